"""Everything that follows from a construction, each number with its unit, its origin and its band.

The bands are what is known of the formulas' errors: mass and thickness on measured cloths; bending on five whose
construction had to be inverted from mass and thickness (median factor 1.9); shear, tension and hysteresis on less.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from taichi_cloth.mechanics.bending import bias_bending, family_bending, family_couple, family_torsion
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.drape import bending_length, drape_coefficient
from taichi_cloth.mechanics.quantity import Band, Quantity, factor, percent, plus_minus
from taichi_cloth.mechanics.shear import locking_angle, shear_hysteresis, shear_stiffness
from taichi_cloth.mechanics.tension import family_tension, poisson

__all__ = ["FabricProperties", "light_thickness", "woven_properties"]

WOVEN = "from yarn and weave"
BANDS: dict[str, tuple[str, str, Band]] = {
    "areal_density": ("areal density", "g/m²", percent(10)),
    "thickness": ("thickness at light pressure", "mm", percent(15)),
    "body_thickness": ("thickness of the threads as drawn", "mm", percent(15)),
    "cover": ("cover factor Kc", "", percent(5)),
    "crimp_warp": ("crimp, warp", "%", plus_minus(3)),
    "crimp_weft": ("crimp, weft", "%", plus_minus(3)),
    "bending_warp": ("bending, warp", "µN·m", factor(2)),
    "bending_weft": ("bending, weft", "µN·m", factor(2)),
    "couple_warp": ("bending hysteresis 2HB, warp", "mN", factor(2.5)),
    "couple_weft": ("bending hysteresis 2HB, weft", "mN", factor(2.5)),
    "torsion": ("torsion J", "µN·m", factor(3)),
    "shear": ("shear G", "N/m", factor(3)),
    "shear_hysteresis": ("shear hysteresis 2HG", "N/m", factor(3)),
    "locking_angle": ("locking angle of shear", "°", plus_minus(10)),
    "tensile_warp": ("tension at first, warp", "N/m", factor(3)),
    "tensile_weft": ("tension at first, weft", "N/m", factor(3)),
    "drawn_warp": ("tension, crimp drawn out, warp", "N/m", percent(25)),
    "drawn_weft": ("tension, crimp drawn out, weft", "N/m", percent(25)),
    "strain_warp": ("strain that draws crimp out, warp", "%", plus_minus(2)),
    "strain_weft": ("strain that draws crimp out, weft", "%", plus_minus(2)),
    "poisson_warp": ("contraction of weft, warp pulled", "", factor(2)),
    "poisson_weft": ("contraction of warp, weft pulled", "", factor(2)),
    "friction": ("friction, cloth on cloth", "", plus_minus(0.1)),
}
"""Key: name, unit and band where it is woven."""

DERIVED = ("bending_length_warp", "bending_length_weft", "bias_bending", "drape_coefficient")


@dataclass(frozen=True, eq=False)
class FabricProperties(Mapping[str, Quantity]):
    """The quantities of a fabric by key: those of BANDS and DERIVED. What is derived follows those it is derived from,
    whoever they are from."""

    stated: Mapping[str, Quantity]

    def __getitem__(self, key: str) -> Quantity:
        return self._derived(key) if key in DERIVED else self.stated[key]

    def __iter__(self) -> Iterator[str]:
        yield from self.stated
        yield from DERIVED

    def __len__(self) -> int:
        return len(self.stated) + len(DERIVED)

    def si(self, key: str) -> float:
        """A value in SI."""
        return self[key].si

    def but(self, changed: Mapping[str, Quantity]) -> "FabricProperties":
        """The same with some quantities from somebody else."""
        return FabricProperties({**self.stated, **changed})

    def _derived(self, key: str) -> Quantity:
        own = self.stated
        density, warp, weft = (own[k].value for k in ("areal_density", "bending_warp", "bending_weft"))
        sources = {own[k].origin for k in ("areal_density", "bending_warp", "bending_weft")}
        origin = "woven" if "woven" in sources else own["bending_warp"].origin
        if key == "drape_coefficient":
            value = drape_coefficient((warp + weft) / 2.0, density)
            return Quantity("drape coefficient", value, "%", origin, "from bending and mass by a curve", plus_minus(12))
        if key == "bias_bending":
            value = bias_bending(warp, weft, own["torsion"].value, 0.785398163)
            return Quantity("bending on the bias, 45°", value, "µN·m", origin, "from bending and torsion", factor(2))
        family = key.rpartition("_")[2]
        value = bending_length(own[f"bending_{family}"].value, density)
        return Quantity(f"bending length, {family}", value, "mm", origin, "from bending and mass", factor(1.3))


def light_thickness(cloth: Construction) -> float:
    """Thickness at light pressure [mm]: the sum of both round diameters times 1.30 less 0.20 for each change of face a
    crossing: 1.20 in 2/2 and 3/1 twills, to which it is fitted, less in plain weave, whose threads cannot bulge in
    floats. Threads of filaments lie flat and hairless, as thick as they are thick."""
    warp, weft = cloth.families
    bulge = 1.30 - 0.20 * (warp.turns + weft.turns) / 2.0
    thick = sum(
        own.diameter * (cloth.flattening**-0.5 if own.fibre.form == "filament" else bulge) for own in (warp, weft)
    )
    return float(thick)


def woven_properties(cloth: Construction) -> FabricProperties:
    """What follows from fibre, yarns, weave and sett."""
    bending, couple, tension = family_bending(cloth), family_couple(cloth), family_tension(cloth)
    families = cloth.families
    both: dict[str, tuple[float, float]] = {
        "crimp": (100.0 * families[0].crimp, 100.0 * families[1].crimp),
        "bending": bending,
        "couple": (2.0 * couple[0], 2.0 * couple[1]),
        "tensile": (tension[0].initial, tension[1].initial),
        "drawn": (tension[0].drawn, tension[1].drawn),
        "strain": (100.0 * tension[0].crimp_strain, 100.0 * tension[1].crimp_strain),
        "poisson": (poisson(cloth, 0), poisson(cloth, 1)),
    }
    values = {
        "areal_density": cloth.areal_density,
        "thickness": light_thickness(cloth),
        "body_thickness": cloth.facts.thickness_mm,
        "cover": cloth.facts.cover,
        "torsion": family_torsion(cloth),
        "shear": shear_stiffness(cloth),
        "shear_hysteresis": shear_hysteresis(cloth),
        "locking_angle": locking_angle(cloth),
        "friction": (families[0].fibre.friction + families[1].fibre.friction) / 2.0,
        **{f"{key}_{name}": pair[k] for key, pair in both.items() for k, name in enumerate(("warp", "weft"))},
    }
    return FabricProperties(
        {
            key: Quantity(name, float(values[key]), unit, "woven", WOVEN, band)
            for key, (name, unit, band) in BANDS.items()
        }
    )
