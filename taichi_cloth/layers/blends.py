"""Points of cloth that are blends of key points: corners of pieces of cells, and corners that are not simulated.

They are elements like key points, but for two things: where they are follows from key points, and what moves them moves
those, by shares of weight over mass that keep momentum: x += w/m / (Σ w²/m) d.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, I32x1, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host

__all__ = ["Blends"]

NODES = 16
"""Key points of a blend, of all of them in the mean at most."""


@ti.data_oriented
class Blends:
    """Room for so many, of elements up to `size`. of: number of the blend that an element
    is, −1: a key point. at: the element. start, node, weight: what it consists of. give: 1/Σ w²/m [kg]."""

    count: Any
    start: Any

    def __init__(self, size: int, room: int) -> None:
        self.of = ti.field(ti.i32, size)
        self.at, self.start = ti.field(ti.i32, room), ti.field(ti.i32, room + 1)
        self.node, self.weight = ti.field(ti.i32, NODES * room), ti.field(ti.f32, NODES * room)
        self.give, self.count = ti.field(ti.f32, room), ti.field(ti.i32, ())

    @ti.func
    def take(self, points: Template, count, at: I32x1, starts: I32x1, nodes: I32x1, weights: F32x1):
        """Loops, after the inverse masses of key points; those of blends follow."""
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(self.of.shape[0]):
            self.of[p] = -1
        self.count[None], self.start[0] = count, 0
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(count):
            self.at[k], self.start[k + 1] = at[k], starts[k + 1]
            self.of[at[k]] = k
            yields = 0.0
            for m in range(starts[k], starts[k + 1]):
                self.node[m], self.weight[m] = nodes[m], weights[m]
                yields += weights[m] ** 2 * points.inverse_mass[nodes[m]]
            points.inverse_mass[at[k]] = yields
            self.give[k] = ti.select(yields > 0.0, 1.0 / ti.max(yields, 1e-20), 0.0)

    @routine
    def refresh(self, points: Template):
        """Where they are, and their steps."""
        for k in range(self.count[None]):
            self.refresh_one(points, k)

    @ti.func
    def refresh_one(self, points: Template, k):
        """Blend number k."""
        x, s = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        for m in range(self.start[k], self.start[k + 1]):
            p, w = self.node[m], self.weight[m]
            for axis in ti.static(range(3)):
                x[axis] += w * points.position[axis][p]
                s[axis] += w * points.step[axis][p]
        for axis in ti.static(range(3)):
            points.position[axis][self.at[k]] = x[axis]
            points.step[axis][self.at[k]] = s[axis]

    @ti.func
    def place(self, points: Template, p):
        """Where element p is, whatever was moved since `refresh`."""
        out, k = ti.Vector([points.position[0][p], points.position[1][p], points.position[2][p]]), self.of[p]
        if k >= 0:
            out = ti.Vector([0.0, 0.0, 0.0])
            for m in range(self.start[k], self.start[k + 1]):
                for axis in ti.static(range(3)):
                    out[axis] += self.weight[m] * points.position[axis][self.node[m]]
        return out

    @ti.func
    def at_start(self, points: Template, paths: Template, p):
        """Where element p was at the start of the interval."""
        out, k = ti.Vector([0.0, 0.0, 0.0]), self.of[p]
        if k >= 0:
            for m in range(self.start[k], self.start[k + 1]):
                for axis in ti.static(range(3)):
                    out[axis] += self.weight[m] * paths.was[axis][self.node[m]]
        else:
            out = ti.Vector([paths.was[0][p], paths.was[1][p], paths.was[2][p]])
        return out

    @ti.func
    def move(self, points: Template, p, way, change):
        """Element p by a way, and its step by a change; if it is a blend by what it consists of."""
        x, s = ti.static(points.position, points.step)
        for axis in ti.static(range(3)):
            x[axis][p] = x[axis][p] + way[axis]
            s[axis][p] = s[axis][p] + change[axis]
        k = self.of[p]
        if k >= 0:
            for m in range(self.start[k], self.start[k + 1]):
                q = self.node[m]
                share = self.give[k] * self.weight[m] * points.inverse_mass[q]
                for axis in ti.static(range(3)):
                    x[axis][q] = x[axis][q] + share * way[axis]
                    s[axis][q] = s[axis][q] + share * change[axis]

    @ti.func
    def put_back(self, points: Template, place: Template, p):
        """Element p to where `place` says, at rest; if it is a blend, all that it consists of."""
        k = self.of[p]
        if k >= 0:
            for m in range(self.start[k], self.start[k + 1]):
                self.put_one_back(points, place, self.node[m])
        else:
            self.put_one_back(points, place, p)

    @ti.func
    def put_one_back(self, points: Template, place: Template, p):
        if points.inverse_mass[p] > 0.0:
            for axis in ti.static(range(3)):
                points.position[axis][p] = place[axis][p]
                points.step[axis][p] = 0.0
