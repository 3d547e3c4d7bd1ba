"""What a pattern needs to know of a body: girths, heights, and where its limbs are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Figure", "Limb", "Section"]

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Section:
    """The trunk at one height: half its breadth (x) and depth (z), and the middle of its depth [m]."""

    breadth: float
    depth: float
    middle: float


@dataclass(frozen=True, eq=False)
class Limb:
    """An upper arm or a leg: top and bottom (3,) of its axis, the furthest that skin is from the axis below the top
    fifth [m]."""

    top: F64
    bottom: F64
    radius: float

    @property
    def axis(self) -> F64:
        """(3,) unit, from the bottom to the top."""
        way = self.top - self.bottom
        return way / np.linalg.norm(way)


@dataclass(frozen=True, eq=False)
class Figure:
    """Girths and heights in metres; the body stands on y = 0 and faces +z.

    neck_height: of the point where neck and shoulder meet. shoulder: from one shoulder's tip to the other.
    sections: trunk at "chest", "waist", "hip". arms, legs: left (+x), right; an arm ends at the elbow, a leg at the
    ankle.
    """

    stature: float
    neck: float
    chest: float
    waist: float
    hip: float
    upper_arm: float
    thigh: float
    shoulder: float
    neck_height: float
    shoulder_height: float
    underarm_height: float
    waist_height: float
    hip_height: float
    crotch_height: float
    sections: dict[str, Section]
    arms: tuple[Limb, Limb]
    legs: tuple[Limb, Limb]
