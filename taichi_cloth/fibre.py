"""A fibre is a set of spheres, filled with particles (paper 2.1, Figures 1 and 2).

The paper: put spheres of different sizes together to the fibre's rough shape, take the box around them,
divide it evenly by the particle density, keep the lattice points inside any sphere, move each a little at
random, give it a size, and draw it with an alpha texture. The fibre's axis is x throughout, from 0 to its
length.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from taichi_cloth.errors import InputError, did_you_mean

__all__ = [
    "FIBRES",
    "FibreKind",
    "FibreParticles",
    "SphereSet",
    "SurfacePoints",
    "contour",
    "in_union",
    "known_contours",
    "lattice_point_count",
    "particles_in",
    "sphere_set_from_rows",
    "sphere_surface_points",
]

UM = 1e-6
LARGEST_SPHERE_COUNT = 100_000
LARGEST_LATTICE = 50_000_000
PARTICLE_RADIUS = 0.8
"""Radius of a particle's sprite over the lattice spacing: discs on an even lattice close (they touch at 0.5, leave
no gap from sqrt(2)/2 on) and the soft edge of an alpha texture is allowed for."""


@dataclass(frozen=True)
class FibreKind:
    """What a textile person would look up of a fibre. SI, but for the customary fineness and width.

    density_kg_m3 and fineness_dtex: Morton & Hearle, Physical Properties of Textile Fibres, 4th ed., ch. 3
    and 5 (typical apparel grades, dry); width_um: the wider way across. colour: linear-light RGB of the
    undyed fibre, chosen by eye. finish: name of the surface look to draw it with. section_um2
    follows from fineness and density: 1 dtex = 1e-7 kg/m.
    """

    name: str
    density_kg_m3: float
    fineness_dtex: float
    width_um: float
    colour: tuple[float, float, float]
    finish: str
    shape: str

    @property
    def section_um2(self) -> float:
        """Area of the solid cross-section, fineness over density [um^2]."""
        return self.fineness_dtex * 1e-7 / self.density_kg_m3 * 1e12


FIBRES: dict[str, FibreKind] = {
    kind.name: kind
    for kind in (
        FibreKind("cotton", 1520, 1.7, 17.4, (0.80, 0.76, 0.66), "cotton", "twisted flat ribbon; bean section"),
        FibreKind("wool", 1310, 4.1, 20.8, (0.72, 0.66, 0.52), "wool", "overlapping scales; round section"),
        FibreKind("silk", 1340, 1.2, 11.9, (0.83, 0.79, 0.70), "silk", "smooth; rounded triangle"),
        FibreKind("viscose", 1520, 1.7, 15.0, (0.85, 0.85, 0.83), "viscose", "furrowed; lobed section"),
        FibreKind("polyester", 1380, 1.7, 12.5, (0.86, 0.86, 0.87), "polyester", "smooth; round section"),
    )
}


@dataclass(frozen=True)
class SphereSet:
    """The fibre's shape as a union of spheres: centres (n, 3) and radii (n,) [m], float64, 1 to 100,000 spheres.

    turn_x_m and turn_rad, both (k,) or both None, say how far the section is turned about x at each place
    along x, so that particles know the direction of the fibre's surface; None is a fibre that is not twisted.
    Raises InputError.
    """

    centres: NDArray[np.float64]
    radii: NDArray[np.float64]
    turn_x_m: NDArray[np.float64] | None = None
    turn_rad: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        centres, radii = np.array(self.centres, dtype=np.float64), np.array(self.radii, dtype=np.float64)
        if centres.ndim != 2 or centres.shape[1] != 3 or radii.shape != centres.shape[:1]:
            raise InputError(
                f"fibre.spheres: centres of shape {centres.shape} with radii of shape {radii.shape};"
                " they must be (n, 3) and (n,)"
            )
        if not 1 <= len(radii) <= LARGEST_SPHERE_COUNT:
            raise InputError(f"fibre.spheres: {len(radii)} spheres; allowed 1 to {LARGEST_SPHERE_COUNT}")
        wrong = ~(np.isfinite(centres).all(axis=1) & np.isfinite(radii) & (radii > 0))
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(
                f"fibre.spheres: sphere {i} has centre {centres[i].tolist()} and radius {radii[i]:g} m;"
                " all must be finite and the radius above 0"
            )
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "radii", radii)

    def bounding_box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner, each (3,) [m], of the box around all spheres."""
        r = self.radii[:, None]
        return (self.centres - r).min(axis=0), (self.centres + r).max(axis=0)

    def tangents(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Direction of the fibre's surface at points (n, 3) [m]: x, sheared by the section's turn. Unit, (n, 3)."""
        tangent = np.zeros_like(points)
        tangent[:, 0] = 1.0
        if self.turn_x_m is None or self.turn_rad is None:
            return tangent
        rate = np.interp(points[:, 0], self.turn_x_m, np.gradient(self.turn_rad, self.turn_x_m))
        tangent[:, 1], tangent[:, 2] = -rate * points[:, 2], rate * points[:, 1]
        return tangent / np.linalg.norm(tangent, axis=1, keepdims=True)


def sphere_set_from_rows(rows: Sequence[Sequence[float]] | ArrayLike) -> SphereSet:
    """A user's own fibre: rows [x, y, z, r] in micrometres, x along the fibre. Raises InputError naming the row."""
    checked: list[list[float]] = []
    if isinstance(rows, str) or not isinstance(rows, Sequence | np.ndarray):
        raise InputError(f"fibre.spheres: {rows!r} is not a list of rows [x, y, z, r] in micrometres")
    if len(rows) > LARGEST_SPHERE_COUNT:
        raise InputError(f"fibre.spheres: {len(rows)} rows; allowed 1 to {LARGEST_SPHERE_COUNT}")
    for number, row in enumerate(rows, start=1):
        try:
            values = [float(value) for value in row]  # type: ignore[union-attr]
        except (TypeError, ValueError):
            values = []
        if len(values) != 4 or isinstance(row, str) or not np.isfinite(values).all() or values[3] <= 0:
            raise InputError(
                f"fibre.spheres: row {number} is {str(row)[:60]};"
                " give four finite numbers [x, y, z, r] in micrometres, r > 0"
            )
        checked.append(values)
    table = np.array(checked, dtype=np.float64).reshape(-1, 4) * UM
    return SphereSet(table[:, :3], table[:, 3])


# ---- the contours of known fibres


def known_contours() -> tuple[str, ...]:
    """Names that `contour` knows."""
    return tuple(FIBRES)


def contour(kind: str, *, length_m: float = 240 * UM, width_m: float | None = None) -> SphereSet:
    """The spheres of a known fibre, from x = 0 to length_m [m].

    width_m [m], the wider way across, defaults to the fibre's usual one; the section keeps its proportions.
    The lengthwise pattern of cotton and wool keeps its own length. Raises InputError for an unknown kind, a
    length under one width or over 20 mm, a width not in 1 um to 1 mm, or more than 100,000 spheres.
    """
    if kind not in FIBRES:
        raise InputError(
            f'fibre.contour: unknown fibre "{kind}"; known: {", ".join(FIBRES)}{did_you_mean(kind, FIBRES)}'
        )
    usual = FIBRES[kind].width_um * UM
    width = usual if width_m is None else float(width_m)
    if not UM <= width <= 1000 * UM:
        raise InputError(f"fibre.width_m: {width:g} m is not allowed; a fibre is 1e-06 to 0.001 m wide")
    if not width <= length_m <= 0.02:
        raise InputError(f"fibre.length_m: {length_m:g} m is not allowed; it must be {width:g} (its width) to 0.02 m")
    return CONTOURS[kind](float(length_m), width / usual)


def _stations(length: float, step: float) -> NDArray[np.float64]:
    return np.linspace(0.0, length, max(2, ceil(length / step) + 1))


def _refuse_too_many(count: int) -> None:
    if count > LARGEST_SPHERE_COUNT:
        raise InputError(
            f"fibre.length_m: this fibre needs {count} spheres, the limit is {LARGEST_SPHERE_COUNT};"
            " give a shorter length"
        )


def _swept(
    length: float, x: NDArray[np.float64], section: ArrayLike, r: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (n, 3) and radii (n,) of sections y + iz, broadcast to (stations, spheres), between x = 0 and length.

    At the ends spheres are drawn back by their radius, so that the fibre ends at 0 and length.
    """
    y, z = np.real(section), np.imag(section)
    x, y, z, r = np.broadcast_arrays(x[:, None], y, z, np.asarray(r, dtype=np.float64))
    inside = np.clip(x, np.minimum(r, 0.5 * length), np.maximum(length - r, 0.5 * length))
    return np.stack([inside.ravel(), y.ravel(), z.ravel()], axis=1), r.ravel()


def _cotton(length: float, scale: float) -> SphereSet:
    """A collapsed tube: a bean section, 17 um by 8 um, bent round the line where the lumen closed.

    It is twisted by half a turn (one convolution) every 100 um, and the sense reverses. Convolutions of
    mature cotton: 200 to 300 per inch, 85 to 125 um each; bean section and convolutions: Morton & Hearle ch.
    1 and 3.10. Width and pitch vary along a real fibre, here by smooth 8 % and 25 %. A reversal comes every
    340 um (real ones are further apart) so that a short piece shows one.
    """
    um = UM * scale
    x = _stations(length, 1.2 * um)
    _refuse_too_many(len(x) * 15)
    phase = 2 * pi * (x / (680 * UM) + 0.01)
    swing = np.arcsin(0.985 * np.sin(phase)) * (340 / 100)  # a triangle wave with rounded tips: 3.4 half turns
    turn = swing + 0.35 * np.sin(2 * pi * x / (74 * UM) + 1.0)
    breadth = 1 + 0.08 * np.sin(2 * pi * x / (57 * UM)) * np.cos(2 * pi * x / (131 * UM) + 0.6)
    along = np.linspace(-1.0, 1.0, 15)  # across the ribbon
    rim = (2.75 + 0.75 * along**2) * um  # thicker edges, the two rolled rims of the collapsed tube
    bent, across = 2.3 * um * (along**2 - 0.45), 5.2 * um * along
    section = across * breadth[:, None] + 1j * bent / breadth[:, None]
    centres, radii = _swept(length, x, section * np.exp(1j * turn)[:, None], rim)
    return SphereSet(centres, radii, x, turn)


def _wool(length: float, scale: float) -> SphereSet:
    """Round, 21 um over the scale edges, with scales like roof tiles, their free edges toward +x (the tip).

    Fine merino: 19 to 21 um, edges about 0.7 um high and 9 to 14 um apart (up to 700 scales per cm), two or
    so scales around, their edges wavy: Morton & Hearle ch. 1; Wildman, The Microscopy of Animal Textile
    Fibres, 1954. A core of large spheres is covered by a shell of small ones whose height rises along each
    scale and drops at its edge.
    """
    um = UM * scale
    small, around = 1.3 * um, 64
    x, angle = _stations(length, 0.8 * um), np.arange(around) * (2 * pi / around)
    core = _stations(length, 2.0 * um)
    _refuse_too_many(len(x) * around + len(core))
    angles = angle[None, :] + 0.5 * (np.arange(len(x)) % 2)[:, None] * (2 * pi / around)
    # Edge k lies at k + wave_k(angle) pitches: two rounded tips around, notches between, turned at random per scale.
    place = x[:, None] / (12.5 * UM)
    random = np.random.Generator(np.random.Philox(1954)).random((ceil(length / (12.5 * UM)) + 4, 3))

    def edge(k: NDArray[np.intp]) -> NDArray[np.float64]:
        tip, wave, shift = random[k + 2, 0], random[k + 2, 1], random[k + 2, 2]
        return (
            k
            + 0.34 * np.abs(np.sin(angles + 2 * pi * tip))
            + 0.07 * np.sin(3 * angles + 2 * pi * wave)
            + 0.2 * (shift - 0.5)
        )

    below = np.floor(place).astype(np.intp) + np.zeros_like(angles, dtype=np.intp)
    for _ in range(2):
        below = np.where(edge(below) > place, below - 1, below)
    rise = (place - edge(below)) / (edge(below + 1) - edge(below))
    reach = (8.0 + 0.25 * np.sin(2 * pi * x / (90 * UM)))[:, None] * um + 1.1 * um * rise
    centres, radii = _swept(length, x, reach * np.exp(1j * angles), small)
    inner, inner_radii = _swept(length, core, 0.0, 8.3 * um)
    return SphereSet(np.concatenate([inner, centres]), np.concatenate([inner_radii, radii]))


def _silk(length: float, scale: float) -> SphereSet:
    """A degummed silk filament: smooth, a triangle with rounded corners and slightly bulging sides, 12 um wide.

    Section and width (10 to 13 um, 1.0 to 1.3 dtex): Morton & Hearle 3.10; Bombyx mori. The triangle turns
    slowly, a few degrees over the piece, as drawn silk does.
    """
    um = UM * scale
    x = _stations(length, 0.8 * um)
    corner, side = 2.3 * um, np.linspace(0, 1, 8)[:-1]
    points = []
    for k in range(3):
        begin, end = (np.exp(1j * (pi / 2 + 2 * pi * (k + j) / 3)) for j in (0, 1))
        edge = begin + (end - begin) * side
        points.append(edge * (1 + 0.25 * 4 * side * (1 - side)))
    rim = np.concatenate(points) * 4.0 * um
    section = np.concatenate([rim, rim[::2] * 0.5])
    _refuse_too_many(len(x) * len(section))
    turn = 0.35 * np.sin(2 * pi * x / (900 * UM))
    turned = section[None, :] * np.exp(1j * turn)[:, None]
    centres, radii = _swept(length, x, turned, corner)
    return SphereSet(centres, radii, x, turn)


VISCOSE_LOBES = 8


def _viscose(length: float, scale: float) -> SphereSet:
    """A regenerated fibre whose skin shrank on its core: eight uneven lobes, the furrows running along the fibre.

    Serrated section, 12 to 15 um at 1.7 dtex, from the wet spinning of regular viscose: Morton & Hearle 3.10.
    """
    um = UM * scale
    x = _stations(length, 0.6 * um)
    lobe = np.arange(VISCOSE_LOBES)
    angle = 2 * pi * (lobe + 0.22 * np.sin(2.1 * lobe + 0.5)) / VISCOSE_LOBES
    radius = (1.85 + 0.30 * np.cos(1.7 * lobe)) * um
    reach = (4.55 + 0.40 * np.sin(3.3 * lobe + 1.0) + 0.4 * np.cos(2 * angle)) * um
    fans = [(part * reach * np.exp(1j * angle), radius) for part in (1.0, 0.8, 0.6)]
    core = np.array([0.0, 1.3, 1.3j, -1.3, -1.3j]) * um
    section = np.concatenate([spot for spot, _ in fans] + [core])
    radii = np.concatenate([r for _, r in fans] + [np.full(len(core), 3.1 * um)])
    _refuse_too_many(len(x) * len(section))
    wander = 1 + 0.02 * np.sin(2 * pi * x / (83 * UM))
    centres, all_radii = _swept(length, x, section * wander[:, None], radii)
    return SphereSet(centres, all_radii)


def _polyester(length: float, scale: float) -> SphereSet:
    """Melt-spun through a round hole: a smooth cylinder, 12.5 um across at 1.7 dtex (Morton & Hearle 3.10)."""
    um = UM * scale
    x = _stations(length, 0.8 * um)
    _refuse_too_many(len(x))
    centres, radii = _swept(length, x, 0.0, 6.26 * um)
    return SphereSet(centres, radii)


CONTOURS: dict[str, Callable[[float, float], SphereSet]] = {
    "cotton": _cotton,
    "wool": _wool,
    "silk": _silk,
    "viscose": _viscose,
    "polyester": _polyester,
}


# ---- the particles in it


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
            f"fibre.spacing_m: {spacing_m:g} m is too coarse, no lattice point falls inside;"
            f" try {float(spheres.radii.max()) / 2:.3g} m"
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


def in_union(spheres: SphereSet, points: NDArray[np.float64], *, margin_m: float = 0.0) -> NDArray[np.bool_]:
    """Whether points (n, 3) [m] lie in any sphere grown by margin_m [m]. Exact. Returns (n,) bool."""
    return _Lifted(spheres, margin_m).power(points)[0] <= 0


class _Lifted:
    """Power distance |p - c|^2 - r^2 to the nearest sphere, by a nearest-neighbour search in four dimensions.

    With the centre lifted to (c, sqrt(R^2 - r^2)), R the largest radius, the squared distance to (p, 0) is
    the power plus R^2, so the nearest lifted centre is the sphere of least power, and p is inside any sphere
    iff that is <= 0.
    """

    def __init__(self, spheres: SphereSet, margin: float = 0.0) -> None:
        radii = np.maximum(spheres.radii + margin, 0.0)
        self.unit = float(radii.max())
        height = np.sqrt(np.maximum(1.0 - (radii / self.unit) ** 2, 0.0))
        self.tree = KDTree(np.column_stack([spheres.centres / self.unit, height]))

    def power(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Least power over R^2, (n,), and the sphere that has it, (n,), for points (n, 3) [m]."""
        distance, sphere = self.tree.query(np.column_stack([points / self.unit, np.zeros(len(points))]))
        return np.asarray(distance) ** 2 - 1.0, np.asarray(sphere, dtype=np.intp)


def _lattice(spheres: SphereSet, spacing: float) -> tuple[NDArray[np.float64], tuple[int, int, int]]:
    """The first lattice point and the number of points along x, y, z; refused when there would be too many."""
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"fibre.spacing_m: {spacing:g} is not allowed; it must be finite and above 0")
    low, high = spheres.bounding_box()
    numbers = np.maximum(np.ceil((high - low) / spacing * (1 - 1e-12)), 1.0)
    total = float(np.prod(numbers))
    if total > LARGEST_LATTICE:
        enough = float(spacing * (total / LARGEST_LATTICE) ** (1 / 3) * 1.02)
        raise InputError(
            f"fibre.spacing_m: {spacing:g} m makes {total:.3g} lattice points, the limit is {LARGEST_LATTICE:.0e};"
            f" {enough:.3g} m or more would do"
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
    for some in _chunks((2 * radius + 1) ** 2, 4_000_000):
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


def _chunks(work: NDArray[np.float64], limit: float) -> Iterator[slice]:
    """Slices of consecutive items whose work adds up to about limit each."""
    group = np.floor(np.cumsum(work) / limit)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(group)) + 1, [len(work)]])
    for begin, end in pairwise(starts):
        yield slice(int(begin), int(end))


def _normals_and_depths(
    inside: NDArray[np.bool_], index: NDArray[np.intp], points: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Outward unit normals (n, 3) and depths (n,) [m] of the lattice points kept."""
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
    _, owner = _Lifted(spheres).power(points)
    at = points - spheres.centres[owner]
    a = np.maximum(np.einsum("ij,ij->i", moves, moves), 1e-300)
    b = np.einsum("ij,ij->i", at, moves)
    c = np.minimum(np.einsum("ij,ij->i", at, at) - spheres.radii[owner] ** 2, 0.0)
    return np.clip((-b + np.sqrt(b * b - a * c)) / a, 0.0, 1.0)


# ---- the spheres themselves, for Figure 1


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
    lifted = _Lifted(spheres)
    coarse = np.full(len(areas), max(4, min(400, 60_000 // len(areas))))
    seen = _visible(spheres, lifted, coarse, seed)
    visible = seen.area_m2
    if visible == 0:  # every sphere but for slivers lies in others
        visible = float(areas.max())
    wanted = areas * (count / visible)
    numbers = np.diff(np.floor(np.concatenate([[0.0], np.cumsum(wanted)]) + 0.5)).astype(np.int64)
    return _visible(spheres, lifted, numbers, seed)


def _visible(spheres: SphereSet, lifted: _Lifted, numbers: NDArray[np.int64], seed: int) -> SurfacePoints:
    """Fibonacci lattices of numbers[i] points on sphere i, without what lies inside another sphere."""
    random = np.random.Generator(np.random.Philox(seed)).random((len(numbers), 4))
    turns = _random_rotations(random)
    near = KDTree(spheres.centres).query(spheres.centres, k=min(7, len(numbers)))[1].reshape(len(numbers), -1)
    kept: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]] = []
    for some in _chunks(numbers.astype(np.float64), 1_000_000):
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
