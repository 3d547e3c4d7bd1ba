"""The end of an interval: every near pair is on the sides of its direction that it was on at the start.

If one direction n parts two convex bodies at both ends, min n·a > max n·b, it parts them all along the straight paths
between, as n·(a − b) changes linearly. So no point has passed through a face, and no edge through an edge, and whatever
the substeps between have done, the sheet at the end of the interval meets itself no more than at its start.

Two edges that all but touch are parted by few directions, and when they turn by as many degrees as those span, by none
all the way. So where n fails the way is gone in steps: from where they are to as far as the direction between their
nearest places parts them, and on from there with a new one (`follow`). Pairs that are not parted even so are pushed
apart along the last of these; points that do not come apart go back to where the interval began, where all is well.
What does not come apart even so is let off in the end: it may pass through, and is drawn apart (`tangles.py`).
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.contacts import GROWTH
from taichi_cloth.layers.nearest import EDGES, FACES, gather, weights_of
from taichi_cloth.motion.stencil import listed, load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Certificate"]

PUSHED, STILL_PARTED = 5.0, 0.5
"""How far those are pushed that are not, over that; and what is asked of points that went back: rounding has its
share."""

PUSHES, ROUNDS = 12, 60
"""Sweeps that push, and sweeps in all."""

LOOK, PUSH, BACK, LET_OFF = 0, 1, 2, 3

STEPS, RESERVE, ROOM = 24, 0.2, 1024
"""On the way of a pair, at most; what is left of how far it is apart at the end of one; pairs that are followed."""

DEEP = 0.005
"""Of the spacing, that a pair may have passed through and is pushed back all the same: more would draw threads long,
and an interval of several substeps is taken again."""


@ti.data_oriented
class Certificate:
    """bad, deep: pairs that are not parted after a sweep, and of these such as have passed each other by more than
    DEEP. pushed, returned, let_off: of the frame, pairs that had to be. lets: whether those are let off that nothing
    parts."""

    def __init__(self) -> None:
        self.bad, self.deep, self.pushed, self.returned = (ti.field(ti.i32, ()) for _ in range(4))
        self.let_off, self.lets = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.room, self.most = ti.field(ti.f32, LANES), ti.field(ti.f32, ())
        # Corners of a pair at the start of the interval and at its end; pairs that were followed, and the last
        # direction on the way of each.
        self.place = ti.field(ti.f32, (2, 4, 3))
        self.followed, self.last = ti.field(ti.i32, ROOM), ti.field(ti.f32, (ROOM, 3))
        self.count: Any = ti.field(ti.i32, ())
        # The last direction of that which was followed last, where along both sides, as of `Nearest`, and how far it is
        # apart along it at the end.
        self.way, self.share, self.end = ti.field(ti.f32, 3), ti.field(ti.f32, 2), ti.field(ti.f32, ())

    @routine
    def sweep(
        self,
        points: Template,
        paths: Template,
        contacts: Template,
        near: Template,
        kind: Int,
        remedy: Int,
        ahead: Float,
    ):
        """All pairs of a kind. remedy: what is done with those that are not parted. ahead: how long the next interval
        may be over how long this was: pairs that may touch in it are awake."""
        pairs = near.pairs
        begin, awake, bad, deep = pairs.first(kind), pairs.first_awake(kind), 0, 0
        part = ti.select(remedy >= BACK, STILL_PARTED, 1.0)
        for packet in range(pairs.packets(kind)):
            at = listed(begin + packet * LANES)
            x, y, z = load(pairs.normal[0], at), load(pairs.normal[1], at), load(pairs.normal[2], at)
            low, high = ti.Vector([1e9] * LANES), ti.Vector([-1e9] * LANES)
            for corner in ti.static(range(4)):
                p = load(pairs.point[corner], at)
                here = x * gather(points.position[0], p)
                here += y * gather(points.position[1], p) + z * gather(points.position[2], p)
                low = ti.select(corner < kind, ti.min(low, here), low)
                high = ti.select(corner < kind, high, ti.max(high, here))
            apart = low - high
            room = apart - GROWTH * ahead * ti.max(load(pairs.apart, at) - apart, 0.0) - load(pairs.kept, at)
            store(pairs.apart, at, apart)
            store(self.room, 0, room)
            some = ti.select(room.min() < contacts.margin[None], LANES, 0)  # pyright: ignore[reportOptionalCall]
            for k in range(some):
                if self.room[k] < contacts.margin[None]:
                    pair = at + k
                    pairs.awake[awake] = pair
                    awake += 1
                    least = pairs.least[pair]
                    alright = pairs.apart[pair] >= part * least or pairs.kept[pair] <= 0.0
                    if not alright:
                        alright = self.follow(points, paths, pairs, near.nearest, kind, pair, part * least) == 1
                    if not alright:
                        bad += 1
                        deep += ti.select(self.end[None] < -self.most[None], 1, 0)
                        if remedy == PUSH:
                            self.push(points, contacts, pairs, kind, pair, PUSHED * least)
                        elif remedy == BACK:
                            self.put_back(points, paths, pairs, pair)
                        elif remedy == LET_OFF:
                            near.let_off(pair)
        self.bad[None] = self.bad[None] + bad
        self.deep[None] = self.deep[None] + deep
        contacts.close(pairs, kind, awake)

    @routine
    def follow(
        self,
        points: Template,
        paths: Template,
        pairs: Template,
        nearest: Template,
        kind: Int,
        pair: Int,
        least: Float,
    ) -> Int:
        """Whether a pair has not met on its straight way from the start of the interval, and is at least so far apart
        at its end [m]: then it is listed, with the direction that it has there.

        How far two convex bodies are apart along one direction is concave in time. So where it is a now and b < a at
        the end, it is not below a share of a up to that share of a/(a − b) of what is left of the way.
        """
        for corner in ti.static(range(4)):
            p = pairs.point[corner][pair]
            start = points.blends.at_start(points, paths, p)
            for axis in ti.static(range(3)):
                self.place[0, corner, axis], self.place[1, corner, axis] = start[axis], points.position[axis][p]
        self.end[None] = pairs.apart[pair]
        for axis in ti.static(range(3)):
            self.way[axis] = pairs.normal[axis][pair]
        time, out, step, at = 0.0, 0, 0, self.count[None]
        while step < STEPS and at < ROOM:
            for corner in ti.static(range(4)):
                for axis in ti.static(range(3)):
                    here, there = self.place[0, corner, axis], self.place[1, corner, axis]
                    store(nearest.place[corner][axis], 0, ti.Vector([here + time * (there - here)] * LANES))
            nearest.find(kind)
            nearest.part(kind)
            now, end = 0.0, 0.0
            for when in ti.static(range(2)):
                low, high = 1e9, -1e9
                for corner in ti.static(range(4)):
                    along = 0.0
                    for axis in ti.static(range(3)):
                        here = nearest.place[corner][axis][0] if ti.static(when == 0) else self.place[1, corner, axis]
                        along += nearest.normal[axis][0] * here
                    low = ti.select(corner < kind, ti.min(low, along), low)
                    high = ti.select(corner < kind, high, ti.max(high, along))
                if ti.static(when == 0):
                    now = low - high
                else:
                    end = low - high
            step += 1
            if now > 0.0 or step == 1:
                for side in ti.static(range(2)):
                    self.share[side] = nearest.share[side][0]
            if now > 0.0:
                self.end[None] = end
                for axis in ti.static(range(3)):
                    self.way[axis] = nearest.normal[axis][0]
                out = ti.select(end >= least, 1, 0)
            if out == 1 or now < 0.5 * least:
                step = STEPS
            else:
                time += (1.0 - time) * (1.0 - RESERVE) * now / ti.max(now - end, 1e-9)
        if out == 1:
            self.followed[at], self.count[None] = pair, at + 1
            for axis in ti.static(range(3)):
                self.last[at, axis] = self.way[axis]
        return out

    @routine
    def push(self, points: Template, contacts: Template, pairs: Template, kind: Int, pair: Int, apart: Float):
        """So far apart, and what approaches stops. After `follow`."""
        blends = 0
        for corner in ti.static(range(4)):
            blends += ti.select(points.blends.of[pairs.point[corner][pair]] >= 0, 1, 0)
        if blends == 0:
            self.push_sides(points, pairs, kind, pair, apart)
        else:
            n = ti.Vector([self.way[0], self.way[1], self.way[2]])
            weights = weights_of(kind, self.share[0], self.share[1])
            contacts.blended.part(points, pairs, pair, weights, n, apart)

    @ti.func
    def push_sides(self, points: Template, pairs: Template, kind, pair, apart):
        """To both sides of the middle between them."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        n = ti.Vector([self.way[0], self.way[1], self.way[2]])
        least, most, up, down, free_up, free_down = 1e9, -1e9, 0.0, 0.0, 0.0, 0.0
        for corner in ti.static(range(4)):
            p = pairs.point[corner][pair]
            here = n[0] * x[0][p] + n[1] * x[1][p] + n[2] * x[2][p]
            step = n[0] * s[0][p] + n[1] * s[1][p] + n[2] * s[2][p]
            if corner < kind:
                least, up, free_up = ti.min(least, here), up + step / kind, free_up + inverse[p]
            else:
                most, down, free_down = ti.max(most, here), down + step / (4 - kind), free_down + inverse[p]
        middle, pace = 0.5 * (least + most), 0.5 * (up + down)
        if free_up == 0.0:  # held by pins: the other side makes room
            middle, pace = least - 0.5 * apart, up
        elif free_down == 0.0:
            middle, pace = most + 0.5 * apart, down
        for corner in ti.static(range(4)):
            p = pairs.point[corner][pair]
            side = ti.select(corner < kind, 1.0, -1.0)
            here = n[0] * x[0][p] + n[1] * x[1][p] + n[2] * x[2][p]
            step = n[0] * s[0][p] + n[1] * s[1][p] + n[2] * s[2][p]
            depth = 0.5 * apart - side * (here - middle)
            if depth > 0.0 and inverse[p] > 0.0:
                slower = ti.max(side * (pace - step), 0.0)
                points.blends.move(points, p, side * depth * n, side * slower * n)

    @routine
    def put_back(self, points: Template, paths: Template, pairs: Template, pair: Int):
        """To where the interval began, at rest."""
        for corner in ti.static(range(4)):
            points.blends.put_back(points, paths.was, pairs.point[corner][pair])
        self.returned[None] = self.returned[None] + 1

    @routine
    def settle(self, points: Template, paths: Template, contacts: Template, near: Template, ahead: Float, long: Int):
        """Sweeps until all pairs are parted, or no sweep is left: then `bad` are not, or are let off. Where after a
        long interval any have passed each other by much the first sweep leaves them as they are, and `deep` says so."""
        rounds, bad = 0, 1
        self.most[None] = DEEP * ti.min(near.spacing[0], near.spacing[1])
        while bad > 0 and rounds < ROUNDS:
            remedy = ti.select(rounds < PUSHES, PUSH, BACK)
            if rounds == 0 and long == 1:
                remedy = LOOK
            elif rounds == ROUNDS - 1 and self.lets[None] == 1:
                remedy = LET_OFF
            self.bad[None] = 0
            self.deep[None] = 0
            self.count[None] = 0
            for kind in range(FACES, EDGES + 1):
                self.sweep(points, paths, contacts, near, kind, remedy, ahead)
            bad = self.bad[None]
            if bad > 0 and remedy != LOOK:
                points.blends.refresh(points)
            if rounds == 0:
                self.pushed[None] = self.pushed[None] + bad
            if remedy != LOOK:
                self.deep[None] = 0
            elif self.deep[None] > 0:
                bad = 0
            rounds += 1
            if remedy == LET_OFF:
                self.let_off[None] = self.let_off[None] + bad
                self.bad[None] = 0
        some = ti.select(self.deep[None] == 0, self.count[None], 0)
        for k in range(some):
            for axis in ti.static(range(3)):
                near.pairs.normal[axis][self.followed[k]] = self.last[k, axis]
