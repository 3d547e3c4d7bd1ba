"""Points near faces and edges near edges, of the pairs of cells that a search has left: each with a direction that
parts them, the unit vector between their nearest places."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.nearest import CORNERS, EDGES, FACES, Nearest
from taichi_cloth.layers.outline import MEETS, RIM_EAST, RIM_NORTH
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.search import ROOM as CELL_ROOM
from taichi_cloth.layers.search import element
from taichi_cloth.motion.stencil import load, near, nothing, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["BESIDE", "NEAR_SEAMS", "NearPairs", "Pairs"]

FACE_ROOM, EDGE_ROOM = 16, 48
"""Pairs, for each key point."""

NEAR_SEAMS = 8e-6
"""That pairs are kept apart at least beside a seam [m]."""

PARTED, SHARE = 2e-5, 0.25
"""How far apart a pair is at least [m], and of what it is kept apart where that is less: small pieces of cells lie near
each other."""

HINGE = 0.125
"""Share of how far parts are from each other by way of a seam that they are kept apart at least: no seam folds by more
than to 14°, where the cells beside it would have less freedom than the pairs between them ask for."""

FOLDED = 4.0
"""Spacings in the flat sheet, from one side of the tightest fold to the other."""

SHALLOW = 0.35
"""Share of the spacing that pairs are kept apart at least, however near they are in the flat sheet."""

LET_OFF = 1 << 24
"""Tangle of what is let off within a frame, beyond all others."""

BESIDE = 16
"""More than as many cells as neighbours may be apart that are not tangled for being of one tangle."""


@ti.data_oriented
class Pairs:
    """Of both kinds, one behind the other, so that one piece of code goes through either. rooms: for pairs of each.
    point: [corner], elements of the padded grid: a point and a face, or the ends of two edges. normal: [axis], from the
    second side to the first. kept: how far apart they are kept [m]. apart: along the normal, when last looked at [m].
    cell: [side], elements of the cells that they are of. awake: numbers of those that may touch in the next interval.
    count, woken: [kind], how many there are, and are awake."""

    count: Any
    woken: Any

    def __init__(self, faces: int, edges: int) -> None:
        self.rooms = faces, edges
        room = faces + edges + 2 * LANES
        self.point = [ti.field(ti.i32, room) for _ in range(4)]
        self.normal = [ti.field(ti.f32, room) for _ in range(3)]
        self.kept, self.cap, self.least, self.apart = (ti.field(ti.f32, room) for _ in range(4))
        self.cell = [ti.field(ti.i32, room) for _ in range(2)]
        self._all = [*self.point, *self.normal, self.kept, self.cap, self.least, self.apart, *self.cell]
        self.awake = ti.field(ti.i32, room + 2 * LANES)
        self.count, self.woken = ti.field(ti.i32, 3), ti.field(ti.i32, 3)

    @ti.func
    def first(self, kind):
        """Number of the first pair of a kind."""
        return ti.select(kind == FACES, 0, self.rooms[0] + LANES)

    @ti.func
    def first_awake(self, kind):
        """Place in `awake` of the first of a kind."""
        return ti.select(kind == FACES, 0, self.rooms[0] + 2 * LANES)

    @ti.func
    def room(self, kind):
        return ti.select(kind == FACES, self.rooms[0], self.rooms[1])

    @ti.func
    def packets(self, kind):
        return (self.count[kind] + LANES - 1) // LANES

    @ti.func
    def move(self, source, target):
        """A pair to another place."""
        for field in ti.static(self._all):
            field[target] = field[source]

    @ti.func
    def close(self, kind, found, apart):
        """`found` pairs of a kind are in; whole lanes of ones that never touch behind them, of points `apart`."""
        self.count[kind] = ti.min(found, self.room(kind))
        begin = self.first(kind) + self.count[kind]
        for k in range(LANES):
            for corner in ti.static(range(4)):
                self.point[corner][begin + k] = apart[corner]
            for axis in ti.static(range(3)):
                self.normal[axis][begin + k] = 0.0
            self.kept[begin + k] = -1.0


@ti.data_oriented
class NearPairs:
    """pairs: all of them. nearest: looks at eight. thickness [m]. most: that is kept where cloth is bent [m]. bulge:
    [axis], how far smooth cloth stands out of the middle of each cell [m]. panel: of each element, 0 where there is
    none: only within a panel are neighbours let nearer than the thickness. tangle: of each cell, see `tangles.py`.
    overflow: pairs without room."""

    def __init__(self, size: int) -> None:
        self.pairs, self.nearest = Pairs(FACE_ROOM * size, EDGE_ROOM * size), Nearest()
        self.thickness, self.edge_share = ti.field(ti.f32, ()), ti.field(ti.f32, ())
        self.spacing, self.most = ti.field(ti.f32, 2), ti.field(ti.f32, ())
        self.bulge, self._bent = ([ti.field(ti.f32, size) for _ in range(3)] for _ in range(2))
        self.panel, self.tangle = ti.field(ti.i32, size), ti.field(ti.i32, size)
        # Elements from a cell's own to the corners of its faces, and to the ends of its edges.
        self.face_offset, self.edge_offset = ti.field(ti.i32, (2, 3)), ti.field(ti.i32, (3, 2))
        self.one, self.other = (ti.field(ti.i32, LANES) for _ in range(2))
        self.within = ti.field(ti.f32, LANES)
        self.overflow = ti.field(ti.i32, ())
        # Of each cell the first of the pairs of cells at hand that begin with it, from 1; of each of these the next.
        self.first, self.next = ti.field(ti.i32, size), ti.field(ti.i32, CELL_ROOM * size)

    @ti.func
    def take(self, width):
        """width: of the padded grid."""
        for k, offset in ti.static(enumerate((0, 1, width + 1, 0, width + 1, width))):
            self.face_offset[k // 3, k % 3] = offset
        for k, offset in ti.static(enumerate((0, 1, 0, width, 0, width + 1))):
            self.edge_offset[k // 2, k % 2] = offset

    @routine
    def bend(self, points: Template, paths: Template):
        """`bulge`: threads are drawn as splines through key points (`fabric/surface.py`), whose middle between two is
        off the chord by a sixteenth of the second differences at both; of a cell, in the mean of its two rows and two
        columns."""
        row = points.row[None]
        for axis in ti.static(range(3)):
            for e in range(paths.count[None]):
                self.bend_at(points, paths, axis, paths.packet(e), row)
            for e in range(paths.count[None]):
                self.bulge_at(axis, paths.packet(e), row)

    @ti.func
    def bend_at(self, points: Template, paths: Template, axis: Template, p, row):
        """The second differences of the lanes at p."""
        place = ti.static(points.position[axis])
        both = nothing()
        for o, bit in ti.static(((1, EAST), (row, NORTH))):
            through = (load(paths.has, p) & load(paths.has, near(p - o)) & bit) != 0
            second = load(place, near(p + o)) - 2.0 * load(place, p) + load(place, near(p - o))
            both += ti.select(through, second, 0.0)
        store(self._bent[axis], p, both)

    @ti.func
    def bulge_at(self, axis: Template, p, row):
        """After `bend_at` of all."""
        bent = ti.static(self._bent[axis])
        four = load(bent, p) + load(bent, near(p + 1))
        four += load(bent, near(p + row)) + load(bent, near(p + row + 1))
        store(self.bulge[axis], p, -four / 32.0)

    @ti.func
    def drawn_apart(self, kept, share, p, q, n):
        """How far cells p and q are kept apart along normal n, that smooth cloth through them is by `kept`.
        That is less than a share of the thickness beside seams, where more would be in the way of these."""
        out = kept
        if kept >= share * self.thickness[None]:
            for axis in ti.static(range(3)):
                out += n[axis] * (self.bulge[axis][q] - self.bulge[axis][p])
        return ti.min(ti.max(out, kept), ti.max(kept, self.most[None]))

    @ti.func
    def in_fold(self, flat, kept):
        """How far what is so far apart in the flat sheet is kept apart: no fold is tighter than key points follow."""
        return ti.select(flat < self.folded(), ti.max(kept, self.most[None]), kept)

    @ti.func
    def kept_apart(self, points: Template, width, p, q):
        """How far parts of two cells are kept apart: the thickness, or what folds are, but at most half of how far they
        are in the flat sheet, or by way of a seam."""
        out = self.thickness[None]
        if self.panel[p] == self.panel[q] and self.panel[p] > 0:
            i = ti.cast(ti.max(ti.abs(p // width - q // width) - 1, 0), ti.f32) * self.spacing[1]
            j = ti.cast(ti.max(ti.abs(p % width - q % width) - 1, 0), ti.f32) * self.spacing[0]
            flat, least = ti.sqrt(i * i + j * j), ti.min(self.spacing[0], self.spacing[1])
            out = ti.min(self.in_fold(flat, out), ti.max(0.5 * flat, SHALLOW * least))
        return out

    @ti.func
    def across(self, points: Template, width, p, q):
        """How far parts of two cells are from each other by way of a seam at least; far, where they are nearer in the
        flat sheet."""
        seams = ti.static(points.pieces.cell_seam)
        out = seams[p] + seams[q]
        near_by = ti.max(ti.abs(p // width - q // width), ti.abs(p % width - q % width)) <= 4
        return out, near_by and self.panel[p] == self.panel[q]

    @ti.func
    def folded(self):
        """From one side of the tightest fold to the other, in the flat sheet [m]."""
        return FOLDED * ti.min(self.spacing[0], self.spacing[1])

    @ti.func
    def tent(self, sewn):
        """How far apart cloth is kept that is so far from each other by way of a seam: no seam folds flat."""
        return HINGE * ti.max(ti.min(sewn, self.folded() - sewn), 0.0)

    @ti.func
    def owns(self, paths: Template, p, bit):
        return (paths.has[p] & (bit << MEETS)) != 0

    @ti.func
    def differ(self, points: Template, p, q):
        """Whether two elements are not one."""
        return points.pieces.label[p] != points.pieces.label[q]

    @ti.func
    def tangled(self, p, q):
        """Whether two cells are of layers that pass through each other: they have no sides."""
        one, width = self.tangle[p], self.face_offset[1, 2]
        far = ti.max(ti.abs(p // width - q // width), ti.abs(p % width - q % width))
        return one > 0 and one == self.tangle[q] and (far > one % BESIDE or self.panel[p] != self.panel[q])

    @ti.func
    def keep(self, kind, at, n, kept, share, points: Template, p, q, sewn, beside):
        """One more pair, which n parts, of cells p and q, unless they are tangled. share: of the thickness that such
        pairs keep at most. Returns how many there are."""
        pairs, out, tangled = self.pairs, at, self.tangled(p, q)
        if at < pairs.room(kind) and not tangled:
            pair = pairs.first(kind) + at
            pairs.cell[0][pair], pairs.cell[1][pair] = p, q
            for corner in ti.static(range(4)):
                pairs.point[corner][pair] = points[corner]
            for axis in ti.static(range(3)):
                pairs.normal[axis][pair] = n[axis]
            cap = self.drawn_apart(kept, share, p, q, n)
            pairs.cap[pair], pairs.kept[pair] = cap, cap
            if not beside:
                pairs.kept[pair] = ti.max(cap, share * self.tent(ti.max(sewn, 0.5 * self.folded())))
            pairs.least[pair] = ti.min(PARTED, SHARE * ti.min(cap, share * ti.max(0.5 * sewn, NEAR_SEAMS)))
            out = at + 1
        elif not tangled:
            self.overflow[None] = self.overflow[None] + 1
        return out

    @ti.func
    def let_off(self, pair):
        """A pair that nothing parts, and what else is of its cells, until the frame is over."""
        self.pairs.kept[pair] = -1.0
        p, q = self.pairs.cell[0][pair], self.pairs.cell[1][pair]
        one, other = self.tangle[p], self.tangle[q]
        if one == 0 or other == 0:
            number = ti.select(one + other == 0, LET_OFF, one + other)
            self.tangle[p], self.tangle[q] = number, number

    @ti.func
    def none(self):
        """Known."""
        self.pairs.count[FACES] = 0
        self.pairs.count[EDGES] = 0

    @routine
    def thin(self, points: Template, tree: Template, search: Template):
        """Forgets pairs of cells of which something got a new path, and of those that are at hand anew."""
        width = points.row[None]
        for pair in range(search.count[0]):
            p = element(search.one[0, pair], width)
            self.next[pair], self.first[p] = self.first[p], pair + 1
        pairs = self.pairs
        for kind in range(FACES, EDGES + 1):
            begin = pairs.first(kind)
            left = begin
            for pair in range(begin, begin + pairs.count[kind]):
                p, q = pairs.cell[0][pair], pairs.cell[1][pair]
                gone = tree.stale[p] | tree.stale[q]
                if gone == 0:
                    gone = self.at_hand(search, width, p, q) | self.at_hand(search, width, q, p)
                if gone == 0:
                    pairs.move(pair, left)
                    left += 1
            pairs.count[kind] = left - begin
        for pair in range(search.count[0]):
            self.first[element(search.one[0, pair], width)] = 0

    @ti.func
    def at_hand(self, search: Template, width, p, q):
        found, at = 0, self.first[p]
        while at != 0 and found == 0:
            found = ti.select(element(search.other[0, at - 1], width) == q, 1, 0)
            at = self.next[at - 1]
        return found

    @routine
    def find(self, points: Template, paths: Template, tree: Template, search: Template, reach: Float):
        """Pairs of the cells at hand that are nearer than `reach` [m] and what they may approach each other until the
        horizon, behind those that are known."""
        width = points.row[None]
        faces, edges, total = self.pairs.count[FACES], self.pairs.count[EDGES], search.count[0]
        for group in range((total + LANES - 1) // LANES):
            count = ti.min(total - group * LANES, LANES)
            for k in range(LANES):
                pair = group * LANES + ti.min(k, count - 1)
                p, q = element(search.one[0, pair], width), element(search.other[0, pair], width)
                approach = 0.0
                for axis in ti.static(range(3)):
                    slow, fast = ti.static(tree.low[axis + 3], tree.high[axis + 3])
                    approach += ti.max(fast[p] - slow[q], fast[q] - slow[p]) ** 2
                off = paths.strayed(p, width) + paths.strayed(q, width)
                self.one[k], self.other[k], self.within[k] = p, q, (reach + off + ti.sqrt(approach)) ** 2
                tree.clear[p] = ti.min(tree.clear[p], 0.5 * reach)
                tree.clear[q] = ti.min(tree.clear[q], 0.5 * reach)
            self.nearest.take_cells(points, self.one, self.other, width)
            faces = self.find_faces(points, paths, width, count, faces)
            edges = self.find_edges(points, paths, width, count, edges)
        self.end(FACES, faces, width)
        self.end(EDGES, edges, width)

    @routine
    def end(self, kind: Int, found: Int, width: Int):
        """Of the pairs of a kind."""
        self.pairs.close(kind, found, ti.Vector([0, 1, width, width + 1]))

    @ti.func
    def any_within(self):
        """Whether any of what is looked at is near enough: most are not, and directions take half of the time."""
        apart = load(self.nearest.square, 0) - load(self.within, 0)
        return apart.min() < 0.0  # pyright: ignore[reportOptionalCall]

    @routine
    def find_faces(self, points: Template, paths: Template, width: Int, count: Int, begin: Int) -> Int:
        """Of the pairs of cells at hand: the point of each against both faces of the other."""
        found = begin
        for turn in range(4):
            half = turn % 2
            p, q = ti.select(turn < 2, 0, CORNERS), ti.select(turn < 2, CORNERS, 0)
            self.nearest.take_corners(p, q, q + ti.select(half == 0, 1, 3), q + ti.select(half == 0, 3, 2))
            self.nearest.of_faces()
            some = 0
            if self.any_within():
                self.nearest.part(FACES)
                some = count
            for lane in range(some):
                if self.nearest.square[lane] < self.within[lane]:
                    a, b = self.one[lane], self.other[lane]
                    if turn >= 2:
                        a, b = b, a
                    if self.asks_face(points, paths, a, b, half):
                        found = self.keep_face(points, width, a, b, half, self.found_normal(lane), found)
        return found

    @ti.func
    def found_normal(self, lane):
        return ti.Vector([self.nearest.normal[axis][lane] for axis in ti.static(range(3))])

    @ti.func
    def corner_of(self, b, half, k: Template):
        """Element of corner k of a face of cell b, the first or second half."""
        return b + self.face_offset[half, k]

    @ti.func
    def asks_face(self, points: Template, paths: Template, a, b, half):
        """Whether the point of cell a and a face of cell b are there, and no two of their points are one."""
        out = self.owns(paths, a, POINT) and self.owns(paths, b, CELL)
        for k in ti.static(range(3)):
            out = out and self.differ(points, a, self.corner_of(b, half, k))
        return out

    @ti.func
    def keep_face(self, points: Template, width, a, b, half, n, at):
        """That pair, as the next of its kind; see `keep`."""
        kept = self.kept_apart(points, width, a, b)
        sewn, beside = self.across(points, width, a, b)
        corners = a, self.corner_of(b, half, 0), self.corner_of(b, half, 1), self.corner_of(b, half, 2)
        return self.keep(FACES, at, n, kept, 1.0, corners, a, b, sewn, beside)

    @routine
    def find_edges(self, points: Template, paths: Template, width: Int, count: Int, begin: Int) -> Int:
        """Of the pairs of cells at hand: three edges of one against three of the other."""
        found = begin
        for turn in range(9):
            e, f = turn // 3, turn % 3
            self.nearest.take_corners(0, e + 1, CORNERS, CORNERS + f + 1)
            self.nearest.of_edges()
            some = 0
            if self.any_within():
                self.nearest.part(EDGES)
                some = count
            for lane in range(some):
                if self.nearest.square[lane] < self.within[lane]:
                    a, b = self.one[lane], self.other[lane]
                    if self.asks_edge(points, paths, a, b, e, f):
                        found = self.keep_edge(points, paths, width, a, b, e, f, self.found_normal(lane), found)
        return found

    @ti.func
    def end_of(self, a, e, k: Template):
        """Element of an end of edge e of cell a."""
        return a + self.edge_offset[e, k]

    @ti.func
    def asks_edge(self, points: Template, paths: Template, a, b, e, f):
        """Whether edges e and f of cells a and b are there, and no two of their ends are one."""
        bits = ti.Vector([EAST, NORTH, CELL])
        out = self.owns(paths, a, bits[e]) and self.owns(paths, b, bits[f])
        for k in ti.static(range(4)):
            out = out and self.differ(points, self.end_of(a, e, k // 2), self.end_of(b, f, k % 2))
        return out

    @ti.func
    def keep_edge(self, points: Template, paths: Template, width, a, b, e, f, n, at):
        """Those two, as the next pair of their kind; see `keep`."""
        rims, share = ti.Vector([RIM_EAST, RIM_NORTH, 0]), 1.0
        kept = self.kept_apart(points, width, a, b)
        # A rim bears what hangs over it: no point of that is above a face.
        if (paths.has[a] & rims[e]) | (paths.has[b] & rims[f]) == 0:
            share = self.edge_share[None]
        sewn, beside = self.across(points, width, a, b)
        ends = self.end_of(a, e, 0), self.end_of(a, e, 1), self.end_of(b, f, 0), self.end_of(b, f, 1)
        return self.keep(EDGES, at, n, share * kept, share, ends, a, b, sewn, beside)
