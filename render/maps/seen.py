"""Reading the maps of the sky (see `sky`), for particles and for any points."""

from dataclasses import dataclass
from typing import Literal

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, RADIUS
from taichi_cloth.ground.vectors import Octets, each, keep, lanes, of_group, of_row, set_row

from ..data.light_sizes import LAYERS
from ..tiles.compiling import left_to_llvm
from .decay import decay
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP, moved_out
from .lookup import slope
from .map_place import LEANT
from .sky import coordinate

__all__ = ["Looking", "look", "look_at"]


@dataclass(frozen=True)
class Looking:
    """How maps are read: a compile-time switch. walled: there is a mesh, met first and left last at the depths `walls`.
    bulk: also what a cloth sees around, see `_seen`. part: of bulk, that "cloth" alone, what a particle sees its "own",
    with the other known, or "all". blind: BLIND is above 0."""

    walled: bool
    bulk: bool
    part: Literal["all", "cloth", "own"] = "all"
    blind: bool = False


OFFSET, FINE, BEYOND, BLIND, YARNS = range(5)
"""Numbers by which maps are read: how far a place is moved out along its normal, and towards the sky, before it reads
[m]; length by which layers are laid [m]; and of bulk, see `_seen`; the last of them in yarns a metre."""

STEEP = 30.0
"""Slope of a cloth to a map beyond which it is that."""
TURNS = 2.0
"""How fast a fibre that faces aside takes the side of its cloth from which more is seen, with how much more that is."""
OPEN_BEHIND = 0.42, 0.52
"""Of how much more than a cloth's interstices, and of how much a yarn is open behind that nothing crosses (`_seen`): of
a plain weave 0.24 to 0.40 of the sky, from crowns to interstices, of a satin as much, of a yarn alone 0.54 to 0.59."""


@ti.func
def _passing(how: Template, side, at, cell, width, s, t, fine, ends: F32x2, depth_of: F32x2, walls: F32x2):
    """What passes between a depth [m] and the nearer ends of the four texels from `cell` on, side 1, or their farther
    ones, -1, as of whole layers: their mean at s, t of the way from the first to the others. No branches: a loop over
    lanes that calls this becomes one of vectors."""
    passing = 0.0
    for j in ti.static(range(4)):
        c = cell + j // 2 * width + j % 2
        f, g = at - ends[0, c], ends[1, c] - at
        k = coordinate(ti.max(f, 0.0), ti.max(g, 0.0), fine) - side
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
def _faced(places, axes: F32x3, maps: I32x2, ends: F32x2):
    """The unit normal (3), on the side of n, of the cloth at `places`, p (3) and n (3): where the first or the last
    thing in four texels of a map is near, its depth rises as the cloth slopes. Each map counts by how straight it looks
    on the cloth, and how near that is."""
    px, py, pz, nx, ny, nz = places
    fx, fy, fz = 0.02 * nx, 0.02 * ny, 0.02 * nz
    for m in range(maps.shape[0]):
        right = ti.Vector([axes[m, RIGHT, k] for k in ti.static(range(3))])
        up = ti.Vector([axes[m, UP, k] for k in ti.static(range(3))])
        away = ti.Vector([axes[m, AWAY, k] for k in ti.static(range(3))])
        for i in range(ti.static(lanes())):
            cell, width, s, t, depth = _on_sky(axes, maps, m, right, up, away, px[i], py[i], pz[i])
            for end in ti.static(range(2)):
                a, b = ends[end, cell], ends[end, cell + 1]
                c, d = ends[end, cell + width], ends[end, cell + width + 1]
                texels = axes[m, SCALE, 0]
                p = texels * ((1.0 - t) * (b - a) + t * (d - c))
                q = texels * ((1.0 - s) * (c - a) + s * (d - b))
                p, q = ti.min(ti.max(p, -STEEP), STEEP), ti.min(ti.max(q, -STEEP), STEEP)
                far = texels * (depth - (1.0 - t) * (a + s * (b - a)) - t * (c + s * (d - c)))
                long = 1.0 / (1.0 + p * p + q * q)
                share = long * long / (1.0 + far * far * long)
                gx = p * right[0] + q * up[0] - away[0]
                gy = p * right[1] + q * up[1] - away[1]
                gz = p * right[2] + q * up[2] - away[2]
                share = ti.select(gx * nx[i] + gy * ny[i] + gz * nz[i] > 0.0, share, -share)
                fx[i] += share * gx
                fy[i] += share * gy
                fz[i] += share * gz
    return _unit(fx, fy, fz)


@ti.func
def _on_sky(axes: F32x3, maps: I32x2, m, right, up, away, x, y, z):
    """The first of the four texels of map m around a place [m], their row's width, the shares of the second ones, and
    the place's depth [m]."""
    texels, width = axes[m, SCALE, 0], maps[m, 1]
    u = (x * right[0] + y * right[1] + z * right[2] - axes[m, ORIGIN, 0]) * texels
    v = (x * up[0] + y * up[1] + z * up[2] - axes[m, ORIGIN, 1]) * texels
    depth = x * away[0] + y * away[1] + z * away[2] - axes[m, ORIGIN, 2]
    u = ti.min(ti.max(u - 0.5, 0.0), width - 1.001)
    v = ti.min(ti.max(v - 0.5, 0.0), maps[m, 2] - 1.001)
    left = ti.cast(u, ti.i32)
    top = ti.cast(v, ti.i32)
    return maps[m, 0] + top * width + left, width, u - left, v - top, depth


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

    around: what is known of the cloth (`Looking.part`), and of "cloth" is given back: m, 2 m1 (3) and how closed it
    is; where it is blind before it the cloth's normal (3), and m and m1 are along it, by the cosine to it.
    lag: how far towards each end of a map it is moved before it reads [m]. BLIND: how far the maps do not show what
    hides what within a cloth, 0 to 1 (see `map_place.blind`): as far, a fibre sees all of the sky that the cloth does,
    on the side that is more open unless it faces the other, and what is open to it lies between there and its normal.
    """
    px, py, pz, nx, ny, nz = places
    mean, back, lx, ly, lz, closed = around
    if ti.static(how.blind and how.part != "own"):
        lx, ly, lz = _faced(places, axes, maps, ends)
    total, weight, near_behind = each(0.0), each(0.0), each(0.0)
    ox, oy, oz = each(0.0), each(0.0), each(0.0)
    on_front, on_back, by = each(0.0), each(0.0), each(0.0)
    fine, farther, yarns = reading[FINE], reading[BEYOND], reading[YARNS]
    count = ti.cast(maps.shape[0], ti.f32)
    for m in range(maps.shape[0]):
        right = ti.Vector([axes[m, RIGHT, k] for k in ti.static(range(3))])
        up = ti.Vector([axes[m, UP, k] for k in ti.static(range(3))])
        away = ti.Vector([axes[m, AWAY, k] for k in ti.static(range(3))])
        for i in range(ti.static(lanes())):
            # Which of the map's ends the surface faces: the first, 1, or the last, -1; and where the place lies on it.
            cosine = -(nx[i] * away[0] + ny[i] * away[1] + nz[i] * away[2])
            side = ti.select(cosine > 0.0, 1.0, -1.0)
            cosine = ti.abs(cosine)
            cell, width, s, t, depth = _on_sky(axes, maps, m, right, up, away, px[i], py[i], pz[i])
            moved = side * (lag[i] * slope(cosine))
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
                if ti.static(how.blind):
                    cosine = -(lx[i] * away[0] + ly[i] * away[1] + lz[i] * away[2])
                    side = ti.select(cosine > 0.0, 1.0, -1.0)
                    cosine = ti.abs(cosine)
                    moved = side * (lag[i] * slope(cosine))
                beyond = side * farther
                outside = _passing(how, side, depth - moved - beyond, cell, width, s, t, fine, ends, depth_of, walls)
                at = depth + moved + beyond
                opposite = _passing(how, -side, at, cell, width, s, t, fine, ends, depth_of, walls)
                if ti.static(how.blind):
                    on_front[i] += cosine * outside
                    on_back[i] += cosine * opposite
                    by[i] += cosine
                else:
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
        if ti.static(how.blind):
            mean, back = on_front / ti.max(by, 1e-6), on_back / ti.max(by, 1e-6)
    if ti.static(how.part == "cloth"):
        seen, before, ox, oy, oz = mean, back, lx, ly, lz
    elif ti.static(how.bulk):
        # Where nothing is open the normal stands for it.
        ox, oy, oz = _unit(ox + 0.05 * nx, oy + 0.05 * ny, oz + 0.05 * nz)
        if ti.static(how.blind):
            blind = reading[BLIND]
            lean = 0.5 * (mean - back) * (lx * ox + ly * oy + lz * oz)
            before, behind = _share(0.5 * (mean + back) + lean), _share(0.5 * (mean + back) - lean)
            over = (1.0 - _share(lx * nx + ly * ny + lz * nz)) * _share(TURNS * (back - mean))
            of_cloth = mean + over * (back - mean)
            seen += blind * (of_cloth - seen)
            before += blind * (of_cloth - before)
            behind += blind * (back + over * (mean - back) - behind)
            straight = (1.0 - LEANT) * (1.0 - 2.0 * over)
            lx, ly, lz = _unit(LEANT * nx + straight * lx, LEANT * ny + straight * ly, LEANT * nz + straight * lz)
            ox, oy, oz = _unit(ox + blind * (lx - ox), oy + blind * (ly - oy), oz + blind * (lz - oz))
            closed += blind * (1.0 - closed)
        else:
            lean = lx * ox + ly * oy + lz * oz
            before, behind = _share(mean + lean), _share(mean - lean)
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
        mean, back, lx, ly, lz, closed = each(0.0), each(0.0), each(0.0), each(0.0), each(0.0), each(1.0)
        if ti.static(how.part == "own"):
            mean, back, closed = of_row(light_out, b, row), of_row(light_out, b, row + 1), of_row(light_out, b, row + 6)
            lx, ly, lz = of_row(light_out, b, row + 3), of_row(light_out, b, row + 4), of_row(light_out, b, row + 5)
        around = (mean, back, lx, ly, lz, closed)
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
        around = (none, none, none, none, none, each(1.0))
        found = _seen(how, places, each(reading[OFFSET]), around, reading, axes, maps, ends, depth_of, walls)
        for i in range(ti.static(lanes())):
            k = b * ti.static(lanes()) + i
            if k < points.shape[0]:
                light_out[k] = found[0][i]  # pyright: ignore[reportIndexIssue]
