"""A fibre is a set of spheres, filled with particles (paper 2.1, Figures 1 and 2).

The paper: put spheres of different sizes together to the fibre's rough shape, take the box around them,
divide it evenly by the particle density, keep the lattice points inside any sphere, move each a little at
random, give it a size, and draw it with an alpha texture. The fibre's axis is x throughout, from 0 to its
length.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fibre.sphere_set import PowerDistance, SphereSet, chunks
from taichi_cloth.ground.errors import InputError

__all__ = ["FibreParticles", "lattice_point_count", "particles_in"]

LARGEST_LATTICE = 50_000_000
PARTICLE_RADIUS = 0.8
"""Radius of a particle's sprite over the lattice spacing: discs on an even lattice close (they touch at 0.5, leave
no gap from sqrt(2)/2 on) and the soft edge of an alpha texture is allowed for."""


@dataclass(frozen=True)
class FibreParticles:
    """The particles of a fibre, float32, in the order of the lattice (x slowest, z fastest).

    positions (n, 3) [m]; normals (n, 3), unit, away from the fibre's inside; tangents (n, 3), unit, along the
    fibre; depths (n,) [m] below the surface, 0 at it; radius_m the sprite's radius and spacing_m the lattice
    spacing [m].
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    tangents: NDArray[np.float32]
    depths: NDArray[np.float32]
    radius_m: float
    spacing_m: float


def lattice_point_count(spheres: SphereSet, *, spacing_m: float) -> int:
    """How many lattice points `particles_in` would look at: the box divided evenly, a multiple of nothing else."""
    return int(np.prod([float(n) for n in _lattice(spheres, spacing_m)[1]]))


def particles_in(
    spheres: SphereSet,
    *,
    spacing_m: float,
    jitter: float = 0.3,
    seed: int = 0,
    keep_inside: bool = False,
    radius_factor: float = PARTICLE_RADIUS,
) -> FibreParticles:
    """Fill the spheres with particles (paper 2.1): box, even lattice, those inside any sphere, a bounded perturbation.

    spacing_m [m] > 0 is the lattice's; its points are the middles of cubes centred on the box. jitter, 0 to
    1, times the spacing is the most a particle moves along each axis, evenly distributed; the amount depends
    on seed and on the lattice point alone, so it is the same in any order. keep_inside=False is the paper's
    rule, by which a perturbed particle may leave the spheres by up to jitter x spacing an axis; True shortens
    the moves that would, so that each stays in the sphere that holds its lattice point deepest. radius_factor
    x spacing_m is the particle's size.

    Depth and normal come from the distance of lattice points to the nearest one outside, less half a spacing,
    smoothed over 1.2 spacings for the normal, so details finer than the lattice are not seen; both follow the
    perturbation.

    Kept particles times spacing^3 tends to the union's volume at order 1 or better as the spacing shrinks
    (1.8 measured for a ball). Raises InputError; more than 50,000,000 lattice points are refused before
    anything is allocated, with the spacing that would do.
    """
    if not 0 <= jitter <= 1:
        raise InputError(f"fibre.jitter: {jitter:g} is not allowed; it must be 0 to 1 (times the spacing)")
    if not (np.isfinite(radius_factor) and radius_factor > 0):
        raise InputError(f"fibre.radius_factor: {radius_factor:g} is not allowed; it must be above 0")
    origin, shape = _lattice(spheres, spacing_m)
    inside = _fill(spheres, origin, shape, spacing_m)
    index = np.flatnonzero(inside)
    if len(index) == 0:
        raise InputError(
            f"fibre.spacing_um: {1e6 * spacing_m:g} µm is too coarse, no lattice point falls inside;"
            f" try {5e5 * float(spheres.radii.max()):.3g} µm"
        )
    cells = np.stack(np.unravel_index(index, shape), axis=1)
    points = origin + cells * spacing_m
    normals, depths = _normals_and_depths(inside, index, points, spacing_m)
    moves = _jitter(cells, seed) * (jitter * spacing_m)
    if keep_inside:
        moves *= _share_that_stays(spheres, points, moves)[:, None]
    depths = np.maximum(depths - np.einsum("ij,ij->i", moves, normals), 0.0)
    positions = points + moves
    return FibreParticles(
        positions.astype(np.float32),
        normals.astype(np.float32),
        spheres.tangents(positions).astype(np.float32),
        depths.astype(np.float32),
        radius_factor * spacing_m,
        float(spacing_m),
    )


def _lattice(spheres: SphereSet, spacing: float) -> tuple[NDArray[np.float64], tuple[int, int, int]]:
    """The first lattice point and the number of points along x, y, z; refused when there would be too many."""
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"fibre.spacing_um: {1e6 * spacing:g} µm is not allowed; it must be finite and above 0")
    low, high = spheres.bounding_box()
    numbers = np.maximum(np.ceil((high - low) / spacing * (1 - 1e-12)), 1.0)
    total = float(np.prod(numbers))
    if total > LARGEST_LATTICE:
        enough = float(spacing * (total / LARGEST_LATTICE) ** (1 / 3) * 1.02)
        raise InputError(
            f"fibre.spacing_um: {1e6 * spacing:g} µm makes {total:.3g} lattice points, the limit is"
            f" {LARGEST_LATTICE:.0e}; {1e6 * enough:.3g} µm or more would do"
        )
    shape = (int(numbers[0]), int(numbers[1]), int(numbers[2]))
    return 0.5 * (low + high) - 0.5 * (numbers - 1) * spacing, shape


def _fill(
    spheres: SphereSet, origin: NDArray[np.float64], shape: tuple[int, int, int], spacing: float
) -> NDArray[np.bool_]:
    """Which lattice points lie in any sphere, (nx, ny, nz): each sphere is drawn row by row along z, like a disc.

    Every row is one interval of z; its start counts +1 and its end -1, and the running sum is above 0 inside.
    The work is the number of rows, about pi (r/spacing)^2 a sphere, not the number of lattice points.
    """
    nx, ny, nz = shape
    edges = np.zeros((nx, ny, nz + 1), dtype=np.int32)
    flat = edges.reshape(-1)
    centre, radius = (spheres.centres - origin) / spacing, spheres.radii / spacing
    for some in chunks((2 * radius + 1) ** 2, 4_000_000):
        c, r = centre[some], radius[some]
        low = np.maximum(np.ceil(c[:, :2] - r[:, None]), 0).astype(np.int64)
        high = np.minimum(np.floor(c[:, :2] + r[:, None]), [nx - 1, ny - 1]).astype(np.int64)
        size = np.maximum(high - low + 1, 0)
        rows = size[:, 0] * size[:, 1]
        sphere = np.repeat(np.arange(len(r)), rows)
        rank = np.arange(len(sphere)) - np.repeat(np.cumsum(rows) - rows, rows)
        i = low[sphere, 0] + rank // size[sphere, 1]
        j = low[sphere, 1] + rank % size[sphere, 1]
        rest = r[sphere] ** 2 - (i - c[sphere, 0]) ** 2 - (j - c[sphere, 1]) ** 2
        half = np.sqrt(np.maximum(rest, 0.0))
        first = np.maximum(np.ceil(c[sphere, 2] - half), 0).astype(np.int64)
        last = np.minimum(np.floor(c[sphere, 2] + half), nz - 1).astype(np.int64)
        hit = (rest >= 0) & (first <= last)
        row = (i[hit] * ny + j[hit]) * (nz + 1)
        np.add.at(flat, row + first[hit], 1)
        np.add.at(flat, row + last[hit] + 1, -1)
    return np.cumsum(edges, axis=2)[:, :, :nz] > 0


def _normals_and_depths(
    inside: NDArray[np.bool_], index: NDArray[np.intp], points: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Outward unit normals (n, 3) and depths (n,) [m] of the lattice points kept."""
    from scipy import ndimage  # a fifth of a second, of all that import this

    padded = np.pad(inside, 3)
    core = (slice(3, -3),) * 3
    distance = np.asarray(ndimage.distance_transform_edt(padded), dtype=np.float32)
    depths = np.maximum(distance[core].reshape(-1)[index] - 0.5, 0.0).astype(np.float64) * spacing
    # Outside, one smoothed step of -1 stands for the distance there: enough to tilt the gradient at the
    # surface.
    distance[~padded] = -0.5
    smooth = ndimage.gaussian_filter(distance, 1.2, truncate=2.5)
    padded_index = np.ravel_multi_index(tuple(k + 3 for k in np.unravel_index(index, inside.shape)), padded.shape)
    flat, normals = smooth.reshape(-1), np.empty((len(index), 3))
    for axis, stride in enumerate((padded.shape[1] * padded.shape[2], padded.shape[2], 1)):
        normals[:, axis] = flat[padded_index - stride] - flat[padded_index + stride]
    length = np.linalg.norm(normals, axis=1)
    flat_spot = length < 1e-3  # the middle of the fibre has no outside: point away from the axis
    normals[flat_spot] = points[flat_spot] * [0.0, 1.0, 1.0]
    length[flat_spot] = np.linalg.norm(normals[flat_spot], axis=1)
    normals[length == 0], length[length == 0] = (0.0, 0.0, 1.0), 1.0
    return normals / length[:, None], depths


def _jitter(cells: NDArray[np.intp], seed: int) -> NDArray[np.float64]:
    """Three numbers in [-1, 1) for each lattice point (n, 3): a counter-based generator (SplitMix64's finisher).

    The counter is made of the point's own i, j, k and the seed, so neither order nor neighbours matter.
    """
    with np.errstate(over="ignore"):
        word = _mix(np.full(len(cells), int(seed) & (2**64 - 1), dtype=np.uint64))
        for axis in range(3):
            word = _mix(word ^ (cells[:, axis].astype(np.uint64) + np.uint64(axis << 40)))
    parts = np.stack([(word >> np.uint64(shift)) & np.uint64(2**21 - 1) for shift in (0, 21, 42)], axis=1)
    return parts.astype(np.float64) * 2.0**-20 - 1.0


def _mix(word: NDArray[np.uint64]) -> NDArray[np.uint64]:
    word = word + np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


def _share_that_stays(
    spheres: SphereSet, points: NDArray[np.float64], moves: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest f in 0 to 1, (n,), by which point + f x move stays in the sphere that holds the point deepest."""
    _, owner = PowerDistance(spheres).power(points)
    at = points - spheres.centres[owner]
    a = np.maximum(np.einsum("ij,ij->i", moves, moves), 1e-300)
    b = np.einsum("ij,ij->i", at, moves)
    c = np.minimum(np.einsum("ij,ij->i", at, at) - spheres.radii[owner] ** 2, 0.0)
    return np.clip((-b + np.sqrt(b * b - a * c)) / a, 0.0, 1.0)
