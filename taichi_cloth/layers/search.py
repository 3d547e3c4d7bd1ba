"""Which cells of cloth may come near each other: down the tree, pair by pair.

A pair of nodes is done with where the two stay apart until the horizon, or where both are part of one patch that cannot
meet itself (`patches.py`). Either way it is noted how much they may leave their paths before that has to be looked at
again. What is left on the lowest level are pairs of cells.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.patches import slack_of
from taichi_cloth.layers.tree import LEVELS, WARP, WEFT

__all__ = ["Search"]

ROOM = 24
"""Pairs, for each key point."""

COLUMNS = 1 << 12
"""More than a padded grid has."""


@ti.data_oriented
class Search:
    """one, other: [list, pair], row × COLUMNS + column of two nodes. count: [list]. least: [level], slack
    that a patch has to have. overflow: pairs without room."""

    count: Any

    def __init__(self, size: int) -> None:
        self.room = ROOM * size
        self.one, self.other = (ti.field(ti.i32, (2, self.room)) for _ in range(2))
        self.least = ti.field(ti.f32, LEVELS)
        self.count, self.overflow = ti.field(ti.i32, 2), ti.field(ti.i32, ())

    @ti.func
    def apart(self, tree: Template, a, b, reach):
        """Whether two nodes stay further apart than `reach` until the horizon, as far as boxes tell."""
        gap = -1e9
        for axis in ti.static(range(3)):
            low, high, slow, fast = ti.static(tree.low[axis], tree.high[axis], tree.low[axis + 3], tree.high[axis + 3])
            gap = ti.max(gap, low[a] - high[b] - ti.max(fast[b] - slow[a], 0.0))
            gap = ti.max(gap, low[b] - high[a] - ti.max(fast[a] - slow[b], 0.0))
        if gap > reach:
            tree.clear[a] = ti.min(tree.clear[a], 0.5 * gap)
            tree.clear[b] = ti.min(tree.clear[b], 0.5 * gap)
        return gap > reach

    @ti.func
    def flat(self, tree: Template, level, i, j, k, m):
        """Whether nodes (i, j) and (k, m) of a level, which touch, are part of a patch that cannot meet itself."""
        p, q, r, t = tree.node(level, i, j), tree.node(level, i, m), tree.node(level, k, j), tree.node(level, k, m)
        bounds = ti.Matrix.zero(ti.f32, 4, 3)
        for family, first in ti.static(((0, WEFT), (1, WARP))):
            for axis in ti.static(range(3)):
                low, high = ti.static(tree.low[first + axis], tree.high[first + axis])
                bounds[2 * family, axis] = ti.min(ti.min(low[p], low[q]), ti.min(low[r], low[t]))
                bounds[2 * family + 1, axis] = ti.max(ti.max(high[p], high[q]), ti.max(high[r], high[t]))
        slack = slack_of(bounds[0, :], bounds[1, :], bounds[2, :], bounds[3, :])
        if slack > self.least[level]:
            for node in ti.static((p, q, r, t)):
                tree.slack[node] = ti.min(tree.slack[node], slack)
        return slack > self.least[level]

    @ti.func
    def add(self, target, found, i, j, k, m):
        if found < self.room:
            self.one[target, found] = i * COLUMNS + j
            self.other[target, found] = k * COLUMNS + m
        else:
            self.overflow[None] = self.overflow[None] + 1
        return ti.min(found + 1, self.room)

    @ti.func
    def done(self, tree: Template, level, i, j, k, m, reach):
        """Whether two nodes need no closer look."""
        out = 0
        if ti.max(ti.abs(i - k), ti.abs(j - m)) <= 1:
            out = ti.cast(self.flat(tree, level, i, j, k, m), ti.i32)
        if out == 0:
            out = ti.cast(self.apart(tree, tree.node(level, i, j), tree.node(level, k, m), reach), ti.i32)
        return out == 1

    @routine
    def begin(self, tree: Template, reach: Float):
        """All pairs of the top level."""
        level = tree.top[None]
        wide = tree.at[level, 2]
        total, found = tree.at[level, 1] * wide, 0
        for a in range(total):
            for b in range(a, total):
                if not self.done(tree, level, a // wide, a % wide, b // wide, b % wide, reach):
                    found = self.add(level & 1, found, a // wide, a % wide, b // wide, b % wide)
        self.count[level & 1] = found

    @routine
    def descend(self, tree: Template, level: Int, wide: Float, reach: Float):
        """Pairs of a level to those of the one below. wide, reach: how near two nodes are looked at, of which one is on
        this level, and both on the one below [m]."""
        source, target = level & 1, 1 - (level & 1)
        found, rows, columns = 0, tree.at[level - 1, 1], tree.at[level - 1, 2]
        for pair in range(self.count[source]):
            one, other = self.one[source, pair], self.other[source, pair]
            i, j, k, m = one // COLUMNS, one % COLUMNS, other // COLUMNS, other % COLUMNS
            same = one == other
            a, b = tree.node(level, i, j), tree.node(level, k, m)
            near = 0  # a bit for each child of the second
            for y in range(4):
                u, v = 2 * k + (y >> 1), 2 * m + (y & 1)
                there = u < rows and v < columns
                if there and same:
                    near |= 1 << y
                elif there:  # noqa: SIM102  # nested, as `and` works out all of it
                    if not self.apart(tree, tree.node(level - 1, u, v), a, wide):
                        near |= 1 << y
            for x in range(4):
                s, t = 2 * i + (x >> 1), 2 * j + (x & 1)
                if near != 0 and s < rows and t < columns:
                    far = 0
                    if not same:
                        far = ti.cast(self.apart(tree, tree.node(level - 1, s, t), b, wide), ti.i32)
                    if far == 0:
                        for y in range(4):
                            if (near >> y) & 1 == 1 and (not same or x < y or (x == y and level > 1)):
                                u, v = 2 * k + (y >> 1), 2 * m + (y & 1)
                                if not self.done(tree, level - 1, s, t, u, v, reach):
                                    found = self.add(target, found, s, t, u, v)
        self.count[target] = found
