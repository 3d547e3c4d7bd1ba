"""A piece of cloth in the mill: in the reed, on the loom, finished, and the yarn that it takes.

Take-up and shrinkage are two things, each a share of what was there before it: a piece that is to be a metre after it
shrinks by 20 % leaves the loom with 1/0.8 = 1.25 m, not 1.20, and the threads in it are longer by their crimp.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.construction import Construction

__all__ = ["Direction", "Piece", "YarnNeed", "piece_of"]


@dataclass(frozen=True)
class Direction:
    """Of the warp, along the length, or of the weft, across.

    size: finished [m]. shrinkage: in finishing, a share of the size on the loom. on_loom: size there [m]. take_up: by
    which the threads are longer than the cloth on the loom. yarn: of one thread [m]. crimp: in the finished cloth.
    yarn_shrinkage: of the threads themselves, where the cloth shrinks by more than crimp can take.
    """

    size: float
    shrinkage: float
    on_loom: float
    take_up: float
    yarn: float
    crimp: float
    yarn_shrinkage: float


@dataclass(frozen=True)
class YarnNeed:
    """Threads of one colour: how many, their length in all [m] and mass [g]."""

    family: str
    colour: str
    threads: int
    metres: float
    grams: float


@dataclass(frozen=True)
class Piece:
    """length, width: of the warp and the weft. ends, picks: in all. Threads a cm as in their names."""

    length: Direction
    width: Direction
    ends: int
    picks: int
    ends_per_cm_finished: float
    ends_per_cm_on_loom: float
    ends_per_cm_in_reed: float
    picks_per_cm_finished: float
    picks_per_cm_on_loom: float
    width_in_reed: float
    yarn: tuple[YarnNeed, ...]
    waste: float

    def as_dict(self) -> dict[str, object]:
        """For JSON; metres, grams, threads a cm, and shares."""
        return asdict(self)


def piece_of(
    cloth: Construction,
    colours: tuple[NDArray, NDArray],
    *,
    length: float,
    width: float,
    shrinkage: tuple[float, float] = (0.0, 0.0),
    waste: float = 0.0,
) -> Piece:
    """The piece of a construction.

    colours: one repeat of the warp's and of the weft's, (n, 3) linear. length, width: finished [m]. shrinkage: of the
    length and of the width, shares of the size on the loom. waste: of warp at both ends of the loom [m]. Raises
    InputError on sizes that no piece has.
    """
    limits = {"length": (length, 1e-3, 1e5), "width": (width, 1e-3, 100.0), "waste": (waste, 0.0, 1e3)}
    for name, (value, least, most) in limits.items():
        if not (isfinite(value) and least <= value <= most):
            raise InputError(f"--{name}: {value:g} m; allowed: {least:g} to {most:g} m")
    for name, value in zip(("length", "width"), shrinkage, strict=True):
        if not 0.0 <= value <= 0.8:
            raise InputError(f"--shrinkage-{name}: {100 * value:g} %; allowed: 0 to 80 % of the size on the loom")
    warp, weft = cloth.families
    along = _direction(length, shrinkage[0], warp.crimp)
    across = _direction(width, shrinkage[1], weft.crimp)
    ends, picks = max(1, round(1e3 * warp.per_mm * width)), max(1, round(1e3 * weft.per_mm * length))
    reed = across.yarn
    yarn = [
        *_needs("warp", colours[0], ends, along.yarn + waste, warp.tex / (1.0 - cloth.warp.loss)),
        *_needs("weft", colours[1], picks, across.yarn, weft.tex / (1.0 - cloth.weft.loss)),
    ]
    return Piece(
        length=along,
        width=across,
        ends=ends,
        picks=picks,
        ends_per_cm_finished=0.01 * ends / width,
        ends_per_cm_on_loom=0.01 * ends / across.on_loom,
        ends_per_cm_in_reed=0.01 * ends / reed,
        picks_per_cm_finished=0.01 * picks / length,
        picks_per_cm_on_loom=0.01 * picks / along.on_loom,
        width_in_reed=reed,
        yarn=tuple(yarn),
        waste=waste,
    )


def _direction(size: float, shrinkage: float, crimp: float) -> Direction:
    """On the loom threads are as long as in the finished cloth, which relaxes into its crimp; a cloth that shrinks by
    more takes its threads with it."""
    on_loom = size / (1.0 - shrinkage)
    yarn = max(size * (1.0 + crimp), on_loom)
    return Direction(size, shrinkage, on_loom, yarn / on_loom - 1.0, yarn, crimp, 1.0 - size * (1.0 + crimp) / yarn)


def _needs(family: str, repeat: NDArray, threads: int, metres: float, tex: float) -> list[YarnNeed]:
    """Of each colour, in the order in which they first come."""
    index = np.arange(threads) % len(repeat)
    names = [_hexadecimal(shade) for shade in np.asarray(repeat, np.float64)]
    counts: dict[str, int] = dict.fromkeys(names, 0)
    for number, count in enumerate(np.bincount(index, minlength=len(repeat))):
        counts[names[number]] += int(count)
    return [
        YarnNeed(family, name, count, count * metres, count * metres * tex * 1e-3)
        for name, count in counts.items()
        if count
    ]


def _hexadecimal(linear: Sequence[float] | NDArray) -> str:
    """A linear colour as #rrggbb of sRGB."""
    c = np.clip(np.asarray(linear, np.float64), 0.0, 1.0)
    srgb = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    return "#" + "".join(f"{round(255 * float(v)):02x}" for v in srgb)
