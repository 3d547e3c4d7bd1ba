"""Reading a deep opacity map (see `transmittance`), for particles and for any points."""

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET, RADIUS
from taichi_cloth.ground.vectors import Octets, each, keep, lanes, of_group, set_row

from ..data.light_sizes import LAYERS
from ..tiles.compiling import left_to_llvm
from .deep_map import AWAY, ORIGIN, RIGHT, SCALE, UP, DeepMap, moved_out
from .transmittance import layer_of

__all__ = ["gather", "look_up", "on_surface", "slope"]

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
def slope(cosine):
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
    cloth there: read nearer to the light by as much as leads out of it; and at row + 2 what reaches the fibres around
    it, on the side of the light: read nearer by a part of that.

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
        depth -= deep.lag * slope(cosine) + 0.5 * size
        light, outside, around = each(1.0), each(1.0), each(1.0)
        for i in range(ti.static(lanes())):
            light[i] = _through(soft, deep, levels, u[i], v[i], depth[i], nearest, through)
        if ti.static(bulk):
            for i in range(ti.static(lanes())):
                outside[i] = _through(soft, deep, levels, u[i], v[i], depth[i] - deep.beyond, nearest, through)
            for i in range(ti.static(lanes())):
                around[i] = _through(soft, deep, levels, u[i], v[i], depth[i] - deep.around, nearest, through)
            set_row(light_out, b, row + 1, ti.select(size > 0.0, outside, 1.0))
            set_row(light_out, b, row + 2, ti.select(size > 0.0, around, 1.0))
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
