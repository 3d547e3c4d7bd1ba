"""What acts on a sheet from outside. Each is optional, and left out of the kernels where it is not named.

Wind (after Keckeisen et al. 2004, "Wind fields"; flat plates): of a patch with area vector N (its area, along its
normal) in an air flow u relative to it,

    F = ½ ρ (C_D |N·u| u + C_L (N·u)/|N| (|u| N − (N·u) u/|u|)),

drag along the flow and lift across it; neither depends on which side is called the front.
"""

from dataclasses import dataclass
from math import isfinite, pi

import numpy as np

from taichi_cloth.body.colliders.colliders import BoneFrame, Colliders
from taichi_cloth.ground.errors import InputError

__all__ = ["Forces", "FrameForces", "Plane", "SelfContact", "Sphere", "StrainLimit", "Wind"]

Vector = tuple[float, float, float]

_STILL: Vector = (0.0, 0.0, 0.0)


def _check(name: str, value: float, *, positive: bool = False) -> None:
    if not (isfinite(value) and (value > 0 if positive else value >= 0)):
        raise InputError(f"{name}: {value!r}; allowed: a finite number, {'above 0' if positive else '0 or more'}")


def _check_vector(name: str, value: Vector) -> None:
    if len(value) != 3 or not all(isfinite(v) for v in value):
        raise InputError(f"{name}: {value!r}; allowed: three finite numbers")


@dataclass(frozen=True, kw_only=True)
class Wind:
    """Air that moves, the same everywhere, with seeded gusts.

    velocity: its mean [m/s]. gusts: root mean square of the gusts along each axis, as a share of the mean speed.
    period: of the slowest gust [s]; the quickest is an eighth of it. air_density [kg/m³]. drag, lift: C_D and C_L.
    """

    velocity: Vector
    gusts: float = 0.0
    period: float = 4.0
    air_density: float = 1.2
    drag: float = 1.2
    lift: float = 0.6
    seed: int = 0

    def __post_init__(self) -> None:
        _check_vector("wind.velocity", self.velocity)
        for name in ("gusts", "drag", "lift"):
            _check(f"wind.{name}", getattr(self, name))
        for name in ("period", "air_density"):
            _check(f"wind.{name}", getattr(self, name), positive=True)

    def at(self, time: float) -> Vector:
        """Velocity [m/s] at a time [s]: the mean and 8 sines an axis, of seeded phases and spread periods."""
        mean = np.asarray(self.velocity, np.float64)
        rng = np.random.Generator(np.random.Philox(key=self.seed))
        phase = rng.uniform(0, 2 * pi, (3, 8))
        rate = 2 * pi / self.period * 8 ** ((np.arange(8) + rng.uniform(0, 1, (3, 8))) / 8)
        gust = np.sin(rate * time + phase).sum(axis=1) / 2  # mean square of one sine is ½: 8 of them give 4
        out = mean + self.gusts * float(np.linalg.norm(mean)) * gust
        return float(out[0]), float(out[1]), float(out[2])


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A fixed ball. centre [m], radius [m], gap: kept between it and the key points [m], friction: Coulomb's µ."""

    centre: Vector
    radius: float
    friction: float = 0.3
    gap: float = 0.0

    def __post_init__(self) -> None:
        _check_vector("sphere.centre", self.centre)
        _check("sphere.radius", self.radius, positive=True)
        _check("sphere.friction", self.friction)
        _check("sphere.gap", self.gap)


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A fixed half space below `height` [m] along the unit vector `normal`. gap, friction: as of Sphere."""

    normal: Vector = (0.0, 1.0, 0.0)
    height: float = 0.0
    friction: float = 0.3
    gap: float = 0.0

    def __post_init__(self) -> None:
        _check_vector("plane.normal", self.normal)
        _check("plane.friction", self.friction)
        _check("plane.gap", self.gap)
        if not isfinite(self.height) or abs(float(np.linalg.norm(self.normal)) - 1) > 1e-6:
            raise InputError(f"plane.normal: {self.normal!r}; allowed: a vector of length 1, and a finite height")


@dataclass(frozen=True, kw_only=True)
class StrainLimit:
    """Threads that have become too long are shortened after each substep (Provot 1995, "Deformation constraints").

    strain: by how much of its length a thread may grow; Provot takes a tenth. passes: over those threads and the seams,
    each substep; the more, the closer the limit is kept where a long row of threads hangs on one.
    """

    strain: float = 0.1
    passes: int = 3

    def __post_init__(self) -> None:
        _check("strain_limit.strain", self.strain)
        if not 1 <= self.passes <= 101:
            raise InputError(f"strain_limit.passes: {self.passes!r}; allowed: 1 to 101")


@dataclass(frozen=True, kw_only=True)
class SelfContact:
    """Cloth that does not pass through cloth. thickness: kept between layers [m], smooth surfaces through their
    key points. friction: Coulomb's µ. held: whether key points of what is sewn are held in the room round their paths
    within substeps, see `paths.py`. Where seams jam cloth there is next to none, and held in it all is driven along."""

    thickness: float
    friction: float = 0.3
    held: bool = True

    def __post_init__(self) -> None:
        _check("self_contact.thickness", self.thickness, positive=True)
        _check("self_contact.friction", self.friction)


@dataclass(frozen=True, kw_only=True)
class Forces:
    """Everything that acts on a sheet beside its own springs. gravity [m/s²]; y is up."""

    gravity: Vector = (0.0, -9.81, 0.0)
    wind: Wind | None = None
    sphere: Sphere | None = None
    plane: Plane | None = None
    body: Colliders | None = None
    strain_limit: StrainLimit | None = None
    self_contact: SelfContact | None = None

    def __post_init__(self) -> None:
        _check_vector("forces.gravity", self.gravity)

    def during(self, start: float, end: float) -> "FrameForces":
        """What a solver needs for a frame from `start` to `end` [s]."""
        wind = self.wind
        return FrameForces(
            wind_start=wind.at(start) if wind else _STILL,
            wind_end=wind.at(end) if wind else _STILL,
            body=self.body.during(start, end) if self.body else None,
        )


@dataclass(frozen=True, kw_only=True)
class FrameForces:
    """What changes from frame to frame. wind_start, wind_end: [m/s] at its ends, linear between. body: its bones."""

    wind_start: Vector = _STILL
    wind_end: Vector = _STILL
    body: BoneFrame | None = None
