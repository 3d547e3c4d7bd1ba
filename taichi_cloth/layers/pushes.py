"""What contacts pushed and rubbed in the last substep of an interval, for those of the next: lists of contacts are made
anew, and what bears a stack would have to be found anew with them."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.routine import routine

__all__ = ["Pushes"]


@ti.data_oriented
class Pushes:
    """Room for so many contacts of elements up to `size`. point: [corner]. pushed, rubbed: as of `Contacts`. first: of
    each element, from 1, of those whose first point it is; next: of each of these."""

    count: Any

    def __init__(self, room: int, size: int) -> None:
        self.point = [ti.field(ti.i32, room) for _ in range(4)]
        self.pushed, self.rubbed = ti.field(ti.f32, room), [ti.field(ti.f32, room) for _ in range(3)]
        self.next, self.first, self.count = ti.field(ti.i32, room), ti.field(ti.i32, size), ti.field(ti.i32, ())

    @routine
    def take(self, contacts: Template):
        """Those that push, of `Contacts` or `Blended`."""
        at = self.count[None]
        for c in range(contacts.count[None]):
            if contacts.pushed[c] > 0.0:
                for corner in ti.static(range(4)):
                    self.point[corner][at] = contacts.point[corner][c]
                for axis in ti.static(range(3)):
                    self.rubbed[axis][at] = contacts.rubbed[axis][c]
                self.pushed[at], p = contacts.pushed[c], contacts.point[0][c]
                self.next[at], self.first[p] = self.first[p], at + 1
                at += 1
        self.count[None] = at

    @ti.func
    def recall(self, contacts: Template, pairs: Template, pair, c):
        """Contact c, of a near pair, begins with what that pushed; friction along its new direction is left out."""
        for corner in ti.static(range(4)):
            contacts.point[corner][c] = pairs.point[corner][pair]
        pushed, rubbed = 0.0, ti.Vector([0.0, 0.0, 0.0])
        at = self.first[contacts.point[0][c]]
        while at != 0:
            k, alike = at - 1, True
            for corner in ti.static(range(1, 4)):
                alike &= self.point[corner][k] == contacts.point[corner][c]
            if alike:
                n = ti.Vector([contacts.normal[axis][c] for axis in ti.static(range(3))])
                was = ti.Vector([self.rubbed[axis][k] for axis in ti.static(range(3))])
                pushed, rubbed = self.pushed[k], was - was.dot(n) * n
            at = ti.select(alike, 0, self.next[k])
        contacts.pushed[c] = pushed
        for axis in ti.static(range(3)):
            contacts.rubbed[axis][c] = rubbed[axis]

    @ti.func
    def clear(self):
        """None."""
        for k in range(self.count[None]):
            self.first[self.point[0][k]] = 0
        self.count[None] = 0
