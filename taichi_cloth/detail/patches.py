"""Patches: crossings of a cell, or of a part of it, seen, counted and laid.

A patch's fibre blocks are numbered through: layer by layer, pick by pick, end by end, first the warp end's block of a
crossing and then the weft pick's. Their particles come one after the other; where they fade, each has its chance.
"""

import taichi as ti

from taichi_cloth.detail.directions import DIRECTIONS, VIEWS, turned
from taichi_cloth.detail.thinning import FADE
from taichi_cloth.detail.view import View, in_frustum, seen_at, tiles_of
from taichi_cloth.fabric.cell_blocks import (
    cell_block,
    cell_crossing,
    cell_shades,
    cell_span,
    cell_template,
    cell_turned_in,
    cell_widths,
)
from taichi_cloth.fabric.cells import TEMPLATES, CellPack
from taichi_cloth.fabric.laying import frame_at, lay_particle
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I16x2, I32x1, I32x2, Template
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
from taichi_cloth.ground.vectors import chunk_count, chunk_steps
from taichi_cloth.yarn.places import hashed

__all__ = [
    "CELL", "CHUNKS", "FEW", "FIRST_END", "FIRST_PICK", "LAYERS", "LEVEL", "PANEL", "PATCH", "PATCH_ENDS",
    "PATCH_PICKS", "SPREAD", "TONES", "count", "cut_away", "lay", "look", "look_at", "patch_block", "placed_block",
]  # fmt: skip

CELL, PANEL, FIRST_PICK, FIRST_END, PATCH_PICKS, PATCH_ENDS, LAYERS, LEVEL = range(8)
"""Numbers of a patch: its cell and panel, its first pick and end in the panel, how many of each, layers, level."""
PATCH = 8
TONES, SPREAD = 9, 17
FEW = SPREAD + 8 * DIRECTIONS
"""Numbers that `SheetLook` has of a level of fibres; where those of tones and of directions begin."""
CHUNKS = 16


@ti.kernel
def look(cloth: CellPack, patch: I32x2, view: View, reach: F32x1, boxes_out: I16x2, depth_out: F32x1):
    """Boxes of tiles and depth of patches, first > last for those out of view. reach: beyond the crossings [m], and
    then from the middle."""
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
        reach[q] = r
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


@ti.func
def patch_block(patch: I32x2, cloth: Template, q, e):
    """Block e of patch q: its family, the pick and the end where it begins, its thread and its place along it, and
    where its particles stand among the templates' and how many they are."""
    high, wide = patch[q, PATCH_PICKS], patch[q, PATCH_ENDS]
    family, c = e % 2, (e // 2) % (high * wide)
    i, j = patch[q, FIRST_PICK] + c // wide, patch[q, FIRST_END] + c % wide
    yarn, along, made = cell_template(cloth, patch[q, PANEL], family, i, j)
    base, size = 0, 0
    if made >= 0:
        kind = patch[q, LEVEL] * cloth.grid[TEMPLATES] + made
        base = ti.cast(cloth.start[kind], ti.i32)
        size = ti.cast(cloth.start[kind + 1], ti.i32) - base
    return family, i, j, yarn, along, base, size


@ti.func
def placed_block(patch: I32x2, under: F32x1, cloth: Template, q, e, yarn, along):
    """From where to where block e of patch q is not cut away, and its ends as of `cell_block`."""
    cell, p, high, wide = patch[q, CELL], patch[q, PANEL], patch[q, PATCH_PICKS], patch[q, PATCH_ENDS]
    family, c, layer = e % 2, (e // 2) % (high * wide), (e // 2) // (high * wide)
    i, j = patch[q, FIRST_PICK] + c // wide, patch[q, FIRST_END] + c % wide
    since, up_to = cell_span(cloth, yarn, along)
    p0, p1, a0, a1, n0, n1 = cell_block(cloth, p, cell, family, i, j)
    if layer > 0:
        if not cell_turned_in(cloth, p, cell, i, j):
            since, up_to = 1.0, 0.0
        # Under the first and half a thread beside it, its wrong side up: turned about the yarn.
        p0 += 0.5 * under[1 + family] * n0.cross(a0).normalized() - 2.0 * under[0] * n0
        p1 += 0.5 * under[1 + family] * n1.cross(a1).normalized() - 2.0 * under[0] * n1
        n0, n1 = -n0, -n1
    return since, up_to, p0, p1, a0, a1, n0, n1


@ti.func
def cut_away(since, up_to, u):
    """Whether a particle at u along its block is."""
    return since > up_to or (u < since and since > 0.0) or (u > up_to and up_to < 1.0)


@ti.func
def _by_angle(few: F32x2, p, at, near):
    """A number of panel p for cloth that is seen at a flat angle, 0, to nearly from above, 1: of the first `VIEWS` and,
    four places on, of the other."""
    return (1.0 - near) * few[p, at] + near * few[p, at + 4]


@ti.kernel
def lay(
    bounds: I32x1,
    chosen: I32x1,
    starts: I32x1,
    patch: I32x2,
    share: F32x1,
    under: F32x1,
    eye: F32x1,
    shades: F32x2,
    cloth: CellPack,
    # out
    groups_out: F32x3,
    yarn_out: I32x1,
):
    """Particles of chosen patches, in groups, and the thread of each.

    bounds: (CHUNKS + 1,) first of the chosen of each chunk of work. starts: (chosen + 1,) where each one's particles
    stand. share: of each patch's particles that are drawn, 1 for all; the last of them fade (`thinning.FADE`). under:
    (3,) how far the cloth's right side lies above its middle, and how far warp ends and weft picks lie apart [m].
    eye: where it is (3,) [m], and how far normals of each level lean to it. shades: of each panel `alone`
    as of `cell_shades`, then of each level `SheetLook.few`.
    """
    for step in range(ti.static(chunk_count(CHUNKS) * chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for k in range(bounds[chunk], bounds[chunk + 1]):
            q = chosen[k]
            p, at, last, e = patch[q, PANEL], starts[k], starts[k + 1], 0
            while at < last:
                # The next block.
                family, i, j, yarn, along, base, size = patch_block(patch, cloth, q, e)
                since, up_to, p0, p1, a0, a1, n0, n1 = placed_block(patch, under, cloth, q, e, yarn, along)
                w0, w1 = cell_widths(cloth, family, yarn, along)
                right, wrong = cell_shades(cloth, p, family, yarn, i, j, shades)
                few = 4 + FEW * patch[q, LEVEL]
                for m in range(size):
                    t = base + m
                    x, d, outward, radius = lay_particle(cloth.particle, t, p0, p1, a0, a1, n0, n1, w0, w1)
                    on_right = cloth.particle[t, COLUMN.normal + 2] > 0.0
                    lean = eye[3 + patch[q, LEVEL]]
                    way, near = ti.Vector([0.0, 0.0, 0.0]), 0.5
                    if lean > 0.0:
                        way = (ti.Vector([eye[0], eye[1], eye[2]]) - x).normalized()  # pyright: ignore[reportOptionalCall]
                        near = ti.math.clamp((ti.abs(way.dot(n0)) - VIEWS[0]) / (VIEWS[1] - VIEWS[0]), 0.0, 1.0)
                    u, of = cloth.particle[t, COLUMN.u], family if on_right else 2 + family
                    if patch[q, LEVEL] > 0 and cloth.particle[t, COLUMN.openness] < 1.0:
                        chances = ti.Vector([0.0, 0.0, 0.0, 0.0])
                        for c in ti.static(range(4)):
                            chances[c] = hashed(yarn * 64 + along % 64, 4 * m + 4096 + c) / 16777216.0
                        spread = few + SPREAD + DIRECTIONS * (4 + of if chances[3] < near else of)
                        a, c, n = frame_at(a0, a1, n0, n1, u)
                        own = ti.Vector([cloth.particle[t, COLUMN.tangent + k] for k in range(3)])
                        out = ti.Vector([cloth.particle[t, COLUMN.normal + k] for k in range(3)])
                        own, out = turned(
                            own, out, a.dot(way), shades, p, spread, chances[0], chances[1], chances[2]
                        )  # fmt: skip
                        d = own[0] * a + own[1] * c + own[2] * n  # pyright: ignore[reportIndexIssue]
                        outward = out[0] * a + out[1] * c + out[2] * n  # pyright: ignore[reportIndexIssue]
                        radius *= shades[p, few]
                    if lean > 0.0:
                        outward = (outward + lean * way).normalized()
                    if share[q] < 1.0:
                        chance = ti.cast(hashed(yarn * 64 + along % 64, m), ti.f32) / 16777216.0
                        radius *= ti.math.clamp((share[q] - (1.0 - FADE) * chance) / FADE, 0.0, 1.0)
                    group, lane = at // LANES, at % LANES
                    shut = _by_angle(shades, p, few + 1 + of, near)
                    tone = cloth.particle[t, COLUMN.tone] * _by_angle(shades, p, few + TONES + of, near)
                    dyed = right if on_right else wrong
                    for axis in ti.static(range(3)):
                        groups_out[POSITION + axis, group, lane] = x[axis]
                        groups_out[TANGENT + axis, group, lane] = d[axis]
                        groups_out[NORMAL + axis, group, lane] = outward[axis]
                        groups_out[COLOUR + axis, group, lane] = dyed[axis] * tone  # pyright: ignore[reportIndexIssue]
                    groups_out[RADIUS, group, lane] = 0.0 if cut_away(since, up_to, u) else radius
                    groups_out[HALF_LENGTH, group, lane] = cloth.particle[t, COLUMN.half_length]
                    groups_out[OPENNESS, group, lane] = 1.0 - shut * (1.0 - cloth.particle[t, COLUMN.openness])
                    yarn_out[at] = yarn
                    at += 1
                e += 1
