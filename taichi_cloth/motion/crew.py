"""Threads that go through one kernel together, stage by stage.

At 6,000 key points a launch of a parallel loop costs more than a substep, so all substeps of a frame are one kernel,
and its threads meet inside it. A stage is cut into parts that share nothing they write. A thread takes its own, and
then those that nobody has taken, if it must; the next stage begins when all parts of this one are finished.

So no thread waits for another to come, only for a part that another has begun: a thread that gets no processor is done
without, all can run one after the other, and nothing can hang. What a stage leaves does not depend on who did which
part, so the bytes do not depend on the number of threads.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import Template
from taichi_cloth.sheet.sheet import LANES

__all__ = ["LINE", "PARTS", "Crew", "Pace", "parts_of"]

PARTS = 8
"""More than threads: the quick help the slow."""

PATIENCE = 2000
"""Looks for those who are at work on the rest before a thread helps them, some 50 µs: what it takes over it must fetch
from their caches, which costs more than to wait for a thread that is there."""

PERIOD, TRIALS = 64, 4
"""Frames from one trial of the number of threads to the next, and of a trial."""

LINE = 32
"""Elements between what two threads write: two cache lines."""


def parts_of(present: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Blocks of lanes that hold key points, in the order of the rows, and PARTS + 1 cuts into parts of about as many.

    present: (rows, width) of a padded grid.
    """
    blocks = np.flatnonzero(present.reshape(-1, LANES).any(axis=1)).astype(np.int32)
    return blocks, (np.arange(PARTS + 1) * len(blocks) // PARTS).astype(np.int32)


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
            own = part * threads // parts == thread
            spare = own
            if not own:
                left = self.patience[(thread + 1) * LINE]
                while left > 0 and ti.atomic_add(self.finished[LINE], 0) < finished:
                    left -= 1
                spare = left == 0
            if not spare:
                part = -1
            else:
                taken = ti.atomic_max(self.taken[(part + 1) * LINE], stage) >= stage
                if not own:
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
