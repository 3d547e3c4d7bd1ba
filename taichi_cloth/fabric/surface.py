"""The smooth surface through key points, known anywhere between them: what threads lie on that key points do not stand
for one by one.

In each cell, between four key points, it is bicubic. Kept of a key point are its place P and three differences: Pu to
its neighbours along the weft, Pv along the warp, Puv of Pu along the warp, each half of what lies between the two
neighbours, or the whole way to the one that is there. With the cubics of Hermite, H₀ = 2t³ − 3t² + 1, H₁ = 3t² − 2t³,
G₀ = t³ − 2t² + t, G₁ = t³ − t²,

    S(u, v) = Σ_ab H_a(u) H_b(v) P + G_a(u) H_b(v) Pu + H_a(u) G_b(v) Pv + G_a(u) G_b(v) Puv,   a, b ∈ {0, 1}

which inside a grid is the surface of Catmull–Rom splines of `crossings`. It goes through all key points, and its
slopes, by which the cloth's frame is known, have no step from cell to cell.
"""

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.arrays import F32x2

__all__ = ["NODE", "nodes_of", "surface_at", "surface_points"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NODE = 12
"""Numbers a key point: P, Pu, Pv, Puv."""


def nodes_of(points: NDArray, present: ArrayLike | None = None) -> F32:
    """What kernels keep of key points (rows, cols, 3) [m], (rows · cols, NODE); 0 for those that are not present.

    present: bool (rows, cols); None: all.
    """
    x = np.asarray(points, np.float64)
    mask = np.ones(x.shape[:2], bool) if present is None else np.asarray(present, bool)
    x = np.where(mask[..., None], x, 0.0)
    along = _difference(x, mask, 1)
    parts = [x, along, _difference(x, mask, 0), _difference(along, mask, 0)]
    return np.concatenate(parts, axis=2).reshape(-1, NODE).astype(np.float32)


def _difference(x: F64, mask: NDArray[np.bool_], axis: int) -> F64:
    """Half of what lies between the neighbours of each, or the way to the one there is, or 0."""
    out, count = np.zeros_like(x), np.zeros(mask.shape)
    low, high = [slice(None)] * 2, [slice(None)] * 2
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    a, b = tuple(low), tuple(high)
    both = mask[a] & mask[b]
    step = np.where(both[..., None], x[b] - x[a], 0.0)
    for side in (a, b):
        out[side] += step
        count[side] += both
    return out / np.maximum(count, 1.0)[..., None]


def surface_points(nodes: NDArray, cols: int, u: ArrayLike, v: ArrayLike) -> tuple[F64, F64, F64]:
    """Places (n, 3) [m] and slopes along the weft and along the warp [m a cell] at u columns and v rows, (n,) each,
    from the first key point. nodes: of `nodes_of`, cols: key points in a row. The same as `surface_at`, on the host.
    """
    u, v = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
    grid = np.asarray(nodes, np.float64).reshape(-1, cols, NODE)
    c = np.clip(np.floor(u).astype(np.int64), 0, cols - 2)
    r = np.clip(np.floor(v).astype(np.int64), 0, len(grid) - 2)
    place, by_u, by_v = np.zeros((3, len(u), 3))
    for b in (0, 1):
        for a in (0, 1):
            p, pu, pv, puv = np.moveaxis(grid[r + b, c + a].reshape(-1, 4, 3), 1, 0)
            (hu, gu, hu1, gu1), (hv, gv, hv1, gv1) = _cubics(np.subtract(u, c), a), _cubics(np.subtract(v, r), b)
            place += hu * hv * p + gu * hv * pu + hu * gv * pv + gu * gv * puv
            by_u += hu1 * hv * p + gu1 * hv * pu + hu1 * gv * pv + gu1 * gv * puv
            by_v += hu * hv1 * p + gu * hv1 * pu + hu * gv1 * pv + gu * gv1 * puv
    return place, by_u, by_v


def _cubics(t: F64, end: int) -> tuple[F64, F64, F64, F64]:
    """H, G of one end of a cell and their derivatives at t, (n, 1) each."""
    t = t[:, None]
    if end:
        return 3 * t**2 - 2 * t**3, t**3 - t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t
    return 2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 6 * t**2 - 6 * t, 3 * t**2 - 4 * t + 1


@ti.func
def _of_end(t, end):
    """As `_cubics`, of one number."""
    far = ti.cast(end, ti.f32)
    h1, h1_by = t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)
    h = far * h1 + (1.0 - far) * (1.0 - h1)
    h_by = (2.0 * far - 1.0) * h1_by
    # G₁ = t²(t − 1), G₀ = t(t − 1)²
    g = t * (t - 1.0) * (far * t + (1.0 - far) * (t - 1.0))
    g_by = far * t * (3.0 * t - 2.0) + (1.0 - far) * (t - 1.0) * (3.0 * t - 1.0)
    return h, g, h_by, g_by


@ti.func
def _three(node: F32x2, k, c):
    return ti.Vector([node[k, c], node[k, c + 1], node[k, c + 2]])


@ti.func
def surface_at(node: F32x2, first, cols, u, v):
    """Place and slopes along the weft and along the warp in the cell whose first key point is number `first`, at the
    shares u, v of it; just outside it is the same bicubic."""
    place, by_u, by_v = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
    for corner in range(4):
        a, b = corner % 2, corner // 2
        k = first + a + b * cols
        p, pu, pv, puv = _three(node, k, 0), _three(node, k, 3), _three(node, k, 6), _three(node, k, 9)
        hu, gu, hu_by, gu_by = _of_end(u, a)
        hv, gv, hv_by, gv_by = _of_end(v, b)
        place += hv * (hu * p + gu * pu) + gv * (hu * pv + gu * puv)
        by_u += hv * (hu_by * p + gu_by * pu) + gv * (hu_by * pv + gu_by * puv)
        by_v += hv_by * (hu * p + gu * pu) + gv_by * (hu * pv + gu * puv)
    return place, by_u, by_v
