"""The sky seen through particles: kernels of the maps that ambient occlusion reads (see `occlusion`).

A map looks along one direction and answers for both of its ends. Layers are laid between the first and the last
depth of each texel, fine near both: with f behind the first, g before the last and a length h

    k = 16 w(f) / (w(f) + w(g)),   w(d) = d / (d + h)

is even through a thin cloth and fine at both of its walls where the map looks through a whole garment. A piece of
fibre of area A and opacity a takes the optical depth DENSITY a A / texel^2, laid at points along its axis and shared
bilinearly between four texels. A direction belongs to one thread.
"""

from dataclasses import dataclass
from typing import Literal

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import (
    CHUNK_STEPS,
    Blocks,
    Octets,
    Vec16,
    each,
    keep,
    lanes,
    of_group,
    of_row,
    set_row,
)

from ..data.light_sizes import LAYERS
from ..tiles.compiling import left_to_llvm
from ..tiles.sort import share
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP, deepen, laid, lift, lower, moved_out
from .fibre import decay
from .map_place import LEANT

__all__ = ["Looking", "fill", "look", "look_at"]


@dataclass(frozen=True)
class Looking:
    """How maps are read: a compile-time switch. walled: there is a mesh, met first and left last at the depths `walls`.
    bulk: also what a cloth sees around, see `_seen`. part: of bulk, that "cloth" alone, what a particle sees its "own",
    with the other known, or "all"."""

    walled: bool
    bulk: bool
    part: Literal["all", "cloth", "own"] = "all"


OFFSET, FINE, BEYOND, BLIND, YARNS = range(5)
"""Numbers by which maps are read: how far a place is moved out along its normal, and towards the sky, before it reads
[m]; length by which layers are laid [m]; and of bulk, see `_seen`; the last of them in yarns a metre."""

OPEN_BEHIND = 0.42, 0.52
"""Of how much more than a cloth's interstices, and of how much a yarn is open behind that nothing crosses (`_seen`): of
a plain weave 0.24 to 0.40 of the sky, from crowns to interstices, of a satin as much, of a yarn alone 0.54 to 0.59."""

DENSITY = 1.6
"""Optical depth of a texel covered once by an opaque fibre: spread evenly, as a fibre that covers its middle is."""

MOST_POINTS = 12.0
APART = 2.0
"""Distance between the points of a fibre [texels]."""


@ti.func
def _coordinate(f, g, h):
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
                    k = _coordinate(depth[i] - ends[0, c], ends[1, c] - depth[i], fine)
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


@ti.func
def _passing(how: Template, side, at, cell, width, s, t, fine, ends: F32x2, depth_of: F32x2, walls: F32x2):
    """What passes between a depth [m] and the nearer ends of the four texels from `cell` on, side 1, or their farther
    ones, -1, as of whole layers: their mean at s, t of the way from the first to the others. No branches: a loop over
    lanes that calls this becomes one of vectors."""
    passing = 0.0
    for j in ti.static(range(4)):
        c = cell + j // 2 * width + j % 2
        f, g = at - ends[0, c], ends[1, c] - at
        k = _coordinate(ti.max(f, 0.0), ti.max(g, 0.0), fine) - side
        k = ti.min(ti.max(k, 0.0), 16.0)
        low = ti.min(ti.cast(k, ti.i32), ti.static(LAYERS - 1))
        before = depth_of[c, ti.max(low - 1, 0)] * ti.cast(low > 0, ti.f32)
        optical = before + (k - low) * (depth_of[c, low] - before)
        optical = ti.select(side > 0.0, optical, depth_of[c, LAYERS - 1] - optical)
        # Nothing is in the way outside a cloth, nor where texels are empty, in which no depth is laid.
        through = ti.select(ti.select(side > 0.0, f, g) > 0.0, decay(optical), 1.0)
        if ti.static(how.walled):
            through = ti.select(ti.select(side > 0.0, at - walls[0, c], walls[1, c] - at) > 0.0, 0.0, through)
        part = (s if ti.static(j % 2 == 1) else 1.0 - s) * (t if ti.static(j // 2 == 1) else 1.0 - t)
        passing += part * through
    return passing


@ti.func
def _farthest(side, depth, cell, width, ends: F32x2):
    """How far the last thing in four texels stands behind a depth [m]; -1e30 where nothing stands."""
    inner = -EMPTY
    for j in ti.static(range(4)):
        c = cell + j // 2 * width + j % 2
        inner = ti.max(inner, ti.select(side > 0.0, ends[1, c] - depth, depth - ends[0, c]))
    return inner


@ti.func
def _seen(
    how: Template, places, lag, around, reading: F32x1, axes: F32x3, maps: I32x2, ends: F32x2, depth_of: F32x2,
    walls: F32x2,
):  # fmt: skip
    """Of `places`, p (3) and normals n (3) of as many as there are lanes: the share of the sky, by the cosine to the
    normal, that is seen from them; and in bulk, read BEYOND [m] farther out where the cloth that they are in hides
    nothing, the share of the sky seen by a surface that faces the mean direction of what is open, and by its other
    side: with the sky's mean m and its mean m1 times direction, m + 2 m1 . n, which is exact where the sky is linear in
    the direction. Then that direction (3), and how closed the cloth is behind, 1, or how far it is a yarn alone, 0: by
    the mean over the directions of 1 / (1 + (g / d)^2), where the last thing behind a place stands g behind it, and d
    is a yarn's diameter.

    around: m and 2 m1 (3) of the cloth and how closed it is, where they are known (`Looking.part`); of "cloth" they are
    what is given back.
    lag: how far towards each end of a map it is moved before it reads [m]. BLIND: how far the maps do not show what
    hides what within a cloth, 0 to 1 (see `map_place.blind`): as far, a fibre sees all of the sky that the cloth does,
    on the side that is more open unless it faces the other, and what is open to it lies between there and its normal.
    """
    px, py, pz, nx, ny, nz = places
    mean, lx, ly, lz, closed = around[0], around[1], around[2], around[3], around[4]
    total, weight, near_behind = each(0.0), each(0.0), each(0.0)
    ox, oy, oz = each(0.0), each(0.0), each(0.0)
    fine, farther, yarns = reading[FINE], reading[BEYOND], reading[YARNS]
    count = ti.cast(maps.shape[0], ti.f32)
    for m in range(maps.shape[0]):
        right = ti.Vector([axes[m, RIGHT, k] for k in ti.static(range(3))])
        up = ti.Vector([axes[m, UP, k] for k in ti.static(range(3))])
        away = ti.Vector([axes[m, AWAY, k] for k in ti.static(range(3))])
        origin = ti.Vector([axes[m, ORIGIN, k] for k in ti.static(range(3))])
        texels, begin, width = axes[m, SCALE, 0], maps[m, 0], maps[m, 1]
        most_u, most_v = width - 1.001, maps[m, 2] - 1.001
        for i in range(ti.static(lanes())):
            # Where the place lies on the map, and which of its ends the surface faces: the first, 1, or the last, -1.
            cosine = -(nx[i] * away[0] + ny[i] * away[1] + nz[i] * away[2])
            side = ti.select(cosine > 0.0, 1.0, -1.0)
            cosine = ti.abs(cosine)
            u = (px[i] * right[0] + py[i] * right[1] + pz[i] * right[2] - origin[0]) * texels
            v = (px[i] * up[0] + py[i] * up[1] + pz[i] * up[2] - origin[1]) * texels
            depth = px[i] * away[0] + py[i] * away[1] + pz[i] * away[2] - origin[2]
            # How the depth of a surface varies over a texel: 1 + tan of the angle, up to 4.
            slope = ti.min(ti.sqrt(ti.max(1.0 - cosine * cosine, 0.0)) / ti.max(cosine, 0.05), 3.0)
            moved = side * (lag[i] * (1.0 + slope))
            u = ti.min(ti.max(u - 0.5, 0.0), most_u)
            v = ti.min(ti.max(v - 0.5, 0.0), most_v)
            left = ti.cast(u, ti.i32)
            top = ti.cast(v, ti.i32)
            s = u - left
            t = v - top
            cell = begin + top * width + left
            at = depth - moved
            # What passes on the way out there.
            if ti.static(how.part != "cloth"):
                passing = _passing(how, side, at, cell, width, s, t, fine, ends, depth_of, walls)
                total[i] += cosine * passing
                weight[i] += cosine
                passing *= -side
                ox[i] += passing * away[0]
                oy[i] += passing * away[1]
                oz[i] += passing * away[2]
            if ti.static(how.bulk and how.part != "own"):
                beyond = side * farther
                outside = _passing(how, side, at - beyond, cell, width, s, t, fine, ends, depth_of, walls)
                at = depth + moved + beyond
                opposite = _passing(how, -side, at, cell, width, s, t, fine, ends, depth_of, walls)
                mean[i] += 0.5 / count * (outside + opposite)
                lean = -side * ((outside - opposite) / count)
                lx[i] += lean * away[0]
                ly[i] += lean * away[1]
                lz[i] += lean * away[2]
                inner = ti.max(_farthest(side, depth, cell, width, ends), 0.0) * yarns
                near_behind[i] += 1.0 / (1.0 + inner * inner)
    seen, before, behind = total / ti.max(weight, 1e-6), each(1.0), each(1.0)
    if ti.static(how.bulk and how.part != "own"):
        low, high = ti.static(OPEN_BEHIND)
        closed = _share((high - near_behind / count) * ti.static(1.0 / (high - low)))
    if ti.static(how.part == "cloth"):
        seen, ox, oy, oz = mean, lx, ly, lz
    elif ti.static(how.bulk):
        # Where nothing is open the normal stands for it.
        ox, oy, oz = _unit(ox + 0.05 * nx, oy + 0.05 * ny, oz + 0.05 * nz)
        lean = lx * ox + ly * oy + lz * oz
        before, behind = _share(mean + lean), _share(mean - lean)
        blind = reading[BLIND]
        if blind > 0.0:
            side = ti.sqrt(lx * lx + ly * ly + lz * lz)
            side *= ti.min(ti.max(1.0 + 2.0 * (lx * nx + ly * ny + lz * nz) / (side + 1e-6), -1.0), 1.0)
            of_cloth = _share(mean + side)
            seen += blind * (of_cloth - seen)
            before += blind * (of_cloth - before)
            behind += blind * (_share(mean - side) - behind)
            leant = LEANT * blind
            ox, oy, oz = _unit(ox + leant * (nx - ox), oy + leant * (ny - oy), oz + leant * (nz - oz))
            closed += blind * (1.0 - closed)
    return seen, before, behind, ox, oy, oz, closed


@ti.func
def _share(x):
    return ti.min(ti.max(x, 0.0), 1.0)


@ti.func
def _unit(x, y, z):
    scale = 1.0 / ti.sqrt(x * x + y * y + z * z)
    return scale * x, scale * y, scale * z


@left_to_llvm
@ti.kernel
def look(
    how: Template,
    # maps:
    axes: F32x3,
    maps: I32x2,
    reading: F32x1,
    ends: F32x2,
    depth_of: F32x2,
    walls: F32x2,
    # in:
    particles: Octets,
    octet_count: Int,
    row: Int,
    # out:
    light_out: Octets,
):
    """light_out[block, row, lane]: the share of the sky that packed particles see, 0..1; in bulk, in the rows after it
    what the cloth at their place sees before it and behind it, the direction (3) of what is open to them, and how
    closed the cloth is behind (`_seen`). Of the "cloth" alone its mean, in place of that direction how it leans, and
    how closed it is; of a particle's "own" these are there.

    reading: numbers by which they are read, `OFFSET` and so on.
    """
    keep(light_out, (0, 0), row)
    for b in range(octet_count * ti.static(OCTET // lanes())):
        size = of_group(particles, RADIUS, b)
        places = moved_out(particles, b, reading[OFFSET] + 0.5 * size)
        mean, lx, ly, lz, closed = each(0.0), each(0.0), each(0.0), each(0.0), each(1.0)
        if ti.static(how.part == "own"):
            mean, closed = of_row(light_out, b, row), of_row(light_out, b, row + 6)
            lx, ly, lz = of_row(light_out, b, row + 3), of_row(light_out, b, row + 4), of_row(light_out, b, row + 5)
        around = (mean, lx, ly, lz, closed)
        lag = reading[OFFSET] + 0.25 * size
        found = _seen(how, places, lag, around, reading, axes, maps, ends, depth_of, walls)
        for k in ti.static(range(7 if how.bulk else 1)):
            set_row(light_out, b, row + k, ti.select(size > 0.0, found[k], 1.0))


@left_to_llvm
@ti.kernel
def look_at(
    how: Template,
    # maps:
    axes: F32x3,
    maps: I32x2,
    reading: F32x1,
    ends: F32x2,
    depth_of: F32x2,
    walls: F32x2,
    # in:
    points: F32x2,
    normals: F32x2,
    # out:
    light_out: F32x1,
):
    """light_out[i]: the share of the sky that points (n, 3) [m] with normals (n, 3) see. reading: as of `look`."""
    for b in range((points.shape[0] - 1) // ti.static(lanes()) + 1):
        px, py, pz, nx, ny, nz = each(0.0), each(0.0), each(0.0), each(0.0), each(0.0), each(0.0)
        for i in range(ti.static(lanes())):
            k = ti.min(b * ti.static(lanes()) + i, points.shape[0] - 1)
            nx[i], ny[i], nz[i] = normals[k, 0], normals[k, 1], normals[k, 2]
            px[i] = points[k, 0] + reading[OFFSET] * nx[i]
            py[i] = points[k, 1] + reading[OFFSET] * ny[i]
            pz[i] = points[k, 2] + reading[OFFSET] * nz[i]
        places, none = (px, py, pz, nx, ny, nz), each(0.0)
        around = (none, none, none, none, each(1.0))
        found = _seen(how, places, each(reading[OFFSET]), around, reading, axes, maps, ends, depth_of, walls)
        for i in range(ti.static(lanes())):
            k = b * ti.static(lanes()) + i
            if k < points.shape[0]:
                light_out[k] = found[0][i]  # pyright: ignore[reportIndexIssue]
