"""Jamming: how close threads can lie, and what makes a close set fit (Peirce 1937, Kemp 1958; see `crimp`).

A yarn that changes face over the pitch p with the height h jams at p = sqrt(h (2S - h)), S the sum of its two wrap
radii; and threads side by side need the mean of their diameters. Flats add to both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.weave.crimp import JAM_TOLERANCE, Family, Interlacing, block_ends

__all__ = ["Jam", "balance_limits", "fit_balance", "fit_diameters", "jams", "least_pitches"]

F64 = NDArray[np.float64]


def least_pitches(cloth: Interlacing) -> tuple[F64, F64]:
    """The least pitch each pair of neighbours allows [m]: ends (as `pitches("warp")`), picks.

    It is the larger of two limits: a crossing yarn must get through between them (Peirce's jamming), and,
    since neighbours pass each other at equal height, they need the mean of their diameters.
    """

    def one(family: Family, diameter: F64) -> F64:
        _, z0, z1, same, radius0, radius1 = block_ends(cloth, "weft" if family == "warp" else "warp")
        h = np.abs(z1 - z0)
        outer = np.where(np.abs(z0) > np.abs(z1), radius0, radius1)
        total = np.where(same, outer, radius0 + radius1)
        through = np.sqrt(np.maximum(h * (2 * total - h), 0)).max(axis=0 if family == "warp" else 1)
        side_by_side = 0.5 * (diameter + np.roll(diameter, -1))[: through.size]
        return np.maximum(through, side_by_side) + cloth.flats(family)

    return one("warp", cloth.warp_diameter_m), one("weft", cloth.weft_diameter_m)


@dataclass(frozen=True)
class Jam:
    """Two neighbours too close together: thread `first` and the next, counted from 0, of one family [m]."""

    family: Family
    first: int
    pitch_m: float
    least_pitch_m: float


def jams(cloth: Interlacing) -> tuple[Jam, ...]:
    """The pairs of neighbours whose pitch is below the least possible; empty when the cloth can be woven."""
    found: list[Jam] = []
    families: Sequence[Family] = ("warp", "weft")
    for family, least in zip(families, least_pitches(cloth), strict=True):
        pitch = cloth.pitches(family)
        for k in np.flatnonzero(pitch < least * (1 - JAM_TOLERANCE)):
            found.append(Jam(family, int(k), float(pitch[k]), float(least[k])))
    return tuple(found)


def fit_diameters(cloth: Interlacing) -> float:
    """The largest factor, at most 1, by which all diameters must be scaled so that no threads jam or overlap.

    Least pitches grow in proportion to the diameters (and flats, which must be scaled alike), so it is the smallest
    ratio of pitch to least pitch.
    """
    factor = 1.0
    families: Sequence[Family] = ("warp", "weft")
    for family, least in zip(families, least_pitches(cloth), strict=True):
        factor = min(factor, float(np.min(cloth.pitches(family) / least, initial=1.0)))
    return factor


def _tightest(cloth: Interlacing, family: Family) -> float:
    """The smallest pitch / (r0 + r1) at which a yarn of this family changes face, infinite when none does."""
    pitch, _, _, same, radius0, radius1 = block_ends(cloth, family)
    return float(np.min(np.where(same, np.inf, pitch / (radius0 + radius1)), initial=np.inf))


def balance_limits(cloth: Interlacing) -> tuple[float, float]:
    """Least and greatest balance at which no yarn jams on its way through; low > high when there is none.

    A yarn that takes the share w of the crimp height jams at p = S sqrt(1 - (1 - w)²), so that the *other* family
    must take at least sqrt(1 - (p/S)²).
    """

    def other(tightest: float) -> float:
        return float(np.sqrt(1 - min(max(tightest, 0.0), 1.0) ** 2))

    return other(_tightest(cloth, "weft")), 1 - other(_tightest(cloth, "warp"))


def fit_balance(cloth: Interlacing) -> float:
    """The balance nearest to the cloth's own at which it can be woven.

    Close sets need it: in poplin the warp takes most of the crimp, because the ends lie too close for the
    weft to bend between them. When the cloth jams at any balance, it is the one that `fit_diameters` shrinks
    least.
    """
    low, high = balance_limits(cloth)
    if low <= high:
        return min(max(cloth.balance, low), high)
    a, b = (max(_tightest(cloth, family), 1e-6) ** 2 for family in ("warp", "weft"))
    return float(a / (b + np.sqrt(b * b - (b - a) * a)))  # a (1 - w²) = b (1 - (1 - w)²): both jam together
