"""Particles of pieces of fibre, as splats or as points on their skin, behind those of what is farther."""

from math import prod
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.detail.pieces import surface
from taichi_cloth.detail.view import View
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.particles import LANES, ROWS, fill_up

__all__ = ["Skins"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


class _Pieces(Protocol):
    """What `place` found of pieces (n, WIDTH) in a view."""

    @property
    def pieces(self) -> F32: ...
    @property
    def grid(self) -> I32: ...
    @property
    def view(self) -> View: ...


class Skins:
    """skin: the fibres' height map (see `relief.skin_of`). gain: factors for the colour of points on a skin, of warp
    and of weft: they hide what is behind them better than what they replace. chunks: of work, for as many threads."""

    def __init__(self, skin: F32, gain: ArrayLike, chunks: int) -> None:
        self.skin, self.gain, self.chunks = np.ascontiguousarray(skin, np.float32), np.asarray(gain, np.float32), chunks
        self._batch = np.zeros(0, np.float32)

    @property
    def allocated(self) -> int:
        """Bytes of the batch's array."""
        return self._batch.nbytes

    def lay_after(self, out: F32, seen: _Pieces, counts: I32, mine: I32) -> tuple[F32, int]:
        """Particles (ROWS, groups, LANES), first those of `out`, then those of the pieces number `mine`, each `counts`
        of them, and how many places there are. Those between the two kinds that stay empty have radius 0. Valid until
        the next call."""
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        rows, more = out.shape[1], -(-int(starts[-1]) // LANES)
        shape = ROWS, rows + more, LANES
        if self._batch.size < prod(shape):
            self._batch = np.zeros(prod(shape), np.float32)
        batch = self._batch[: prod(shape)].reshape(shape)
        batch[:, :rows] = fetched(out)
        at = (starts + rows * LANES).astype(np.int32)
        surface(self.chunks, mine.astype(np.int32), at, seen.pieces, seen.grid, seen.view, self.skin, self.gain, batch)
        fill_up(batch, int(starts[-1]))
        return batch, (rows + more) * LANES
