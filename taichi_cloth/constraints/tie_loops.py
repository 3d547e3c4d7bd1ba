"""Ties as parallel loops (`ties.py` has the law, `tie_fields.py` the serial form and the numbers).

To close all at once is parallel as it is: how far each tie is apart, the product with a matrix that is known, and what
moves each key point, summed over its ties in their order. The few ties that are still too wide after it, and the few
threads beside ties that are too long, are gone through one after the other by one thread of the device, in the order of
a CPU: so the answer is a CPU's.
"""

from collections.abc import Callable
from typing import Any

import taichi as ti

from taichi_cloth.constraints.tie_fields import NODES, TieFields
from taichi_cloth.ground.arrays import Template

__all__ = ["TieLoops"]

GROUP = 16
"""Threads beside ties that one of the device looks at."""


@ti.data_oriented
class TieLoops:
    """Of the ties in some fields.

    round: how often ties were closed in this substep. near: of each thread beside ties, whether it was nearly too long
    at the last look; any_near: of each group of them, whether one was.
    """

    def __init__(self, ties: TieFields, threads: int) -> None:
        self.ties, self.groups = ties, -(-threads // GROUP)
        self.round: Any = ti.field(ti.i32, ())
        self.near, self.any_near = ti.field(ti.i32, self.groups * GROUP), ti.field(ti.i32, self.groups)

    def kernel(self, loops: Any, again: bool) -> Callable[..., Any]:
        """All ties, the first time in a substep, or again."""
        points, ties = loops.frame, self.ties
        follows = points.sums and ties.repeated  # a substep begins with what ties were pushed by in those before
        always = points.sums and not ties.repeated  # yarns pull again at what is held
        seen = points.sums and (again or always)  # threads beside ties

        @ti.kernel
        def close():
            if ti.static(not (ties.repeated or again)):
                for k in range(ties.capacity):
                    if k < ties.count():
                        ties.slide_one(points, k, ties.share_of(loops.now()))
            if ti.static(follows and not again):
                for m in range(ties.capacity * NODES):
                    if m < ties.points[None]:
                        ties.move_point(points, ties.usual, m)
            elif ti.static(not again or follows or always):
                self.close_all(points, loops, ti.static(not again or always))
            if ti.static(again and not always):
                self.close_wide(points, loops)
            if ti.static(seen):
                self.see_to_beside(points, loops, always)
            for _ in range(1):
                self.round[None] = self.round[None] + 1 if ti.static(again) else ti.static(0 if follows else 1)

        return close

    @ti.func
    def close_all(self, points: Template, loops: Template, always: Template):
        """Loops: all ties at once, where it is the first round or always."""
        for k in range(self.ties.capacity):
            if k < self.asked(always):
                self.ties.far[k] = int(self.ties.ask(points, k, self.ties.share_of(loops.now())))
        for k in range(self.ties.capacity):
            if k < self.asked(always):
                self.ties.answer_one(points, k)
        for m in range(self.ties.capacity * NODES):
            if m < self.ties.points[None] and self.asked(always) > 0:
                self.ties.move_point(points, self.ties.push, m)
        for k in range(self.ties.capacity):
            if k < self.asked(always):
                self.ties.learn_one(points, k)

    @ti.func
    def asked(self, always: Template):
        """How many ties are closed at once in this round."""
        out = self.ties.count()
        if ti.static(not always):
            out = out if self.round[None] == 0 else 0
        return out

    @ti.func
    def close_wide(self, points: Template, loops: Template):
        """A loop of one: the ties that were too wide, after the first round."""
        for _ in range(1):
            if self.round[None] > 0:
                for k in range(self.ties.count()):
                    if self.ties.far[k] > 0:
                        self.ties.close(points, k, self.ties.share_of(loops.now()))

    @ti.func
    def see_to_beside(self, points: Template, loops: Template, always: Template):
        """Loops: threads beside ties, where it is not the first round, or always."""
        for g in range(self.groups):
            share = self.ties.share_of(loops.now())
            if (always or self.round[None] > 0) and self.ties.closed() and self.ties.looks(share, loops.now()):
                found = 0
                for t in range(g * GROUP, (g + 1) * GROUP):
                    near = t < self.ties.beside.count[None] and self.ties.beside.is_nearly(points, t)
                    self.near[t] = int(near)
                    found += int(near)
                self.any_near[g] = found
        for _ in range(1):
            if always or self.round[None] > 0:
                share, listed = self.ties.share_of(loops.now()), 0
                if self.ties.closed():
                    if self.ties.looks(share, loops.now()):
                        self.ties.beside.listed[None] = self.listed()
                    listed = self.ties.beside.listed[None]
                self.ties.take_turns(points, listed, share)

    @ti.func
    def listed(self):
        """Lists the threads that were near, in their order: how many."""
        found = 0
        for g in range(self.groups):
            if self.any_near[g] > 0:
                for t in range(g * GROUP, (g + 1) * GROUP):
                    if self.near[t] > 0:
                        self.ties.beside.nearly[found] = t
                        found += 1
        return found
