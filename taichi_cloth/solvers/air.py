"""Drag and lift of the air in float64 on the host: the same law as `stencil.Stencil.air` (see `forces.Wind`)."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.forces import Wind
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["air_forces"]

F64 = NDArray[np.float64]


def _span(positions: F64, weight: F64, axis: int) -> F64:
    """Sum of the vectors to the two neighbours along an axis, as if each went forward; 0 where there is none."""
    here = np.minimum(2 * np.moveaxis(weight, axis, 0)[:-1], 1.0)[..., None]
    d = here * np.diff(np.moveaxis(positions, axis, 0), axis=0)
    out = np.zeros_like(np.moveaxis(positions, axis, 0))
    out[:-1] += d
    out[1:] += d
    return np.moveaxis(out, 0, axis)


def air_forces(sheet: Sheet, wind: Wind, air: tuple[float, float, float], x: F64, v: F64) -> tuple[F64, F64]:
    """Force on every key point (rows, cols, 3) [N], and (rows, cols) |force| / |air − v| [N s/m].

    air: velocity of the air [m/s]. x [m], v [m/s]: of the key points, (rows, cols, 3).
    """
    east, north, _ = sheet.weights
    area = 0.25 * np.cross(_span(x, east, 1), _span(x, north, 0))
    u = np.asarray(air) - v
    speed = np.sqrt((u**2).sum(-1, keepdims=True) + 1e-30)
    size = np.sqrt((area**2).sum(-1, keepdims=True) + 1e-30)
    through = (area * u).sum(-1, keepdims=True)
    drag, lift = 0.5 * wind.air_density * wind.drag, 0.5 * wind.air_density * wind.lift
    along = drag * np.abs(through) - lift * through**2 / (size * speed)
    force = along * u + lift * through * speed / size * area
    return force, np.linalg.norm(force, axis=-1) / speed[..., 0]
