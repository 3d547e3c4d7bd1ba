"""Distances of points from faces and of edges from edges, by lanes, and the directions that part them."""

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.sheet.sheet import LANES

__all__ = [
    "EDGES",
    "FACES",
    "cross",
    "dot",
    "gather",
    "nearest_of_edges",
    "nearest_on_face",
]

FACES, EDGES = 1, 2
"""Kinds of pairs, and how many of their four points are on the first side: a point and a face, two edges."""


@ti.func
def gather(field: Template, at):
    """Of elements `at`, one a lane."""
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
