"""Signed distance and outward normal of primitives in float64: the reference for contact, and what fits are scored by.

Sphere and round-capped, tapered cylinder in closed form. The elliptic cylinder needs the nearest point of an ellipse
with semi-axes a ≥ b to (p, q), p, q ≥ 0 (Eberly 2013, "Distance from a point to an ellipse"): with r = (a/b)² it is
(a y₀, b y₁) with

    y₀ = r (p/a) / (u + r − 1),   y₁ = (q/b) / u,   y₀² + y₁² = 1,   u > 0.

1/|y| − 1 is concave, increasing and nearly straight in u (Moré & Sorensen 1983), so Newton's method from below its root
rises to it without ever passing it: safe without a bracket. The error of the distance is of second order in that of u.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.body.primitives.primitives import Primitive

__all__ = ["cross", "nearest_distance", "newton_steps", "signed_distance"]

F64 = NDArray[np.float64]
Pair = tuple[F64, F64]


def signed_distance(primitive: Primitive, points: ArrayLike) -> Pair:
    """Distance (n,) [m] from points (n, 3) [m] to the surface, negative inside, and its gradient (n, 3), unit.

    Where several points of the surface are nearest the gradient belongs to one of them.
    """
    p = np.asarray(points, np.float64).reshape(-1, 3)
    if primitive.kind == "elliptic":
        return _elliptic(primitive, p)
    return _cone(primitive, p)


def nearest_distance(primitives: Sequence[Primitive], points: ArrayLike) -> tuple[F64, F64, NDArray[np.int64]]:
    """The least signed distance over all primitives (n,), its gradient (n, 3), and whose it is (n,).

    Outside it is the distance to their union. Inside the union it is a bound: the boundary is at least that deep.
    """
    p = np.asarray(points, np.float64).reshape(-1, 3)
    best, gradient = np.full(len(p), np.inf), np.zeros((len(p), 3))
    whose = np.zeros(len(p), np.int64)
    for number, primitive in enumerate(primitives):
        distance, normal = signed_distance(primitive, p)
        nearer = distance < best
        best[nearer], gradient[nearer], whose[nearer] = distance[nearer], normal[nearer], number
    return best, gradient, whose


def cross(a: F64, b: F64) -> F64:
    """Of two vectors (3,): NumPy's own is slow on so few numbers."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def square_to(axis: F64) -> F64:
    """A unit vector square to a unit vector."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    out = cross(axis, other)
    return out / np.linalg.norm(out)


def _cone(primitive: Primitive, points: F64) -> Pair:
    """The hull of two spheres; one sphere where it holds the other.

    In the half plane of (distance to the axis, place along it) the normals of the straight flank are (c, s) with
    s = (r₁ − r₂)/length, and each of the three pieces owns the points between the normals at its ends, inside as out.
    """
    r1, r2 = primitive.radii if primitive.kind == "cylinder" else (primitive.radii[0], primitive.radii[0])
    span = primitive.end - primitive.start if primitive.kind == "cylinder" else np.zeros(3)
    length = float(np.linalg.norm(span))
    if length <= abs(r1 - r2):
        return _ball(points - (primitive.start if r1 >= r2 else primitive.end), max(r1, r2))
    axis, s = span / length, (r1 - r2) / length
    c = np.sqrt(1 - s * s)
    v = points - primitive.start
    along = v @ axis
    q = v - along[:, None] * axis
    q -= (q @ axis)[:, None] * axis  # beside the axis the first difference is mostly rounding
    radial = np.sqrt(np.einsum("nk,nk->n", q, q))
    out = np.where(radial[:, None] > 1e-14 * length, q / np.maximum(radial, 1e-300)[:, None], square_to(axis))
    out -= (out @ axis)[:, None] * axis
    foot = c * along - s * radial  # from 0 to c·length on the flank
    distance = c * radial + s * along - r1
    gradient = c * out + s * axis
    for chosen, centre, radius in ((foot < 0, primitive.start, r1), (foot > c * length, primitive.end, r2)):
        distance[chosen], gradient[chosen] = _ball(points[chosen] - centre, radius, axis)
    return distance, gradient


def _ball(v: F64, radius: float, otherwise: ArrayLike = (0.0, 1.0, 0.0)) -> Pair:
    far = np.sqrt(np.einsum("nk,nk->n", v, v))
    return far - radius, np.where(far[:, None] > 0, v / np.maximum(far, 1e-300)[:, None], np.asarray(otherwise))


def _elliptic(primitive: Primitive, points: F64) -> Pair:
    """A right elliptic cylinder grown by `rounding`; a convex solid's distance grows by it everywhere."""
    assert primitive.across is not None
    span = primitive.end - primitive.start
    length = float(np.linalg.norm(span))
    axis, x = span / length, primitive.across
    y = cross(axis, x)
    v = points - (primitive.start + primitive.end) / 2
    along = v @ axis
    flank, nx, ny = _ellipse(
        v @ x, v @ y, primitive.radii[0] - primitive.rounding, primitive.radii[1] - primitive.rounding
    )
    cap = np.abs(along) - (length / 2 - primitive.rounding)
    # Inside, and beside a cap or the flank, the larger of the two; beyond an edge both count.
    beyond = (flank > 0) & (cap > 0)
    side = np.where(beyond, flank, (flank >= cap).astype(np.float64))
    end = np.where(beyond, cap, (flank < cap).astype(np.float64))
    far = np.hypot(side, end)
    distance = np.where(beyond, far, np.maximum(flank, cap)) - primitive.rounding
    side, end = side / far, end / far * np.where(along < 0, -1.0, 1.0)
    return distance, (side * nx)[:, None] * x + (side * ny)[:, None] * y + end[:, None] * axis


def _ellipse(px: F64, py: F64, rx: float, ry: float) -> tuple[F64, F64, F64]:
    """Signed distance to the ellipse with semi-axes rx, ry, and the normal where it is nearest."""
    if rx < ry:
        distance, ny, nx = _ellipse(py, px, ry, rx)
        return distance, nx, ny
    r = (rx / ry) ** 2
    p, q = np.abs(px) / rx, np.maximum(np.abs(py) / ry, 1e-14)  # just off the long axis the nearest point is the same
    u, _ = _root(p, q, r, 1e-15)
    y0, y1 = r * p / (u + r - 1), q / u
    size = np.hypot(y0, y1)
    y0, y1 = y0 / size, y1 / size
    nx, ny = y0 / rx, y1 / ry
    norm = np.hypot(nx, ny)
    nx, ny = nx / norm, ny / norm
    distance = (np.abs(px) - rx * y0) * nx + (np.abs(py) - ry * y1) * ny
    return distance, np.copysign(nx, px), np.copysign(ny, py)


def _root(p: F64, q: F64, r: float, near: float) -> tuple[F64, int]:
    """u, and the steps of Newton after which no u changes by more than that share."""
    far = np.hypot(p, q)
    u = np.maximum(np.maximum(q, r * p - r + 1), np.where(far > 1, far, 0.0))  # far: as r far ≥ far + r − 1 outside
    for steps in range(100):
        y0, y1 = r * p / (u + r - 1), q / u
        size = np.hypot(y0, y1)
        change = (size - 1) * size**2 / (y0**2 / (u + r - 1) + y1**2 / u)
        u = u + np.maximum(change, 0.0)
        if (change <= near * u).all():
            return u, steps
    return u, 100


def newton_steps(long: float, short: float, rounding: float, *, reach: float = 0.01) -> int:
    """Steps of Newton that give the distance to an ellipse to 1e-6 m, for points that are `reach` [m] or less from it
    grown by `rounding`: with u to a thousandth it is right to some 1e-7 m."""
    turn, off = np.meshgrid(np.linspace(0, np.pi / 2, 400), rounding + np.linspace(-reach, reach, 41))
    x, y = np.cos(turn), np.sin(turn)
    out = off / np.hypot(x / long, y / short)
    p, q = np.abs(x + out * x / long**2), np.maximum(np.abs(y + out * y / short**2), 1e-6)
    return _root(p, q, (long / short) ** 2, 1e-3)[1]
