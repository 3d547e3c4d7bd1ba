"""Points near faces and edges near edges, of the pairs of cells that a search has left: each with a direction that
parts them, the unit vector between their nearest places."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.outline import MEETS
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.search import COLUMNS
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["EDGES", "FACES", "NearPairs", "Pairs", "apart_along", "gather", "nearest_of_edges", "nearest_on_face"]

FACES, EDGES = 1, 2
"""Kinds of pairs, and how many of their four points are on the first side: a point and a face, two edges."""

FACE_ROOM, EDGE_ROOM = 16, 48
"""Pairs, for each key point."""

NEAR_SEAMS = 8e-6
"""That pairs are kept apart at least beside a seam [m]."""

SHALLOW = 0.35
"""Share of the spacing that pairs are kept apart at least, however near they are in the flat sheet."""


@ti.func
def gather(field: Template, at):
    """Of elements `at`, one a lane."""
    return ti.Vector([field[at[k]] for k in ti.static(range(LANES))])


@ti.func
def vectors(place: Template, to, origin: Template):
    """Of elements `to`, less x, y, z."""
    return (
        gather(place[0], to) - origin[0],
        gather(place[1], to) - origin[1],
        gather(place[2], to) - origin[2],
    )


@ti.func
def dot(one: Template, other: Template):
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@ti.func
def cross(one: Template, other: Template):
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


@ti.func
def apart_along(x: Template, kind: Template, i, j, k, m, way: Template):
    """How far the first `kind` of points i, j, k, m (lanes) are beyond the others along a way."""
    origin = ti.static((0.0, 0.0, 0.0))
    a = vectors(x, i, origin)
    b, c, d = dot(vectors(x, j, a), way), dot(vectors(x, k, a), way), dot(vectors(x, m, a), way)
    out = -ti.max(b, ti.max(c, d))
    if ti.static(kind == EDGES):
        out = ti.min(b, 0.0) - ti.max(c, d)
    return out


@ti.func
def parting(x: Template, kind: Template, i, j, k, m, u: Template, v: Template, side: Template, way: Template):
    """A unit vector that parts a point i and a face, or edges i–j and k–m (lanes): `way`, or what is across u and v,
    two edges of theirs, where that parts them more: the nearest places of slivers, and of what all but touches, are not
    known so well. side: from the second to the first."""
    n = cross(u, v)
    scale = ti.select(dot(side, n) < 0.0, -1.0, 1.0) / ti.sqrt(dot(n, n) + 1e-30)
    across = (n[0] * scale, n[1] * scale, n[2] * scale)
    better = apart_along(x, kind, i, j, k, m, across) > apart_along(x, kind, i, j, k, m, way)
    return (
        ti.select(better, across[0], way[0]),
        ti.select(better, across[1], way[1]),
        ti.select(better, across[2], way[2]),
    )


@ti.func
def nearest_of_edges(x: Template, i, j, k, m):
    """Where on edges i–j and k–m (lanes) they are nearest, 0 to 1 each, and the vector from the second to the first
    (Ericson 2004, Real-Time Collision Detection, 5.1.9, without branches)."""
    origin = ti.static((0.0, 0.0, 0.0))
    a, b = vectors(x, i, origin), vectors(x, k, origin)
    u, v = vectors(x, j, a), vectors(x, m, b)
    rx, ry, rz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    r = (rx, ry, rz)
    uu, vv, uv = dot(u, u) + 1e-20, dot(v, v) + 1e-20, dot(u, v)
    ur, vr = dot(u, r), dot(v, r)
    s = ti.min(ti.max((uv * vr - ur * vv) / ti.max(uu * vv - uv * uv, 1e-6 * uu * vv), 0.0), 1.0)
    t = ti.min(ti.max((uv * s + vr) / vv, 0.0), 1.0)
    s = ti.min(ti.max((uv * t - ur) / uu, 0.0), 1.0)
    return s, t, rx + s * u[0] - t * v[0], ry + s * u[1] - t * v[1], rz + s * u[2] - t * v[2]


@ti.func
def nearest_on_face(x: Template, p, i, j, k):
    """Where on triangle i, j, k (lanes) point p is nearest, as shares of j and k, the vector from there to p, and
    whether that is inside."""
    origin = ti.static((0.0, 0.0, 0.0))
    a = vectors(x, i, origin)
    w, u, v = vectors(x, p, a), vectors(x, j, a), vectors(x, k, a)
    uu, uv, vv, uw, vw = dot(u, u) + 1e-20, dot(u, v), dot(v, v) + 1e-20, dot(u, w), dot(v, w)
    # By areas, not by uu vv − uv²: pieces of cells may be slivers.
    n, one, other = cross(u, v), cross(w, v), cross(u, w)
    scale = 1.0 / ti.max(dot(n, n), 1e-8 * uu * vv)
    s, t = scale * dot(one, n), scale * dot(other, n)
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    # On each edge, and how near, but for |w|².
    s1, t2 = ti.min(ti.max(uw / uu, 0.0), 1.0), ti.min(ti.max(vw / vv, 0.0), 1.0)
    k3 = ti.min(ti.max((uu - uv - uw + vw) / (uu - 2.0 * uv + vv + 1e-20), 0.0), 1.0)
    h3 = 1.0 - k3
    d1, d2 = s1 * s1 * uu - 2.0 * s1 * uw, t2 * t2 * vv - 2.0 * t2 * vw
    d3 = h3 * h3 * uu + 2.0 * k3 * h3 * uv + k3 * k3 * vv - 2.0 * h3 * uw - 2.0 * k3 * vw
    first, second = (d1 <= d2) & (d1 <= d3), d2 <= d3
    s = ti.select(inside, s, ti.select(first, s1, ti.select(second, 0.0, h3)))
    t = ti.select(inside, t, ti.select(first, 0.0, ti.select(second, t2, k3)))
    return s, t, w[0] - s * u[0] - t * v[0], w[1] - s * u[1] - t * v[1], w[2] - s * u[2] - t * v[2], inside


@ti.data_oriented
class Pairs:
    """Of one kind. point: [corner], elements of the padded grid: a point and a face, or the ends of two edges. normal:
    [axis], from the second side to the first. kept: how far apart they are kept [m]. apart: along the normal, when last
    looked at [m]. awake: numbers of those that may touch in the next interval."""

    count: Any
    woken: Any

    def __init__(self, room: int) -> None:
        self.room = room
        self.point = [ti.field(ti.i32, room + LANES) for _ in range(4)]
        self.normal = [ti.field(ti.f32, room + LANES) for _ in range(3)]
        self.kept, self.apart = (ti.field(ti.f32, room + LANES) for _ in range(2))
        self.awake = ti.field(ti.i32, room + 2 * LANES)
        self.count, self.woken = ti.field(ti.i32, ()), ti.field(ti.i32, ())

    @ti.func
    def packets(self):
        return (self.count[None] + LANES - 1) // LANES

    @ti.func
    def close(self, found, apart: Template):
        """`found` pairs are in; whole lanes of ones that never touch behind them, of points `apart`."""
        self.count[None] = ti.min(found, self.room)
        for k in range(LANES):
            for corner in ti.static(range(4)):
                self.point[corner][self.count[None] + k] = apart[corner]
            for axis in ti.static(range(3)):
                self.normal[axis][self.count[None] + k] = 0.0
            self.kept[self.count[None] + k] = -1.0


@ti.data_oriented
class NearPairs:
    """faces, edges: the pairs. thickness [m]. panel: of each element, 0 where there is none: only within a panel are
    neighbours let nearer than the thickness. overflow: pairs without room."""

    def __init__(self, size: int) -> None:
        self.faces, self.edges = Pairs(FACE_ROOM * size), Pairs(EDGE_ROOM * size)
        self.thickness, self.edge_share = ti.field(ti.f32, ()), ti.field(ti.f32, ())
        self.spacing = ti.field(ti.f32, 2)
        self.panel = ti.field(ti.i32, size)
        # Elements from a cell's own to the corners of its faces, and to the ends of its edges.
        self.face_offset, self.edge_offset = ti.field(ti.i32, (2, 3)), ti.field(ti.i32, (3, 2))
        self.one, self.other = (ti.field(ti.i32, LANES) for _ in range(2))
        self.within = ti.field(ti.f32, LANES)
        self.found = [ti.field(ti.f32, LANES) for _ in range(4)]
        self.overflow = ti.field(ti.i32, ())

    @ti.func
    def take(self, width):
        """width: of the padded grid."""
        for k, offset in ti.static(enumerate((0, 1, width + 1, 0, width + 1, width))):
            self.face_offset[k // 3, k % 3] = offset
        for k, offset in ti.static(enumerate((0, 1, 0, width, 0, width + 1))):
            self.edge_offset[k // 2, k % 2] = offset

    @ti.func
    def kept_apart(self, points: Template, width, p, q):
        """How far parts of two cells are kept apart: the thickness, or half of how far they are in the flat sheet, or
        by way of a seam."""
        out = self.thickness[None]
        seams = ti.static(points.pieces.cell_seam)
        out = ti.min(out, ti.max(0.5 * (seams[p] + seams[q]), NEAR_SEAMS))
        if self.panel[p] == self.panel[q] and self.panel[p] > 0:
            i = ti.cast(ti.max(ti.abs(p // width - q // width) - 1, 0), ti.f32) * self.spacing[1]
            j = ti.cast(ti.max(ti.abs(p % width - q % width) - 1, 0), ti.f32) * self.spacing[0]
            least = ti.min(self.spacing[0], self.spacing[1])
            out = ti.min(out, ti.max(0.5 * ti.sqrt(i * i + j * j), SHALLOW * least))
        return out

    @ti.func
    def owns(self, paths: Template, p, bit):
        return (paths.has[p] & (bit << MEETS)) != 0

    @ti.func
    def differ(self, points: Template, p, q):
        """Whether two elements are not one."""
        return points.pieces.label[p] != points.pieces.label[q]

    @ti.func
    def keep(self, pairs: Template, at, k, kept, points: Template):
        """One more pair, from lane k of what was found. Returns how many there are."""
        if at < pairs.room:
            for corner in ti.static(range(4)):
                pairs.point[corner][at] = points[corner]
            for axis in ti.static(range(3)):
                pairs.normal[axis][at] = self.found[1 + axis][k]
            pairs.kept[at] = kept
        else:
            self.overflow[None] = self.overflow[None] + 1
        return ti.min(at + 1, pairs.room)

    @ti.func
    def note_faces(self, x: Template, i, j, k, m, way: Template):
        """Of points i and faces j, k, m (lanes): the squared length of the way between their nearest places, and what
        parts them."""
        a = vectors(x, j, ti.static((0.0, 0.0, 0.0)))
        self.note(x, FACES, i, j, k, m, vectors(x, k, a), vectors(x, m, a), vectors(x, i, a), way)

    @ti.func
    def note_edges(self, x: Template, i, j, k, m, way: Template):
        """The same of edges i–j and k–m."""
        origin = ti.static((0.0, 0.0, 0.0))
        a, b = vectors(x, i, origin), vectors(x, k, origin)
        self.note(x, EDGES, i, j, k, m, vectors(x, j, a), vectors(x, m, b), vectors(x, i, b), way)

    @ti.func
    def note(self, x: Template, kind: Template, i, j, k, m, u: Template, v: Template, side: Template, way: Template):
        square = dot(way, way)
        scale = 1.0 / ti.sqrt(square + 1e-20)
        unit = (way[0] * scale, way[1] * scale, way[2] * scale)
        n = parting(x, kind, i, j, k, m, u, v, side, unit)
        store(self.found[0], 0, square)
        store(self.found[1], 0, n[0])
        store(self.found[2], 0, n[1])
        store(self.found[3], 0, n[2])

    @routine
    def find(self, points: Template, paths: Template, tree: Template, search: Template, reach: Float):
        """Pairs nearer than `reach` [m] and what they may approach each other until the horizon."""
        width = points.row[None]
        faces, edges, total = 0, 0, search.count[0]
        for group in range((total + LANES - 1) // LANES):
            count = ti.min(total - group * LANES, LANES)
            for k in range(LANES):
                pair = group * LANES + ti.min(k, count - 1)
                one, other = search.one[0, pair], search.other[0, pair]
                p = one // COLUMNS * width + one % COLUMNS
                q = other // COLUMNS * width + other % COLUMNS
                approach = 0.0
                for axis in ti.static(range(3)):
                    slow, fast = ti.static(tree.low[axis + 3], tree.high[axis + 3])
                    approach += ti.max(fast[p] - slow[q], fast[q] - slow[p]) ** 2
                self.one[k], self.other[k], self.within[k] = p, q, (reach + ti.sqrt(approach)) ** 2
                tree.clear[p] = ti.min(tree.clear[p], 0.5 * reach)
                tree.clear[q] = ti.min(tree.clear[q], 0.5 * reach)
            faces = self.find_faces(points, paths, width, count, faces)
            edges = self.find_edges(points, paths, width, count, edges)
        self.faces.close(faces, (0, 1, width, width + 1))
        self.edges.close(edges, (0, 1, width, width + 1))

    @ti.func
    def find_faces(self, points: Template, paths: Template, width, count, found):
        """Of the pairs of cells at hand: the point of each against both faces of the other."""
        for turn in range(4):
            first, second = load(self.one, 0), load(self.other, 0)
            p, q = ti.select(turn < 2, first, second), ti.select(turn < 2, second, first)
            half = turn % 2
            i, j, k = (
                q + self.face_offset[half, 0],
                q + self.face_offset[half, 1],
                q + self.face_offset[half, 2],
            )
            _s, _t, x, y, z, _inside = nearest_on_face(points.position, p, i, j, k)
            self.note_faces(points.position, p, i, j, k, (x, y, z))
            for lane in range(count):
                if self.found[0][lane] < self.within[lane]:
                    a, b = self.one[lane], self.other[lane]
                    if turn >= 2:
                        a, b = b, a
                    c, d, e = (
                        b + self.face_offset[half, 0],
                        b + self.face_offset[half, 1],
                        b + self.face_offset[half, 2],
                    )
                    if self.owns(paths, a, POINT) and self.owns(paths, b, CELL):
                        apart = self.differ(points, a, c) & self.differ(points, a, d)
                        if apart & self.differ(points, a, e):
                            kept = self.kept_apart(points, width, a, b)
                            found = self.keep(self.faces, found, lane, kept, (a, c, d, e))
        return found

    @ti.func
    def find_edges(self, points: Template, paths: Template, width, count, found):
        """Of the pairs of cells at hand: three edges of one against three of the other."""
        bits = ti.Vector([EAST, NORTH, CELL])
        for turn in range(9):
            e, f = turn // 3, turn % 3
            p, q = load(self.one, 0), load(self.other, 0)
            i, j = p + self.edge_offset[e, 0], p + self.edge_offset[e, 1]
            k, m = q + self.edge_offset[f, 0], q + self.edge_offset[f, 1]
            _s, _t, x, y, z = nearest_of_edges(points.position, i, j, k, m)
            self.note_edges(points.position, i, j, k, m, (x, y, z))
            for lane in range(count):
                if self.found[0][lane] < self.within[lane]:
                    a, b = self.one[lane], self.other[lane]
                    if self.owns(paths, a, bits[e]) and self.owns(paths, b, bits[f]):
                        c, d = a + self.edge_offset[e, 0], a + self.edge_offset[e, 1]
                        g, h = b + self.edge_offset[f, 0], b + self.edge_offset[f, 1]
                        apart = self.differ(points, c, g) & self.differ(points, c, h)
                        if apart & self.differ(points, d, g) & self.differ(points, d, h):
                            kept = self.edge_share[None] * self.kept_apart(points, width, a, b)
                            found = self.keep(self.edges, found, lane, kept, (c, d, g, h))
        return found
