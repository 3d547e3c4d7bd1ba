"""Points and faces, and edges and edges, eight pairs at a time: where they are nearest, and what parts them.

One piece of code for all who ask, as it takes long to compile: they leave elements in `corner` and find answers beside.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.distances import FACES, cross, dot, nearest_of_edges, nearest_on_face, vectors
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Nearest"]


@ti.data_oriented
class Nearest:
    """All by lanes. corner: [corner], elements: a point and a face, or the ends of two edges. way: [axis], from the
    nearest place of the second to that of the first [m]; square: of it. share: of k and m on the face, or along both
    edges. inside: 1 where the nearest place is inside the face, and of all edges. normal: [axis], unit vector that
    parts them. beyond: how far the first are beyond the second along `way` [m]."""

    def __init__(self) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, LANES) for _ in range(count)]

        self.corner = [ti.field(ti.i32, LANES) for _ in range(4)]
        self.way, self.normal, self.share = fields(3), fields(3), fields(2)
        self.square, self.beyond = fields(2)
        self.inside = ti.field(ti.i32, LANES)

    @ti.func
    def take(self, i, j, k, m):
        """Elements (lanes) to look at."""
        for corner, p in ti.static(((0, i), (1, j), (2, k), (3, m))):
            store(self.corner[corner], 0, p)

    @ti.func
    def find(self, points: Template, kind):
        """Where they are nearest: all but `normal` and `beyond`."""
        if kind == FACES:
            self.of_faces(points)
        else:
            self.of_edges(points)

    @routine
    def of_faces(self, points: Template):
        i, j, k, m = (
            load(self.corner[0], 0),
            load(self.corner[1], 0),
            load(self.corner[2], 0),
            load(self.corner[3], 0),
        )
        s, t, x, y, z, inside = nearest_on_face(points.position, i, j, k, m)
        store(self.inside, 0, ti.select(inside, 1, 0))
        self.keep(s, t, x, y, z)

    @routine
    def of_edges(self, points: Template):
        i, j, k, m = (
            load(self.corner[0], 0),
            load(self.corner[1], 0),
            load(self.corner[2], 0),
            load(self.corner[3], 0),
        )
        s, t, x, y, z = nearest_of_edges(points.position, i, j, k, m)
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
    def part(self, points: Template, kind: Int):
        """`normal`: the way, or what is across two edges of theirs, where that parts them more: the nearest places of
        slivers, and of what all but touches, are not known so well. And `beyond`."""
        origin = ti.static((0.0, 0.0, 0.0))
        i = vectors(points.position, load(self.corner[0], 0), origin)
        j = vectors(points.position, load(self.corner[1], 0), i)
        k = vectors(points.position, load(self.corner[2], 0), i)
        m = vectors(points.position, load(self.corner[3], 0), i)
        x, y, z = load(self.way[0], 0), load(self.way[1], 0), load(self.way[2], 0)
        scale = 1.0 / ti.sqrt(x * x + y * y + z * z + 1e-20)
        unit = (x * scale, y * scale, z * scale)
        beyond = self.apart(kind, j, k, m, unit)
        # Across: of a face two of its edges, of edges both; and from the second to the first.
        on_face = kind == FACES
        u = self.either(on_face, (k[0] - j[0], k[1] - j[1], k[2] - j[2]), j)
        v = self.either(on_face, (m[0] - j[0], m[1] - j[1], m[2] - j[2]), (m[0] - k[0], m[1] - k[1], m[2] - k[2]))
        side = self.either(on_face, (-j[0], -j[1], -j[2]), (-k[0], -k[1], -k[2]))
        n = cross(u, v)
        scale = ti.select(dot(side, n) < 0.0, -1.0, 1.0) / ti.sqrt(dot(n, n) + 1e-30)
        across = (n[0] * scale, n[1] * scale, n[2] * scale)
        better = self.apart(kind, j, k, m, across) > beyond
        for axis in ti.static(range(3)):
            store(self.normal[axis], 0, ti.select(better, across[axis], unit[axis]))
        store(self.beyond, 0, beyond)

    @ti.func
    def either(self, first, one: Template, other: Template):
        return (
            ti.select(first, one[0], other[0]),
            ti.select(first, one[1], other[1]),
            ti.select(first, one[2], other[2]),
        )

    @ti.func
    def apart(self, kind, j: Template, k: Template, m: Template, way: Template):
        """How far the first `kind` of four points, one at the origin and the others at j, k and m, are beyond the
        others along a way."""
        b, c, d = dot(j, way), dot(k, way), dot(m, way)
        others = ti.max(c, d)
        return ti.select(kind == FACES, -ti.max(b, others), ti.min(b, 0.0) - others)
