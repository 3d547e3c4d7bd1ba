"""How much light comes through many thin, half-transparent layers: kernels of the deep opacity map.

C. Yuksel, J. Keyser, "Deep opacity maps", Computer Graphics Forum 27(2), 2008: a map seen from the light whose
layers of opacity begin, texel by texel, at the depth where the light first meets something, so that the few
layers follow the surface. Here layer boundary k of 16 lies behind that first depth by

    d(k) = D ((k + a)^4 - a^4) / ((15 + a)^4 - a^4)

(fine where yarns shadow one another, coarse far behind; D the depth of the scene, a such that d(1) is about a
particle's radius), and a particle of opacity alpha that covers the share c of a texel takes the optical depth
-c ln(1 - alpha) there. Departures from the paper: what lies in a layer dims the light from the layer's far side
on and is read one layer late, so that a fibre does not shadow itself; and maps hold the transmittance
exp(-optical depth) at the boundaries, averaged into coarser maps for soft light.

No atomics: a band of rows belongs to one thread, which goes through the particles in their order. The same input
gives the same map for any number of bands.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x1, I32x2, Int, Template
from taichi_cloth.ground.particles import LANES, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import Blocks, Vec16

from ..data.light_sizes import LAYERS
from ..tiles.sort import CHUNK_STEPS, share
from .fibre import decay

__all__ = ["EMPTY", "coarsen", "deposit", "layer_of", "stamp"]

EMPTY = 1e30
"""First depth [m] of a texel that no light is stopped in."""

# Rows of a stamp, a block of particles on the map: u, v [texels], depth [m], optical depth, edge, half height and
# half width of its box [texels], the rows s and t that turn an offset into -1..1. What is laid at points has no edge;
# its place is that of the first point, u and v less 1/2, and it has the steps to the next and the number of points.
U, V, BEHIND, OPTICAL, EDGE, REACH, WIDE, S_X, S_Y, T_X, T_Y = range(11)
POINTS, STEP_U, STEP_V, STEP_BEHIND = REACH, S_X, S_Y, T_X

SMALL = 0.82
"""A particle of smaller radius [texels] is laid at points along its axis, each shared bilinearly between four texels:
a tent varies as much across as a disc of this radius."""

APART = 1.5
"""Distance between points [texels], at most."""

OPAQUEST = 0.97
"""Highest opacity counted: its optical depth, 3.5, is dark enough."""

# Rows of the argument `axes`, three numbers each.
RIGHT, UP, AWAY = 0, 1, 2  # unit axes of the map; away from the light
ORIGIN = 3  # u, v, depth [m] where the map begins
SCALE = 4  # texels per metre, opacity of all, unused


@ti.kernel
def stamp(
    layout: Template,
    chunks: Int,
    stretch: Float,
    particles: Blocks,
    block_count: Int,
    height: Int,
    axes: F32x2,
    # out:
    stamps_out: Blocks,
    spans_out: I32x2,
    rows_out: I32x2,
):
    """Where each particle falls on the map, between which rows of texels a block does, shape (blocks, 2), and how many
    particles there are in each row, chunk by chunk.

    A disc of radius r [texels] is drawn with coverage min(1, e q), q = 1 - s^2 - t^2, of radius
    R = 1/2 + sqrt(1/4 + r^2) and edge e = max(1, R/2), which keeps its area (compare `project._crisp`); of an
    elongated piece only the middle half of its length counts, for pieces of one fibre overlap. What is laid at points
    has the same optical depth in all. Each stands for `stretch` neighbours along the fibre, and is that much longer, or
    denser where it has no length.
    """
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
        for k in range(height):
            rows_out[chunk, k] = 0
        texels = axes[SCALE, 0]
        for b in range(share(block_count, chunk, chunks), share(block_count, chunk + 1, chunks)):
            px = particles[POSITION, b]
            py = particles[POSITION + 1, b]
            pz = particles[POSITION + 2, b]
            size = particles[RADIUS, b]
            u = (px * axes[RIGHT, 0] + py * axes[RIGHT, 1] + pz * axes[RIGHT, 2] - axes[ORIGIN, 0]) * texels
            v = (px * axes[UP, 0] + py * axes[UP, 1] + pz * axes[UP, 2] - axes[ORIGIN, 1]) * texels
            depth = px * axes[AWAY, 0] + py * axes[AWAY, 1] + pz * axes[AWAY, 2] - axes[ORIGIN, 2]
            radius = ti.max(size * texels, 1e-3)
            long = radius
            e_x = Vec16(1.0)
            e_y = Vec16(0.0)
            points = Vec16(1.0)
            step_u = Vec16(0.0)
            step_v = Vec16(0.0)
            step_behind = Vec16(0.0)
            if ti.static(layout.elliptic):
                tx = particles[TANGENT, b]
                ty = particles[TANGENT + 1, b]
                tz = particles[TANGENT + 2, b]
                e_x = tx * axes[RIGHT, 0] + ty * axes[RIGHT, 1] + tz * axes[RIGHT, 2]
                e_y = tx * axes[UP, 0] + ty * axes[UP, 1] + tz * axes[UP, 2]
                flat = ti.min(e_x * e_x + e_y * e_y, 1.0)
                half = stretch * ti.max(0.5 * particles[layout.half_length_row, b] * texels, radius)
                long = ti.sqrt(radius * radius * (1.0 - flat) + half * half * flat)
                points = ti.max(ti.ceil(half * ti.sqrt(flat) * (2.0 / APART)), 1.0)
                gap = 2.0 * half / points
                step_u = e_x * gap
                step_v = e_y * gap
                step_behind = (tx * axes[AWAY, 0] + ty * axes[AWAY, 1] + tz * axes[AWAY, 2]) * gap / texels
                e_x += 1e-6
                unit = 1.0 / ti.sqrt(e_x * e_x + e_y * e_y)
                e_x *= unit
                e_y *= unit
            across = 0.5 + ti.sqrt(0.25 + radius * radius)
            along = 0.5 + ti.sqrt(0.25 + long * long)
            edge = ti.max(0.5 * across, 1.0)
            area = across * along * (1.0 - 0.5 / edge)
            alpha = radius * long / area
            thin = radius < SMALL
            short = long < SMALL  # by its area, as if it were even in a texel
            alpha = ti.select(short, ti.min(3.1416 * radius * long, 0.95), alpha)
            if ti.static(layout.opacity):
                alpha *= ti.min(ti.max(particles[layout.opacity_row, b], 0.0), 1.0)
            else:
                alpha *= axes[SCALE, 1]
            optical = -ti.log(1.0 - ti.min(alpha, ti.static(OPAQUEST)))
            if ti.static(not layout.elliptic):
                optical *= stretch
            half_width = ti.sqrt(along * along * e_x * e_x + across * across * e_y * e_y)
            half_height = ti.sqrt(along * along * e_y * e_y + across * across * e_x * e_x)
            there = size > 0.0
            back = 0.5 * (points - 1.0)
            stamps_out[b, U] = ti.select(thin, u - 0.5 - back * step_u, u)
            stamps_out[b, V] = ti.select(thin, v - 0.5 - back * step_v, v)
            stamps_out[b, BEHIND] = ti.select(thin, depth - back * step_behind, depth)
            stamps_out[b, OPTICAL] = optical * ti.select(thin, ti.select(short, 1.0, 3.1416 * area) / points, 1.0)
            stamps_out[b, EDGE] = ti.select(thin, 0.0, edge)
            stamps_out[b, REACH] = ti.select(there, ti.select(thin, points, half_height), 0.0)
            stamps_out[b, WIDE] = half_width
            stamps_out[b, S_X] = ti.select(thin, step_u, -e_y / across)
            stamps_out[b, S_Y] = ti.select(thin, step_v, e_x / across)
            stamps_out[b, T_X] = ti.select(thin, step_behind, e_x / along)
            stamps_out[b, T_Y] = e_y / along
            reach = ti.max(half_height, 0.5 * points * ti.abs(step_v)) + 2.0
            spans_out[b, 0] = ti.cast(ti.select(there, v - reach, 1e9).min(), ti.i32)
            spans_out[b, 1] = ti.cast(ti.select(there, v + reach, -1e9).max(), ti.i32)
            for lane in ti.static(range(LANES)):
                row = ti.min(ti.max(ti.cast(v[lane], ti.i32), 0), height - 1)
                rows_out[chunk, row] = rows_out[chunk, row] + ti.cast(size[lane] > 0.0, ti.i32)


@ti.func
def layer_of(behind, span, root):
    """The layer coordinate k of a place `behind` metres behind the first depth; span = ((15+a)^4 - a^4) / D."""
    squared = root * root
    return ti.sqrt(ti.sqrt(behind * span + squared * squared)) - root


@ti.func
def _points(turn, stamps: F32x3, b, lane, top, bottom, width, span, root, nearest: F32x1, through: Blocks):
    """What is laid at points, in the rows top to bottom: into the first depths, then into the layers."""
    count = ti.cast(stamps[b, POINTS, lane], ti.i32)
    u = stamps[b, U, lane]
    v = stamps[b, V, lane]
    depth = stamps[b, BEHIND, lane]
    for k in range(count):
        row = ti.cast(v, ti.i32)
        if row >= top - 1 and row <= bottom:
            left = ti.min(ti.max(ti.cast(u, ti.i32), 0), width - 2)
            # Four texels side by side; a row that is not of this band takes nothing.
            one = ti.max(row, top) * width + left
            two = ti.min(row + 1, bottom) * width + left
            if turn == 0:
                first = depth if row >= top else EMPTY
                second = depth if row < bottom else EMPTY
                nearest[one] = ti.min(nearest[one], first)
                nearest[one + 1] = ti.min(nearest[one + 1], first)
                nearest[two] = ti.min(nearest[two], second)
                nearest[two + 1] = ti.min(nearest[two + 1], second)
            else:
                near = ti.Vector([nearest[one], nearest[one + 1], nearest[two], nearest[two + 1]])
                layer = _layer(depth, near, span, root)
                optical = stamps[b, OPTICAL, lane]
                g = v - row
                second = optical * g if row < bottom else 0.0
                first = optical - optical * g if row >= top else 0.0
                f = u - left
                through[one, 0][layer[0]] += first - first * f
                through[one + 1, 0][layer[1]] += first * f
                through[two, 0][layer[2]] += second - second * f
                through[two + 1, 0][layer[3]] += second * f
        if k + 1 < count:
            u += stamps[b, STEP_U, lane]
            v += stamps[b, STEP_V, lane]
            depth += stamps[b, STEP_BEHIND, lane]


@ti.func
def _layer(depth, nearest, span, root):
    """The layer that a place `depth` [m] deep dims: it lies in the one before."""
    k = layer_of(ti.max(depth - nearest, 0.0), span, root)
    return ti.min(ti.cast(k, ti.i32) + 1, ti.static(LAYERS - 1))


@ti.func
def _disc(turn, stamps: F32x3, b, lane, top, bottom, width, span, root, nearest: F32x1, through: Blocks):
    """What covers more than four texels, in the rows top to bottom: into the first depths, then into the layers."""
    u = stamps[b, U, lane]
    v = stamps[b, V, lane]
    depth = stamps[b, BEHIND, lane]
    reach = stamps[b, REACH, lane]
    wide = stamps[b, WIDE, lane]
    left = ti.max(ti.cast(ti.ceil(u - wide - 0.5), ti.i32), 0)
    right = ti.min(ti.cast(ti.floor(u + wide - 0.5), ti.i32), width - 1)
    first = ti.max(ti.cast(ti.ceil(v - reach - 0.5), ti.i32), top)
    last = ti.min(ti.cast(ti.floor(v + reach - 0.5), ti.i32), bottom)
    for y in range(first, last + 1):
        dy = y + 0.5 - v
        for x in range(left, right + 1):
            dx = x + 0.5 - u
            s = dx * stamps[b, S_X, lane] + dy * stamps[b, S_Y, lane]
            t = dx * stamps[b, T_X, lane] + dy * stamps[b, T_Y, lane]
            q = 1.0 - s * s - t * t
            if q > 0.0:
                cell = y * width + x
                if turn == 0:
                    nearest[cell] = ti.min(nearest[cell], depth)
                else:
                    layer = _layer(depth, nearest[cell], span, root)
                    through[cell, 0][layer] += stamps[b, OPTICAL, lane] * ti.min(q * stamps[b, EDGE, lane], 1.0)


@ti.kernel
def deposit(
    bands: Int,
    walled: Template,
    block_count: Int,
    stamps: F32x3,
    spans: I32x2,
    cuts: I32x1,
    width: Int,
    span: Float,
    root: Float,
    wall: F32x1,
    # out: first depths; optical depths, of which transmittances are made in place
    nearest_out: F32x1,
    through_out: Blocks,
):
    """The map: first depth and the transmittance at every layer boundary, shape (texels,) and (texels, 1, 16).

    cuts: band b has the rows cuts[b] to cuts[b + 1]. wall: first depth of what lets nothing through, EMPTY where
    there is none, shape (texels,).
    """
    for step in range(bands * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        band = step // CHUNK_STEPS
        top = cuts[band]
        bottom = cuts[band + 1] - 1
        for cell in range(top * width, (bottom + 1) * width):
            nearest_out[cell] = wall[cell] if ti.static(walled) else EMPTY
        for turn in range(2):
            for b in range(block_count):
                if spans[b, 0] <= bottom and spans[b, 1] >= top:
                    for lane in range(LANES):
                        if stamps[b, EDGE, lane] == 0.0:
                            _points(turn, stamps, b, lane, top, bottom, width, span, root, nearest_out, through_out)
                        else:
                            _disc(turn, stamps, b, lane, top, bottom, width, span, root, nearest_out, through_out)
            if turn == 0:
                for cell in range(top * width, (bottom + 1) * width):
                    if nearest_out[cell] < EMPTY:
                        through_out[cell, 0] = Vec16(0.0)
        for cell in range(top * width, (bottom + 1) * width):
            if nearest_out[cell] < EMPTY:
                row = through_out[cell, 0]
                total = 0.0
                for k in ti.static(range(LAYERS)):
                    total += row[k]
                    row[k] = total
                passing = decay(row)
                if ti.static(walled):
                    a = root * root
                    a *= a
                    for k in ti.static(range(LAYERS)):
                        up = (k + root) * (k + root)
                        if nearest_out[cell] + (up * up - a) / span >= wall[cell]:
                            passing[k] = 0.0
                through_out[cell, 0] = passing


@ti.kernel
def coarsen(
    first: Int,
    width: Int,
    coarse_first: Int,
    coarse_width: Int,
    coarse_height: Int,
    span: Float,
    root: Float,
    # in and out: all levels one after another
    nearest: F32x1,
    through: F32x2,
):
    """A map of half the resolution from the one before: mean transmittance of four texels at equal depths."""
    for cell in range(coarse_width * coarse_height):
        x = cell % coarse_width
        y = cell // coarse_width
        corner = first + 2 * y * width + 2 * x
        near = EMPTY
        for child in ti.static(range(4)):
            near = ti.min(near, nearest[corner + (child // 2) * width + child % 2])
        nearest[coarse_first + cell] = near
        if near < EMPTY:
            a = root * root
            a *= a
            for k in range(LAYERS):
                up = k + root
                up *= up
                boundary = near + (up * up - a) / span
                total = 0.0
                for child in ti.static(range(4)):
                    source = corner + (child // 2) * width + child % 2
                    behind = boundary - nearest[source]
                    value = 1.0
                    if behind > 0.0:
                        at = layer_of(behind, span, root)
                        low = ti.min(ti.cast(at, ti.i32), ti.static(LAYERS - 2))
                        part = ti.min(at - low, 1.0)
                        value = through[source, low] + part * (through[source, low + 1] - through[source, low])
                    total += 0.25 * value
                through[coarse_first + cell, k] = total
