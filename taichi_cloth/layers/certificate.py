"""The end of an interval: every near pair is on the sides of its direction that it was on at the start.

If one direction n parts two convex bodies at both ends, min n·a > max n·b, it parts them all along the straight paths
between, as n·(a − b) changes linearly. So no point has passed through a face, and no edge through an edge, and whatever
the substeps between have done, the sheet at the end of the interval meets itself no more than at its start. Pairs that
n does not part are pushed apart until it does; points that do not come apart go back to where the interval began, where
all is well.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.contacts import GROWTH
from taichi_cloth.layers.nearest import EDGES, FACES, gather
from taichi_cloth.motion.stencil import listed, load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Certificate"]

PARTED, SHARE = 2e-5, 0.25
"""How far apart a pair is at least [m], and of what it is kept apart where that is less: small pieces of cells lie near
each other."""

PUSHED, STILL_PARTED = 5.0, 0.5
"""How far those are pushed that are not, over that; and what is asked of points that went back: rounding has its
share."""

PUSHES, ROUNDS = 12, 60
"""Sweeps that push, and sweeps in all."""

PUSH, BACK = 1, 2


@ti.data_oriented
class Certificate:
    """bad: pairs that are not parted after a sweep. pushed, returned: of the frame, pairs that had to be."""

    def __init__(self) -> None:
        self.bad, self.pushed, self.returned = (ti.field(ti.i32, ()) for _ in range(3))
        self.room = ti.field(ti.f32, LANES)

    @routine
    def sweep(
        self,
        points: Template,
        paths: Template,
        contacts: Template,
        pairs: Template,
        kind: Int,
        remedy: Int,
        ahead: Float,
    ):
        """All pairs of a kind. remedy: what is done with those that are not parted. ahead: how long the next interval
        may be over how long this was: pairs that may touch in it are awake."""
        begin, awake, bad = pairs.first(kind), pairs.first_awake(kind), 0
        part = ti.select(remedy == BACK, STILL_PARTED, 1.0)
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
                    least = ti.min(PARTED, SHARE * pairs.kept[pair])
                    if pairs.apart[pair] < part * least and pairs.kept[pair] > 0.0:
                        bad += 1
                        if remedy == PUSH:
                            self.push(points, pairs, kind, pair, PUSHED * least)
                        elif remedy == BACK:
                            self.put_back(points, paths, pairs, pair)
        self.bad[None] = self.bad[None] + bad
        contacts.close(pairs, kind, awake)

    @routine
    def push(self, points: Template, pairs: Template, kind: Int, pair: Int, apart: Float):
        """To both sides of the middle between them, so far apart, and what approaches stops."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        n = ti.Vector([pairs.normal[0][pair], pairs.normal[1][pair], pairs.normal[2][pair]])
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
    def settle(self, points: Template, paths: Template, contacts: Template, near: Template, ahead: Float):
        """Sweeps until all pairs are parted, or no sweep is left: then `bad` are not."""
        rounds, bad = 0, 1
        while bad > 0 and rounds < ROUNDS:
            remedy = ti.select(rounds < PUSHES, PUSH, BACK)
            self.bad[None] = 0
            for kind in range(FACES, EDGES + 1):
                self.sweep(points, paths, contacts, near.pairs, kind, remedy, ahead)
            bad = self.bad[None]
            if bad > 0:
                points.blends.refresh(points)
            if rounds == 0:
                self.pushed[None] = self.pushed[None] + bad
            rounds += 1
