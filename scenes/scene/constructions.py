"""What a draft file, a sett and a material bring to a scene's data, and what the scene says that gives way to them."""

import os
from collections.abc import Mapping
from typing import Any

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.mechanics.presets import TRADE, trade_sections

from .draft_file import draft_file
from .schema import WOVEN
from .section import DRAFT_FILE

__all__ = ["give_way", "is_stated", "with_construction", "woven_where_changed"]

Data = dict[str, Any]

WIF_BRINGS = {
    "weave": ("ends", "picks"),
    "fabric": ("ends_per_cm", "picks_per_cm", "balance"),
    "yarn": ("count_tex", "count_ne", "count"),
    "weft_yarn": ("count_tex", "count_ne", "count"),
}
SAME = (("count_tex", "count_ne", "count"), ("twist_per_m", "twist_multiplier"))
"""Keys of a yarn that say one thing."""

_SPUN = (*SAME[0], *SAME[1], "plies", "singles_twist_per_m", "packing")
MAKES = {
    "fibre": ("kind", "blend", "fineness_dtex", "modulus_n_per_tex", "flexural_mn_mm2_per_tex2", "friction"),
    "yarn": _SPUN,
    "weft_yarn": _SPUN,
    "weave": ("draft",),
    "fabric": ("ends_per_cm", "picks_per_cm", "flattening", "balance", "finish"),
}
"""What makes a cloth: another value is another cloth. All else of these sections is how it looks."""


def give_way(data: Data, given: Mapping[str, str]) -> bool:
    """Forget of a scene's data what overrides, by name, say in other words. What they say comes after, and then, where
    this returns True, `woven_where_changed`. Raises InputError as `load_scene` does."""
    material, draft = _material(given), _text(given, "weave.draft")
    taken_up = material is not None and _has_sett(data)
    if material is not None and taken_up:
        _take_up(data, material)
    if DRAFT_FILE.fits(draft):
        kept = _kept_beside(data, draft)
        for section, keys in WIF_BRINGS.items():
            if section not in kept:
                _drop(data, section, keys)
        _drop(data, "weave", _coloured(draft))
    for section in ("yarn", "weft_yarn"):  # a count given in one unit replaces the scene's in the other
        for keys in SAME:
            if any(f"{section}.{key}" in given for key in keys):
                _drop(data, section, keys)
        if f"{section}.count" in given:
            _drop(data, section, ("plies",))  # it says them
    if not taken_up and all(f"fabric.{key}" in given for key in ("ends_per_cm", "picks_per_cm")):
        _forget_material(data)
    return taken_up


def is_stated(given: Mapping[str, str], name: str) -> bool:
    """Whether an override states a key, by itself or with the table it is in."""
    return any(f"{name}.".startswith(f"{other}.") for other in given)


def with_construction(data: Data) -> Data:
    """The data of a cloth or garment whose fibres are drawn, or that has a [weave], and that names a material known to
    the trade and no [yarn]: what it does not say of fibre, yarn, weave and sett is that material's, and where it says
    otherwise it is `woven_where_changed`. Raises InputError for an unknown material."""
    for section in ("cloth", "garment"):
        said = data.get(section)
        if not isinstance(said, dict) or "yarn" in data:
            continue
        if said.get("representation", "fibre") != "fibre" and "weave" not in data:  # whose colours a mesh has
            continue
        material = said.get("material")
        if not isinstance(material, str) or material == WOVEN:
            continue
        if material not in TRADE:
            known = (WOVEN, *TRADE)
            shown = material if len(material) < 60 else f"{material[:57]}…"
            hint = did_you_mean(material[:100], known)
            raise InputError(f"{section}.material: {shown!r}; known: {', '.join(known)}{hint}")
        brought = trade_sections(material)
        own = {key: data.get(key, {}) for key in brought}
        if all(isinstance(value, dict) for value in own.values()):
            return woven_where_changed({**data, **{key: {**brought[key], **own[key]} for key in brought}})
    return data


def woven_where_changed(data: Data) -> Data:
    """The data of a cloth or garment that has the construction of its material, but for what was said of it: where that
    makes another cloth it moves by what it is woven of, as it is drawn, and no longer by the material's numbers."""
    for section in ("cloth", "garment"):
        said = data.get(section)
        material = said.get("material") if isinstance(said, dict) else None
        if not isinstance(material, str) or material not in TRADE:
            continue
        whole = trade_sections(material)
        for name, keys in MAKES.items():
            own, brought = data.get(name, {}), whole.get(name, {})
            if isinstance(own, dict) and any(own.get(key) != brought.get(key) for key in keys):
                return {**data, section: {**data[section], "material": WOVEN}}
    return data


def _material(given: Mapping[str, str]) -> str | None:
    """The material known to the trade that an override names."""
    named = (_text(given, f"{section}.material") for section in ("cloth", "garment"))
    return next((name for name in named if name in TRADE), None)


def _text(given: Mapping[str, str], key: str) -> str:
    """The text that an override gives, without quotes; empty where none does."""
    return given.get(key, "").strip("\"'")


def _has_sett(data: Mapping[str, Any]) -> bool:
    return isinstance(data.get("fabric"), dict) and "ends_per_cm" in data["fabric"]


def _take_up(data: Data, material: str) -> None:
    """A cloth or garment with a sett is of this material: what the scene says of another's fibre, yarns, weave and sett
    goes, but for colours."""
    _forget_material(data)
    for section in ("yarn", "weft_yarn"):
        data.pop(section, None)
    for section, keys in MAKES.items():
        _drop(data, section, keys)
    for section, keys in trade_sections(material).items():
        if isinstance(data.setdefault(section, {}), dict):
            data[section] = {**data[section], **keys}


def _forget_material(data: Data) -> None:
    """A cloth or garment whose sett is overridden is another cloth: what the scene says of its own material, and of how
    its threads lie, goes; which of a fabric's frictions move with it, and what damps it, stays."""
    if any(isinstance(data.get(section), dict) for section in ("cloth", "garment")):
        _drop(data, "fabric", ("flattening", "balance", "finish"))
    for section in ("cloth", "garment"):
        _drop(data, section, ("material", "measured"))
        if isinstance(data.get(section), dict) and isinstance(data[section].get("properties"), dict):
            said = data[section]["properties"].items()
            kept = {key: value for key, value in said if key == "within" or "damping" in key}
            data[section] = data[section] | {"properties": kept}


def _kept_beside(data: Mapping[str, Any], path: str) -> tuple[str, ...]:
    """The sections whose sett and counts a cloth or garment with a sett keeps beside the draft of this WIF file: what
    the file does not state. Of a file that cannot be read, which is said where all names are looked up, none."""
    if not _has_sett(data) or not ("cloth" in data or "garment" in data) or not os.path.isfile(path):
        return ()
    draft = draft_file(path)
    if draft.warp_spacing_m is not None or draft.weft_spacing_m is not None:
        return ()
    thick = draft.warp_thickness_m is not None or draft.weft_thickness_m is not None
    return ("fabric",) if thick else ("fabric", "yarn", "weft_yarn")


def _coloured(path: str) -> tuple[str, ...]:
    """The thread orders that a WIF file has itself; both of a file that is not there, which is said where it is asked
    for. Raises InputError on what is no such file."""
    if not os.path.isfile(path):
        return "warp_colours", "weft_colours"
    draft = draft_file(path)
    own = {"warp_colours": draft.warp_colour, "weft_colours": draft.weft_colour}
    return tuple(key for key, order in own.items() if order is not None)


def _drop(data: Data, section: str, keys: tuple[str, ...]) -> None:
    """Forget keys of a section; one that is no table is left for the schema to refuse."""
    if isinstance(data.get(section), dict):
        for key in keys:
            data[section].pop(key, None)
