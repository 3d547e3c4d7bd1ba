"""An outfit in a scene's data: `[[garment]]`, in the order worn, each with its own fibre, yarns, weave and fabric.

Each is taken apart to the data of a scene of that garment alone, so that what holds for one garment holds for each of
several: what gives way to overrides, what a material brings, where files lie.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from taichi_cloth.ground.errors import InputError, did_you_mean

from .schema import OWN, WornSection

__all__ = ["apart", "is_outfit", "name_of", "overrides_of", "together", "worn_over"]

Data = dict[str, Any]


def is_outfit(data: Mapping[str, Any]) -> bool:
    return isinstance(data.get("garment"), list)


def apart(said: Any, number: int, where: str) -> Data:
    """The data of a scene of one [[garment]] alone. number: which it is. Raises InputError on what is no table."""
    if not isinstance(said, dict):
        raise InputError(f"{where}: garment {number + 1}: {str(said)[:60]!r}; allowed: a table of keys")
    own = {key: value for key, value in said.items() if key in OWN}
    return {**own, "garment": {key: value for key, value in said.items() if key not in OWN and key != "scene"}}


def together(alone: Mapping[str, Any]) -> Data:
    """And back."""
    return {**{key: value for key, value in alone.items() if key in OWN}, **alone["garment"]}


def worn_over(scene: Mapping[str, Any], own: Data, source: str | None) -> Data:
    """The data of a garment that another scene tells of, but for what is its own."""
    out: Data = {}
    for key in (*OWN, "garment"):
        below, above = scene.get(key), own.get(key)
        if isinstance(below, dict) and isinstance(above, dict):
            out[key] = {**below, **above}
        elif above is not None or below is not None:
            out[key] = below if above is None else above
    if source is not None:
        out["garment"].setdefault("name", Path(source).stem)
    return out


def name_of(alone: Mapping[str, Any]) -> str:
    section = alone["garment"]
    return str(section.get("name") or Path(str(section.get("pattern", WornSection().pattern))).stem)


def overrides_of(overrides: Sequence[str], name: str, names: Sequence[str]) -> list[str]:
    """Of `key=value` overrides of an outfit those of one garment, as of a scene of it alone: `garment.KEY` is of all
    garments, `garment.NAME.KEY` of one. Raises InputError on a name of none."""
    out = []
    for text in overrides:
        key, sign, value = text.partition("=")
        parts = key.strip().split(".")
        if parts[0] in OWN:
            raise InputError(
                f"--set {text[:100]}: each garment of an outfit has its own; say garment.{key.strip()} for all, or "
                f"garment.{names[0]}.{key.strip()}"
            )
        if parts[0] != "garment" or len(parts) < 2:
            continue
        if parts[1] in names:
            if parts[1] != name:
                continue
            parts = ["garment", *parts[2:]]
        elif parts[1] not in WornSection.model_fields:
            known = (*names, *WornSection.model_fields)
            raise InputError(
                f"--set {text[:100]}: {parts[1]!r} is neither a garment nor a key of one; garments: {', '.join(names)}"
                f"{did_you_mean(parts[1][:100], known)}"
            )
        if len(parts) < 2:
            raise InputError(f"--set {text[:100]}: expected garment.{name}.KEY=VALUE")
        own = parts[1:] if parts[1] in OWN else parts
        out.append(f"{'.'.join(own)}{sign}{value}")
    return out
