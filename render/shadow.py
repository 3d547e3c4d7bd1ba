"""A shadow map of particles under one distant light, for particles, meshes and the ground.

map_ = cast(layout, blocks, box, direction, …)     once a pose and light
map_.on_particles(blocks, light, row)              transmittance of every particle
map_.shadow_at(points)                             transmittance anywhere
"""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, log2, radians, tan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import lookup, transmittance
from .arrays import LANES
from .blocks import RADIUS, Layout
from .errors import RenderError
from .transmittance import EMPTY, LAYERS, STAMP_SIZE

__all__ = ["MAP_SIZE", "ShadowMap", "cast"]

MAP_SIZE = 512
"""Texels along the longer side of a map; fewer where a texel would be smaller than TEXEL radii."""

TEXEL = 1.5
"""Smallest texel, in radii of a typical particle."""

MOST_LEVELS = 6
"""Maps of halved resolution for soft light: penumbras up to 2^6 texels wide."""


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Transmittance at 16 boundaries behind the first depth of every texel (see `transmittance`)."""

    direction: NDArray[np.float64]
    """Towards the light, unit, shape (3,)."""
    axes: NDArray[np.float32]
    """Rows right, up, away from the light, origin, scale: shape (5, 3)."""
    levels: NDArray[np.int32]
    """First texel, width and height of each resolution, shape (levels, 3); the finest first."""
    nearest: NDArray[np.float32]
    """Depth [m] at which light first meets something, EMPTY where it never does, shape (texels,)."""
    through: NDArray[np.float32]
    """Transmittance at the boundaries of the layers, shape (texels, 16); undefined where empty."""
    span: float
    root: float
    softness: float
    """Width of a penumbra [texels] per metre behind what casts it; 0 is a light without size."""
    radius: float
    """Radius of a typical particle [m]."""

    @property
    def texel(self) -> float:
        """Width of a texel of the finest map [m]."""
        return 1.0 / float(self.axes[transmittance.SCALE, 0])

    def on_particles(self, blocks: NDArray[np.float32], light_out: NDArray[np.float32], row: int) -> None:
        """Write the light 0..1 that reaches packed particles to light_out (blocks, rows, 16), at `row`."""
        if len(blocks):
            lookup.gather(
                self.softness > 0, blocks, self.axes, 0.5 * self.texel, 0.5 * self.texel, self.levels,
                self.softness, self.span, self.root, self.nearest, self.through, row, light_out,
            )  # fmt: skip

    def add_sky(self, blocks: NDArray[np.float32], sums: NDArray[np.float32], *, stride: int = 1) -> None:
        """Add this direction to sums (particles / stride, 2), weighted by the cosine to each particle's normal."""
        if len(blocks):
            lookup.ambient(
                stride, blocks, self.axes, 0.5 * self.texel, 0.5 * self.texel, self.levels,
                self.span, self.root, self.nearest, self.through, sums,
            )  # fmt: skip

    def shadow_at(self, points: ArrayLike, *, lag: float | None = None) -> NDArray[np.float32]:
        """The light 0..1 that reaches world points (n, 3) [m], shape (n,) float32.

        lag: how far towards the light a point is moved before it reads [m]; None is a particle's radius.
        """
        points = np.ascontiguousarray(points, np.float32)
        if points.ndim != 2 or points.shape[1] != 3:
            raise RenderError(f"shadow_at: points {points.shape}; allowed: (n, 3)")
        light = np.ones(len(points), np.float32)
        if len(points):
            lookup.look_up(
                self.softness > 0, points, self.axes, self.radius if lag is None else lag, self.levels,
                self.softness, self.span, self.root, self.nearest, self.through, light,
            )  # fmt: skip
        return light


def cast(
    layout: Layout,
    blocks: NDArray[np.float32],
    box: NDArray[np.float64],
    direction: ArrayLike,
    *,
    opacity: float = 1.0,
    size_deg: float = 0.0,
    resolution: int = MAP_SIZE,
    texel_radii: float = TEXEL,
    chunks: int = 2,
    stride: int = 1,
) -> ShadowMap:
    """The shadow map of packed particles under a light from `direction` (towards it, world).

    box: (2, 3) [m] that holds the particles. size_deg: angle across the light, as seen from the cloth; the sun
    has 0.5, a large soft box 20. resolution: texels along the longer side. texel_radii: a texel is at least so
    many typical radii wide. stride: 1, 2, 4, 8 or 16; take every so many of elongated particles, each so much longer.
    """
    away = -np.asarray(direction, np.float64)
    away = away / np.linalg.norm(away)
    helper = np.array([0.0, 1.0, 0.0]) if abs(away[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(helper, away)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(away, right), away])
    corners = np.array([[box[i >> k & 1, k] for k in range(3)] for i in range(8)]) @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    radius = _typical_radius(blocks)
    deep = max(float(high[2] - low[2]), 4.0 * radius)
    texel = max(float((high - low)[:2].max()) / resolution, texel_radii * radius)
    softness = 2.0 * tan(radians(size_deg) / 2) / texel
    count = min(MOST_LEVELS, max(1, ceil(log2(max(softness * deep, 4.0))) - 1)) if size_deg > 0 else 0
    block = 1 << count
    margin = block * ceil((2.0 + 4.0 * radius / texel) / block)
    origin = (np.floor(low[:2] / texel) - margin) * texel
    width, height = (block * ceil((n / texel + 1 + margin) / block) for n in (high[:2] - origin).tolist())
    levels, first = [], 0
    for k in range(count + 1):
        levels.append((first, width >> k, height >> k))
        first += (width >> k) * (height >> k)
    axes = np.zeros((5, 3), np.float32)
    axes[:3], axes[3] = frame, (*origin, low[2])
    axes[4] = 1.0 / texel, opacity, 0.0
    root = _root(deep, max(0.5 * radius, 1e-4 * deep))
    span = ((LAYERS - 1 + root) ** 4 - root**4) / deep

    n = len(blocks) * LANES
    stamps = np.empty((n, STAMP_SIZE), np.float32)
    rows = np.zeros((chunks, height), np.int32)
    nearest = np.empty(first, np.float32)
    through = np.empty((first, LAYERS), np.float32)
    table = np.array(levels, np.int32)
    if n == 0:
        nearest[:] = EMPTY
    else:
        transmittance.stamp(layout, chunks, stride, blocks, len(blocks), height, axes, stamps, rows)
        cuts = _cuts(rows.sum(axis=0), chunks)
        transmittance.deposit(
            chunks, n, stamps, cuts, width, span, root, nearest, through, through.reshape(-1, 1, LAYERS)
        )
        for fine, coarse in pairwise(levels):
            first, wide, high = coarse
            transmittance.coarsen(fine[0], fine[1], first, wide, high, span, root, nearest, through)
    return ShadowMap(-away, axes, table, nearest, through, span, root, softness, radius)


def _typical_radius(blocks: NDArray[np.float32]) -> float:
    """Median radius [m] of up to 64 blocks spread evenly; 1e-4 without particles."""
    sample = blocks[:: max(1, len(blocks) // 64), RADIUS]
    sample = sample[sample > 0]
    return float(np.median(sample)) if len(sample) else 1e-4


def _root(deep: float, first: float) -> float:
    """The a of `transmittance` for which boundary 1 lies `first` behind boundary 0, of 0.5 to 50."""
    low, high = 0.5, 50.0
    for _ in range(40):
        a = 0.5 * (low + high)
        low, high = (low, a) if deep * ((1 + a) ** 4 - a**4) / ((15 + a) ** 4 - a**4) > first else (a, high)
    return low


def _cuts(rows: NDArray[np.int32], bands: int) -> NDArray[np.int32]:
    """Rows at which the map is cut into bands of about as many particles each, shape (bands + 1,)."""
    cumulative = np.cumsum(rows)
    inner = np.searchsorted(cumulative, cumulative[-1] * np.arange(1, bands) / bands) + 1
    return np.array([0, *np.minimum(inner, len(rows)), len(rows)], np.int32)
