"""Distances to triangles, each of many points to its own."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["triangle_distance"]

F64 = NDArray[np.float64]


def triangle_distance(p: F64, triangles: F64) -> F64:
    """Distance (n,) [m] from points p (n, 3) to triangles (n, 3, 3): to the plane where its foot lies inside, else to
    the nearest edge."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    square = (normal**2).sum(axis=1)
    within = square > 0
    nearest = np.full(len(p), np.inf)
    for u, v in ((a, b), (b, c), (c, a)):
        edge = v - u
        within &= (np.cross(edge, p - u) * normal).sum(axis=1) >= 0
        along = ((p - u) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300)
        nearest = np.minimum(nearest, np.linalg.norm(p - u - np.clip(along, 0, 1)[:, None] * edge, axis=1))
    plane = np.abs(((p - a) * normal).sum(axis=1)) / np.sqrt(np.maximum(square, 1e-300))
    return np.where(within, plane, nearest)
