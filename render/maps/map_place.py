"""Where the map of a light lies: over all that is lit, on a grid that stays where it is while things move.

A texel's size goes in steps of 2^(1/4) and its corner lies on a multiple of it from the world's origin, so a pose
that differs a little has the same texels in the same places: shadows do not crawl from frame to frame.
"""

from dataclasses import dataclass
from math import ceil, log2

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.arrays import F32x3, Float, Int
from taichi_cloth.ground.copies import DeviceArray, every
from taichi_cloth.ground.particles import LANES, RADIUS

__all__ = ["LEANT", "MapPlace", "blind", "lead", "open_to", "place_map", "step_up", "typical_radius"]

SEEING, BLIND = 0.5, 1.5
"""Widths of a texel, in depths of a cloth, up to which its threads are seen, and from which on they are not at all.
A particle reads a map beside itself, out along its normal by half a texel. Where that is farther than the cloth is
thick, a fibre on a thread's flank reads within the cloth, as if it were buried there. So the wider the texels, the more
is taken what gets to the cloth as a whole; what a particle's own neighbours hide is told by its openness alone."""

LEANT = 0.2
"""How far the direction that is open to such a fibre leans from the cloth's to its own normal."""


@dataclass(frozen=True, eq=False)
class MapPlace:
    """One map. frame: rows right, up, away from the light; origin: of the map along them [m]; texel: its width [m];
    deep: depth that holds everything [m]; width, height: texels."""

    frame: NDArray[np.float64]
    origin: NDArray[np.float64]
    texel: float
    deep: float
    width: int
    height: int

    def axes(self, opacity: float) -> NDArray[np.float32]:
        """Shape (5, 3), as `deep_map` names the rows."""
        axes = np.zeros((5, 3), np.float32)
        axes[:3], axes[3] = self.frame, self.origin
        axes[4] = 1.0 / self.texel, opacity, 0.0
        return axes


def place_map(
    direction: ArrayLike,
    box: NDArray[np.float64],
    radius: float,
    *,
    resolution: int,
    texel_radii: float,
    size_deg: float = 0.0,
    levels: int = 0,
) -> tuple[MapPlace, int]:
    """The map of a light from `direction` (towards it, world) over a box (2, 3) [m], and how many halvings a light
    `size_deg` wide needs, at most `levels`.

    resolution: texels along the longer side, fewer where a texel would be smaller than texel_radii radii [m].
    """
    away = -np.asarray(direction, np.float64)
    away = away / np.linalg.norm(away)
    helper = np.array([0.0, 1.0, 0.0]) if abs(away[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(helper, away)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(away, right), away])
    corners = np.array([[box[i >> k & 1, k] for k in range(3)] for i in range(8)]) @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    deep = step_up(max(float(high[2] - low[2]), 4.0 * radius))
    texel = step_up(max(float((high - low)[:2].max()) / resolution, texel_radii * radius))
    widest = 2.0 * np.tan(np.radians(size_deg) / 2) * deep / texel
    count = min(levels, max(1, ceil(log2(max(widest, 1.5) / 1.5)))) if size_deg > 0 else 0
    block = 1 << count
    margin = block * ceil((2.0 + 4.0 * radius / texel) / block)
    first = np.floor(low[:2] / (texel * block)) * block - margin
    width, height = (block * ceil((n + 1 + margin) / block) for n in (high[:2] / texel - first).tolist())
    return MapPlace(frame, np.array([*(first * texel), low[2]]), texel, deep, width, height), count


def step_up(value: float) -> float:
    """The next power of 2^(1/4) that is not smaller."""
    return 2.0 ** (ceil(4.0 * log2(value) - 1e-6) / 4)


def typical_radius(blocks: NDArray[np.float32]) -> float:
    """Median radius [m] of up to 64 blocks spread evenly; 1e-4 without particles."""
    sample = every(blocks, max(1, blocks.shape[1] // 64))[RADIUS]
    sample = sample[sample > 0]
    return float(np.median(sample)) if len(sample) else 1e-4


def blind(texel: float, depth: float) -> float:
    """How far texels so wide [m] do not show what hides what in a cloth `depth` [m] thick, 0 to 1; 0 of no cloth."""
    return float(np.clip((texel / depth - SEEING) / (BLIND - SEEING), 0.0, 1.0)) if depth > 0 else 0.0


def open_to(normal: NDArray[np.float32], up: float) -> NDArray[np.float32]:
    """The direction that is open to fibres with these normals (3, …) in a flat cloth before which is the sky above, 1,
    or below, -1, told by maps that do not show them."""
    way = np.float32(LEANT) * normal
    way[1] += (1.0 - LEANT) * up
    return way / np.maximum(np.linalg.norm(way, axis=0), 1e-6)


def lead(light: NDArray[np.float32], row: int, to: int, share: float) -> None:
    """Lead a row of light (blocks, rows, 16) by so much to the one `to` rows after it, in place."""
    if share > 0.0 and isinstance(light, DeviceArray):
        _lead(light, row, to, share)
    elif share > 0.0:
        light[:, row] += np.float32(share) * (light[:, row + to] - light[:, row])


@ti.kernel
def _lead(light: F32x3, row: Int, to: Int, share: Float):
    for b in range(light.shape[0]):
        for lane in range(LANES):
            light[b, row, lane] += share * (light[b, row + to, lane] - light[b, row, lane])
