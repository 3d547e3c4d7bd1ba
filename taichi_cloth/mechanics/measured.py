"""Measured properties from a TOML file that names the method of each, in the instrument's own units.

    source = "our laboratory, cloth 17"

    [kes]                           # Kawabata's KES-F
    bending_warp = 0.09             # B [gf·cm²/cm]
    bending_hysteresis_warp = 0.08  # 2HB [gf·cm/cm]
    shear = 1.2                     # G [gf/(cm·deg)]

    [cantilever]                    # Peirce's, ISO 9073-7, ASTM D1388
    bending_length_weft = 18        # c [mm]; needs the mass, measured or woven

Methods do not measure the same thing: a strip that hangs from an edge overcomes the friction that KES tells apart, so
that its bending is up to twice KES's. A property is taken from one method alone, which is said with it.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.files import read_text, shown_path
from taichi_cloth.mechanics.drape import GRAVITY
from taichi_cloth.mechanics.properties import FabricProperties
from taichi_cloth.mechanics.quantity import Quantity

__all__ = ["METHODS", "Measured", "measured_properties", "read_measured"]

GF_CM2_PER_CM = 98.07  # µN·m of B
GF_CM_PER_CM = 9.807  # mN of 2HB
GF_PER_CM_DEG = 56.2  # N/m of G
GF_PER_CM = 0.9807  # N/m of 2HG
LARGEST_FILE = 100_000

_BOTH = ("warp", "weft")


def _pairs(key: str, target: str, unit: float) -> dict[str, tuple[str, float]]:
    return {f"{key}_{family}": (f"{target}_{family}", unit) for family in _BOTH}


METHODS: Mapping[str, Mapping[str, tuple[str, float]]] = {
    "kes": {
        **_pairs("bending", "bending", GF_CM2_PER_CM),
        **_pairs("bending_hysteresis", "couple", GF_CM_PER_CM),
        "shear": ("shear", GF_PER_CM_DEG),
        "shear_hysteresis": ("shear_hysteresis", GF_PER_CM),
        "weight": ("areal_density", 10.0),  # mg/cm²
        "thickness": ("thickness", 1.0),  # mm at 0.5 gf/cm²
        "friction": ("friction", 1.0),
    },
    "fast": {
        **_pairs("bending", "bending", 1.0),  # µN·m
        **_pairs("bending_length", "bending_length", 1.0),  # mm
        "shear": ("shear", 1.0),  # N/m
        "weight": ("areal_density", 1.0),  # g/m²
        "thickness": ("thickness", 1.0),  # mm at 0.2 kPa
    },
    "cantilever": {
        **_pairs("bending_length", "bending_length", 1.0),  # mm, half the overhang at 41.5°
        **_pairs("bending", "bending", 1.0),  # µN·m
        "weight": ("areal_density", 1.0),
    },
    "tensile": {
        **_pairs("initial", "tensile", 1.0),  # N/m
        **_pairs("drawn", "drawn", 1.0),  # N/m
        **_pairs("crimp_strain", "strain", 1.0),  # %
    },
    "other": {
        "weight": ("areal_density", 1.0),
        "thickness": ("thickness", 1.0),
        **_pairs("crimp", "crimp", 1.0),  # %
        "locking_angle": ("locking_angle", 1.0),  # °
        "torsion": ("torsion", 1.0),  # µN·m
        "friction": ("friction", 1.0),
        **_pairs("poisson", "poisson", 1.0),
    },
}
"""Method: its keys, each with the quantity that it measures, and that quantity's unit in one of the instrument's."""

_TITLES = {"kes": "KES-F", "fast": "FAST", "cantilever": "cantilever", "tensile": "tensile test", "other": "measured"}


@dataclass(frozen=True)
class Measured:
    """What a file says. values: quantity to its value in the unit of `properties.BANDS` and the method; bending lengths
    stand under bending_length_warp and _weft. source: in its words."""

    values: Mapping[str, tuple[float, str]]
    source: str = ""


def read_measured(path: Path) -> Measured:
    """Reads a file of measured properties. Raises InputError: which file, key and value, and what is allowed."""
    text = read_text(path, most=LARGEST_FILE, give="a .toml file of measured properties")
    where = shown_path(str(path))
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not TOML: {error}") from None
    try:
        return measured_of(data)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def measured_of(data: Mapping[str, Any]) -> Measured:
    """What nested dictionaries say, as TOML reads them. Raises InputError."""
    values: dict[str, tuple[float, str]] = {}
    source = data.get("source", "")
    if not isinstance(source, str):
        raise InputError(f"source: {source!r}; allowed: text")
    for method, rows in data.items():
        if method == "source":
            continue
        if method not in METHODS:
            known = ", ".join(f"[{name}]" for name in METHODS)
            raise InputError(f"{method}: unknown method; known: source, {known}{did_you_mean(method, METHODS)}")
        if not isinstance(rows, dict):
            raise InputError(f"{method}: {rows!r}; allowed: a section, with {', '.join(METHODS[method])}")
        for key, value in rows.items():
            name, number = _number(method, key, value)
            also = values.get(name) or values.get(_rival(name))
            if also is not None:
                raise InputError(
                    f"{method}.{key}: {name.replace('_', ' ')} is measured by {also[1]} too; leave one of them out"
                )
            values[name] = number, _TITLES[method]
    if not values:
        raise InputError(f"nothing measured; give a method, {', '.join(f'[{name}]' for name in METHODS)}")
    return Measured(values, source)


def _rival(name: str) -> str:
    """Bending and bending length of one family say the same."""
    if name.startswith("bending_length_"):
        return name.replace("bending_length_", "bending_")
    return name.replace("bending_", "bending_length_") if name.startswith("bending_") else ""


def _number(method: str, key: str, value: Any) -> tuple[str, float]:
    """The quantity that a key measures, and its value in our unit."""
    keys = METHODS[method]
    if key not in keys:
        raise InputError(f"{method}.{key}: unknown key; known: {', '.join(keys)}{did_you_mean(key, keys)}")
    name, unit = keys[key]
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)
    if not number or value < 0 or (value == 0 and name.startswith(("areal", "thickness", "tensile", "bending_length"))):
        raise InputError(f"{method}.{key}: {value!r}; allowed: a number above 0")
    return name, unit * float(value)


def measured_properties(properties: FabricProperties, measured: Measured) -> FabricProperties:
    """The properties with those that were measured. A bending length c becomes B = w·c³, with the mass that holds."""
    from_ = f", {measured.source}" if measured.source else ""
    changed: dict[str, Quantity] = {}
    for name, (value, method) in measured.values.items():
        if not name.startswith("bending_length_"):
            changed[name] = properties.stated[name].instead(value, "measured", f"{method}{from_}")
    density = (changed.get("areal_density") or properties.stated["areal_density"]).value
    for name, (value, method) in measured.values.items():
        if name.startswith("bending_length_"):
            key = name.replace("bending_length_", "bending_")
            bending = 1e-3 * density * GRAVITY * (1e-3 * value) ** 3 * 1e6
            how = f"{method}, bending length {value:g} mm{from_}"
            changed[key] = properties.stated[key].instead(bending, "measured", how)
    return properties.but(changed)
