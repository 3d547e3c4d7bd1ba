"""Boxes round cells of cloth, and round blocks of 2 × 2, 4 × 4, … of them: of where they are, where they may get, and
of the directions of their threads."""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import Float, I32x2, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.patches import slack_of
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.motion.stencil import listed, load, load_xyz, near, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["HOLE", "LEVELS", "NONE", "Tree", "levels_of"]

LEVELS = 8
TOP = 144
"""Blocks of the top level, at most: all pairs of them are looked at."""

HOLE = 16
"""Bit of an element without a cell that leaves a hole in the cloth round it, beside those of `Paths`."""

NONE = 1e9
WEFT, WARP = 6, 9
"""First of the three bounds, of twelve: of places from 0, of ways from 3, of the threads along rows and columns."""


def levels_of(rows: int, width: int) -> NDArray[np.int32]:
    """(LEVELS, 3) first node, rows and columns of each level; rows 0 beyond the last. rows, width: of the padded grid.
    Nodes of level 0 are the grid's elements. Each level begins with whole lanes."""
    out = np.zeros((LEVELS, 3), np.int32)
    out[0] = 0, rows, width
    at, level = _whole(rows * width), 0
    while rows * width > TOP or level < 2:
        rows, width, level = -(-rows // 2), -(-width // 2), level + 1
        out[level] = at, rows, width
        at += _whole(rows * width)
    return out


def _whole(nodes: int) -> int:
    return -(-nodes // LANES) * LANES


@ti.func
def lower(one: Template, other: Template):
    return ti.min(one[0], other[0]), ti.min(one[1], other[1]), ti.min(one[2], other[2])


@ti.func
def higher(one: Template, other: Template):
    return ti.max(one[0], other[0]), ti.max(one[1], other[1]), ti.max(one[2], other[2])


@ti.data_oriented
class Tree:
    """low, high: [bound], see `WEFT`; of nothing NONE and −NONE. clear: how far all in a node may be off its path [m].
    slack: by how much its threads may turn, as a share of their length. stale: 1 where anything in it gets a new path.
    fits: slack of the patches that a node makes, of each of four kinds in turn: by itself, with the next of its row, of
    its column, with all three beyond it. flat: a bit for each of the nodes beside it, and itself, that it makes a patch
    with that is taken for one that cannot meet itself, see `Search.beside`. at: see `levels_of`. top: level."""

    at: Any
    top: Any

    def __init__(self, size: int) -> None:
        nodes = 2 * size
        self.low, self.high = ([ti.field(ti.f32, nodes) for _ in range(12)] for _ in range(2))
        self.clear, self.slack = (ti.field(ti.f32, nodes) for _ in range(2))
        self.stale, self.flat = (ti.field(ti.i32, nodes) for _ in range(2))
        self.nodes, self.fits = nodes, ti.field(ti.f32, 4 * nodes)
        self.at, self.top = ti.field(ti.i32, (LEVELS, 3)), ti.field(ti.i32, ())
        self.inverse = ti.field(ti.f32, 2)

    @ti.func
    def take(self, levels: I32x2, inverse_x, inverse_y):
        """inverse: 1 over the spacings [1/m]."""
        for level in range(LEVELS):
            for k in range(3):
                self.at[level, k] = levels[level, k]
            if levels[level, 1] > 0:
                self.top[None] = level
        self.inverse[0], self.inverse[1] = inverse_x, inverse_y

    @ti.func
    def node(self, level, i, j):
        return self.at[level, 0] + i * self.at[level, 2] + j

    @ti.func
    def bound(self, k: Template, p, there, low, high):
        """Bounds of lanes, of those that are there."""
        store(self.low[k], p, ti.select(there, low, NONE))
        store(self.high[k], p, ti.select(there, high, -NONE))

    @routine
    def cells(self, points: Template, paths: Template, horizon: Float, whole: Int):
        """The lowest level. horizon: substeps ahead. whole: whether nothing is known from before."""
        for axis in ti.static(range(3)):
            self.bounds(points, paths, horizon, axis)
        row = points.row[None]
        for e in range(paths.count[None]):
            p = paths.packet(e)
            stale = load(paths.spent, p) | load(paths.spent, near(p + 1))
            stale |= load(paths.spent, near(p + row)) | load(paths.spent, near(p + row + 1))
            store(self.stale, p, stale)
            store(self.clear, p, ti.select(stale != 0, NONE, load(self.clear, p)))
            store(self.slack, p, ti.select(stale != 0, NONE, load(self.slack, p)))
            store(self.flat, p, ti.select(whole != 0, 0, load(self.flat, p)))

    @routine
    def bounds(self, points: Template, paths: Template, horizon: Float, axis: Template):
        """Of all cells along one axis: of places, of ways, and of their threads."""
        row = points.row[None]
        for e in range(paths.count[None]):
            self.bounds_at(paths, horizon, axis, paths.packet(e), row)

    @ti.func
    def bounds_at(self, paths: Template, horizon, axis: Template, p, row):
        """Of the lanes at p."""
        has = load(paths.has, p)
        here, east, north, cell = (has & POINT) != 0, (has & EAST) != 0, (has & NORTH) != 0, (has & CELL) != 0
        hole = (has & HOLE) != 0
        a, b = load(paths.now[axis], p), load(paths.now[axis], near(p + 1))
        c, d = load(paths.now[axis], near(p + row)), load(paths.now[axis], near(p + row + 1))
        x, y, z = ti.select(east, b, a), ti.select(north, c, a), ti.select(cell, d, a)
        self.bound(axis, p, here, ti.min(ti.min(a, x), ti.min(y, z)), ti.max(ti.max(a, x), ti.max(y, z)))
        u, v = horizon * load(paths.pace[axis], p), horizon * load(paths.pace[axis], near(p + 1))
        w, t = horizon * load(paths.pace[axis], near(p + row)), horizon * load(paths.pace[axis], near(p + row + 1))
        x, y, z = ti.select(east, v, u), ti.select(north, w, u), ti.select(cell, t, u)
        self.bound(axis + 3, p, here, ti.min(ti.min(u, x), ti.min(y, z)), ti.max(ti.max(u, x), ti.max(y, z)))
        # Threads along the row and the column, now and at the horizon.
        for first, one, other, ahead, beyond, scale in ti.static(
            (
                (WEFT, b - a, d - c, v - u, t - w, self.inverse[0]),
                (WARP, c - a, d - b, w - u, t - v, self.inverse[1]),
            )
        ):
            low = ti.min(one, other) + ti.min(ti.min(ahead, beyond), 0.0)
            high = ti.max(one, other) + ti.max(ti.max(ahead, beyond), 0.0)
            low, high = ti.select(hole, -9.0, scale * low), ti.select(hole, 9.0, scale * high)
            self.bound(first + axis, p, cell | hole, low, high)

    @routine
    def rise(self, whole: Int):
        """All levels from the one below."""
        for level in range(1, self.top[None] + 1):
            rows, wide = self.at[level - 1, 1], self.at[level - 1, 2]
            for i in range(self.at[level, 1]):
                for j in range(self.at[level, 2]):
                    q, p = self.node(level, i, j), self.node(level - 1, 2 * i, 2 * j)
                    x = ti.select(2 * j + 1 < wide, 1, 0)
                    y = ti.select(2 * i + 1 < rows, wide, 0)
                    self.round_four(q, p, x, y)
                    self.stale[q] = self.stale[p] | self.stale[p + x] | self.stale[p + y] | self.stale[p + y + x]
                    if self.stale[q] != 0:
                        self.clear[q] = NONE
                        self.slack[q] = NONE
                    if whole != 0:
                        self.flat[q] = 0

    @ti.func
    def round_four(self, q, p, x, y):
        """The box of node q round nodes p, p + x, p + y and p + x + y."""
        for k in ti.static(range(12)):
            low, high = ti.static(self.low[k], self.high[k])
            low[q] = ti.min(ti.min(low[p], low[p + x]), ti.min(low[p + y], low[p + y + x]))
            high[q] = ti.max(ti.max(high[p], high[p + x]), ti.max(high[p + y], high[p + y + x]))

    @routine
    def fit(self, whole: Int):
        """Patches of one to four nodes, of all levels; where not all is searched, those with anything stale."""
        for level in range(self.top[None] + 1):
            wide = self.at[level, 2]
            for group in range((self.at[level, 1] * wide + LANES - 1) // LANES):
                p = near(self.at[level, 0] + group * LANES)
                stale = load(self.stale, p) | load(self.stale, near(p + 1))
                stale |= load(self.stale, near(p + wide)) | load(self.stale, near(p + wide + 1))
                if whole != 0 or stale.max() != 0:  # pyright: ignore[reportOptionalCall]
                    self.fit_lanes(p, wide)

    @ti.func
    def fit_lanes(self, p, wide):
        """Of nodes p on. Beyond the end of a row or column is what nobody asks for."""
        own, north = self.threads(p), self.threads(near(p + wide))
        east, beyond = self.both(own, self.threads(near(p + 1))), self.threads(near(p + wide + 1))
        store(self.fits, p, slack_of(own[0], own[1], own[2], own[3]))
        store(self.fits, listed(p + self.nodes), slack_of(east[0], east[1], east[2], east[3]))
        column, block = self.both(own, north), self.both(east, self.both(north, beyond))
        store(self.fits, listed(p + 2 * self.nodes), slack_of(column[0], column[1], column[2], column[3]))
        store(self.fits, listed(p + 3 * self.nodes), slack_of(block[0], block[1], block[2], block[3]))

    @ti.func
    def threads(self, p):
        """Boxes of the threads of nodes p on along rows and columns, low and high."""
        a, b, c, d = ti.static(self.low[WEFT:WARP], self.high[WEFT:WARP], self.low[WARP:], self.high[WARP:])
        return load_xyz(a, p), load_xyz(b, p), load_xyz(c, p), load_xyz(d, p)

    @ti.func
    def both(self, one: Template, other: Template):
        """Boxes round two of them."""
        return (
            lower(one[0], other[0]),
            higher(one[1], other[1]),
            lower(one[2], other[2]),
            higher(one[3], other[3]),
        )

    @routine
    def settle(self, points: Template, paths: Template):
        """What nodes may be off, down to the key points."""
        for down in range(self.top[None]):
            level = self.top[None] - 1 - down
            for i in range(self.at[level, 1]):
                for j in range(self.at[level, 2]):
                    q, p = self.node(level, i, j), self.node(level + 1, i >> 1, j >> 1)
                    self.clear[q] = ti.min(self.clear[q], self.clear[p])
                    self.slack[q] = ti.min(self.slack[q], self.slack[p])
        row = points.row[None]
        for e in range(paths.count[None]):
            p = paths.packet(e)
            has = load(paths.has, p)
            room, turn = load(self.clear, p), load(self.slack, p)
            for back in ti.static((1, row, row + 1)):
                room = ti.min(room, load(self.clear, near(p - back)))
                turn = ti.min(turn, load(self.slack, near(p - back)))
            store(paths.room, p, ti.select((has & POINT) != 0, 1.0 / (room * room), 0.0))
            for field, bit, scale in ti.static(
                ((paths.turn_east, EAST, self.inverse[0]), (paths.turn_north, NORTH, self.inverse[1]))
            ):
                store(field, p, ti.select((has & bit) != 0, scale * scale / (turn * turn), 0.0))
