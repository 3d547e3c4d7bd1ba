"""Points near faces and edges near edges, of the pairs of cells that a search has left: each with a direction that
parts them, the unit vector between their nearest places."""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.nearest import CORNERS, EDGES, FACES, Nearest, Pairs, gather
from taichi_cloth.layers.outline import MEETS, RIM_EAST, RIM_NORTH
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.search import COLUMNS, PLACES, element
from taichi_cloth.layers.search import ROOM as CELL_ROOM
from taichi_cloth.motion.stencil import listed, load, load_xyz, near, nothing, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["BESIDE", "NEAR_SEAMS", "NearPairs"]

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

ONE, OTHER, HAS, LABEL, BESIDE_EACH, MET, CELLS = (LANES * k for k in (0, 1, 2, 4, 12, 13, 14))
"""Places in `NearPairs.cells`: elements of the cells; what both have; labels of the corners of both; whether they are
nearer in the flat sheet than by way of a seam; which of them are near enough. Fields are few: Taichi has 1,024."""

WITHIN, KEPT, SEWN, ASKED = (LANES * k for k in range(4))
"""Places in `NearPairs.asked`: how near parts are looked at, squared [m²]; how far they are kept apart, and how far
they are from each other by way of a seam [m]."""

LET_OFF = 1 << 24
"""Tangle of what is let off within a frame, beyond all others."""

BESIDE = 16
"""More than as many cells as neighbours may be apart that are not tangled for being of one tangle."""


@ti.data_oriented
class NearPairs:
    """pairs: all of them. nearest: looks at eight. thickness [m]. most: that is kept where cloth is bent [m]. bulge:
    [axis], how far smooth cloth stands out of the middle of each cell [m]. panel: of each element, 0 where there is
    none: only within a panel are neighbours let nearer than the thickness. tangle: of each cell, see `tangles.py`.
    cells, asked: of the eight pairs of cells at hand, by lanes, see `HAS` and `WITHIN`. overflow: pairs without
    room."""

    def __init__(self, size: int) -> None:
        self.pairs, self.nearest = Pairs(FACE_ROOM * size, EDGE_ROOM * size), Nearest()
        self.thickness, self.edge_share = ti.field(ti.f32, ()), ti.field(ti.f32, ())
        self.spacing, self.most = ti.field(ti.f32, 2), ti.field(ti.f32, ())
        self.bulge, self._bent = ([ti.field(ti.f32, size) for _ in range(3)] for _ in range(2))
        self.panel, self.tangle = ti.field(ti.i32, size), ti.field(ti.i32, size)
        # Elements from a cell's own to the corners of its faces, and to the ends of its edges.
        self.face_offset, self.edge_offset = ti.field(ti.i32, (2, 3)), ti.field(ti.i32, (3, 2))
        self.cells, self.asked = ti.field(ti.i32, CELLS), ti.field(ti.f32, ASKED)
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
    def in_fold(self, flat, kept):
        """How far what is so far apart in the flat sheet is kept apart: no fold is tighter than key points follow."""
        return ti.select(flat < self.folded(), ti.max(kept, self.most[None]), kept)

    @routine
    def know(self, points: Template, paths: Template, tree: Template, search: Template, group: Int, reach: Float):
        """Of eight pairs of cells at hand all that is asked of them below. Behind the last one is that again, and
        nothing near it."""
        width, total = points.row[None], search.count[0]
        number = ti.Vector([group * LANES + k for k in ti.static(range(LANES))])
        at = ti.min(number, total - 1)
        one = ti.Vector([search.one[0, at[k]] for k in ti.static(range(LANES))])  # pyright: ignore[reportIndexIssue]
        other = ti.Vector([search.other[0, at[k]] for k in ti.static(range(LANES))])  # pyright: ignore[reportIndexIssue]
        p, q = element(one, width), element(other, width)
        store(self.cells, ONE, p)
        store(self.cells, OTHER, q)
        approach = ti.Vector([0.0] * LANES)
        for axis in ti.static(range(3)):
            slow, fast = ti.static(tree.low[axis + 3], tree.high[axis + 3])
            ahead = ti.max(gather(fast, p) - gather(slow, q), gather(fast, q) - gather(slow, p))
            approach += ahead * ahead
        within = reach + (gather(paths.astray, p) + gather(paths.astray, q)) + ti.sqrt(approach)
        store(self.asked, WITHIN, ti.select(number < total, within * within, -1.0))
        for k in range(LANES):
            a, b = self.cells[ONE + k], self.cells[OTHER + k]
            tree.clear[a], tree.clear[b] = ti.min(tree.clear[a], 0.5 * reach), ti.min(tree.clear[b], 0.5 * reach)
        columns = COLUMNS - 1
        up, along = (one >> PLACES) - (other >> PLACES), (one & columns) - (other & columns)
        panel, second = gather(self.panel, p), gather(self.panel, q)
        kept, beside = self.known_apart(up, along, panel, second)
        store(self.asked, KEPT, kept)
        store(self.cells, BESIDE_EACH, beside)
        store(self.asked, SEWN, gather(points.pieces.cell_seam, p) + gather(points.pieces.cell_seam, q))
        store(self.cells, HAS, gather(paths.has, p))
        store(self.cells, HAS + LANES, gather(paths.has, q))
        for corner in range(2 * CORNERS):
            place = ti.select(corner < CORNERS, p, q) + (corner & 1) + ((corner >> 1) & 1) * width
            store(self.cells, near(LABEL + corner * LANES), gather(points.pieces.label, place))

    @ti.func
    def known_apart(self, up, along, panel, second):
        """How far parts of two cells of panels (lanes) are kept apart: the thickness, or what folds are, but at most
        half of how far they are in the flat sheet. And 1 where they are nearer there than by way of a seam. up, along:
        rows and columns from one to the other."""
        up, along = ti.max(up, -up), ti.max(along, -along)
        i = ti.cast(ti.max(up - 1, 0), ti.f32) * self.spacing[1]
        j = ti.cast(ti.max(along - 1, 0), ti.f32) * self.spacing[0]
        flat, least = ti.sqrt(i * i + j * j), ti.min(self.spacing[0], self.spacing[1])
        thick = nothing() + self.thickness[None]
        folded = ti.min(self.in_fold(flat, thick), ti.max(0.5 * flat, SHALLOW * least))
        alike = panel == second
        return (
            ti.select(alike & (panel > 0), folded, thick),
            ti.select(alike & (ti.max(up, along) <= 4), 1, 0),
        )

    @ti.func
    def folded(self):
        """From one side of the tightest fold to the other, in the flat sheet [m]."""
        return FOLDED * ti.min(self.spacing[0], self.spacing[1])

    @ti.func
    def tent(self, sewn):
        """How far apart cloth is kept that is so far from each other by way of a seam: no seam folds flat."""
        return HINGE * ti.max(ti.min(sewn, self.folded() - sewn), 0.0)

    @ti.func
    def owns(self, side, bit):
        """1 where the cell on a side has that, and meets others with it as a whole."""
        return ti.select((load(self.cells, near(HAS + side * LANES)) & (bit << MEETS)) != 0, 1, 0)

    @ti.func
    def differ(self, one, other):
        """1 where two corners, of one cell from 0, of the other from CORNERS, are not one point."""
        first, second = near(LABEL + one * LANES), near(LABEL + other * LANES)
        return ti.select(load(self.cells, first) != load(self.cells, second), 1, 0)

    @ti.func
    def tangled(self, p, q):
        """Whether two cells are of layers that pass through each other: they have no sides."""
        one, width = self.tangle[p], self.face_offset[1, 2]
        far = ti.max(ti.abs(p // width - q // width), ti.abs(p % width - q % width))
        return one > 0 and one == self.tangle[q] and (far > one % BESIDE or self.panel[p] != self.panel[q])

    @ti.func
    def note(self, kind, at, share, points: Template, p, q, kept, sewn, beside):
        """One more pair of cells p and q, unless they are tangled: kept apart by `kept`, not more than a share of the
        thickness but in folds; so far from each other by way of a seam, unless nearer in the flat sheet, `beside`.
        What of it hangs on its direction is left to `settle`, and stands there what that has to know. Returns how many
        there are."""
        pairs, out, tangled = self.pairs, at, self.tangled(p, q)
        if at < pairs.room(kind) and not tangled:
            pair = pairs.first(kind) + at
            pairs.cell[0][pair], pairs.cell[1][pair] = p, q
            for corner in ti.static(range(4)):
                pairs.point[corner][pair] = points[corner]
            pairs.kept[pair], pairs.apart[pair], pairs.cap[pair] = kept, share, 0.0
            if beside == 0:
                pairs.cap[pair] = share * self.tent(ti.max(sewn, 0.5 * self.folded()))
            pairs.least[pair] = share * ti.max(0.5 * sewn, NEAR_SEAMS)
            out = at + 1
        elif not tangled:
            self.overflow[None] = self.overflow[None] + 1
        return out

    @ti.func
    def settle(self, at, normal: Template):
        """Pairs from number `at` on (lanes), which were noted, and their directions: how far cells are kept apart that
        smooth cloth through them is by what was noted. That is less than a share of the thickness beside seams, where
        more would be in the way of these."""
        pairs = self.pairs
        p, q = load(pairs.cell[0], at), load(pairs.cell[1], at)
        kept, sewn = load(pairs.kept, at), load(pairs.cap, at)
        drawn = kept
        for axis in ti.static(range(3)):
            store(pairs.normal[axis], at, normal[axis])
            drawn += normal[axis] * (gather(self.bulge[axis], q) - gather(self.bulge[axis], p))
        bent = kept >= load(pairs.apart, at) * self.thickness[None]
        cap = ti.min(ti.max(ti.select(bent, drawn, kept), kept), ti.max(kept, self.most[None]))
        store(pairs.cap, at, cap)
        store(pairs.kept, at, ti.max(cap, sewn))
        store(pairs.least, at, ti.min(PARTED, SHARE * ti.min(cap, load(pairs.least, at))))

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
        horizon, behind those that are known. First they are listed, then looked at by whole lanes: most cells at hand
        share a corner, and no parts of them are near each other that do not."""
        width, faces, edges = points.row[None], self.pairs.count[FACES], self.pairs.count[EDGES]
        known_faces, known_edges = faces, edges
        for group in range((search.count[0] + LANES - 1) // LANES):
            self.know(points, paths, tree, search, group, reach)
            self.nearest.take_cells(points, self.cells, width)
            faces = self.list_faces(faces)
            edges = self.list_edges(edges)
        self.part(points, FACES, known_faces, faces)
        self.part(points, EDGES, known_edges, edges)
        self.end(FACES, faces, width)
        self.end(EDGES, edges, width)

    @routine
    def end(self, kind: Int, found: Int, width: Int):
        """Of the pairs of a kind."""
        self.pairs.close(kind, found, ti.Vector([0, 1, width, width + 1]))

    @ti.func
    def near_enough(self, may):
        """Whether any of what is looked at is that, of those that may be; which ones, see `MET`."""
        may = ti.select(load(self.nearest.square, 0) < load(self.asked, WITHIN), may, 0)
        store(self.cells, MET, may)
        return may.max() != 0  # pyright: ignore[reportOptionalCall]

    @routine
    def list_faces(self, begin: Int) -> Int:
        """Of the pairs of cells at hand: the point of each against both faces of the other."""
        found = begin
        for turn in range(4):
            half, back = turn % 2, turn // 2
            p, q = back * CORNERS, (1 - back) * CORNERS
            i, j = q + ti.select(half == 0, 1, 3), q + ti.select(half == 0, 3, 2)
            may = self.differ(p, q) & self.differ(p, i) & self.differ(p, j)
            may &= self.owns(back, POINT) & self.owns(1 - back, CELL)
            self.nearest.take_corners(p, q, i, j)
            self.nearest.of_faces()
            if self.near_enough(may):
                for k in range(LANES):
                    if self.cells[MET + k] != 0:
                        a, b = self.cells[ONE + k], self.cells[OTHER + k]
                        if back == 1:
                            a, b = b, a
                        kept, sewn, beside = self.how_apart(k)
                        found = self.note_face(found, a, b, half, kept, sewn, beside)
        return found

    @ti.func
    def how_apart(self, k):
        """Of what is at hand in lane k, see `note`."""
        return self.asked[KEPT + k], self.asked[SEWN + k], self.cells[BESIDE_EACH + k]

    @ti.func
    def corner_of(self, b, half, k: Template):
        """Element of corner k of a face of cell b, the first or second half."""
        return b + self.face_offset[half, k]

    @ti.func
    def note_face(self, at, a, b, half, kept, sewn, beside):
        """The point of cell a and a face of cell b; see `note`."""
        corners = a, self.corner_of(b, half, 0), self.corner_of(b, half, 1), self.corner_of(b, half, 2)
        return self.note(FACES, at, 1.0, corners, a, b, kept, sewn, beside)

    @routine
    def list_edges(self, begin: Int) -> Int:
        """Of the pairs of cells at hand: three edges of one against three of the other."""
        found, bits = begin, ti.Vector([EAST, NORTH, CELL])
        for turn in range(9):
            e, f = turn // 3, turn % 3
            i, j, far = e + 1, CORNERS + f + 1, CORNERS
            may = self.differ(0, far) & self.differ(0, j) & self.differ(i, far) & self.differ(i, j)
            may &= self.owns(0, bits[e]) & self.owns(1, bits[f])
            self.nearest.take_corners(0, i, far, j)
            self.nearest.of_edges()
            if self.near_enough(may):
                for k in range(LANES):
                    if self.cells[MET + k] != 0:
                        a, b = self.cells[ONE + k], self.cells[OTHER + k]
                        has, second = self.cells[HAS + k], self.cells[HAS + LANES + k]
                        kept, sewn, beside = self.how_apart(k)
                        found = self.note_edges(found, a, b, e, f, has, second, kept, sewn, beside)
        return found

    @ti.func
    def end_of(self, a, e, k: Template):
        """Element of an end of edge e of cell a."""
        return a + self.edge_offset[e, k]

    @ti.func
    def note_edges(self, at, a, b, e, f, has, second, kept, sewn, beside):
        """Edges e and f of cells a and b, which have that; see `note`."""
        rims, share = ti.Vector([RIM_EAST, RIM_NORTH, 0]), 1.0
        # A rim bears what hangs over it: no point of that is above a face.
        if (has & rims[e]) | (second & rims[f]) == 0:
            share = self.edge_share[None]
        ends = self.end_of(a, e, 0), self.end_of(a, e, 1), self.end_of(b, f, 0), self.end_of(b, f, 1)
        return self.note(EDGES, at, share, ends, a, b, share * kept, sewn, beside)

    @routine
    def part(self, points: Template, kind: Int, begin: Int, end: Int):
        """Directions of pairs of a kind that were noted, from one number up to another."""
        pairs = self.pairs
        for packet in range((end - begin + LANES - 1) // LANES):
            at = listed(pairs.first(kind) + begin + packet * LANES)
            i, j = load(pairs.point[0], at), load(pairs.point[1], at)
            self.nearest.take(points, i, j, load(pairs.point[2], at), load(pairs.point[3], at))
            self.nearest.find(kind)
            self.nearest.part(kind)
            self.settle(at, load_xyz(self.nearest.normal, 0))
