"""Ambient occlusion: the share of the sky that each particle sees, between yarns and in folds.

The transmittance of the particles along directions spread evenly (see `maps.sky`), averaged with the cosine to the
particle's normal: ambient occlusion as L. Szirmay-Kalos, T. Umenhoffer, B. Toth, L. Szecsi, M. Sbert define it
("Volumetric ambient occlusion for real-time rendering and games", 2010), without a bound on distance. Maps are
kept, so that other particles of the same scene, a mesh or the ground can be looked up in them too.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.copies import zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import OCTET
from taichi_cloth.ground.vectors import in_octets

from ..data.blocks import Layout
from ..data.light_sizes import LAYERS, SCRATCH_ROWS, SKY_DIRECTIONS, SKY_SIZE
from ..maps import seen, sky
from ..maps.deep_map import counts_for
from ..maps.map_place import blind, place_map, typical_radius
from ..maps.meshlight import walls
from ..tiles.mesh import Mesh

__all__ = ["SkyMaps", "half_sphere", "occlude"]

TEXEL = 3.0
"""The smallest texel in radii."""

FINE = 6.0
"""Depth [texels] in which the layers near either side of a texel are fine."""

BEYOND = 8.0
"""Depths of a cloth by which a place in it is moved to be out of it."""

NO_WALLS = np.zeros((2, 1), np.float32)


def half_sphere(count: int) -> NDArray[np.float64]:
    """`count` unit directions which with their opposites are spread evenly over the sphere, shape (count, 3).

    Ten are the axes through the corners of a dodecahedron, turned so that none lies along a world axis; other
    numbers half of a Fibonacci lattice.
    """
    if count == 10:
        golden = (1 + sqrt(5)) / 2
        corners = [(x, y, 1.0) for x in (-1, 1) for y in (-1, 1)]
        corners += [tuple(np.roll((0.0, s / golden, golden), k)) for s in (-1, 1) for k in range(3)]
        tilt, turn = 0.4, 0.7
        lean = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        spin = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        return np.array(corners) / sqrt(3) @ (spin @ lean)
    k = np.arange(count)
    y = 1.0 - (k + 0.5) / count
    around = pi * (3.0 - sqrt(5.0)) * k
    ring = np.sqrt(1.0 - y * y)
    return np.stack([ring * np.cos(around), y, ring * np.sin(around)], axis=1)


@dataclass(frozen=True, eq=False)
class SkyMaps:
    """How much of the sky is seen from anywhere. Made by `occlude`."""

    axes: NDArray[np.float32]
    """(maps, 5, 3), see `transmittance`."""
    maps: NDArray[np.int32]
    """First texel, width and height of each, shape (maps, 3)."""
    ends: NDArray[np.float32]
    """First and last depth [m] at which something stands, shape (2, texels); 1e30 and -1e30 where nothing does."""
    depth: NDArray[np.float32]
    """Optical depth up to the end of each layer, shape (texels, 16); undefined where nothing stands."""
    walls: NDArray[np.float32] | None
    """First and last depth [m] of a mesh, shape (2, texels); None without a mesh."""
    texel: float
    """Width of the coarsest map's texel [m]."""

    def on_particles(
        self,
        blocks: NDArray[np.float32],
        light_out: NDArray[np.float32],
        row: int,
        depth: float = 0.0,
        part: Literal["all", "cloth", "own"] = "all",
    ) -> None:
        """Write the share of the sky that packed particles see, 0..1, to light_out (blocks, rows, 16), at `row`; with a
        depth, in the six after it what a cloth `depth` [m] thick at their place sees, or a `part` of it (see
        `seen.look`)."""
        if blocks.shape[1]:
            unseen = blind(self.texel, depth)
            how = seen.Looking(self.walls is not None, depth > 0, part, unseen > 0)
            told = self._map(BEYOND * depth + self.texel, unseen, 2.0 / max(depth, 1e-9))
            octets = in_octets(blocks)
            seen.look(how, *told, octets, octets.shape[1], row, in_octets(light_out))

    def seen_from(self, points: ArrayLike, normals: ArrayLike) -> NDArray[np.float32]:
        """The share of the sky, 0..1, that world points (n, 3) [m] with unit normals (n, 3) see, shape (n,)."""
        points, normals = (np.ascontiguousarray(a, np.float32) for a in (points, normals))
        if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
            raise InputError(f"seen_from: points {points.shape}, normals {normals.shape}; allowed: (n, 3) both")
        light = np.ones(len(points), np.float32)
        if len(points):
            seen.look_at(seen.Looking(self.walls is not None, False), *self._map(), points, normals, light)
        return light

    def _map(self, beyond: float = 0.0, unseen: float = 0.0, yarns: float = 0.0) -> tuple[Any, Any, Any, Any, Any, Any]:
        """As the kernels that look up in it take it."""
        reading = np.array([0.5 * self.texel, FINE * self.texel, beyond, unseen, yarns], np.float32)
        walls = NO_WALLS if self.walls is None else self.walls
        return self.axes, self.maps, reading, self.ends, self.depth, walls

    @property
    def nbytes(self) -> int:
        return self.ends.nbytes + self.depth.nbytes + (0 if self.walls is None else self.walls.nbytes)


def occlude(
    layout: Layout,
    blocks: NDArray[np.float32],
    box: NDArray[np.float64],
    *,
    opacity: float,
    chunks: int,
    directions: int = SKY_DIRECTIONS,
    stretch: float = 1.0,
    resolution: int = SKY_SIZE,
    texel_radii: float = TEXEL,
    mesh: Mesh | None = None,
) -> SkyMaps:
    """The maps of packed particles in a box (2, 3) [m], of which each stands for `stretch` along its fibre, and of an
    opaque mesh among them."""
    radius = typical_radius(blocks)
    fits = [
        place_map(d, box, radius, resolution=resolution, texel_radii=texel_radii)[0] for d in half_sphere(directions)
    ]
    sizes = np.array([f.width * f.height for f in fits])
    table = np.array([(n, f.width, f.height) for n, f in zip(np.cumsum(sizes) - sizes, fits, strict=True)], np.int32)
    axes = np.stack([f.axes(opacity) for f in fits])
    texels, texel = int(sizes.sum()), max(f.texel for f in fits)
    ends, depth = zeros((2, texels)), zeros((texels, LAYERS))
    chunks = directions if runtime.resident() else min(chunks, directions)
    octets = in_octets(blocks)
    count = octets.shape[1]
    scratch = zeros((max(1, chunks * count), SCRATCH_ROWS, OCTET))
    sky.fill(
        layout, chunks, stretch, octets, count, axes, table, FINE * texel, scratch, ends, depth.reshape(-1, 1, LAYERS),
        counts_for(texels),
    )  # fmt: skip
    solid = None if mesh is None else walls(mesh, axes, table, chunks=chunks)
    return SkyMaps(axes, table, ends, depth, solid, texel)
