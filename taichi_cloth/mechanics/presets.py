"""Constructions: cloths of the trade by name, fibre, yarns, weave and sett.

The first four are those of `sheet.materials`, made so that the weight lies within 2 % of the preset's and bending
within the band of the formulas (docs/fabrics.md lists each property of both). The others are ordinary goods whose
weight the trade knows: it lies within 5 %.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import pi
from types import MappingProxyType

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.mechanics.construction import FLATTENING, Construction, usual_loss
from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics, fibre_mechanics
from taichi_cloth.mechanics.properties import FabricProperties, woven_properties
from taichi_cloth.mechanics.quantity import Quantity
from taichi_cloth.sheet.materials import MATERIALS, Material
from taichi_cloth.weave.draft import named_weave
from taichi_cloth.yarn.count import in_count, parse_count
from taichi_cloth.yarn.yarn import Yarn, turns_per_m

__all__ = [
    "PRESET_KEYS",
    "TRADE",
    "WITHIN",
    "TradeCloth",
    "named_construction",
    "preset_properties",
    "trade_sections",
    "within_material",
    "woven_material",
    "yarn_of_count",
]

INCH = 2.54  # cm


@dataclass(frozen=True, kw_only=True)
class TradeCloth:
    """A cloth as the trade names it.

    fibre: a kind. warp, weft: counts in the trade's words. weave: of `named_weave`. ends_per_cm, picks_per_cm: of the
    finished cloth. twist_multiplier: of the yarns, by their resultant count. weight: what the trade or the preset says
    it weighs [g/m²]. finish: see `construction.FINISHES`. flattening: of the threads; None takes that of FLATTENING.
    """

    title: str
    fibre: str
    warp: str
    weft: str
    weave: str
    ends_per_cm: float
    picks_per_cm: float
    twist_multiplier: float
    weight: float
    finish: str = "plain"
    flattening: float | None = None


TRADE: Mapping[str, TradeCloth] = MappingProxyType(
    {
        "cotton-shirting": TradeCloth(
            title="poplin shirting, 40s × 40s, 118 × 68 an inch",
            fibre="cotton",
            warp="Ne 40",
            weft="Ne 40",
            weave="plain",
            ends_per_cm=118 / INCH,
            picks_per_cm=68 / INCH,
            twist_multiplier=4.0,
            weight=115.0,
        ),
        "silk-habotai": TradeCloth(
            title="habotai of 12.7 momme, two threads of 20/22 den",
            fibre="silk",
            warp="20/22 den x 2",
            weft="20/22 den x 2",
            weave="plain",
            ends_per_cm=60.5,
            picks_per_cm=47.5,
            twist_multiplier=0.3,
            weight=55.0,
        ),
        "wool-suiting": TradeCloth(
            title="worsted suiting, 2/48 Nm, 2/2 twill",
            fibre="wool",
            warp="2/48 Nm",
            weft="2/48 Nm",
            weave="twill-2/2",
            ends_per_cm=24.5,
            picks_per_cm=22.5,
            twist_multiplier=3.0,
            weight=220.0,
            flattening=1.2,
        ),
        "denim": TradeCloth(
            title="raw denim of 9.6 oz, 8s × 8s, 3/1 twill",
            fibre="cotton",
            warp="Ne 8",
            weft="Ne 8",
            weave="twill-3/1",
            ends_per_cm=24.2,
            picks_per_cm=15.5,
            twist_multiplier=4.2,
            weight=324.0,
            finish="sized",
            flattening=1.5,
        ),
        "poplin": TradeCloth(
            title="poplin, 40s × 40s, 133 × 72 an inch",
            fibre="cotton",
            warp="Ne 40",
            weft="Ne 40",
            weave="plain",
            ends_per_cm=133 / INCH,
            picks_per_cm=72 / INCH,
            twist_multiplier=4.0,
            weight=128.0,
        ),
        "sheeting": TradeCloth(
            title="sheeting, 32s × 32s, 68 × 68 an inch",
            fibre="cotton",
            warp="Ne 32",
            weft="Ne 32",
            weave="plain",
            ends_per_cm=68 / INCH,
            picks_per_cm=68 / INCH,
            twist_multiplier=4.0,
            weight=105.0,
        ),
        "habotai-8mm": TradeCloth(
            title="habotai of 8 momme, two threads of 20/22 den",
            fibre="silk",
            warp="20/22 den x 2",
            weft="20/22 den x 2",
            weave="plain",
            ends_per_cm=39.0,
            picks_per_cm=33.0,
            twist_multiplier=0.3,
            weight=34.5,
        ),
        "denim-12oz": TradeCloth(
            title="raw denim of 12 oz, 7s × 6s, 64 × 40 an inch",
            fibre="cotton",
            warp="Ne 7",
            weft="Ne 6",
            weave="twill-3/1",
            ends_per_cm=64 / INCH,
            picks_per_cm=40 / INCH,
            twist_multiplier=4.2,
            weight=407.0,
            finish="sized",
            flattening=1.1,
        ),
        "wool-flannel": TradeCloth(
            title="worsted flannel of 260 g/m², 2/36 Nm, 2/2 twill",
            fibre="wool",
            warp="2/36 Nm",
            weft="2/36 Nm",
            weave="twill-2/2",
            ends_per_cm=21.5,
            picks_per_cm=20.0,
            twist_multiplier=3.0,
            weight=260.0,
            finish="raised",
            flattening=1.2,
        ),
    }
)
"""Cloths by name."""


def yarn_of_count(text: str, fibre: FibreMechanics, twist_multiplier: float, finish: str = "plain") -> Yarn:
    """A yarn from its count in the trade's words, of a fibre. Raises InputError on words that are no count."""
    count = parse_count(text)
    return Yarn(
        count_tex=count.tex,
        plies=count.plies,
        twist_per_m=turns_per_m(twist_multiplier, in_count(count.tex * count.plies, "Ne")),
        fibre_density=1e3 * fibre.density,
        fineness_dtex=count.fineness_dtex or 10.0 * fibre.fineness,
        loss=usual_loss(fibre, finish),
    )


def named_construction(name: str) -> Construction:
    """A cloth of the trade, or the construction of a preset, by its name. Raises InputError on one not known."""
    if name not in TRADE:
        raise InputError(f"construction: unknown cloth {name!r}; known: {', '.join(TRADE)}{did_you_mean(name, TRADE)}")
    cloth = TRADE[name]
    fibre = fibre_mechanics(cloth.fibre)
    form = parse_count(cloth.warp).form
    fibre = replace(fibre, form=form) if form else fibre
    return Construction(
        draft=named_weave(cloth.weave),
        warp=yarn_of_count(cloth.warp, fibre, cloth.twist_multiplier, cloth.finish),
        weft=yarn_of_count(cloth.weft, fibre, cloth.twist_multiplier, cloth.finish),
        warp_fibre=fibre,
        weft_fibre=fibre,
        ends_per_cm=cloth.ends_per_cm,
        picks_per_cm=cloth.picks_per_cm,
        flattening=cloth.flattening or FLATTENING[fibre.form],
        finish=cloth.finish,
    )


def trade_sections(name: str) -> dict[str, dict[str, object]]:
    """A cloth of the trade in the words of a scene: sections, each with the keys that make it. Raises InputError."""
    made = named_construction(name)
    cloth = TRADE[name]
    yarn: dict[str, object] = {"count": cloth.warp, "twist_multiplier": cloth.twist_multiplier}
    sections: dict[str, dict[str, object]] = {
        "fibre": {"kind": cloth.fibre},
        "yarn": yarn,
        "weave": {"draft": cloth.weave},
        "fabric": {
            "ends_per_cm": cloth.ends_per_cm,
            "picks_per_cm": cloth.picks_per_cm,
            "flattening": made.flattening,
            "balance": round(made.resting_balance, 3),
            "finish": cloth.finish,
        },
    }
    return sections if cloth.weft == cloth.warp else {**sections, "weft_yarn": {**yarn, "count": cloth.weft}}


PRESET_KEYS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "areal_density": ("density", 1e3),
        "bending_warp": ("bending_warp", 1e6),
        "bending_weft": ("bending_weft", 1e6),
        "shear": ("shear", 1.0),
        "tensile_warp": ("tensile_warp", 1.0),
        "tensile_weft": ("tensile_weft", 1.0),
        "drawn_warp": ("drawn_warp", 1.0),
        "drawn_weft": ("drawn_weft", 1.0),
        "strain_warp": ("crimp_warp", 1e2),
        "strain_weft": ("crimp_weft", 1e2),
    }
)
"""A quantity's key: the field of `Material`, and its unit in one of SI."""


WITHIN: Mapping[str, Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "couple": {"couple_warp": ("couple_warp", 2e3), "couple_weft": ("couple_weft", 2e3)},
        "torsion": {"torsion": ("torsion", 1e6)},
        "shear-hysteresis": {"shear_hysteresis": ("shear_friction", 2.0)},
        "locking": {"locking_angle": ("locking", 180.0 / pi)},
    }
)
"""What cloth has beside springs, by name: quantities, each as in PRESET_KEYS; of hysteresis the whole width of a loop,
where a `Material` has half of it."""


def within_material(properties: FabricProperties, names: Iterable[str]) -> dict[str, float]:
    """Fields of a `Material` that properties have of WITHIN, by its names."""
    return {field: properties[key].value / unit for name in names for key, (field, unit) in WITHIN[name].items()}


def woven_material(properties: FabricProperties) -> Material:
    """The sheet of properties, with all that it has of WITHIN."""
    found = {field: properties[key].value / unit for key, (field, unit) in PRESET_KEYS.items()}
    return Material(**found, **within_material(properties, WITHIN))


def with_material(properties: FabricProperties, material: Material, origin: str, how: str) -> FabricProperties:
    """Properties with those that a material has, from it."""
    changed: dict[str, Quantity] = {}
    for key, (field, unit) in PRESET_KEYS.items():
        value = unit * getattr(material, field)
        if value > 0 or not field.startswith(("drawn", "crimp")):  # 0: the law stays linear
            changed[key] = properties.stated[key].instead(value, origin, how)  # pyright: ignore[reportArgumentType]
    return properties.but(changed)


def preset_properties(name: str) -> FabricProperties:
    """A preset of `sheet.materials`: its own numbers, the others from its construction. Raises InputError."""
    properties = woven_properties(named_construction(name))
    return with_material(properties, MATERIALS[name], "preset", f"preset {name}") if name in MATERIALS else properties
