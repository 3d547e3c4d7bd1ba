"""Solids as fields: about the distance to their skin, below 0 inside; joined by smooth unions.

Smooth union: the cubic polynomial minimum, min(a, b) − k h³ / 6 with h = max(k − |a − b|, 0) / k (Quilez, "smooth
minimum", 2013): twice differentiable, and no different from the plain minimum where the two differ by more than k.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

__all__ = ["FAR", "Ellipsoid", "Part", "RoundCone", "Tube", "field", "gradient", "smooth_union"]

F64 = NDArray[np.float64]

FAR = 0.08
"""Value given outside a part's box; larger than any blend, so that what is out of reach is not computed."""

FINE = 512
"""Places along a tube where its section is looked up."""


def smooth_union(a: F64, b: F64, k: float) -> F64:
    """Cubic smooth minimum of two fields; k is the reach of the blend."""
    h = np.maximum(k - np.abs(a - b), 0) / k
    return np.minimum(a, b) - k * h**3 / 6


@dataclass(frozen=True, eq=False)
class Tube:
    """Sections along a straight line: superellipses with their own depth in front and behind.

    rows: (s, shift, width, front, back, power): at s along the axis, the section's middle lies `shift` along u, is
    `width` to either side along u, and reaches from `back` to `front` along v. The radial distance is exact along the
    ray from the middle of the section.
    """

    origin: F64
    axis: F64
    across: F64
    rows: F64
    middle: float = 0.45
    """Where between back and front the section is widest."""

    @cached_property
    def table(self) -> F64:
        """The rows but s, smoothly interpolated at FINE places."""
        places = np.linspace(self.rows[0, 0], self.rows[-1, 0], FINE)
        return PchipInterpolator(self.rows[:, 0], self.rows[:, 1:])(places)

    def box(self) -> tuple[F64, F64]:
        w, u = self.axis, self.across
        v = np.cross(w, u)
        corners = [
            self.origin + s * w + (shift + x * width) * u + y * v
            for s, shift, width, front, back, _ in self.rows
            for x in (-1, 1)
            for y in (front, back)
        ]
        return np.min(corners, 0), np.max(corners, 0)

    def value(self, points: F64) -> F64:
        q = points - self.origin
        s = q @ self.axis
        low, high = self.rows[0, 0], self.rows[-1, 0]
        step = np.clip((s - low) * ((FINE - 1) / (high - low)), 0, FINE - 1.001)
        low_row = step.astype(np.int32)
        share = (step - low_row)[:, None]
        table = self.table
        shift, width, front, back, power = (table[low_row] * (1 - share) + table[low_row + 1] * share).T
        centre = back + self.middle * (front - back)
        x = q @ self.across - shift
        y = q @ np.cross(self.axis, self.across) - centre
        depth = np.where(y > 0, front - centre, centre - back)
        if (self.rows[:, 5] == 2).all():
            ratio = np.hypot(x / width, y / depth)
        else:
            ratio = ((np.abs(x) / width) ** power + (np.abs(y) / depth) ** power) ** (1 / power)
        radial = np.hypot(x, y) * (1 - 1 / np.maximum(ratio, 1e-6))
        radial = np.where(ratio < 1e-3, -np.minimum(width, depth), radial)
        beyond = np.maximum(low - s, s - high)
        return -smooth_union(-radial, -beyond, 0.010)


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """turned: rows are the axes of the ellipsoid."""

    centre: F64
    radii: F64
    turned: F64 | None = None

    def box(self) -> tuple[F64, F64]:
        reach = np.max(self.radii) if self.turned is not None else self.radii
        return self.centre - reach, self.centre + reach

    def value(self, points: F64) -> F64:
        q = points - self.centre
        q = q if self.turned is None else q @ self.turned.T
        k0 = np.linalg.norm(q / self.radii, axis=1)
        k1 = np.linalg.norm(q / self.radii**2, axis=1)
        return k0 * (k0 - 1) / np.maximum(k1, 1e-9)


@dataclass(frozen=True, eq=False)
class RoundCone:
    """Ball of radius r0 at a blended to a ball of r1 at b."""

    a: F64
    b: F64
    r0: float
    r1: float

    def box(self) -> tuple[F64, F64]:
        return np.minimum(self.a - self.r0, self.b - self.r1), np.maximum(self.a + self.r0, self.b + self.r1)

    def value(self, points: F64) -> F64:
        axis = self.b - self.a
        t = np.clip((points - self.a) @ axis / (axis @ axis), 0, 1)
        smooth = t * t * (3 - 2 * t)
        return np.linalg.norm(points - self.a - t[:, None] * axis, axis=1) - (self.r0 + (self.r1 - self.r0) * smooth)


@dataclass(frozen=True, eq=False)
class Part:
    """A solid and how it joins those before it in the list."""

    solid: Tube | Ellipsoid | RoundCone
    blend: float
    mirrored: bool = False
    """Whether its mirror image in x is there too."""
    between: float = 0.004
    """Reach of the blend between the two of a pair."""
    carve: bool = False
    """Taken away instead of added."""


def field(parts: Sequence[Part], points: ArrayLike) -> F64:
    """Value at each point, shape (n,): the parts joined in order; the floor at y = 0 cuts flat soles."""
    points = np.asarray(points, np.float64)
    total = np.full(len(points), FAR)
    mirrored = points * [-1, 1, 1]
    for part in parts:
        value = _boxed(part.solid, points)
        if part.mirrored:
            value = smooth_union(value, _boxed(part.solid, mirrored), part.between)
        total = -smooth_union(-total, value, part.blend) if part.carve else smooth_union(total, value, part.blend)
    return -smooth_union(-total, points[:, 1].copy(), 0.006)


def gradient(parts: Sequence[Part], points: F64, step: float = 4e-4) -> F64:
    """Slope of the field by differences over a tetrahedron, shape (n, 3)."""
    corners = np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]], np.float64)
    values = [field(parts, points + step * corner) for corner in corners]
    return np.stack(values, 1) @ corners / (4 * step)


def _boxed(solid: Tube | Ellipsoid | RoundCone, points: F64) -> F64:
    low, high = solid.box()
    near = ((points > low - FAR) & (points < high + FAR)).all(1)
    value = np.full(len(points), FAR)
    if near.any():
        value[near] = np.minimum(solid.value(points[near]), FAR)
    return value
