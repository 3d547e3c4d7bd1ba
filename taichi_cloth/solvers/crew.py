"""Threads that go through one kernel together, stage by stage.

At 6,000 key points a launch of a parallel loop costs more than a substep, so all substeps of a frame are one kernel, and
its threads meet inside it. A stage is cut into PARTS that share nothing they write. Whoever comes takes the next part
that nobody has taken; the next stage begins when all parts of this one are finished.

So no thread waits for another to come, only for a part that another has begun: a thread that gets no processor is done
without, both can run one after the other, and nothing can hang. What a stage leaves does not depend on who did which
part, so the bytes do not depend on the number of threads.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false

import numpy as np
import taichi as ti
from numpy.typing import NDArray

__all__ = ["LINE", "PARTS", "Crew", "even_parts"]

PARTS = 8
"""More than threads: the quick help the slow."""

LINE = 32
"""Elements between what two threads write: two cache lines."""


def even_parts(sizes: NDArray[np.int64]) -> NDArray[np.int32]:
    """A part for each of things of those sizes that must not be divided: the largest first, each to the smallest part
    so far, of equals the outermost, for that is where threads begin."""
    outermost = np.array([k // 2 if k % 2 == 0 else PARTS - 1 - k // 2 for k in range(PARTS)])
    load, out = np.zeros(PARTS, np.int64), np.zeros(len(sizes), np.int32)
    for thing in np.argsort(-np.asarray(sizes), kind="stable"):
        part = outermost[np.argmin(load[outermost])]
        load[part] += sizes[thing]
        out[thing] = part
    return out


@ti.data_oriented
class Crew:
    """threads: how many there are; with one, nothing is counted."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.taken = ti.field(ti.i32, (PARTS + 2) * LINE)  # the last stage in which each part was taken
        self.finished = ti.field(ti.i32, 2 * LINE)  # parts, of all stages

    @ti.func
    def assemble(self):
        """Before the first stage, by one thread."""
        for part in range(PARTS):
            self.taken[(part + 1) * LINE] = 0
        self.finished[LINE] = 0

    @ti.func
    def take(self, thread, turn, stage):
        """The part that a thread looks at in its turn, from 0 to PARTS − 1, or −1 where it is taken already. Threads
        begin apart from each other. stage: from 1."""
        part = turn
        if ti.static(self.threads > 1):
            first = (thread + thread % 2) * PARTS // self.threads
            part = (first + turn if thread % 2 == 0 else first - 1 - turn + PARTS) % PARTS
            if ti.atomic_max(self.taken[(part + 1) * LINE], stage) >= stage:
                part = -1
        return part

    @ti.func
    def finish(self):
        """A part that was taken."""
        if ti.static(self.threads > 1):
            ti.atomic_add(self.finished[LINE], 1)

    @ti.func
    def meet(self, stage):
        """Until all parts of the stage are finished."""
        if ti.static(self.threads > 1):
            while ti.atomic_add(self.finished[LINE], 0) < stage * PARTS:  # what cannot be kept in a register
                pass
