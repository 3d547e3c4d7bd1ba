"""Pieces of real fibres, and the points on their surface: what `refine` is made of.

`split` lays blocks with every drawn fibre as several real ones, in pieces; `place` finds where each piece is on the
image and how many points its surface needs there; `surface` makes them.
"""

from math import pi

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.detail.view import View, seen_at, tiles_of
from taichi_cloth.fabric.laying import FabricPack, block_ends, block_widths, lay_particle, row
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I16x2, I32x1, I32x2, Int
from taichi_cloth.ground.particles import (
    COLOUR,
    HALF_LENGTH,
    LANES,
    NORMAL,
    OPENNESS,
    POSITION,
    RADIUS,
    ROWS,
    TANGENT,
)
from taichi_cloth.ground.vectors import leant
from taichi_cloth.yarn.places import hashed
from taichi_cloth.yarn.unevenness import MOST_HASHED

__all__ = [
    "AFTER", "BEFORE", "BEYOND", "COVERED", "FAMILY", "MEETS", "PARTED", "PERIOD", "PLACE", "SKINNED", "SURFACE",
    "THREAD", "TURN", "WIDTH", "place", "reach_of", "split", "surface",
]  # fmt: skip

SURFACE = (7.0, 16.0)
"""Radius of a real fibre [px] at which its surface begins to show, and at which it has all its relief."""
COVERED = (21.0, 26.0)
"""Radius [px] at which points on its surface cover a fibre, and at which nothing is left of the splats under them."""
SPACING = 2.0
"""Distance between points on a fibre's surface [px]."""
GROWN = 30.0
"""The real fibres beside the first have their full radius when they have parted this many times less than wholly."""
LONG = 1.6
"""Half length of a piece whose fibres have not parted, in its radii, at least: a chain of pieces that are shorter than
wide lets light past that one of longer ones does not, as each is fainter (`render.splat.project`)."""
PLACE, PERIOD, TURN, SKINNED, PARTED, BEFORE, AFTER, THREAD, FAMILY, MEETS, BEYOND = range(ROWS, ROWS + 11)
"""Numbers of a piece after those of a particle's record: its place along its skin's period, the period [m], the skin's
turn [rad], whether it has one, how far it has parted, how far before and after it its neighbours on the fibre stand in
the list, 0 at a block's end, its thread, whether that is warp (0) or weft (1), whether the fibre is known to go on in
the next block, and where its piece there stands and which way it looks (6)."""
WIDTH = ROWS + 16
"""Numbers of a piece."""
AROUND = 2.2
"""Radii from a piece's axis within which all of it lies."""
ARC = 220.0 / 180.0 * pi
"""How much of a fibre's circumference gets points: the side towards the camera, and a little more."""


@ti.func
def _hash(a, b):
    """Even in 0..1 from two whole numbers."""
    return ti.cast(hashed(a, b), ti.f32) / ti.static(MOST_HASHED)


@ti.kernel
def split(
    chunks: Int,
    chosen: I32x1,
    starts: I32x1,
    parted: F32x1,
    gain: F32x1,
    fabric: FabricPack,
    core: I32x1,
    steps: I32x1,
    each: I32x1,
    usual: Float,
    eye: F32x1,
    # out
    pieces_out: F32x2,
):
    """Lay chosen blocks, each drawn fibre as `each` real ones: an even spiral in its section (Vogel).

    starts: (chosen + 1,) where each one's pieces stand. parted: how far its fibres have parted, 0 to 1. gain: factor
    for the colour of those that part. Of each block of the fabric, core: particles of its template that are fibres, not
    hairs; steps: those of one fibre; each: real fibres for a drawn one. usual: a skin's period is near this [m]. eye:
    of `streaming.Survey`: normals lean to it as far as fibres have not parted.
    """
    for step in range(chunks * 1024):
        if step % 1024 != 0:
            continue
        chunk = step // 1024
        for i in range(chosen.shape[0] * chunk // chunks, chosen.shape[0] * (chunk + 1) // chunks):
            b = chosen[i]
            yarn, length = fabric.thread[b], fabric.pitch[b]
            p0, p1, a0, a1, n0, n1 = block_ends(fabric, b)
            w0, w1 = block_widths(fabric, b)
            periods = ti.max(1.0, ti.round(length / usual))
            t0 = ti.cast(fabric.start[fabric.template[b]], ti.i32)
            q = starts[i]
            m = 0
            while q < starts[i + 1]:
                # The drawn fibre's particle, and how many real ones it stands for.
                t = t0 + m
                u = fabric.particle[t, COLUMN.u]
                x, d, up, radius = lay_particle(fabric.particle, t, p0, p1, a0, a1, n0, n1, w0, w1)
                side = d.cross(up)
                is_core, facing = m < core[b], up
                if is_core and parted[i] < 1.0:
                    facing = leant(up, d, x, ti.Vector([eye[0], eye[1], eye[2]]), eye[3] * (1.0 - parted[i]))
                line = m // steps[b] if is_core else 100000 + m
                count = each[b] if is_core else 1
                many = ti.cast(count, ti.f32)
                for j in range(count):
                    here, r, outward, tone = x, radius, facing, fabric.particle[t, COLUMN.tone]
                    far = 0.0
                    if count > 1:
                        # Its place in the section; between the block's ends it strays a little.
                        rho = ti.sqrt((j + 0.5) / many)
                        fine = radius / ti.sqrt(many)
                        angle = 2.399963 * j + 6.2831853 * _hash(line, yarn)
                        bulge = ti.sin(3.14159265 * ti.math.clamp(u, 0.0, 1.0)) ** 2 * radius
                        y = ti.cos(angle) * rho * (radius - fine) + (_hash(line * 64 + j, b) - 0.5) * 0.7 * bulge
                        z = ti.sin(angle) * rho * (radius - fine) + (_hash(line * 64 + j, b + 7919) - 0.5) * 0.7 * bulge
                        # As far on the way there as the fibres have parted.
                        here += parted[i] * (y * up + z * side)
                        r = radius + parted[i] * (fine - radius)
                        if j > 0:  # where all still lie on one another, one is enough
                            r *= ti.min(GROWN * parted[i], 1.0)
                        outward = (facing + parted[i] * 0.6 * (y * up + z * side) / radius).normalized()
                        tone *= gain[i]
                        tone *= 1.0 + parted[i] * 0.12 * (_hash(line * 64 + j, yarn + 31) - 0.5)
                        far = parted[i]
                    for c in ti.static(range(3)):
                        pieces_out[q, POSITION + c] = here[c]
                        pieces_out[q, COLOUR + c] = fabric.colour[yarn, c] * tone
                        pieces_out[q, TANGENT + c] = d[c]
                        pieces_out[q, NORMAL + c] = outward[c]
                    pieces_out[q, RADIUS] = r
                    least = LONG * (1.0 - parted[i]) * r
                    pieces_out[q, HALF_LENGTH] = ti.max(fabric.particle[t, COLUMN.half_length], least)
                    pieces_out[q, OPENNESS] = fabric.particle[t, COLUMN.openness]
                    pieces_out[q, PLACE] = u * periods + _hash(line * 64 + j, yarn + 101)
                    pieces_out[q, PERIOD] = length / periods
                    pieces_out[q, TURN] = 6.2831853 * _hash(line * 64 + j, yarn + 57)
                    pieces_out[q, SKINNED] = 1.0 if is_core else 0.0
                    pieces_out[q, PARTED] = far
                    pieces_out[q, BEFORE] = count if is_core and m % steps[b] > 0 else 0
                    pieces_out[q, AFTER] = count if is_core and m % steps[b] < steps[b] - 1 else 0
                    pieces_out[q, THREAD] = yarn
                    pieces_out[q, FAMILY] = fabric.family[b]
                    for c in ti.static(range(7)):
                        pieces_out[q, MEETS + c] = 0.0
                    q += 1
                m += 1


@ti.kernel
def place(
    pieces: F32x2,
    view: View,
    # out
    boxes_out: I16x2,
    counts_out: I32x1,
    depth_out: F32x1,
    grid_out: I32x2,
):
    """As `streaming.survey`, for pieces; grid_out: points along a piece and around it, beside its splat; 0 for none."""
    for q in range(pieces.shape[0]):
        at = seen_at(view, row(pieces, q))
        z = at[2]
        r = ti.max(pieces[q, HALF_LENGTH], AROUND * pieces[q, RADIUS])
        left, right, top, bottom = 1, 0, 1, 0
        along, around, count = 0, 0, 0
        if z > view.near + r:
            left, right, top, bottom = tiles_of(view, at, r, 2.0)
            if left <= right and top <= bottom:
                count = 1
                scale = view.focal / z
                radius = pieces[q, RADIUS] * scale
                if pieces[q, SKINNED] > 0 and radius > SURFACE[0] and pieces[q, PARTED] > 0.5:
                    # What is much nearer than the rest gets fewer points, not a multitude.
                    scale = ti.min(scale, view.focal / (2.0 * view.near))
                    radius = pieces[q, RADIUS] * scale
                    along = ti.cast(ti.ceil(pieces[q, HALF_LENGTH] * scale * 2.0 / 3.0 / SPACING), ti.i32) + 1
                    around = ti.cast(ti.ceil(ARC * radius / SPACING), ti.i32) + 1
                    along, around = ti.min(along, 256), ti.min(around, 1024)
                    count = along * around + 1
        if count == 0:
            left, right, top, bottom = 1, 0, 1, 0
        boxes_out[q, 0] = ti.cast(left, ti.i16)
        boxes_out[q, 1] = ti.cast(right, ti.i16)
        boxes_out[q, 2] = ti.cast(top, ti.i16)
        boxes_out[q, 3] = ti.cast(bottom, ti.i16)
        counts_out[q] = count
        depth_out[q] = z
        grid_out[q, 0] = along
        grid_out[q, 1] = around


def reach_of(pieces: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far each of the pieces (n, WIDTH) reaches from its middle [m], (n,)."""
    return np.maximum(pieces[:, HALF_LENGTH], AROUND * pieces[:, RADIUS]) + AROUND * pieces[:, RADIUS]


@ti.func
def _normal(pieces: F32x2, i):
    return ti.Vector([pieces[i, NORMAL], pieces[i, NORMAL + 1], pieces[i, NORMAL + 2]])


@ti.func
def _beyond(pieces: F32x2, i, other):
    """Where the fibre goes on beyond its block after piece i, which has its neighbour `other` on the other side."""
    at = row(pieces, i)
    out = 2.0 * at - row(pieces, other)
    if pieces[i, MEETS] > 0:
        out = ti.Vector([pieces[i, BEYOND], pieces[i, BEYOND + 1], pieces[i, BEYOND + 2]])
    return out


@ti.func
def _looks(pieces: F32x2, i):
    """The normal there."""
    out = _normal(pieces, i)
    if pieces[i, MEETS] > 0:
        out = ti.Vector([pieces[i, BEYOND + 3], pieces[i, BEYOND + 4], pieces[i, BEYOND + 5]])
    return out


@ti.func
def _way(radius, begin, end):
    """How far a radius [px] has come from `begin` to `end`, 0 to 1, evenly as the camera comes nearer."""
    return ti.math.clamp(ti.log(ti.max(radius, 1e-6) / begin) / ti.log(end / begin), 0.0, 1.0)


@ti.func
def _height(skin: F32x2, s, angle):
    """The skin at s periods along and an angle [rad], bilinear, both ways round."""
    rows, columns = skin.shape[0], skin.shape[1]
    a = (s - ti.floor(s)) * rows
    turn = angle / 6.283185307179586
    c = (turn - ti.floor(turn)) * columns
    i, j = ti.cast(a, ti.i32), ti.cast(c, ti.i32)
    f, g = a - i, c - j
    i0, j0 = i % rows, j % columns
    i1, j1 = (i + 1) % rows, (j + 1) % columns
    return (skin[i0, j0] * (1 - g) + skin[i0, j1] * g) * (1 - f) + (skin[i1, j0] * (1 - g) + skin[i1, j1] * g) * f


@ti.kernel
def surface(
    chunks: Int,
    chosen: I32x1,
    starts: I32x1,
    pieces: F32x2,
    grid: I32x2,
    view: View,
    skin: F32x2,
    gain: F32x1,
    # out
    groups_out: F32x3,
):
    """A piece as one splat, or as points on its skin, too: with ρ(s, θ) the height map over the mean radius r and e the
    unit vector from the axis, points a + r ρ e with normals e − ρ_θ/ρ e_θ − r ρ_s t. The points grow before the splat
    as the camera comes nearer, and it goes when they cover it, each point by its own distance: no piece comes at once.

    chosen: numbers of pieces. starts: where each one's particles stand in groups_out. grid: of `place`. skin: ρ, rows
    along a period and columns around. gain: factors for the points' colour, of warp and of weft.
    """
    for step in range(chunks * 1024):
        if step % 1024 != 0:
            continue
        chunk = step // 1024
        total = ti.cast(chosen.shape[0], ti.i64)
        for i in range(ti.cast(total * chunk // chunks, ti.i32), ti.cast(total * (chunk + 1) // chunks, ti.i32)):  # pyright: ignore[reportArgumentType]
            p = chosen[i]
            q = starts[i]
            if grid[p, 0] == 0:
                for c in ti.static(range(ROWS)):
                    groups_out[c, q // LANES, q % LANES] = pieces[p, c]
            else:
                # The course of the fibre through its neighbours.
                at = row(pieces, p)
                before = p - ti.cast(pieces[p, BEFORE], ti.i32)
                after = p + ti.cast(pieces[p, AFTER], ti.i32)
                x0, x2 = row(pieces, before), row(pieces, after)
                n0, n1, n2 = _normal(pieces, before), _normal(pieces, p), _normal(pieces, after)
                s0, s1, s2 = pieces[before, PLACE], pieces[p, PLACE], pieces[after, PLACE]
                # Beyond the block it goes on as the next one says, or straight.
                if before == p:
                    x0, n0, s0 = _beyond(pieces, p, after), _looks(pieces, p), 2.0 * s1 - s2
                if after == p:
                    x2, n2, s2 = _beyond(pieces, p, before), _looks(pieces, p), 2.0 * s1 - s0
                # How much of its skin shows, and how it is cut into points.
                radius = pieces[p, RADIUS]
                toward = view.eye - at
                scale = view.focal / seen_at(view, at)[2]
                shown = ti.math.clamp((radius * scale - SURFACE[0]) / (SURFACE[1] - SURFACE[0]), 0.0, 1.0)
                shown = shown * shown * (3.0 - 2.0 * shown)
                along, around = grid[p, 0], grid[p, 1]
                period = pieces[p, PERIOD]
                gap = 0.5 * (x2 - x0).norm() / along  # pyright: ignore[reportOptionalCall]
                tint = gain[ti.cast(pieces[p, FAMILY], ti.i32)]
                for a in range(along):
                    # The course between the middles of neighbours: the uniform quadratic B-spline.
                    t = (a + 0.5) / along - 0.5
                    w0, w1, w2 = 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2
                    middle = w0 * x0 + w1 * at + w2 * x2
                    d = ((t - 0.5) * x0 - 2.0 * t * at + (t + 0.5) * x2).normalized()
                    outward = w0 * n0 + w1 * n1 + w2 * n2
                    outward = (outward - d * outward.dot(d)).normalized()
                    side = d.cross(outward)
                    front = ti.atan2(toward.dot(side), toward.dot(outward))
                    s = w0 * s0 + w1 * s1 + w2 * s2
                    grown = _way(radius * view.focal / seen_at(view, middle)[2], SURFACE[0], COVERED[0])
                    for k in range(around):
                        angle = front + ((k + 0.5) / around - 0.5) * ARC
                        # A point on the skin, and its normal: more of the yarn's where little of the skin shows.
                        e = ti.cos(angle) * outward + ti.sin(angle) * side
                        f = ti.cos(angle) * side - ti.sin(angle) * outward
                        turn = angle + pieces[p, TURN]
                        rho = 1.0 + shown * (_height(skin, s, turn) - 1.0)
                        by_angle = shown * (_height(skin, s, turn + 0.06) - _height(skin, s, turn - 0.06)) / 0.12
                        step_s = 0.008
                        by_length = shown * (_height(skin, s + step_s, turn) - _height(skin, s - step_s, turn))
                        by_length *= radius / (2.0 * step_s * period)
                        n = (e - by_angle / rho * f - by_length * d).normalized()
                        n = (n * (0.6 + 0.9 * shown) + outward * (1.0 - 0.55 * shown)).normalized()
                        x = middle + radius * rho * e
                        to = q + k * along + a  # along the fibre, as whoever looks up light takes neighbours
                        group, lane = to // LANES, to % LANES
                        for c in ti.static(range(3)):
                            groups_out[POSITION + c, group, lane] = x[c]
                            groups_out[COLOUR + c, group, lane] = pieces[p, COLOUR + c] * tint
                            groups_out[TANGENT + c, group, lane] = d[c]
                            groups_out[NORMAL + c, group, lane] = n[c]
                        width = ti.sqrt(rho * rho + by_angle * by_angle) * radius * ARC / around
                        groups_out[RADIUS, group, lane] = grown * 0.8 * width
                        groups_out[HALF_LENGTH, group, lane] = grown * ti.max(1.5 * gap, 0.8 * width)
                        groups_out[OPENNESS, group, lane] = pieces[p, OPENNESS]
                last = q + along * around
                for c in ti.static(range(ROWS)):
                    groups_out[c, last // LANES, last % LANES] = pieces[p, c]
                groups_out[RADIUS, last // LANES, last % LANES] = radius * (1.0 - _way(radius * scale, *COVERED))
