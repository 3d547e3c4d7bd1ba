"""Crossings between key points: more threads than the simulation moves.

A sheet is simulated on key points a centimetre apart, and woven of threads a fraction of a millimetre apart. The
crossings between lie on the surface that Catmull–Rom splines span (E. Catmull, R. Rom, "A class of local interpolating
splines", 1974), first along the rows, then along the columns: it goes through all key points and has no crease.

    p(t) = p₀ + t/2 ((p₁ − p₋₁) + t ((2p₋₁ − 5p₀ + 4p₁ − p₂) + t (3(p₀ − p₁) + p₂ − p₋₁)))

At an edge and at the border of a mask, the neighbour that is missing is the mirror image 2p₀ − p₁.
"""

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.arrays import F32x3, I32x2, Int, Template
from taichi_cloth.ground.errors import InputError

__all__ = ["refine_points", "refined_mask"]

F32 = NDArray[np.float32]
MOST = 1000  # threads a key point


def refined_mask(present: ArrayLike, k: int) -> NDArray[np.bool_]:
    """Which crossings exist, bool ((rows − 1)k + 1, (cols − 1)k + 1): those with all key points round them."""
    _check(k)
    mask = np.asarray(present, bool)
    for axis in (1, 0):
        count = (mask.shape[axis] - 1) * k + 1
        at = np.arange(count)
        mask = mask.take(at // k, axis) & mask.take(-(-at // k), axis)
    return mask


def refine_points(points: NDArray, present: ArrayLike | None, k: int) -> F32:
    """Crossings ((rows − 1)k + 1, (cols − 1)k + 1, 3) float32 [m] of key points (rows, cols, 3) [m].

    present: bool (rows, cols), key points that exist; None: all. Crossings that are not in `refined_mask` are 0.
    k: threads a key point, 1 or more; 1 gives the key points back. Raises InputError.
    """
    _check(k)
    x = np.ascontiguousarray(points, np.float32)
    rows, cols = x.shape[:2]
    mask = np.ones((rows, cols), np.int32) if present is None else np.ascontiguousarray(present, np.int32)
    if x.ndim != 3 or mask.shape != (rows, cols) or min(rows, cols) < 2:
        raise InputError(
            f"points, present: shapes {x.shape}, {mask.shape}; "
            "allowed: (rows, cols, 3) and (rows, cols), each 2 or more"
        )
    if k == 1:
        out = x.copy()
        if present is not None:
            out.reshape(-1, 3)[np.flatnonzero(mask == 0)] = 0.0
        return out
    many_rows, many_cols = (rows - 1) * k + 1, (cols - 1) * k + 1
    between, out = np.zeros((rows, many_cols, 3), np.float32), np.zeros((many_rows, many_cols, 3), np.float32)
    found = np.zeros((rows, many_cols), np.int32)
    _refine(k, x, mask, between, found, out)
    return out


def _check(k: int) -> None:
    if not 1 <= k <= MOST:
        raise InputError(f"threads_per_key_point: {k!r}; allowed: 1 to {MOST}")


@ti.func
def _spline(before, here, ahead, after, t):
    a = ahead - before
    b = 2.0 * before - 5.0 * here + 4.0 * ahead - after
    c = 3.0 * (here - ahead) + after - before
    return here + 0.5 * t * (a + t * (b + t * c))


@ti.func
def _point(x: F32x3, i, j):
    return ti.Vector([x[i, j, 0], x[i, j, 1], x[i, j, 2]])


@ti.func
def _along(x: F32x3, present: I32x2, i, j, di: Template, dj: Template, last, share, k):
    """The point `share`/k of the way from key point (i, j) to its neighbour, and whether there is one."""
    t = ti.cast(share, ti.f32) / ti.cast(k, ti.f32)
    here, ahead = present[i, j], present[i + di, j + dj]
    on = here if share == 0 else ahead if share == k else here * ahead
    p0, p1 = _point(x, i, j), _point(x, i + di, j + dj)
    value = p0 if share == 0 else p1
    if on != 0 and 0 < share < k:
        before, after = 2.0 * p0 - p1, 2.0 * p1 - p0
        at = i * di + j * dj
        if at > 0:  # noqa: SIM102 - the index must not be read otherwise
            if present[i - di, j - dj] != 0:
                before = _point(x, i - di, j - dj)
        if at + 2 <= last:  # noqa: SIM102
            if present[i + 2 * di, j + 2 * dj] != 0:
                after = _point(x, i + 2 * di, j + 2 * dj)
        value = _spline(before, p0, p1, after, t)
    return value, on


@ti.kernel
def _refine(k: Int, point: F32x3, present: I32x2, between_out: F32x3, found_out: I32x2, crossing_out: F32x3):
    rows, cols, many = point.shape[0], point.shape[1], between_out.shape[1]
    for q in range(rows * many):
        i, m = q // many, q % many
        j = ti.max(ti.min(m // k, cols - 2), 0)
        value, on = _along(point, present, i, j, 0, 1, cols - 1, m - j * k, k)
        found_out[i, m] = on
        for c in ti.static(range(3)):
            between_out[i, m, c] = value[c] if on != 0 else 0.0
    for q in range(crossing_out.shape[0] * many):
        n, m = q // many, q % many
        i = ti.max(ti.min(n // k, rows - 2), 0)
        value, on = _along(between_out, found_out, i, m, 1, 0, rows - 1, n - i * k, k)
        for c in ti.static(range(3)):
            crossing_out[n, m, c] = value[c] if on != 0 else 0.0
