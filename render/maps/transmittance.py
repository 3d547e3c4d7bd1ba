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
gives the same map for any number of bands. On a device where arrays stay a particle has a thread, and what threads add
to one texel are whole numbers: it does not matter who is first.
"""

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, I32x2, Int, Template
from taichi_cloth.ground.particles import OCTET
from taichi_cloth.ground.vectors import CHUNK_STEPS, Blocks, Vec16

from ..data.light_sizes import LAYERS
from .decay import decay
from .deep_map import EMPTY, DeepMap, deepen, laid, lower
from .stamps import BEHIND, EDGE, OPTICAL, POINTS, REACH, S_X, S_Y, STEP_BEHIND, STEP_U, STEP_V, T_X, T_Y, WIDE, U, V

__all__ = ["coarsen", "deposit", "layer_of"]


@ti.func
def layer_of(behind, deep: Template):
    """The layer coordinate k of a place `behind` metres behind the first depth."""
    squared = deep.root * deep.root
    return ti.sqrt(ti.sqrt(behind * deep.span + squared * squared)) - deep.root


@ti.func
def _points(turn, deep: Template, stamps: F32x3, b, lane, top, bottom, nearest: F32x1, through: Blocks, counts: I32x2):
    """What is laid at points, in the rows top to bottom: into the first depths, then into the layers."""
    width = deep.width
    count = ti.cast(stamps[b, POINTS, lane], ti.i32)
    u = stamps[b, U, lane]
    v = stamps[b, V, lane]
    depth = stamps[b, BEHIND, lane]
    for k in range(count):  # pyright: ignore[reportArgumentType]
        row = ti.cast(v, ti.i32)
        if row >= top - 1 and row <= bottom:
            left = ti.min(ti.max(ti.cast(u, ti.i32), 0), width - 2)
            # Four texels side by side; a row that is not of this band takes nothing.
            one = ti.max(row, top) * width + left
            two = ti.min(row + 1, bottom) * width + left
            if turn == 0:
                first = depth if row >= top else EMPTY
                second = depth if row < bottom else EMPTY
                lower(nearest, one, first)
                lower(nearest, one + 1, first)
                lower(nearest, two, second)
                lower(nearest, two + 1, second)
            else:
                near = ti.Vector([nearest[one], nearest[one + 1], nearest[two], nearest[two + 1]])
                layer = _layer(depth, near, deep)
                optical = stamps[b, OPTICAL, lane]
                g = v - row
                second = optical * g if row < bottom else 0.0
                first = optical - optical * g if row >= top else 0.0
                f = u - left
                deepen(through, counts, one, layer[0], first - first * f)  # pyright: ignore[reportIndexIssue]
                deepen(through, counts, one + 1, layer[1], first * f)  # pyright: ignore[reportIndexIssue]
                deepen(through, counts, two, layer[2], second - second * f)  # pyright: ignore[reportIndexIssue]
                deepen(through, counts, two + 1, layer[3], second * f)  # pyright: ignore[reportIndexIssue]
        if k + 1 < count:
            u += stamps[b, STEP_U, lane]
            v += stamps[b, STEP_V, lane]
            depth += stamps[b, STEP_BEHIND, lane]


@ti.func
def _layer(depth, nearest, deep: Template):
    """The layer that a place `depth` [m] deep dims: it lies in the one before."""
    k = layer_of(ti.max(depth - nearest, 0.0), deep)
    return ti.min(ti.cast(k, ti.i32) + 1, ti.static(LAYERS - 1))


@ti.func
def _disc(turn, deep: Template, stamps: F32x3, b, lane, top, bottom, nearest: F32x1, through: Blocks, counts: I32x2):
    """What covers more than four texels, in the rows top to bottom: into the first depths, then into the layers."""
    u = stamps[b, U, lane]
    v = stamps[b, V, lane]
    depth = stamps[b, BEHIND, lane]
    reach = stamps[b, REACH, lane]
    wide = stamps[b, WIDE, lane]
    left = ti.max(ti.cast(ti.ceil(u - wide - 0.5), ti.i32), 0)
    right = ti.min(ti.cast(ti.floor(u + wide - 0.5), ti.i32), deep.width - 1)
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
                cell = y * deep.width + x
                if turn == 0:
                    lower(nearest, cell, depth)
                else:
                    layer = _layer(depth, nearest[cell], deep)
                    deepen(
                        through, counts, cell, layer, stamps[b, OPTICAL, lane] * ti.min(q * stamps[b, EDGE, lane], 1.0)
                    )


@ti.func
def _lay(turn, deep: Template, stamps: F32x3, b, lane, top, bottom, nearest: F32x1, through: Blocks, counts: I32x2):
    """One particle, in the rows top to bottom."""
    if stamps[b, EDGE, lane] == 0.0:
        _points(turn, deep, stamps, b, lane, top, bottom, nearest, through, counts)
    else:
        _disc(turn, deep, stamps, b, lane, top, bottom, nearest, through, counts)


@ti.func
def _let_through(walled: Template, deep: Template, cell, wall: F32x1, nearest: F32x1, through: Blocks, counts: I32x2):
    """Optical depths of a texel summed from layer to layer, and the transmittance; none behind a wall."""
    row = laid(through, counts, cell)
    total = 0.0
    for k in ti.static(range(LAYERS)):
        total += row[k]
        row[k] = total
    passing = decay(row)
    if ti.static(walled):
        a = deep.root * deep.root
        a *= a
        for k in ti.static(range(LAYERS)):
            up = (k + deep.root) * (k + deep.root)
            if nearest[cell] + (up * up - a) / deep.span >= wall[cell]:
                passing[k] = 0.0  # pyright: ignore[reportIndexIssue]
    through[cell, 0] = passing


@ti.kernel
def deposit(
    bands: Int,
    walled: Template,
    deep: DeepMap,
    # stamps:
    octet_count: Int,
    stamps: F32x3,
    spans: I32x2,
    cuts: I32x1,
    wall: F32x1,
    # out: first depths; optical depths, of which transmittances are made in place
    nearest_out: F32x1,
    through_out: Blocks,
    counts: I32x2,
):
    """The map: first depth and the transmittance at every layer boundary, shape (texels,) and (texels, 1, 16).

    cuts: band b has the rows cuts[b] to cuts[b + 1]. wall: first depth of what lets nothing through, EMPTY where
    there is none, shape (texels,). counts: zeros (texels, 16), see `deepen`.
    """
    if ti.static(runtime.resident()):
        texels = deep.width * cuts[bands]
        for cell in range(texels):
            nearest_out[cell] = wall[cell] if ti.static(walled) else EMPTY
        for turn in ti.static(range(2)):
            for i in range(octet_count * OCTET):
                _lay(turn, deep, stamps, i // OCTET, i % OCTET, 0, cuts[bands] - 1, nearest_out, through_out, counts)
        for cell in range(texels):
            if nearest_out[cell] < EMPTY:
                _let_through(walled, deep, cell, wall, nearest_out, through_out, counts)
    else:
        # Elsewhere than on a CPU a texel has a thread of its own wherever nothing is laid.
        if ti.static(not runtime.on_host()):
            for cell in range(deep.width * cuts[bands]):
                nearest_out[cell] = wall[cell] if ti.static(walled) else EMPTY
        for step in range(bands * CHUNK_STEPS):
            if step % CHUNK_STEPS != 0:
                continue
            width = deep.width
            band = step // CHUNK_STEPS
            top = cuts[band]
            bottom = cuts[band + 1] - 1
            if ti.static(runtime.on_host()):
                for cell in range(top * width, (bottom + 1) * width):
                    nearest_out[cell] = wall[cell] if ti.static(walled) else EMPTY
            # First where light meets something, then what each layer takes of it.
            for turn in range(2):
                for b in range(octet_count):
                    if spans[b, 0] <= bottom and spans[b, 1] >= top:
                        for lane in range(OCTET):
                            _lay(turn, deep, stamps, b, lane, top, bottom, nearest_out, through_out, counts)
                if ti.static(runtime.on_host()):  # noqa: SIM102 (elsewhere they come as zeros)
                    if turn == 0:
                        for cell in range(top * width, (bottom + 1) * width):
                            if nearest_out[cell] < EMPTY:
                                through_out[cell, 0] = Vec16(0.0)
            if ti.static(runtime.on_host()):
                for cell in range(top * width, (bottom + 1) * width):
                    if nearest_out[cell] < EMPTY:
                        _let_through(walled, deep, cell, wall, nearest_out, through_out, counts)
        if ti.static(not runtime.on_host()):
            for cell in range(deep.width * cuts[bands]):
                if nearest_out[cell] < EMPTY:
                    _let_through(walled, deep, cell, wall, nearest_out, through_out, counts)


@ti.kernel
def coarsen(
    first: Int,
    width: Int,
    coarse_first: Int,
    coarse_width: Int,
    coarse_height: Int,
    deep: DeepMap,
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
            a = deep.root * deep.root
            a *= a
            for k in range(LAYERS):
                up = k + deep.root
                up *= up
                boundary = near + (up * up - a) / deep.span
                total = 0.0
                for child in ti.static(range(4)):
                    source = corner + (child // 2) * width + child % 2
                    behind = boundary - nearest[source]
                    value = 1.0
                    if behind > 0.0:
                        at = layer_of(behind, deep)
                        low = ti.min(ti.cast(at, ti.i32), ti.static(LAYERS - 2))
                        part = ti.min(at - low, 1.0)
                        value = through[source, low] + part * (through[source, low + 1] - through[source, low])
                    total += 0.25 * value
                through[coarse_first + cell, k] = total
