"""The set of a cloth: how far apart threads of a thickness lie, and what it takes to weave a close set (Peirce 1937).

A yarn of diameter d lies in cloth flattened by f at equal area: d·√f wide and d/√f thick.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.weave.crimp import Interlacing
from taichi_cloth.weave.draft import Draft
from taichi_cloth.weave.jamming import fit_balance, fit_diameters
from taichi_cloth.yarn.yarn import CLOSEST_PACKING

__all__ = ["CLOSEST", "OPENING", "Fitted", "fit_set", "opening_spacing", "set_sizes", "square_set_diameter"]

F64 = NDArray[np.float64]

OPENING = 1.02
"""Spacing of threads over the closest possible, where nothing states one."""
CLOSEST = float(np.sqrt(0.60 / CLOSEST_PACKING))
"""Diameter of a thread pressed by its neighbours as far as that goes, over that of the loose one."""
ROUNDING = 1e-9
"""Share of a size by which threads that just fit may jam, by how numbers are rounded."""


def square_set_diameter(spacing: float, flattening: float) -> float:
    """Diameter [m] of the yarn that fills a spacing [m] in a square cloth up to OPENING: at Peirce's limit of one,
    threads lie √3 thicknesses apart, and flats add to that."""
    root = float(np.sqrt(flattening))
    return spacing / (OPENING * (np.sqrt(3.0) / root + root - 1.0 / root))


def opening_spacing(own: F64, other: F64, flattening: float) -> F64:
    """Spacing [m] of threads of the diameters `own` (n,) [m] that cross threads of the diameters `other` [m]: OPENING
    times the closest of a square cloth (Peirce's limit, of the mean of both)."""
    root = float(np.sqrt(flattening))
    passing = 0.5 * np.sqrt(3.0) * (float(own.max()) + float(other.max())) / root
    return np.full(len(own), OPENING * (passing + float(own.max()) * (root - 1.0 / root)))


def set_sizes(
    draft: Draft, diameter: tuple[float, float], per_cm: tuple[float | None, float | None], flattening: float
) -> tuple[tuple[F64, F64], tuple[F64, F64]]:
    """Diameters [m] of the warp ends and the weft picks, the draft's own or `diameter`; and the room of each [m]: that
    of so many a centimetre, else the draft's, else what just fits."""
    thick = (draft.warp_thickness_m, draft.weft_thickness_m)
    warp, weft = (
        np.full(count, own) if stated is None else stated
        for count, own, stated in zip((draft.ends, draft.picks), diameter, thick, strict=True)
    )
    spacing = []
    for own, other, asked, stated in (
        (warp, weft, per_cm[0], draft.warp_spacing_m),
        (weft, warp, per_cm[1], draft.weft_spacing_m),
    ):
        if asked is not None:
            spacing.append(np.full(len(own), 0.01 / asked))
        elif stated is not None:
            spacing.append(np.asarray(stated, np.float64))
        else:
            spacing.append(opening_spacing(own, other, flattening))
    return (warp, weft), (spacing[0], spacing[1])


@dataclass(frozen=True)
class Fitted:
    """A weave that can be woven. balance: the warp's part of the crimp height it took. thinned: the factor of all
    diameters it took, 1 for none. flattening: of the warp and of the weft, width over thickness."""

    cloth: Interlacing
    balance: float
    thinned: float
    flattening: tuple[float, float]


def fit_set(
    warp_up: NDArray[np.bool_],
    spacing: tuple[F64, F64],
    diameter: tuple[F64, F64],
    *,
    flattening: float,
    balance: float,
    rounder: bool = False,
) -> Fitted:
    """The weave with its sizes, fitted as a loom fits a close set: first the crimp is shared otherwise, then yarn is
    pressed, and where it cannot be pressed so far (CLOSEST) it is thinned.

    warp_up: (picks, ends). spacing, diameter: of the warp ends and of the weft picks [m]. balance: the warp's part of
    the crimp height, kept where it can be. rounder: before yarn is thinned, threads of a family that lie closer than
    they would be wide press each other rounder. So they look; what close cloths weigh is nearer to what all threads
    pressed alike come to, whose crimp is less (`mechanics.comparison`).
    """

    def sized(factor: float, share: float, flat: tuple[float, float]) -> Interlacing:
        warp, weft = (float(np.sqrt(one)) for one in flat)
        return Interlacing(
            warp_up=warp_up,
            warp_spacing_m=spacing[0],
            weft_spacing_m=spacing[1],
            warp_diameter_m=factor * diameter[0] / warp,
            weft_diameter_m=factor * diameter[1] / weft,
            warp_flat_m=factor * diameter[0] * (warp - 1.0 / warp),
            weft_flat_m=factor * diameter[1] * (weft - 1.0 / weft),
            balance=share,
            periodic=False,
        )

    def fits(factor: float, share: float, flat: tuple[float, float]) -> float:
        found = fit_diameters(sized(factor, share, flat))
        return factor if found > 1.0 - ROUNDING else factor * found

    flat = flattening, flattening
    if fits(1.0, balance, flat) == 1.0:
        return Fitted(sized(1.0, balance, flat), balance, 1.0, flat)
    share = fit_balance(sized(1.0, balance, flat))
    factor = fits(1.0, share, flat)
    if rounder and factor < CLOSEST:
        pressed_flat = _rounded(spacing[0], diameter[0], flattening), _rounded(spacing[1], diameter[1], flattening)
        other = fit_balance(sized(CLOSEST, balance, pressed_flat))
        pressed = fits(CLOSEST, other, pressed_flat)
        if pressed > factor:
            flat, share, factor = pressed_flat, other, pressed
    return Fitted(sized(factor * (1.0 - ROUNDING * (factor < 1.0)), share, flat), share, factor, flat)


def _rounded(spacing: F64, diameter: F64, flattening: float) -> float:
    """How flat threads of a family can be, pressed to the closest, without lying over one another."""
    between = (spacing[1:] + spacing[:-1]) / (CLOSEST * (diameter[1:] + diameter[:-1]))
    return float(np.clip(np.min(between, initial=np.inf) ** 2, 1.0, flattening))
