"""Where key points are expected to be: each goes on at the mean velocity of the points around it.

A search for pairs that come near each other is good for as long as no key point has left its path by more than the
room that the search found round it, and no thread has turned from the course its ends have by more than the patches it
is part of allow (`patches.py`). What cloth does together, however fast, uses up none of either.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.stencil import largest, load, near, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["CELL", "EAST", "NORTH", "POINT", "Paths"]

CELL, EAST, NORTH, POINT = 1, 2, 4, 8
"""Bits of what belongs to an element of the padded grid: both triangles of its cell and the thread across them, the
threads to the next key point of its row and of its column, the key point itself."""

FULL = 0.998
"""Share of its room, squared, to which a key point is pulled back that has used up more."""

ROUNDS = 3
"""In which that is done: what is pulled back at one place may be too much at the next."""


@ti.data_oriented
class Paths:
    """Of padded grids of up to `size` key points. has: `CELL` and so on. was: at the start of the interval [m]. begin,
    pace: path from the last search on, place [m] and step [m a substep]. off: from the path [m]. room, turn: 1 over the
    square of how far key points may be off [m], and of how much the difference of two that a thread joins may be off
    [m]; 0 where there is none. count: packets of lanes. since: substeps since the search. used: the largest
    share. rough: the largest difference of a key point's own pace from that of its path [m]."""

    count: Any  # its number is the bound of loops: type checkers would take it for a matrix

    def __init__(self, size: int) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, size) for _ in range(count)]

        self.was, self.begin, self.pace, self.off, self._own = (fields(3) for _ in range(5))
        self.room, self.turn_east, self.turn_north, self.there = fields(4)
        self.has = ti.field(ti.i32, size)
        self.count, self.since = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.used, self.rough = ti.field(ti.f32, ()), ti.field(ti.f32, ())

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

    @routine
    def predict(self, points: Template, span: Float):
        """Paths from here. span: substeps since `was`; 0: at the speed of the last step."""
        row = points.row[None]
        scale = 1.0 / ti.max(span, 1.0)
        for e in range(self.count[None]):
            p = self.packet(e)
            there = load(self.there, p)
            for axis in ti.static(range(3)):
                here = load(points.position[axis], p)
                store(self.begin[axis], p, here)
                mean = scale * (here - load(self.was[axis], p))
                own = ti.select(span > 0.0, mean, load(points.step[axis], p))
                store(self._own[axis], p, there * own)
        most = ti.Vector([0.0] * LANES)
        for e in range(self.count[None]):
            p = self.packet(e)
            # By twos across from each other: a slope of the pace changes nothing, at an edge neither.
            u, v, w = load(self._own[0], p), load(self._own[1], p), load(self._own[2], p)
            x, y, z, weight = u, v, w, ti.Vector([1.0] * LANES)
            for o in ti.static((1, row, row + 1, row - 1)):
                a, b = near(p + o), near(p - o)
                both = load(self.there, a) * load(self.there, b)
                weight += 2.0 * both
                x += both * (load(self._own[0], a) + load(self._own[0], b))
                y += both * (load(self._own[1], a) + load(self._own[1], b))
                z += both * (load(self._own[2], a) + load(self._own[2], b))
            x, y, z = x / weight, y / weight, z / weight
            for axis, pace in ti.static(((0, x), (1, y), (2, z))):
                store(self.pace[axis], p, pace)
            apart = (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2
            most = ti.max(most, apart * load(self.there, p))
        self.rough[None] = ti.sqrt(largest(most))
        self.since[None] = 0

    @routine
    def measure(self, points: Template):
        """How far all are off, into `off`, and `used`."""
        row = points.row[None]
        time = ti.cast(self.since[None], ti.f32)
        most = ti.Vector([0.0] * LANES)
        for e in range(self.count[None]):
            p = self.packet(e)
            total = ti.Vector([0.0] * LANES)
            for axis in ti.static(range(3)):
                path = load(self.begin[axis], p) + time * load(self.pace[axis], p)
                off = load(points.position[axis], p) - path
                store(self.off[axis], p, off)
                total += off * off
            most = ti.max(most, total * load(self.room, p))
        for e in range(self.count[None]):
            p = self.packet(e)
            for offset, turn in ti.static(((1, self.turn_east), (row, self.turn_north))):
                total = ti.Vector([0.0] * LANES)
                for axis in ti.static(range(3)):
                    apart = load(self.off[axis], near(p + offset)) - load(self.off[axis], p)
                    total += apart * apart
                most = ti.max(most, total * load(turn, p))
        self.used[None] = ti.sqrt(largest(most))

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
    def turn_back(self, points: Template, p, q, turn, span):
        """The thread from p to q, by moving both ends."""
        most = 0.0
        for axis in ti.static(range(3)):
            most += (self.off[axis][q] - self.off[axis][p]) ** 2
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
