"""A shadow map of particles under one distant light, for particles, meshes and the ground.

map_ = cast(layout, blocks, box, direction, …)     once a pose and light
map_.on_particles(blocks, light, row)              transmittance of every particle
map_.shadow_at(points)                             transmittance anywhere
"""

from dataclasses import dataclass
from itertools import pairwise
from math import radians, tan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.copies import filled, zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import OCTET
from taichi_cloth.ground.vectors import in_octets

from ..data.blocks import Layout
from ..data.light_sizes import LAYERS, MAP_SIZE, STAMP_ROWS
from ..maps import lookup, transmittance
from ..maps.deep_map import EMPTY, SCALE, counts_for, new_deep_map
from ..maps.map_place import blind, lead, place_map, typical_radius
from ..maps.meshlight import walls
from ..maps.stamps import stamp
from ..tiles.mesh import Mesh

__all__ = ["ShadowMap", "cast"]

TEXEL = 1.5
"""Smallest texel, in radii of a typical particle."""

MOST_LEVELS = 6
"""Maps of halved resolution for soft light: penumbras up to 2^6 texels wide."""


BEYOND = 2.0
"""Depths of a cloth by which a place in it is moved to be out of it: along a light that falls on it at 60 degrees."""
AROUND = 0.25
"""Depths of a cloth, half a yarn, over which light goes from fibre to fibre: how far towards the light those are that
send on to a place what they get of it."""

NO_WALL = np.zeros(1, np.float32)


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
    """Of the layers, see `DeepMap`."""
    softness: float
    """Width of a penumbra [texels] per metre behind what casts it; 0 is a light without size."""
    radius: float
    """Radius of a typical particle [m]."""

    @property
    def _arrays(self) -> tuple[Any, Any, Any, Any]:
        """As kernels take them."""
        return self.axes, self.levels, self.nearest, self.through

    def _numbers(self, **place: float) -> Any:
        """For kernels that look a place up, moved by so much."""
        places = {name: float(value) for name, value in place.items()}
        return new_deep_map(span=self.span, root=self.root, softness=self.softness, **places)

    @property
    def nbytes(self) -> int:
        return self.nearest.nbytes + self.through.nbytes

    @property
    def texel(self) -> float:
        """Width of a texel of the finest map [m]."""
        return 1.0 / float(self.axes[SCALE, 0])

    def on_particles(
        self, blocks: NDArray[np.float32], light_out: NDArray[np.float32], row: int, depth: float = 0.0
    ) -> None:
        """Write the light 0..1 that reaches packed particles to light_out (blocks, rows, 16), at `row`; with a
        depth, at the rows after it what reaches a cloth `depth` [m] thick at their place, and fibres around it."""
        if blocks.shape[1]:
            lag = 0.5 * self.texel
            beyond, around = BEYOND * depth + self.texel, AROUND * depth + self.texel
            numbers = self._numbers(offset=lag, lag=lag, beyond=beyond, around=around)
            octets, light = in_octets(blocks), in_octets(light_out)
            lookup.gather(self.softness > 0, depth > 0, numbers, *self._arrays, octets, octets.shape[1], row, light)
            for at, to in ((row, 1), (row + 2, -1)):  # of the cloth alone where its fibres are not told apart
                lead(light_out, at, to, blind(self.texel, depth))

    def shadow_at(self, points: ArrayLike, *, lag: float | None = None) -> NDArray[np.float32]:
        """The light 0..1 that reaches world points (n, 3) [m], shape (n,) float32.

        lag: how far towards the light a point is moved before it reads [m]; None is a particle's radius.
        """
        points = np.ascontiguousarray(points, np.float32)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"shadow_at: points {points.shape}; allowed: (n, 3)")
        light = np.ones(len(points), np.float32)
        if len(points):
            numbers = self._numbers(lag=self.radius if lag is None else lag)
            lookup.look_up(self.softness > 0, numbers, *self._arrays, points, light)
        return light

    def shadow_on(self, points: ArrayLike, normals: ArrayLike) -> NDArray[np.float32]:
        """The light 0..1 that reaches points (n, 3) [m] of a surface with unit normals (n, 3), shape (n,): see
        `shadows_of`."""
        light = np.ones(len(np.asarray(points)), np.float32)
        if len(light):
            self.shadows_of(np.ascontiguousarray(points, np.float32), np.ascontiguousarray(normals, np.float32), light)
        return light

    def shadows_of(
        self, points: NDArray[np.float32], normals: NDArray[np.float32], light_out: NDArray[np.float32]
    ) -> None:
        """`shadow_on`, to light_out (n,), all where kernels read them.

        A point reads a texel out along its normal and one towards the light: where the surface itself, which the
        map knows only texel by texel, does not yet shadow it.
        """
        numbers = self._numbers(offset=self.texel, lag=self.texel)
        lookup.on_surface(self.softness > 0, numbers, *self._arrays, points, normals, light_out)


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
    stretch: float = 1.0,
    mesh: Mesh | None = None,
) -> ShadowMap:
    """The shadow map of packed particles, and of a mesh, under a light from `direction` (towards it, world).

    box: (2, 3) [m] that holds all. size_deg: angle across the light, as seen from the cloth; the sun has 0.5, a
    large soft box 20. resolution: texels along the longer side. texel_radii: a texel is at least so many typical
    radii wide. stretch: how many along its fibre each elongated particle stands for.
    """
    radius = typical_radius(blocks)
    at, count = place_map(
        direction, box, radius, resolution=resolution, texel_radii=texel_radii, size_deg=size_deg, levels=MOST_LEVELS
    )
    softness = 2.0 * tan(radians(size_deg) / 2) / at.texel
    levels, first = [], 0
    for k in range(count + 1):
        levels.append((first, at.width >> k, at.height >> k))
        first += (at.width >> k) * (at.height >> k)
    axes, deep = at.axes(opacity), at.deep
    root = _root(deep, max(0.5 * radius, 1e-4 * deep))
    span = ((LAYERS - 1 + root) ** 4 - root**4) / deep

    octets = in_octets(blocks)
    count = octets.shape[1]
    stamps = zeros((max(1, count), STAMP_ROWS, OCTET))
    spans = zeros((max(1, count), 2), np.int32)
    rows = np.zeros((chunks, at.height), np.int32)
    nearest, through = filled((first,), EMPTY), zeros((first, LAYERS))
    whole = np.array([(0, at.width, at.height)], np.int32)
    wall = NO_WALL if mesh is None else walls(mesh, axes[None], whole, chunks=1)[0]
    if blocks.shape[1] or mesh is not None:
        stamp(layout, chunks, stretch, octets, count, at.height, axes, stamps, spans, rows)
        cuts = _cuts(rows.sum(axis=0), chunks)
        deep = new_deep_map(width=at.width, span=span, root=root)
        transmittance.deposit(
            chunks, mesh is not None, deep, count, stamps, spans, cuts, wall, nearest,
            through.reshape(-1, 1, LAYERS), counts_for(at.width * at.height),
        )  # fmt: skip
        for fine, coarse in pairwise(levels):
            begin, wide, high = coarse
            transmittance.coarsen(fine[0], fine[1], begin, wide, high, deep, nearest, through)
    table = np.array(levels, np.int32)
    return ShadowMap(at.frame[2] * -1.0, axes, table, nearest, through, span, root, softness, radius)


def _root(deep: float, first: float) -> float:
    """The a of `transmittance` for which boundary 1 lies `first` behind boundary 0, of 0.5 to 50."""
    low, high = 0.5, 50.0
    for _ in range(40):
        a = 0.5 * (low + high)
        low, high = (low, a) if deep * ((1 + a) ** 4 - a**4) / ((15 + a) ** 4 - a**4) > first else (a, high)
    return low


def _cuts(rows: NDArray[np.int32], bands: int) -> NDArray[np.int32]:
    """Rows at which the map is cut into bands of about as many particles each, shape (bands + 1,)."""
    cumulative = np.cumsum(rows) if rows.any() else np.arange(1, len(rows) + 1)
    inner = np.searchsorted(cumulative, cumulative[-1] * np.arange(1, bands) / bands) + 1
    return np.array([0, *np.minimum(inner, len(rows)), len(rows)], np.int32)
