"""Near pairs that may touch in an interval, and what keeps them apart in each substep.

A contact is four points with weights of either sign that add up to 0, a direction n and a distance: of a point and a
face as of two edges, one law. Where its gap n·Σ w x is below the distance, approach is taken off, friction holds what
slides, at most µ times the push (Coulomb), both by shares of the inverse masses, so that momentum is kept; and a share
of the depth is mended in positions alone. Where a substep goes through it several times the push and the friction are
sums over the substep, which the next turn may take back.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.blended import Blended, across, answer, slid
from taichi_cloth.layers.near_pairs import NEAR_SEAMS
from taichi_cloth.layers.nearest import EDGES, FACES, gather
from taichi_cloth.motion.stencil import listed, load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["AWAKE", "PUSHED", "RUBBED", "SAVED", "SLID", "THERE", "Contacts"]

ROOM = 12
"""Contacts, for each key point."""

AWAKE = 0.2
"""Share of the thickness beyond it up to which pairs are looked at for the next interval."""

PUSHED, RUBBED, SLID, THERE, SAVED = 4, 5, 8, 11, 12
"""Numbers of a contact that a state keeps, and which of them are what it pushed, what it rubbed, how far it has slid,
and 1 where it is one; the first are its points."""

WARM = 1.0
"""Share of what a contact pushed and rubbed in a substep that it begins the next with."""

GROWTH = 1.5
"""By which pairs may approach each other faster than they did."""


@ti.data_oriented
class Pushes:
    """What contacts pushed and rubbed in the last substep of an interval, for those of the next: their list is made
    anew, and what bears a stack would have to be found anew with it. Room for so many, of elements up to `size`.

    point: [corner]. pushed, rubbed: as of `Contacts`. slid: [axis], from where it was anchored [m]. first: of each
    element, from 1, of those whose first point it is; next: of each of these."""

    count: Any

    def __init__(self, room: int, size: int) -> None:
        self.point = [ti.field(ti.i32, room) for _ in range(4)]
        self.pushed = ti.field(ti.f32, room)
        self.rubbed, self.slid = ([ti.field(ti.f32, room) for _ in range(3)] for _ in range(2))
        self.next, self.first, self.count = ti.field(ti.i32, room), ti.field(ti.i32, size), ti.field(ti.i32, ())

    @routine
    def take(self, points: Template, contacts: Template):
        """Those of `Contacts` or `Blended` that hold."""
        at = self.count[None]
        for c in range(contacts.count[None]):
            if contacts.holds[c] != 0:
                self.put(points, contacts, c, at)
                self.list(at)
                at += 1
        self.count[None] = at

    @ti.func
    def put(self, points: Template, contacts: Template, c, at):
        """What contact c has pushed, as number `at`."""
        way = slid(contacts, points, c)
        for corner in ti.static(range(4)):
            self.point[corner][at] = contacts.point[corner][c]
        for axis in ti.static(range(3)):
            self.rubbed[axis][at], self.slid[axis][at] = contacts.rubbed[axis][c], way[axis]
        self.pushed[at] = contacts.pushed[c]

    @ti.func
    def list(self, at):
        p = self.point[0][at]
        self.next[at], self.first[p] = self.first[p], at + 1

    @ti.func
    def recall(self, points: Template, contacts: Template, pairs: Template, pair, c):
        """Contact c, of a near pair, begins with what that pushed; friction along its new direction is left out."""
        for corner in ti.static(range(4)):
            contacts.point[corner][c] = pairs.point[corner][pair]
        pushed, holds = 0.0, 0
        rubbed, way = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        at = self.first[contacts.point[0][c]]
        while at != 0:
            k, alike = at - 1, True
            for corner in ti.static(range(1, 4)):
                alike &= self.point[corner][k] == contacts.point[corner][c]
            if alike:
                n = ti.Vector([contacts.normal[axis][c] for axis in ti.static(range(3))])
                was = ti.Vector([self.rubbed[axis][k] for axis in ti.static(range(3))])
                pushed, rubbed, holds = self.pushed[k], across(was, n), 1
                way = ti.Vector([self.slid[axis][k] for axis in ti.static(range(3))])
            at = ti.select(alike, 0, self.next[k])
        contacts.pushed[c], contacts.holds[c] = pushed, holds
        place = contacts.place(points, c)
        for axis in ti.static(range(3)):
            contacts.rubbed[axis][c], contacts.anchor[axis][c] = rubbed[axis], place[axis] - way[axis]

    @ti.func
    def load(self, values: Template, first, grid):
        """After `save`, of a state."""
        for c in range(grid):
            k = first + c
            if values[k + THERE * grid] > 0.0:
                at = self.count[None]
                for corner in ti.static(range(4)):
                    self.point[corner][at] = ti.cast(values[k + corner * grid], ti.i32)
                self.pushed[at] = values[k + PUSHED * grid]
                for axis in ti.static(range(3)):
                    self.rubbed[axis][at] = values[k + (RUBBED + axis) * grid]
                    self.slid[axis][at] = values[k + (SLID + axis) * grid]
                self.list(at)
                self.count[None] = at + 1

    @ti.func
    def save(self, values: Template, first, grid):
        """Into planes of `grid` elements of a state, which begin at element `first`, as many as there is room for."""
        for c in range(grid):
            k, there = first + c, c < self.count[None]
            values[k + THERE * grid] = ti.select(there, 1.0, 0.0)
            if there:
                for corner in ti.static(range(4)):
                    values[k + corner * grid] = ti.cast(self.point[corner][c], ti.f32)
                values[k + PUSHED * grid] = self.pushed[c]
                for axis in ti.static(range(3)):
                    values[k + (RUBBED + axis) * grid] = self.rubbed[axis][c]
                    values[k + (SLID + axis) * grid] = self.slid[axis][c]

    @ti.func
    def clear(self):
        """None."""
        for k in range(self.count[None]):
            self.first[self.point[0][k]] = 0
        self.count[None] = 0


@ti.data_oriented
class Contacts:
    """point, weight: [corner]. normal: [axis]. kept: distance [m]. share: 1/Σ w²/m [kg]. pushed, rubbed: in this
    substep [m]. holds: 1 since it pushed first; anchor: [axis], Σ w x there, or where that has been dragged to [m].
    blended: those of points that are blends. before: what those of the last interval pushed. overflow: contacts without
    room. most: of the frame. turns: whether any was in this substep."""

    count: Any

    def __init__(self, size: int, blends: int) -> None:
        self.room, self.blended = ROOM * size, Blended(blends)
        self.before = Pushes(self.room + self.blended.room, size + blends)

        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, self.room + LANES) for _ in range(count)]

        self.point = [ti.field(ti.i32, self.room + LANES) for _ in range(4)]
        self.weight, self.normal, self.rubbed, self.anchor = fields(4), fields(3), fields(3), fields(3)
        self.holds = ti.field(ti.i32, self.room + LANES)
        self.kept, self.share, self.pushed = fields(3)
        self.count, self.overflow, self.most, self.turns = (ti.field(ti.i32, ()) for _ in range(4))
        self.friction, self.mend, self.margin = (ti.field(ti.f32, ()) for _ in range(3))
        self.found = [ti.field(ti.f32, LANES) for _ in range(10)]
        self.inside = ti.field(ti.i32, LANES)

    @routine
    def wake(self, points: Template, pairs: Template, kind: Int, ahead: Float):
        """Lists the pairs that may touch within `ahead` substeps, by the speeds of their points."""
        begin, awake = pairs.first(kind), pairs.first_awake(kind)
        for packet in range(pairs.packets(kind)):
            at = listed(begin + packet * LANES)
            x, y, z = load(pairs.normal[0], at), load(pairs.normal[1], at), load(pairs.normal[2], at)
            low, high = ti.Vector([1e9] * LANES), ti.Vector([-1e9] * LANES)
            slow, fast = ti.Vector([1e9] * LANES), ti.Vector([-1e9] * LANES)
            for corner in ti.static(range(4)):
                p = load(pairs.point[corner], at)
                here = x * gather(points.position[0], p)
                here += y * gather(points.position[1], p) + z * gather(points.position[2], p)
                step = x * gather(points.step[0], p) + y * gather(points.step[1], p) + z * gather(points.step[2], p)
                first = corner < kind
                low, slow = ti.select(first, ti.min(low, here), low), ti.select(first, ti.min(slow, step), slow)
                high, fast = ti.select(first, high, ti.max(high, here)), ti.select(first, fast, ti.max(fast, step))
            room = low - high - GROWTH * ahead * ti.max(fast - slow, 0.0) - load(pairs.kept, at)
            store(pairs.apart, at, low - high)
            store(self.found[1], 0, room)
            if room.min() < self.margin[None]:  # pyright: ignore[reportOptionalCall]
                for k in range(LANES):
                    if self.found[1][k] < self.margin[None]:
                        pairs.awake[awake] = at + k
                        awake += 1
        self.close(pairs, kind, awake)

    @ti.func
    def close(self, pairs: Template, kind, awake):
        """Those up to place `awake` are; whole lanes of pairs that never touch behind them."""
        pairs.woken[kind] = awake - pairs.first_awake(kind)
        for k in range(LANES):
            pairs.awake[awake + k] = pairs.first(kind) + pairs.count[kind] + k

    @routine
    def meet(self, points: Template, beside: Template, kind: Int, ahead: Float):
        """New directions of the pairs that are awake, and those that may touch within `ahead` substeps as contacts.
        They are gone through in eight runs side by side, so that contacts of one packet rarely share a point."""
        pairs, nearest = beside.pairs, beside.nearest
        made, begin, one = self.count[None], pairs.first_awake(kind), ti.Vector([1.0] * LANES)
        runs = (pairs.woken[kind] + LANES - 1) // LANES
        for run in range(runs):
            at = ti.Vector([pairs.awake[begin + k * runs + run] for k in ti.static(range(LANES))])
            i, j = gather(pairs.point[0], at), gather(pairs.point[1], at)
            k, m = gather(pairs.point[2], at), gather(pairs.point[3], at)
            nearest.take(points, i, j, k, m)
            nearest.find(kind)
            nearest.part(kind)
            s, t = load(nearest.share[0], 0), load(nearest.share[1], 0)
            on_face = kind == FACES
            w0 = ti.select(on_face, one, 1.0 - s)
            w1 = ti.select(on_face, s + t - 1.0, s)
            w2 = ti.select(on_face, -s, t - 1.0)
            # Of slivers it may be a way that does not part them: then the one that does stays, and they do not answer.
            parts = load(nearest.beyond, 0) > 0.5 * ti.sqrt(load(nearest.square, 0) + 1e-20)
            within = ti.select(parts, load(nearest.inside, 0), 0)
            x = ti.select(parts, load(nearest.normal[0], 0), gather(pairs.normal[0], at))
            y = ti.select(parts, load(nearest.normal[1], 0), gather(pairs.normal[1], at))
            z = ti.select(parts, load(nearest.normal[2], 0), gather(pairs.normal[2], at))
            distance = x * load(nearest.way[0], 0) + y * load(nearest.way[1], 0) + z * load(nearest.way[2], 0)
            distance = ti.select(parts, distance, gather(pairs.apart, at))
            rate, sewn = ti.Vector([0.0] * LANES), ti.Vector([0.0] * LANES)
            for corner, p, w in ti.static(((0, i, w0), (1, j, w1), (2, k, w2), (3, m, -t))):
                sewn += ti.abs(w) * gather(points.pieces.seam, p)
                step = x * gather(points.step[0], p) + y * gather(points.step[1], p) + z * gather(points.step[2], p)
                rate += w * step
                store(self.found[5 + corner], 0, w)
            store(self.found[0], 0, distance)
            store(self.found[1], 0, distance - self.margin[None] - GROWTH * ahead * ti.max(-rate, 0.0))
            for axis, v in ti.static(((2, x), (3, y), (4, z))):
                store(self.found[axis], 0, v)
            store(self.inside, 0, within)
            tent, cap = ti.select(on_face, 1.0, 0.5) * beside.tent(sewn), gather(pairs.cap, at)
            least = ti.max(tent, ti.max(ti.min(cap, 0.5 * sewn), NEAR_SEAMS))
            store(self.found[9], 0, ti.min(gather(pairs.kept, at), least))
            for lane in range(LANES):
                pair = pairs.awake[begin + lane * runs + run]
                for axis in ti.static(range(3)):
                    pairs.normal[axis][pair] = self.found[2 + axis][lane]
                pairs.apart[pair] = self.found[0][lane]
                if self.found[1][lane] < self.found[9][lane] and self.inside[lane] == 1:
                    made = self.add_any(points, pairs, pair, lane, made)
        self.count[None] = made

    @routine
    def add_any(self, points: Template, pairs: Template, pair: Int, lane: Int, at: Int) -> Int:
        """`add`, or as one of blends."""
        out, blends = at, 0
        for corner in ti.static(range(4)):
            if points.blends.of[pairs.point[corner][pair]] >= 0:
                blends += 1
        if blends == 0:
            out = self.add(points, pairs, pair, lane, at)
        else:
            weights = ti.Vector([self.found[5 + corner][lane] for corner in ti.static(range(4))])
            normal = ti.Vector([self.found[2 + axis][lane] for axis in ti.static(range(3))])
            self.blended.add(points, pairs, self.before, pair, weights, normal, self.found[9][lane])
        return out

    @ti.func
    def add(self, points: Template, pairs: Template, pair, lane, at):
        yields = 0.0
        for corner in ti.static(range(4)):
            yields += self.found[5 + corner][lane] ** 2 * points.inverse_mass[pairs.point[corner][pair]]
        out = at
        if yields > 0.0:
            if at < self.room:
                for corner in ti.static(range(4)):
                    self.weight[corner][at] = self.found[5 + corner][lane]
                for axis in ti.static(range(3)):
                    self.normal[axis][at] = self.found[2 + axis][lane]
                self.kept[at], self.share[at] = self.found[9][lane], 1.0 / yields
                self.before.recall(points, self, pairs, pair, at)
                out = at + 1
            else:
                self.overflow[None] = self.overflow[None] + 1
        return out

    @routine
    def fill_up(self):
        """Whole lanes of contacts that never touch behind the others."""
        for k in range(LANES):
            at = self.count[None] + k
            for corner in ti.static(range(4)):
                self.point[corner][at] = corner
                self.weight[corner][at] = 0.0
            for axis in ti.static(range(3)):
                self.normal[axis][at] = 0.0
            self.kept[at], self.share[at], self.pushed[at] = -1.0, 0.0, 0.0
        self.most[None] = ti.max(self.most[None], self.count[None])

    @routine
    def next(self, points: Template, beside: Template, ahead: Float):
        """Those of the next interval, `ahead` substeps long: of what is awake. They begin with what the same pairs
        pushed at the end of the last one."""
        self.before.take(points, self)
        self.before.take(points, self.blended)
        self.clear()
        for kind in range(FACES, EDGES + 1):
            self.meet(points, beside, kind, ahead)
        self.before.clear()
        self.fill_up()

    @ti.func
    def keep(self, points: Template, values: Template, first, grid):
        """In planes of a state, until the next frame, see `Pushes.save`."""
        self.before.take(points, self)
        self.before.take(points, self.blended)
        self.before.save(values, first, grid)
        self.before.clear()

    @ti.func
    def clear(self):
        """None."""
        self.count[None] = 0
        self.blended.count[None] = 0
        self.blended.start[0] = 0

    @routine
    def warm(self, points: Template):
        """At the first turn of a substep: what was pushed and rubbed in the last one acts again, to be corrected. A
        stack would need as many turns as it has layers to find that, and walks apart for want of it."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        for c in range(self.count[None]):
            if self.pushed[c] > 0.0:
                self.pushed[c] = WARM * self.pushed[c]
                for axis in ti.static(range(3)):
                    self.rubbed[axis][c] = WARM * self.rubbed[axis][c]
                    change = self.share[c] * (self.pushed[c] * self.normal[axis][c] + self.rubbed[axis][c])
                    for corner in ti.static(range(4)):
                        p = self.point[corner][c]
                        move = inverse[p] * self.weight[corner][c] * change
                        s[axis][p] = s[axis][p] + move
                        x[axis][p] = x[axis][p] + move
        self.blended.warm(points, WARM)

    @routine
    def respond(self, points: Template, mended: Float):
        """Every contact once. mended: share of the depth."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        for group in range((self.count[None] + LANES - 1) // LANES):
            at = group * LANES
            gap = -load(self.kept, at)
            gx, gy, gz = ti.Vector([0.0] * LANES), ti.Vector([0.0] * LANES), ti.Vector([0.0] * LANES)
            for corner in ti.static(range(4)):
                p, w = load(self.point[corner], at), load(self.weight[corner], at)
                gx, gy, gz = gx + w * gather(x[0], p), gy + w * gather(x[1], p), gz + w * gather(x[2], p)
            gap += load(self.normal[0], at) * gx + load(self.normal[1], at) * gy + load(self.normal[2], at) * gz
            store(self.found[0], 0, gap)
            if ti.min(gap, -load(self.pushed, at)).min() < 0.0:  # pyright: ignore[reportOptionalCall]
                for k in range(LANES):
                    if self.found[0][k] < 0.0 or self.pushed[at + k] > 0.0:
                        self.part(x, s, inverse, at + k, self.found[0][k], mended)
        self.blended.respond(points, self.friction[None], mended)

    @ti.func
    def place(self, points: Template, c):
        """Σ w x of a contact [m]."""
        out = ti.Vector([0.0, 0.0, 0.0])
        for corner in ti.static(range(4)):
            p, w = self.point[corner][c], self.weight[corner][c]
            out += w * ti.Vector([points.position[axis][p] for axis in ti.static(range(3))])
        return out

    @ti.func
    def part(self, x: Template, s: Template, inverse: Template, c, gap, mended):
        """One contact: its push and friction of the substep anew."""
        n = ti.Vector([self.normal[0][c], self.normal[1][c], self.normal[2][c]])
        place, step = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        for corner in ti.static(range(4)):
            p, w = self.point[corner][c], self.weight[corner][c]
            place += w * ti.Vector([x[0][p], x[1][p], x[2][p]])
            step += w * ti.Vector([s[0][p], s[1][p], s[2][p]])
        change = answer(self, c, place, step, n, self.friction[None], 1.0)
        move = change + mended * self.share[c] * ti.max(-gap, 0.0) * n
        for corner in ti.static(range(4)):
            p = self.point[corner][c]
            share = inverse[p] * self.weight[corner][c]
            for axis in ti.static(range(3)):
                s[axis][p] = s[axis][p] + share * change[axis]
                x[axis][p] = x[axis][p] + share * move[axis]
