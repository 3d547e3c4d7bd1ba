"""Friction that holds a place and not only a speed: what a fixed shape keeps of key points that do not slide on it.

Coulomb's friction takes the step of what lies still. What moves its position alone, as other cloth does that mends its
depth along a slanting direction, it would let creep by some nanometres a substep: millimetres in minutes. So what does
not slide goes back to where it was as the frame began, as far as its step has not spent the friction.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.motion.stencil import BALL, FLOOR, load, store

__all__ = ["Grip"]

SPENT = 1e-3
"""Share of the friction that must be left: what slides has spent it all, but for rounding."""


@ti.data_oriented
class Grip:
    """place: [shape][axis], where key points slid last on a shape, or were as the frame began [m]."""

    def __init__(self, size: int) -> None:
        self.place = [[ti.field(ti.f32, size) for _ in range(3)] for _ in (BALL, FLOOR)]

    @ti.func
    def begin(self, position: Template, p, done):
        """Before substep `done`, where kernels begin: at the first one, places anew."""
        if done == 0:
            for place in ti.static(self.place):
                for axis in ti.static(range(3)):
                    store(place[axis], p, load(position[axis], p))

    @ti.func
    def back(self, shape: Template, p, n: Template, most, taken: Template, at: Template):
        """How far the lanes at p, which are at `at`, go back across n [m]. most: what friction can take of a step in
        this substep; taken: what it has [m]."""
        place = ti.static(self.place[shape])
        x, y, z = load(place[0], p) - at[0], load(place[1], p) - at[1], load(place[2], p) - at[2]
        along = x * n[0] + y * n[1] + z * n[2]
        x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
        spare = most - ti.sqrt(taken[0] * taken[0] + taken[1] * taken[1] + taken[2] * taken[2])
        still = spare >= SPENT * most  # what slides has spent it all; what is off for a moment has none
        share = ti.select(still, ti.min(spare / ti.sqrt(x * x + y * y + z * z + 1e-30), 1.0), 0.0)
        for axis in ti.static(range(3)):
            store(place[axis], p, ti.select(still, load(place[axis], p), at[axis]))
        return share * x, share * y, share * z
