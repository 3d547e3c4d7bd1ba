"""A primitive as numbers that may move: what least squares turns, and where it starts from.

Sphere: centre, log radius (4). Cylinder: start, end, two log radii (8). Elliptic: middle, axis from start to end, two
log semi-axes, the turn of `across` about the axis from where it was, and the rounding's share of the most there may be
as a logit (10).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.distance import cross
from taichi_cloth.body.primitives.primitives import Primitive, PrimitiveKind

__all__ = ["MOST_ROUND", "Solid", "starts"]

F64 = NDArray[np.float64]
SHORTEST = 0.004
"""An elliptic cylinder is no shorter than this [m], nor any radius smaller."""
MOST_ROUND = 0.98
"""Rounding, of the smaller of the semi-axes and half the length."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A kind and its numbers; `across` is where the turn is counted from."""

    kind: PrimitiveKind
    numbers: F64
    across: F64 | None = None
    free: F64 | None = None
    """Which changes of the numbers there may be, a projection (numbers, numbers); None: all."""

    @property
    def freedom(self) -> int:
        """How many numbers may move."""
        return len(self.numbers) if self.free is None else round(float(np.trace(self.free)))

    @cached_property
    def primitive(self) -> Primitive | None:
        """None where the numbers make no solid."""
        n = self.numbers
        if not np.isfinite(n).all():
            return None
        if self.kind == "sphere":
            r = float(np.exp(n[3]))
            return Primitive(kind="sphere", start=n[:3], end=n[:3], radii=(r, r))
        radii = np.exp(n[6:8])
        if radii.min() < SHORTEST or radii.max() > 10:
            return None
        if self.kind == "cylinder":
            return Primitive(kind="cylinder", start=n[:3], end=n[3:6], radii=(float(radii[0]), float(radii[1])))
        length = float(np.linalg.norm(n[3:6]))
        if length < 2 * SHORTEST:
            return None
        axis = n[3:6] / length
        assert self.across is not None
        x = self.across - (self.across @ axis) * axis
        x /= np.linalg.norm(x)
        y = cross(axis, x)
        across = np.cos(n[8]) * x + np.sin(n[8]) * y
        across -= (across @ axis) * axis
        across /= np.linalg.norm(across)
        rounding = MOST_ROUND * min(float(radii.min()), length / 2) / (1 + np.exp(-np.clip(n[9], -30, 30)))
        return Primitive(
            kind="elliptic",
            start=n[:3] - n[3:6] / 2,
            end=n[:3] + n[3:6] / 2,
            radii=(float(radii[0]), float(radii[1])),
            across=across,
            rounding=float(rounding),
        )

    def moved(self, step: F64) -> "Solid":
        return replace(self, numbers=self.numbers + (step if self.free is None else self.free @ step))

    def on_plane(self, across: F64, level: float) -> "Solid | None":
        """The nearest solid that is its own image in the plane across·x = level, and stays so; None where a cylinder
        lies square to it."""
        flat = np.eye(3) - np.outer(across, across)
        free = np.eye(len(self.numbers))
        numbers = self.numbers.copy()
        free[:3, :3] = flat
        numbers[:3] += (level - numbers[:3] @ across) * across
        if self.kind == "sphere":
            return replace(self, numbers=numbers, free=free)
        axis = numbers[3:6] if self.kind == "elliptic" else self.numbers[3:6] - self.numbers[:3]
        if abs(axis @ across) > 0.7 * np.linalg.norm(axis):
            if self.kind == "cylinder":
                return None
            free[3:6, 3:6] = np.outer(across, across)
            numbers[3:6] = (axis @ across) * across
            return replace(self, numbers=numbers, free=free)
        free[3:6, 3:6] = flat
        if self.kind == "cylinder":
            numbers[3:6] += (level - numbers[3:6] @ across) * across
            return replace(self, numbers=numbers, free=free)
        numbers[3:6] = flat @ axis
        assert self.across is not None
        if abs(self.across @ across) < 0.7:  # the other semi-axis is the one across the plane
            numbers[[6, 7]] = numbers[[7, 6]]
        numbers[8] = 0
        free[8, 8] = 0
        return Solid("elliptic", numbers, across, free)

    def farthest(self, directions: F64) -> F64:
        """The surface's farthest point in each unit direction (n, 3), shape (n, 3)."""
        p = self.primitive
        return np.full(directions.shape, 1e3) if p is None else _farthest(p, directions)


def _farthest(p: Primitive, directions: F64) -> F64:
    if p.kind != "elliptic":
        first = directions @ (p.start - p.end) + (p.radii[0] - p.radii[1]) > 0
        return np.where(first[:, None], p.start + p.radii[0] * directions, p.end + p.radii[1] * directions)
    assert p.across is not None
    span = p.end - p.start
    axis = span / np.sqrt(span @ span)
    other, r = cross(axis, p.across), p.rounding
    a, b = p.radii[0] - r, p.radii[1] - r
    x, y = directions @ p.across * a, directions @ other * b
    size = np.maximum(np.hypot(x, y), 1e-12)
    inner = (x / size * a)[:, None] * p.across + (y / size * b)[:, None] * other
    end = np.where((directions @ axis > 0)[:, None], p.end - r * axis, p.start + r * axis)
    return end + inner + r * directions


def starts(points: F64) -> list[Solid]:
    """Solids to begin a fit to points (n, 3) from: a sphere, cylinders and elliptic cylinders along their main axes."""
    middle = points.mean(axis=0)
    centred = points - middle
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    if np.linalg.det(axes) < 0:
        axes[2] *= -1
    at = centred @ axes.T
    radius = max(float(np.linalg.norm(centred, axis=1).mean()), SHORTEST)
    found = [Solid("sphere", np.array([*middle, np.log(radius)]))]
    for k in (0, 1, 2):
        i, j = (k + 1) % 3, (k + 2) % 3
        low, high = np.quantile(at[:, k], [0.02, 0.98])
        length = max(float(high - low), 4 * SHORTEST)
        offset = (
            middle + (at[:, i].min() + at[:, i].max()) / 2 * axes[i] + (at[:, j].min() + at[:, j].max()) / 2 * axes[j]
        )
        centre = offset + (low + high) / 2 * axes[k]
        if k < 2:
            radial = np.hypot(*(at[:, m] - (at[:, m].min() + at[:, m].max()) / 2 for m in (i, j)))
            slope, mean = np.polyfit(at[:, k], radial, 1) if len(points) > 2 else (0.0, radial.mean())
            ends = np.maximum(mean + slope * np.array([low, high]), 2 * SHORTEST)
            inset = np.minimum(0.5 * ends, 0.3 * length)
            start, end = offset + (low + inset[0]) * axes[k], offset + (high - inset[1]) * axes[k]
            found.append(Solid("cylinder", np.array([*start, *end, *np.log(ends)])))
        a, b = (max(float(np.ptp(np.quantile(at[:, m], [0.02, 0.98]))) / 2, 2 * SHORTEST) for m in (i, j))
        found.append(Solid("elliptic", np.array([*centre, *(length * axes[k]), np.log(a), np.log(b), 0, 0.0]), axes[i]))
    return found
