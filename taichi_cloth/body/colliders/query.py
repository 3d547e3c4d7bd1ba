"""Where many points stand to a body at rest: distance and normal of its nearest primitive, in one kernel."""

from collections.abc import Sequence

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.body.primitives.distance import square_to
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.shapes import EVERYWHERE, cone, ellipse, local, prism
from taichi_cloth.ground.arrays import F32x2

__all__ = ["PrimitiveQuery"]

F32 = NDArray[np.float32]
ROW = 18
"""Of a primitive: 0 whether elliptic, 1 anchor, 4 axis, 7 across, 10 other, 13 shape."""


class PrimitiveQuery:
    """Primitives asked by call: points (n, 3) [m] to distances (n,) [m], negative inside, and unit normals (n, 3).

    Outside it is the distance to the union; inside a bound, as of `distance.nearest_distance`.
    """

    def __init__(self, primitives: Sequence[Primitive]) -> None:
        self.rows = np.array([_row(p) for p in primitives], np.float32)

    def __call__(self, points: ArrayLike) -> tuple[F32, F32]:
        asked = np.ascontiguousarray(points, np.float32)
        out = np.empty((len(asked), 4), np.float32)
        _nearest(self.rows, asked, out)
        return out[:, 0], out[:, 1:]


def _row(p: Primitive) -> list[float]:
    span = p.end - p.start
    length = float(np.linalg.norm(span)) if p.kind != "sphere" else 0.0
    axis = span / length if length > 0 else np.array([0.0, 1.0, 0.0])
    r0, r1 = p.radii
    if p.kind == "elliptic":
        assert p.across is not None
        across = p.across if r0 >= r1 else np.cross(p.across, axis)
        anchor = (p.start + p.end) / 2
        shape = [max(r0, r1) - p.rounding, min(r0, r1) - p.rounding, length / 2 - p.rounding, p.rounding]
    else:
        across, anchor = square_to(axis), p.start
        if p.kind == "sphere" or length <= abs(r0 - r1):  # one ball holds the other
            anchor = p.end if p.kind == "cylinder" and r1 > r0 else p.start
            shape = [r0 if p.kind == "sphere" else max(r0, r1), 0.0, 0.0, 0.0]
        else:
            sine = (r0 - r1) / length
            shape = [r0, sine, sine / np.sqrt(1 - sine**2), length]
    other = np.cross(axis, across)
    return [float(p.kind == "elliptic"), *anchor, *axis, *across, *other, *shape, 0.0]


@ti.kernel
def _nearest(rows: F32x2, points: F32x2, out: F32x2):
    for n in range(points.shape[0]):
        best, nx, ny, nz = 1e30, 0.0, 0.0, 0.0
        for i in range(rows.shape[0]):
            x, y, z = points[n, 0] - rows[i, 1], points[n, 1] - rows[i, 2], points[n, 2] - rows[i, 3]
            axis = ti.Vector([rows[i, 4], rows[i, 5], rows[i, 6]])
            across = ti.Vector([rows[i, 7], rows[i, 8], rows[i, 9]])
            one, two, three, four = rows[i, 13], rows[i, 14], rows[i, 15], rows[i, 16]
            d, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
            if rows[i, 0] > 0.5:
                other = ti.Vector([rows[i, 10], rows[i, 11], rows[i, 12]])
                along, px, py = local(x, y, z, axis), local(x, y, z, across), local(x, y, z, other)
                flank, nu, nv = ellipse(px, py, one, two, EVERYWHERE)
                far, u, v, end = prism(flank, nu, nv, along, three, four)
                normal = u * across + v * other + end * axis
                d, gx, gy, gz = far, normal[0], normal[1], normal[2]
            else:
                d, gx, gy, gz = cone(x, y, z, axis, across, one, two, three, four)
            if d < best:
                best, nx, ny, nz = d, gx, gy, gz
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = best, nx, ny, nz
