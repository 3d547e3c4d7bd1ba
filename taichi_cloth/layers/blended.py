"""Contacts of points that are blends of key points: the law of `contacts.py`, of as many key points as there are."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine

__all__ = ["FIRM", "NODES", "ROOM", "TOUCHING", "WEAK", "Blended", "Nodes", "across", "answer", "slid"]

ROOM, NODES = 6, 24
"""Contacts for each blend, and key points of one in the mean, at most."""


FIRM, TOUCHING, WEAK = 0.2, 5.0, 0.02
"""Σ w²/m of a contact, over the largest 1/m, below which it answers only where its sides all but touch, so many times
as far apart as a proof asks for: they are so nearly the same blend that mending more depth would take their key points
far, and shake them. Those of layers that have no key point in common have 0.33 at least. And below which there is none:
that these do not pass through each other is proven all the same."""

ANCHORED, YIELDS = 0.05, 5e-5
"""Share of how far a contact has slid from its anchor that it goes back in a substep, if friction can; and how far it
slides before the anchor is dragged along [m]. Friction that only stops speeds lets what rests creep."""


@ti.func
def across(way, n):
    """What of a way is across n."""
    return way - way.dot(n) * n


@ti.func
def back(contacts: Template, c, place, step, n):
    """By how much the step of a contact differs, across its direction, from that of what is held at its anchor, which
    is dragged along where that is too far [m]. contacts: `Contacts` or `Blended`. place, step: Σ w x and Σ w s."""
    for axis in ti.static(range(3)):
        if contacts.holds[c] == 0:
            contacts.anchor[axis][c] = place[axis] - step[axis]
    contacts.holds[c] = 1
    slid = across(place - ti.Vector([contacts.anchor[axis][c] for axis in ti.static(range(3))]), n)
    most = ti.min(YIELDS / ti.sqrt(slid.norm_sqr() + 1e-20), 1.0)
    for axis in ti.static(range(3)):
        contacts.anchor[axis][c] = contacts.anchor[axis][c] + (1.0 - most) * slid[axis]
    return (1.0 - ANCHORED) * across(step, n) + ANCHORED * most * slid


@ti.func
def answer(contacts: Template, c, place, step, n, friction, share):
    """The push and the friction of a contact in this substep anew, by so large a share of what is asked. Returns by how
    much Σ w²/m of the steps changes that. contacts, place, step: as of `back`."""
    held = ti.Vector([contacts.rubbed[0][c], contacts.rubbed[1][c], contacts.rubbed[2][c]])
    was = contacts.pushed[c]
    push = ti.max(was - share * step.dot(n), 0.0)
    rub = held - share * back(contacts, c, place, step, n)
    rub *= ti.min(friction * push / ti.sqrt(rub.norm_sqr() + 1e-20), 1.0)
    contacts.pushed[c] = push
    for axis in ti.static(range(3)):
        contacts.rubbed[axis][c] = rub[axis]
    return ((push - was) * n + rub - held) * contacts.share[c]


@ti.func
def slid(contacts: Template, points: Template, c):
    """How far a contact is from its anchor, across its direction [m]. contacts: as of `back`."""
    n = ti.Vector([contacts.normal[axis][c] for axis in ti.static(range(3))])
    return across(contacts.place(points, c) - ti.Vector([contacts.anchor[axis][c] for axis in ti.static(range(3))]), n)


@ti.data_oriented
class Nodes:
    """Key points that pairs consist of, and their weights: node, weight, of as many as there is room for."""

    def __init__(self, room: int) -> None:
        self.node, self.weight = ti.field(ti.i32, room), ti.field(ti.f32, room)

    @ti.func
    def gather(self, points: Template, pairs: Template, pair, weights: Template, begin):
        """The key points of a pair and their weights, from `begin` on. weights: of its four points. Returns where they
        end."""
        used = begin
        for corner in ti.static(range(4)):
            p, w = pairs.point[corner][pair], weights[corner]
            if w != 0.0:
                used = self.put_point(points, p, w, begin, used)
        return used

    @routine
    def put_point(self, points: Template, p: Int, w: Float, begin: Int, used: Int) -> Int:
        """All key points of one point. Returns how many there are."""
        out, k = used, points.blends.of[p]
        if k >= 0:
            for m in range(points.blends.start[k], points.blends.start[k + 1]):
                out = self.put(begin, out, points.blends.node[m], w * points.blends.weight[m])
        else:
            out = self.put(begin, out, p, w)
        return out

    @ti.func
    def put(self, begin, used, p, w):
        """One key point more, or more of one. Returns how many there are."""
        out, found = used, -1
        for m in range(begin, used):
            if self.node[m] == p:
                found = m
        if found >= 0:
            self.weight[found] = self.weight[found] + w
        else:
            self.node[used], self.weight[used] = p, w
            out = used + 1
        return out

    @ti.func
    def yields(self, points: Template, begin, end):
        """Σ w²/m of key points, and the largest 1/m of them [1/kg]."""
        out, most = 0.0, 0.0
        for m in range(begin, end):
            out += self.weight[m] ** 2 * points.inverse_mass[self.node[m]]
            most = ti.max(most, points.inverse_mass[self.node[m]])
        return out, most


@ti.data_oriented
class Blended(Nodes):
    """start: of each contact, in the lists of nodes. point: [corner], as in its pair. normal, rubbed: [axis]. kept,
    share, pushed, holds, anchor: as of `Contacts`. overflow: contacts without room."""

    count: Any
    start: Any

    def __init__(self, blends: int) -> None:
        self.room = ROOM * blends

        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, self.room) for _ in range(count)]

        self.start, self.point = ti.field(ti.i32, self.room + 1), [ti.field(ti.i32, self.room) for _ in range(4)]
        Nodes.__init__(self, NODES * self.room)
        self.normal, self.rubbed, self.anchor = fields(3), fields(3), fields(3)
        self.holds = ti.field(ti.i32, self.room)
        self.kept, self.share, self.pushed = fields(3)
        self.count, self.overflow = ti.field(ti.i32, ()), ti.field(ti.i32, ())

    @ti.func
    def part(self, points: Template, pairs: Template, pair, weights: Template, n: Template, apart):
        """Moves the key points of a near pair so that its sides, where they are nearest, are so far apart along n, and
        do not approach. Both sides of a seam are blends of the same key points: one side after the other would take
        them back and forth."""
        begin = self.start[self.count[None]]
        end = begin
        if begin < (NODES - 1) * self.room:
            end = self.gather(points, pairs, pair, weights, begin)
        yields, most = self.yields(points, begin, end)
        gap, rate = apart, 0.0
        for m in range(begin, end):
            for axis in ti.static(range(3)):
                gap -= self.weight[m] * n[axis] * points.position[axis][self.node[m]]
                rate -= self.weight[m] * n[axis] * points.step[axis][self.node[m]]
        scale = ti.select(most > 0.0, 1.0 / ti.max(yields, WEAK * most + 1e-20), 0.0)
        for m in range(begin, end):
            q = self.node[m]
            share = scale * self.weight[m] * points.inverse_mass[q]
            for axis in ti.static(range(3)):
                x, s = ti.static(points.position[axis], points.step[axis])
                x[q] = x[q] + share * ti.max(gap, 0.0) * n[axis]
                s[q] = s[q] + share * ti.max(rate, 0.0) * n[axis]
        for corner in ti.static(range(4)):
            k = points.blends.of[pairs.point[corner][pair]]
            if k >= 0:
                points.blends.refresh_one(points, k)

    @ti.func
    def add(self, points: Template, pairs: Template, before: Template, pair, weights, normal, kept):
        """A near pair as a contact. weights: of its four points. before: what those of the last interval pushed."""
        c = self.count[None]
        begin = self.start[c]
        if c < self.room and begin < (NODES - 1) * self.room:
            used = self.gather(points, pairs, pair, weights, begin)
            yields, most = self.yields(points, begin, used)
            if yields > WEAK * most:
                for axis in ti.static(range(3)):
                    self.normal[axis][c] = normal[axis]
                self.kept[c] = ti.select(yields > FIRM * most, kept, ti.min(kept, TOUCHING * pairs.least[pair]))
                self.share[c] = 1.0 / yields
                self.start[c + 1] = used
                before.recall(points, self, pairs, pair, c)
                self.count[None] = c + 1
        else:
            self.overflow[None] = self.overflow[None] + 1

    @ti.func
    def place(self, points: Template, c):
        """Σ w x of a contact [m]."""
        out = ti.Vector([0.0, 0.0, 0.0])
        for m in range(self.start[c], self.start[c + 1]):
            p, w = self.node[m], self.weight[m]
            out += w * ti.Vector([points.position[axis][p] for axis in ti.static(range(3))])
        return out

    @routine
    def warm(self, points: Template, part: Float):
        """See `Contacts.warm`."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        for c in range(self.count[None]):
            if self.pushed[c] > 0.0:
                self.pushed[c] = part * self.pushed[c]
                for axis in ti.static(range(3)):
                    self.rubbed[axis][c] = part * self.rubbed[axis][c]
                    change = self.share[c] * (self.pushed[c] * self.normal[axis][c] + self.rubbed[axis][c])
                    for m in range(self.start[c], self.start[c + 1]):
                        p = self.node[m]
                        move = inverse[p] * self.weight[m] * change
                        s[axis][p] = s[axis][p] + move
                        x[axis][p] = x[axis][p] + move

    @routine
    def respond(self, points: Template, friction: Float, mended: Float):
        """Every contact once; see `Contacts.part`."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        for c in range(self.count[None]):
            n = ti.Vector([self.normal[0][c], self.normal[1][c], self.normal[2][c]])
            apart, step, was = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), self.pushed[c]
            for m in range(self.start[c], self.start[c + 1]):
                p, w = self.node[m], self.weight[m]
                for axis in ti.static(range(3)):
                    apart[axis] += w * x[axis][p]
                    step[axis] += w * s[axis][p]
            gap = n.dot(apart) - self.kept[c]
            if gap < 0.0 or was > 0.0:
                change = answer(self, c, apart, step, n, friction, 1.0)
                move = change + mended * self.share[c] * ti.max(-gap, 0.0) * n
                for m in range(self.start[c], self.start[c + 1]):
                    p = self.node[m]
                    share = inverse[p] * self.weight[m]
                    for axis in ti.static(range(3)):
                        s[axis][p] = s[axis][p] + share * change[axis]
                        x[axis][p] = x[axis][p] + share * move[axis]
