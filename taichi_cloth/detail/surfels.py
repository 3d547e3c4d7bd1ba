"""Surfels: small pieces of cloth that stand for k × k crossings each, where a thread is narrower than a pixel.

They lie evenly in a cell, on the side of the cloth that is seen, and are particles like all others: as a fibre's, each
has a direction and a normal, and together these spread as those of the fibres that are seen there. Their colour is the
mean of the threads under them, warp and weft in the shares that show on that side; as many lie as warp as of their
light is the warp's: of a denim most is of the pale weft, of which little is seen. How much they cover, and how bright
they are, is as measured on the fibres (`SheetLook`).
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.detail.patches import CELL, FEW, FIRST_END, FIRST_PICK, PANEL, PATCH_ENDS, PATCH_PICKS, SPREAD
from taichi_cloth.fabric.cell_blocks import cell_inside, cell_mean, cell_thick
from taichi_cloth.fabric.cells import (
    COL,
    COLS,
    END,
    ENDS,
    PER_CELL_ENDS,
    PER_CELL_PICKS,
    PICK,
    PICKS,
    ROW,
    CellPack,
)
from taichi_cloth.fabric.repeat import RepeatBank, WeaveRepeat
from taichi_cloth.fabric.surface import surface_at
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, I32x2
from taichi_cloth.ground.particles import COLOUR, HALF_LENGTH, LANES, NORMAL, OPENNESS, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import chunk_steps

__all__ = [
    "AREA",
    "FLANKS",
    "OPEN_WARP",
    "OPEN_WEFT",
    "TILTS",
    "TO_EYE",
    "TURNED",
    "WARP",
    "WEFT",
    "SheetLook",
    "guess_of",
    "lay_surfels",
]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

TILTS = (0.1, 0.3, 0.5, 0.65, 0.8, 1.0)
"""Cosines of the angle between the cloth's normal and the view at which a look is known."""
AREA, WARP, WEFT, OPEN_WARP, OPEN_WEFT = FACTORS = range(5)
"""Of a look: area of surfels over that of the cloth, factors of the warp's and the weft's colour, their openness."""
LEAN = 0.7
"""How far normals and directions lean from the cloth's, of what fibres' do."""
FLANKS, TO_EYE = 1.0, 0.35
"""How much farther, and how far towards the eye, where the cloth is seen edge-on."""
TURNED = 5.0
"""How far fibres turn to face the eye, which sees that side of a thread that goes over and under: this times the square
of how far they lean and the share of crossings at which it changes sides, for what floats is straight. By fibres of a
plain weave, a twill, a satin and a denim in lights from all sides (`docs/appearance.md`)."""
OVERLAP = 3.0
FEWEST = 0.05
"""Of the light, what the warp's or the weft's share must be for any surfels to lie so; from twice as much on as many do
as of the light is its. Fewer are specks: silk's weft shines where its warp is in shadow."""

EVEN_ROW, EVEN_COL = 0.7548776662, 0.5698402910
"""Of rows and columns, by which surfels take turns evenly: the inverse of the plastic number, and its square (M.
Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018)."""


@dataclass(frozen=True)
class SheetLook:
    """How the sheets of some repeats look, and few of their fibres.

    factor: (repeats, 2, TILTS, 5) of their right and their wrong side, what `AREA` and so on name. lean: (repeats, 6)
    of warp and of weft the mean sine by which normals lean across the thread, and by which fibres lean from the cloth's
    plane along it; and how far the one and the other turn to the eye along the thread. alone: (repeats, 4) what threads
    send back with nothing but black ones round them, over what they do among their like: of warp and of weft on the
    right side, then on the wrong one. few: (repeats, levels, FEW) of each level of fibres, by what their width is taken
    times, but of hairs; what they do not see of the sky, of warp and of weft on the right side, then on the wrong one,
    seen at a flat angle, and likewise from nearly above; of the same eight what their colour is taken times, and tables
    of directions (see `directions`).
    """

    factor: F32
    lean: F32
    alone: F32
    few: F32


def guess_of(bank: RepeatBank, repeats: tuple[WeaveRepeat, ...]) -> SheetLook:
    """A look before anything is measured: leans of the fibres on the upper side, colours by who lies on top."""
    factor = np.empty((len(repeats), 2, len(TILTS), len(FACTORS)), np.float32)
    lean = np.zeros((len(repeats), 6), np.float32)
    first = np.concatenate([bank.first, [bank.templates]])
    begin = 0
    for r, repeat in enumerate(repeats):
        kinds = repeat.layout.kinds.family
        up = float(repeat.layout.cloth.warp_up[:-1, :-1].mean())
        for family in (0, 1):
            of = [
                bank.particle[bank.start[first[k]] : bank.start[first[k + 1]]]
                for k in begin + np.flatnonzero(kinds == family)
            ]
            p = np.concatenate(of)
            high = (p[:, COLUMN.normal + 2] > 0) & (p[:, COLUMN.offset + 2] > 0)
            weight = np.where(high, p[:, COLUMN.radius] * p[:, COLUMN.half_length] * p[:, COLUMN.normal + 2], 0.0)
            for c, column in enumerate((COLUMN.normal + 1, COLUMN.tangent + 2)):
                square = float((weight * p[:, column] ** 2).sum() / max(float(weight.sum()), 1e-30))
                lean[r, 2 * family + c] = LEAN * square**0.5
            over = repeat.layout.cloth.warp_up
            changes = float((np.diff(over.astype(np.int8), axis=family) != 0).mean())
            lean[r, 4 + family] = TURNED * changes * lean[r, 1 + 2 * family] ** 2
        factor[r, ..., AREA] = OVERLAP * np.array(TILTS)
        factor[r, 0, :, WARP], factor[r, 0, :, WEFT] = up, 1.0 - up
        factor[r, 1, :, WARP], factor[r, 1, :, WEFT] = 1.0 - up, up
        factor[r, ..., OPEN_WARP] = factor[r, ..., OPEN_WEFT] = 0.8
        begin += len(kinds)
    few = np.ones((len(repeats), bank.levels, FEW), np.float32)
    few[..., SPREAD:] = 0.0
    return SheetLook(factor, lean, np.ones((len(repeats), 4), np.float32), few)


@ti.kernel
def lay_surfels(
    bounds: I32x1,
    chosen: I32x1,
    starts: I32x1,
    patch: I32x2,
    grid: I32x2,
    share: F32x1,
    look: F32x3,
    lean: F32x2,
    eye: F32x1,
    cloth: CellPack,
    # out
    groups_out: F32x3,
    yarn_out: I32x1,
):
    """Surfels of chosen patches, and the thread of each.

    bounds: (CHUNKS + 1,) first of the chosen of each chunk of work. starts: (chosen + 1,) where each one's begin. grid:
    (patches, 2) rows and columns of each one's. share: (patches,) of their area that is drawn. look: (panels, sides ·
    TILTS, 4), lean: (panels, 10) with what threads send back alone, see `SheetLook`. eye: 1 and where it is [m], or 0
    for the right side from above; then how far the surfels lie above the cloth's middle [m].
    """
    for step in range((bounds.shape[0] - 1) * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for k in range(bounds[chunk], bounds[chunk + 1]):
            q = chosen[k]
            cell, p, rows, cols = patch[q, CELL], patch[q, PANEL], grid[q, 0], grid[q, 1]
            # Of a thread at the panel's edge there is no block beyond it.
            high = ti.min(patch[q, PATCH_PICKS], cloth.panel[p, PICKS] - 1 - patch[q, FIRST_PICK])
            wide = ti.min(patch[q, PATCH_ENDS], cloth.panel[p, ENDS] - 1 - patch[q, FIRST_END])
            row0, col0 = cell // cloth.grid[COLS] - cloth.panel[p, ROW], cell % cloth.grid[COLS] - cloth.panel[p, COL]
            for m in range(rows * cols):
                row, col = m // cols, m % cols
                tall, broad = ti.cast(high, ti.f32) / rows, ti.cast(wide, ti.f32) / cols
                i = patch[q, FIRST_PICK] + (row + 0.5) * tall
                j = patch[q, FIRST_END] + (col + 0.5) * broad
                u, v = j / cloth.grid[PER_CELL_ENDS] - col0, i / cloth.grid[PER_CELL_PICKS] - row0
                x, by_u, by_v = surface_at(cloth.node, cell, cloth.grid[COLS], u, v)
                n = by_u.cross(by_v)  # pyright: ignore[reportOptionalMemberAccess]
                area = n.norm() * tall * broad / (cloth.grid[PER_CELL_ENDS] * cloth.grid[PER_CELL_PICKS])  # pyright: ignore[reportOptionalMemberAccess]
                n = n.normalized()  # pyright: ignore[reportOptionalMemberAccess]
                # From which side, and how flat, it is seen.
                above, tilt, side, way = 1.0, 1.0, 0, n
                if eye[0] > 0.0:
                    way = (ti.Vector([eye[1], eye[2], eye[3]]) - x).normalized()  # pyright: ignore[reportOptionalCall]
                    tilt = n.dot(way)
                    if tilt < 0.0:
                        above, side, tilt = -1.0, 1, -tilt
                number, part = 0, 0.0
                for t in ti.static(range(len(TILTS) - 1)):
                    if tilt >= TILTS[t]:
                        number, part = t, (tilt - TILTS[t]) / (TILTS[t + 1] - TILTS[t])
                part = ti.min(part, 1.0)
                number += side * ti.static(len(TILTS))
                seen = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0])
                for c in ti.static(FACTORS):
                    seen[c] = look[p, number, c] + part * (look[p, number + 1, c] - look[p, number, c])
                # Thick threads cover more, and are more of what is seen.
                warp_more, weft_more, covered = cell_thick(cloth, p, i, j, tall, broad)
                of_warp, of_weft = seen[WARP] * (1.0 + warp_more), seen[WEFT] * (1.0 + weft_more)
                both = (seen[WARP] + seen[WEFT]) / ti.max(of_warp + of_weft, 1e-6)
                of_warp, of_weft = both * of_warp, both * of_weft
                # Its colour, and what an outline leaves of it.
                dyed, opening, shown = cell_mean(
                    cloth, p, i, j, tall, broad, of_warp, of_weft, lean[p, 6 + 2 * side], lean[p, 7 + 2 * side],
                    seen[OPEN_WARP], seen[OPEN_WEFT],
                )  # fmt: skip
                inside = cell_inside(cloth, p, i, j, tall, broad)
                # As warp or as weft, by whose light it is, and to which side it leans.
                turn = (patch[q, FIRST_PICK] + row) * EVEN_ROW + (patch[q, FIRST_END] + col) * EVEN_COL
                turn -= ti.floor(turn)
                least = ti.min(shown, 1.0 - shown)
                least = ti.max(ti.min(least, 2.0 * (least - FEWEST)), 0.0)
                shown = least if shown < 0.5 else 1.0 - least
                warp = turn < shown
                turn = turn / ti.max(shown, 1e-6) if warp else (turn - shown) / ti.max(1.0 - shown, 1e-6)
                along = by_v.normalized() if warp else by_u.normalized()
                family = 0 if warp else 1
                out = above * n
                across = out.cross(along).normalized()
                to_side, to_end = lean[p, 2 * family], lean[p, 1 + 2 * family]
                if turn < 0.25 or turn > 0.75:
                    to_side = -to_side
                if turn < 0.5:
                    to_end = -to_end
                # Seen at a flat angle, threads show their flanks: normals lean farther, and towards the eye.
                to_side = ti.math.clamp(to_side * (1.0 + FLANKS * (1.0 - tilt)), -0.9, 0.9)
                facing = ti.sqrt(1.0 - to_side * to_side) * out + to_side * across
                facing = (facing + TO_EYE * (1.0 - tilt) * way).normalized()
                to_end = ti.math.clamp(to_end - lean[p, 4 + family] * way.dot(along), -0.9, 0.9)
                along = ti.sqrt(1.0 - to_end * to_end) * along + to_end * out
                at = starts[k] + m
                group, lane = at // LANES, at % LANES
                for axis in ti.static(range(3)):
                    groups_out[POSITION + axis, group, lane] = x[axis] + eye[4] * out[axis]
                    groups_out[TANGENT + axis, group, lane] = along[axis]
                    groups_out[NORMAL + axis, group, lane] = facing[axis]
                    groups_out[COLOUR + axis, group, lane] = dyed[axis]  # pyright: ignore[reportIndexIssue]
                # As wide as long: 32 / 15 r² is what it covers, see `render.splat.project`.
                radius = ti.sqrt(area * seen[AREA] * covered * inside * share[q] * (15.0 / 32.0))
                groups_out[RADIUS, group, lane] = radius
                groups_out[HALF_LENGTH, group, lane] = radius
                groups_out[OPENNESS, group, lane] = opening
                thread = cloth.panel[p, END] + ti.min(ti.cast(j + 0.5, ti.i32), cloth.panel[p, ENDS] - 1)
                if not warp:
                    thread = cloth.panel[p, PICK] + ti.min(ti.cast(i + 0.5, ti.i32), cloth.panel[p, PICKS] - 1)
                yarn_out[at] = thread
