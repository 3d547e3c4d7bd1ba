"""Where each particle falls on the map of a light, and how much of it it covers: see `transmittance`."""

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, Float, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import CHUNK_STEPS, Octets, Vec8

from ..tiles.sort import share
from .deep_map import AWAY, ORIGIN, RIGHT, SCALE, UP

__all__ = ["stamp"]

# Rows of a stamp, eight particles on the map: u, v [texels], depth [m], optical depth, edge, half height and
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


@ti.kernel
def stamp(
    layout: Template,
    chunks: Int,
    stretch: Float,
    particles: Octets,
    octet_count: Int,
    height: Int,
    axes: F32x2,
    # out:
    stamps_out: Octets,
    spans_out: I32x2,
    rows_out: I32x2,
):
    """Where each particle falls on the map, between which rows of texels eight do, shape (octets, 2), and how many
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
        for b in range(share(octet_count, chunk, chunks), share(octet_count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            # Where it is on the map.
            px = particles[POSITION, b]
            py = particles[POSITION + 1, b]
            pz = particles[POSITION + 2, b]
            size = particles[RADIUS, b]
            u = (px * axes[RIGHT, 0] + py * axes[RIGHT, 1] + pz * axes[RIGHT, 2] - axes[ORIGIN, 0]) * texels
            v = (px * axes[UP, 0] + py * axes[UP, 1] + pz * axes[UP, 2] - axes[ORIGIN, 1]) * texels
            depth = px * axes[AWAY, 0] + py * axes[AWAY, 1] + pz * axes[AWAY, 2] - axes[ORIGIN, 2]
            # Its outline there, and the points that it is laid at where it is thin.
            radius = ti.max(size * texels, 1e-3)
            long = radius
            e_x = Vec8(1.0)
            e_y = Vec8(0.0)
            points = Vec8(1.0)
            step_u = Vec8(0.0)
            step_v = Vec8(0.0)
            step_behind = Vec8(0.0)
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
            # What it stops of the light.
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
            # Its box, and the rows of texels that the eight reach.
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
            spans_out[b, 0] = ti.cast(ti.select(there, v - reach, 1e9).min(), ti.i32)  # pyright: ignore[reportOptionalCall]
            spans_out[b, 1] = ti.cast(ti.select(there, v + reach, -1e9).max(), ti.i32)  # pyright: ignore[reportOptionalCall]
            for lane in range(OCTET):
                row = ti.min(ti.max(ti.cast(v[lane], ti.i32), 0), height - 1)
                rows_out[chunk, row] = rows_out[chunk, row] + ti.cast(size[lane] > 0.0, ti.i32)
