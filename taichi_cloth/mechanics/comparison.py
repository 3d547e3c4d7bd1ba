"""Cloths that were measured beside what their construction predicts.

Columns of a table (CSV): id, name, fibre ("cotton 100", "polyester 50 cotton 50"), weave ("plain", "twill 2/2", "satin
5", …), warp_tex, weft_tex, ends_per_cm, picks_per_cm, and what was measured: mass_gsm, thickness_mm, B_warp_uNm,
B_weft_uNm, B_mean_uNm, twoHB_mean_mN, G_N_per_m, DC_pct. An empty cell was not measured.
"""

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp, isfinite, log, pi
from pathlib import Path
from typing import Literal

from scipy.optimize import brentq

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_text
from taichi_cloth.mechanics.construction import FLATTENING, Construction, usual_loss
from taichi_cloth.mechanics.drape import drape_coefficient
from taichi_cloth.mechanics.fibre_mechanics import FIBRE_MECHANICS, FibreMechanics, blend
from taichi_cloth.mechanics.properties import light_thickness, woven_properties
from taichi_cloth.sheet.materials import Material
from taichi_cloth.weave.draft import Draft, named_weave
from taichi_cloth.yarn.count import parse_count
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["Compared", "compared", "error", "measured_material", "read_table", "row_construction"]

COLUMNS = ("id", "name", "fibre", "weave")
LARGEST_FILE = 1_000_000
USUAL_CRIMP = 1.06
"""Length of threads over that of the cloth, where a construction is looked for that nobody states."""

NAMED = {"cotton broad": ("Ne 40", 133 / 72), "wool tropical": ("2/60 Nm", 1.0)}
"""Cloths of one construction in the trade, by the names that tables give them: of which yarn both ways, and how many
ends to a pick. Both are plain, a poplin and a tropical."""

How = Literal["stated", "named", "inferred", "none"]


@dataclass(frozen=True)
class Compared:
    """A row. how: whether its construction is stated, is that of the trade's cloth of its name and of its mass, is that
    of a square cloth of its mass and thickness, or cannot be known. values: what was measured, by name, as (predicted
    or None, measured)."""

    number: str
    name: str
    how: How
    values: Mapping[str, tuple[float | None, float]]


def read_table(path: Path) -> list[dict[str, str]]:
    """The rows of a table. Raises InputError on a file that is none."""
    text = read_text(path, most=LARGEST_FILE, give="a .csv table of measured cloths")
    rows = list(csv.DictReader(io.StringIO(text)))
    missing = [key for key in COLUMNS if not rows or key not in rows[0]]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}; needed: {', '.join(COLUMNS)}")
    return rows


def compared(row: Mapping[str, str]) -> Compared:
    """One row: its measured values beside the predicted ones. Raises InputError on values that are no numbers."""
    made, how = row_construction(row)
    measured = {key: _number(row, column) for key, column in MEASURED.items()}
    pair = _number(row, "B_warp_uNm"), _number(row, "B_weft_uNm")
    if pair[0] is not None and pair[1] is not None:
        measured["bending"] = (pair[0] + pair[1]) / 2.0
    predicted = _predicted(made, measured["mass"]) if made is not None else {}
    if how in ("named", "inferred"):  # found from its mass
        del predicted["mass"]
    if how == "inferred":  # and from this
        del predicted["thickness"]
    found = {key: (predicted.get(key), value) for key, value in measured.items() if value is not None}
    return Compared(row["id"], row["name"], how, found)


MEASURED = {
    "mass": "mass_gsm",
    "thickness": "thickness_mm",
    "bending": "B_mean_uNm",
    "2HB": "twoHB_mean_mN",
    "shear": "G_N_per_m",
    "drape": "DC_pct",
}
"""Name of a value: its column."""


def measured_material(row: Mapping[str, str], woven: Material) -> Material | None:
    """The sheet of a row with what was measured of it in place of what is woven: mass, bending, its couple, shear. What
    was not goes with bending: the couple and torsion. None of a row whose bending was not measured. Raises InputError
    on values that are no numbers."""
    mean = _number(row, "B_mean_uNm")
    warp, weft = _number(row, "B_warp_uNm") or mean, _number(row, "B_weft_uNm") or mean
    if warp is None or weft is None:
        return None
    stiffer = 1e-6 * warp / woven.bending_warp, 1e-6 * weft / woven.bending_weft
    loop, mass = _number(row, "twoHB_mean_mN"), _number(row, "mass_gsm")
    couple = [
        own * more if loop is None else 0.5e-3 * loop
        for own, more in zip((woven.couple_warp, woven.couple_weft), stiffer, strict=True)
    ]
    return replace(
        woven,
        bending_warp=1e-6 * warp,
        bending_weft=1e-6 * weft,
        couple_warp=couple[0],
        couple_weft=couple[1],
        torsion=woven.torsion * (stiffer[0] + stiffer[1]) / 2.0,
        shear=_number(row, "G_N_per_m") or woven.shear,
        density=woven.density if mass is None else 1e-3 * mass,
    )


def error(predicted: float, measured: float) -> float:
    """Factor, 1 or more, by which one differs from the other."""
    return exp(abs(log(predicted / measured)))


def _number(row: Mapping[str, str], column: str) -> float | None:
    text = (row.get(column) or "").strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not (isfinite(value) and value > 0):
        raise InputError(f"{row.get('id', '?')}: {column}: {text!r}; allowed: a number above 0, or nothing")
    return value


def _fibre(text: str) -> FibreMechanics | None:
    """The known fibres of a composition by their shares; elastane is left out, it bends nothing."""
    words = text.lower().replace(";", " ").replace(",", " ").split()
    parts = []
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word in FIBRE_MECHANICS:
            share = float(following) if re.fullmatch(r"\d+(\.\d+)?", following) else 100.0
            parts.append((share, FIBRE_MECHANICS[word]))
    return blend(parts) if parts else None


def _draft(text: str) -> Draft | None:
    """A weave as tables write it. A cross twill has a 2/2 twill's changes of face; a rib's, which say how many threads
    lie side by side, count where two do."""
    words = text.lower().split("(")[0].replace(",", " ")
    ratio = re.search(r"\d+/\d+", words)
    if "plain" in words or "tabby" in words or "taffeta" in words:
        return named_weave("plain")
    if "rib" in words:
        return named_weave("basket-2/1" if "weft" in words else "basket-1/2")
    if "panama" in words or "basket" in words or "hopsack" in words:
        return named_weave("basket-2/2")
    if "satin" in words or "sateen" in words:
        ends = re.search(r"\b(5|7|8|10)\b", words)
        return named_weave(f"satin-{ends[0] if ends else 5}")
    if "twill" in words or "denim" in words:
        return named_weave(f"twill-{ratio[0]}" if ratio else "twill-2/2")
    return None


def row_construction(row: Mapping[str, str]) -> tuple[Construction | None, How]:
    """The construction of a row, and how it is known. Raises InputError on values that are no numbers."""
    fibre, draft = _fibre(row["fibre"]), _draft(row["weave"])
    counts = _number(row, "warp_tex"), _number(row, "weft_tex")
    sett = _number(row, "ends_per_cm"), _number(row, "picks_per_cm")
    if fibre is None:
        return None, "none"
    if draft is not None and None not in counts and None not in sett:
        return _made(draft, fibre, counts, sett), "stated"
    mass, thickness = _number(row, "mass_gsm"), _number(row, "thickness_mm")
    if mass is not None and row["name"] in NAMED:
        return _of_the_trade(row["name"], fibre, mass), "named"
    if mass is None or thickness is None:
        return None, "none"
    draft = draft or named_weave("plain")
    # Square, of one yarn: thickness is in proportion to the diameter, whatever the sett.
    probe = _made(draft, fibre, (20.0, 20.0), (10.0, 10.0))
    own = probe.families[0]
    diameter = thickness * own.diameter / light_thickness(probe)
    tex = pi / 4.0 * diameter**2 * fibre.density * probe.warp.packing * 1e3
    per_cm = 10.0 * mass / (2.0 * USUAL_CRIMP * tex)
    return _made(draft, fibre, (tex, tex), (per_cm, per_cm)), "inferred"


def _of_the_trade(name: str, fibre: FibreMechanics, mass: float) -> Construction:
    """The cloth of one of NAMED, as dense as its mass asks for [g/m²]."""
    count, ends_to_a_pick = NAMED[name]
    tex = parse_count(count)
    both = (tex.tex * tex.plies,) * 2

    def woven(picks: float) -> Construction:
        return _made(named_weave("plain"), fibre, both, (ends_to_a_pick * picks, picks))

    straight = 0.1 * both[0] * (1.0 + ends_to_a_pick)  # g/m² of a pick a cm
    most = mass / straight
    picks = brentq(lambda picks: woven(picks).areal_density - mass, 0.5 * most, 1.2 * most, xtol=1e-3)
    return woven(float(picks))  # pyright: ignore[reportArgumentType]


def _made(draft: Draft, fibre: FibreMechanics, tex: tuple, sett: tuple) -> Construction:
    warp, weft = (
        Yarn(
            count_tex=t,
            plies=1,
            fibre_density=1e3 * fibre.density,
            fineness_dtex=10 * fibre.fineness,
            loss=usual_loss(fibre),
        )
        for t in tex
    )
    return Construction(
        draft=draft,
        warp=warp,
        weft=weft,
        warp_fibre=fibre,
        weft_fibre=fibre,
        ends_per_cm=sett[0],
        picks_per_cm=sett[1],
        flattening=FLATTENING[fibre.form],
    )


def _predicted(made: Construction, mass: float | None) -> dict[str, float]:
    woven = woven_properties(made)
    bending = (woven["bending_warp"].value + woven["bending_weft"].value) / 2.0
    return {
        "mass": woven["areal_density"].value,
        "thickness": woven["thickness"].value,
        "bending": bending,
        "2HB": (woven["couple_warp"].value + woven["couple_weft"].value) / 2.0,
        "shear": woven["shear"].value,
        "drape": drape_coefficient(bending, mass or woven["areal_density"].value),
    }
