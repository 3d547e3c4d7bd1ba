"""Depth order and tile lists, without atomics: stable counting sorts with one histogram a chunk.

Work is cut into chunks of neighbours. Each chunk counts into a histogram of its own; one serial scan over the
bins, and within a bin over the chunks, turns the counts into places; then each chunk fills its places in
order. Whatever the number of chunks, the result is the same stable sort.

Taichi on a CPU gives each thread at least 512 iterations of a parallel loop and splits them evenly. A loop over
chunks therefore runs CHUNK_STEPS iterations a chunk, of which the first does all the work.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from taichi.lang import impl

from taichi_cloth.ground.arrays import I32x1, I32x2, I64x1, Int, Long

__all__ = [
    "BINS",
    "CHUNK_STEPS",
    "DEEPEST_KEY",
    "count_high",
    "count_tiles",
    "fill_tiles",
    "places",
    "scatter_high",
    "scatter_low",
    "share",
    "usual_chunks",
]

BINS = 2048
"""Bins of one round: 11 bits."""

DEEPEST_KEY = BINS * BINS - 1
"""Depth keys have 22 bits: two rounds of an 11-bit counting sort."""

CHUNK_STEPS = 1024

GPU_CHUNKS = 256


def usual_chunks() -> int:
    """Parts that work is cut into: one a thread of a CPU; many for a graphics device, where a part is one lane's."""
    return int(impl.current_cfg().cpu_max_num_threads) if _on_cpu() else GPU_CHUNKS


def _on_cpu() -> bool:
    return impl.current_cfg().arch in (ti.x64, ti.arm64)


def places(histogram: NDArray[np.int32], chunks: int, bins: int, starts: NDArray[np.int32] | None = None) -> int:
    """Replace counts by places, bin by bin and chunk by chunk; returns their total, and where each bin begins.

    histogram: (chunks or more, bins or more). starts: (bins + 1 or more,). A graphics device would go through the
    bins with one lane, so there it is done on the host.
    """
    if starts is None:
        starts = np.empty(bins + 1, np.int32)
    if _on_cpu():
        return _scan(chunks, bins, histogram, starts)
    counts = histogram[:chunks, :bins].T.ravel().astype(np.int64)
    ends = np.cumsum(counts)
    begins = (ends - counts).reshape(bins, chunks)
    histogram[:chunks, :bins] = begins.T.astype(np.int32)
    starts[: bins + 1] = np.append(begins[:, 0], ends[-1]).astype(np.int32)
    return int(ends[-1])


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
def scatter_low(
    chunks: Int, block_count: Int, block_size: Int, keys: I32x1, histogram: I32x2, order_out: I32x1, high_out: I32x1
):
    """First round: particles that have a key, by its low 11 bits; high_out takes its high bits along."""
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
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
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
        for k in range(BINS):
            histogram_out[chunk, k] = 0
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            histogram_out[chunk, high[i]] = histogram_out[chunk, high[i]] + 1


@ti.kernel
def scatter_high(chunks: Int, count: Int, high: I32x1, order: I32x1, histogram: I32x2, sorted_out: I32x1):
    """Second round: sorted_out has the particles from the nearest to the farthest."""
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
        for i in range(share(count, chunk, chunks), share(count, chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
            place = histogram[chunk, high[i]]
            histogram[chunk, high[i]] = place + 1
            sorted_out[place] = order[i]


@ti.kernel
def count_tiles(chunks: Int, count: Int, tiles_x: Int, tiles: Int, order: I32x1, boxes: I64x1, histogram_out: I32x2):
    """How many splats each tile gets from each chunk."""
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
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
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
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
