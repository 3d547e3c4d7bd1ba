"""Cloth woven on cells, streamed: what a camera sees of threads that are counted in millions and stored nowhere.

`CellStream.survey` looks at cells, not at threads. What it hands on is *patches*: the crossings of a cell, or of a part
of it where they have many particles. Where a thread is wider than a pixel or two, a patch is drawn of fibres, at the
finest of the bank's levels whose fibres are not smaller than `target` pixels. Where it is narrower, it is drawn as the
*sheet* it is: of surfels about as far apart as pixels (see `surfels`). Between the two, fibres fade out as the sheet
fades in. `lay` makes the particles of patches.
"""

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.patches import (
    CELL,
    CHUNKS,
    FIRST_END,
    FIRST_PICK,
    LAYERS,
    LEVEL,
    PANEL,
    PATCH,
    PATCH_ENDS,
    PATCH_PICKS,
    count,
    lay,
    look,
    look_at,
)
from taichi_cloth.detail.surfels import guess_of, lay_surfels
from taichi_cloth.detail.view import Pinhole, view_of
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.ground.copies import fetched, filled_up, paste, put, zeros
from taichi_cloth.ground.particles import HALF_LENGTH, LANES, POSITION, RADIUS, ROWS
from taichi_cloth.ground.vectors import chunk_count

__all__ = ["SHEET", "TARGET", "CellStream", "Seen", "parted"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
F64 = NDArray[np.float64]

TARGET = 0.25
"""Radius of the smallest particles, in pixels of the picture that is shown: on a canvas with several samples a pixel
each way, as many times as much."""
SHEET = 1.0, 5.0
"""Pixels from thread to thread up to which a cloth is drawn as a sheet, and from which on it is drawn of fibres."""
EVENLY = 0.54
"""Fibres that fade in beside a sheet show little at first: with their share so, brightness goes over evenly."""
HIDING = 0.5
"""Of a sheet that goes, by how much less there is yet, times the square of the fibres' share: some of all fibres hide
more than their share. With 0 half of them and the rest of the sheet cover up to 2 % more than either alone."""
FADING = 1.9
"""Fibres of a level are whole from so many times the smallest radius on, and from where the next finer level begins; of
smaller ones some are of the next coarser level."""
MEETING = 0.7
"""Power of the share of a level that goes as the next finer one comes. With 1, half of each covers up to 3 % less than
the thickest fibres alone; with 0.5, finer ones cover more and are brighter than alone, which then ends at once."""
APART, FINER = 0.6, 0.42
"""Pixels between surfels; with n × n samples a pixel n^FINER times as many samples, as larger ones hide more: so a
cloth that covers 0.95 does at 1 × and at 4 × 4."""
ABOVE = 0.7
"""How far above the cloth's middle surfels lie, of what its right side does."""
TO_EYE = 1.0
"""How far normals of fibres lean to the eye, over how much thicker they are than the finest, of the cloth's height: of
those that a thick one stands for, the ones that are seen are on the eye's side."""
CAST = 4
"""Of a sample that casts light, particles for each surfel: they lie evenly, so that fewer do."""
MOST = 16_384
"""Particles of a patch, beyond which it is parted, down to single crossings."""


@dataclass(frozen=True)
class Seen:
    """What a camera sees. boxes: (n, 4) int16 first and last tile column and row of each patch, then of each piece.
    counts: (n,) int32 particles. depth: (n,) float32 [m] of their middles. reach: (n,) float32 how far it reaches from
    there [m]. patch: (patches, PATCH) int32, see `patches`. share:
    (patches,) float32 of its particles that are drawn, 1 for all. grid: (patches, 2) int32 rows and columns of surfels,
    0 where it is drawn of fibres. eye: where it stands (3,) [m]; None: the right side is wanted."""

    boxes: NDArray[np.int16]
    counts: I32
    depth: F32
    reach: F32
    patch: I32
    share: F32
    grid: I32
    eye: F64 | None


class CellStream:
    """Makes the particles of a cloth woven on cells as they are needed.

    target: radius [px] of the smallest fibre drawn, 0 for all fibres at any distance. parts: number of the part that
    each thread is of, (threads,); None: 0 warp ends, 1 weft picks. pieces: particles that somebody else places,
    such as stitches, (ROWS, n · each), `each` of them together.
    """

    def __init__(
        self,
        cloth: CellCloth,
        *,
        target: float = TARGET,
        parts: I32 | None = None,
        pieces: F32 | None = None,
        each: int = 1,
    ) -> None:
        self.cloth, self.target = cloth, float(target)
        self.parts = cloth.family_of_thread() if parts is None else parts
        self.pieces, self.each = np.zeros((ROWS, 0), np.float32) if pieces is None else pieces, each
        self._whole = self._cells()
        layout = cloth.repeats[0].layout
        self.under = np.array([cloth.bank.height, layout.warp.pitch, layout.weft.pitch], np.float32)
        """How far the cloth's right side lies above its middle, and from warp end to warp end and from weft pick to
        weft pick, on average [m]."""
        self.sheets = True
        """Whether cloth far away is drawn as a sheet."""
        self.level: int | None = None
        """At which all fibres are drawn, if not as a picture tells them apart."""
        self.look = guess_of(cloth.bank, cloth.repeats)
        self._batch = np.zeros(0, np.float32)
        self._yarn = np.zeros(0, np.int32)

    def _cells(self) -> I32:
        """A patch of each cell; in the last row and column of a panel with the threads at its edge."""
        cloth = self.cloth
        cols = cloth.shape[1]
        ends, picks = cloth.per_cell
        out = np.zeros((len(cloth.cells), PATCH), np.int32)
        out[:, CELL] = cloth.cells
        out[:, PANEL] = cloth.of_cell[cloth.cells]
        out[:, LAYERS] = cloth.layers[cloth.cells]
        of = [
            np.array([getattr(p, name) for p in cloth.panels])[out[:, PANEL]] for name in ("row", "col", "rows", "cols")
        ]
        row, col = cloth.cells // cols - of[0], cloth.cells % cols - of[1]
        out[:, FIRST_PICK], out[:, FIRST_END] = row * picks, col * ends
        out[:, PATCH_PICKS] = picks + (row == of[2] - 2)
        out[:, PATCH_ENDS] = ends + (col == of[3] - 2)
        return out

    def whole(self) -> I32:
        """A patch of each cell, at the finest level, a copy."""
        return self._whole.copy()

    @property
    def pitch(self) -> tuple[float, float]:
        """From warp end to warp end and from weft pick to weft pick, on average [m]."""
        return float(self.under[1]), float(self.under[2])

    @property
    def alone(self) -> F32:
        """Of each panel, see `SheetLook`."""
        return self.look.alone[[panel.repeat for panel in self.cloth.panels]]

    @property
    def _shades(self) -> F32:
        """Of each panel, as `lay` takes them."""
        few = self.look.few[[panel.repeat for panel in self.cloth.panels]]
        return np.hstack([self.alone, few.reshape(len(few), -1)])

    @property
    def allocated(self) -> int:
        """Bytes of the batch's arrays, the only ones that grow with what is drawn."""
        return self._batch.nbytes + self._yarn.nbytes

    def survey(self, camera: Pinhole) -> Seen:
        """What is worth drawing for a camera."""
        bank = self.cloth.bank
        patch = self._whole.copy()
        pack, view = self.cloth.pack(), view_of(camera)
        depth, seen, _, _ = self._look(pack, view, patch, np.full(len(patch), bank.reach[0]))
        patch, depth = patch[seen], depth[seen]
        pixel = np.maximum(depth, camera.near).astype(np.float64) / camera.focal  # [m]
        fine = self._fine(pixel)
        # Of fibres; too many particles for one patch: several.
        woven, of_fibres = self._levels(patch[fine > 0], pixel[fine > 0], fine[fine > 0])
        parts = np.ceil(np.sqrt(_blocks(woven) * bank.size[woven[:, LEVEL]] / MOST)).astype(np.int64)
        woven, of_patch = parted(woven, parts)
        # As a sheet.
        flat, far = patch[fine < 1], pixel[fine < 1]
        grid = np.concatenate([np.zeros((len(woven), 2), np.int32), self._grid(flat, self._apart(far))])
        patch = np.concatenate([woven, flat])
        sheet = fine[fine < 1]
        share = np.concatenate([of_fibres[of_patch], (1.0 - sheet) * (1.0 - HIDING * sheet**2)])
        reach = np.concatenate([bank.reach[woven[:, LEVEL]], bank.reach[0] + 2.0 * self._apart(far)])
        depth, seen, boxes, reach = self._look(pack, view, patch, reach)
        patch, share, grid = patch[seen], share[seen], grid[seen]
        depth, boxes, reach = depth[seen], boxes[seen], reach[seen]
        counts = self._counts(pack, patch, grid)
        if self.pieces.shape[1]:
            sphere = self._spheres()
            more, far = np.empty((len(sphere), 4), np.int16), np.empty(len(sphere), np.float32)
            look_at(sphere, view, more, far)
            boxes, depth = np.concatenate([boxes, more]), np.concatenate([depth, far])
            reach = np.concatenate([reach, sphere[:, 3]])
            counts = np.concatenate([counts, np.where(more[:, 0] <= more[:, 1], self.each, 0).astype(np.int32)])
        eye = -np.asarray(camera.rotation).T @ np.asarray(camera.translation)
        return Seen(boxes, counts, depth, reach, patch, share.astype(np.float32), grid, eye)

    def _spheres(self) -> F32:
        """Round each of the pieces, (n, 4)."""
        place = self.pieces[POSITION : POSITION + 3].T.reshape(-1, self.each, 3)
        size = np.maximum(self.pieces[RADIUS], self.pieces[HALF_LENGTH]).reshape(-1, self.each).max(axis=1)
        middle = place.mean(axis=1)
        away = np.linalg.norm(place - middle[:, None], axis=2).max(axis=1)
        return np.column_stack([middle, away + size]).astype(np.float32)

    def _look(
        self, pack: Any, view: Any, patch: I32, beyond: F64
    ) -> tuple[F32, NDArray[np.bool_], NDArray[np.int16], F32]:
        """Of patches whose particles lie so far beyond their crossings [m]: depth, whether in view, boxes, reach."""
        n = len(patch)
        boxes, depth, reach = np.empty((n, 4), np.int16), np.empty(n, np.float32), beyond.astype(np.float32)
        if n:
            look(pack, patch, view, reach, boxes, depth)
        return depth, boxes[:, 0] <= boxes[:, 1], boxes, reach

    def _fine(self, pixel: F64) -> F64:
        """What share of a cloth is drawn of fibres where a pixel is so wide [m], 0 to 1."""
        if not self.sheets or self.target <= 0:
            return np.ones(len(pixel))
        wide = float(np.sqrt(self.under[1] * self.under[2])) / pixel * (TARGET / self.target)
        return np.clip(np.log(wide / SHEET[0]) / np.log(SHEET[1] / SHEET[0]), 0.0, 1.0) ** EVENLY

    def _levels(self, patch: I32, pixel: F64, share: F64) -> tuple[I32, F64]:
        """Patches at their levels, where a pixel is so wide [m] and that share of them is drawn of fibres; two where
        one level fades into the next."""
        if self.level is not None:
            out = patch.copy()
            out[:, LEVEL] = self.level
            return out, share
        size = self.cloth.bank.radius / (pixel[:, None] * max(self.target, 1e-9))  # finest first, so rising
        last = size.shape[1] - 1
        level = np.where((size >= 1.0).any(axis=1), (size >= 1.0).argmax(axis=1), last)
        radius = self.cloth.bank.radius
        way = np.minimum(FADING, np.append(FADING, np.maximum(radius[1:] / radius[:-1], 1.0 + 1e-9)))
        whole = np.log(np.maximum(np.take_along_axis(size, level[:, None], axis=1)[:, 0], 1.0)) / np.log(way[level])
        whole = np.where(level == last, 1.0, np.minimum(whole, 1.0))
        fading = whole < 1.0
        out = np.concatenate([patch[whole > 0.0], patch[fading]])
        out[:, LEVEL] = np.concatenate([level[whole > 0.0], level[fading] + 1])
        return out, np.concatenate([(share * whole)[whole > 0.0], (share * (1.0 - whole) ** MEETING)[fading]])

    def _apart(self, pixel: F64) -> F64:
        """Distance between surfels where a pixel is so wide [m]."""
        return APART * (self.target / TARGET) ** FINER * pixel

    def _grid(self, patch: I32, apart: F64) -> I32:
        """Rows and columns of surfels so far apart [m] in whole cells, (n, 2)."""
        size = patch[:, [PATCH_PICKS, PATCH_ENDS]] * self.under[[2, 1]] / apart[:, None]
        return np.maximum(np.rint(size), 1.0).astype(np.int32)

    def _counts(self, pack: Any, patch: I32, grid: I32) -> I32:
        counts = np.prod(grid, axis=1, dtype=np.int32)
        woven = np.flatnonzero(counts == 0).astype(np.int32)
        if len(woven):
            count(pack, patch, woven, counts)
        return counts

    def lay(self, seen: Seen, chosen: I32) -> tuple[F32, int]:
        """The particles of these patches, then of these pieces: (ROWS, ceil(n / 16), 16) and n. The array is valid
        until the next call."""
        pieces = chosen[chosen >= len(seen.patch)] - len(seen.patch)
        chosen = chosen[chosen < len(seen.patch)].astype(np.int32, copy=False)
        sheet = seen.grid[chosen, 0] > 0
        chosen = np.concatenate([chosen[~sheet], chosen[sheet]])
        starts = np.concatenate([[0], np.cumsum(seen.counts[chosen], dtype=np.int64)])
        woven = int(starts[-1])
        total = woven + self.each * len(pieces)
        shape = ROWS, -(-total // LANES), LANES
        if self._batch.size < prod(shape):
            self._batch, self._yarn = zeros(prod(shape)), zeros(shape[1] * LANES, np.int32)
        out = self._batch[: prod(shape)].reshape(shape)
        if not total:
            return out, 0
        pack, fibres = self.cloth.pack(), len(sheet) - int(sheet.sum())
        if fibres:
            lay(
                *_shared_out(chosen[:fibres], starts[: fibres + 1]), seen.patch, seen.share, self.under,
                self._leaning(seen.eye), self._shades, pack, out, self._yarn,
            )  # fmt: skip
        if fibres < len(chosen):
            above = np.zeros(4) if seen.eye is None else np.array([1.0, *seen.eye])
            height = 0.0 if seen.eye is None else ABOVE * self.cloth.bank.height
            of_panel = [panel.repeat for panel in self.cloth.panels]
            factor = self.look.factor[of_panel].reshape(len(of_panel), -1, self.look.factor.shape[-1])
            lay_surfels(
                *_shared_out(chosen[fibres:], starts[fibres:]), seen.patch, seen.grid, seen.share,
                factor, np.hstack([self.look.lean[of_panel], self.alone]), np.array([*above, height], np.float32),
                pack, out, self._yarn,
            )  # fmt: skip
        if len(pieces):
            places = (pieces[:, None] * self.each + np.arange(self.each)).ravel()
            paste(out, woven, self.pieces[:, places])
            put(self._yarn[woven:total], np.full(total - woven, -1, np.int32))
        filled_up(out, total)
        return out, total

    def _leaning(self, eye: F64 | None) -> F32:
        """Where the eye is (3,) [m], and by how much normals of each level lean to it; by nothing without one."""
        bank = self.cloth.bank
        if eye is None:
            return np.zeros(3 + len(bank.radius), np.float32)
        return np.array([*eye, *(TO_EYE * (bank.radius - bank.radius[0]) / bank.height)], np.float32)

    def sample(self, most: float, *, level: int = -1) -> F32:
        """The whole cloth as `lay` gives it, a copy: of fibres at a level, the coarsest if none is said, if there are
        no more than `most`, or as a sheet of about `most` / CAST surfels, at least one a cell."""
        bank, patch = self.cloth.bank, self._whole.copy()
        patch[:, LEVEL] = level % bank.levels
        grid, zero = np.zeros((len(patch), 2), np.int32), np.zeros(len(patch), np.float32)
        if float(_blocks(patch).sum() * bank.size[level]) > most:
            area = float((patch[:, PATCH_PICKS] * patch[:, PATCH_ENDS]).sum()) * self.pitch[0] * self.pitch[1]
            grid = self._grid(patch, np.full(len(patch), np.sqrt(area * CAST / most)))
        counts = self._counts(self.cloth.pack(), patch, grid)
        seen = Seen(np.zeros((len(patch), 4), np.int16), counts, zero, zero, patch, zero + 1.0, grid, None)
        return fetched(self.lay(seen, np.arange(len(patch), dtype=np.int32))[0]).copy()

    def numbers(self, seen: Seen, chosen: I32) -> tuple[I32, I32]:
        """The thread of each particle that `lay` makes of these, and its part; −1 of pieces."""
        _, total = self.lay(seen, chosen)
        thread = fetched(self._yarn[:total]).copy()
        return thread, np.where(thread < 0, -1, self.parts[thread]).astype(np.int32)


def _shared_out(chosen: I32, starts: NDArray[np.int64]) -> tuple[I32, I32, I32]:
    """First of the chosen of each chunk of work, so that all have about as many particles; the chosen; their starts."""
    ends = np.linspace(starts[0], starts[-1], chunk_count(CHUNKS) + 1).astype(np.int64)
    bounds = np.searchsorted(starts, ends).astype(np.int32)
    bounds[0], bounds[-1] = 0, len(chosen)
    return bounds, np.ascontiguousarray(chosen), starts.astype(np.int32)


def _blocks(patch: I32) -> F64:
    """Fibre blocks of patches."""
    return 2.0 * np.prod(patch[:, [LAYERS, PATCH_PICKS, PATCH_ENDS]].astype(np.float64), axis=1)


def parted(patch: I32, parts: NDArray[np.int64]) -> tuple[I32, NDArray[np.int64]]:
    """Patches cut into so many parts each way, as even as whole crossings allow, and which of them each is of."""
    high, wide = np.minimum(parts, patch[:, PATCH_PICKS]), np.minimum(parts, patch[:, PATCH_ENDS])
    each = high * wide
    of_patch = np.repeat(np.arange(len(patch)), each)
    out = patch[of_patch]
    number = np.arange(len(out)) - np.repeat(np.cumsum(each) - each, each)
    high, wide = np.repeat(high, each), np.repeat(wide, each)
    for first, size, cut, at in (
        (FIRST_PICK, PATCH_PICKS, high, number // wide),
        (FIRST_END, PATCH_ENDS, wide, number % wide),
    ):
        whole = out[:, size].copy()
        begin, end = whole * at // cut, whole * (at + 1) // cut
        out[:, first] += begin.astype(np.int32)
        out[:, size] = end - begin
    return out, of_patch
