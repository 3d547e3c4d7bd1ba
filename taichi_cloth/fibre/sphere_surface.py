"""Points spread evenly over the visible surface of a sphere set, to draw the spheres themselves (Figure 1)."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fibre.sphere_set import PowerDistance, SphereSet, chunks
from taichi_cloth.ground.errors import InputError

__all__ = ["SurfacePoints", "sphere_surface_points"]


@dataclass(frozen=True)
class SurfacePoints:
    """Points on the visible surface of a sphere set: positions (n, 3) [m], outward unit normals (n, 3), the index (n,)
    of the sphere each lies on, float64 and intp; area_m2 [m^2] of that surface, so that each stands for area_m2 / n.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    sphere: NDArray[np.intp]
    area_m2: float


def sphere_surface_points(spheres: SphereSet, count: int, *, seed: int = 0) -> SurfacePoints:
    """About count points (1 to 10,000,000) spread evenly over the union's surface, to draw the spheres opaque.

    Each sphere carries a Fibonacci lattice, turned at random (seeded), with points in proportion to its area;
    points inside another sphere are dropped. How much of the area is visible is found first with a coarse
    lattice, so the number returned is near count but not equal to it. Raises InputError.
    """
    if not 1 <= count <= 10_000_000:
        raise InputError(f"fibre.surface_points: {count} is not allowed; it must be 1 to 10000000")
    areas = 4 * pi * spheres.radii**2
    lifted = PowerDistance(spheres)
    coarse = np.full(len(areas), max(4, min(400, 60_000 // len(areas))))
    seen = _visible(spheres, lifted, coarse, seed)
    visible = seen.area_m2
    if visible == 0:  # every sphere but for slivers lies in others
        visible = float(areas.max())
    wanted = areas * (count / visible)
    numbers = np.diff(np.floor(np.concatenate([[0.0], np.cumsum(wanted)]) + 0.5)).astype(np.int64)
    return _visible(spheres, lifted, numbers, seed)


def _visible(spheres: SphereSet, lifted: PowerDistance, numbers: NDArray[np.int64], seed: int) -> SurfacePoints:
    """Fibonacci lattices of numbers[i] points on sphere i, without what lies inside another sphere."""
    from scipy.spatial import KDTree  # half a second, of all that import this

    random = np.random.Generator(np.random.Philox(seed)).random((len(numbers), 4))
    turns = _random_rotations(random)
    near = KDTree(spheres.centres).query(spheres.centres, k=min(7, len(numbers)))[1].reshape(len(numbers), -1)
    kept: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]] = []
    for some in chunks(numbers.astype(np.float64), 1_000_000):
        here = numbers[some]
        sphere = np.repeat(np.arange(len(numbers))[some], here)
        rank = np.arange(len(sphere)) - np.repeat(np.cumsum(here) - here, here)
        height = 1 - (2 * rank + 1) / numbers[sphere]
        angle = rank * (pi * (3 - sqrt(5)))
        ring = np.sqrt(1 - height**2)
        normal = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
        normal = np.einsum("nij,nj->ni", turns[sphere], normal)
        position = spheres.centres[sphere] + spheres.radii[sphere, None] * normal
        for k in range(1, near.shape[1]):  # most hidden points lie in a near sphere: cheap to drop before the search
            other = near[sphere, k]
            gap = position - spheres.centres[other]
            free = np.einsum("ij,ij->i", gap, gap) >= (spheres.radii[other] * (1 - 1e-9)) ** 2
            sphere, normal, position = sphere[free], normal[free], position[free]
        free = lifted.power(position)[0] > -1e-9 if len(position) else np.zeros(0, dtype=bool)
        kept.append((position[free], normal[free], sphere[free]))
    position, normal, sphere = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    area = float(np.sum((4 * pi * spheres.radii**2 / np.maximum(numbers, 1))[sphere]))
    return SurfacePoints(position, normal, sphere, area)


def _random_rotations(random: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices (n, 3, 3) from evenly random numbers (n, >= 3) in [0, 1) (Shoemake 1992)."""
    u, v, w = random[:, 0], 2 * pi * random[:, 1], 2 * pi * random[:, 2]
    long, short = np.sqrt(1 - u), np.sqrt(u)
    x, y, z, s = long * np.sin(v), long * np.cos(v), short * np.sin(w), short * np.cos(w)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * s), 2 * (x * z + y * s)],
        [2 * (x * y + z * s), 1 - 2 * (x * x + z * z), 2 * (y * z - x * s)],
        [2 * (x * z - y * s), 2 * (y * z + x * s), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
