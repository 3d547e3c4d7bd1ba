"""A number that says where it is from and how far it may be wrong."""

from dataclasses import dataclass, replace
from math import pi
from typing import Literal

__all__ = ["UNITS", "Band", "Origin", "Quantity", "factor", "percent", "plus_minus"]

Origin = Literal["woven", "measured", "preset", "stated"]

UNITS = {
    "": 1.0,
    "%": 1e-2,
    "°": pi / 180.0,
    "mm": 1e-3,
    "g/m²": 1e-3,
    "µN·m": 1e-6,
    "mN": 1e-3,
    "N/m": 1.0,
    "kN/m": 1e3,
}
"""Units that quantities are printed in, and what each is in SI: m, kg/m², N·m, N, N/m, rad, or a share."""


@dataclass(frozen=True)
class Band:
    """How far a number may be wrong: by a factor, by percent of itself, or by so much of its own unit."""

    kind: Literal["factor", "percent", "plus-minus"]
    size: float

    def __str__(self) -> str:
        sign, end = {"factor": ("×/÷", ""), "percent": ("±", " %"), "plus-minus": ("±", "")}[self.kind]
        return f"{sign} {self.size:g}{end}"

    def limits(self, value: float) -> tuple[float, float]:
        """The least and the greatest that a value of this band stands for."""
        if self.kind == "factor":
            return value / self.size, value * self.size
        away = self.size if self.kind == "plus-minus" else abs(value) * self.size / 100.0
        return value - away, value + away


def factor(size: float) -> Band:
    """Right within a factor."""
    return Band("factor", size)


def percent(size: float) -> Band:
    """Right within a share of itself [%]."""
    return Band("percent", size)


def plus_minus(size: float) -> Band:
    """Right within so much of its own unit."""
    return Band("plus-minus", size)


@dataclass(frozen=True)
class Quantity:
    """One property of a cloth.

    value: in `unit`, one of UNITS. origin: "woven" where it follows from yarn and weave, "measured" on an instrument,
    "preset", or "stated" in a scene. how: the rule, the instrument or the preset, in words. band: None where a person
    gave the number, who alone knows.

    >>> str(Quantity("bending, warp", 11.2, "µN·m", "woven", "from yarn and weave", factor(2)))
    'bending, warp 11.2 µN·m (×/÷ 2, from yarn and weave)'
    """

    name: str
    value: float
    unit: str
    origin: Origin
    how: str
    band: Band | None = None

    def __str__(self) -> str:
        return f"{self.name} {self.shown} ({self.provenance})"

    @property
    def shown(self) -> str:
        """The value with its unit, in three digits, thousands of N/m as kN/m."""
        value, unit = self.value, self.unit
        if unit == "N/m" and abs(value) >= 1000:
            value, unit = value / 1000.0, "kN/m"
        digits = f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
        return f"{digits} {unit}".rstrip()

    @property
    def provenance(self) -> str:
        """The band and where it is from."""
        return self.how if self.band is None else f"{self.band}, {self.how}"

    @property
    def si(self) -> float:
        """The value in SI."""
        return self.value * UNITS[self.unit]

    def instead(self, value: float, origin: Origin, how: str) -> "Quantity":
        """The same property as somebody else has it, with no band."""
        return replace(self, value=value, origin=origin, how=how, band=None)

    def as_dict(self) -> dict[str, object]:
        """For JSON: name, value, unit, origin, how, and the limits of its band where it has one."""
        low_high = None if self.band is None else list(self.band.limits(self.value))
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "origin": self.origin,
            "how": self.how,
            "limits": low_high,
        }
