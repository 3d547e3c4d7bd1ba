"""Exact signs of volumes and areas of points in float64, many at once.

A determinant in float64 is right about its sign where it is larger than its rounding can be (Shewchuk 1997, "Adaptive
precision floating-point arithmetic and fast robust geometric predicates", the first of his bounds). The others, few
unless points lie in one plane, are worked out again in whole numbers: a float64 is one times a power of two.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["ROUNDING", "area_signs", "volume_signs"]

F64 = NDArray[np.float64]
Signs = NDArray[np.int8]

ROUNDING = 2.0**-53
"""Of a sum or a product, at most, as a share of it."""
VOLUME_BOUND = (7 + 56 * ROUNDING) * ROUNDING
AREA_BOUND = (3 + 16 * ROUNDING) * ROUNDING
TINY = 1e-250
"""Below which products may have lost digits by underflow: such determinants are worked out in whole numbers, too."""


def volume_signs(a: F64, b: F64, c: F64, d: F64) -> Signs:
    """(n,) −1, 0 or 1: of the volume (b − a) · (c − a) × (d − a) of points (n, 3), finite numbers."""
    points = np.stack(np.broadcast_arrays(a, b, c, d), axis=1).astype(np.float64)
    volume, most = _volume(points)
    return _settled(points, volume, VOLUME_BOUND * most, _volume)


def area_signs(a: F64, b: F64, c: F64) -> Signs:
    """(n,) −1, 0 or 1: of the area (b − a) × (c − a) of points (n, 2), finite numbers."""
    points = np.stack(np.broadcast_arrays(a, b, c), axis=1).astype(np.float64)
    area, most = _area(points)
    return _settled(points, area, AREA_BOUND * most, _area)


def _volume(points: NDArray) -> tuple[NDArray, NDArray]:
    """Of points (n, 4, 3), and the sum of the sizes of its products."""
    u, v, w = (points[:, k] - points[:, 0] for k in (1, 2, 3))
    value = size = np.zeros(len(u), np.int64)  # whole, so that whole numbers stay exact
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        first, second = v[:, j] * w[:, k], v[:, k] * w[:, j]
        value = value + u[:, i] * (first - second)
        size = size + abs(u[:, i]) * (abs(first) + abs(second))
    return value, size


def _area(points: NDArray) -> tuple[NDArray, NDArray]:
    """The same of points (n, 3, 2)."""
    u, v = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    first, second = u[:, 0] * v[:, 1], u[:, 1] * v[:, 0]
    return first - second, abs(first) + abs(second)


def _settled(points: F64, value: F64, bound: F64, again: Callable[[NDArray], tuple[NDArray, NDArray]]) -> Signs:
    """Signs of values, those within `bound` by `again` on the points as whole numbers."""
    out = np.sign(value).astype(np.int8)
    level = (points == points[:, :1]).all(axis=1).any(axis=1)  # across an axis: 0, and all products are
    unsure = np.flatnonzero(~level & ~(np.abs(value) > bound + TINY))
    if len(unsure):
        exact, _ = again(_whole(points[unsure]))
        out[unsure] = (exact > 0).astype(np.int8) - (exact < 0).astype(np.int8)
    return out


def _whole(points: F64) -> NDArray[np.object_]:
    """The same numbers times one power of two, as Python's integers."""
    mantissa, exponent = np.frexp(points)
    digits = (mantissa * 2.0**53).astype(np.int64).astype(object)
    there = points != 0
    least = int(exponent[there].min()) if there.any() else 0
    power = np.where(there, exponent - least, 0)
    return digits * np.array([1 << k for k in range(int(power.max(initial=0)) + 1)], object)[power]
