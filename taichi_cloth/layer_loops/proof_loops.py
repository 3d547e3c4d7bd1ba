"""The proof at the end of an interval as parallel loops (`layers/certificate.py` has what is proven, and how).

All near pairs are looked at, and those that their directions no longer part are followed along their ways, all at once.
What is not parted even so is pushed apart by one thread, in the order of the list: mostly there is none.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.layer_loops.contact_loops import CORNERS, ContactLoops
from taichi_cloth.layer_loops.pair_loops import nearest_of, parting_of, place_of
from taichi_cloth.layer_loops.places import turns
from taichi_cloth.layers.certificate import BACK, DEEP, LET_OFF, PUSH, PUSHED, RESERVE, STEPS, STILL_PARTED

__all__ = ["ProofLoops"]

ROOM = 8192
"""Pairs that are followed."""


@ti.data_oriented
class ProofLoops:
    """found: 1 of pairs that are to be followed; listed: numbers of those; count: how many. Of each of these parted:
    whether it is; end: how far apart at the end [m]; way: [axis], share: [2]: the last direction, and where it is
    nearest along both sides."""

    def __init__(self, contacts: ContactLoops) -> None:
        self.contacts, self.points, self.pairs = contacts, contacts.points, contacts.pairs
        self.certificate, self.many = contacts.points.certificate, contacts.many
        self.listed, self.parted = (ti.field(ti.i32, ROOM) for _ in range(2))
        self.seen, self.places = contacts.seen, contacts.places
        self.found = ti.field(ti.i32, contacts.places.room)
        self.count, self.end = ti.field(ti.i32, ()), ti.field(ti.f32, ROOM)
        self.way, self.share = ([ti.field(ti.f32, ROOM) for _ in range(n)] for n in (3, 2))

    @ti.func
    def look(self, remedy):
        """Loops: which pairs are not parted, after what `remedy` has done; into `certificate.bad` and `deep`."""
        for t in range(self.many):
            if t == 0:
                self.seen[None] = self.contacts.total()
            for turn in range(turns(self.contacts.total(), t, self.many)):
                slot = t + turn * self.many
                pair = self.contacts.pair_of(slot)
                apart = self.apart(self.contacts.kind_of(slot), pair)
                self.pairs.apart[pair] = apart
                found = self.pairs.kept[pair] > 0.0 and apart < self.least(pair, remedy)
                self.found[slot] = ti.select(found, 1, 0)
                self.places.of[slot] = self.found[slot]
        self.places.sum_up()
        for t in range(self.many):
            if t == 0:
                self.count[None] = self.places.total[None]
            for turn in range(turns(self.contacts.total(), t, self.many)):
                slot = t + turn * self.many
                if self.found[slot] != 0 and self.places.of[slot] < ROOM:
                    self.listed[self.places.of[slot]] = slot
        for k in range(ROOM):
            if k < self.count[None]:
                self.follow(k, self.least(self.pair(k), remedy))
        for _ in range(1):
            bad, deep = ti.max(self.count[None] - ROOM, 0), 0
            most = DEEP * ti.min(self.points.near.spacing[0], self.points.near.spacing[1])
            for k in range(ti.min(self.count[None], ROOM)):
                bad += 1 - self.parted[k]
                deep += ti.select(self.parted[k] == 0 and self.end[k] < -most, 1, 0)
            self.certificate.bad[None], self.certificate.deep[None] = bad, deep

    @ti.func
    def least(self, pair, remedy):
        """How far apart a pair is to be [m]."""
        return ti.select(remedy >= BACK, STILL_PARTED, 1.0) * self.pairs.least[pair]

    @ti.func
    def pair(self, k):
        """That is followed as number k."""
        return self.contacts.pair_of(self.listed[k])

    @ti.func
    def apart(self, kind, pair):
        """How far it is, along its direction [m]."""
        return self.between(kind, self.contacts.along(pair), self.places_of(pair))

    @ti.func
    def places_of(self, pair):
        """Of its four points, a row each [m]."""
        out = ti.Matrix.zero(ti.f32, CORNERS, 3)
        for corner in ti.static(range(CORNERS)):
            one = place_of(self.points, self.pairs.point[corner][pair])
            for axis in ti.static(range(3)):
                out[corner, axis] = one[axis]
        return out

    @ti.func
    def follow(self, k, least):
        """As `Certificate.follow`."""
        pair, kind = self.pair(k), self.contacts.kind_of(self.listed[k])
        start, there = ti.Matrix.zero(ti.f32, CORNERS, 3), self.places_of(pair)
        for corner in ti.static(range(CORNERS)):
            one = self.points.blends.at_start(self.points, self.points.paths, self.pairs.point[corner][pair])
            for axis in ti.static(range(3)):
                start[corner, axis] = one[axis]
        time, out, step, last, way = 0.0, 0, 0, self.pairs.apart[pair], self.contacts.along(pair)
        s, u = 0.0, 0.0
        while step < STEPS:
            here = start + time * (there - start)
            one, two = self.row_of(here, 0), self.row_of(here, 1)
            three, four = self.row_of(here, 2), self.row_of(here, 3)
            found = nearest_of(kind, one, two, three, four)
            n = parting_of(kind, one, two, three, four, found)
            now, end = self.between(kind, n, here), self.between(kind, n, there)
            step += 1
            if now > 0.0 or step == 1:
                s, u = found[0], found[1]
            if now > 0.0:
                last, way = end, ti.Vector([n[0], n[1], n[2]])
                out = ti.select(end >= least, 1, 0)
            if out == 1 or now < 0.5 * least:
                step = STEPS
            else:
                time += (1.0 - time) * (1.0 - RESERVE) * now / ti.max(now - end, 1e-9)
        self.parted[k], self.end[k], self.share[0][k], self.share[1][k] = out, last, s, u
        for axis in ti.static(range(3)):
            self.way[axis][k] = way[axis]

    @ti.func
    def row_of(self, places: Template, k: Template):
        return ti.Vector([places[k, 0], places[k, 1], places[k, 2]])

    @ti.func
    def between(self, kind, n, place):
        """How far the first `kind` of four places are beyond the others along n."""
        low, high = 1e9, -1e9
        for corner in ti.static(range(CORNERS)):
            along = n[0] * place[corner, 0] + n[1] * place[corner, 1] + n[2] * place[corner, 2]
            low = ti.select(corner < kind, ti.min(low, along), low)
            high = ti.select(corner < kind, high, ti.max(high, along))
        return low - high

    @ti.func
    def mend(self, remedy):
        """A loop of one: what was not parted, one after the other, by a remedy."""
        for _ in range(1):
            for k in range(ti.min(self.count[None], ROOM)):
                if self.parted[k] == 0:
                    self.mend_one(k, remedy)

    @ti.func
    def mend_one(self, k, remedy):
        pair, kind = self.pair(k), self.contacts.kind_of(self.listed[k])
        if remedy == PUSH:
            for side in ti.static(range(2)):
                self.certificate.share[side] = self.share[side][k]
            for axis in ti.static(range(3)):
                self.certificate.way[axis] = self.way[axis][k]
            apart = PUSHED * self.pairs.least[pair]
            self.certificate.push(self.points, self.points.contacts, self.pairs, kind, pair, apart)
        elif remedy == BACK:
            self.certificate.put_back(self.points, self.points.paths, self.pairs, pair)
        elif remedy == LET_OFF:
            self.points.near.let_off(pair)

    @ti.func
    def turn(self):
        """A loop: the directions of what was followed are those that it has now."""
        for k in range(ROOM):
            if k < self.count[None] and self.parted[k] != 0:
                for axis in ti.static(range(3)):
                    self.pairs.normal[axis][self.pair(k)] = self.way[axis][k]
