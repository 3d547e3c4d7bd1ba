"""Threads that go through one kernel together, stage by stage.

At 6,000 key points a launch of a parallel loop costs more than a substep, so all substeps of a frame are one kernel,
and its threads meet inside it. A stage is cut into parts that share nothing they write. A thread takes its own, and
then those that nobody has taken, if it must; the next stage begins when all parts of this one are finished.

So no thread waits for another to come, only for a part that another has begun: a thread that gets no processor is done
without, all can run one after the other, and nothing can hang. What a stage leaves does not depend on who did which
part, so the bytes do not depend on the number of threads.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.arrays import Template
from taichi_cloth.sheet import LANES

__all__ = ["LINE", "PARTS", "SIDES", "Crew", "parts_of", "sides_of"]

PARTS = 8
"""More than threads: the quick help the slow."""

SIDES = 2
"""What is worked through in order is not cut as fine: half of the parts are a side, and its order is its own."""

PATIENCE = 2000
"""Looks for those who are at work on the rest before a thread helps them, some 50 µs: what it takes over it must fetch
from their caches, which costs more than to wait for a thread that is there."""

PERIOD, TRIALS = 64, 4
"""Frames from one trial of the number of threads to the next, and of a trial."""

LINE = 32
"""Elements between what two threads write: two cache lines."""

Mask = NDArray[np.bool_]


def parts_of(present: Mask, across: NDArray) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Blocks of lanes that hold key points, one part after the other, and PARTS + 1 cuts between parts.

    present: (rows, width) of a padded grid. across: of the same shape; key points with less of it are in an earlier
    side. Parts of a side are rows. Two blocks that share a cache line are in one side.
    """
    used = np.flatnonzero(present.reshape(-1, LANES).any(axis=1))
    pair, number, count = np.unique(used // 2, return_inverse=True, return_counts=True)
    room = (0, -present.size % (2 * LANES))
    held = np.pad(present.ravel(), room).reshape(-1, 2 * LANES)[pair]
    value = np.where(held, np.pad(across.ravel(), room).reshape(-1, 2 * LANES)[pair], 0.0)
    order = np.argsort(value.sum(axis=1) / held.sum(axis=1), kind="stable")
    side = np.empty(len(pair), np.int64)
    side[order] = (np.cumsum(count[order]) - 1) * SIDES // len(used)
    blocks, cuts = [], [0]
    for k in range(SIDES):
        here = used[side[number] == k]
        blocks.append(here)
        ends = np.arange(1, PARTS // SIDES + 1) * len(here) // (PARTS // SIDES)
        cuts.extend((ends + sum(len(b) for b in blocks[:-1])).tolist())
    return np.concatenate(blocks).astype(np.int32), np.array(cuts, np.int32)


def sides_of(blocks: NDArray[np.int32], cuts: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """The side of each of `count` blocks, −1 for those that hold nothing; `blocks`, `cuts` from `parts_of`."""
    out = np.full(count, -1, np.int32)
    for side in range(SIDES):
        out[blocks[cuts[side * PARTS // SIDES] : cuts[(side + 1) * PARTS // SIDES]]] = side
    return out


class Pace:
    """How many of `most` threads to take for a frame: all, or one where that is quicker now.

    Where other programs want the processors too, threads that share a frame wait for each other. As the bytes are the
    same either way, it is tried out: a few frames of each in turn, and again from time to time.
    """

    def __init__(self, most: int) -> None:
        self._most, self._best, self._frame = most, most, 0
        self._spent = [0.0, 0.0]

    def threads(self) -> int:
        at = self._frame % PERIOD
        return (self._most, 1)[at % 2] if 0 < at <= TRIALS else self._best

    def took(self, seconds: float) -> None:
        """What the frame took."""
        at = self._frame % PERIOD
        if 0 < at <= TRIALS:
            self._spent[at % 2] += seconds
            if at == TRIALS:
                self._best = self._most if self._spent[0] < self._spent[1] else 1
                self._spent = [0.0, 0.0]
        self._frame += 1


@ti.data_oriented
class Crew:
    """threads: how many there may be; with one, nothing is counted."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.taken = ti.field(ti.i32, (PARTS + 2) * LINE)  # the last stage in which each part was taken
        self.finished = ti.field(ti.i32, 2 * LINE)  # parts, of all stages
        self.there = ti.field(ti.i32, 2 * LINE)  # how many threads there are
        self.patience = ti.field(ti.i32, (threads + 2) * LINE)

    @ti.func
    def assemble(self, threads):
        """Before the first stage, by one thread."""
        self.there[LINE] = threads
        for part in range(PARTS):
            self.taken[(part + 1) * LINE] = 0
        self.finished[LINE] = 0
        for thread in range(self.threads):
            self.patience[(thread + 1) * LINE] = PATIENCE

    @ti.func
    def take(self, thread, turn, stage, parts: Template, finished):
        """The part that a thread looks at in its turn, from 0 to parts − 1, or −1 where it is not to do it: first its
        own, then those of threads that do not come. stage: from 1. finished: parts, of all stages, when this ends."""
        part = turn
        if ti.static(self.threads > 1):
            threads = self.there[LINE]
            first = (thread + thread % 2) * parts // threads
            part = (first + turn if thread % 2 == 0 else first - 1 - turn + parts) % parts
            spare = part * threads // parts == thread
            if not spare:
                left = self.patience[(thread + 1) * LINE]
                while left > 0 and ti.atomic_add(self.finished[LINE], 0) < finished:
                    left -= 1
                spare = left == 0
            if not spare:
                part = -1
            else:
                taken = ti.atomic_max(self.taken[(part + 1) * LINE], stage) >= stage
                if part * threads // parts != thread:
                    self.patience[(thread + 1) * LINE] = PATIENCE if taken else 0
                if taken:
                    part = -1
        return part

    @ti.func
    def finish(self):
        """A part that was taken."""
        if ti.static(self.threads > 1):
            ti.atomic_add(self.finished[LINE], 1)

    @ti.func
    def meet(self, parts):
        """Until so many parts are finished, of all stages together."""
        if ti.static(self.threads > 1):
            while ti.atomic_add(self.finished[LINE], 0) < parts:  # what cannot be kept in a register
                pass
