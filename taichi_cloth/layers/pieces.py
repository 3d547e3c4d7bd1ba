"""Near pairs of pieces of cells, of those pairs of cells of which at least one has pieces."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, Float, I32x2, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.layers.near_pairs import NEAR_SEAMS
from taichi_cloth.layers.nearest import EDGES, FACES, gather
from taichi_cloth.layers.outline import BEYOND, MEETS, PIECES
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.search import element
from taichi_cloth.layers.tree import NONE
from taichi_cloth.motion.stencil import load
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Pieces"]

QUEUE, ROOM = 4096, 1024
"""Pairs that wait to be looked at, and room that is left for those of two more cells."""


@ti.data_oriented
class Pieces:
    """first: (3, elements + 1), where the points, faces and threads of a cell's pieces begin; point, face, edge: of
    them; some: above 0 where there are any. label: of each element: those of one number are one. panel: from 1. flat,
    seam: see `Outline`. cell_seam: the least of a cell. queue: [corner], of pairs that wait. cell: [side], of them.
    within: how near they are to be, squared [m²].

    Corners that have become one with others, as where they are sewn, lie beyond the cells that they are corners of, and
    are blends of other key points.
    now, pace, off: of each blend, as of `Paths`. spent: 1 of those of which anything gets a new path. clear: how far
    they may be off [m]. beyond: how far any of a cell's are off, at most [m]."""

    waiting: Any
    some: Any
    first: Any

    def __init__(self, size: int, blends: int) -> None:
        elements, lists = size + blends, 6 * blends
        self.first = ti.field(ti.i32, (3, size + 1))
        self.point = ti.field(ti.i32, lists)
        self.face, self.edge = ([ti.field(ti.i32, lists) for _ in range(n)] for n in (3, 2))
        self.label, self.panel = (ti.field(ti.i32, elements) for _ in range(2))
        self.flat = [ti.field(ti.f32, elements) for _ in range(2)]
        self.seam, self.cell_seam = ti.field(ti.f32, elements), ti.field(ti.f32, size)
        self.queue = [ti.field(ti.i32, QUEUE + LANES) for _ in range(4)]
        self.within = ti.field(ti.f32, QUEUE + LANES)
        self.cell = [ti.field(ti.i32, QUEUE) for _ in range(2)]
        self.waiting, self.some = (ti.field(ti.i32, ()) for _ in range(2))
        self.now, self.pace = ([ti.field(ti.f32, blends) for _ in range(3)] for _ in range(2))
        self.off, self.clear = ti.field(ti.f32, blends), ti.field(ti.f32, blends)
        self.spent, self.beyond = ti.field(ti.i32, blends), ti.field(ti.f32, size)

    @ti.func
    def take(self, first: I32x2, points: I32x2, faces: I32x2, edges: I32x2, elements: F32x2):
        """Loops. elements: (6, …), label, flat, seam, the seam of cells, panel."""
        last = first.shape[1] - 1
        self.some[None] = ti.max(first[0, last], first[1, last], first[2, last])
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(first.shape[1]):
            for k in ti.static(range(3)):
                self.first[k, p] = first[k, p]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(points.shape[1]):
            self.point[k] = points[0, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(faces.shape[1]):
            for c in ti.static(range(3)):
                self.face[c][k] = faces[c, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(edges.shape[1]):
            for c in ti.static(range(2)):
                self.edge[c][k] = edges[c, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(elements.shape[1]):
            self.label[p] = ti.cast(elements[0, p], ti.i32)
            self.flat[0][p], self.flat[1][p], self.seam[p] = elements[1, p], elements[2, p], elements[3, p]
            self.panel[p] = ti.cast(elements[5, p], ti.i32)
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(self.cell_seam.shape[0]):
            self.cell_seam[p] = elements[4, p]

    @routine
    def reach(self, points: Template, paths: Template, tree: Template, ahead: Float):
        """After `Tree.cells`: boxes of cells go round corners beyond them, and what their paths follow from is a
        part of them. ahead: substeps until the horizon."""
        for k in range(points.blends.count[None]):
            self.expect(points, paths, k, ahead)
        for p in range(self.cells(paths)):
            if (paths.has[p] & BEYOND) != 0:
                self.reach_corners(points, tree, p)

    @ti.func
    def expect(self, points: Template, paths: Template, k, ahead):
        """Where blend k is by the paths of what it consists of, and how it goes on."""
        self.clear[k], self.spent[k], off = NONE, 0, ti.Vector([0.0, 0.0, 0.0])
        now, pace = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        for m in range(points.blends.start[k], points.blends.start[k + 1]):
            q, w = points.blends.node[m], points.blends.weight[m]
            self.spent[k] = self.spent[k] | paths.spent[q]
            for axis in ti.static(range(3)):
                now[axis] += w * paths.now[axis][q]
                pace[axis] += w * paths.pace[axis][q]
                off[axis] += w * paths.off[axis][q]
        self.off[k] = off.norm()  # pyright: ignore[reportOptionalCall]
        for axis in ti.static(range(3)):
            self.now[axis][k], self.pace[axis][k] = now[axis], ahead * pace[axis]

    @ti.func
    def reach_corners(self, points: Template, tree: Template, p):
        """The box of cell p round all corners of its pieces that are blends."""
        self.beyond[p] = 0.0
        for f in range(self.first[1, p], self.first[1, p + 1]):
            for corner in ti.static(range(3)):
                k = points.blends.of[self.face[corner][f]]
                if k >= 0:
                    self.reach_to(tree, p, k)

    @ti.func
    def cells(self, paths: Template):
        """How many there are to look for pieces of."""
        return ti.select(self.some[None] > 0, paths.count[None] * LANES, 0)

    @ti.func
    def reach_to(self, tree: Template, p, k):
        """The box of cell p round blend k."""
        for axis in ti.static(range(3)):
            for bound, at in ti.static(((axis, self.now[axis]), (axis + 3, self.pace[axis]))):
                tree.low[bound][p] = ti.min(tree.low[bound][p], at[k])
                tree.high[bound][p] = ti.max(tree.high[bound][p], at[k])
        self.beyond[p] = ti.max(self.beyond[p], self.off[k])
        if self.spent[k] != 0:
            tree.stale[p], tree.clear[p], tree.slack[p] = 1, NONE, NONE

    @routine
    def settle(self, points: Template, paths: Template, tree: Template):
        """After `Tree.settle`: key points have no more room than the cells have of which they carry corners."""
        for p in range(self.cells(paths)):
            if (paths.has[p] & BEYOND) != 0:
                for f in range(self.first[1, p], self.first[1, p + 1]):
                    for corner in ti.static(range(3)):
                        k = points.blends.of[self.face[corner][f]]
                        if k >= 0:
                            self.clear[k] = ti.min(self.clear[k], tree.clear[p])
        for k in range(points.blends.count[None]):
            for m in range(points.blends.start[k], points.blends.start[k + 1]):
                q = points.blends.node[m]
                paths.room[q] = ti.max(paths.room[q], 1.0 / (self.clear[k] * self.clear[k]))

    @ti.func
    def strayed(self, paths: Template, p):
        """How far corners of cell p and of its pieces are off, at most [m]."""
        return ti.max(paths.astray[p], ti.select((paths.has[p] & BEYOND) != 0, self.beyond[p], 0.0))

    @routine
    def find(self, points: Template, paths: Template, tree: Template, search: Template, near: Template, reach: Float):
        """After `NearPairs.find`: the same of pieces, behind what that has found."""
        width, self.waiting[None] = points.row[None], 0
        for kind in range(FACES, ti.select(self.some[None] > 0, EDGES + 1, FACES)):
            total = search.count[0]
            for pair in range(total):
                p, q = element(search.one[0, pair], width), element(search.other[0, pair], width)
                if ((paths.has[p] | paths.has[q]) & PIECES) != 0:
                    approach = 0.0
                    for axis in ti.static(range(3)):
                        slow, fast = ti.static(tree.low[axis + 3], tree.high[axis + 3])
                        approach += ti.max(fast[p] - slow[q], fast[q] - slow[p], 0.0) ** 2
                    off = self.strayed(paths, p) + self.strayed(paths, q)
                    within = (reach + off + ti.sqrt(approach)) ** 2
                    if kind == FACES:
                        self.ask_faces(paths, near, p, q, within)
                        self.ask_faces(paths, near, q, p, within)
                    else:
                        self.ask_edges(paths, near, p, q, within)
                if self.waiting[None] > QUEUE - ROOM:
                    self.answer(points, near, kind)
            for p in range(paths.count[None] * LANES):
                if (paths.has[p] & PIECES) != 0 and tree.stale[p] != 0:
                    self.ask_own(paths, tree, near, p, reach, kind)
                if self.waiting[None] > QUEUE - ROOM:
                    self.answer(points, near, kind)
            self.answer(points, near, kind)

    @ti.func
    def ask_own(self, paths: Template, tree: Template, near: Template, p, reach, kind):
        """Pieces of cell p with each other: corners that became one with others are in the plane of none of them."""
        approach = 0.0
        for axis in ti.static(range(3, 6)):
            approach += (tree.high[axis][p] - tree.low[axis][p]) ** 2
        tree.clear[p] = ti.min(tree.clear[p], 0.5 * reach)
        within = (reach + 2.0 * self.strayed(paths, p) + ti.sqrt(approach)) ** 2
        if kind == FACES:
            self.ask_faces(paths, near, p, p, within)
        else:
            self.ask_edges(paths, near, p, p, within)

    @ti.func
    def ask(self, near: Template, i, j, k, m, p, q, within):
        """One more waits, of cells p and q."""
        at = self.waiting[None]
        if at < QUEUE:
            self.queue[0][at], self.queue[1][at], self.queue[2][at], self.queue[3][at] = i, j, k, m
            self.within[at], self.cell[0][at], self.cell[1][at] = within, p, q
            self.waiting[None] = at + 1
        else:
            near.overflow[None] = near.overflow[None] + 1

    @routine
    def ask_faces(self, paths: Template, near: Template, p: Int, q: Int, within: Float):
        """Points of cell p with faces of cell q, where at least one is of a piece, and no two points are one."""
        points, faces = self.first[0, p], self.first[1, q]
        point_count, face_count = self.first[0, p + 1] - points, self.first[1, q + 1] - faces
        of_point = (paths.has[p] & (POINT << MEETS)) != 0
        of_cell = (paths.has[q] & (CELL << MEETS)) != 0
        for u in range(-1, point_count):
            v = p
            if u >= 0:
                v = self.point[points + u]
            if u >= 0 or of_point:
                for f in range(-2, face_count):
                    if (u >= 0 or f >= 0) and (f >= 0 or of_cell):
                        i, j, k = q, q, q
                        if f >= 0:
                            i, j, k = self.face[0][faces + f], self.face[1][faces + f], self.face[2][faces + f]
                        else:
                            i += near.face_offset[f + 2, 0]
                            j += near.face_offset[f + 2, 1]
                            k += near.face_offset[f + 2, 2]
                        own = self.label[v]
                        if own != self.label[i] and own != self.label[j] and own != self.label[k]:
                            self.ask(near, v, i, j, k, p, q, within)

    @ti.func
    def thread(self, near: Template, p, e, first):
        """Ends of thread e of cell p: of its pieces from 0, of what it has as a whole from −3."""
        i, j = p, p
        if e >= 0:
            i, j = self.edge[0][first + e], self.edge[1][first + e]
        else:
            i += near.edge_offset[e + 3, 0]
            j += near.edge_offset[e + 3, 1]
        return i, j

    @routine
    def ask_edges(self, paths: Template, near: Template, p: Int, q: Int, within: Float):
        """Threads of cell p with threads of cell q, likewise."""
        one, other = self.first[2, p], self.first[2, q]
        one_count, other_count = self.first[2, p + 1] - one, self.first[2, q + 1] - other
        bits = ti.Vector([EAST << MEETS, NORTH << MEETS, CELL << MEETS])
        for e in range(-3, one_count):
            there = e >= 0
            if not there:
                there = (paths.has[p] & bits[e + 3]) != 0
            if there:
                i, j = self.thread(near, p, e, one)
                first, second = self.label[i], self.label[j]
                for f in range(ti.select(p == q, e + 1, -3), other_count):
                    beside = f >= 0
                    if not beside:
                        beside = e >= 0 and (paths.has[q] & bits[f + 3]) != 0
                    if beside:
                        k, m = self.thread(near, q, f, other)
                        third, fourth = self.label[k], self.label[m]
                        if first != third and first != fourth and second != third and second != fourth:
                            self.ask(near, i, j, k, m, p, q, within)

    @ti.func
    def waiting_lanes(self):
        """How many packets wait; whole lanes, of the last one again."""
        count = self.waiting[None]
        for k in range(LANES):
            for corner in ti.static(range(4)):
                self.queue[corner][count + k] = self.queue[corner][ti.max(count - 1, 0)]
            self.within[count + k] = -1.0
        return (count + LANES - 1) // LANES

    @routine
    def answer(self, points: Template, near: Template, kind: Int):
        """Those that wait and are near enough, as pairs."""
        known = near.pairs.count[kind]
        found = known
        for group in range(self.waiting_lanes()):
            at = ti.Vector([group * LANES + k for k in ti.static(range(LANES))])
            i, j = gather(self.queue[0], at), gather(self.queue[1], at)
            near.nearest.take(points, i, j, gather(self.queue[2], at), gather(self.queue[3], at))
            near.nearest.find(kind)
            some, apart = 0, load(near.nearest.square, 0) - gather(self.within, at)
            if apart.min() < 0.0:  # pyright: ignore[reportOptionalCall]
                some = LANES
            for k in range(some):
                w = group * LANES + k
                if near.nearest.square[k] < self.within[w]:
                    corners = ti.Vector([self.queue[corner][w] for corner in ti.static(range(4))])
                    found = self.note(near, kind, found, corners, self.cell[0][w], self.cell[1][w])
        near.part(points, kind, known, found)
        near.end(kind, found, points.row[None])
        self.waiting[None] = 0

    @ti.func
    def note(self, near: Template, kind, found, corners, p, q):
        """Those corners of pieces of cells p and q, as the next pair of their kind. Returns how many there are."""
        a, b, c, d = corners[0], corners[1], corners[2], corners[3]
        kept, share, flat, sewn = 0.0, 1.0, 0.0, 0.0
        if kind == FACES:
            flat = ti.min(self.beside(a, b, c), ti.min(self.beside(a, c, d), self.beside(a, d, b)))
            sewn = self.seam[a] + ti.min(self.seam[b], ti.min(self.seam[c], self.seam[d]))
            kept = self.kept_apart(near, a, b, flat)
        else:
            one, other = ti.min(self.beside(a, c, d), self.beside(b, c, d)), self.beside(c, a, b)
            flat = ti.min(one, ti.min(other, self.beside(d, a, b)))
            sewn = ti.min(self.seam[a], self.seam[b]) + ti.min(self.seam[c], self.seam[d])
            kept = self.kept_apart(near, a, c, flat)
            share = near.edge_share[None]
        kept *= share
        beside = ti.select(near.panel[p] == near.panel[q] and flat < sewn, 1, 0)
        return near.note(kind, found, share, (a, b, c, d), p, q, kept, sewn, beside)

    @routine
    def beside(self, p: Int, i: Int, j: Int) -> Float:
        """How far point p is from the thread from i to j in the flat sheet [m]."""
        a = ti.Vector([self.flat[0][i], self.flat[1][i]])
        b = ti.Vector([self.flat[0][j], self.flat[1][j]]) - a
        c = ti.Vector([self.flat[0][p], self.flat[1][p]]) - a  # pyright: ignore[reportOptionalCall]
        share = ti.min(ti.max(b.dot(c) / (b.norm_sqr() + 1e-20), 0.0), 1.0)  # pyright: ignore[reportOptionalCall]
        return (c - share * b).norm()  # pyright: ignore[reportOptionalCall]

    @ti.func
    def kept_apart(self, near: Template, p, q, flat):
        """How far parts of panels are kept apart: as `NearPairs.kept_apart` of cells."""
        out = near.thickness[None]
        if self.panel[p] == self.panel[q]:
            out = ti.min(near.in_fold(flat, out), 0.5 * flat)
        return ti.max(out, NEAR_SEAMS)
