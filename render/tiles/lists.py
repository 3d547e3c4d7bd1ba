"""Which splats each tile has, from the nearest to the farthest, and the memory that finding them takes."""

import numpy as np

from taichi_cloth.ground.copies import zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES
from taichi_cloth.ground.runtime import on_host, resident

from .sort import (
    BINS,
    GPU_CHUNKS,
    MOST_CHUNKS,
    MOST_COUNTS,
    Scan,
    count_high,
    count_low,
    count_tiles,
    fill_tiles,
    scatter_high,
    scatter_low,
)

__all__ = ["TileLists"]

MAX_TILE_ENTRIES = 2**31 - 1
"""Longest list of all tiles together; Taichi counts with 32 bits."""


class TileLists:
    """Lists for images of up to `tiles` tiles; work is cut into `chunks` parts, more where arrays stay on a device.

    Of every splat (n,): keys: int32 depth, -1 for what is not drawn; boxes: int64 the tiles it touches, see `project`.
    histogram: (chunks, bins) of the keys' low bits. These are filled from outside, then `sort`, then `fill` makes
    entries: numbers of splats, all lists one after another; starts: (tiles + 1,) where each begins.
    """

    def __init__(self, chunks: int, tiles: int) -> None:
        bins = max(BINS, tiles)
        self.chunks = max(GPU_CHUNKS, min(MOST_CHUNKS, MOST_COUNTS // bins)) if resident() else chunks
        self.histogram, self._scan = zeros((self.chunks, bins), np.int32), Scan(self.chunks, bins)
        self.starts, self.entries = zeros(tiles + 1, np.int32), zeros(1, np.int32)
        self.reserve(1)

    def reserve(self, count: int) -> None:
        """Room for so many splats."""
        self.boxes = zeros(count, np.int64)
        self.keys, self._order, self._high, self._sorted = (zeros(count, np.int32) for _ in range(4))

    def sort(self, blocks: int) -> int:
        """Depth order of the splats of so many blocks of particles; returns how many are drawn."""
        if not on_host():
            count_low(self.chunks, blocks, LANES, self.keys, self.histogram)
        drawn = self._scan.places(self.histogram, self.chunks, BINS)
        scatter_low(self.chunks, blocks, LANES, self.keys, self.histogram, self._order, self._high)
        count_high(self.chunks, drawn, self._high, self.histogram)
        self._scan.places(self.histogram, self.chunks, BINS)
        scatter_high(self.chunks, drawn, self._high, self._order, self.histogram, self._sorted)
        return drawn

    def fill(self, drawn: int, across: int, tiles: int) -> int:
        """The lists of so many tiles, `across` in a row; returns their length together.

        Raises InputError where that is more than can be counted.
        """
        count_tiles(self.chunks, drawn, across, tiles, self._sorted, self.boxes, self.histogram)
        entries = self._scan.places(self.histogram, self.chunks, tiles, self.starts)
        if entries > MAX_TILE_ENTRIES:
            raise InputError(
                f"tile lists: {entries} entries; allowed: {MAX_TILE_ENTRIES}; "
                "draw a smaller image, fewer particles or smaller radii"
            )
        if entries > len(self.entries):
            self.entries = zeros(min(int(entries * 1.25), MAX_TILE_ENTRIES), np.int32)
        fill_tiles(self.chunks, drawn, across, self._sorted, self.boxes, self.histogram, self.entries)
        return entries
