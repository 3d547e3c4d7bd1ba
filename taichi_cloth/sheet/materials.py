"""Fabric properties that dynamics follows from, and presets with their sources.

Everything is a property of the *sheet*, per width or per area, so it does not know how finely the sheet is cut into
key points. Kawabata's units (KES-F): 1 gf·cm²/cm of bending rigidity = 98.07 µN·m, 1 gf/(cm·deg) of shear stiffness
= 56.2 N/m.

Sources. Denim: all of it measured, "11oz-black-denim" of Wang, O'Brien & Ramamoorthi 2011 ("Data-driven elastic models
for cloth: modeling and measurement", SIGGRAPH), from their published material file: 0.324 kg/m²; small-strain moduli
C22 = 1014–1059 N/m along the stiffer family (here the warp), C11 = 205–232 N/m along the other, C33 = 53–84 N/m in
shear; bending 97 and 64 µN·m. Their C12 of 10–62 N/m has no counterpart in springs. The other three: bending and shear
are the middle of ranges usual in Kawabata's measurements ("The standardization and analysis of hand evaluation", 1980)
for habotai silk, cotton shirting and wool suiting; those ranges are quoted from memory and were not checked against
the book. Their tensile stiffness is the secant of the first percent, a round number of the right order and not a
measurement.

Once crimp is drawn out, threads of n ends a metre, T tex and a modulus Y of their yarn carry n T Y: 190 and 90 kN/m for
a shirting of 52 × 28 threads of 14.8 tex a centimetre, 84 and 66 for habotai, 94 and 86 for a suiting of 33 tex, with a
tenth less than the fibre's modulus for filaments and half of it for spun yarns; by that 380 to 530 for denim, for which
300 stand here.
The strain at which that is has the order of what cloth gives on a tensile tester, again a round number: a cotton of 158
g/m² grew by 2.29 % at 490 N/m (Tadesse et al. 2018, Materials 11, 2466), this shirting by 2.2 and 2.5; suitings by 2 to
4 % at 98 N/m (usual of FAST), this one by 3.1.
"""

from dataclasses import dataclass, fields, replace
from math import isfinite

from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["MATERIALS", "Material", "named_material"]

_BENDING = 98.07e-6  # N·m of 1 gf·cm²/cm
_SHEAR = 56.2  # N/m of 1 gf/(cm·deg)
RIGHT_ANGLE = 1.57  # rad


@dataclass(frozen=True, kw_only=True)
class Material:
    """A fabric as a sheet. Raises InputError on values that no cloth can have.

    tensile_warp, tensile_weft: force per width and strain when pulled along one family with free edges [N/m].
    drawn_warp, drawn_weft: the same once the crimp of that family is drawn out [N/m]; 0: its law stays linear.
    crimp_warp, crimp_weft: strain at which that is; T(ε) = E₀ ε + (E₁ − E₀) max(ε − crimp, 0). Whole yarns follow it.
    shear: force per width and radian of shear angle [N/m].
    bending_warp, bending_weft: rigidity when the warp, or the weft, is bent [N·m] (moment per width and curvature).
    density: mass per area [kg/m²].
    couple_warp, couple_weft: moment a width that fibres hold by friction before they slip, half of KES's 2HB [N].
    torsion: J of both families together, moment a width and twist [N·m].
    shear_friction: force per width that crossings hold before they turn, half of KES's 2HG [N/m].
    locking: shear angle at which neighbouring threads touch [rad].
    What is 0 of these five the fabric has none of, nor do its kernels.
    air_damping: share of the velocity lost a second, as a rate [1/s].
    fibre_damping: time by which the stress in springs and hinges lags behind, of Kelvin and Voigt [s].
    """

    tensile_warp: float
    tensile_weft: float
    shear: float
    bending_warp: float
    bending_weft: float
    density: float
    air_damping: float = 1.0
    fibre_damping: float = 0.0
    drawn_warp: float = 0.0
    drawn_weft: float = 0.0
    crimp_warp: float = 0.0
    crimp_weft: float = 0.0
    couple_warp: float = 0.0
    couple_weft: float = 0.0
    torsion: float = 0.0
    shear_friction: float = 0.0
    locking: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            positive = field.name in ("tensile_warp", "tensile_weft", "density")
            if not (isfinite(value) and (value > 0 if positive else value >= 0)):
                allowed = "above 0" if positive else "0 or more"
                raise InputError(f"material.{field.name}: {value!r}; allowed: a finite number, {allowed}")
        if self.locking >= RIGHT_ANGLE:
            raise InputError(f"material.locking: {self.locking!r} rad; allowed: less than a right angle, or 0 for none")
        for family in ("warp", "weft"):
            soft, stiff = getattr(self, f"tensile_{family}"), getattr(self, f"drawn_{family}")
            if 0 < stiff < soft:
                raise InputError(
                    f"material.drawn_{family}: {stiff:g} N/m; allowed: at least its {soft:g} N/m before, or 0 for none"
                )

    @property
    def linear(self) -> "Material":
        """The same with threads that stay as they are before their crimp is drawn out."""
        return replace(self, drawn_warp=0.0, drawn_weft=0.0, crimp_warp=0.0, crimp_weft=0.0)

    @property
    def elastic(self) -> "Material":
        """The same without friction within it, torsion and locking: the five numbers that may be 0."""
        return replace(self, couple_warp=0.0, couple_weft=0.0, torsion=0.0, shear_friction=0.0, locking=0.0)

    @property
    def curved(self) -> bool:
        """Whether threads get stiffer as their crimp is drawn out."""
        return self.drawn_warp > 0 or self.drawn_weft > 0


MATERIALS = {
    "cotton-shirting": Material(
        tensile_warp=1500.0,
        tensile_weft=1000.0,
        shear=1.2 * _SHEAR,
        bending_warp=0.09 * _BENDING,
        bending_weft=0.06 * _BENDING,
        density=0.115,
        drawn_warp=190e3,
        drawn_weft=90e3,
        crimp_warp=0.02,
        crimp_weft=0.02,
    ),
    "silk-habotai": Material(
        tensile_warp=1200.0,
        tensile_weft=900.0,
        shear=0.3 * _SHEAR,
        bending_warp=0.015 * _BENDING,
        bending_weft=0.012 * _BENDING,
        density=0.055,
        drawn_warp=84e3,
        drawn_weft=66e3,
        crimp_warp=0.015,
        crimp_weft=0.02,
    ),
    "wool-suiting": Material(
        tensile_warp=1000.0,
        tensile_weft=800.0,
        shear=0.75 * _SHEAR,
        bending_warp=0.13 * _BENDING,
        bending_weft=0.11 * _BENDING,
        density=0.220,
        drawn_warp=94e3,
        drawn_weft=86e3,
        crimp_warp=0.03,
        crimp_weft=0.03,
    ),
    "denim": Material(
        tensile_warp=1040.0,
        tensile_weft=220.0,
        shear=70.0,
        bending_warp=97e-6,
        bending_weft=64e-6,
        density=0.324,
        drawn_warp=300e3,
        drawn_weft=300e3,
        crimp_warp=0.025,
        crimp_weft=0.03,
    ),
}
"""Presets by name; the sources stand at the head of this module."""


def named_material(name: str) -> Material:
    """A preset by its name. Raises InputError on a name that is not known."""
    if name not in MATERIALS:
        raise InputError(
            f"material: unknown material {name!r}; known: {', '.join(MATERIALS)}{did_you_mean(name, MATERIALS)}"
        )
    return MATERIALS[name]
