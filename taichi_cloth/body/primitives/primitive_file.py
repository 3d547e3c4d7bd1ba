"""Primitives in a file: JSON, metres, with the number of the format."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_json

__all__ = ["FORMAT", "VERSION", "load_primitives", "primitives_json"]

FORMAT = "taichi-cloth body"
VERSION = 1
LARGEST_FILE = 5_000_000
"""Bytes; a primitive takes about 300."""
REFIT = "make it again with: taichi-cloth body fit"


def primitives_json(primitives: Sequence[Primitive], about: Mapping[str, Any] | None = None) -> bytes:
    """The file's bytes. about: what else it is to hold, such as the report; `load_primitives` does not read it."""
    rows = []
    for p in primitives:
        row: dict[str, Any] = {
            "kind": p.kind,
            "part": p.part,
            "bone": p.bone,
            "start": p.start.tolist(),
            "end": p.end.tolist(),
            "radii": list(p.radii),
        }
        if p.across is not None:
            row |= {"across": p.across.tolist(), "rounding": p.rounding}
        rows.append(row)
    whole = {"format": FORMAT, "version": VERSION, "unit": "m", **(about or {}), "primitives": rows}
    return json.dumps(whole, indent=1).encode() + b"\n"


def load_primitives(path: str | Path) -> list[Primitive]:
    """The primitives of a file. Raises InputError, in one line, for what is none, is of another version or broken."""
    data = read_json(path, most=LARGEST_FILE, give=f"a file of primitives, or {REFIT}")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InputError(f"{path}: format is not {FORMAT!r}; {REFIT}")
    if data.get("version") != VERSION:
        raise InputError(f"{path}: version {data.get('version')!r}; this program reads {VERSION}; {REFIT}")
    rows = data.get("primitives")
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{path}: primitives: none; {REFIT}")
    return [_primitive(path, number, row) for number, row in enumerate(rows)]


def _primitive(path: str | Path, number: int, row: Any) -> Primitive:
    try:
        across = row.get("across")
        bone = row["bone"]
        if not isinstance(bone, int) or bone < 0 or not isinstance(row["part"], str):
            raise ValueError("bone or part")
        return Primitive(
            kind=row["kind"],
            start=np.array(row["start"], np.float64),
            end=np.array(row["end"], np.float64),
            radii=(float(row["radii"][0]), float(row["radii"][1])),
            across=None if across is None else np.array(across, np.float64),
            rounding=float(row.get("rounding", 0.0)),
            part=row["part"],
            bone=bone,
        )
    except InputError as error:
        raise InputError(f"{path}: primitive {number}: {error}") from None
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        raise InputError(f"{path}: primitive {number}: not readable ({error}); {REFIT}") from None
