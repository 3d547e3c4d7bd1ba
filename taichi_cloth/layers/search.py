"""Which cells of cloth may come near each other: down the tree, pair by pair.

A pair of nodes is done with where the two stay apart until the horizon, or where both are part of one patch that cannot
meet itself (`patches.py`). Either way it is noted how much they may leave their paths before that has to be looked at
again. What is left on the lowest level are pairs of cells.

Where only some key points get a new path, only pairs are gone through that have to do with them; what was found of all
others stays as it is. A pair of which nothing got a new path was dealt with before, itself or as part of a larger one,
and what those of its cells may leave their paths by has been kept. Unless that was as part of a patch: of one that is
none any more all pairs are gone through (`ANEW`).
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.nearest import CORNERS, gather
from taichi_cloth.layers.outline import BEYOND
from taichi_cloth.layers.paths import CELL, EAST, NORTH
from taichi_cloth.layers.tree import LEVELS, NONE
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["COLUMNS", "PLACES", "ROOM", "Search", "Sieve", "element"]

ROOM = 24
"""Pairs, for each key point."""

PLACES = 12
COLUMNS = 1 << PLACES
"""More than a padded grid has."""

ANEW = 1 << 28
"""Bit of the first node of pairs of which all within is to be gone through."""


@ti.func
def element(node, width):
    """Of the padded grid, of a cell in a list."""
    return (node >> PLACES) * width + (node & (COLUMNS - 1))


@ti.data_oriented
class Search:
    """one, other: [list, pair], row × COLUMNS + column of two nodes. count: [list]. least: [level], slack that a patch
    has to have. gap: between four nodes and four others [m]. overflow: pairs without room."""

    count: Any

    def __init__(self, size: int) -> None:
        self.room = ROOM * size
        self.one, self.other = (ti.field(ti.i32, (2, self.room)) for _ in range(2))
        self.gap = ti.field(ti.f32, 2 * LANES)
        self.least = ti.field(ti.f32, LEVELS)
        self.count, self.overflow = ti.field(ti.i32, 2), ti.field(ti.i32, ())

    @ti.func
    def apart(self, tree: Template, a, b):
        """How far nodes a and b, four each, stay apart until the horizon at least, as far as boxes tell: into `gap`, of
        each of the first with all of the others."""
        for half in ti.static(range(2)):
            gap = ti.Vector([-1e9] * LANES)
            for axis in ti.static(range(3)):
                low, high, slow, fast = ti.static(
                    tree.low[axis], tree.high[axis], tree.low[axis + 3], tree.high[axis + 3]
                )
                one = self.each(low, a, half) - self.all_of(high, b)
                one -= ti.max(self.all_of(fast, b) - self.each(slow, a, half), 0.0)
                other = self.all_of(low, b) - self.each(high, a, half)
                other -= ti.max(self.each(fast, a, half) - self.all_of(slow, b), 0.0)
                gap = ti.max(gap, ti.max(one, other))
            store(self.gap, half * LANES, gap)

    @routine
    def children_apart(self, tree: Template, level: Int, i: Int, j: Int, k: Int, m: Int):
        """The same of the children of nodes (i, j) and (k, m) of the level above, which are on this one."""
        self.apart(tree, self.children(tree, level, i, j), self.children(tree, level, k, m))

    @routine
    def strangers(
        self, tree: Template, level: Int, one: Int, other: Int, anew: Int, reach: Float, target: Int, begin: Int
    ) -> Int:
        """All sixteen pairs of the children, on a level, of two nodes that do not touch, which are part of no patch:
        what `done` and `clear` say of each. one, other: of the two, as in lists. begin: how many pairs there are in
        list `target`; returns how many there are then."""
        i, j, k, m = one // COLUMNS, one % COLUMNS, other // COLUMNS, other % COLUMNS
        a, b = self.children(tree, level, i, j), self.children(tree, level, k, m)
        self.apart(tree, a, b)
        found, far = begin, ti.Vector([NONE] * 4)
        for half in ti.static(range(2)):
            look = self.each(tree.stale, a, half) | self.all_of(tree.stale, b) | anew
            gap = ti.select(look != 0, load(self.gap, half * LANES), NONE)
            store(self.gap, half * LANES, gap)
            least = ti.select(gap > reach, gap, NONE)
            far = ti.min(far, ti.Vector([self.lower(least, y, y + 4) for y in ti.static(range(4))]))
            for x in ti.static(range(2)):
                node, q = a[2 * half + x], 4 * x
                nearest = ti.min(self.lower(least, q, q + 1), self.lower(least, q + 2, q + 3))
                tree.clear[node] = ti.min(tree.clear[node], 0.5 * nearest)
        for y in ti.static(range(4)):
            tree.clear[b[y]] = ti.min(tree.clear[b[y]], 0.5 * far[y])  # pyright: ignore[reportIndexIssue]
        rows, columns, all_in = tree.at[level, 1], tree.at[level, 2], ti.select(level > 0, -anew, 0)
        for x in range(4):
            g = 4 * x
            near = ti.min(ti.min(self.gap[g], self.gap[g + 1]), ti.min(self.gap[g + 2], self.gap[g + 3]))
            s, t = 2 * i + (x >> 1), 2 * j + (x & 1)
            if near <= reach and s < rows and t < columns:
                for y in range(4):
                    u, v = 2 * k + (y >> 1), 2 * m + (y & 1)
                    if self.gap[g + y] <= reach and u < rows and v < columns:
                        found = self.add(target, found, s, t, u, v, all_in)
        return found

    @ti.func
    def lower(self, values: Template, k: Template, m: Template):
        """Of two lanes."""
        return ti.min(values[k], values[m])

    @ti.func
    def each(self, field: Template, a, half: Template):
        """Of the first or last two of four nodes, four times each."""
        one, other = field[a[2 * half]], field[a[2 * half + 1]]
        return ti.Vector([one, one, one, one, other, other, other, other])

    @ti.func
    def all_of(self, field: Template, b):
        """Of four nodes, twice."""
        four = ti.Vector([field[b[k]] for k in ti.static(range(4))])
        return ti.Vector([four[k % 4] for k in ti.static(range(LANES))])

    @ti.func
    def children(self, tree: Template, level, i, j):
        """Those of node (i, j) of the level above, on this level; others where the sheet ends."""
        last_row, last_column = tree.at[level, 1] - 1, tree.at[level, 2] - 1
        return ti.Vector(
            [
                tree.node(level, ti.min(2 * i + x // 2, last_row), ti.min(2 * j + x % 2, last_column))
                for x in ti.static(range(4))
            ]
        )

    @ti.func
    def flat(self, tree: Template, level, i, j, k, m):
        """Whether nodes (i, j) and (k, m) of a level, which touch, are part of a patch that cannot meet itself."""
        first = tree.node(level, ti.min(i, k), ti.min(j, m))
        slack = tree.fits[first + tree.nodes * (2 * ti.abs(k - i) + ti.abs(m - j))]
        if slack > self.least[level]:
            for row, column in ti.static(((i, j), (i, m), (k, j), (k, m))):
                node = tree.node(level, row, column)
                tree.slack[node] = ti.min(tree.slack[node], slack)
        return slack > self.least[level]

    @ti.func
    def beside(self, tree: Template, level, i, j, k, m):
        """Of two nodes that touch, the first as rows and columns go, and the bit that the other is of it."""
        first = i < k or (i == k and j <= m)
        node = ti.select(first, tree.node(level, i, j), tree.node(level, k, m))
        side = ti.select(first, m - j, j - m)
        return node, 1 << (3 * ti.abs(k - i) + side + 1)

    @ti.func
    def add(self, target, found, i, j, k, m, done):
        if found < self.room:
            self.one[target, found] = i * COLUMNS + j + ti.select(done < 0, ANEW, 0)
            self.other[target, found] = k * COLUMNS + m
        else:
            self.overflow[None] = self.overflow[None] + 1
        return ti.min(found + 1, self.room)

    @ti.func
    def done(self, tree: Template, level, i, j, k, m, anew):
        """0 where two nodes need a closer look, −1 where all in them does; 1 where they need none, as far as may be
        said without how far they are apart. anew: whether nothing is known of them."""
        a, b = tree.node(level, i, j), tree.node(level, k, m)
        out, look, was = 0, tree.stale[a] | tree.stale[b] | anew, 0
        if ti.max(ti.abs(i - k), ti.abs(j - m)) <= 1:
            look |= tree.stale[tree.node(level, i, m)] | tree.stale[tree.node(level, k, j)]
            if look != 0:
                node, bit = self.beside(tree, level, i, j, k, m)
                was = ti.select(tree.flat[node] & bit != 0, 1, 0)
                out = ti.cast(self.flat(tree, level, i, j, k, m), ti.i32)
                tree.flat[node] = ti.select(out == 1, tree.flat[node] | bit, tree.flat[node] & ~bit)
        if look == 0:
            out = 1
        return ti.select(out == 0 and (was | anew) != 0, -1, out)

    @ti.func
    def clear(self, tree: Template, a, b, reach, gap):
        """Whether nodes a and b are so far apart that they need no closer look. gap: how far they are."""
        if gap > reach:
            tree.clear[a] = ti.min(tree.clear[a], 0.5 * gap)
            tree.clear[b] = ti.min(tree.clear[b], 0.5 * gap)
        return gap > reach

    @routine
    def begin(self, tree: Template, reach: Float):
        """All pairs of the top level."""
        level = tree.top[None]
        wide = tree.at[level, 2]
        total, found = tree.at[level, 1] * wide, 0
        for a in range(total):
            for group in range(a // 4, (total + 3) // 4):
                first = tree.node(level, 0, 0)
                others = ti.Vector([first + ti.min(4 * group + y, total - 1) for y in ti.static(range(4))])
                look = tree.stale[first + a]
                for y in ti.static(range(4)):
                    look |= tree.stale[others[y]]
                # Of two that touch what is beside both counts, too.
                if look != 0 or 4 * group <= a + wide + 1:
                    self.apart(tree, ti.Vector([first + a] * 4), others)
                    for b in range(ti.max(a, 4 * group), ti.min(4 * group + 4, total)):
                        done = self.done(tree, level, a // wide, a % wide, b // wide, b % wide, 0)
                        if done <= 0 and not self.clear(tree, first + a, first + b, reach, self.gap[b - 4 * group]):
                            found = self.add(level & 1, found, a // wide, a % wide, b // wide, b % wide, done)
        self.count[level & 1] = found

    @routine
    def descend(self, tree: Template, level: Int, reach: Float):
        """Pairs of a level to those of the one below. reach: how near two nodes of that are looked at [m]."""
        source, target = level & 1, 1 - (level & 1)
        found, rows, columns = 0, tree.at[level - 1, 1], tree.at[level - 1, 2]
        for pair in range(self.count[source]):
            one, other = self.one[source, pair], self.other[source, pair]
            anew = ti.select(one & ANEW != 0, 1, 0)
            one &= ~ANEW
            i, j, k, m = one // COLUMNS, one % COLUMNS, other // COLUMNS, other % COLUMNS
            same, known = one == other, False
            alone = ti.max(ti.abs(i - k), ti.abs(j - m)) > 1
            if alone:
                found = self.strangers(tree, level - 1, one, other, anew, reach, target, found)
            for x in range(ti.select(alone, 0, 4)):
                s, t = 2 * i + (x >> 1), 2 * j + (x & 1)
                if s < rows and t < columns:
                    for y in range(4):
                        u, v = 2 * k + (y >> 1), 2 * m + (y & 1)
                        if u < rows and v < columns and (not same or x < y or (x == y and level > 1)):
                            done = self.done(tree, level - 1, s, t, u, v, anew)
                            if done <= 0 and not known:  # of all sixteen at once
                                self.children_apart(tree, level - 1, i, j, k, m)
                                known = True
                            if level == 1 and done < 0:
                                done = 0
                            if done <= 0:
                                a, b = tree.node(level - 1, s, t), tree.node(level - 1, u, v)
                                if not self.clear(tree, a, b, reach, self.gap[4 * x + y]):
                                    found = self.add(target, found, s, t, u, v, done)
        self.count[target] = found


@ti.data_oriented
class Sieve:
    """Which of the pairs of cells that boxes have left are parted by the direction from one's middle to the other's.
    Boxes along the axes of space are wide round cloth that lies aslant: most cells two apart in a bent sheet are near
    each other by their boxes alone.

    one, other: elements of the cells at hand. corner: of their corners, of one and then of the other, by lanes. gap:
    [lane] [m]."""

    def __init__(self) -> None:
        self.one, self.other = (ti.field(ti.i32, LANES) for _ in range(2))
        self.corner = ti.field(ti.i32, 2 * CORNERS * LANES)
        self.gap = ti.field(ti.f32, LANES)

    @routine
    def sift(self, points: Template, paths: Template, tree: Template, search: Template, reach: Float, horizon: Float):
        """Takes from the cells that a search has found those that stay further apart than `reach` [m] until the
        horizon [substeps]."""
        width, total, left = points.row[None], search.count[0], 0
        for group in range((total + LANES - 1) // LANES):
            for k in range(LANES):
                pair = ti.min(group * LANES + k, total - 1)
                self.one[k] = element(search.one[0, pair], width)
                self.other[k] = element(search.other[0, pair], width)
            self.measure(paths, width, horizon)
            for k in range(ti.min(total - group * LANES, LANES)):
                pair, p, q = group * LANES + k, self.one[k], self.other[k]
                gap = ti.select(((paths.has[p] | paths.has[q]) & BEYOND) != 0, 0.0, self.gap[k])
                if gap > reach:
                    tree.clear[p], tree.clear[q] = ti.min(tree.clear[p], 0.5 * gap), ti.min(tree.clear[q], 0.5 * gap)
                else:
                    search.one[0, left], search.other[0, left] = search.one[0, pair], search.other[0, pair]
                    left += 1
        search.count[0] = left

    @routine
    def measure(self, paths: Template, width: Int, horizon: Float):
        """How far the cells at hand are apart at least, until the horizon."""
        self.corners(paths, width, load(self.one, 0), 0)
        self.corners(paths, width, load(self.other, 0), CORNERS)
        none = ti.Vector([0.0] * LANES)
        x, y, z = none, none, none
        for k in range(2 * CORNERS):
            p, sign = load(self.corner, k * LANES), ti.select(k < CORNERS, 1.0, -1.0)
            x += sign * gather(paths.now[0], p)
            y += sign * gather(paths.now[1], p)
            z += sign * gather(paths.now[2], p)
        scale = 1.0 / ti.sqrt(x * x + y * y + z * z + 1e-20)
        x, y, z = scale * x, scale * y, scale * z
        low, slow = ti.Vector([1e9] * LANES), ti.Vector([1e9] * LANES)
        high, fast = ti.Vector([-1e9] * LANES), ti.Vector([-1e9] * LANES)
        for k in range(2 * CORNERS):
            p, first = load(self.corner, k * LANES), k < CORNERS
            here = x * gather(paths.now[0], p) + y * gather(paths.now[1], p) + z * gather(paths.now[2], p)
            pace = x * gather(paths.pace[0], p) + y * gather(paths.pace[1], p) + z * gather(paths.pace[2], p)
            low, slow = ti.select(first, ti.min(low, here), low), ti.select(first, ti.min(slow, pace), slow)
            high, fast = ti.select(first, high, ti.max(high, here)), ti.select(first, fast, ti.max(fast, pace))
        store(self.gap, 0, low - high - horizon * ti.max(fast - slow, 0.0))

    @ti.func
    def corners(self, paths: Template, width, p, begin: Template):
        """Of cells p (lanes); what of them there is no cloth at is the first."""
        has = gather(paths.has, p)
        store(self.corner, begin * LANES, p)
        store(self.corner, (begin + 1) * LANES, ti.select((has & EAST) != 0, p + 1, p))
        store(self.corner, (begin + 2) * LANES, ti.select((has & NORTH) != 0, p + width, p))
        store(self.corner, (begin + 3) * LANES, ti.select((has & CELL) != 0, p + width + 1, p))
