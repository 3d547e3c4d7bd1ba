"""Primitives that stand for a limb in contact (paper 4.1): spheres, capped cylinders, elliptic cylinders.

One class for all three, so that a body is a plain list of them. Lengths in metres, in the world at rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["Primitive", "PrimitiveKind"]

F64 = NDArray[np.float64]
PrimitiveKind = Literal["sphere", "cylinder", "elliptic"]
LARGEST = 100.0
"""Of a primitive's radii and of any coordinate of it [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Primitive:
    """A solid at rest. Raises InputError on an impossible one.

    kind: "sphere": around start, radius radii[0].
    "cylinder": the hull of the spheres of radius radii[0] around start and radii[1] around end: round caps, tapered
    where the radii differ.
    "elliptic": all points whose distance to the right elliptic cylinder with semi-axes radii[0] − rounding (along
    `across`) and radii[1] − rounding, from start + rounding to end − rounding along the axis, is at most `rounding`:
    flat caps at start and end, with rounded edges.
    start, end: (3,) ends of the axis; equal for a sphere. across: (3,) unit, square to the axis; elliptic only.
    part: name of the part of the body. bone: number of the joint it moves with.
    """

    kind: PrimitiveKind
    start: F64
    end: F64
    radii: tuple[float, float]
    across: F64 | None = None
    rounding: float = 0.0
    part: str = ""
    bone: int = 0

    def __post_init__(self) -> None:
        known = get_args(PrimitiveKind)
        if self.kind not in known:
            raise InputError(f"kind: {self.kind!r}; known: {', '.join(known)}{did_you_mean(str(self.kind), known)}")
        for name in ("start", "end"):
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != (3,) or not (np.abs(value) <= LARGEST).all():
                raise InputError(f"primitive.{name}: {value.tolist()!r}; allowed: three numbers up to {LARGEST:g} m")
            object.__setattr__(self, name, value)
        if len(self.radii) != 2 or not all(0 < r <= LARGEST for r in self.radii):
            raise InputError(f"primitive.radii: {self.radii!r}; allowed: two numbers above 0, up to {LARGEST:g} m")
        if self.kind != "elliptic":
            return
        axis = self.end - self.start
        length = float(np.linalg.norm(axis))
        across = np.zeros(3) if self.across is None else np.asarray(self.across, np.float64)
        if (
            length <= 0
            or across.shape != (3,)
            or not (np.abs(across) < 2).all()
            or abs(np.linalg.norm(across) - 1) > 1e-6
        ):
            raise InputError("primitive.across: allowed: for an elliptic cylinder of some length, a unit vector")
        if abs(across @ axis) > 1e-6 * length:
            raise InputError("primitive.across: not square to the axis; allowed: a unit vector square to it")
        if not 0 <= self.rounding < min(*self.radii, length / 2):
            raise InputError(
                f"primitive.rounding: {self.rounding!r}; allowed: 0 or more, below both semi-axes and half the length"
            )
        object.__setattr__(self, "across", across)

    @cached_property
    def ball(self) -> tuple[F64, float]:
        """A ball that holds it: middle (3,) and radius [m]."""
        span = self.end - self.start
        return (self.start + self.end) / 2, float(np.sqrt(span @ span)) / 2 + max(self.radii)

    @property
    def thinnest(self) -> float:
        """Radius of its thinnest place [m]; of an elliptic cylinder half of its least width."""
        length = float(np.linalg.norm(self.end - self.start))
        one, two = self.radii
        if self.kind == "sphere":
            return one
        if self.kind == "elliptic":
            return min(one, two, length / 2)
        return max(one, two) if length <= abs(one - two) else min(one, two)

    def wider(self, by: float) -> "Primitive":
        """All points within `by` [m] of it: each kind is such a hull itself."""
        one, two = self.radii
        grown = replace(self, radii=(one + by, two + by))
        if self.kind != "elliptic":
            return grown
        along = self.end - self.start
        along *= by / np.linalg.norm(along)
        return replace(grown, start=self.start - along, end=self.end + along, rounding=self.rounding + by)

    def meets(self, other: "Primitive") -> bool:
        """Whether their balls do."""
        (here, reach), (there, beyond) = self.ball, other.ball
        return float(np.linalg.norm(here - there)) < reach + beyond
