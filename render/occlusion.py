"""Ambient occlusion: the share of the sky that each particle sees, between yarns and in folds.

The transmittance of the particles (see `transmittance`) from directions spread evenly over the sphere, averaged
with the cosine to the particle's normal: what L. Szirmay-Kalos and others call the obscurance of a surface.
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from .arrays import LANES
from .blocks import Layout
from .shadow import cast

__all__ = ["SKY_DIRECTIONS", "occlude", "sphere_directions"]

SKY_DIRECTIONS = 20
"""Directions over the whole sphere; a surface sees half of them."""

STRIDE = 4
"""Of the particles along a fibre, every so many blocks the sky and reads it, for its neighbours too."""

MAP_SIZE, TEXEL = 256, 2.0
"""Texels along a map, and the smallest texel in radii: coarser than for a shadow, which has one direction."""


def sphere_directions(count: int) -> NDArray[np.float64]:
    """`count` unit directions spread evenly over the sphere (a Fibonacci lattice), shape (count, 3)."""
    k = np.arange(count)
    y = 1.0 - (2.0 * k + 1.0) / count
    around = pi * (3.0 - sqrt(5.0)) * k
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.cos(around), y, ring * np.sin(around)], axis=1)


def occlude(
    layout: Layout,
    blocks: NDArray[np.float32],
    box: NDArray[np.float64],
    light_out: NDArray[np.float32],
    row: int,
    *,
    opacity: float,
    chunks: int,
    directions: int = SKY_DIRECTIONS,
) -> None:
    """Write the share of the sky, 0..1, that packed particles see to light_out (blocks, rows, 16), at `row`."""
    stride = STRIDE if layout.elliptic else 1
    sums = np.zeros((len(blocks) * LANES // stride, 2), np.float32)
    for direction in sphere_directions(directions):
        cast(
            layout,
            blocks,
            box,
            direction,
            opacity=opacity,
            resolution=MAP_SIZE,
            texel_radii=TEXEL,
            chunks=chunks,
            stride=stride,
        ).add_sky(blocks, sums, stride=stride)
    seen = np.where(sums[:, 1] > 0, sums[:, 0] / np.maximum(sums[:, 1], 1e-9), 1.0)
    light_out[:, row] = np.repeat(seen, stride).reshape(-1, LANES)
