"""Limbs that would pass between the key points of a sheet.

Between four key points that stand at the gap g off a surface lies, at the middle of their cell, the widest hole: l/2
from all of them, l the diagonal of the cell. A ball of radius r that comes up there stands out of their plane by

    s = R − √(R² − l²/4),   R = r + g        (it goes through where R < l/2)

above the place where it would touch them. Where s is more than g and what a key point may be deep, DEEP, the sheet is
pierced. Solved for r: of limbs thinner than (l²/4 + u²) / 2u − g, u = g + DEEP, the middles of springs are needed too.
They leave holes of half the size. Solved for g: `least_gap`.
"""

from math import hypot

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from taichi_cloth.body.colliders.colliders import Colliders, Solid
from taichi_cloth.body.colliders.grid import DistanceGrid

__all__ = ["DEEP", "least_gap", "let_through", "thinnest_held"]

DEEP = 5e-4  # [m]


def thinnest_held(diagonal: float, gap: float, *, middles: bool = False) -> float:
    """Radius [m] of the thinnest limb that key points `gap` [m] off it keep out, or they and the middles of springs.

    diagonal: of a cell [m]. 0 where they keep out any limb.
    """
    hole, u = diagonal / (4 if middles else 2), gap + DEEP
    return (hole * hole + u * u) / (2 * u) - gap if u < hole else 0.0


def least_gap(diagonal: float, radius: float, *, middles: bool = False) -> float:
    """Least gap [m] at which key points, or they and the middles of springs, keep out limbs of a radius [m] or more:
    that at which `thinnest_held` is the radius, u = √(ρ² + h²) − ρ with ρ = r − DEEP and h half the hole. 0 where none
    is needed."""
    hole, rest = diagonal / (4 if middles else 2), radius - DEEP
    return max(0.0, hypot(rest, hole) - rest - DEEP)


def let_through(body: Colliders, diagonal: float) -> NDArray[np.int32]:
    """Numbers (n,) of the solids that key points alone would let through somewhere. diagonal: of a cell [m]."""
    held = [thinnest_held(diagonal, body.gap + wider) for wider in body.wider]
    return np.flatnonzero([_is_thinner(*one) for one in zip(body.solids, held, strict=True)]).astype(np.int32)


def _is_thinner(solid: Solid, radius: float) -> bool:
    """Whether some of a solid is thinner than a ball. Of a grid, to its spacing: some of its inside is farther than
    that from all balls of this radius [m] in it."""
    if isinstance(solid, DistanceGrid):
        inside = solid.values < 0
        if radius <= 0 or not inside.any():
            return False
        middles = solid.values <= -radius
        if not middles.any():
            return True
        far = np.asarray(distance_transform_edt(~middles, sampling=solid.spacing))
        return bool(far[inside].max() > radius + solid.spacing)
    return solid.thinnest < radius
