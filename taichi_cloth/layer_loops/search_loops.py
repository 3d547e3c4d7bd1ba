"""The search for cells that may come near each other as parallel loops (`layers/search.py` has what it does).

Always of all, as whatever has used up its room makes all that is known old: a device has the threads. Nodes of a level
are made at once. So are pairs of them gone through, twice: first each says how many pairs of their children are to be
looked at, then these are put down, in the order of their parents. What nodes may be off is a minimum in any order.

No loop has an atomic operation within a loop: llvmpipe, a Vulkan of CPU threads, goes wrong there.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.layer_loops.places import Places
from taichi_cloth.layers.outline import BEYOND
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.search import ROOM
from taichi_cloth.layers.tree import NONE, TOP, levels_of
from taichi_cloth.loops.frame_loops import MOST_ITERATIONS

__all__ = ["SearchLoops", "bits_of"]

FOUR = 4
"""Children of a node."""


@ti.func
def bits_of(value):
    """Of a number above 0, which are in the same order."""
    return ti.bit_cast(ti.cast(value, ti.f32), ti.i32)


@ti.data_oriented
class SearchLoops:
    """points: a `LayerFields`. shape: of the padded grid. many: threads for pairs. clear, slack: of each node, as of
    `Tree`, by their bits. room: for pairs. source: how many are at hand; asked: pairs of their children; found: of each
    of these, whether it is put down."""

    def __init__(self, points: Any, shape: tuple[int, int], many: int) -> None:
        self.points, self.paths, self.tree, self.search = points, points.paths, points.tree, points.search
        self.many, self.count, self.row = many, shape[0] * shape[1], shape[1]
        self.levels = tuple(tuple(int(one) for one in level) for level in levels_of(*shape) if level[1] > 0)
        self.top = len(self.levels) - 1
        self.nodes = self.levels[-1][0] + self.levels[-1][1] * self.levels[-1][2]
        self.clear, self.slack = (ti.field(ti.i32, self.nodes) for _ in range(2))
        self.room = min(self.search.room, ROOM * self.count, MOST_ITERATIONS // FOUR**2)
        self.found, self.source = ti.field(ti.i32, FOUR * FOUR * self.room), ti.field(ti.i32, ())
        self.asked: Any = ti.field(ti.i32, ())
        self.places: Any = Places(max(FOUR * FOUR * self.room, TOP * TOP), self.asked)

    @ti.func
    def boxes(self):
        """Loops: of all cells, until the horizon."""
        for p in range(self.count):
            ahead = ti.cast(self.points.horizon[None], ti.f32)
            for axis in ti.static(range(3)):
                self.tree.bounds_at(self.paths, ahead, axis, p, self.row)

    @ti.func
    def rise(self):
        """Loops: of all levels, and patches."""
        for q in range(self.nodes):
            self.clear[q], self.slack[q] = bits_of(NONE), bits_of(NONE)
        for level in ti.static(range(1, self.top + 1)):
            self.rise_to(ti.static(self.levels[level]), ti.static(self.levels[level - 1]))
        for level in ti.static(range(self.top + 1)):
            for q in range(ti.static(self.levels[level][1] * self.levels[level][2])):
                self.tree.fit_lanes(q + ti.static(self.levels[level][0]), ti.static(self.levels[level][2]))

    @ti.func
    def rise_to(self, level: Template, below: Template):
        """A loop: the boxes of a level round those of the one below."""
        for node in range(ti.static(level[1] * level[2])):
            i, j = node // level[2], node % level[2]
            x = ti.select(2 * j + 1 < below[2], 1, 0)
            y = ti.select(2 * i + 1 < below[1], below[2], 0)
            self.tree.round_four(level[0] + node, below[0] + 2 * i * below[2] + 2 * j, x, y)

    @ti.func
    def descend(self):
        """Loops: pairs of nodes of the top, then of each level down to the cells."""
        total = ti.static(self.levels[self.top][1] * self.levels[self.top][2])
        for t in range(ti.static(total**2)):
            if t == 0:
                self.asked[None] = total * total
            found = 0
            if t // total <= t % total and self.goes_on(self.top, t // total, t % total):
                found = 1
            self.found[t], self.places.of[t] = found, found
        self.places.sum_up()
        for t in range(ti.static(total**2)):
            if self.found[t] != 0:
                self.put(ti.static(self.top & 1), self.places.of[t], t // total, t % total)
        self.count_up()
        for down in ti.static(range(self.top)):
            self.go_down(ti.static(self.top - down))

    @ti.func
    def go_down(self, level: Template):
        """Loops: pairs of a level to those of the one below, a thread for each pair of children."""
        source = ti.static(level & 1)
        for t in range(FOUR * FOUR * self.room):
            if t < self.asked[None]:
                one, other = self.search.one[source, t // 16], self.search.other[source, t // 16]
                x, y, found = t // 4 % 4, t % 4, 0
                a, b = self.child(level, one, x), self.child(level, other, y)
                once = one != other or x < y or (x == y and level > 1)
                if once and a >= 0 and b >= 0:
                    found = int(self.goes_on(ti.static(level - 1), a, b))
                self.found[t], self.places.of[t] = found, found
        self.places.sum_up()
        for t in range(FOUR * FOUR * self.room):
            if t < self.asked[None] and self.found[t] != 0:
                one, other = self.search.one[source, t // 16], self.search.other[source, t // 16]
                a, b = self.child(level, one, t // 4 % 4), self.child(level, other, t % 4)
                self.put(1 - source, self.places.of[t], a, b)
        self.count_up()

    @ti.func
    def child(self, level: Template, node, k):
        """Number, within the level below, of a child of a node of a level; −1 where there is none."""
        columns, rows_below = ti.static(self.levels[level][2], self.levels[level - 1][1])
        below = ti.static(self.levels[level - 1][2])
        i, j = 2 * (node // columns) + k // 2, 2 * (node % columns) + k % 2
        return ti.select(i < rows_below and j < below, i * below + j, -1)

    @ti.func
    def put(self, target: Template, at, a, b):
        """One more pair, of numbers of nodes within their level."""
        if at < self.room:
            self.search.one[target, at], self.search.other[target, at] = a, b

    @ti.func
    def count_up(self):
        """A loop of one: what has been put down is what is gone through next."""
        for _ in range(1):
            total = self.places.total[None]
            self.search.overflow[None] = self.search.overflow[None] + ti.max(total - self.room, 0)
            self.source[None] = ti.min(total, self.room)
            self.asked[None] = FOUR * FOUR * self.source[None]

    @ti.func
    def goes_on(self, level: Template, a, b):
        """Whether nodes a and b of a level, by their numbers within it, are to be looked at more closely."""
        first, columns = ti.static(self.levels[level][0], self.levels[level][2])
        i, j, k, m = a // columns, a % columns, b // columns, b % columns
        out = True
        if ti.max(ti.abs(i - k), ti.abs(j - m)) <= 1:
            out = not self.flat(level, i, j, k, m)
        if out:
            reach = self.points.reach[None] + ti.static(1.0 if level > 0 else 0.0) * self.points.coarse[None]
            gap = self.gap(first + a, first + b)
            if ti.static(level == 0):  # noqa: SIM102 (one is known when it is compiled)
                if ((self.paths.has[a] | self.paths.has[b]) & BEYOND) == 0:
                    gap = ti.max(gap, self.gap_of_cells(first + a, first + b))
            if gap > reach:
                ti.atomic_min(self.clear[first + a], bits_of(0.5 * gap))
                ti.atomic_min(self.clear[first + b], bits_of(0.5 * gap))
                out = False
            elif ti.static(level == 0):
                ti.atomic_min(self.clear[first + a], bits_of(0.5 * reach))
                ti.atomic_min(self.clear[first + b], bits_of(0.5 * reach))
        return out

    @ti.func
    def flat(self, level: Template, i, j, k, m):
        """As `Search.flat`."""
        base, columns = ti.static(self.levels[level][0], self.levels[level][2])
        first = base + ti.min(i, k) * columns + ti.min(j, m)
        slack = self.tree.fits[first + self.tree.nodes * (2 * ti.abs(k - i) + ti.abs(m - j))]
        enough = slack > self.search.least[level]
        if enough:
            for row, column in ti.static(((i, j), (i, m), (k, j), (k, m))):
                ti.atomic_min(self.slack[base + row * columns + column], bits_of(slack))
        return enough

    @ti.func
    def gap(self, a, b):
        """How far nodes a and b stay apart until the horizon at least, as far as boxes tell [m]."""
        out = -NONE
        for axis in ti.static(range(3)):
            low, high = ti.static(self.tree.low[axis], self.tree.high[axis])
            slow, fast = ti.static(self.tree.low[axis + 3], self.tree.high[axis + 3])
            one = low[a] - high[b] - ti.max(fast[b] - slow[a], 0.0)
            other = low[b] - high[a] - ti.max(fast[a] - slow[b], 0.0)
            out = ti.max(out, ti.max(one, other))
        return out

    @ti.func
    def corner(self, p, k):
        """Element of a corner of cell p; what of it there is no cloth at is the first."""
        bit = ti.select(k == 1, EAST, ti.select(k == 2, NORTH, CELL))
        there = k > 0 and (self.paths.has[p] & bit) != 0
        return ti.select(there, p + (k & 1) + (k >> 1) * self.row, p)

    @ti.func
    def gap_of_cells(self, p, q):
        """As `Sieve.measure`: by the way from one's middle to the other's."""
        way = ti.Vector([0.0, 0.0, 0.0])
        for k in range(4):
            one, other = self.corner(p, k), self.corner(q, k)
            for axis in ti.static(range(3)):
                way[axis] += self.paths.now[axis][one] - self.paths.now[axis][other]
        way /= ti.sqrt(way.norm_sqr() + 1e-20)
        low, slow, high, fast = NONE, NONE, -NONE, -NONE
        for k in range(4):
            one, other = self.corner(p, k), self.corner(q, k)
            here, pace, there, other_pace = 0.0, 0.0, 0.0, 0.0
            for axis in ti.static(range(3)):
                here += way[axis] * self.paths.now[axis][one]
                pace += way[axis] * self.paths.pace[axis][one]
                there += way[axis] * self.paths.now[axis][other]
                other_pace += way[axis] * self.paths.pace[axis][other]
            low, slow = ti.min(low, here), ti.min(slow, pace)
            high, fast = ti.max(high, there), ti.max(fast, other_pace)
        return low - high - ti.cast(self.points.horizon[None], ti.f32) * ti.max(fast - slow, 0.0)

    @ti.func
    def pairs(self):
        """How many pairs of cells are at hand."""
        return self.source[None]

    @ti.func
    def cells_of(self, pair):
        """The two, by their elements."""
        return self.search.one[0, pair], self.search.other[0, pair]

    @ti.func
    def settle(self):
        """Loops: what nodes may be off, down to the key points, as `Tree.settle`."""
        for down in ti.static(range(self.top)):
            self.hand_down(ti.static(self.levels[self.top - 1 - down]), ti.static(self.levels[self.top - down]))
        for p in range(self.count):
            room, turn = self.clear[p], self.slack[p]
            for back in ti.static((1, self.row, self.row + 1)):
                room = ti.min(room, self.clear[ti.max(p - back, 0)])
                turn = ti.min(turn, self.slack[ti.max(p - back, 0)])
            has, off, turned = self.paths.has[p], ti.bit_cast(room, ti.f32), ti.bit_cast(turn, ti.f32)
            self.paths.room[p] = ti.select((has & POINT) != 0, 1.0 / (off * off), 0.0)
            for field, bit, scale in ti.static(
                (
                    (self.paths.turn_east, EAST, self.tree.inverse[0]),
                    (self.paths.turn_north, NORTH, self.tree.inverse[1]),
                )
            ):
                field[p] = ti.select((has & bit) != 0, scale * scale / (turned * turned), 0.0)

    @ti.func
    def hand_down(self, level: Template, above: Template):
        """A loop: what the nodes of a level may be off, no more than those above."""
        for node in range(ti.static(level[1] * level[2])):
            q = level[0] + node
            p = above[0] + node // level[2] // 2 * above[2] + node % level[2] // 2
            self.clear[q] = ti.min(self.clear[q], self.clear[p])
            self.slack[q] = ti.min(self.slack[q], self.slack[p])
