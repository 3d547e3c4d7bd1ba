"""Cloth woven on cells, streamed: what a camera sees of threads that are counted in millions and stored nowhere.

`CellStream.survey` looks at cells, not at threads. What it hands on is *patches*: the crossings of a cell, or of a part
of it where they have many particles. Each is drawn at one of the bank's levels, the finest whose fibres are not smaller
than `target` pixels, or, where even those of the coarsest are, by a sample of that whose areas add up to the same (see
`thinning`): its particles are spread by an even sequence, as large as a pixel wants them, of the side that is seen and
with the mean colour of the threads that they cover. `lay` makes the particles of patches.
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
    ROUND,
    count,
    lay,
    look,
    look_at,
)
from taichi_cloth.detail.view import Pinhole, view_of
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.ground.particles import HALF_LENGTH, LANES, POSITION, RADIUS, ROWS, fill_up

__all__ = ["TARGET", "CellStream", "Seen"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
F64 = NDArray[np.float64]

TARGET = 0.25
"""Radius of the smallest particles, in pixels of the picture that is shown: on a canvas with several samples a pixel
each way, as many times as much."""
MOST = 16_384
"""Particles of a patch, beyond which it is parted, down to single crossings."""


@dataclass(frozen=True)
class Seen:
    """What a camera sees. boxes: (n, 4) int16 first and last tile column and row of each patch, then of each piece.
    counts: (n,) int32 particles. depth: (n,) float32 [m]. patch: (patches, PATCH) int32, see `patches`. share:
    (patches,) float32 of the level's particles that are drawn, 1 for all. eye: where it stands (3,) [m]; None: all
    sides are wanted."""

    boxes: NDArray[np.int16]
    counts: I32
    depth: F32
    patch: I32
    share: F32
    eye: F64 | None


class CellStream:
    """Makes the particles of a cloth woven on cells as they are needed.

    target: radius [px] of the smallest drawn. parts: number of the part that each thread is of, (threads,); None: 0
    warp ends, 1 weft picks. pieces: particles that somebody else places, such as stitches, (ROWS, n · each), `each` of
    them together.
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
        self._under = np.array([cloth.bank.height, layout.warp.pitch, layout.weft.pitch], np.float32)
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

    @property
    def allocated(self) -> int:
        """Bytes of the batch's arrays, the only ones that grow with what is drawn."""
        return self._batch.nbytes + self._yarn.nbytes

    def survey(self, camera: Pinhole) -> Seen:
        """What is worth drawing for a camera."""
        bank = self.cloth.bank
        patch = self._whole.copy()
        pack, view = self.cloth.pack(), view_of(camera)
        depth, seen, _ = self._look(pack, view, patch, np.full(len(patch), bank.reach[0], np.float32))
        patch, depth = patch[seen], depth[seen]
        level, share = self._level(np.maximum(depth, camera.near), camera.focal)
        patch[:, LEVEL] = level
        # Too many particles for one patch: several.
        blocks = _blocks(patch)
        parts = np.ceil(np.sqrt(blocks * bank.size[level] * share / MOST)).astype(np.int64)
        patch, of_patch = _parted(patch, parts)
        share = share[of_patch]
        level = patch[:, LEVEL]
        grown = 1.0 / np.sqrt(share)
        reach = (bank.reach + (grown[:, None] - 1.0) * bank.half_length)[np.arange(len(level)), level]
        depth, seen, boxes = self._look(pack, view, patch, reach.astype(np.float32))
        patch, share, depth, boxes = patch[seen], share[seen], depth[seen], boxes[seen]
        counts = self._counts(pack, patch, share)
        if self.pieces.shape[1]:
            sphere = self._spheres()
            more, far = np.empty((len(sphere), 4), np.int16), np.empty(len(sphere), np.float32)
            look_at(sphere, view, more, far)
            boxes, depth = np.concatenate([boxes, more]), np.concatenate([depth, far])
            counts = np.concatenate([counts, np.where(more[:, 0] <= more[:, 1], self.each, 0).astype(np.int32)])
        eye = -np.asarray(camera.rotation).T @ np.asarray(camera.translation)
        return Seen(boxes, counts, depth, patch, share.astype(np.float32), eye)

    def _spheres(self) -> F32:
        """Round each of the pieces, (n, 4)."""
        place = self.pieces[POSITION : POSITION + 3].T.reshape(-1, self.each, 3)
        size = np.maximum(self.pieces[RADIUS], self.pieces[HALF_LENGTH]).reshape(-1, self.each).max(axis=1)
        middle = place.mean(axis=1)
        away = np.linalg.norm(place - middle[:, None], axis=2).max(axis=1)
        return np.column_stack([middle, away + size]).astype(np.float32)

    def _look(self, pack: Any, view: Any, patch: I32, reach: F32) -> tuple[F32, NDArray[np.bool_], NDArray[np.int16]]:
        n = len(patch)
        boxes, depth = np.empty((n, 4), np.int16), np.empty(n, np.float32)
        if n:
            look(pack, patch, reach, view, boxes, depth)
        return depth, boxes[:, 0] <= boxes[:, 1], boxes

    def _level(self, depth: F32, focal: float) -> tuple[I32, F64]:
        """The level at depths (n,) [m], and what share of its particles is drawn there."""
        pixels = self.cloth.bank.radius * focal / depth[:, None].astype(np.float64)  # finest first, so rising
        fine = pixels >= self.target
        last = fine.shape[1] - 1
        level = np.where(fine.any(axis=1), fine.argmax(axis=1), last)
        share = np.ones(len(depth))
        if self.target > 0:
            share = np.minimum(self.cloth.bank.area[last] / ROUND * (focal / depth / self.target) ** 2, 1.0)
        return level.astype(np.int32), np.where(fine.any(axis=1), 1.0, share)

    def _counts(self, pack: Any, patch: I32, share: F64) -> I32:
        blocks = _blocks(patch)
        counts = np.maximum(np.ceil(share * blocks * self.cloth.bank.size[patch[:, LEVEL]]), 1.0).astype(np.int32)
        full = np.flatnonzero(share >= 1.0).astype(np.int32)
        if len(full):
            count(pack, patch, full, counts)
        return counts

    def lay(self, seen: Seen, chosen: I32) -> tuple[F32, int]:
        """The particles of these patches, then of these pieces: (ROWS, ceil(n / 16), 16) and n. The array is valid
        until the next call."""
        pieces = chosen[chosen >= len(seen.patch)] - len(seen.patch)
        chosen = chosen[chosen < len(seen.patch)]
        starts = np.concatenate([[0], np.cumsum(seen.counts[chosen], dtype=np.int64)])
        woven = int(starts[-1])
        total = woven + self.each * len(pieces)
        shape = ROWS, -(-total // LANES), LANES
        if self._batch.size < prod(shape):
            self._batch, self._yarn = np.zeros(prod(shape), np.float32), np.zeros(shape[1] * LANES, np.int32)
        out = self._batch[: prod(shape)].reshape(shape)
        if not total:
            return out, 0
        bounds = np.searchsorted(starts, np.linspace(0, woven, CHUNKS + 1).astype(np.int64)).astype(np.int32)
        bounds[-1] = len(chosen)
        eye = np.zeros(4) if seen.eye is None else np.array([1.0, *seen.eye])
        whole = _blocks(seen.patch) * self.cloth.bank.size[seen.patch[:, LEVEL]]
        grown = np.where(seen.share < 1.0, np.sqrt(whole / np.maximum(seen.counts[: len(whole)], 1)), 1.0)
        lay(
            bounds,
            chosen.astype(np.int32, copy=False),
            starts.astype(np.int32),
            seen.patch,
            seen.share,
            grown[chosen].astype(np.float32),
            self._beside(seen, grown)[chosen],
            np.concatenate([self._under, eye]).astype(np.float32),
            self.cloth.pack(),
            out,
            self._yarn,
        )
        if len(pieces):
            places = (pieces[:, None] * self.each + np.arange(self.each)).ravel()
            out.reshape(ROWS, -1)[:, woven:total] = self.pieces[:, places]
            self._yarn[woven:total] = -1
        fill_up(out, total)
        return out, total

    def _beside(self, seen: Seen, grown: F64) -> I32:
        """How many threads to each side a particle covers, where they are enlarged."""
        bank = self.cloth.bank
        radius = np.sqrt(bank.area[-1] / ROUND) * grown
        return np.where(seen.share < 1.0, radius / self._under[1:].mean(), 0.0).astype(np.int32)

    def sample(self, most: int) -> F32:
        """An even sample of the whole cloth as `lay` gives it, a copy: about `most` particles, at least one a cell, so
        much larger that their areas add up to those of all."""
        bank, patch = self.cloth.bank, self._whole.copy()
        last = bank.levels - 1
        patch[:, LEVEL] = last
        blocks = _blocks(patch)
        share = np.full(len(patch), min(1.0, most / max(1.0, float(blocks.sum() * bank.size[last]))))
        counts = self._counts(self.cloth.pack(), patch, share)
        zero = np.zeros(len(patch), np.float32)
        seen = Seen(np.zeros((len(patch), 4), np.int16), counts, zero, patch, share.astype(np.float32), None)
        return self.lay(seen, np.arange(len(patch), dtype=np.int32))[0].copy()

    def numbers(self, seen: Seen, chosen: I32) -> tuple[I32, I32]:
        """The thread of each particle that `lay` makes of these, and its part; −1 of pieces."""
        _, total = self.lay(seen, chosen)
        thread = self._yarn[:total].copy()
        return thread, np.where(thread < 0, -1, self.parts[thread]).astype(np.int32)


def _blocks(patch: I32) -> F64:
    """Fibre blocks of patches."""
    return 2.0 * np.prod(patch[:, [LAYERS, PATCH_PICKS, PATCH_ENDS]].astype(np.float64), axis=1)


def _parted(patch: I32, parts: NDArray[np.int64]) -> tuple[I32, NDArray[np.int64]]:
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
