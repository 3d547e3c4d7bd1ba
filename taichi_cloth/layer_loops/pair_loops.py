"""Near pairs of points and faces and of edges, all pairs of cells at once (`layers/near_pairs.py` has what they are).

Each pair of cells says first how many it has; then all are put down, in the order of the cells: the list does not
depend on which thread came first.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.layer_loops.places import Places, turns
from taichi_cloth.layer_loops.search_loops import SearchLoops
from taichi_cloth.layers.nearest import EDGES, FACES, nearest_of_edges, nearest_on_face, parting
from taichi_cloth.layers.outline import MEETS
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT

__all__ = ["PairLoops", "nearest_of", "parting_of", "place_of"]

OF_FACES, OF_EDGES = 4, 9
"""Points with faces, and edges with edges, of two cells."""


@ti.func
def place_of(points: Template, p):
    return ti.Vector([points.position[axis][p] for axis in ti.static(range(3))])


@ti.func
def nearest_of(kind, i, j, k, m):
    """Of a point and a face, or of the ends of two edges: where they are nearest on the second, or along both, the way
    from the second to the first, and whether that is inside the face, in one vector of six."""
    out = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    if kind == FACES:
        s, t, x, y, z, inside = nearest_on_face(i - j, k - j, m - j)
        out = ti.Vector([s, t, x, y, z, ti.select(inside, 1.0, 0.0)])
    else:
        s, t, x, y, z = nearest_of_edges(i - k, j - i, m - k)
        out = ti.Vector([s, t, x, y, z, 1.0])
    return out


@ti.func
def parting_of(kind, i, j, k, m, found):
    """What parts them, found by `nearest_of`: a unit vector, and how far they are beyond each other along it."""
    x, y, z, beyond = parting(kind, j - i, k - i, m - i, (found[2], found[3], found[4]))
    return ti.Vector([x, y, z, beyond])


@ti.data_oriented
class PairLoops:
    """search: the cells at hand. bits: of each pair of cells, which of its parts are near pairs. cells: how many are
    asked; of garments behind the pairs also each cell with itself, see `PieceLoops`."""

    def __init__(self, search: SearchLoops, *, sewn: bool) -> None:
        self.search, self.points, self.near = search, search.points, search.points.near
        self.many, self.count, self.row = search.many, search.count, search.row
        room = search.room + (search.count if sewn else 0)
        self.bits, self.cells = ti.field(ti.i32, room), ti.field(ti.i32, ())
        self.faces: Any = Places(room, self.cells)
        self.edges: Any = Places(room, self.cells)

    @ti.func
    def ask_all(self):
        """Loops: how many each pair of cells has."""
        for p in range(self.count):
            for axis in ti.static(range(3)):
                self.near.bend_at(self.points, self.points.paths, axis, p, self.row)
        for p in range(self.count):
            for axis in ti.static(range(3)):
                self.near.bulge_at(axis, p, self.row)
        for t in range(self.many):
            if t == 0:
                self.cells[None] = self.search.pairs()
            for turn in range(turns(self.search.pairs(), t, self.many)):
                self.ask(t + turn * self.many)

    @ti.func
    def keep_all(self):
        """Loops: their list. In a kernel of its own: with both in one Taichi writes code for Vulkan that is wrong."""
        self.faces.sum_up()
        self.edges.sum_up()
        for t in range(self.many):
            if t == 0:
                self.end()
            for turn in range(turns(self.search.pairs(), t, self.many)):
                self.keep(t + turn * self.many)

    @ti.func
    def behind(self, pair):
        """Places of the first of faces and of edges behind those that two cells have as a whole."""
        faces, edges = self.faces.of[pair], self.edges.of[pair]
        for turn in range(OF_FACES):
            faces += (self.bits[pair] >> turn) & 1
        for turn in range(OF_EDGES):
            edges += (self.bits[pair] >> (OF_FACES + turn)) & 1
        return faces, edges

    @ti.func
    def end(self):
        """How many there are of either kind."""
        pairs = self.near.pairs
        for kind, total in ti.static(((FACES, self.faces.total), (EDGES, self.edges.total))):
            pairs.count[kind] = ti.min(total[None], pairs.room(kind))

    @ti.func
    def ask(self, pair):
        """Which parts of two cells are near each other."""
        p, q = self.search.cells_of(pair)
        reach = self.points.reach[None]
        approach = 0.0
        for axis in ti.static(range(3)):
            slow, fast = ti.static(self.search.tree.low[axis + 3], self.search.tree.high[axis + 3])
            approach += ti.max(fast[p] - slow[q], fast[q] - slow[p]) ** 2
        within, bits, faces, edges = (reach + ti.sqrt(approach)) ** 2, 0, 0, 0
        edges_of = ti.Vector([EAST, NORTH, CELL])
        if not self.near.tangled(p, q):
            for turn in range(OF_FACES):
                a, b = ti.select(turn < 2, p, q), ti.select(turn < 2, q, p)
                at = self.of_face(a, b, turn % 2)
                asked = self.owns(a, POINT) and self.owns(b, CELL)
                for k in ti.static(range(1, 4)):
                    asked = asked and self.differ(a, at[k])
                if asked and self.square(FACES, at) < within:
                    bits |= 1 << turn
                    faces += 1
            for turn in range(OF_EDGES):
                e, f = turn // 3, turn % 3
                at, asked = self.of_edges(p, q, e, f), self.owns(p, edges_of[e]) and self.owns(q, edges_of[f])
                for k in ti.static(range(4)):
                    asked = asked and self.differ(at[k // 2], at[2 + k % 2])
                if asked and self.square(EDGES, at) < within:
                    bits |= 1 << (OF_FACES + turn)
                    edges += 1
        self.bits[pair], self.faces.of[pair], self.edges.of[pair] = bits, faces, edges

    @ti.func
    def owns(self, p, bit):
        """Whether cell p has that, and meets others with it as a whole."""
        return (self.points.paths.has[p] & (bit << MEETS)) != 0

    @ti.func
    def differ(self, p, q):
        """Whether two elements are not one."""
        return self.points.pieces.label[p] != self.points.pieces.label[q]

    @ti.func
    def of_face(self, a, b, half):
        """Elements of the point of cell a and a face of cell b."""
        near = self.near
        return ti.Vector([a, near.corner_of(b, half, 0), near.corner_of(b, half, 1), near.corner_of(b, half, 2)])

    @ti.func
    def of_edges(self, a, b, e, f):
        """Elements of the ends of edge e of cell a and edge f of cell b."""
        near = self.near
        return ti.Vector([near.end_of(a, e, 0), near.end_of(a, e, 1), near.end_of(b, f, 0), near.end_of(b, f, 1)])

    @ti.func
    def square(self, kind, at):
        """How near elements `at` are, squared [m²]."""
        i, j = place_of(self.points, at[0]), place_of(self.points, at[1])
        found = nearest_of(kind, i, j, place_of(self.points, at[2]), place_of(self.points, at[3]))
        return found[2] ** 2 + found[3] ** 2 + found[4] ** 2

    @ti.func
    def settle(self, kind, number, end, at):
        """Pair `number` of a kind, of elements `at`, where it was noted: they are up to `end`."""
        if number < end:
            i, j = place_of(self.points, at[0]), place_of(self.points, at[1])
            k, m = place_of(self.points, at[2]), place_of(self.points, at[3])
            self.near.settle(
                self.near.pairs.first(kind) + number, parting_of(kind, i, j, k, m, nearest_of(kind, i, j, k, m))
            )

    @ti.func
    def keep(self, pair):
        """The near pairs of two cells."""
        p, q = self.search.cells_of(pair)
        bits, found = self.bits[pair], self.faces.of[pair]
        has, seams, panel = ti.static(self.points.paths.has, self.points.pieces.cell_seam, self.near.panel)
        up, along = p // self.row - q // self.row, p % self.row - q % self.row
        kept, beside = self.near.known_apart(up, along, panel[p], panel[q])
        sewn = seams[p] + seams[q]
        for turn in range(OF_FACES):
            if (bits >> turn) & 1 != 0:
                a, b = ti.select(turn < 2, p, q), ti.select(turn < 2, q, p)
                before = found
                found = self.near.note_face(found, a, b, turn % 2, kept, sewn, beside)
                self.settle(FACES, before, found, self.of_face(a, b, turn % 2))
        found = self.edges.of[pair]
        for turn in range(OF_EDGES):
            if (bits >> (OF_FACES + turn)) & 1 != 0:
                e, f = turn // 3, turn % 3
                before = found
                found = self.near.note_edges(found, p, q, e, f, has[p], has[q], kept, sewn, beside)
                self.settle(EDGES, before, found, self.of_edges(p, q, e, f))
