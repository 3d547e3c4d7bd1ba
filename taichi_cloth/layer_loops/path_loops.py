"""Paths of key points as parallel loops (`layers/paths.py` has what they are): all get new ones at once."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.layers.layer_fields import FAR, NEXT, SHARE
from taichi_cloth.layers.paths import FULL, ROUNDS

__all__ = ["PathLoops", "carry"]

GROUP = 256
"""Numbers that one thread goes through."""


@ti.func
def carry(position: Template, step: Template, places: Template, steps: Template, p):
    """Where element p is, and its step, from fields [axis] to others."""
    for axis in ti.static(range(3)):
        places[axis][p], steps[axis][p] = position[axis][p], step[axis][p]


@ti.data_oriented
class PathLoops:
    """points: a `LayerFields`. count: elements of the padded grid; row: of them. there: key points of the sheet. sewn:
    whether points of it are blends of others."""

    def __init__(self, points: Any, count: int, row: int, there: int, *, sewn: bool) -> None:
        self.points, self.paths, self.sewn = points, points.paths, sewn
        self.count, self.row, self.there = count, row, there
        self.groups = -(-count // GROUP)
        self.value, self.group = ti.field(ti.f32, self.groups * GROUP), ti.field(ti.f32, self.groups)

    @ti.func
    def predict(self, span, longest, left):
        """Loops: new paths from here on; and the horizon of a search. span, left: as of `LayerFields.search_all`."""
        for p in range(self.count):
            self.paths.take_pace(self.points, p, span)
        for p in range(self.count):
            total = 0.0
            for axis in ti.static(range(3)):
                own, mean = self.paths.paces(axis, p, self.row)
                here = self.points.position[axis][p]
                self.paths.pace[axis][p], self.paths.begin[axis][p] = mean, here
                self.paths.now[axis][p], self.paths.off[axis][p] = here, 0.0
                total += self.paths.there[p] * (mean - own) ** 2
            self.value[p] = total
        self.group_up(True)
        for _ in range(1):
            total = self.of_groups(True)
            good = SHARE * 0.5 * self.points.reach[None] / ti.max(ti.sqrt(total / self.there), 1e-7)
            most = ti.min(ti.max(ti.cast(ti.min(good, 1e6), ti.i32), NEXT * longest), FAR * longest)
            parts = (left + most - 1) // most
            self.points.horizon[None], self.paths.since[None] = (left + parts - 1) // parts, 0

    @ti.func
    def measure(self, since):
        """Loops: `off` of all, and the largest share of room or turn that one has used up, `used`. since: substeps
        since the search."""
        for p in range(self.count):
            if p == 0:
                self.paths.since[None] = since
            total = 0.0
            for axis in ti.static(range(3)):
                path = self.paths.begin[axis][p] + ti.cast(since, ti.f32) * self.paths.pace[axis][p]
                off = self.points.position[axis][p] - path
                self.paths.off[axis][p] = off
                total += off * off
            self.paths.use[p] = total * self.paths.room[p]
        for p in range(self.count):
            most = self.paths.use[p]
            for offset, turn in ti.static(((1, self.paths.turn_east), (self.row, self.paths.turn_north))):
                if turn[p] > 0.0:
                    most = ti.max(most, self.paths.turned(p, p + offset) * turn[p])
            self.value[p] = most
        self.group_up(False)
        for _ in range(1):
            self.paths.used[None] = ti.sqrt(self.of_groups(False))

    @ti.func
    def group_up(self, summed: Template):
        """A loop: the sum of each group of `value`, or the largest number in it."""
        for g in range(self.groups):
            out = 0.0
            for k in range(g * GROUP, (g + 1) * GROUP):
                out = self.both(out, self.value[k], summed)
            self.group[g] = out

    @ti.func
    def of_groups(self, summed: Template):
        """That of all groups, after `group_up`."""
        out = 0.0
        for g in range(self.groups):
            out = self.both(out, self.group[g], summed)
        return out

    @ti.func
    def both(self, one, other, summed: Template):
        return one + other if ti.static(summed) else ti.max(one, other)

    @ti.func
    def keep(self):
        """A loop: where an interval starts."""
        for p in range(self.count):
            carry(self.points.position, self.points.step, self.paths.was, self.paths.went, p)

    @ti.func
    def go_back(self):
        """A loop: there."""
        for p in range(self.count):
            carry(self.paths.was, self.paths.went, self.points.position, self.points.step, p)

    @ti.func
    def pull_back(self, span):
        """Loops: as `Paths.pull_back`; threads by colours, every second of a row or column at a time. Corners of cells
        that are blends move what others may: one after the other, and the threads to them, after the others."""
        for _ in ti.static(range(ROUNDS)):
            for p in range(self.count):
                if not self.is_blend(p):
                    self.pull(p, span)
            if ti.static(self.sewn):
                for _ in range(1):
                    for k in range(self.points.blends.count[None]):
                        if self.points.blends.at[k] < self.count:
                            self.pull(self.points.blends.at[k], span)
            for colour in ti.static(range(4)):
                for p in range(self.count):
                    offset = ti.static(1 if colour < 2 else self.row)
                    line = ti.select(ti.static(colour < 2), p % self.row, p // self.row)
                    if line % 2 == colour % 2 and not self.is_blend(p) and not self.is_blend(p + offset):
                        self.turn_back(p, span, ti.static(colour // 2))
            if ti.static(self.sewn):
                for _ in range(1):
                    for k in range(self.points.blends.count[None]):
                        p = self.points.blends.at[k]
                        if p < self.count:
                            for along, first in ti.static(((0, 0), (0, 1), (1, 0), (1, self.row))):
                                self.turn_back(p - first, span, along)

    @ti.func
    def is_blend(self, p):
        out = False
        if ti.static(self.sewn):
            out = self.points.blends.of[ti.min(p, self.count - 1)] >= 0
        return out

    @ti.func
    def pull(self, p, span):
        """Key point p, or a blend, to the edge of its room."""
        off = self.paths.away(self.points, p)
        used = off.norm_sqr() * self.paths.room[p]
        if used > FULL and self.points.inverse_mass[p] > 0.0:
            back = (1.0 - FULL / ti.sqrt(used)) * off
            self.points.blends.move(self.points, p, -back, -back / span)

    @ti.func
    def turn_back(self, p, span, north: Template):
        """The thread that begins at p, along its row or its column."""
        offset, turn = ti.static((self.row, self.paths.turn_north) if north else (1, self.paths.turn_east))
        if turn[p] > 0.0:
            self.paths.turn_back(self.points, p, p + offset, turn[p], span)

    @ti.func
    def hold(self, points: Template, loops: Template):
        """A loop: as `Paths.hold_all`. points: of the solver. loops: of a frame."""
        for p in range(self.count):
            done = loops.now() + 1 - self.points.began[None]
            time, most = ti.cast(self.paths.since[None] + done, ti.f32), self.paths.held[None] ** 2
            off, total = ti.Vector([0.0, 0.0, 0.0]), 0.0
            for axis in ti.static(range(3)):
                here = points.position[axis][p] - self.paths.begin[axis][p]
                off[axis] = here - time * self.paths.pace[axis][p]
                total += off[axis] * off[axis]
            total *= self.paths.room[p]
            if total > most and points.inverse_mass[p] > 0.0:
                share = 1.0 - ti.min(ti.sqrt(most / ti.max(total, 1e-9)), 1.0)
                for axis in ti.static(range(3)):
                    points.position[axis][p] = points.position[axis][p] - share * off[axis]
                    points.step[axis][p] = points.step[axis][p] - share * off[axis]
