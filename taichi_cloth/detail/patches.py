"""Patches: crossings of a cell, or of a part of it, seen, counted and laid.

A patch's fibre blocks are numbered through: layer by layer, pick by pick, end by end, first the warp end's block of a
crossing and then the weft pick's. Where a patch is drawn whole, its blocks come one after the other; where a sample of
it is drawn, particle m is of the crossing that an even sequence gives, at random which of the block's.
"""

import taichi as ti

from taichi_cloth.detail.view import View, in_frustum, seen_at, tiles_of
from taichi_cloth.fabric.cell_blocks import (
    cell_block,
    cell_crossing,
    cell_shade,
    cell_span,
    cell_template,
    cell_turned_in,
    hashed,
)
from taichi_cloth.fabric.cells import TEMPLATES, CellPack
from taichi_cloth.fabric.laying import lay_particle
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I16x2, I32x1, I32x2
from taichi_cloth.ground.particles import (
    COLOUR,
    HALF_LENGTH,
    LANES,
    NORMAL,
    OPENNESS,
    POSITION,
    RADIUS,
    TANGENT,
    TILE,
)

__all__ = [
    "CELL", "CHUNKS", "FIRST_END", "FIRST_PICK", "LAYERS", "LEVEL", "PANEL", "PATCH", "PATCH_ENDS", "PATCH_PICKS",
    "count", "lay", "look", "look_at",
]  # fmt: skip

CELL, PANEL, FIRST_PICK, FIRST_END, PATCH_PICKS, PATCH_ENDS, LAYERS, LEVEL = range(8)
"""Numbers of a patch: its cell and panel, its first pick and end in the panel, how many of each, layers, level."""
PATCH = 8
MANY = 16
"""Draws for a particle of a sample, on average, after which any is taken."""
ROUND = 1.5
"""Length over width of the particles of a small sample: longer ones would be streaks across stripes."""
CHUNKS = 16
CHUNK_STEPS = 1024  # Taichi on a CPU gives a thread at least 512 iterations (see render/tiles/sort.py)
EVEN_PICK, EVEN_END = 0.7548776662, 0.5698402910
"""From one particle of a sample to the next, in shares of the patch: the inverse of the plastic number, and its square
(M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018)."""


@ti.kernel
def look(cloth: CellPack, patch: I32x2, reach: F32x1, view: View, boxes_out: I16x2, depth_out: F32x1):
    """Boxes of tiles and depth of patches, first > last for those out of view. reach: beyond the crossings [m]."""
    for q in range(patch.shape[0]):
        cell, p = patch[q, CELL], patch[q, PANEL]
        i, j, high, wide = patch[q, FIRST_PICK], patch[q, FIRST_END], patch[q, PATCH_PICKS], patch[q, PATCH_ENDS]
        # The sphere round its corners, from its middle.
        middle, _u, _v = cell_crossing(cloth, p, cell, i + high // 2, j + wide // 2)
        r = 0.0
        for corner in range(4):
            x, _s, _t = cell_crossing(cloth, p, cell, i + high * (corner // 2), j + wide * (corner % 2))
            r = ti.max(r, (x - middle).norm())  # pyright: ignore[reportOptionalCall]
        r = 1.15 * r + reach[q]
        _box(view, seen_at(view, middle), r, q, boxes_out, depth_out)


@ti.kernel
def look_at(sphere: F32x2, view: View, boxes_out: I16x2, depth_out: F32x1):
    """Likewise of spheres, a row each: middle and radius [m]."""
    for q in range(sphere.shape[0]):
        at = seen_at(view, ti.Vector([sphere[q, 0], sphere[q, 1], sphere[q, 2]]))
        _box(view, at, sphere[q, 3], q, boxes_out, depth_out)


@ti.func
def _box(view: View, at, r, q, boxes_out: I16x2, depth_out: F32x1):
    """Box and depth of a sphere with its middle there, in the camera's axes."""
    left, right, top, bottom = 1, 0, 1, 0
    if in_frustum(view, at, r, 4.0):
        left, right = 0, ti.cast(view.width - 1, ti.i32) // TILE
        top, bottom = 0, ti.cast(view.height - 1, ti.i32) // TILE
        if at[2] - r > view.near:
            left, right, top, bottom = tiles_of(view, at, r, 4.0)
    if left > right or top > bottom:
        left, right, top, bottom = 1, 0, 1, 0
    boxes_out[q, 0] = ti.cast(left, ti.i16)
    boxes_out[q, 1] = ti.cast(right, ti.i16)
    boxes_out[q, 2] = ti.cast(top, ti.i16)
    boxes_out[q, 3] = ti.cast(bottom, ti.i16)
    depth_out[q] = at[2]


@ti.kernel
def count(cloth: CellPack, patch: I32x2, chosen: I32x1, counts_out: I32x1):
    """Particles of patches that are drawn whole."""
    for k in range(chosen.shape[0]):
        q = chosen[k]
        p, crossings = patch[q, PANEL], patch[q, PATCH_PICKS] * patch[q, PATCH_ENDS]
        total = 0
        for e in range(2 * crossings * patch[q, LAYERS]):
            c = (e // 2) % crossings
            i, j = patch[q, FIRST_PICK] + c // patch[q, PATCH_ENDS], patch[q, FIRST_END] + c % patch[q, PATCH_ENDS]
            _yarn, _along, made = cell_template(cloth, p, e % 2, i, j)
            if made >= 0:
                t = patch[q, LEVEL] * cloth.grid[TEMPLATES] + made
                total += ti.cast(cloth.start[t + 1] - cloth.start[t], ti.i32)
        counts_out[q] = total


@ti.kernel
def lay(
    bounds: I32x1,
    chosen: I32x1,
    starts: I32x1,
    patch: I32x2,
    share: F32x1,
    grown: F32x1,
    beside: I32x1,
    under: F32x1,
    cloth: CellPack,
    # out
    groups_out: F32x3,
    yarn_out: I32x1,
):
    """Particles of chosen patches, in groups, and the thread of each.

    bounds: (CHUNKS + 1,) first of the chosen of each chunk of work. starts: (chosen + 1,) where each one's particles
    stand. share: of each patch's particles that are drawn, 1 for all. grown: factor of each chosen one's radii. beside:
    how many threads to each side lend it their colour. under: (7,) how far the cloth's right side lies above its
    middle, and how far warp ends and weft picks lie apart [m]; then 1 and where the eye is [m] that a sample is drawn
    for, or 0 for a sample of all sides.
    """
    for step in range(CHUNKS * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        for k in range(bounds[step // CHUNK_STEPS], bounds[step // CHUNK_STEPS + 1]):
            q = chosen[k]
            cell, p, high, wide = patch[q, CELL], patch[q, PANEL], patch[q, PATCH_PICKS], patch[q, PATCH_ENDS]
            whole = share[q] >= 1.0
            first_pick, first_end = patch[q, FIRST_PICK], patch[q, FIRST_END]
            seed = hashed(cell * 64 + first_pick % 64, first_end)
            at, last, e = starts[k], starts[k + 1], 0
            while at < last:
                # The next block: where, of which family, in which layer.
                family, c, layer = e % 2, (e // 2) % (high * wide), (e // 2) // (high * wide)
                i, j = first_pick + c // wide, first_end + c % wide
                if not whole:
                    s = ti.cast(seed & 4095, ti.f32) / 4096.0 + EVEN_PICK * e
                    t = ti.cast(seed >> 12, ti.f32) / 4096.0 + EVEN_END * e
                    i = first_pick + ti.min(ti.cast((s - ti.floor(s)) * high, ti.i32), high - 1)
                    j = first_end + ti.min(ti.cast((t - ti.floor(t)) * wide, ti.i32), wide - 1)
                    family, layer = (e + seed) % 2, 0
                    if patch[q, LAYERS] > 1:
                        layer = hashed(e, seed) % patch[q, LAYERS]
                yarn, along, made = cell_template(cloth, p, family, i, j)
                base, size, since, up_to = 0, 1, 1.0, 0.0
                if made >= 0:
                    kind = patch[q, LEVEL] * cloth.grid[TEMPLATES] + made
                    base = ti.cast(cloth.start[kind], ti.i32)
                    size = ti.cast(cloth.start[kind + 1], ti.i32) - base
                    since, up_to = cell_span(cloth, yarn, along)
                    if layer > 0 and not cell_turned_in(cloth, p, cell, i, j):
                        since, up_to = 1.0, 0.0
                few = e < MANY * (last - starts[k])
                if made < 0 and (whole or few):
                    size = 0
                p0, p1, a0, a1, n0, n1 = cell_block(cloth, p, cell, family, i, j)
                if not whole and size > 0:
                    base, size = base + hashed(seed, e) % size, 1
                    if under[3] > 0.0 and made >= 0 and few:
                        # What lies on the far side is hidden; in a sample of larger particles it would show through.
                        above = n0.dot(ti.Vector([under[4], under[5], under[6]]) - p0)
                        if layer > 0:
                            above = -above
                        if above * cloth.particle[base, COLUMN.offset + 2] < 0.0:
                            size = 0
                if layer > 0:
                    # Under the first and half a thread beside it, its wrong side up: turned about the yarn.
                    p0 += 0.5 * under[1 + family] * n0.cross(a0).normalized() - 2.0 * under[0] * n0
                    p1 += 0.5 * under[1 + family] * n1.cross(a1).normalized() - 2.0 * under[0] * n1
                    n0, n1 = -n0, -n1
                dyed = cell_shade(cloth, p, family, yarn, i, j, beside[k])
                for m in range(size):
                    t = base + m
                    x, d, outward = lay_particle(cloth.particle, t, p0, p1, a0, a1, n0, n1)
                    u = cloth.particle[t, COLUMN.u]
                    cut = since > up_to or (u < since and since > 0.0) or (u > up_to and up_to < 1.0)
                    group, lane = at // LANES, at % LANES
                    tone = cloth.particle[t, COLUMN.tone]
                    for axis in ti.static(range(3)):
                        groups_out[POSITION + axis, group, lane] = x[axis]
                        groups_out[TANGENT + axis, group, lane] = d[axis]
                        groups_out[NORMAL + axis, group, lane] = outward[axis]
                        groups_out[COLOUR + axis, group, lane] = dyed[axis] * tone  # pyright: ignore[reportIndexIssue]
                    radius, half_length = cloth.particle[t, COLUMN.radius], cloth.particle[t, COLUMN.half_length]
                    if not whole:
                        # Larger by as much as they are fewer, and rounder.
                        slender = ti.min(half_length / radius, ti.max(ROUND, half_length / radius * share[q]))
                        radius = ti.sqrt(radius * half_length / slender) * grown[k]
                        half_length = slender * radius
                    groups_out[RADIUS, group, lane] = 0.0 if cut else radius
                    groups_out[HALF_LENGTH, group, lane] = half_length
                    groups_out[OPENNESS, group, lane] = cloth.particle[t, COLUMN.openness]
                    yarn_out[at] = yarn
                    at += 1
                e += 1
