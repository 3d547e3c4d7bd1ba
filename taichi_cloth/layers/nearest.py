"""Points and faces, and edges and edges, eight pairs at a time: where they are nearest, and what parts them.

One piece of code for all who ask, as it takes long to compile: they leave places beside it and find answers there. And
the list of those that are near each other, which a search fills.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.stencil import load, load_xyz, near, relative, store, taken
from taichi_cloth.sheet.sheet import LANES

__all__ = ["CORNERS", "EDGES", "FACES", "Nearest", "Pairs", "gather"]

FACES, EDGES = 1, 2
"""Kinds of pairs, and how many of their four points are on the first side: a point and a face, two edges."""

CORNERS = 4
"""Of a cell."""


@ti.func
def gather(field: Template, at):
    """Of elements `at`, one a lane."""
    if ti.static(taken() == 1):
        return field[at]
    else:
        return ti.Vector([field[at[k]] for k in ti.static(range(LANES))])


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
def nearest_of_edges(r: Template, u: Template, v: Template):
    """Where on edges a + s u and b + t v (lanes) they are nearest, 0 to 1 each, and the vector from the second to the
    first. r: a − b (Ericson 2004, Real-Time Collision Detection, 5.1.9, without branches)."""
    uu, vv, uv = dot(u, u) + 1e-20, dot(v, v) + 1e-20, dot(u, v)
    ur, vr = dot(u, r), dot(v, r)
    s = ti.min(ti.max((uv * vr - ur * vv) / ti.max(uu * vv - uv * uv, 1e-6 * uu * vv), 0.0), 1.0)
    t = ti.min(ti.max((uv * s + vr) / vv, 0.0), 1.0)
    s = ti.min(ti.max((uv * t - ur) / uu, 0.0), 1.0)
    return s, t, r[0] + s * u[0] - t * v[0], r[1] + s * u[1] - t * v[1], r[2] + s * u[2] - t * v[2]


@ti.func
def nearest_on_face(w: Template, u: Template, v: Template):
    """Where on triangle 0, u, v (lanes) point w is nearest, as shares of u and v, the vector from there to w, and
    whether that is inside."""
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


@ti.func
def weights_of(kind, s, t):
    """Of the four points of a pair that is nearest at shares s and t: Σ w x is the way from the second to the first."""
    out = ti.Vector([1.0 - s, s, t - 1.0, -t])
    if kind == FACES:
        out = ti.Vector([1.0, s + t - 1.0, -s, -t])
    return out


@ti.func
def parting(kind, j: Template, k: Template, m: Template, way: Template):
    """What parts four points more, one at the origin and the others at j, k and m (lanes): a way between them, or what
    is across two of their edges. A unit vector, and how far the first `kind` of them are beyond the others along it."""
    x, y, z = way[0], way[1], way[2]
    scale = 1.0 / ti.sqrt(x * x + y * y + z * z + 1e-20)
    unit = (x * scale, y * scale, z * scale)
    beyond = beyond_others(kind, j, k, m, unit)
    # Across: of a face two of its edges, of edges both; and from the second to the first.
    on_face = kind == FACES
    u = either(on_face, (k[0] - j[0], k[1] - j[1], k[2] - j[2]), j)
    v = either(on_face, (m[0] - j[0], m[1] - j[1], m[2] - j[2]), (m[0] - k[0], m[1] - k[1], m[2] - k[2]))
    side = either(on_face, (-j[0], -j[1], -j[2]), (-k[0], -k[1], -k[2]))
    n = cross(u, v)
    scale = ti.select(dot(side, n) < 0.0, -1.0, 1.0) / ti.sqrt(dot(n, n) + 1e-30)
    across = (n[0] * scale, n[1] * scale, n[2] * scale)
    other = beyond_others(kind, j, k, m, across)
    more = other > beyond
    return (
        ti.select(more, across[0], unit[0]),
        ti.select(more, across[1], unit[1]),
        ti.select(more, across[2], unit[2]),
        ti.max(beyond, other),
    )


@ti.func
def either(first, one: Template, other: Template):
    return (
        ti.select(first, one[0], other[0]),
        ti.select(first, one[1], other[1]),
        ti.select(first, one[2], other[2]),
    )


@ti.func
def beyond_others(kind, j: Template, k: Template, m: Template, way: Template):
    """How far the first `kind` of four points, as of `parting`, are beyond the others along a way."""
    b, c, d = dot(j, way), dot(k, way), dot(m, way)
    others = ti.max(c, d)
    return ti.select(kind == FACES, -ti.max(b, others), ti.min(b, 0.0) - others)


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
class Nearest:
    """All by lanes. place: [corner][axis], of a point and a face, or of the ends of two edges [m]. cell: [axis], of the
    corners of two cells, one behind the other [m]. way: [axis], from the nearest place of the second to that of the
    first [m]; square: of it. share: of the last two corners on the face, or along both edges. inside: 1 where the
    nearest place is inside the face, and of all edges. normal: [axis], unit vector that parts them. beyond: how far the
    first are beyond the second along it [m]."""

    def __init__(self) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, LANES) for _ in range(count)]

        self.place = [fields(3) for _ in range(4)]
        self.cell = [ti.field(ti.f32, 2 * CORNERS * LANES) for _ in range(3)]
        self.way, self.normal, self.share = fields(3), fields(3), fields(2)
        self.square, self.beyond = fields(2)
        self.inside = ti.field(ti.i32, LANES)

    @ti.func
    def take(self, points: Template, i, j, k, m):
        """Elements (lanes) to look at."""
        for corner, p in ti.static(((0, i), (1, j), (2, k), (3, m))):
            for axis in ti.static(range(3)):
                store(self.place[corner][axis], 0, gather(points.position[axis], p))

    @routine
    def take_cells(self, points: Template, cells: Template, width: Int):
        """Cells by their elements, all that are first and then all others: of the corners of two go all that is then
        looked at."""
        for k in range(2 * CORNERS):
            first = ti.select(k < CORNERS, load(cells, 0), load(cells, LANES))
            p = first + (k & 1) + ((k >> 1) & 1) * width
            for axis in ti.static(range(3)):
                store(self.cell[axis], near(k * LANES), gather(points.position[axis], p))

    @ti.func
    def take_corners(self, i, j, k, m):
        """Corners to look at, of one cell from 0, of the other from CORNERS."""
        for corner, at in ti.static(((0, i), (1, j), (2, k), (3, m))):
            for axis in ti.static(range(3)):
                store(self.place[corner][axis], 0, load(self.cell[axis], near(at * LANES)))

    @ti.func
    def find(self, kind):
        """Where they are nearest: all but `normal` and `beyond`."""
        if kind == FACES:
            self.of_faces()
        else:
            self.of_edges()

    @routine
    def of_faces(self):
        a = load_xyz(self.place[1], 0)
        w, u, v = relative(self.place[0], 0, a), relative(self.place[2], 0, a), relative(self.place[3], 0, a)
        s, t, x, y, z, inside = nearest_on_face(w, u, v)
        store(self.inside, 0, ti.select(inside, 1, 0))
        self.keep(s, t, x, y, z)

    @routine
    def of_edges(self):
        a, b = load_xyz(self.place[0], 0), load_xyz(self.place[2], 0)
        u, v = relative(self.place[1], 0, a), relative(self.place[3], 0, b)
        s, t, x, y, z = nearest_of_edges((a[0] - b[0], a[1] - b[1], a[2] - b[2]), u, v)
        store(self.inside, 0, ti.Vector([1] * LANES))
        self.keep(s, t, x, y, z)

    @ti.func
    def keep(self, s, t, x, y, z):
        for field, v in ti.static(
            ((self.share[0], s), (self.share[1], t), (self.way[0], x), (self.way[1], y), (self.way[2], z))
        ):
            store(field, 0, v)
        store(self.square, 0, x * x + y * y + z * z)

    @routine
    def part(self, kind: Int):
        """`normal`: the way, or what is across two edges of theirs, where that parts them more: the nearest places of
        slivers, and of what all but touches, are not known so well. And `beyond`."""
        i = load_xyz(self.place[0], 0)
        j, k, m = relative(self.place[1], 0, i), relative(self.place[2], 0, i), relative(self.place[3], 0, i)
        x, y, z, beyond = parting(kind, j, k, m, load_xyz(self.way, 0))
        for axis, v in ti.static(((0, x), (1, y), (2, z))):
            store(self.normal[axis], 0, v)
        store(self.beyond, 0, beyond)
