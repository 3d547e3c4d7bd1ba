"""What keeps near pairs apart in each substep, as parallel loops (`layers/contacts.py` has the law).

On a CPU contacts are gone through one after the other, each after what the last has moved. Here all answer at once to
where key points are, and then each key point sums what its contacts ask, in their order. Several that push one key
point would push it too far together: so each sees it as light as if they had shared its mass (mass splitting; Tonge,
Benevolenski and Voroshilov 2012): what it asks is taken off by the share

    θ = Σ w²/m / Σ w² n/m,      n: contacts of a key point that hold or touch.

Momentum is kept as before, and as pushes are sums that begin with those of the last substep it comes to the same.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x3, Template
from taichi_cloth.layer_loops.pair_loops import PairLoops, nearest_of, parting_of, place_of
from taichi_cloth.layer_loops.places import Lists, Places, turns
from taichi_cloth.layers.blended import FIRM, TOUCHING, WEAK, Nodes, answer, slid
from taichi_cloth.layers.blended import NODES as OF_BLENDS
from taichi_cloth.layers.blended import ROOM as BLEND_ROOM
from taichi_cloth.layers.contacts import GROWTH, PUSHED, ROOM, RUBBED, SAVED, SLID, THERE
from taichi_cloth.layers.near_pairs import NEAR_SEAMS
from taichi_cloth.layers.nearest import EDGES, FACES, weights_of
from taichi_cloth.layers.tree import NONE
from taichi_cloth.loops.frame_loops import MOST_ITERATIONS

__all__ = ["ContactLoops"]

CORNERS = 4


@ti.data_oriented
class ContactLoops:
    """pairs: near pairs. Of each of them share: [2], where they are nearest, and kept: what a contact keeps it apart by
    [m], −1 of those that are none. before: lists, by their first key points, of what contacts pushed in the last
    interval; remembered: how many, stays: which of them held. nodes: what contacts consist of, those of one up to
    `ends`: of sheets its four corners, of garments `lists` says from where; owner: the contact of each of these, −1 of
    none. entries: of each key point, where in `nodes` it is. Of each contact gap [m], active: whether it answers,
    change, move: [axis], what it changes steps and positions by, over weight and 1/m; slot: its near pair. held:
    contacts of a key point that answer. sewn: of a garment, in which points of near pairs are blends of key points."""

    def __init__(self, pairs: PairLoops, *, sewn: bool) -> None:
        self.points, self.pairs, self.near = pairs.points, pairs.points.near.pairs, pairs.near
        self.contacts, self.many, self.count, self.row = pairs.points.contacts, pairs.many, pairs.count, pairs.row
        size, blends = self.count, self.points.blends.at.shape[0] if sewn else 0
        room = min(self.contacts.room, ROOM * self.count + BLEND_ROOM * blends, MOST_ITERATIONS)
        self.sewn, self.room, slots = sewn, room, sum(self.pairs.rooms)
        self.share, self.kept = [ti.field(ti.f32, slots) for _ in range(2)], ti.field(ti.f32, slots)
        self.seen = ti.field(ti.i32, ())
        self.places: Any = Places(slots, self.seen)
        self.before: Any = Lists(self.points.inverse_mass.shape[0] if sewn else size, room)
        self.remembered, self.stays = ti.field(ti.i32, ()), ti.field(ti.i32, self.before.room)
        self.listed = min(CORNERS * room + OF_BLENDS * BLEND_ROOM * blends, MOST_ITERATIONS)
        self.nodes: Any = Nodes(self.listed)
        self.lists: Any = Places(room, self.contacts.count) if sewn else None
        self.ends: Any = ti.field(ti.i32, room)  # its numbers are bounds of loops
        self.slot = ti.field(ti.i32, room)
        self.owner = ti.field(ti.i32, self.listed if sewn else 1)
        self.entries: Any = Lists(size, self.listed)
        self.gap, self.active = ti.field(ti.f32, room), ti.field(ti.i32, room)
        self.change, self.move = ([ti.field(ti.f32, room) for _ in range(3)] for _ in range(2))
        self.held = ti.field(ti.f32, size)
        self.filled: Any = Places(room, self.contacts.count)

    @ti.func
    def next(self, ahead, first):
        """Loops: those of an interval of so many substeps. first: 1 where the pushes before are those that the state
        remembers."""
        self.remember(first)
        self.meet(ahead)
        self.places.sum_up()
        for t in range(self.many):
            if t == 0:
                self.end()
            for turn in range(turns(self.seen[None], t, self.many)):
                slot = t + turn * self.many
                if self.kept[slot] >= 0.0 and self.places.of[slot] < self.room:
                    self.add(slot, self.places.of[slot])
        if ti.static(self.sewn):
            self.lists.sum_up()
        for c in range(self.room):
            if c < self.contacts.count[None]:
                self.gather(c)
        self.entries.clear()
        for e in range(self.listed):
            if self.is_listed(e):
                self.entries.count(self.nodes.node[e])
        self.entries.places.sum_up()
        for e in range(self.listed):
            if self.is_listed(e):
                self.entries.put(self.nodes.node[e], e)
        self.entries.sort()

    @ti.func
    def first(self, c):
        """Where the key points of contact c begin in `nodes`."""
        out = CORNERS * c
        if ti.static(self.sewn):
            out = ti.min(self.lists.of[c], self.listed)
        return out

    @ti.func
    def of(self, e):
        """The contact that number e of `nodes` is of."""
        out = e // CORNERS
        if ti.static(self.sewn):
            out = self.owner[e]
        return out

    @ti.func
    def is_listed(self, e):
        """Whether number e of `nodes` is a key point of a contact."""
        out = False
        if ti.static(self.sewn):
            out = e < self.lists.total[None]
            if out:
                out = self.owner[e] >= 0
        else:
            out = e < CORNERS * self.contacts.count[None]
            if out:
                out = e < self.ends[e // CORNERS]
        return out

    @ti.func
    def gather(self, c):
        """What contact c consists of, and its share; as `Blended.add` has them."""
        pair, begin, room, blends = self.pair_of(self.slot[c]), self.first(c), 0, 0
        weights = ti.Vector([self.contacts.weight[corner][c] for corner in ti.static(range(CORNERS))])
        for corner in ti.static(range(CORNERS)):
            room += self.size_of(self.contacts.point[corner][c])
            blends += ti.select(self.points.blends.of[self.contacts.point[corner][c]] >= 0, 1, 0)
        end = begin
        if begin + room <= self.listed:
            end = self.nodes.gather(self.points, self.pairs, pair, weights, begin)
        else:
            self.contacts.overflow[None] = 1
        yields, most = self.nodes.yields(self.points, begin, end)
        if ti.static(self.sewn):
            for e in range(begin, ti.min(begin + room, self.listed)):
                self.owner[e] = ti.select(e < end, c, -1)
            if blends > 0:
                if yields <= WEAK * most:
                    self.contacts.kept[c], self.contacts.pushed[c], self.contacts.holds[c] = -NONE, 0.0, 0
                elif yields <= FIRM * most:
                    self.contacts.kept[c] = ti.min(self.contacts.kept[c], TOUCHING * self.pairs.least[pair])
        self.ends[c], self.contacts.share[c] = end, ti.select(yields > 0.0, 1.0 / ti.max(yields, 1e-20), 0.0)

    @ti.func
    def size_of(self, p):
        """Of how many key points element p is one, or a blend."""
        k = self.points.blends.of[p]
        out = 1
        if k >= 0:
            out = self.points.blends.start[k + 1] - self.points.blends.start[k]
        return out

    @ti.func
    def end(self):
        total = self.places.total[None]
        self.contacts.count[None] = ti.min(total, self.room)
        self.contacts.most[None] = ti.max(self.contacts.most[None], total)
        self.contacts.overflow[None] = self.contacts.overflow[None] + ti.max(total - self.room, 0)

    @ti.func
    def remember(self, first):
        """Loops: what contacts pushed, in lists by their first points, as `Pushes.recall` reads them."""
        before = self.contacts.before
        self.before.clear()
        for c in range(self.room):
            if c == 0 and first == 0:
                self.remembered[None] = self.contacts.count[None]
            if c < ti.select(first == 0, self.contacts.count[None], self.remembered[None]):
                if first == 0:
                    before.put(self.points, self.contacts, c, c)
                    self.stays[c] = self.contacts.holds[c]
                if self.stays[c] != 0:
                    self.before.count(before.point[0][c])
        self.before.places.sum_up()
        for c in range(self.room):
            if c < self.remembered[None] and self.stays[c] != 0:
                self.before.put(before.point[0][c], c)
        self.before.sort()
        for p in range(self.count):
            after = 0
            for back in range(self.before.size[p]):
                k = self.before.entry[self.before.end(p) - 1 - back]
                before.next[k] = after
                after = k + 1
            before.first[p] = after

    @ti.func
    def pair_of(self, slot):
        """The pair that is number `slot` of those of both kinds."""
        faces = self.pairs.count[FACES]
        return ti.select(slot < faces, slot, self.pairs.first(EDGES) + slot - faces)

    @ti.func
    def kind_of(self, slot):
        return ti.select(slot < self.pairs.count[FACES], FACES, EDGES)

    @ti.func
    def total(self):
        return self.pairs.count[FACES] + self.pairs.count[EDGES]

    @ti.func
    def meet(self, ahead):
        """A loop: new directions of what may touch within `ahead` substeps, and which of it do."""
        for t in range(self.many):
            if t == 0:
                self.seen[None] = self.total()
            for turn in range(turns(self.total(), t, self.many)):
                slot = t + turn * self.many
                self.kept[slot] = -1.0
                kind, pair = self.kind_of(slot), self.pair_of(slot)
                if self.may_touch(kind, pair, ahead):
                    self.touch(slot, kind, pair, ahead)
                self.places.of[slot] = ti.select(self.kept[slot] >= 0.0, 1, 0)

    @ti.func
    def along(self, pair):
        """The direction of a pair."""
        return ti.Vector([self.pairs.normal[axis][pair] for axis in ti.static(range(3))])

    @ti.func
    def step_of(self, p):
        return ti.Vector([self.points.step[axis][p] for axis in ti.static(range(3))])

    @ti.func
    def may_touch(self, kind, pair, ahead):
        """As `Contacts.wake`."""
        n = self.along(pair)
        low, slow, high, fast = 1e9, 1e9, -1e9, -1e9
        for corner in ti.static(range(CORNERS)):
            p = self.pairs.point[corner][pair]
            here, step = n.dot(place_of(self.points, p)), n.dot(self.step_of(p))
            first = corner < kind
            low, slow = ti.select(first, ti.min(low, here), low), ti.select(first, ti.min(slow, step), slow)
            high, fast = ti.select(first, high, ti.max(high, here)), ti.select(first, fast, ti.max(fast, step))
        self.pairs.apart[pair] = low - high
        room = low - high - GROWTH * ahead * ti.max(fast - slow, 0.0) - self.pairs.kept[pair]
        return room < self.contacts.margin[None]

    @ti.func
    def touch(self, slot, kind, pair, ahead):
        """As `Contacts.meet`."""
        at = ti.Vector([self.pairs.point[corner][pair] for corner in ti.static(range(CORNERS))])
        i, j = place_of(self.points, at[0]), place_of(self.points, at[1])
        k, m = place_of(self.points, at[2]), place_of(self.points, at[3])
        found = nearest_of(kind, i, j, k, m)
        n, way = parting_of(kind, i, j, k, m, found), ti.Vector([found[2], found[3], found[4]])
        # Of slivers it may be a way that does not part them: then the one that does stays, and they do not answer.
        if n[3] > 0.5 * ti.sqrt(way.norm_sqr() + 1e-20):
            distance, rate, sewn, yields = 0.0, 0.0, 0.0, 0.0
            weights = weights_of(kind, found[0], found[1])
            for axis in ti.static(range(3)):
                self.pairs.normal[axis][pair] = n[axis]
                distance += n[axis] * way[axis]
            for corner in ti.static(range(CORNERS)):
                p, w = at[corner], weights[corner]
                sewn += ti.abs(w) * self.points.pieces.seam[p]
                rate += w * self.along(pair).dot(self.step_of(p))
                yields += w * w * self.points.inverse_mass[p]
            self.pairs.apart[pair] = distance
            tent = ti.select(kind == FACES, 1.0, 0.5) * self.near.tent(sewn)
            least = ti.max(tent, ti.max(ti.min(self.pairs.cap[pair], 0.5 * sewn), NEAR_SEAMS))
            kept = ti.min(self.pairs.kept[pair], least)
            room = distance - self.contacts.margin[None] - GROWTH * ahead * ti.max(-rate, 0.0)
            if room < kept and found[5] > 0.0 and yields > 0.0:
                self.kept[slot], self.share[0][slot], self.share[1][slot] = kept, found[0], found[1]

    @ti.func
    def add(self, slot, c):
        """A near pair as contact c, which begins with what that pushed."""
        pair, weights = self.pair_of(slot), weights_of(self.kind_of(slot), self.share[0][slot], self.share[1][slot])
        self.slot[c], size = slot, 0
        for corner in ti.static(range(CORNERS)):
            self.contacts.weight[corner][c] = weights[corner]
            size += self.size_of(self.pairs.point[corner][pair])
        if ti.static(self.sewn):
            self.lists.of[c] = size
        for axis in ti.static(range(3)):
            self.contacts.normal[axis][c] = self.pairs.normal[axis][pair]
        self.contacts.kept[c] = self.kept[slot]
        self.contacts.before.recall(self.points, self.contacts, self.pairs, pair, c)

    @ti.func
    def warm(self, points: Template):
        """A loop: what was pushed and rubbed in the last substep acts again. points: of the solver."""
        for p in range(self.count):
            if self.entries.size[p] > 0:
                way = ti.Vector([0.0, 0.0, 0.0])
                for e in range(self.entries.first(p), self.entries.end(p)):
                    c = self.of(self.entries.entry[e])
                    if self.contacts.pushed[c] > 0.0:
                        share = self.contacts.share[c] * self.nodes.weight[self.entries.entry[e]]
                        for axis in ti.static(range(3)):
                            push = self.contacts.pushed[c] * self.contacts.normal[axis][c]
                            way[axis] += share * (push + self.contacts.rubbed[axis][c])
                for axis in ti.static(range(3)):
                    move = points.inverse_mass[p] * way[axis]
                    points.step[axis][p] = points.step[axis][p] + move
                    points.position[axis][p] = points.position[axis][p] + move

    @ti.func
    def respond(self, points: Template, mended: Template):
        """Loops: every contact once; see `Contacts.respond`."""
        for t in range(self.many):
            for turn in range(turns(self.contacts.count[None], t, self.many)):
                c = t + turn * self.many
                gap = -self.contacts.kept[c]
                for e in range(self.first(c), self.ends[c]):
                    p, w = self.nodes.node[e], self.nodes.weight[e]
                    for axis in ti.static(range(3)):
                        gap += w * self.contacts.normal[axis][c] * points.position[axis][p]
                self.gap[c], self.active[c] = gap, ti.select(gap < 0.0 or self.contacts.pushed[c] > 0.0, 1, 0)
        for p in range(self.count):
            held = 0.0
            for e in range(self.entries.first(p), self.entries.end(p)):
                held += ti.cast(self.active[self.of(self.entries.entry[e])], ti.f32)
            self.held[p] = held
        for t in range(self.many):
            for turn in range(turns(self.contacts.count[None], t, self.many)):
                c = t + turn * self.many
                if self.active[c] != 0:
                    self.answer(points, c, mended)
        for p in range(self.count):
            if self.held[p] > 0.0:
                change, move = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
                for e in range(self.entries.first(p), self.entries.end(p)):
                    c = self.of(self.entries.entry[e])
                    if self.active[c] != 0:
                        w = self.nodes.weight[self.entries.entry[e]]
                        for axis in ti.static(range(3)):
                            change[axis] += w * self.change[axis][c]
                            move[axis] += w * self.move[axis][c]
                for axis in ti.static(range(3)):
                    points.step[axis][p] = points.step[axis][p] + points.inverse_mass[p] * change[axis]
                    points.position[axis][p] = points.position[axis][p] + points.inverse_mass[p] * move[axis]

    @ti.func
    def answer(self, points: Template, c, mended: Template):
        """What contact c asks of its key points."""
        place, step, shared = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), 0.0
        n = ti.Vector([self.contacts.normal[axis][c] for axis in ti.static(range(3))])
        for e in range(self.first(c), self.ends[c]):
            p, w = self.nodes.node[e], self.nodes.weight[e]
            shared += w * w * points.inverse_mass[p] * self.held[p]
            for axis in ti.static(range(3)):
                place[axis] += w * points.position[axis][p]
                step[axis] += w * points.step[axis][p]
        share = 1.0 / (self.contacts.share[c] * shared)
        change = answer(self.contacts, c, place, step, n, self.contacts.friction[None], share)
        depth = share * mended * self.contacts.share[c] * ti.max(-self.gap[c], 0.0)
        for axis in ti.static(range(3)):
            self.change[axis][c], self.move[axis][c] = change[axis], change[axis] + depth * n[axis]

    @ti.kernel
    def load(self, values: F32x3):
        """What a state remembers, see `Pushes.load`. values: its last planes."""
        before, grid = self.contacts.before, self.count
        for c in range(self.count):
            i, j = c // self.row, c % self.row
            if c == 0:
                self.remembered[None] = grid
            self.stays[c] = ti.select(values[THERE, i, j] > 0.0, 1, 0)
            for corner in ti.static(range(CORNERS)):
                before.point[corner][c] = ti.cast(values[corner, i, j], ti.i32)
            before.pushed[c] = values[PUSHED, i, j]
            for axis in ti.static(range(3)):
                before.rubbed[axis][c] = values[RUBBED + axis, i, j]
                before.slid[axis][c] = values[SLID + axis, i, j]

    @ti.kernel
    def save(self, values: F32x3):
        """And back, as many as there is room for, see `Pushes.save`."""
        for c in range(self.count):
            for plane in range(SAVED):
                values[plane, c // self.row, c % self.row] = 0.0
        for c in range(self.room):
            if c < self.contacts.count[None]:
                self.filled.of[c] = self.contacts.holds[c]
        self.filled.sum_up()
        for c in range(self.room):
            if c < self.contacts.count[None]:
                at = self.filled.of[c]
                if self.contacts.holds[c] != 0 and at < self.count:
                    self.save_one(values, c, at // self.row, at % self.row)

    @ti.func
    def save_one(self, values: Template, c, i, j):
        way = slid(self.contacts, self.points, c)
        for corner in ti.static(range(CORNERS)):
            values[corner, i, j] = ti.cast(self.contacts.point[corner][c], ti.f32)
        values[PUSHED, i, j], values[THERE, i, j] = self.contacts.pushed[c], 1.0
        for axis in ti.static(range(3)):
            values[RUBBED + axis, i, j], values[SLID + axis, i, j] = self.contacts.rubbed[axis][c], way[axis]
