"""Depth order and tile lists, without atomics: stable counting sorts with one histogram a chunk.

Work is cut into chunks of neighbours. Each chunk counts into a histogram of its own; one serial scan over the
bins, and within a bin over the chunks, turns the counts into places; then each chunk fills its places in
order. Whatever the number of chunks, the result is the same stable sort.

Taichi on a CPU gives each thread at least 512 iterations of a parallel loop and splits them evenly. A loop over
chunks therefore runs `chunk_steps` iterations a chunk, of which the first does all the work. On a device they are a
warp, so that threads that take different ways do not wait for each other, and there are thousands of chunks.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from taichi.lang import impl

from taichi_cloth.ground.arrays import I32x1, I32x2, I64x1, Int, Long
from taichi_cloth.ground.copies import DeviceArray, zeros
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.ground.vectors import chunk_steps

__all__ = [
    "BINS",
    "DEEPEST_KEY",
    "GPU_CHUNKS",
    "MOST_CHUNKS",
    "MOST_COUNTS",
    "Scan",
    "count_high",
    "count_low",
    "count_tiles",
    "fill_tiles",
    "scatter_high",
    "scatter_low",
    "share",
    "usual_chunks",
]

BINS = 2048
"""Bins of one round: 11 bits."""

DEEPEST_KEY = BINS * BINS - 1
"""Depth keys have 22 bits: two rounds of an 11-bit counting sort."""

GPU_CHUNKS, MOST_CHUNKS, MOST_COUNTS = 256, 4096, 1 << 24
"""Chunks on a graphics device; and, where arrays stay there, at most, with so many counts in a histogram of all."""


def usual_chunks() -> int:
    """Parts that work is cut into: one a thread of a CPU; many for a graphics device, where a part is one lane's."""
    return int(impl.current_cfg().cpu_max_num_threads) if on_host() else GPU_CHUNKS


class Scan:
    """Sums over the histograms of up to `chunks` chunks, of up to `bins` bins each."""

    def __init__(self, chunks: int, bins: int) -> None:
        self._part, self._total = zeros((min(PARTS, chunks), bins), np.int32), zeros(bins, np.int32)
        self._group, self._starts = zeros(-(-bins // GROUP), np.int32), zeros(bins + 1, np.int32)

    def places(self, histogram: NDArray[np.int32], chunks: int, bins: int, starts: Any = None) -> int:
        """Replace counts by places, bin by bin and chunk by chunk; returns their total, and where each bin begins.

        histogram: (chunks or more, bins or more). starts: (bins + 1 or more,). Where arrays do not stay on a graphics
        device it is done on the host.
        """
        starts = self._starts if starts is None else starts
        if on_host():
            return _scan(chunks, bins, histogram, starts)
        if isinstance(histogram, DeviceArray):
            return _scan_at_once(chunks, bins, histogram, self._part, self._total, self._group, starts)
        counts = histogram[:chunks, :bins].T.ravel().astype(np.int64)
        ends = np.cumsum(counts)
        begins = (ends - counts).reshape(bins, chunks)
        histogram[:chunks, :bins] = begins.T.astype(np.int32)
        starts[: bins + 1] = np.append(begins[:, 0], ends[-1]).astype(np.int32)
        return int(ends[-1])


PARTS = 64
"""Into which chunks are cut where they are summed at once."""
GROUP = 64
"""Bins that are summed before those that come after."""


@ti.func
def share(total, chunk, chunks):
    """Where `chunk` of `chunks` begins in 0..total."""
    return ti.cast(ti.cast(total, ti.i64) * chunk // chunks, ti.i32)


@ti.kernel
def _scan(chunks: Int, bins: Int, histogram: I32x2, starts_out: I32x1) -> Long:
    """The total is 64 bits wide, to notice overflow."""
    total = ti.cast(0, ti.i64)
    ti.loop_config(serialize=True)
    for k in range(bins):
        starts_out[k] = ti.cast(total, ti.i32)
        for chunk in range(chunks):
            count = histogram[chunk, k]
            histogram[chunk, k] = ti.cast(total, ti.i32)
            total += count
    starts_out[bins] = ti.cast(total, ti.i32)
    return total


@ti.kernel
def _scan_at_once(
    chunks: Int, bins: Int, histogram: I32x2, part: I32x2, total: I32x1, group: I32x1, starts_out: I32x1
) -> Long:
    """The same with a thread for each bin and part of the chunks."""
    parts = part.shape[0]
    for t in range(parts * bins):
        own, k, run = t // bins, t % bins, 0
        for chunk in range(share(chunks, own, parts), share(chunks, own + 1, parts)):  # pyright: ignore[reportArgumentType]
            run += histogram[chunk, k]
        part[own, k] = run
    for k in range(bins):
        run = 0
        for own in range(parts):
            here = part[own, k]
            part[own, k] = run
            run += here
        total[k] = run
    groups = (bins + GROUP - 1) // GROUP
    for j in range(groups):
        run = 0
        for k in range(j * GROUP, ti.min((j + 1) * GROUP, bins)):
            run += total[k]
        group[j] = run
    for k in range(bins + 1):
        run = 0
        for j in range(k // GROUP):
            run += group[j]
        for m in range(k // GROUP * GROUP, k):
            run += total[m]
        starts_out[k] = run
    for t in range(parts * bins):
        own, k = t // bins, t % bins
        run = starts_out[k] + part[own, k]
        for chunk in range(share(chunks, own, parts), share(chunks, own + 1, parts)):  # pyright: ignore[reportArgumentType]
            here = histogram[chunk, k]
            histogram[chunk, k] = run
            run += here
    everything = ti.cast(0, ti.i64)
    ti.loop_config(serialize=True)
    for j in range(groups):
        everything += group[j]
    return everything


@ti.kernel
def count_low(chunks: Int, block_count: Int, block_size: Int, keys: I32x1, histogram_out: I32x2):
    """Histogram of the low 11 bits of the keys that there are, where `project` has not counted them."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for k in range(BINS):
            histogram_out[chunk, k] = 0
        first = share(block_count, chunk, chunks) * block_size
        for i in range(first, share(block_count, chunk + 1, chunks) * block_size):
            if keys[i] >= 0:
                low = keys[i] & (BINS - 1)
                histogram_out[chunk, low] = histogram_out[chunk, low] + 1


@ti.kernel
def scatter_low(
    chunks: Int, block_count: Int, block_size: Int, keys: I32x1, histogram: I32x2, order_out: I32x1, high_out: I32x1
):
    """First round: particles that have a key, by its low 11 bits; high_out takes its high bits along."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        first = share(block_count, chunk, chunks) * block_size
        for i in range(first, share(block_count, chunk + 1, chunks) * block_size):
            key = keys[i]
            if key >= 0:
                low = key & (BINS - 1)
                place = histogram[chunk, low]
                histogram[chunk, low] = place + 1
                order_out[place] = i
                high_out[place] = key >> 11


@ti.kernel
def count_high(chunks: Int, count: Int, high: I32x1, histogram_out: I32x2):
    """Histogram of the high bits, in the order of the first round."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for k in range(BINS):
            histogram_out[chunk, k] = 0
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            histogram_out[chunk, high[i]] = histogram_out[chunk, high[i]] + 1


@ti.kernel
def scatter_high(chunks: Int, count: Int, high: I32x1, order: I32x1, histogram: I32x2, sorted_out: I32x1):
    """Second round: sorted_out has the particles from the nearest to the farthest."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            place = histogram[chunk, high[i]]
            histogram[chunk, high[i]] = place + 1
            sorted_out[place] = order[i]


@ti.kernel
def count_tiles(chunks: Int, count: Int, tiles_x: Int, tiles: Int, order: I32x1, boxes: I64x1, histogram_out: I32x2):
    """How many splats each tile gets from each chunk."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for k in range(tiles):
            histogram_out[chunk, k] = 0
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            box = boxes[order[i]]
            columns = ti.cast(box, ti.i32)
            rows = ti.cast(box >> 32, ti.i32)
            for y in range(rows & 0xFFFF, (rows >> 16) + 1):
                for x in range(columns & 0xFFFF, (columns >> 16) + 1):
                    histogram_out[chunk, y * tiles_x + x] = histogram_out[chunk, y * tiles_x + x] + 1


@ti.kernel
def fill_tiles(chunks: Int, count: Int, tiles_x: Int, order: I32x1, boxes: I64x1, histogram: I32x2, list_out: I32x1):
    """The lists of all tiles, one after another, each from the nearest splat to the farthest."""
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            splat = order[i]
            box = boxes[splat]
            columns = ti.cast(box, ti.i32)
            rows = ti.cast(box >> 32, ti.i32)
            for y in range(rows & 0xFFFF, (rows >> 16) + 1):
                for x in range(columns & 0xFFFF, (columns >> 16) + 1):
                    place = histogram[chunk, y * tiles_x + x]
                    histogram[chunk, y * tiles_x + x] = place + 1
                    list_out[place] = splat
