"""Reading a deep opacity map (see `transmittance`): for particles and for any points."""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import taichi as ti

from .arrays import LANES, Float, Floats1, Floats2, Floats3, Int, Ints2, Switch, keep
from .blocks import NORMAL, POSITION, RADIUS
from .light_sizes import LAYERS
from .transmittance import AWAY, ORIGIN, RIGHT, SCALE, UP, layer_of

__all__ = ["gather", "look_up"]


@ti.func
def _bilinear(first, width, height, u, v, depth, span, root, nearest: Floats1, through: Floats2):
    """Transmittance at u, v [texels of this level] and a depth [m]; and how far behind the first depth [m]."""
    column = ti.min(ti.max(u - 0.5, 0.0), ti.cast(width - 1, ti.f32))
    row = ti.min(ti.max(v - 0.5, 0.0), ti.cast(height - 1, ti.f32))
    left = ti.min(ti.cast(column, ti.i32), width - 2)
    top = ti.min(ti.cast(row, ti.i32), height - 2)
    f = column - left
    g = row - top
    total = 0.0
    farthest = 0.0
    for j in ti.static(range(2)):
        for i in ti.static(range(2)):
            weight = (f if ti.static(i == 1) else 1.0 - f) * (g if ti.static(j == 1) else 1.0 - g)
            cell = first + (top + j) * width + left + i
            behind = depth - nearest[cell]
            value = 1.0
            if behind > 0.0:
                farthest = ti.max(farthest, behind)
                at = layer_of(behind, span, root) - 1.0
                if at > 0.0:
                    low = ti.min(ti.cast(at, ti.i32), ti.static(LAYERS - 2))
                    part = ti.min(at - low, 1.0)
                    value = through[cell, low] + part * (through[cell, low + 1] - through[cell, low])
            total += weight * value
    return total, farthest


@ti.func
def _through(soft: Switch, levels: Ints2, u, v, depth, softness, span, root, nearest: Floats1, through: Floats2):
    """Transmittance at a place of the map. softness: width of the penumbra [texels] per metre behind the blocker.

    levels: rows (first texel, width, height). Between two levels the two are mixed, as in a mip map.
    """
    value = 1.0
    level = -1.0
    if ti.static(soft):
        # What stops the light of a penumbra may stand beside this texel: look as wide as the coarsest level.
        top = levels.shape[0] - 1
        wide = 1.0 / ti.cast(1 << top, ti.f32)
        far, behind = _bilinear(
            levels[top, 0], levels[top, 1], levels[top, 2], u * wide, v * wide, depth, span, root, nearest, through
        )
        # The mean of a texel read bilinearly blurs an edge over one to two texels, by where it falls in them.
        if behind * softness > 1.5:
            level = ti.min(ti.log(behind * softness / 1.5) * 1.4427, ti.cast(top, ti.f32))
            low = ti.min(ti.cast(level, ti.i32), top - 1)
            scale = 1.0 / ti.cast(1 << low, ti.f32)
            value, behind = _bilinear(
                levels[low, 0], levels[low, 1], levels[low, 2],
                u * scale, v * scale, depth, span, root, nearest, through,
            )  # fmt: skip
            if low + 1 < top:
                far, behind = _bilinear(
                    levels[low + 1, 0], levels[low + 1, 1], levels[low + 1, 2],
                    0.5 * u * scale, 0.5 * v * scale, depth, span, root, nearest, through,
                )  # fmt: skip
            value += (level - low) * (far - value)
    if level < 0.0:
        value, _ = _bilinear(levels[0, 0], levels[0, 1], levels[0, 2], u, v, depth, span, root, nearest, through)
    return value


@ti.func
def _slope(cosine):
    """1 + tan of the angle between light and normal, up to 4: how the depth of a surface varies over a texel."""
    return 1.0 + ti.min(ti.sqrt(ti.max(1.0 - cosine * cosine, 0.0)) / ti.max(cosine, 0.05), 3.0)


@ti.kernel
def gather(
    soft: Switch,
    particles: Floats3,
    axes: Floats2,
    offset: Float,
    lag: Float,
    levels: Ints2,
    softness: Float,
    span: Float,
    root: Float,
    nearest: Floats1,
    through: Floats2,
    row: Int,
    # out:
    light_out: Floats3,
):
    """light_out[block, row, lane]: the light that reaches each particle, 0..1.

    A particle reads at its centre moved `offset` [m] and half its radius out along its normal, and half its
    radius and `lag` [m], more where the surface slopes, towards the light: the places where its own neighbours
    on the surface do not yet shadow it.
    """
    keep(light_out, (0, 0, 0), row)
    for i in range(particles.shape[1] * LANES):
        b = i // LANES
        lane = i % LANES
        value = 1.0
        size = particles[RADIUS, b, lane]
        if size > 0.0:
            out = offset + 0.5 * size
            px = particles[POSITION, b, lane] + out * particles[NORMAL, b, lane]
            py = particles[POSITION + 1, b, lane] + out * particles[NORMAL + 1, b, lane]
            pz = particles[POSITION + 2, b, lane] + out * particles[NORMAL + 2, b, lane]
            u = (px * axes[RIGHT, 0] + py * axes[RIGHT, 1] + pz * axes[RIGHT, 2] - axes[ORIGIN, 0]) * axes[SCALE, 0]
            v = (px * axes[UP, 0] + py * axes[UP, 1] + pz * axes[UP, 2] - axes[ORIGIN, 1]) * axes[SCALE, 0]
            depth = px * axes[AWAY, 0] + py * axes[AWAY, 1] + pz * axes[AWAY, 2] - axes[ORIGIN, 2]
            cosine = -(
                axes[AWAY, 0] * particles[NORMAL, b, lane]
                + axes[AWAY, 1] * particles[NORMAL + 1, b, lane]
                + axes[AWAY, 2] * particles[NORMAL + 2, b, lane]
            )
            depth -= lag * _slope(cosine) + 0.5 * size
            value = _through(soft, levels, u, v, depth, softness, span, root, nearest, through)
        light_out[b, row, lane] = value


@ti.kernel
def look_up(
    soft: Switch,
    points: Floats2,
    axes: Floats2,
    lag: Float,
    levels: Ints2,
    softness: Float,
    span: Float,
    root: Float,
    nearest: Floats1,
    through: Floats2,
    # out:
    light_out: Floats1,
):
    """light_out[i]: the light that reaches points (n, 3) [m], 0..1, read `lag` [m] towards the light."""
    for i in range(points.shape[0]):
        px = points[i, 0]
        py = points[i, 1]
        pz = points[i, 2]
        u = (px * axes[RIGHT, 0] + py * axes[RIGHT, 1] + pz * axes[RIGHT, 2] - axes[ORIGIN, 0]) * axes[SCALE, 0]
        v = (px * axes[UP, 0] + py * axes[UP, 1] + pz * axes[UP, 2] - axes[ORIGIN, 1]) * axes[SCALE, 0]
        depth = px * axes[AWAY, 0] + py * axes[AWAY, 1] + pz * axes[AWAY, 2] - axes[ORIGIN, 2] - lag
        light_out[i] = _through(soft, levels, u, v, depth, softness, span, root, nearest, through)
