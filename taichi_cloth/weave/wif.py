"""Weaving drafts from WIF 1.1 files: threading, tie-up and treadling, or a liftplan, to a `Draft`.

A warp end lies over a pick when one of the shafts it is threaded on is lifted: by the pick's liftplan, or by the
tie-up of the pick's treadles. On a sinking shed the shafts named go down, and everything is the other way round.

The kept library dtx-to-wif interprets the draft. It trusts the file, so each number is checked here first, with its
line, and the library is given a clean text of those numbers alone. That also steps round its known faults: no
COLOR PALETTE, no COLOR TABLE, "%" in a title, a treadle without tie-up, units that are not converted.
"""

import io
import warnings
from os import PathLike, fspath

import numpy as np
from dtx_to_wif.pattern_data import PatternData
from dtx_to_wif.wif_reader import read_wif as library_read
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import srgb_to_linear
from taichi_cloth.weave.draft import MAX_CROSSINGS, Draft, interlacing_notes
from taichi_cloth.weave.wif_check import CheckedWif
from taichi_cloth.weave.wif_text import read_text, sections

__all__ = ["read_wif"]


def read_wif(path: str | PathLike[str]) -> Draft:
    """The draft of a WIF file, with its colours, spacings and thicknesses; pick 1 and end 1 come first.

    `Draft.notes` tells what was odd in the file and how it was taken, and which threads do not interlace.

    Raises InputError, one line with the file and the reason, whatever is wrong with the file.
    """
    name = fspath(path)
    text, notes = read_text(path)
    checked = CheckedWif(name, sections(name, text), text)
    checked.notes[:0] = notes
    pattern = _by_library(name, checked)
    up = _drawdown(name, pattern, checked)
    colour = {family: _colours(pattern, family, checked) for family in ("warp", "weft")}
    length = {
        (family, quantity): _lengths(pattern, family, quantity, checked)
        for family in ("warp", "weft")
        for quantity in ("spacing", "thickness")
    }
    return Draft(
        warp_up=up,
        warp_colour=colour["warp"],
        weft_colour=colour["weft"],
        warp_spacing_m=length["warp", "spacing"],
        weft_spacing_m=length["weft", "spacing"],
        warp_thickness_m=length["warp", "thickness"],
        weft_thickness_m=length["weft", "thickness"],
        name=checked.title,
        notes=(*checked.notes, *interlacing_notes(up)),
    )


def _by_library(name: str, checked: CheckedWif) -> PatternData:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            pattern = library_read(io.StringIO(checked.clean()), name)
        except Exception as error:  # whatever it still finds, a person gets one line
            raise InputError(f"{name}: {error}") from error
    checked.notes += [str(warning.message) for warning in caught]
    return pattern


def _drawdown(name: str, pattern: PatternData, checked: CheckedWif) -> NDArray[np.bool_]:
    """warp_up (picks, ends). Rows and columns that are alike are worked out once."""
    nothing: set[int] = set()
    ends = [pattern.threading.get(k + 1, nothing) for k in range(checked.threads["warp"])]
    if checked.liftplan:
        lifts = [pattern.liftplan.get(k + 1, nothing) for k in range(checked.threads["weft"])]
    else:
        treads = [pattern.treadling.get(k + 1, nothing) for k in range(checked.threads["weft"])]
        lifts = [nothing.union(*(pattern.tieup.get(treadle, nothing) for treadle in used)) for used in treads]
    end_kind, end_rows = _alike(ends)
    lift_kind, lift_rows = _alike(lifts)
    shafts = 1 + max(max(max(row, default=0) for row in rows) for rows in (end_rows, lift_rows))
    if (len(end_rows) + len(lift_rows)) * shafts > MAX_CROSSINGS:
        raise InputError(f"{name}: {len(end_rows)} different ends on {shafts - 1} shafts are too many to work out")
    up = _on_shafts(lift_rows, shafts) @ _on_shafts(end_rows, shafts).T > 0
    return (up == pattern.is_rising_shed)[lift_kind][:, end_kind]


def _alike(rows: list[set[int]]) -> tuple[NDArray[np.intp], list[frozenset[int]]]:
    """The kind of each row, and the kinds."""
    kinds: dict[frozenset[int], int] = {}
    index = [kinds.setdefault(frozenset(row), len(kinds)) for row in rows]
    return np.array(index, dtype=np.intp), list(kinds)


def _on_shafts(rows: list[frozenset[int]], shafts: int) -> NDArray[np.float32]:
    table = np.zeros((len(rows), shafts), dtype=np.float32)
    for k, row in enumerate(rows):
        table[k, list(row)] = 1
    return table


def _colours(pattern: PatternData, family: str, checked: CheckedWif) -> NDArray[np.float32] | None:
    if checked.colour[family] is None:
        return None
    low, high = checked.range
    table = np.array([pattern.color_table[k + 1] for k in range(len(pattern.color_table))], dtype=np.float64)
    own, default = getattr(pattern, f"{family}_colors"), getattr(pattern, family).color
    number = [own.get(k + 1, default) - 1 for k in range(checked.threads[family])]
    return srgb_to_linear((table[number] - low) / (high - low))


def _lengths(pattern: PatternData, family: str, quantity: str, checked: CheckedWif) -> NDArray[np.float64] | None:
    unit = checked.units[family]
    if checked.length[family, quantity] is None or unit is None:
        return None
    own, default = getattr(pattern, f"{family}_{quantity}"), getattr(getattr(pattern, family), quantity)
    return unit * np.array([own.get(k + 1, default) for k in range(checked.threads[family])], dtype=np.float64)
