"""From particles to splats: where each lands on the image, how large, how bright, and its depth key.

Numbers of one splat, `splats[i]` float32 (see `Layout.splat_size`):
    round      x, y [px], alpha, red, green, blue, reach [px], 1 / reach^2, or the sprite's number if textured
    elliptic   x, y [px], alpha, red, green, blue, half height of its box [px],
               the rows s and t that turn an offset [px] into -1..1 across and along the fibre (2 each),
               the slope of brightness across, the edge (see `sprites`), the sprite's number or half the box's width,
               and for crisp splats the roundness m and the edge along the fibre (see `_thread`)
"""

# In kernels a name stands for a Taichi expression, which type checkers do not know to be a vector.
# pyright: reportIndexIssue=false

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, I32x1, I32x2, I64x1, Int, Template
from taichi_cloth.ground.particles import LANES, NORMAL, OCTET, POSITION, RADIUS, TANGENT, TILE
from taichi_cloth.ground.vectors import CHUNK_STEPS, Octets, each, lanes, of_group

from ..light.shade import shade
from ..light.view import COAT, DEPTH, EDGE, IMAGE, LENS, SURFACE, TRANSLATION
from ..tiles.compiling import left_to_llvm
from ..tiles.sort import BINS, DEEPEST_KEY, share

__all__ = ["project"]

BLUR = 0.91
"""Variance [px^2] by which a soft splat is widened, so that its energy does not depend on where it falls
between the pixels: measured, the deviation stays below 0.07 at all sizes."""

INWARD = 0.55
"""How far thin pieces are drawn towards the axis of their yarn, of what they are too wide: found on a plain weave, a
twill and a yarn, which cover within 0.02 as much at 400 x 400 pixels as at 4 x 4 times as many."""

LARGEST = 1e8
"""Largest radius [px]; a larger one fills the image all the same."""


@ti.func
def _soft(radius):
    """Drawn radius and opacity of a soft splat, r^2 + BLUR; the opacity falls as the area grows."""
    squared = radius * radius
    reach = ti.sqrt(squared + BLUR)
    return reach, squared / (squared + BLUR)


@ti.func
def _crisp(radius):
    """Drawn radius, opacity and edge of a splat that covers the area pi r^2 with a rim one pixel wide.

    With alpha = min(1, edge q)^2 the coverage is pi R^2 (1 - 2 / (3 edge)). Solved for R with edge = R / 2 it
    is r^2 at R = 2/3 + sqrt(4/9 + r^2). Below R = 2 the edge stays 1 and the opacity falls instead; the first
    root meets the second at R = 2 and is `BLUR` wide at r = 0.
    """
    squared = radius * radius
    faint = (3.0 - 0.75 * BLUR) * squared + BLUR
    reach = ti.min(ti.sqrt(faint), 2.0 / 3.0 + ti.sqrt(4.0 / 9.0 + squared))
    return reach, ti.min(3.0 * squared / faint, 1.0), ti.max(0.5 * reach, 1.0)


@ti.func
def _thread(radius, half_length, endwise):
    """A crisp piece of a thread: drawn radius, half length, opacity, edge across, edge along.

        alpha = (min(1, edge (1 - s^2 - m t^2)) min(1, edge_along (1 - t^2)))^2

    s is -1..1 across, t along. A long piece (m = 0, edge along 1) has a rim one pixel wide at its sides and
    fades along the fibre, so that a chain of them reads as one smooth thread; one seen end-on (m = endwise = 1)
    is a disc.
    As in `_crisp`, the energy of a long piece does not depend on its size: across, the integral of alpha is
    2 r at R = 2/3 + sqrt(0.64 + r^2) (within 0.5 %), and below R = 2 the opacity falls instead.
    """
    squared = radius * radius
    faint = ti.sqrt(squared * ((4.0 - BLUR) * (225.0 / 256.0)) + BLUR)
    reach = ti.min(faint, 2.0 / 3.0 + ti.sqrt(0.64 + squared))
    long = ti.sqrt(half_length * half_length + (reach * reach - squared))
    alpha = ti.min(1.875 * radius / faint, 1.0) * (half_length / long) * (1.0 + 0.6 * endwise)
    return reach, long, ti.min(alpha, 1.0), ti.max(0.5 * reach, 1.0), 1.0 / (1.001 - endwise)


@ti.func
def _piece(layout: Template, crisp: Template, particles: Octets, view: F32x2, b, scale, u, v, radius, thin, soft_edge):
    """The outline of an elongated piece on the image: drawn half width, opacity, edge, half width and height of its box
    [px], the rows s and t (2 each), how far it is seen end-on, its edge along the fibre.

    scale: pixels per metre there. u, v: its place at a depth of 1. thin, soft_edge: half width and edge if not crisp.
    """
    reach = thin
    edge = soft_edge
    alpha = thin
    endwise = thin
    edge_along = thin
    half_width = thin
    half_height = thin
    # The tangent on the image, in units of the scale: the ellipsoid's outline under the local
    # affine projection J is the ellipse of covariance r^2 I + (h^2 - r^2) (J t)(J t)^T.
    tx = of_group(particles, TANGENT, b)
    ty = of_group(particles, TANGENT + 1, b)
    tz = of_group(particles, TANGENT + 2, b)
    along_z = tx * view[2, 0] + ty * view[2, 1] + tz * view[2, 2]
    e_x = tx * view[0, 0] + ty * view[0, 1] + tz * view[0, 2] - u * along_z
    e_y = tx * view[1, 0] + ty * view[1, 1] + tz * view[1, 2] - v * along_z
    flat = ti.min(e_x * e_x + e_y * e_y, 1.0)
    e_x += 1e-6  # a fibre seen end-on is round: any direction will do
    unit_e = 1.0 / ti.sqrt(e_x * e_x + e_y * e_y)
    e_x *= unit_e
    e_y *= unit_e
    long = ti.min(ti.max(of_group(particles, layout.half_length_row, b) * scale, 1e-6), LARGEST)
    slim = long / radius
    long = ti.sqrt(radius * radius * (1.0 - flat) + long * long * flat)
    if ti.static(crisp):
        endwise = ti.max(1.0 - flat * (3.0 + slim * slim / 3.0), 0.0)
        reach, long, alpha, edge, edge_along = _thread(radius, long, endwise)
    else:
        major = long
        long = ti.sqrt(major * major + BLUR)
        alpha = (major * radius) / (long * reach)
    if ti.static(crisp or layout.textured):  # the square of s and t
        half_width = long * ti.abs(e_x) + reach * ti.abs(e_y)
        half_height = long * ti.abs(e_y) + reach * ti.abs(e_x)
    else:  # the ellipse in it
        half_width = ti.sqrt((long * e_x) * (long * e_x) + (reach * e_y) * (reach * e_y))
        half_height = ti.sqrt((long * e_y) * (long * e_y) + (reach * e_x) * (reach * e_x))
    s_x = -e_y / reach
    s_y = e_x / reach
    t_x = e_x / long
    t_y = e_y / long
    return reach, alpha, edge, half_width, half_height, s_x, s_y, t_x, t_y, endwise, edge_along


@ti.func
def _slope(particles: Octets, view: F32x2, b, vx, vy, vz, sin_v, from_x, from_y, from_z):
    """How brightness changes across a thread: (t x v) . l of each light, of which (-e_y, e_x) is the direction on the
    image."""
    tx = of_group(particles, TANGENT, b)
    ty = of_group(particles, TANGENT + 1, b)
    tz = of_group(particles, TANGENT + 2, b)
    across = (ty * vz - tz * vy) * from_x
    across += (tz * vx - tx * vz) * from_y
    across += (tx * vy - ty * vx) * from_z
    slope = across / ti.max(sin_v, 1e-3) * view[SURFACE, 2]
    return ti.min(ti.max(slope, -1.0), 1.0)


@ti.func
def _even(crisp: Template, edge, endwise, curve, red, green, blue):
    """Its colour, over the mean brightness of a piece that is shaded by 1 + curve (1/4 - s^2) across. The mean of s^2
    over its alpha hangs on how blunt it is: 1/7 for a long piece of edge 1 and nearly 1/3 for a sharp one, 1/8 and 1/4
    for a disc. So a thread is no brighter the fewer pixels it has. Error of the mean of s^2: 0.005."""
    blunt = 1.0 / edge
    mean = 0.25 + blunt * (0.0625 * blunt - 0.1875)
    if ti.static(crisp):
        long = 0.3354 + blunt * (0.0448 * blunt - 0.2427)
        mean = long + endwise * (mean - long)
    even = 1.0 / (1.0 + curve * (0.25 - mean))
    return even * red, even * green, even * blue


@ti.func
def _drawn_in(layout: Template, particles: Octets, view: F32x2, b, x, y, wider):
    """Where a faint piece is drawn that is so much wider [px] than it is opaque: moved along its normal towards the
    axis of its yarn. Many faint pieces one behind the other are opaque as far as they reach, so that a yarn of them
    would be wider the fewer pixels it has. A piece that is as wide as long is none of a yarn, and stays."""
    nx = of_group(particles, NORMAL, b)
    ny = of_group(particles, NORMAL + 1, b)
    nz = of_group(particles, NORMAL + 2, b)
    slim = of_group(particles, layout.half_length_row, b) / ti.max(of_group(particles, RADIUS, b), 1e-12)
    inward = INWARD * wider * ti.min(ti.max(slim - 1.0, 0.0), 1.0)
    x -= inward * (nx * view[0, 0] + ny * view[0, 1] + nz * view[0, 2])
    y -= inward * (nx * view[1, 0] + ny * view[1, 1] + nz * view[1, 2])
    return x, y


@ti.func
def _tiles(left, right, top, bottom):
    """First and last tile column and row of the pixels from left to right and top to bottom, 16 bits each."""
    box = ti.cast(ti.cast(left, ti.i32) // TILE, ti.i64)
    box |= ti.cast(ti.cast(right, ti.i32) // TILE, ti.i64) << 16
    box |= ti.cast(ti.cast(top, ti.i32) // TILE, ti.i64) << 32
    return box | (ti.cast(ti.cast(bottom, ti.i32) // TILE, ti.i64) << 48)


@ti.func
def _splats(
    layout: Template,
    shading: Template,
    crisp: Template,
    particles: Octets,
    light: Octets,
    view: F32x2,
    b,
    chunk,
    splats_out: F32x2,
    boxes_out: I64x1,
    keys_out: I32x1,
    histogram_out: I32x2,
):
    """Those of the particles at once from b on."""
    focal, width, height, near = view[LENS, 0], view[IMAGE, 0], view[IMAGE, 1], view[IMAGE, 2]
    # Where it is: camera axes [m], then pixels.
    px = of_group(particles, POSITION, b)
    py = of_group(particles, POSITION + 1, b)
    pz = of_group(particles, POSITION + 2, b)
    z = px * view[2, 0] + py * view[2, 1] + pz * view[2, 2] + view[TRANSLATION, 2]
    scale = 1.0 / ti.max(z, near)
    u = (px * view[0, 0] + py * view[0, 1] + pz * view[0, 2] + view[TRANSLATION, 0]) * scale
    v = (px * view[1, 0] + py * view[1, 1] + pz * view[1, 2] + view[TRANSLATION, 1]) * scale
    x = u * focal + view[LENS, 1]
    y = v * focal + view[LENS, 2]
    scale *= focal
    size = of_group(particles, RADIUS, b)
    radius = ti.min(ti.max(size * scale, 1e-6), LARGEST)

    red, green, blue, vx, vy, vz, sin_v, from_x, from_y, from_z = shade(layout, shading, particles, light, view, b)

    # How far it reaches on the image.
    reach = radius
    alpha = radius
    edge = radius
    if ti.static(crisp):
        reach, alpha, edge = _crisp(radius)
    else:
        reach, alpha = _soft(radius)
        edge = each(view[EDGE, 0])
    half_width, half_height = reach, reach
    # Of an elongated piece its outline; the others only need the names to be there.
    s_x, s_y, t_x, t_y = reach, reach, reach, reach
    slope, endwise, edge_along = reach, reach, reach
    if ti.static(layout.elliptic):
        reach, alpha, edge, half_width, half_height, s_x, s_y, t_x, t_y, endwise, edge_along = _piece(
            layout, crisp, particles, view, b, scale, u, v, radius, reach, edge
        )
        slope = _slope(particles, view, b, vx, vy, vz, sin_v, from_x, from_y, from_z)
        if ti.static(not layout.textured):
            x, y = _drawn_in(layout, particles, view, b, x, y, ti.max(reach - 1.875 * radius, 0.0))
            red, green, blue = _even(crisp, edge, endwise, view[COAT, 2], red, green, blue)
    if ti.static(layout.opacity):
        alpha *= ti.min(ti.max(of_group(particles, layout.opacity_row, b), 0.0), 1.0)
    else:
        alpha *= view[DEPTH, 2]

    # Pixels whose centre it touches, as float: casting to int truncates.
    left = ti.max(x - half_width + 0.5, 0.0)
    right = ti.min(x + half_width - 0.5, width - 1.0)
    top = ti.max(y - half_height + 0.5, 0.0)
    bottom = ti.min(y + half_height - 0.5, height - 1.0)
    room = ti.min(ti.min(width - left, height - top), ti.min(z - near, size))
    end = ti.min(right, bottom)
    depth = (z - view[DEPTH, 0]) * view[DEPTH, 1]
    for lane in range(ti.static(lanes())):
        i = b * ti.static(lanes()) + lane
        key = -1
        if room[lane] > 0.0 and end[lane] >= 0.0:
            # Seen: its key, and the numbers that `raster` reads.
            key = ti.cast(ti.min(ti.max(depth[lane], 0.0), ti.static(float(DEEPEST_KEY))), ti.i32)
            if ti.static(lanes() == OCTET):  # on a device they are counted afterwards
                low = key & (BINS - 1)
                histogram_out[chunk, low] = histogram_out[chunk, low] + 1
            splats_out[i, 0] = x[lane]
            splats_out[i, 1] = y[lane]
            splats_out[i, 2] = alpha[lane]
            splats_out[i, 3] = red[lane]
            splats_out[i, 4] = green[lane]
            splats_out[i, 5] = blue[lane]
            if ti.static(layout.elliptic):
                splats_out[i, 6] = half_height[lane]
                splats_out[i, 7] = s_x[lane]
                splats_out[i, 8] = s_y[lane]
                splats_out[i, 9] = t_x[lane]
                splats_out[i, 10] = t_y[lane]
                splats_out[i, 11] = slope[lane]
                splats_out[i, 12] = edge[lane]
                if ti.static(layout.textured):
                    splats_out[i, 13] = of_group(particles, layout.sprite_row, b)[lane]
                else:
                    splats_out[i, 13] = half_width[lane]
                if ti.static(crisp):
                    splats_out[i, 14] = endwise[lane]
                    splats_out[i, 15] = edge_along[lane]
            else:
                splats_out[i, 6] = reach[lane]
                if ti.static(layout.textured):
                    splats_out[i, 7] = of_group(particles, layout.sprite_row, b)[lane]
                else:
                    splats_out[i, 7] = 1.0 / (reach[lane] * reach[lane])
            boxes_out[i] = _tiles(left[lane], right[lane], top[lane], bottom[lane])
        keys_out[i] = key


@left_to_llvm
@ti.kernel
def project(
    layout: Template,
    shading: Template,
    crisp: Template,
    chunks: Int,
    # particles:
    particles: Octets,
    block_count: Int,
    # light that reaches the particles, (blocks, shading.rows, 16); the view, see `light.view`:
    light: Octets,
    view: F32x2,
    # out:
    splats_out: F32x2,
    boxes_out: I64x1,
    keys_out: I32x1,
    histogram_out: I32x2,
):
    """Project, shade and key every particle, and on a CPU count the low 11 bits of the keys, chunk by chunk.

    A particle that is not in the image gets the key -1. boxes_out: the first and last tile column and row that
    the splat touches, 16 bits each from the lowest.
    """
    if ti.static(lanes() == 1):
        for b in range(block_count * LANES):
            _splats(
                layout, shading, crisp, particles, light, view, b, 0, splats_out, boxes_out, keys_out,
                histogram_out,
            )  # fmt: skip
    else:
        for step in range(chunks * CHUNK_STEPS):
            if step % CHUNK_STEPS != 0:
                continue
            chunk = step // CHUNK_STEPS
            for k in range(BINS):
                histogram_out[chunk, k] = 0
            for b in range(2 * share(block_count, chunk, chunks), 2 * share(block_count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
                _splats(
                    layout, shading, crisp, particles, light, view, b, chunk, splats_out, boxes_out, keys_out,
                    histogram_out,
                )  # fmt: skip
