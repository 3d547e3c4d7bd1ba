"""The sky seen through particles: kernels of the maps that ambient occlusion reads (see `occlusion`).

A map looks along one direction and answers for both of its ends. Layers are laid between the first and the last
depth of each texel, fine near both: with f behind the first, g before the last and a length h

    k = 16 w(f) / (w(f) + w(g)),   w(d) = d / (d + h)

is even through a thin cloth and fine at both of its walls where the map looks through a whole garment. A piece of
fibre of area A and opacity a takes the optical depth DENSITY a A / texel^2, laid at points along its axis and shared
bilinearly between four texels. A direction belongs to one thread.
"""

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x2, F32x3, Float, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import CHUNK_STEPS, Blocks, Octets, Vec16, each, lanes

from ..data.light_sizes import LAYERS
from ..tiles.compiling import left_to_llvm
from ..tiles.sort import share
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP, deepen, laid, lift, lower

__all__ = ["coordinate", "fill"]

DENSITY = 1.6
"""Optical depth of a texel covered once by an opaque fibre: spread evenly, as a fibre that covers its middle is."""

MOST_POINTS = 12.0
APART = 2.0
"""Distance between the points of a fibre [texels]."""


@ti.func
def coordinate(f, g, h):
    """Layer coordinate 0..16."""
    front = f * (g + h)
    return ti.min(16.0 * front / (front + g * (f + h) + 1e-30), 16.0)


@ti.func
def _place(layout: Template, stretch, particles: Octets, b, axes: F32x3, m, placed: Octets, out):
    """Eight particles on map m, as row `out` of the scratch: its place, its points, and the optical depth of each."""
    texels = axes[m, SCALE, 0]
    px = particles[POSITION, b]
    py = particles[POSITION + 1, b]
    pz = particles[POSITION + 2, b]
    size = particles[RADIUS, b] * texels
    u = px * axes[m, RIGHT, 0] + py * axes[m, RIGHT, 1] + pz * axes[m, RIGHT, 2] - axes[m, ORIGIN, 0]
    v = px * axes[m, UP, 0] + py * axes[m, UP, 1] + pz * axes[m, UP, 2] - axes[m, ORIGIN, 1]
    placed[out, 0] = u * texels - 0.5
    placed[out, 1] = v * texels - 0.5
    placed[out, 2] = px * axes[m, AWAY, 0] + py * axes[m, AWAY, 1] + pz * axes[m, AWAY, 2] - axes[m, ORIGIN, 2]
    optical = size * size * (3.1416 * DENSITY * stretch)
    if ti.static(layout.elliptic):
        tx = particles[TANGENT, b]
        ty = particles[TANGENT + 1, b]
        tz = particles[TANGENT + 2, b]
        half = 0.5 * stretch * particles[layout.half_length_row, b]
        e_x = (tx * axes[m, RIGHT, 0] + ty * axes[m, RIGHT, 1] + tz * axes[m, RIGHT, 2]) * half
        e_y = (tx * axes[m, UP, 0] + ty * axes[m, UP, 1] + tz * axes[m, UP, 2]) * half
        e_z = (tx * axes[m, AWAY, 0] + ty * axes[m, AWAY, 1] + tz * axes[m, AWAY, 2]) * half
        long = ti.sqrt(e_x * e_x + e_y * e_y) * texels
        points = ti.min(ti.max(ti.floor(long * (2.0 / APART) + 1.0), 1.0), MOST_POINTS)
        spacing = 2.0 / points
        placed[out, 4] = e_x * texels * spacing
        placed[out, 5] = e_y * texels * spacing
        placed[out, 6] = e_z * spacing
        placed[out, 7] = points
        optical = size * ti.sqrt(size * size + long * long) * (3.1416 * DENSITY) / points
    if ti.static(layout.opacity):
        optical *= ti.min(ti.max(particles[layout.opacity_row, b], 0.0), 1.0)
    else:
        optical *= axes[m, SCALE, 1]
    placed[out, 3] = optical


@ti.func
def _lay(
    layout: Template, turn: Template, placed: Octets, t, maps: I32x2, m, fine, ends: F32x2, depth_out: Blocks,
    counts: I32x2,
):  # fmt: skip
    """The particles at once from t on, point by point: into the first and last depths, then into the layers between
    them. What is reckoned is a loop over lanes without branches, which becomes one of vectors."""
    begin, width, high = maps[m, 0], maps[m, 1], maps[m, 2]
    u, v, depth, optical = _placed(placed, 0, t), _placed(placed, 1, t), _placed(placed, 2, t), _placed(placed, 3, t)
    on_u, on_v, on_depth, points = each(0.0), each(0.0), each(0.0), each(1.0)
    if ti.static(layout.elliptic):
        on_u, on_v, on_depth = _placed(placed, 4, t), _placed(placed, 5, t), _placed(placed, 6, t)
        points = _placed(placed, 7, t)
    points *= ti.cast(optical > 0.0, ti.f32)
    back = 0.5 * (points - 1.0)
    u -= back * on_u
    v -= back * on_v
    depth -= back * on_depth
    cell = ti.cast(each(0.0), ti.i32)
    layer = ti.Matrix([[0 for _ in range(ti.static(lanes()))] for _ in range(4)])
    amount = ti.Matrix([[0.0 for _ in range(ti.static(lanes()))] for _ in range(4)])
    for p in range(ti.cast(points.max(), ti.i32)):  # pyright: ignore[reportArgumentType]
        for i in range(ti.static(lanes())):
            left = ti.min(ti.max(ti.cast(u[i], ti.i32), 0), width - 2)
            top = ti.min(ti.max(ti.cast(v[i], ti.i32), 0), high - 2)
            cell[i] = begin + top * width + left  # pyright: ignore[reportIndexIssue]
            if ti.static(turn == 1):
                f, g = u[i] - left, v[i] - top
                for j in ti.static(range(4)):
                    c = cell[i] + j // 2 * width + j % 2  # pyright: ignore[reportIndexIssue]
                    part = (f if ti.static(j % 2 == 1) else 1.0 - f) * (g if ti.static(j // 2 == 1) else 1.0 - g)
                    k = coordinate(depth[i] - ends[0, c], ends[1, c] - depth[i], fine)
                    layer[j, i] = ti.min(ti.cast(k, ti.i32), LAYERS - 1)
                    amount[j, i] = optical[i] * part
        for i in range(ti.static(lanes())):
            if p < points[i]:
                for j in ti.static(range(4)):
                    c = cell[i] + j // 2 * width + j % 2  # pyright: ignore[reportIndexIssue]
                    if ti.static(turn == 0):
                        lower(ends, (0, c), depth[i])
                        lift(ends, (1, c), depth[i])
                    else:
                        deepen(depth_out, counts, c, layer[j, i], amount[j, i])
        u += on_u
        v += on_v
        depth += on_depth


@ti.func
def _placed(placed: Octets, row, t):
    """What `_place` wrote of the particles at once from t on."""
    if ti.static(lanes() == OCTET):
        return placed[t, row]
    else:
        return ti.Vector([placed[t // OCTET, row][t % OCTET]])


@left_to_llvm
@ti.kernel
def fill(
    layout: Template,
    chunks: Int,
    stretch: Float,
    particles: Octets,
    octet_count: Int,
    axes: F32x3,
    maps: I32x2,
    fine: Float,
    # scratch of a chunk:
    placed: Octets,
    # out, all maps one after another:
    ends_out: F32x2,
    depth_out: Blocks,
    counts: I32x2,
):
    """First and last depth [m] and optical depth up to the end of each layer, shape (2, texels), (texels, 1, 16).

    axes: (maps, 5, 3) as in `deep_map`; maps: rows (first texel, width, height). stretch: each piece stands
    for so many, and is that much longer. counts: zeros (texels, 16), see `deepen`.
    """
    if ti.static(runtime.resident()):
        for cell in range(ends_out.shape[1]):
            ends_out[0, cell] = EMPTY
            ends_out[1, cell] = -EMPTY
        for t in range(maps.shape[0] * octet_count):
            _place(layout, stretch, particles, t % octet_count, axes, t // octet_count, placed, t)
        for turn in ti.static(range(2)):
            for t in range(maps.shape[0] * octet_count * OCTET):
                m = t // OCTET // octet_count
                _lay(layout, turn, placed, t, maps, m, fine, ends_out, depth_out, counts)
        for cell in range(ends_out.shape[1]):
            if ends_out[0, cell] < EMPTY:
                _sum_up(cell, depth_out, counts)
    else:
        for step in range(chunks * CHUNK_STEPS):
            if step % CHUNK_STEPS != 0:
                continue
            chunk = step // CHUNK_STEPS
            at = chunk * octet_count
            for m in range(share(maps.shape[0], chunk, chunks), share(maps.shape[0], chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
                begin = maps[m, 0]
                width = maps[m, 1]
                high = maps[m, 2]
                for b in range(octet_count):
                    _place(layout, stretch, particles, b, axes, m, placed, at + b)
                for cell in range(begin, begin + width * high):
                    ends_out[0, cell] = EMPTY
                    ends_out[1, cell] = -EMPTY
                # First where anything stands, then what each layer takes of the light; at last summed front to back.
                for turn in ti.static(range(2)):
                    for b in range(octet_count * ti.static(OCTET // lanes())):
                        t = at * ti.static(OCTET // lanes()) + b
                        _lay(layout, turn, placed, t, maps, m, fine, ends_out, depth_out, counts)
                    for cell in range(begin, begin + width * high):
                        if ends_out[0, cell] < EMPTY:
                            if ti.static(turn == 0):
                                depth_out[cell, 0] = Vec16(0.0)
                            else:
                                _sum_up(cell, depth_out, counts)


@ti.func
def _sum_up(cell, depth_out: Blocks, counts: I32x2):
    """Optical depths of a texel up to the end of each layer."""
    row = laid(depth_out, counts, cell)
    total = 0.0
    for k in ti.static(range(LAYERS)):
        total += row[k]
        row[k] = total
    depth_out[cell, 0] = row
