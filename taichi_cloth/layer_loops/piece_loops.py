"""Near pairs of pieces of cells as parallel loops (`layers/pieces.py` has what they are), of garments.

A thread goes through all that two cells, of which one has pieces, or one such cell with itself, may have near each
other. What is near it notes as bits of whole numbers, in as many as that takes: so what is listed is what was counted.
"""

from typing import Any

import taichi as ti

from taichi_cloth.layer_loops.pair_loops import PairLoops
from taichi_cloth.layer_loops.places import Places, turns
from taichi_cloth.layer_loops.search_loops import bits_of
from taichi_cloth.layers.nearest import EDGES, FACES
from taichi_cloth.layers.outline import BEYOND, MEETS, PIECES
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.tree import NONE

__all__ = ["PieceLoops"]

WORD = 32
"""Bits of a whole number."""

WORDS = 32
"""Of these, for each element of the padded grid."""


@ti.data_oriented
class PieceLoops:
    """pairs: of cells, at hand; behind those each cell with itself. words: of what is near, for each of them.
    cell_of: of each face of pieces, its cell; blend_of: of each key point in the list of a blend, that blend. clear:
    of each blend, how far it may be off, and room: of each key point, 1 over the square of that [m], by their bits."""

    def __init__(self, pairs: PairLoops) -> None:
        self.pairs, self.points, self.near = pairs, pairs.points, pairs.near
        self.pieces, self.blends = pairs.points.pieces, pairs.points.blends
        self.search, self.many, self.count = pairs.search, pairs.many, pairs.count
        self.kinds, self.listed = self.blends.at.shape[0], self.blends.node.shape[0]
        self.faces = self.pieces.face[0].shape[0]
        self.cell_of, self.blend_of = ti.field(ti.i32, self.faces), ti.field(ti.i32, self.listed)
        self.clear, self.room = ti.field(ti.i32, self.kinds), ti.field(ti.i32, self.count)
        self.words: Any = ti.field(ti.i32, WORDS * self.count)
        self.places: Any = Places(pairs.search.room + self.count, pairs.cells)

    @ti.func
    def learn(self):
        """Loops: of which cell faces are, and of which blend what those consist of."""
        for p in range(self.count):
            for f in range(self.pieces.first[1, p], self.pieces.first[1, p + 1]):
                self.cell_of[f] = p
        for k in range(self.kinds):
            if k < self.blends.count[None]:
                for m in range(self.blends.start[k], self.blends.start[k + 1]):
                    self.blend_of[m] = k

    @ti.func
    def refresh(self):
        """A loop: where blends are, and their steps."""
        for k in range(self.kinds):
            if k < self.blends.count[None]:
                self.blends.refresh_one(self.points, k)

    @ti.func
    def reach(self):
        """Loops: after the boxes of cells, as `Pieces.reach`."""
        for k in range(self.kinds):
            if k < self.blends.count[None]:
                ahead = ti.cast(self.points.horizon[None], ti.f32)
                self.pieces.expect(self.points, self.points.paths, k, ahead)
        for p in range(self.count):
            if (self.points.paths.has[p] & BEYOND) != 0:
                self.pieces.reach_corners(self.points, self.points.tree, p)

    @ti.func
    def cells_of(self, pair):
        """The two cells of a pair, or one twice; how many pairs of two there are is before those."""
        pairs = self.search.pairs()
        out = ti.Vector([pair - pairs, pair - pairs])
        if pair < pairs:
            p, q = self.search.cells_of(pair)
            out = ti.Vector([p, q])
        return out

    @ti.func
    def total(self):
        return self.search.pairs() + self.count

    @ti.func
    def count_up(self):
        """Loops: places for the bits of all."""
        for t in range(self.many):
            if t == 0:
                self.pairs.cells[None] = self.total()
            for turn in range(turns(self.total(), t, self.many)):
                pair = t + turn * self.many
                at = self.cells_of(pair)
                self.places.of[pair] = (self.asked(at[0], at[1]) + WORD - 1) // WORD
        self.places.sum_up()

    @ti.func
    def ask_all(self):
        """Loops: what is near, after what cells have as a whole was asked."""
        for t in range(self.many):
            for turn in range(turns(self.total(), t, self.many)):
                self.ask(t + turn * self.many)
        for p in range(self.count):  # pieces of a cell with each other
            if (self.points.paths.has[p] & PIECES) != 0:
                self.search.clear[p] = ti.min(self.search.clear[p], bits_of(0.5 * self.points.reach[None]))

    @ti.func
    def keep_all(self):
        """Loops: as pairs, after what cells have as a whole."""
        for t in range(self.many):
            for turn in range(turns(self.total(), t, self.many)):
                self.keep(t + turn * self.many)

    @ti.func
    def of_faces(self, a, b):
        """How many points of cell a there are to be looked at with faces of cell b: of its pieces, and its own."""
        first = ti.static(self.pieces.first)
        return (first[0, a + 1] - first[0, a] + 1) * (first[1, b + 1] - first[1, b] + 2)

    @ti.func
    def of_edges(self, p):
        """How many threads cell p has at most: of its pieces, and its own."""
        return self.pieces.first[2, p + 1] - self.pieces.first[2, p] + 3

    @ti.func
    def asked(self, p, q):
        """How many pairs of parts of two cells, or of one, there are to be looked at."""
        out = 0
        if ((self.points.paths.has[p] | self.points.paths.has[q]) & PIECES) != 0:
            out = self.of_faces(p, q) + self.of_edges(p) * self.of_edges(q)
            if p != q:
                out += self.of_faces(q, p)
        return out

    @ti.func
    def part(self, p, q, c):
        """Number c of them: their elements, their kind, and 1 where they are there and no two are one point; the cells
        in order."""
        own, turned = self.of_faces(p, q), ti.select(p != q, self.of_faces(q, p), 0)
        out = ti.Vector([p, p, p, p, EDGES, 0, p, q])
        if c < own:
            out = self.face(p, q, c)
        elif c < own + turned:
            out = self.face(q, p, c - own)
        else:
            out = self.edges(p, q, c - own - turned)
        return out

    @ti.func
    def face(self, a, b, c):
        has = ti.static(self.points.paths.has)
        faces = self.pieces.first[1, b + 1] - self.pieces.first[1, b] + 2
        u, f = c // faces - 1, c % faces - 2
        v, i, j, k = a, b, b, b
        if u >= 0:
            v = self.pieces.point[self.pieces.first[0, a] + u]
        if f >= 0:
            at = self.pieces.first[1, b] + f
            i, j, k = self.pieces.face[0][at], self.pieces.face[1][at], self.pieces.face[2][at]
        else:
            i += self.near.face_offset[f + 2, 0]
            j += self.near.face_offset[f + 2, 1]
            k += self.near.face_offset[f + 2, 2]
        there = (u >= 0 or f >= 0) and (u >= 0 or (has[a] & (POINT << MEETS)) != 0)
        there = there and (f >= 0 or (has[b] & (CELL << MEETS)) != 0)
        own = self.pieces.label[v]
        there = there and own != self.pieces.label[i] and own != self.pieces.label[j] and own != self.pieces.label[k]
        return ti.Vector([v, i, j, k, FACES, ti.select(there, 1, 0), a, b])

    @ti.func
    def edges(self, p, q, c):
        has = ti.static(self.points.paths.has)
        others = self.of_edges(q)
        e, f = c // others - 3, c % others - 3
        bits = ti.Vector([EAST << MEETS, NORTH << MEETS, CELL << MEETS])
        there = (e >= 0 or f >= 0) and (p != q or f > e)
        there = there and (e >= 0 or (has[p] & bits[ti.min(e + 3, 2)]) != 0)
        there = there and (f >= 0 or (has[q] & bits[ti.min(f + 3, 2)]) != 0)
        i, j = self.pieces.thread(self.near, p, e, self.pieces.first[2, p])
        k, m = self.pieces.thread(self.near, q, f, self.pieces.first[2, q])
        one, other = self.pieces.label[i], self.pieces.label[j]
        for end in ti.static((k, m)):
            there = there and one != self.pieces.label[end] and other != self.pieces.label[end]
        return ti.Vector([i, j, k, m, EDGES, ti.select(there, 1, 0), p, q])

    @ti.func
    def ask(self, pair):
        """Which parts of two cells, or of one, are near each other."""
        at, first = self.cells_of(pair), self.places.of[pair]
        p, q = at[0], at[1]
        asked, approach = self.asked(p, q), 0.0
        if first + (asked + WORD - 1) // WORD > WORDS * self.count:
            self.near.overflow[None] = 1
            asked = 0
        if self.near.tangled(p, q):
            asked = 0
        for axis in ti.static(range(3)):
            slow, fast = ti.static(self.points.tree.low[axis + 3], self.points.tree.high[axis + 3])
            approach += ti.max(fast[p] - slow[q], fast[q] - slow[p], 0.0) ** 2
        within = (self.points.reach[None] + ti.sqrt(approach)) ** 2
        word, faces, edges = 0, 0, 0
        for c in range(asked):
            one = self.part(p, q, c)
            if one[5] != 0 and self.pairs.square(one[4], one) < within:
                word |= 1 << (c % WORD)
                if one[4] == FACES:
                    faces += 1
                else:
                    edges += 1
            if c % WORD == WORD - 1 or c == asked - 1:
                self.words[first + c // WORD] = word
                word = 0
        if p == q:
            self.pairs.bits[pair], self.pairs.faces.of[pair], self.pairs.edges.of[pair] = 0, faces, edges
        else:
            self.pairs.faces.of[pair] = self.pairs.faces.of[pair] + faces
            self.pairs.edges.of[pair] = self.pairs.edges.of[pair] + edges

    @ti.func
    def keep(self, pair):
        """Those, as near pairs."""
        at, first = self.cells_of(pair), self.places.of[pair]
        p, q = at[0], at[1]
        asked = self.asked(p, q)
        if first + (asked + WORD - 1) // WORD > WORDS * self.count or self.near.tangled(p, q):
            asked = 0
        faces, edges = self.pairs.behind(pair)
        for c in range(asked):
            if (self.words[first + c // WORD] >> (c % WORD)) & 1 != 0:
                one = self.part(p, q, c)
                corners = ti.Vector([one[k] for k in ti.static(range(4))])
                found = ti.select(one[4] == FACES, faces, edges)
                end = self.pieces.note(self.near, one[4], found, corners, one[6], one[7])
                self.pairs.settle(one[4], found, end, corners)
                if one[4] == FACES:
                    faces = end
                else:
                    edges = end

    @ti.func
    def settle(self):
        """Loops: after key points have their room, as `Pieces.settle`: they have no more than the cells of which they
        carry corners."""
        for k in range(self.kinds):
            self.clear[k] = bits_of(NONE)
        for f in range(self.faces):
            if f < self.pieces.first[1, self.count]:
                p = self.cell_of[f]
                if (self.points.paths.has[p] & BEYOND) != 0:
                    for corner in ti.static(range(3)):
                        k = self.blends.of[self.pieces.face[corner][f]]
                        if k >= 0:
                            ti.atomic_min(self.clear[k], self.search.clear[p])
        for p in range(self.count):
            self.room[p] = 0
        for m in range(self.listed):
            if m < self.blends.start[self.blends.count[None]]:
                off = ti.bit_cast(self.clear[self.blend_of[m]], ti.f32)
                ti.atomic_max(self.room[self.blends.node[m]], bits_of(1.0 / (off * off)))
        for p in range(self.count):
            self.points.paths.room[p] = ti.max(self.points.paths.room[p], ti.bit_cast(self.room[p], ti.f32))
