"""Yarn (paper 2.2): what a spinner states about it, and what follows from that by the textbook formulas.

A yarn is described by count, plies, twist and fibre. Where its fibres run is in `spin`.
"""

from dataclasses import dataclass, replace
from math import cos, isfinite, pi, sqrt, tan
from typing import Literal

import numpy as np

from taichi_cloth.ground.errors import InputError

__all__ = [
    "CLOSEST_PACKING",
    "Direction",
    "Hairiness",
    "Yarn",
    "count_for_diameter",
    "resultant_count",
    "turns_per_m",
]

Direction = Literal["S", "Z"]

NAP_PER_M = 12_000.0
"""Hairs a metre that are a nap: of 22 µm and 1 mm, on 20 yarns a cm each way, they cover each side of a cloth once."""

CLOSEST_PACKING = 0.75
"""Share of a thread's section that is fibre where its neighbours press it as close as they do in dense cloth."""


LOOSE = 0.09
"""Angle of a ply to the axis [rad], 5 degrees, up to which folding does not hold plies together: spun yarns are folded
at 15 to 35, thrown silk of a hundred turns a metre at 2."""


def count_for_diameter(diameter: float, fibre_density: float, packing: float, plies: int) -> float:
    """Linear density [tex] of each of `plies` singles that together have the woven diameter [m]: mass of a length of
    their section, of which the share `packing` is fibre of the density [kg/m³]."""
    return 1e6 * pi / 4 * diameter**2 * fibre_density * packing / plies


def resultant_count(n1: float, n2: float) -> float:
    """Count of two singles folded together, in an indirect system such as Ne: N1·N2 / (N1 + N2).

    >>> resultant_count(30, 30)
    15.0
    """
    return n1 * n2 / (n1 + n2)


def turns_per_m(twist_multiplier: float, count_ne: float) -> float:
    """Turns/m from a cotton twist multiplier: turns per inch = TM·√Ne (TM about 3.0 to 4.2)."""
    return twist_multiplier * sqrt(count_ne) / 0.0254


@dataclass(frozen=True)
class Hairiness:
    """Fibres that leave the yarn body: flyaway ends, and loops that come back to it.

    ends_per_m, loops_per_m: how many of each in a metre of yarn. height_mm: mean rise above the surface. lie: how far
    a hair goes along its yarn over how high it rises, on average: those of a nap lie flat.
    """

    ends_per_m: float = 0.0
    loops_per_m: float = 0.0
    height_mm: float = 0.4
    lie: float = 1.5

    @property
    def of_nap(self) -> bool:
        """Whether they are so many that they hide the yarns under them."""
        return self.ends_per_m + self.loops_per_m >= NAP_PER_M


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
    unevenness: coefficient of variation of its mass along it, of which its twist has as much.
    loss: share of its mass that it loses until the cloth is finished; its count and its size are those before.
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
    unevenness: float = 0.0
    loss: float = 0.0

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
        check("unevenness", self.unevenness, 0.0, 0.5, "")
        check("loss", self.loss, 0.0, 0.5, "")
        check("migration", self.migration, 0.0, 1.0, "")
        check("migration_period_mm", self.migration_period_mm, 0.1, 1000.0, "mm")
        for name in ("ends_per_m", "loops_per_m"):
            check(f"hairiness.{name}", getattr(self.hairiness, name), 0.0, 1e5, "per m")
        check("hairiness.height_mm", self.hairiness.height_mm, 0.01, 20.0, "mm")
        check("hairiness.lie", self.hairiness.lie, 0.1, 50.0, "")
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
    def folded_tex(self) -> float:
        """Linear density of the folded yarn [tex] with what folding takes up, less what finishing takes: as it lies in
        the cloth."""
        return self.resultant_tex / (1.0 - self.ply_take_up) * (1.0 - self.loss)

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
    def as_one(self) -> "Yarn":
        """The same with all plies as one single, where they are folded so little that nothing keeps them apart: thrown
        silk of three singles lies in cloth as one flat bundle of filaments."""
        if self.plies == 1 or self.ply_helix_angle > LOOSE:
            return self
        return replace(self, plies=1, count_tex=self.resultant_tex)

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
