"""Crimp: the path of each yarn over and under the threads it crosses.

Peirce's geometry of plain weave (F. T. Peirce, "The geometry of cloth structure", J. Textile Inst. 28, 1937, T45),
for round and inextensible threads: a yarn wraps each thread it crosses with a circular arc and goes straight from
arc to arc. Two extensions make it serve any weave and any mixture of threads:

- floats: between two crossings on the same face there is nothing to pass, so the yarn stays at its height;
- unlike threads: each arc has the radius of its own crossing, R_ij = (d_warp_j + d_weft_i) / 2, and the straight
  part is the common tangent of the two circles. A float between a thick and a thin thread leaves the thick
  one on its arc and comes level again on an arc that bends the other way.

In every block the path then is arc, straight, arc, with both arcs turning through the same weave angle
theta. With p the pitch, h the change of height, S = r0 + r1 the sum of the radii:

    p = s cos(theta) + S sin(theta),   h = s sin(theta) + S (1 - cos(theta)),   l = S theta + s
    =>  s = sqrt(p² + (S - h)² - S²),  theta = atan2(S, s) - atan2(S - h, p)

Peirce writes D for S and l - D theta for s. The threads jam when the root is imaginary: p < sqrt(h (2S - h)).
Slopes are zero at the crossings, so a path is smooth (C1) along the whole yarn.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.draft import Draft, check_size

__all__ = [
    "JAM_TOLERANCE",
    "Family",
    "Interlacing",
    "PathKinds",
    "PeirceCell",
    "block_ends",
    "centreline",
    "crimp",
    "crossing_heights",
    "interlacing",
    "path_kinds",
    "peirce",
    "peirce_crimp",
    "weave_angle",
    "yarn_length",
]

Family = Literal["warp", "weft"]
F64 = NDArray[np.float64]

JAM_TOLERANCE = 1e-9  # of a pitch: exactly jammed threads are allowed


@dataclass(frozen=True, kw_only=True, eq=False)
class Interlacing:
    """A weave with the sizes of its threads: all that the yarn paths follow from.

    warp_up: bool (picks, ends). Sizes in metres, float64, a scalar given for a family is spread over its
    threads:
    warp_spacing_m, warp_diameter_m: (ends,); weft_spacing_m, weft_diameter_m: (picks,).
    warp_flat_m, weft_flat_m: how much wider a thread is than it is thick, 0 for round ones; its diameter then is
    the thickness.
    balance: share of the crimp height taken by the warp, 0 (straight warp) to 1 (straight weft).
    periodic: the draft is a repeat, so its last thread has its first as the neighbour.

    Raises InputError on wrong shapes, or sizes that are not finite and above 0, or a balance outside 0 to 1.
    """

    warp_up: NDArray[np.bool_]
    warp_spacing_m: F64
    weft_spacing_m: F64
    warp_diameter_m: F64
    weft_diameter_m: F64
    balance: float = 0.5
    periodic: bool = True
    warp_flat_m: F64 | float = 0.0
    weft_flat_m: F64 | float = 0.0

    def __post_init__(self) -> None:
        up = np.asarray(self.warp_up, dtype=bool)
        if up.ndim != 2:
            raise InputError(f"crimp: warp_up has shape {up.shape}; needed: (picks, ends)")
        check_size(ends=up.shape[1], picks=up.shape[0])
        object.__setattr__(self, "warp_up", up)
        for family, count in (("warp", up.shape[1]), ("weft", up.shape[0])):
            for quantity in ("spacing_m", "diameter_m"):
                field = f"{family}_{quantity}"
                object.__setattr__(self, field, _lengths(field, getattr(self, field), count))
            field = f"{family}_flat_m"
            object.__setattr__(self, field, _lengths(field, getattr(self, field), count, zero=True))
        if not 0 <= self.balance <= 1:
            raise InputError(f"crimp.balance: {self.balance!r}; allowed: 0 (straight warp) to 1 (straight weft)")

    @property
    def picks(self) -> int:
        """Weft picks, the rows of `warp_up`."""
        return self.warp_up.shape[0]

    @property
    def ends(self) -> int:
        """Warp ends, the columns of `warp_up`."""
        return self.warp_up.shape[1]

    def pitches(self, family: Family) -> F64:
        """Distance from each thread of the family to the next [m], (n,), or (n - 1,) when not periodic."""
        spacing = self.warp_spacing_m if family == "warp" else self.weft_spacing_m
        between = 0.5 * (spacing + np.roll(spacing, -1))
        return between if self.periodic else between[:-1]

    def flats(self, family: Family) -> F64:
        """The part of each of `pitches` that lies on the two threads' flats [m]."""
        flat = np.asarray(self.warp_flat_m if family == "warp" else self.weft_flat_m)
        between = 0.5 * (flat + np.roll(flat, -1))
        return between if self.periodic else between[:-1]

    def round_core(self) -> "Interlacing":
        """The cloth with every flat cut out and the rest moved together: round threads, the same gaps and heights.

        A flat thread is the sweep of a round one across its flat, and all threads lie level over a flat, so two
        flat threads are just as far apart as their round cores.
        """
        return replace(
            self,
            warp_spacing_m=self.warp_spacing_m - self.warp_flat_m,
            weft_spacing_m=self.weft_spacing_m - self.weft_flat_m,
            warp_flat_m=0.0,
            weft_flat_m=0.0,
        )


def _lengths(field: str, values: ArrayLike, count: int, *, zero: bool = False) -> F64:
    try:
        lengths = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"crimp.{field}: not a number of metres, nor one for each thread") from None
    if lengths.shape not in ((), (count,)):
        raise InputError(f"crimp.{field}: shape {lengths.shape}; needed: one number, or ({count},)")
    lengths = np.broadcast_to(lengths, (count,))
    bad = np.flatnonzero(~(((lengths >= 0) if zero else (lengths > 0)) & np.isfinite(lengths)))
    if bad.size:
        raise InputError(
            f"crimp.{field}: {lengths[bad[0]]:g} at thread {bad[0] + 1}; allowed: metres{'' if zero else ' above 0'}"
        )
    return lengths


def interlacing(
    draft: Draft,
    *,
    warp_spacing_m: ArrayLike | None = None,
    weft_spacing_m: ArrayLike | None = None,
    warp_diameter_m: ArrayLike | None = None,
    weft_diameter_m: ArrayLike | None = None,
    balance: float = 0.5,
    periodic: bool = True,
) -> Interlacing:
    """A draft's interlacing; a size that is None is the draft's own.

    Raises InputError when neither gives a size, and as `Interlacing` does.
    """

    def size(given: ArrayLike | None, own: F64 | None, what: str) -> F64:
        if given is None and own is None:
            raise InputError(f"crimp: the draft {draft.name!r} states no {what}; give one")
        return np.asarray(own if given is None else given)

    return Interlacing(
        warp_up=draft.warp_up,
        warp_spacing_m=size(warp_spacing_m, draft.warp_spacing_m, "warp spacing"),
        weft_spacing_m=size(weft_spacing_m, draft.weft_spacing_m, "weft spacing"),
        warp_diameter_m=size(warp_diameter_m, draft.warp_thickness_m, "warp thickness"),
        weft_diameter_m=size(weft_diameter_m, draft.weft_thickness_m, "weft thickness"),
        balance=balance,
        periodic=periodic,
    )


def crossing_heights(warp_up: ArrayLike, d_warp: ArrayLike, d_weft: ArrayLike, balance: float = 0.5) -> tuple[F64, F64]:
    """Heights of the two centrelines above the middle plane at each crossing, both (picks, ends).

    The upper thread is above the lower by exactly R = (d_warp + d_weft) / 2: they touch. The warp's share of R is
    `balance`, so Peirce's h1 = balance · D and h1 + h2 = D.

    d_warp: (ends,) or one number; d_weft: (picks,) or one number; the heights are in their unit.
    """
    up = np.asarray(warp_up, dtype=bool)
    radius = _crossing_radius(np.asarray(d_warp, np.float64), np.asarray(d_weft, np.float64), up.shape)
    z_warp = np.where(up, balance * radius, -balance * radius)
    return z_warp, z_warp - np.where(up, radius, -radius)


def _crossing_radius(d_warp: F64, d_weft: F64, shape: tuple[int, ...]) -> F64:
    return 0.5 * (np.broadcast_to(d_warp, shape[1:])[None, :] + np.broadcast_to(d_weft, shape[:1])[:, None])


@dataclass(frozen=True, eq=False)
class PathKinds:
    """Blocks of yarn from one crossing to the next, any shape (…), all in one unit of length.

    pitch: distance along the straight yarn, without the flats it lies on; z0, z1: heights at its two ends; r0, r1:
    radii of its two arcs.
    """

    pitch: F64
    z0: F64
    z1: F64
    r0: F64
    r1: F64


def path_kinds(cloth: Interlacing, family: Family) -> PathKinds:
    """Every block of one family [m]: warp (picks, ends), from pick i to i+1; weft (picks, ends), end j to
    j+1.

    A cloth that is not periodic has one block less along the yarn.
    """
    pitch, z0, z1, same, radius0, radius1 = block_ends(cloth, family)
    # On a float the arc round the outermost crossing is real. The other only brings the path level, bending
    # away from its thread, so it may be as tight as the pitch needs.
    h = np.abs(z1 - z0)
    tightest = np.full_like(h, np.inf)
    np.divide(pitch**2 + h**2, 2 * h, out=tightest, where=h > 0)  # the S at which this pitch jams
    level0 = same & (np.abs(z0) < np.abs(z1))
    level1 = same & (np.abs(z1) < np.abs(z0))
    r0 = np.where(level0, np.clip(tightest - radius1, 0, radius0), radius0)
    r1 = np.where(level1, np.clip(tightest - radius0, 0, radius1), radius1)
    return PathKinds(np.broadcast_to(pitch, h.shape), z0, z1, r0, r1)


def block_ends(cloth: Interlacing, family: Family) -> tuple[F64, F64, F64, NDArray[np.bool_], F64, F64]:
    """Per block: pitch, height at both ends, both ends on the same face?, R of both crossings."""
    heights = crossing_heights(cloth.warp_up, cloth.warp_diameter_m, cloth.weft_diameter_m, cloth.balance)
    radius = _crossing_radius(cloth.warp_diameter_m, cloth.weft_diameter_m, cloth.warp_up.shape)
    along = 0 if family == "warp" else 1
    other: Family = "weft" if family == "warp" else "warp"
    across = cloth.pitches(other) - cloth.flats(other)
    pitch = across[:, None] if family == "warp" else across[None, :]

    def both_ends(values: NDArray) -> tuple[NDArray, NDArray]:
        beyond = np.roll(values, -1, axis=along)
        if cloth.periodic:
            return values, beyond
        cut = np.s_[:-1] if along == 0 else np.s_[:, :-1]
        return values[cut], beyond[cut]

    z0, z1 = both_ends(heights[0] if family == "warp" else heights[1])
    up0, up1 = both_ends(cloth.warp_up)
    return pitch, z0, z1, up0 == up1, *both_ends(radius)


def _straight(kinds: PathKinds) -> tuple[F64, F64, F64]:
    """s, theta and h of each block; raises InputError where the threads jam."""
    total, h = kinds.r0 + kinds.r1, np.abs(kinds.z1 - kinds.z0)
    square = kinds.pitch**2 - h * (2 * total - h)
    square = np.where(kinds.pitch > 0, square, -np.inf)
    if np.any(square < -2 * JAM_TOLERANCE * kinds.pitch**2):
        worst = np.unravel_index(np.argmin(square / kinds.pitch**2), square.shape)
        least = float(np.sqrt((h * (2 * total - h))[worst]))
        pitch = float(np.broadcast_to(kinds.pitch, square.shape)[worst])
        raise InputError(
            f"crimp: the threads jam: pitch {pitch:.6g}, least possible {least:.6g}; "
            f"use thinner yarn, more room, or another balance (see `jamming`)"
        )
    s = np.sqrt(np.maximum(square, 0))
    theta = np.arctan2(total * kinds.pitch - s * (total - h), s * kinds.pitch + total * (total - h))
    return s, np.where(h > 0, theta, 0.0), h


def weave_angle(kinds: PathKinds) -> F64:
    """Angle theta of the straight part to the cloth's plane [rad], (…). Raises InputError where threads jam."""
    return _straight(kinds)[1]


def yarn_length(kinds: PathKinds) -> F64:
    """Length of yarn l in each block, (…). Raises InputError where threads jam."""
    s, theta, h = _straight(kinds)
    return np.where(h > 0, (kinds.r0 + kinds.r1) * theta + s, kinds.pitch)


def centreline(kinds: PathKinds, u: ArrayLike) -> tuple[F64, F64]:
    """Height z and slope dz/du of each block at u in 0..1, u·pitch being the way along the cloth.

    u: (k,), or (…, k) for each block its own. Returns two arrays of shape (…, k). Raises InputError where threads jam.
    """
    _, theta, h = (value[..., None] for value in _straight(kinds))
    pitch, z0, r0, r1 = (
        np.broadcast_to(v, h.shape[:-1])[..., None] for v in (kinds.pitch, kinds.z0, kinds.r0, kinds.r1)
    )
    x = np.asarray(u, dtype=np.float64) * pitch
    rest = pitch - x
    sin, cos = np.sin(theta), np.cos(theta)
    on_first, on_last = x < r0 * sin, rest < r1 * sin
    reach = np.where(on_first, x, np.where(on_last, rest, 0.0))  # from the middle of the arc
    radius = np.where(on_first, r0, np.where(on_last, r1, 1.0))
    rise = np.sqrt(np.maximum(radius**2 - reach**2, 1e-300))
    tangent = sin / np.maximum(cos, 1e-12)
    dropped_first = r0 * (1 - cos)
    drop = np.where(
        on_first,
        radius - rise,
        np.where(on_last, h - (radius - rise), dropped_first + (x - r0 * sin) * tangent),
    )
    gradient = np.where(on_first | on_last, reach / rise, tangent)
    down = np.sign(z0 - np.broadcast_to(kinds.z1, h.shape[:-1])[..., None])
    return z0 - down * drop, -down * gradient * pitch


@dataclass(frozen=True)
class PeirceCell:
    """One yarn of a plain weave between two crossings. Its lengths are in the unit of the sizes given."""

    angle_rad: float
    crimp: float
    length: float
    height: float


def peirce(pitch: float, d1: float, d2: float, *, balance: float = 0.5) -> PeirceCell:
    """Peirce's plain weave: yarn 1 of diameter d1 over threads of diameter d2 at this pitch, h1 = balance
    (d1 + d2).

    >>> cell = peirce(1.0, 0.3, 0.3)
    >>> round(cell.crimp, 3), round(cell.height, 3)
    (0.047, 0.3)

    Raises InputError when the threads jam, pitch < (d1 + d2) sqrt(1 - (1 - balance)²), or a size is not
    above 0.
    """
    sizes = np.array([pitch, d1, d2], dtype=np.float64)
    if not (np.all(sizes > 0) and np.all(np.isfinite(sizes)) and 0 <= balance <= 1):
        raise InputError(
            f"peirce: pitch {pitch}, diameters {d1} and {d2}, balance {balance}; "
            f"allowed: lengths above 0 and a balance from 0 to 1"
        )
    radius, h = np.array(0.5 * (d1 + d2)), balance * (d1 + d2)
    kinds = PathKinds(np.array(float(pitch)), np.array(0.5 * h), np.array(-0.5 * h), radius, radius)
    length = float(yarn_length(kinds))
    return PeirceCell(angle_rad=float(weave_angle(kinds)), crimp=length / pitch - 1, length=length, height=h)


def peirce_crimp(height: float, pitch: float, free: float | None = None) -> float:
    """Crimp of a yarn that changes face at every crossing by Peirce's rule h = 4/3·p·√c, within 6 %; free: the part of
    the pitch that is not flat, all of it where None; one unit of length."""
    return 0.5625 * height * height / ((pitch if free is None else free) * pitch)


def crimp(cloth: Interlacing) -> tuple[F64, F64]:
    """Crimp of each yarn, its length over its straight length less 1: warp (ends,), weft (picks,).

    Raises InputError when the threads jam, or when a cloth that is not periodic has only one thread across.
    """

    def one(family: Family, along: int) -> F64:
        kinds = path_kinds(cloth, family)
        if kinds.z0.shape[along] == 0:
            raise InputError(f"crimp: a {family} yarn with a single crossing has no length; weave 2 or more")
        other: Family = "weft" if family == "warp" else "warp"
        flat = float(cloth.flats(other).sum())
        return (yarn_length(kinds).sum(axis=along) + flat) / (kinds.pitch.sum(axis=along) + flat) - 1

    return one("warp", 0), one("weft", 1)
