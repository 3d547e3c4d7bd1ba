"""Where key points are expected to be: each goes on at the mean velocity of the points around it.

A search for pairs that come near each other is good for as long as no key point has left its path by more than the
room that the search found round it, and no thread has turned from the course its ends have by more than the patches it
is part of allow (`patches.py`). What cloth does together, however fast, uses up none of either.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.stencil import largest, load, near, nothing, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["CELL", "EAST", "HOLD", "NORTH", "POINT", "Paths"]

CELL, EAST, NORTH, POINT = 1, 2, 4, 8
"""Bits of what belongs to an element of the padded grid: both triangles of its cell and the thread across them, the
threads to the next key point of its row and of its column, the key point itself."""

FULL = 0.998
"""Share of its room, squared, to which a key point is pulled back that has used up more."""

HOLD = 0.85
"""Share of its room at which a key point is held within an interval, before its threads are solved: pulled back at the
end they would be drawn long."""

ROUNDS = 3
"""In which that is done: what is pulled back at one place may be too much at the next."""


@ti.data_oriented
class Paths:
    """Of padded grids of up to `size` key points. has: `CELL` and so on. was, went: place and step at the start of an
    interval [m]. begin, pace: path since the last search of all, where it is at its start [m] and its step [m a
    substep]. now: where it is at the last search [m]. off: from the path [m]; astray: of a cell's corners at most [m].
    room, turn: 1 over the square of how far key points may be off [m], and of how much the difference of two that a
    thread joins may be off [m]; 0 where there is none. renewed: substep at which the path was, from that search on.
    use: which share of room or turn is used up. fast: of it, how much a substep. used, rate: the largest of these.
    spent: 1 of key points that get a new path. count: packets of lanes. since: substeps since the search of all. held:
    share of their room at which key points are held, or 1. rough: how much the paces of key points differ from those of
    their paths, in the root of the mean square [m]."""

    count: Any  # its number is the bound of loops: type checkers would take it for a matrix

    def __init__(self, size: int) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, size) for _ in range(count)]

        self.was, self.went, self.begin, self.now, self.pace, self.off, self._own = (fields(3) for _ in range(7))
        self.room, self.turn_east, self.turn_north, self.there, self.renewed, self.use, self.fast = fields(7)
        self.astray = ti.field(ti.f32, size)
        self.has, self.spent = ti.field(ti.i32, size), ti.field(ti.i32, size)
        self.count, self.since = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.used, self.rate, self.rough, self.held = (ti.field(ti.f32, ()) for _ in range(4))

    @ti.func
    def packet(self, e):
        return ti.min(ti.max(e, 0), 1 << 21) * LANES

    @routine
    def keep(self, points: Template):
        """Where an interval starts."""
        for e in range(self.count[None]):
            p = self.packet(e)
            for axis in ti.static(range(3)):
                store(self.was[axis], p, load(points.position[axis], p))
                store(self.went[axis], p, load(points.step[axis], p))

    @routine
    def go_back(self, points: Template, span: Int):
        """To where the interval started, `span` substeps ago."""
        self.since[None] = self.since[None] - span
        for e in range(self.count[None]):
            p = self.packet(e)
            for axis in ti.static(range(3)):
                store(points.position[axis], p, load(self.was[axis], p))
                store(points.step[axis], p, load(self.went[axis], p))

    @routine
    def spend_all(self):
        """All key points get a new path: a search of all."""
        self.since[None] = 0
        for e in range(self.count[None]):
            store(self.spent, self.packet(e), ti.Vector([1] * LANES))

    @routine
    def spend(self, allowed: Float, ahead: Float) -> Int:
        """After `measure`: those get a new path that, at the rate that they did, would use up more than what is allowed
        within `ahead` substeps. Returns how many."""
        count = ti.Vector([0] * LANES)
        for e in range(self.count[None]):
            p = self.packet(e)
            spent = ti.select(load(self.use, p) + ahead * load(self.fast, p) > allowed, 1, 0)
            store(self.spent, p, spent)
            count += spent
        return count.sum()

    @routine
    def predict(self, points: Template, span: Float):
        """New paths of those that are to get one. span: substeps since `was`; 0: at the speed of the last step."""
        time = ti.cast(self.since[None], ti.f32)
        for e in range(self.count[None]):
            self.take_pace(points, self.packet(e), span)
        total, count = 0.0, ti.Vector([0.0] * LANES)
        for axis in ti.static(range(3)):
            total += self.renew(points, axis)
        for e in range(self.count[None]):
            p = self.packet(e)
            store(self.renewed, p, ti.select(load(self.spent, p) != 0, time, load(self.renewed, p)))
            count += load(self.there, p)
        self.rough[None] = ti.sqrt(total / ti.max(count.sum(), 1.0))  # pyright: ignore[reportOptionalCall]

    @ti.func
    def take_pace(self, points: Template, p, span):
        """The own pace of the lanes at p."""
        scale, there = 1.0 / ti.max(span, 1.0), load(self.there, p)
        for axis in ti.static(range(3)):
            mean = scale * (load(points.position[axis], p) - load(self.was[axis], p))
            own = ti.select(span > 0.0, mean, load(points.step[axis], p))
            store(self._own[axis], p, there * own)

    @ti.func
    def paces(self, axis: Template, p, row):
        """Of the lanes at p the own pace along an axis, and the mean of those round each: by twos across from each
        other, so that a slope of the pace changes nothing, and at an edge neither counts."""
        own = load(self._own[axis], p)
        mean, weight = 4.0 * own, nothing() + 4.0
        for o, share in ti.static(((1, 2.0), (row, 2.0), (row + 1, 1.0), (row - 1, 1.0))):
            a, b = near(p + o), near(p - o)
            both = share * load(self.there, a) * load(self.there, b)
            weight += 2.0 * both
            mean += both * (load(self._own[axis], a) + load(self._own[axis], b))
        return own, mean / weight

    @routine
    def renew(self, points: Template, axis: Template) -> Float:
        """One axis of new paths: at the mean pace of those round each. Returns the sum of the squares of what the own
        differ from that by."""
        row, time = points.row[None], ti.cast(self.since[None], ti.f32)
        total = ti.Vector([0.0] * LANES)
        for e in range(self.count[None]):
            p = self.packet(e)
            own, mean = self.paces(axis, p, row)
            here, spent = load(points.position[axis], p), load(self.spent, p) != 0
            pace = ti.select(spent, mean, load(self.pace[axis], p))
            begin = ti.select(spent, here - time * mean, load(self.begin[axis], p))
            store(self.pace[axis], p, pace)
            store(self.begin[axis], p, begin)
            store(self.now[axis], p, begin + time * pace)
            store(self.off[axis], p, ti.select(spent, 0.0, load(self.off[axis], p)))
            total += load(self.there, p) * (mean - own) ** 2
        return total.sum()  # pyright: ignore[reportOptionalCall]

    @routine
    def stray(self, row: Int):
        """How far the corners of each cell are off, at most, into `astray`; after `measure` or `predict`."""
        for e in range(self.count[None]):
            p, most = self.packet(e), ti.Vector([0.0] * LANES)
            for offset in ti.static((0, 1, row, row + 1)):
                q = near(p + offset)
                x, y, z = load(self.off[0], q), load(self.off[1], q), load(self.off[2], q)
                most = ti.max(most, x * x + y * y + z * z)
            store(self.astray, p, ti.sqrt(most))

    @routine
    def measure(self, points: Template):
        """How far all are off, into `off`; which share each has used up; `used` and `rate`."""
        row = points.row[None]
        time = ti.cast(self.since[None], ti.f32)
        for e in range(self.count[None]):
            p = self.packet(e)
            total = ti.Vector([0.0] * LANES)
            for axis in ti.static(range(3)):
                path = load(self.begin[axis], p) + time * load(self.pace[axis], p)
                off = load(points.position[axis], p) - path
                store(self.off[axis], p, off)
                total += off * off
            total *= load(self.room, p)
            store(self.use, p, total)
            store(self.fast, p, total / ti.max(time - load(self.renewed, p), 1.0) ** 2)
        for e in range(self.count[None]):
            p = self.packet(e)
            for offset, turn in ti.static(((1, self.turn_east), (row, self.turn_north))):
                total = ti.Vector([0.0] * LANES)
                for axis in ti.static(range(3)):
                    apart = load(self.off[axis], near(p + offset)) - load(self.off[axis], p)
                    total += apart * apart
                total *= load(turn, p)
                since = ti.min(load(self.renewed, p), load(self.renewed, near(p + offset)))
                rate = total / ti.max(time - since, 1.0) ** 2
                for q in ti.static((p, near(p + offset))):
                    store(self.use, q, ti.max(load(self.use, q), total))
                    store(self.fast, q, ti.max(load(self.fast, q), rate))
        most, fast = ti.Vector([0.0] * LANES), ti.Vector([0.0] * LANES)
        for e in range(self.count[None]):
            p = self.packet(e)
            used, rate = ti.sqrt(load(self.use, p)), ti.sqrt(load(self.fast, p))
            store(self.use, p, used)
            store(self.fast, p, rate)
            most, fast = ti.max(most, used), ti.max(fast, rate)
        self.used[None], self.rate[None] = largest(most), largest(fast)

    @routine
    def hold_all(self, points: Template, done: Int):
        """Within an interval, those that have used up `held` of their room are held there. done: substeps of the
        interval. points: of the solver."""
        time, most = ti.cast(self.since[None] + done, ti.f32), self.held[None] ** 2
        for e in range(self.count[None]):
            p = self.packet(e)
            total = ti.Vector([0.0] * LANES)
            for axis in ti.static(range(3)):
                off = load(points.position[axis], p) - load(self.begin[axis], p) - time * load(self.pace[axis], p)
                total += off * off
            total *= load(self.room, p)
            if largest(total) > most:
                free = ti.select(load(points.inverse_mass, p) > 0.0, 1.0, 0.0)
                share = free * (1.0 - ti.min(ti.sqrt(most / ti.max(total, 1e-9)), 1.0))
                for axis in ti.static(range(3)):
                    off = load(points.position[axis], p) - load(self.begin[axis], p) - time * load(self.pace[axis], p)
                    store(points.position[axis], p, load(points.position[axis], p) - share * off)
                    store(points.step[axis], p, load(points.step[axis], p) - share * off)

    @routine
    def pull_back(self, points: Template, span: Int):
        """Key points that have left their room to its edge, and threads that have turned by more than their slack back
        to it. After `measure`. span: substeps of the interval."""
        row = points.row[None]
        for _ in range(ROUNDS):
            for p in range(self.count[None] * LANES):
                most = ti.Vector([self.off[0][p], self.off[1][p], self.off[2][p]])
                if most.norm_sqr() * self.room[p] > FULL and points.inverse_mass[p] > 0.0:
                    # Blends after what they consist of has been pulled back, which may be enough.
                    off = self.away(points, p)
                    used = off.norm_sqr() * self.room[p]
                    if used > FULL:
                        back = (1.0 - FULL / ti.sqrt(used)) * off
                        points.blends.move(points, p, -back, -back / span)
            for p in range(self.count[None] * LANES):
                for offset, turn in ti.static(((1, self.turn_east), (row, self.turn_north))):
                    if turn[p] > 0.0:
                        self.turn_back(points, p, p + offset, turn[p], span)

    @ti.func
    def away(self, points: Template, p):
        """How far element p is off its path now."""
        out, time = points.blends.place(points, p), ti.cast(self.since[None], ti.f32)
        for axis in ti.static(range(3)):
            out[axis] -= self.begin[axis][p] + time * self.pace[axis][p]
        return out

    @ti.func
    def turned(self, p, q):
        """How far two differ in how far they are off, squared [m²]; after `measure`."""
        total = 0.0
        for axis in ti.static(range(3)):
            total += (self.off[axis][q] - self.off[axis][p]) ** 2
        return total

    @ti.func
    def turn_back(self, points: Template, p, q, turn, span):
        """The thread from p to q, by moving both ends."""
        most = self.turned(p, q)
        one, other = points.inverse_mass[p] > 0.0, points.inverse_mass[q] > 0.0
        if most * turn > 0.25 * FULL and (one or other):
            apart = self.away(points, q) - self.away(points, p)
            used = apart.norm_sqr() * turn
            if used > FULL:
                back = (1.0 - FULL / ti.sqrt(used)) * apart
                share = ti.select(one and other, 0.5, 1.0)
                if one:
                    points.blends.move(points, p, share * back, share * back / span)
                if other:
                    points.blends.move(points, q, -share * back, -share * back / span)
