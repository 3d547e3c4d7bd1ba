"""A shape as a union of spheres: what a fibre is made of (paper 2.1, Figure 1), and what lies inside it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["LARGEST_SPHERE_COUNT", "UM", "PowerDistance", "SphereSet", "chunks", "in_union", "sphere_set_from_rows"]

UM = 1e-6
LARGEST_SPHERE_COUNT = 100_000


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


def in_union(spheres: SphereSet, points: NDArray[np.float64], *, margin_m: float = 0.0) -> NDArray[np.bool_]:
    """Whether points (n, 3) [m] lie in any sphere grown by margin_m [m]. Exact. Returns (n,) bool."""
    return PowerDistance(spheres, margin_m).power(points)[0] <= 0


class PowerDistance:
    """Power distance |p - c|^2 - r^2 to the nearest sphere, by a nearest-neighbour search in four dimensions.

    With the centre lifted to (c, sqrt(R^2 - r^2)), R the largest radius, the squared distance to (p, 0) is
    the power plus R^2, so the nearest lifted centre is the sphere of least power, and p is inside any sphere
    iff that is <= 0.
    """

    def __init__(self, spheres: SphereSet, margin: float = 0.0) -> None:
        from scipy.spatial import KDTree  # half a second, of all that import this

        radii = np.maximum(spheres.radii + margin, 0.0)
        self.unit = float(radii.max())
        height = np.sqrt(np.maximum(1.0 - (radii / self.unit) ** 2, 0.0))
        self.tree = KDTree(np.column_stack([spheres.centres / self.unit, height]))

    def power(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Least power over R^2, (n,), and the sphere that has it, (n,), for points (n, 3) [m]."""
        distance, sphere = self.tree.query(np.column_stack([points / self.unit, np.zeros(len(points))]))
        return np.asarray(distance) ** 2 - 1.0, np.asarray(sphere, dtype=np.intp)


def chunks(work: NDArray[np.float64], limit: float) -> Iterator[slice]:
    """Slices of consecutive items whose work adds up to about limit each."""
    group = np.floor(np.cumsum(work) / limit)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(group)) + 1, [len(work)]])
    for begin, end in pairwise(starts):
        yield slice(int(begin), int(end))
