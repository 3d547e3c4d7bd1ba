"""The surface of a fibre as a height map, to lay it on the course of any fibre of that kind (paper 2.1, Figure 1).

A sphere set seen from its axis: how far the surface is in each direction at each place along the fibre. The map
closes on itself both ways, so that pieces of fibre can be laid end to end.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fibre.sphere_set import SphereSet

__all__ = ["skin_of"]

BLEND = 0.15
"""Share of the length over which the end is led into the beginning."""


def skin_of(spheres: SphereSet, *, rows: int = 256, columns: int = 128) -> NDArray[np.float32]:
    """(rows, columns) float32: distance of the surface from the axis, along the fibre and around it, over the
    radius of the circle of the mean section's area.

    At x, a sphere of centre c and radius r shows a circle of ρ² = r² − (x − cₓ)²; seen from the axis in the unit
    direction d it reaches to d·c + √(ρ² − |d × c|²). The farthest counts: hollows behind a bulge are filled.
    """
    low, high = (float(v[0]) for v in spheres.bounding_box())
    inset = float(np.median(spheres.radii))  # the ends are rounded: begin and stop inside
    low, high = low + inset, high - inset
    angle = 2 * pi * np.arange(columns) / columns
    c, s = np.cos(angle), np.sin(angle)
    extra = max(1, round(BLEND * rows))
    reach = np.empty((rows + extra, columns))
    x, y, z = spheres.centres.T
    for row, at in enumerate(np.linspace(low, high, rows + extra)):
        near = np.abs(x - at) < spheres.radii
        squared = spheres.radii[near, None] ** 2 - (x[near, None] - at) ** 2
        beside = squared - (y[near, None] * s - z[near, None] * c) ** 2
        ahead = y[near, None] * c + z[near, None] * s + np.sqrt(np.maximum(beside, 0.0))
        reach[row] = np.where(beside > 0, ahead, 0.0).max(axis=0, initial=0.0)
    weight = (np.arange(extra) + 1.0)[:, None] / (extra + 1)
    skin = reach[:rows].copy()
    skin[:extra] = weight * reach[:extra] + (1 - weight) * reach[rows:]
    skin = np.maximum(skin, 0.05 * skin.max())
    return (skin / np.sqrt(np.mean(skin**2))).astype(np.float32)
