"""Cloth woven on cells, nearer than its templates: where a fibre is many pixels wide it gets its own surface.

A bank's finest level has all fibres of a yarn, so that none must part as in `refine`: each particle of it becomes a
piece of fibre, and a piece that is wide enough points on its skin. What is farther is drawn as `CellStream` does.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.detail.cell_stream import CellStream, Seen, parted
from taichi_cloth.detail.patches import (
    CELL,
    FIRST_END,
    FIRST_PICK,
    LAYERS,
    LEVEL,
    PANEL,
    PATCH,
    PATCH_ENDS,
    PATCH_PICKS,
    count,
    cut_away,
    look,
    patch_block,
    placed_block,
)
from taichi_cloth.detail.pieces import (
    AFTER,
    BEFORE,
    BEYOND,
    FAMILY,
    MEETS,
    PARTED,
    PERIOD,
    PLACE,
    SKINNED,
    SURFACE,
    THREAD,
    TURN,
    WIDTH,
    place,
    reach_of,
)
from taichi_cloth.detail.skins import Skins
from taichi_cloth.detail.view import Pinhole, View, view_of
from taichi_cloth.fabric.cell_blocks import cell_shades, cell_template, cell_widths
from taichi_cloth.fabric.cells import TEMPLATES, CellPack
from taichi_cloth.fabric.laying import lay_particle
from taichi_cloth.fabric.surface import surface_points
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, Float, I32x1, I32x2, Int
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
from taichi_cloth.yarn.places import hashed

__all__ = ["NearCells"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
F64 = NDArray[np.float64]

WIDEST = 1.6
"""Of the finest level's mean radius: few fibres are wider. Where such have less than `SURFACE`, none has a surface."""
PERIODS = 20.0
"""Diameters of a fibre along a skin's period, about."""
ABOUT, ASIDE = 8, 0.02
"""Threads each way among which a crown is looked for, and how much height outweighs a way aside."""
MANY, BURIED = 64, 4.0
"""Pieces of more points are left without a surface where so many layers of others lie before them."""
CROWNS, PASSING = 400, 8.0
"""Crowns among which one is looked for, and radii of a fibre by which hairs have to pass it: a camera that comes
down to it goes by them, and one in its way would vanish at once."""
PARTS = 12
"""Patches across a region, at least, that it is cut out of a cloth by."""
MOST_CROSSINGS = 4000
"""Given a surface at a time, the nearest first: at a flat angle more may be near."""


@ti.kernel
def split_cells(
    chunks: Int,
    starts: I32x1,
    patch: I32x2,
    under: F32x1,
    core: I32x1,
    steps: Int,
    usual: Float,
    alone: F32x2,
    cloth: CellPack,
    # out
    pieces_out: F32x2,
):
    """Lay patches at the finest level, each particle as a piece.

    starts: (patches + 1,) where each one's pieces stand. under: as of `patches.lay`. core: particles of a block that
    are fibres, not hairs, of warp and of weft; they come first, `steps` of a fibre. usual: a skin's period is near
    this [m]. alone: as of `cell_shades`.
    """
    for step in range(chunks * 1024):
        if step % 1024 != 0:
            continue
        chunk = step // 1024
        for k in range(patch.shape[0] * chunk // chunks, patch.shape[0] * (chunk + 1) // chunks):
            at, last, e = starts[k], starts[k + 1], 0
            while at < last:
                family, i, j, yarn, along, base, size = patch_block(patch, cloth, k, e)
                since, up_to, p0, p1, a0, a1, n0, n1 = placed_block(patch, under, cloth, k, e, yarn, along)
                w0, w1 = cell_widths(cloth, family, yarn, along)
                right, wrong = cell_shades(cloth, patch[k, PANEL], family, yarn, i, j, alone)
                length = under[2 - family]
                periods = ti.max(1.0, ti.round(length / usual))
                for m in range(size):
                    t = base + m
                    x, d, outward, radius = lay_particle(cloth.particle, t, p0, p1, a0, a1, n0, n1, w0, w1)
                    u, tone = cloth.particle[t, COLUMN.u], cloth.particle[t, COLUMN.tone]
                    is_core = m < core[family]
                    dyed = right if cloth.particle[t, COLUMN.normal + 2] > 0.0 else wrong
                    line = m // steps if is_core else 100000 + m
                    ahead_of = ti.cast(hashed(line * 64, yarn + 101), ti.f32) / 16777216.0
                    turn = ti.cast(hashed(line * 64, yarn + 57), ti.f32) / 16777216.0
                    for c in ti.static(range(3)):
                        pieces_out[at, POSITION + c] = x[c]
                        pieces_out[at, TANGENT + c] = d[c]
                        pieces_out[at, NORMAL + c] = outward[c]
                        pieces_out[at, COLOUR + c] = dyed[c] * tone  # pyright: ignore[reportIndexIssue]
                    pieces_out[at, RADIUS] = 0.0 if cut_away(since, up_to, u) else radius
                    pieces_out[at, HALF_LENGTH] = cloth.particle[t, COLUMN.half_length]
                    pieces_out[at, OPENNESS] = cloth.particle[t, COLUMN.openness]
                    pieces_out[at, PLACE] = u * periods + ahead_of
                    pieces_out[at, PERIOD] = length / periods
                    pieces_out[at, TURN] = 6.2831853 * turn
                    pieces_out[at, SKINNED] = 1.0 if is_core else 0.0
                    pieces_out[at, PARTED] = 1.0
                    pieces_out[at, BEFORE] = 1.0 if is_core and m % steps > 0 else 0.0
                    pieces_out[at, AFTER] = 1.0 if is_core and m % steps < steps - 1 else 0.0
                    pieces_out[at, THREAD] = yarn
                    pieces_out[at, FAMILY] = family
                    for c in ti.static(range(7)):
                        pieces_out[at, MEETS + c] = 0.0
                    place_on = m % steps
                    if is_core and (place_on == 0 or place_on == steps - 1):
                        # Where the next block on the thread has its first piece of this fibre, or that before its last.
                        on = 1 if place_on > 0 else -1
                        next_i, next_j = i + on * (1 - family), j + on * family
                        if next_i >= 0 and next_j >= 0:
                            _yarn, _along, made = cell_template(cloth, patch[k, PANEL], family, next_i, next_j)
                            if made >= 0:
                                kind = patch[k, LEVEL] * cloth.grid[TEMPLATES] + made
                                other = ti.cast(cloth.start[kind], ti.i32) + m - on * (steps - 1)
                                q0, q1, along_it, up = p1, 2.0 * p1 - p0, a1, n1
                                if on < 0:
                                    q0, q1, along_it, up = 2.0 * p0 - p1, p0, a0, n0
                                v0, v1 = cell_widths(cloth, family, yarn, along + on)
                                there, _d, looks, _r = lay_particle(
                                    cloth.particle, other, q0, q1, along_it, along_it, up, up, v0, v1
                                )
                                for c in ti.static(range(3)):
                                    pieces_out[at, BEYOND + c] = there[c]
                                    pieces_out[at, BEYOND + 3 + c] = looks[c]
                                pieces_out[at, MEETS] = 1.0
                    at += 1
                e += 1


@dataclass(frozen=True)
class SeenNear:
    """A survey of patches and pieces of stitches, as `Seen`, and after them of pieces of fibre (n, WIDTH)."""

    boxes: NDArray[np.int16]
    counts: I32
    depth: F32
    reach: F32
    cells: Seen
    pieces: F32
    grid: I32
    view: View


class NearCells:
    """A cloth on cells that streams as its `CellStream` does, and shows the skin of its fibres where a camera is near.
    skin, gain: as of `Skins`."""

    def __init__(self, cells: CellStream, skin: F32, *, gain: ArrayLike = (1.0, 1.0), chunks: int = 2) -> None:
        self.cells, self.chunks = cells, chunks
        self.skins = Skins(skin, gain, chunks)
        layout = cells.cloth.repeats[0].layout
        self.steps = layout.detail.steps
        yarns = layout.warp.yarn, layout.weft.yarn
        fibres = [y.plies * min(layout.detail.fibres, y.fibres_in_section) for y in yarns]
        self._core = np.array(fibres, np.int32) * self.steps
        self._usual = PERIODS * float(np.mean([y.fibre_diameter for y in yarns]))

    @property
    def pitch(self) -> tuple[float, float]:
        """As of `CellStream`."""
        return self.cells.pitch

    def survey(self, camera: Pinhole) -> SeenNear:
        """What is worth drawing for a camera."""
        seen, view = self.cells.survey(camera), view_of(camera)
        near = self._near(seen, camera)
        counts = seen.counts.copy()
        counts[near] = 0
        pieces = self._pieces(self._crossings(seen.patch[near], view))
        n = len(pieces)
        boxes, made = np.empty((n, 4), np.int16), np.zeros(n, np.int32)
        depth, grid = np.empty(n, np.float32), np.empty((n, 2), np.int32)
        if n:
            place(pieces, view, boxes, made, depth, grid)
            hidden = _hidden(pieces, made, depth, camera)
            grid[hidden], made[hidden] = 0, 1
        return SeenNear(
            boxes=np.concatenate([seen.boxes, boxes]),
            counts=np.concatenate([counts, made]),
            depth=np.concatenate([seen.depth, depth]),
            reach=np.concatenate([seen.reach, reach_of(pieces)]),
            cells=seen,
            pieces=pieces,
            grid=grid,
            view=view,
        )

    def _near(self, seen: Seen, camera: Pinhole) -> NDArray[np.intp]:
        """Patches of which some fibres may have a surface: they are at the finest level, and none of them fades."""
        fine = (seen.patch[:, LEVEL] == 0) & (seen.grid[:, 0] == 0) & (seen.share >= 1.0)
        wide = WIDEST * self.cells.cloth.bank.radius[0] * camera.focal
        size = np.sqrt(np.prod(seen.patch[:, [PATCH_PICKS, PATCH_ENDS]], axis=1)) * max(self.pitch)
        nearest = np.maximum(seen.depth[: len(fine)] - size, camera.near)
        return np.flatnonzero(fine & (wide / nearest > SURFACE[0]))

    def _crossings(self, patch: I32, view: View) -> I32:
        """The crossings of patches that a camera sees, each a patch by itself; the nearest `MOST_CROSSINGS`."""
        single, _ = parted(patch, np.full(len(patch), np.iinfo(np.int32).max, np.int64))
        n = len(single)
        boxes, depth = np.empty((n, 4), np.int16), np.empty(n, np.float32)
        if n:
            reach = np.full(n, self.cells.cloth.bank.reach[0], np.float32)
            look(self.cells.cloth.pack(), single, view, reach, boxes, depth)
        seen = np.flatnonzero(boxes[:, 0] <= boxes[:, 1])
        return single[np.sort(seen[np.argsort(depth[seen], kind="stable")[:MOST_CROSSINGS]])]

    def _pieces(self, crossings: I32) -> F32:
        """The pieces of these crossings, (n, WIDTH)."""
        counts = np.zeros(len(crossings), np.int32)
        if len(crossings):
            count(self.cells.cloth.pack(), crossings, np.arange(len(crossings), dtype=np.int32), counts)
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        out = np.empty((int(starts[-1]), WIDTH), np.float32)
        if len(out):
            split_cells(
                self.chunks, starts.astype(np.int32), crossings, self.cells.under, self._core, self.steps, self._usual,
                self.cells.alone, self.cells.cloth.pack(), out,
            )  # fmt: skip
        return out

    def crown(self, cell: int, u: float, v: float, eye: NDArray, turned: float = 1.0) -> tuple[F64, F64]:
        """The outermost place [m] of a fibre on the side of cell number `cell` that is seen from `eye`, near the shares
        u, v of it; and the cloth's normal there on that side. No hair passes it, as it is seen by a camera that turns
        so far from there to the normal."""
        cloth = self.cells.cloth
        row, col = divmod(cell, cloth.shape[1])
        at, by_u, by_v = (a[0] for a in surface_points(cloth.node, cloth.shape[1], [col + u], [row + v]))
        normal = np.cross(by_u, by_v)
        normal *= np.sign(normal @ (eye - at)) / np.linalg.norm(normal)
        panel = cloth.panels[cloth.of_cell[cell]]
        patch = np.zeros((1, PATCH), np.int32)
        patch[0, [CELL, PANEL, LAYERS]] = cell, cloth.of_cell[cell], 1
        for first, size, place_in, begin, each in (
            (FIRST_END, PATCH_ENDS, u, col - panel.col, cloth.per_cell[0]),
            (FIRST_PICK, PATCH_PICKS, v, row - panel.row, cloth.per_cell[1]),
        ):
            count_here = min(ABOUT, each)
            patch[0, size] = count_here
            patch[0, first] = begin * each + np.clip(round(place_in * each) - count_here // 2, 0, each - count_here)
        pieces = self._pieces(patch).astype(np.float64)
        pieces = pieces[pieces[:, RADIUS] > 0]
        hairs, pieces = pieces[pieces[:, SKINNED] == 0], pieces[pieces[:, SKINNED] > 0]
        if not len(pieces):
            return at, normal
        away = pieces[:, POSITION : POSITION + 3] - at
        order = np.argsort(-(away @ normal + pieces[:, RADIUS] - ASIDE * np.linalg.norm(away, axis=1)))[:CROWNS]
        way = (eye - at) / np.linalg.norm(eye - at)
        way = way + turned * (normal - way)
        way /= np.linalg.norm(way)
        clear = PASSING * float(pieces[:, RADIUS].mean())
        top = next((k for k in order if _passing(hairs, at + away[k], way) > clear), order[0])
        return at + away[top] + pieces[top, RADIUS] * normal, normal

    def around(self, place: NDArray, size: float, most: int) -> F32:
        """The cloth in a cube `size` [m] wide round a place (3,) [m], as `lay` gives it, a copy: at the finest level
        of which there are no more than `most` particles."""
        cloth = self.cells.cloth
        whole = self.cells.whole()
        each = max(cloth.per_cell[0] * self.pitch[0], cloth.per_cell[1] * self.pitch[1])
        row, col = np.divmod(whole[:, CELL], cloth.shape[1])
        at, _, _ = surface_points(cloth.node, cloth.shape[1], col + 0.5, row + 0.5)
        whole = whole[np.abs(at - place).max(axis=1) < 0.5 * size + each]
        patch, _ = parted(whole, np.full(len(whole), max(1, round(PARTS * each / size)), np.int64))
        row, col = np.divmod(patch[:, CELL], cloth.shape[1])
        of = [np.array([getattr(p, name) for p in cloth.panels])[patch[:, PANEL]] for name in ("row", "col")]
        u = (patch[:, FIRST_END] + 0.5 * patch[:, PATCH_ENDS]) / cloth.per_cell[0] + of[1]
        v = (patch[:, FIRST_PICK] + 0.5 * patch[:, PATCH_PICKS]) / cloth.per_cell[1] + of[0]
        at, _, _ = surface_points(cloth.node, cloth.shape[1], u, v)
        patch = patch[np.abs(at - place).max(axis=1) < 0.5 * size]
        blocks = 2.0 * np.prod(patch[:, [LAYERS, PATCH_PICKS, PATCH_ENDS]].astype(np.float64), axis=1).sum()
        fits = np.flatnonzero(blocks * cloth.bank.size <= most)
        patch[:, LEVEL] = fits[0] if len(fits) else cloth.bank.levels - 1
        n = len(patch)
        counts, zero = np.zeros(n, np.int32), np.zeros(n, np.float32)
        if n:
            count(cloth.pack(), patch, np.arange(n, dtype=np.int32), counts)
        seen = Seen(np.zeros((n, 4), np.int16), counts, zero, zero, patch, zero + 1.0, np.zeros((n, 2), np.int32), None)
        return self.cells.lay(seen, np.arange(n, dtype=np.int32))[0].copy()

    def lay(self, survey: SeenNear, chosen: I32) -> tuple[F32, int]:
        """The particles of these patches and pieces; places between the two that stay empty have radius 0."""
        first = len(survey.cells.counts)
        out, total = self.cells.lay(survey.cells, chosen[chosen < first])
        mine = chosen[chosen >= first] - first
        if not len(mine):
            return out, total
        return self.skins.lay_after(out, survey, survey.counts[first:][mine], mine)

    def numbers(self, survey: SeenNear, chosen: I32) -> tuple[I32, I32]:
        """As of `CellStream`, of what `lay` makes of these; −1 for a place that stays empty."""
        first = len(survey.cells.counts)
        laid = self.cells.numbers(survey.cells, chosen[chosen < first])
        mine = chosen[chosen >= first] - first
        if not len(mine):
            return laid
        thread = np.repeat(survey.pieces[mine, THREAD].astype(np.int32), survey.counts[first:][mine])
        pairs = zip(laid, (thread, self.cells.parts[thread]), strict=True)
        both = [[np.pad(one, (0, -len(one) % LANES), constant_values=-1) for one in pair] for pair in pairs]
        return np.concatenate(both[0]).astype(np.int32), np.concatenate(both[1]).astype(np.int32)


def _passing(hairs: F64, place: F64, way: F64) -> float:
    """How far the nearest of pieces of hair is from the line from a place along a way [m], of those ahead."""
    there, along = hairs[:, POSITION : POSITION + 3] - place, hairs[:, TANGENT : TANGENT + 3]
    aside, course = there - (there @ way)[:, None] * way, along - (along @ way)[:, None] * way
    share = -(aside * course).sum(axis=1) / np.maximum((course**2).sum(axis=1), 1e-12)
    nearest = aside + np.clip(share, -hairs[:, HALF_LENGTH], hairs[:, HALF_LENGTH])[:, None] * course
    ahead = there @ way > 0.0
    return float((np.linalg.norm(nearest, axis=1) - hairs[:, RADIUS])[ahead].min(initial=np.inf))


def _hidden(pieces: F32, counts: I32, depth: F32, camera: Pinhole) -> NDArray[np.intp]:
    """Those of the pieces of many points that lie behind so many others, or so far beside the picture, that a splat
    will do. Of each is known, tile by tile, how much of it lies within its width of its axis."""
    many = np.flatnonzero(counts > MANY)
    order = many[np.argsort(depth[many], kind="stable")]
    half = pieces[order, HALF_LENGTH, None] * pieces[order, TANGENT : TANGENT + 3]
    middle = pieces[order, POSITION : POSITION + 3].astype(np.float64)
    ends = [(middle + sign * half) @ np.asarray(camera.rotation).T + np.asarray(camera.translation) for sign in (-1, 1)]
    first, last = (
        (camera.focal * e[:, :2] / np.maximum(e[:, 2:], camera.near) + (camera.cx, camera.cy)) / TILE for e in ends
    )
    reach = pieces[order, RADIUS] * camera.focal / depth[order] / TILE
    high, wide = -(-camera.height // TILE), -(-camera.width // TILE)
    layers = np.zeros((high, wide), np.float32)
    out = []
    for k, a, b, r in zip(order, first, last, reach.tolist(), strict=True):
        low = np.clip(np.floor(np.minimum(a, b) - r), 0, (wide, high)).astype(int)
        top = np.clip(np.ceil(np.maximum(a, b) + r) + 1, 0, (wide, high)).astype(int)
        x, y = np.arange(low[0], top[0])[None, :] + 0.5 - a[0], np.arange(low[1], top[1])[:, None] + 0.5 - a[1]
        along = b - a
        t = np.clip((x * along[0] + y * along[1]) / max(float(along @ along), 1e-12), 0.0, 1.0)
        away = np.hypot(x - t * along[0], y - t * along[1])
        box = layers[low[1] : top[1], low[0] : top[0]]
        if (box[away < r + 0.71] >= BURIED).all():
            out.append(k)
        box += np.clip(0.5 + r - away, 0.0, 1.0)
    return np.array(out, np.intp)
