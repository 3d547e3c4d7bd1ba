"""Reading maps of light, for particles and for any points: a deep opacity map (see `transmittance`) and those of the
sky (see `sky`)."""

from dataclasses import dataclass
from typing import Literal

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, RADIUS
from taichi_cloth.ground.vectors import Octets, each, keep, lanes, of_group, of_row, set_row

from ..data.light_sizes import LAYERS
from ..tiles.compiling import left_to_llvm
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP, DeepMap, moved_out
from .fibre import decay
from .map_place import LEANT
from .sky import coordinate
from .transmittance import layer_of

__all__ = ["Looking", "gather", "look", "look_at", "look_up", "on_surface"]


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

ROUND = (1.2, 0.4), (-0.4, 1.2), (-1.2, -0.4), (0.4, -1.2)
"""Where a surface reads its shadow round a place [texels]: a square, turned so that no two lie in a row."""
STEEPEST = 0.25
"""Cosine to the light from which on a surface counts as no steeper."""


@ti.func
def _corner(width, height, u, v):
    """Column and row of the first of the four texels around u, v [texels], and the shares of the second ones."""
    # Texels have their centres at halves; at the border the last pair is taken as it is.
    column = ti.min(ti.max(u - 0.5, 0.0), ti.cast(width - 1, ti.f32))
    row = ti.min(ti.max(v - 0.5, 0.0), ti.cast(height - 1, ti.f32))
    left = ti.min(ti.cast(column, ti.i32), width - 2)
    top = ti.min(ti.cast(row, ti.i32), height - 2)
    return left, top, column - left, row - top


@ti.func
def _place(levels: I32x2, level, u, v):
    """Where the first of the four texels of a level around u, v [texels of the finest] lies, their row's width, and the
    shares of the second ones."""
    width = levels[level, 1]
    scale = 1.0 / ti.cast(1 << level, ti.f32)
    left, top, f, g = _corner(width, levels[level, 2], u * scale, v * scale)
    return levels[level, 0] + top * width + left, width, f, g


@ti.func
def _bilinear(deep: Template, levels: I32x2, level, u, v, depth, nearest: F32x1, through: F32x2):
    """Transmittance at u, v [texels of the finest level] and a depth [m]."""
    cell, width, f, g = _place(levels, level, u, v)
    value = ti.Vector([1.0, 1.0, 1.0, 1.0])
    for k in ti.static(range(4)):
        # Between which two layers the place lies, in each of the four texels; then across the four.
        texel = cell + k // 2 * width + k % 2
        at = ti.max(layer_of(ti.max(depth - nearest[texel], 0.0), deep) - 1.0, 0.0)
        low = ti.min(ti.cast(at, ti.i32), ti.static(LAYERS - 2))
        here, there = through[texel, low], through[texel, low + 1]
        # Undefined where nothing is behind.
        value[k] = ti.select(at > 0.0, here + ti.min(at - low, 1.0) * (there - here), 1.0)  # pyright: ignore[reportIndexIssue]
    return (1.0 - g) * (value[0] + f * (value[1] - value[0])) + g * (value[2] + f * (value[3] - value[2]))  # pyright: ignore[reportIndexIssue]


@ti.func
def _through(soft: Template, deep: Template, levels: I32x2, u, v, depth, nearest: F32x1, through: F32x2):
    """Transmittance at a place of the map. No branches: a loop over lanes that calls this becomes one of vectors.

    levels: rows (first texel, width, height). Between two levels the two are mixed, as in a mip map.
    """
    value = 1.0
    if ti.static(soft):
        # What stops the light of a penumbra may stand beside this texel: look as wide as the coarsest level.
        top = levels.shape[0] - 1
        cell, width, _, _ = _place(levels, top, u, v)
        near = ti.min(nearest[cell], nearest[cell + 1], nearest[cell + width], nearest[cell + width + 1])
        # The mean of a texel read bilinearly blurs an edge over one to two texels, by where it falls in them.
        wide = ti.max((depth - near) * (deep.softness / 1.5), 1.0)
        bits = ti.bit_cast(wide, ti.i32)
        low = ti.min((bits >> 23) - 127, top - 1)  # a power of two, and how far on to the next
        part = ti.min(wide / ti.cast(1 << low, ti.f32) - 1.0, 1.0)
        value = _bilinear(deep, levels, low, u, v, depth, nearest, through)
        value += part * (_bilinear(deep, levels, low + 1, u, v, depth, nearest, through) - value)
    else:
        value = _bilinear(deep, levels, 0, u, v, depth, nearest, through)
    return value


@ti.func
def _on_map(axes: F32x2, px, py, pz):
    """u, v [texels] and depth [m] of places [m]."""
    u = (px * axes[RIGHT, 0] + py * axes[RIGHT, 1] + pz * axes[RIGHT, 2] - axes[ORIGIN, 0]) * axes[SCALE, 0]
    v = (px * axes[UP, 0] + py * axes[UP, 1] + pz * axes[UP, 2] - axes[ORIGIN, 1]) * axes[SCALE, 0]
    return u, v, px * axes[AWAY, 0] + py * axes[AWAY, 1] + pz * axes[AWAY, 2] - axes[ORIGIN, 2]


@ti.func
def _slope(cosine):
    """1 + tan of the angle between light and normal, up to 4: how the depth of a surface varies over a texel."""
    return 1.0 + ti.min(ti.sqrt(ti.max(1.0 - cosine * cosine, 0.0)) / ti.max(cosine, 0.05), 3.0)


@left_to_llvm
@ti.kernel
def gather(
    soft: Template,
    bulk: Template,
    deep: DeepMap,
    # map:
    axes: F32x2,
    levels: I32x2,
    nearest: F32x1,
    through: F32x2,
    # in:
    particles: Octets,
    octet_count: Int,
    row: Int,
    # out:
    light_out: Octets,
):
    """light_out[block, row, lane]: the light that reaches each particle, 0..1; in bulk, at row + 1 what reaches the
    cloth there: read nearer to the light by as much as leads out of it.

    A particle reads at its centre moved the map's offset and half its radius out along its normal, and half its
    radius and its lag, more where the surface slopes, towards the light: the places where its own neighbours
    on the surface do not yet shadow it.
    """
    keep(light_out, (0, 0), row)
    for b in range(octet_count * ti.static(OCTET // lanes())):
        # Where it reads: out along its normal.
        size = of_group(particles, RADIUS, b)
        px, py, pz, nx, ny, nz = moved_out(particles, b, deep.offset + 0.5 * size)
        # That place on the map, less what leads towards the light.
        u, v, depth = _on_map(axes, px, py, pz)
        cosine = -(axes[AWAY, 0] * nx + axes[AWAY, 1] * ny + axes[AWAY, 2] * nz)
        depth -= deep.lag * _slope(cosine) + 0.5 * size
        light, outside = each(1.0), each(1.0)
        for i in range(ti.static(lanes())):
            light[i] = _through(soft, deep, levels, u[i], v[i], depth[i], nearest, through)
        if ti.static(bulk):
            for i in range(ti.static(lanes())):
                outside[i] = _through(soft, deep, levels, u[i], v[i], depth[i] - deep.beyond, nearest, through)
            set_row(light_out, b, row + 1, ti.select(size > 0.0, outside, 1.0))
        set_row(light_out, b, row, ti.select(size > 0.0, light, 1.0))


@left_to_llvm
@ti.kernel
def look_up(
    soft: Template,
    deep: DeepMap,
    # map:
    axes: F32x2,
    levels: I32x2,
    nearest: F32x1,
    through: F32x2,
    # in:
    points: F32x2,
    # out:
    light_out: F32x1,
):
    """light_out[i]: the light that reaches points (n, 3) [m], 0..1, read the map's lag towards the light."""
    for i in range(points.shape[0]):
        u, v, depth = _on_map(axes, points[i, 0], points[i, 1], points[i, 2])
        light_out[i] = _through(soft, deep, levels, u, v, depth - deep.lag, nearest, through)


@left_to_llvm
@ti.kernel
def on_surface(
    soft: Template,
    deep: DeepMap,
    # map:
    axes: F32x2,
    levels: I32x2,
    nearest: F32x1,
    through: F32x2,
    # in:
    points: F32x2,
    normals: F32x2,
    # out:
    light_out: F32x1,
):
    """light_out[i]: the light that reaches points (n, 3) [m] of surfaces with unit normals (n, 3), 0..1, read the map's
    offset out along the normal and its lag towards the light: the mean of four places round each, on its surface. A
    texel's own place is lost in it, so that edges of shadows have no steps (Reeves, Salesin, Cook 1987)."""
    for i in range(points.shape[0]):
        n = ti.Vector([normals[i, k] for k in ti.static(range(3))])
        p = ti.Vector([points[i, k] for k in ti.static(range(3))]) + deep.offset * n
        u, v, depth = _on_map(axes, p[0], p[1], p[2])  # pyright: ignore[reportIndexIssue]
        # How the surface's depth changes across the map [m a texel]: of one that light grazes as of a steep one.
        away = ti.min(n.dot(ti.Vector([axes[AWAY, k] for k in ti.static(range(3))])), -STEEPEST)
        along_u = -n.dot(ti.Vector([axes[RIGHT, k] for k in ti.static(range(3))])) / (away * axes[SCALE, 0])
        along_v = -n.dot(ti.Vector([axes[UP, k] for k in ti.static(range(3))])) / (away * axes[SCALE, 0])
        light = 0.0
        for k in ti.static(range(4)):
            at = ROUND[k]
            behind = depth - deep.lag + at[0] * along_u + at[1] * along_v
            light += 0.25 * _through(soft, deep, levels, u + at[0], v + at[1], behind, nearest, through)
        light_out[i] = light


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
            moved = side * (lag[i] * _slope(cosine))
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
