"""Yarn (paper 2.2): what a spinner states about it, what follows from that, and where its fibres run.

A yarn is described by count, plies, twist and fibre. Its diameter, helix angles and take-up follow from those by
the textbook formulas. `spin` lays its fibres out: one *period* of yarn, cut into equal blocks, that closes on
itself, so that blocks can be laid end to end for ever without a seam. Twist is therefore rounded to whole turns a
period; `Period` picks the number of blocks that makes the rounding least.

Axes of a straight yarn: x along it, (y, z) its section. A rotation by a positive angle about +x is the Z twist
(the middle stroke of the letter, seen from outside, runs along the surface fibres); S is the other.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, cos, isfinite, pi, sqrt, tan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.errors import InputError

__all__ = [
    "Direction",
    "Hairiness",
    "Period",
    "Strands",
    "Yarn",
    "drawn_radius",
    "hairs",
    "ne_to_tex",
    "pack_section",
    "resultant_count",
    "rotate_section",
    "spin",
    "turns_per_m",
]

Direction = Literal["S", "Z"]
F64 = NDArray[np.float64]
GOLDEN_ANGLE = pi * (3.0 - sqrt(5.0))


def ne_to_tex(count_ne: float) -> float:
    """English cotton count Ne (hanks of 840 yd per pound) as tex [g/km]: tex = 590.5 / Ne."""
    return 590.5 / count_ne


def resultant_count(n1: float, n2: float) -> float:
    """Count of two singles folded together, in an indirect system such as Ne: N1·N2 / (N1 + N2)."""
    return n1 * n2 / (n1 + n2)


def turns_per_m(twist_multiplier: float, count_ne: float) -> float:
    """Turns/m from a cotton twist multiplier: turns per inch = TM·√Ne (TM about 3.0 to 4.2)."""
    return twist_multiplier * sqrt(count_ne) / 0.0254


@dataclass(frozen=True)
class Hairiness:
    """Fibres that leave the yarn body: flyaway ends, and loops that come back to it.

    ends_per_m, loops_per_m: how many of each in a metre of yarn. height_mm: mean rise above the surface.
    """

    ends_per_m: float = 0.0
    loops_per_m: float = 0.0
    height_mm: float = 0.4


@dataclass(frozen=True, kw_only=True)
class Yarn:
    """A yarn as a spinner states it. Raises InputError where a value is impossible.

    count_tex: linear density of one single [tex = g/km].
    plies: singles folded together; 1 is a single yarn.
    twist_per_m, twist: turns/m and direction of the folding twist (of the yarn itself when plies is 1).
    singles_twist_per_m, singles_twist: turns/m and direction inside each single, seen in the finished yarn.
    fibre_density: of the fibre substance [kg/m³]. fineness_dtex: of one fibre [dtex = g per 10 km].
    packing: share of a single's section that is fibre; 0.60 gives cotton's textbook diameter.
    flattening: section of a ply, tangential over radial axis, at equal area; plies press each other flat.
    migration: how far a fibre wanders in the section, in fractions of its area; 0 keeps it on its helix.
    migration_period_mm: over which length it wanders.
    """

    count_tex: float
    plies: int = 2
    twist_per_m: float = 700.0
    twist: Direction = "S"
    singles_twist_per_m: float = 0.0
    singles_twist: Direction = "Z"
    fibre_density: float = 1520.0
    fineness_dtex: float = 1.7
    packing: float = 0.60
    flattening: float = 1.0
    migration: float = 0.25
    migration_period_mm: float = 4.0
    hairiness: Hairiness = Hairiness()

    def __post_init__(self) -> None:
        def check(name: str, value: float, low: float, high: float, unit: str) -> None:
            if not (isfinite(value) and low <= value <= high):
                raise InputError(f"yarn.{name}: {value:g}; allowed: {low:g} to {high:g} {unit}".rstrip())

        check("count_tex", self.count_tex, 0.1, 10_000, "tex")
        check("plies", self.plies, 1, 12, "")
        check("twist_per_m", self.twist_per_m, 0, 20_000, "turns/m")
        check("singles_twist_per_m", self.singles_twist_per_m, 0, 20_000, "turns/m")
        check("fibre_density", self.fibre_density, 100, 20_000, "kg/m3")
        check("fineness_dtex", self.fineness_dtex, 0.01, 1_000, "dtex")
        check("packing", self.packing, 0.05, 0.95, "")
        check("flattening", self.flattening, 0.5, 3.0, "")
        check("migration", self.migration, 0.0, 1.0, "")
        check("migration_period_mm", self.migration_period_mm, 0.1, 1000.0, "mm")
        for name in ("ends_per_m", "loops_per_m"):
            check(f"hairiness.{name}", getattr(self.hairiness, name), 0.0, 1e5, "per m")
        check("hairiness.height_mm", self.hairiness.height_mm, 0.01, 20.0, "mm")
        if self.fineness_dtex * 0.1 > self.count_tex:
            raise InputError(
                f"yarn.fineness_dtex: one fibre of {self.fineness_dtex:g} dtex is heavier than the whole single of "
                f"{self.count_tex:g} tex; use a finer fibre or a heavier count"
            )

    @property
    def resultant_tex(self) -> float:
        """Nominal linear density of the folded yarn [tex], without take-up."""
        return self.count_tex * self.plies

    @property
    def single_diameter(self) -> float:
        """Diameter of one single [m] from its mass: π/4·d²·φ·ρ = tex. At φ = 0.6 this is 1/(28√Ne) inch."""
        return sqrt(4.0 * self.count_tex * 1e-6 / (pi * self.fibre_density * self.packing))

    @property
    def ply_axes(self) -> tuple[float, float]:
        """Semi-axes of a ply's section [m]: (radial, tangential), of the area of the round single."""
        if self.plies == 1:
            return self.single_diameter / 2, self.single_diameter / 2
        root = sqrt(self.flattening)
        return self.single_diameter / 2 / root, self.single_diameter / 2 * root

    @property
    def ply_offset(self) -> float:
        """Distance [m] from the yarn's axis to a ply's axis: touching plies, R = a/sin(π/n) for round ones."""
        if self.plies == 1:
            return 0.0
        radial, tangential = self.ply_axes
        return radial if self.plies == 2 else max(radial, tangential) / float(np.sin(pi / self.plies))

    @property
    def diameter(self) -> float:
        """Diameter [m] of the round tube that holds the whole yarn as it leaves the twister."""
        return 2.0 * (self.ply_offset + self.ply_axes[0])

    @property
    def woven_diameter(self) -> float:
        """Diameter [m] of the circle of the same area as all plies: the textbook's, 1/(28√Ne) inch of the
        resultant count. A plied yarn is pressed to it between the threads it crosses."""
        return sqrt(self.plies) * self.single_diameter

    @property
    def fibre_diameter(self) -> float:
        """Diameter [m] of a round fibre of the stated fineness and density."""
        return sqrt(4.0 * self.fineness_dtex * 1e-7 / (pi * self.fibre_density))

    @property
    def fibres_in_section(self) -> int:
        """Fibres in the section of one single: tex of the single over tex of the fibre."""
        return max(1, round(self.count_tex / (self.fineness_dtex * 0.1)))

    @property
    def single_helix_angle(self) -> float:
        """α [rad] of a surface fibre in its single: tan α = 2π·r·T."""
        turns = self.singles_twist_per_m if self.plies > 1 else self.twist_per_m
        return float(np.arctan(pi * self.single_diameter * turns))

    @property
    def ply_helix_angle(self) -> float:
        """β [rad] of a ply's axis: tan β = 2π·R·T with R the ply offset (for two round plies half a diameter)."""
        return float(np.arctan(2.0 * pi * self.ply_offset * self.twist_per_m))

    @property
    def contraction(self) -> float:
        """Length of single needed for a unit of yarn by its own twist: (1 + sec α)/2."""
        return (1.0 + 1.0 / cos(self.single_helix_angle)) / 2.0

    @property
    def retraction(self) -> float:
        """Shortening by the single's own twist as a fraction of the length fed: tan²(α/2)."""
        return tan(self.single_helix_angle / 2.0) ** 2

    @property
    def ply_take_up(self) -> float:
        """Shortening by folding, as a fraction of the length fed: 1 − cos β."""
        return 1.0 - cos(self.ply_helix_angle)


@dataclass(frozen=True)
class Period:
    """A length of yarn that closes on itself: `blocks` blocks of `block_length` [m].

    ply_turns, single_turns: whole turns in the period, signed (Z positive).
    """

    block_length: float
    blocks: int
    ply_turns: int
    single_turns: int

    @cached_property
    def length(self) -> float:
        return self.block_length * self.blocks

    @staticmethod
    def of(yarn: Yarn, block_length: float, *, least: int = 24, most: int = 96) -> "Period":
        """The period of `least` to `most` blocks whose whole turns come nearest to the stated twists."""
        folding, own = _signed_twists(yarn)
        counts = np.arange(least, most + 1)
        error = np.zeros(len(counts))
        for twist in (folding, own):
            if twist != 0.0:
                turns = twist * block_length * counts
                error = np.maximum(error, np.abs(np.rint(turns) - turns) / np.abs(turns))
        blocks = int(counts[np.argmin(error)])
        length = blocks * block_length
        return Period(block_length, blocks, round(folding * length), round(own * length))


@dataclass(frozen=True)
class Strands:
    """Fibres of a straight yarn as rows of points, one row a fibre piece, equally spaced along the yarn.

    position: (f, k, 3) [m], x along the yarn, (y, z) from its axis. tangent, normal: (f, k, 3) unit vectors; the
    normal points away from the ply's axis. ply: (f,) int32. tone: (f,) brightness factor about 1.
    depth: (f, k) 0 at the middle of the yarn, 1 at its surface and beyond. radius: (f,) [m] of the drawn fibre.
    half_length: (f, k) [m] half the distance between neighbours, with the overlap that makes a row read as one.
    """

    position: F64
    tangent: F64
    normal: F64
    ply: NDArray[np.int32]
    tone: F64
    depth: F64
    radius: F64
    half_length: F64


OVERLAP = 3.0  # length of a drawn piece over the distance between pieces; below, a row of them shows its joints
TONE = 0.10  # spread of brightness from fibre to fibre
GIRTH = 0.18  # spread of radius from fibre to fibre


def pack_section(count: int) -> tuple[F64, F64]:
    """Even packing of `count` fibres in a unit disc: (area fraction in (0, 1), angle [rad]), each (count,).

    Vogel's spiral: radius √((k + ½)/n), successive angles apart by the golden angle; equal area for each fibre.
    """
    k = np.arange(count, dtype=np.float64)
    return (k + 0.5) / count, k * GOLDEN_ANGLE


def rotate_section(position: F64, angle: F64) -> F64:
    """Rotate points about the yarn's axis x: (…, 3) by (…,) [rad]. The move of the paper's Step 2."""
    c, s = np.cos(angle), np.sin(angle)
    y, z = position[..., 1], position[..., 2]
    return np.stack([position[..., 0], c * y - s * z, s * y + c * z], axis=-1)


def spin(
    yarn: Yarn,
    period: Period,
    *,
    fibres: int,
    steps: int,
    start: float,
    stop: float,
    seed: int,
    folded: bool = True,
) -> Strands:
    """Lay out `fibres` fibres a ply of the periodic yarn between `start` and `stop` [m], `steps` points a block.

    The drawn fibres are as many as asked for; their radius is such that they cover the area of the real ones.
    folded: False leaves the plies parallel and untwisted about each other (the paper's Step 1).
    Points stand at the middles of steps; x is measured from the start of the period.
    """
    count = max(1, round((stop - start) / period.block_length * steps))
    edges = np.linspace(start, stop, count + 1)
    x = (edges[:-1] + edges[1:]) / 2
    pitch = (stop - start) / count
    course = _Course(yarn, period, fibres, seed, folded)
    middle, centre, depth = course(x)
    delta = 0.25 * pitch
    ahead, _, _ = course(x + delta)
    behind, _, _ = course(x - delta)
    tangent = _unit(ahead - behind)
    out = middle - centre
    out[..., 0] = 0.0
    normal = out - tangent * np.sum(out * tangent, axis=-1, keepdims=True)
    slant = 1.0 / np.maximum(np.abs(tangent[..., 0]), 0.3)
    rows = yarn.plies * fibres
    return Strands(
        position=middle,
        tangent=tangent,
        normal=_unit(normal),
        ply=np.repeat(np.arange(yarn.plies, dtype=np.int32), fibres),
        tone=course.tone,
        depth=depth,
        radius=drawn_radius(yarn, fibres) * course.girth,
        half_length=OVERLAP * 0.5 * pitch * slant * np.ones((rows, count)),
    )


def drawn_radius(yarn: Yarn, fibres: int) -> float:
    """Radius [m] of a drawn fibre when `fibres` of them stand for all fibres of a single, at equal area."""
    return yarn.fibre_diameter / 2 * sqrt(yarn.fibres_in_section / fibres)


class _Course:
    """Where each fibre of the periodic yarn is at a length x: closed forms, so that any piece fits its neighbour."""

    def __init__(self, yarn: Yarn, period: Period, fibres: int, seed: int, folded: bool) -> None:
        self.yarn, self.period, self.folded = yarn, period, folded
        rng = np.random.Generator(np.random.Philox(key=seed))
        rows = yarn.plies * fibres
        area, angle = pack_section(fibres)
        self.area = np.tile(area, yarn.plies)[:, None]
        spins = rng.uniform(0.0, 2.0 * pi, yarn.plies)  # neighbouring plies must not be copies of each other
        self.angle = (np.tile(angle, yarn.plies) + np.repeat(spins, fibres))[:, None]
        self.ply_angle = (2.0 * pi / yarn.plies * np.repeat(np.arange(yarn.plies), fibres))[:, None]
        mean_waves = max(1, round(period.length / (yarn.migration_period_mm * 1e-3)))
        spread = max(1, mean_waves // 3)
        self.waves = rng.integers(max(1, mean_waves - spread), mean_waves + spread + 1, (rows, 2))
        self.wave_phase = rng.uniform(0.0, 2.0 * pi, (rows, 2))
        self.tone = 1.0 + TONE * np.clip(rng.standard_normal(rows), -2.0, 2.0)
        girth = 1.0 + GIRTH * rng.uniform(-1.0, 1.0, rows)
        self.girth = girth / np.sqrt(np.mean(girth**2))  # spread, at the same area in all
        self.inset = np.maximum(0.0, 1.0 - drawn_radius(yarn, fibres) * self.girth / min(yarn.ply_axes))[:, None]

    def __call__(self, x: F64) -> tuple[F64, F64, F64]:
        """Points (f, k, 3), the axis of their ply (f, k, 3), depth in the yarn (f, k)."""
        yarn, turn = self.yarn, 2.0 * pi * x[None, :] / self.period.length
        wander = np.sin(self.waves[:, :1] * turn + self.wave_phase[:, :1])
        swing = np.sin(self.waves[:, 1:] * turn + self.wave_phase[:, 1:])
        # The area fraction wanders and is folded back at the axis and at the surface, so density stays even.
        fraction = self.area + 0.5 * yarn.migration * wander
        fraction = np.abs(fraction)
        fraction = np.where(fraction > 1.0, 2.0 - fraction, fraction)
        rho = self.inset * np.sqrt(np.clip(fraction, 0.0, 1.0))
        own = self.angle + self.period.single_turns * turn + 0.8 * yarn.migration * swing
        radial, tangential = yarn.ply_axes
        zero = np.zeros_like(rho)
        local = np.stack([zero, yarn.ply_offset + radial * rho * np.cos(own), tangential * rho * np.sin(own)], -1)
        axis = np.stack([zero, zero + yarn.ply_offset, zero], -1)
        if yarn.plies > 1:
            fold = self.ply_angle + (self.period.ply_turns * turn if self.folded else zero)
            local, axis = rotate_section(local, fold), rotate_section(axis, fold)
        local[..., 0] = x
        axis[..., 0] = x
        return local, axis, np.clip(np.hypot(local[..., 1], local[..., 2]) / (yarn.diameter / 2), 0.0, 1.0)


def hairs(yarn: Yarn, *, length: float, step: float, seed: int) -> Strands:
    """Flyaway ends and loops on `length` [m] of yarn, each a row of points at most `step` [m] apart.

    A flyaway end leaves the surface at a slant and rises; a loop rises and comes back. Which and where is drawn
    from `seed`; their number is the stated number per metre, rounded at random so that the mean is right.
    All rows have as many points as the longest hair needs. A hair is as thick as a real fibre.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    stated = yarn.hairiness
    counts = [int(n * length + rng.random()) for n in (stated.ends_per_m, stated.loops_per_m)]
    rows = sum(counts)
    height = stated.height_mm * 1e-3 * np.clip(rng.exponential(1.0, rows), 0.15, 3.0)
    reach = height * rng.uniform(0.8, 2.2, rows) * np.where(rng.random(rows) < 0.5, -1.0, 1.0)
    span = np.hypot(height * 1.3, reach)
    points = max(4, ceil(float(span.max()) / step)) if rows else 4
    tau = (np.arange(points) + 0.5) / points
    is_end = (np.arange(rows) < counts[0])[:, None]
    t = tau[None, :]
    bend, lean = rng.uniform(-1.2, 1.2, (2, rows, 1))
    around = rng.uniform(0.0, 2.0 * pi, (rows, 1))
    begin = rng.uniform(0.0, length, (rows, 1))
    curl = rng.uniform(0.03, 0.14, (rows, 1))  # of the hair's length
    waves, phase = rng.uniform(3.0, 9.0, (2, rows, 1))

    def path(t: F64) -> F64:
        rise = np.where(is_end, np.maximum(t, 0.0) ** 1.4, 4.0 * t * (1.0 - t)) * height[:, None]
        swing = curl * np.sin(pi * np.clip(t, 0.0, 1.0) * 0.5) * span[:, None]
        r = 0.92 * yarn.diameter / 2 + rise
        turn = around + bend * t + lean * t * t + swing * np.sin(waves * t + phase) / r
        x = begin + reach[:, None] * t + swing * (np.cos(waves * 0.8 * t + phase) - np.cos(phase))
        return np.stack([x, r * np.cos(turn), r * np.sin(turn)], -1)

    middle = path(t)
    tangent = _unit(path(t + 1e-3) - path(t - 1e-3))
    out = middle.copy()
    out[..., 0] = 0.0
    normal = out - tangent * np.sum(out * tangent, axis=-1, keepdims=True)
    segment = np.linalg.norm(path(t + 0.5 / points) - path(t - 0.5 / points), axis=-1)
    return Strands(
        position=middle,
        tangent=tangent,
        normal=_unit(normal),
        ply=np.zeros(rows, np.int32),
        tone=1.05 + 0.08 * rng.standard_normal(rows).clip(-2, 2),
        depth=np.ones((rows, points)),
        radius=np.full(rows, yarn.fibre_diameter / 2),
        half_length=OVERLAP * 0.5 * segment,
    )


def _signed_twists(yarn: Yarn) -> tuple[float, float]:
    """(folding, inside each single) [turns/m], Z positive. A single yarn has its twist inside."""

    def sign(direction: Direction) -> float:
        return 1.0 if direction == "Z" else -1.0

    if yarn.plies == 1:
        return 0.0, sign(yarn.twist) * yarn.twist_per_m
    return sign(yarn.twist) * yarn.twist_per_m, sign(yarn.singles_twist) * yarn.singles_twist_per_m


def _unit(v: Any) -> F64:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30)
