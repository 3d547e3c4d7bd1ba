"""A pattern of a DXF and the TOML beside it, which says what a DXF does not: which edges meet, and where pieces go.

    seams = [["front.2", "back.4"], ["left_sleeve.2", ["back.5", "front.1"]]]

    [panels.front]
    piece = "FRONT"      # its name in the DXF; default: the panel's own
    part = "trunk"       # trunk, skirt, head, left arm, right arm, left leg, right leg
    side = "front"       # front, back; of skirts and hoods also left, right

Edges are numbered as `taichi-cloth pattern FILE.dxf` draws them, counter-clockwise from 1.
"""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.dxf_pieces import UNITS, CutPiece, read_pieces
from taichi_cloth.garment.pattern.outline import Outline, between
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.pattern.seam_sides import Span, matched, ordered
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.files import read_text, shown_path

__all__ = ["MEASURES", "PARTS", "SIDES", "beside", "read_dxf"]

F64 = NDArray[np.float64]

LARGEST_FILE = 1_000_000  # bytes
PARTS = {
    "trunk": "trunk",
    "skirt": "skirt",
    "head": "head",
    "left arm": "arm_l",
    "right arm": "arm_r",
    "left leg": "leg_l",
    "right leg": "leg_r",
}
SIDES = {
    "front": np.eye(3),
    "back": np.diag([-1.0, 1.0, -1.0]),
    "left": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "right": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
}
"""Rotations of a panel that is drawn upright, its right side towards the reader."""
UPS = {"+x": 0.0, "+y": 90.0, "-x": 180.0, "-y": 270.0}
"""Directions of the drawing, counter-clockwise from +x [degrees]."""
MEASURES = {"stature_cm": (50.0, 250.0), "bust_cm": (40.0, 250.0), "waist_cm": (30.0, 250.0), "hip_cm": (40.0, 250.0)}
"""Of the body that a pattern was drawn for, and what is allowed."""


def beside(path: Path | str) -> Path:
    """The TOML of a DXF."""
    return Path(path).with_suffix(".toml")


def read_dxf(path: Path | str) -> Pattern:
    """A pattern whose panels tell their part and side, and not yet where they stand. Raises InputError with the file
    and what is wrong with it."""
    file, words = Path(path), beside(path)
    if not words.exists() and file.exists():
        raise InputError(
            f"{shown_path(file)}: no {words.name} beside it, which says which edges meet and where pieces are worn; "
            f"taichi-cloth pattern {file.name} draws them and writes one to begin with"
        )
    said = _toml(words) if words.exists() else {}
    unit = said.get("unit")
    if unit is not None and not (isinstance(unit, str) and unit in UNITS):
        raise InputError(f"{shown_path(words)}: unit: {unit!r}; known: {', '.join(UNITS)}")
    pieces = read_pieces(file, unit)
    try:
        return _pattern(file.stem, pieces, said)
    except InputError as error:
        raise InputError(f"{shown_path(words)}: {error}") from None


def _toml(path: Path) -> dict[str, Any]:
    text = read_text(path, most=LARGEST_FILE, give="a TOML of seams and panels")
    try:
        said = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{shown_path(path)}: not TOML ({error}); give a TOML of seams and panels") from None
    return said


def _known(table: Any, keys: tuple[str, ...], where: str) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise InputError(f"{where}: {table!r}; allowed: a table of {', '.join(keys)}")
    for key in table:
        if key not in keys:
            raise InputError(f"{where}: unknown key {key!r}; known: {', '.join(keys)}{did_you_mean(key, keys)}")
    return table


def _word(table: dict[str, Any], key: str, known: Any, where: str, default: str | None = None) -> str:
    value = table.get(key, default)
    if not isinstance(value, str) or value not in known:
        wrong = "missing" if value is None else repr(value)
        raise InputError(f"{where}.{key}: {wrong}; known: {', '.join(known)}{did_you_mean(str(value), known)}")
    return value


def _pattern(name: str, pieces: list[CutPiece], said: dict[str, Any]) -> Pattern:
    _known(said, ("unit", "up", "size", "seams", "panels", "body"), "file")
    wanted = said.get("panels")
    if not isinstance(wanted, dict) or not wanted:
        raise InputError("panels: missing; allowed: a table for each, such as [panels.front]")
    pieces, notes = _of_size(pieces, said.get("size")), list[str]()
    up = _word(said, "up", UPS, "file", "+y")
    panels, outlines, numbers, used = [], {}, {}, set[str]()
    for key, table in wanted.items():
        where = f"panels.{key}"
        _known(table, ("piece", "part", "side", "half", "up", "mirrored", "hems"), where)
        piece = _find(pieces, table.get("piece", key), where)
        used.add(piece.name)
        turn = np.radians(90.0 - UPS[_word(table, "up", UPS, where, up)])
        mirrored = table.get("mirrored", False)
        if not isinstance(mirrored, bool):
            raise InputError(f"{where}.mirrored: {mirrored!r}; allowed: true, false")
        outline, numbers[key], grain = _upright(piece, float(turn), mirrored)
        outlines[key] = outline
        part = PARTS[_word(table, "part", PARTS, where)]
        side = _word(table, "side", SIDES, where, "front")
        half = _word(table, "half", ("whole", "left", "right"), where, "whole")
        place = Flat(SIDES[side], _half(outline, side, half))
        panels.append(Panel(key, (), place, grain, label=part))
    cut_lines = [piece.name for piece in pieces if piece.name in used and not piece.sewn]
    if cut_lines:
        notes.append(f"sewn along the cut line, as no sew line is drawn (layer 14): {', '.join(cut_lines)}")
    notes += [f"piece {one.name}: not used" for one in pieces if one.name not in used]
    seams, cuts, more = _seams(said.get("seams", []), outlines, numbers)
    finished, sides = _cut(panels, outlines, numbers, cuts, wanted)
    joined = tuple(Seam(sides[a], sides[b], alike=False) for a, b in seams)
    return Pattern(name, finished, joined, notes=(*notes, *more), drafted=_body(said.get("body", {})))


def _of_size(pieces: list[CutPiece], size: Any) -> list[CutPiece]:
    """One of each name. Raises InputError where there are several and no size is chosen."""
    known = list(dict.fromkeys(piece.size for piece in pieces))
    if size is not None:
        if str(size) not in known:
            raise InputError(f"size: {size!r}; known: {', '.join(known)}")
        pieces = [piece for piece in pieces if piece.size == str(size)]
    names = [piece.name for piece in pieces]
    for one in names:
        if names.count(one) > 1:
            raise InputError(f"size: missing, and {one} is there in several; known: {', '.join(known)}")
    return pieces


def _find(pieces: list[CutPiece], name: Any, where: str) -> CutPiece:
    for piece in pieces:
        if piece.name == name:
            return piece
    known = [piece.name for piece in pieces]
    raise InputError(
        f"{where}.piece: no {name!r} in the DXF; known: {', '.join(known)}{did_you_mean(str(name), known)}"
    )


def _upright(piece: CutPiece, turn: float, mirrored: bool) -> tuple[Outline, list[float], float]:
    """Its outline turned by an angle [rad], and mirrored then; where each edge of the drawing begins along it, by the
    number that the drawing has for it less one; its grain."""
    c, s = np.cos(turn), np.sin(turn)
    own, size = piece.outline, piece.outline.size
    loop = own.loop @ np.array([[c, s], [-s, c]])
    grain = 0.0 if piece.grain is None else piece.grain - turn
    starts = [a for a, _ in own.spans()]
    notches = list(own.notches)
    if mirrored:
        loop = np.concatenate([loop[:1], loop[:0:-1]]) * np.array([-1.0, 1.0])
        starts = [(size - b) % size for _, b in own.spans()]
        notches = [(size - n) % size for n in own.notches]
        grain = -grain
    grain = float((grain + np.pi / 2) % np.pi - np.pi / 2)
    return Outline(loop, tuple(sorted(starts)), tuple(sorted(notches))), starts, grain


def _half(outline: Outline, side: str, half: str) -> F64:
    """Where a panel stands across the body: its middle in the middle, or its inner end there [m]."""
    x = outline.loop @ SIDES[side][0, :2]
    z = outline.loop @ SIDES[side][2, :2]
    middle = {"whole": (x.min() + x.max()) / 2, "left": x.min(), "right": x.max()}[half]
    return np.array([-middle, 0.0, -(z.min() + z.max()) / 2])


def _seams(said: Any, outlines: dict[str, Outline], numbers: dict[str, list[float]]) -> Any:
    """Pairs of spans that are sewn together, all of them, and lines about notches."""
    if not isinstance(said, list):
        raise InputError(f"seams: {said!r}; allowed: a list of pairs of edges")
    seams, notes, used = [], [], dict[Span, int]()
    for k, pair in enumerate(said, 1):
        where = f"seams: number {k}"
        if not isinstance(pair, list) or len(pair) != 2:
            raise InputError(f'{where}: {pair!r}; allowed: two sides, such as ["front.2", "back.4"]')
        sides = [[_span(ref, outlines, numbers, where) for ref in (s if isinstance(s, list) else [s])] for s in pair]
        for span in (*sides[0], *sides[1]):
            if span in used:
                raise InputError(f"{where}: an edge of {span.panel} that number {used[span]} joins; allowed: one seam")
            used[span] = k
        try:
            if not sides[0] or not sides[1]:
                raise InputError("a side without edges; allowed: one or more")
            first = ordered(sides[0], outlines, along=True)
            second = ordered(sides[1], outlines, along=False)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        pairs, note = matched(first, second, outlines)
        seams += pairs
        notes += [note] if note else []
    return seams, [span for pair in seams for span in pair], notes


def _span(ref: Any, outlines: dict[str, Outline], numbers: dict[str, list[float]], where: str) -> Span:
    """ "front.2" as a part of an outline."""
    name, _, number = ref.rpartition(".") if isinstance(ref, str) else ("", "", "")
    if name not in outlines or not number.isdecimal() or len(number) > 6:
        raise InputError(f"{where}: {ref!r}; allowed: PANEL.EDGE, panels: {', '.join(outlines)}")
    starts = numbers[name]
    if not 1 <= int(number) <= len(starts):
        raise InputError(f"{where}: {ref!r}; {name} has edges 1 to {len(starts)}")
    start = starts[int(number) - 1]
    span = next((a, b) for a, b in outlines[name].spans() if abs(a - start) < 1e-9)
    return Span(name, *span)


def _cut(
    panels: list[Panel],
    outlines: dict[str, Outline],
    numbers: dict[str, list[float]],
    cuts: list[Span],
    wanted: dict[str, Any],
) -> tuple[tuple[Panel, ...], dict[Span, Side]]:
    """Panels with their edges cut where seams ask for it, and which edge each span is."""
    out, sides = [], {}
    for panel in panels:
        outline, name = outlines[panel.name], panel.name
        own = [span for span in cuts if span.panel == name]
        size = outline.size
        more = [span.start % size for span in own]
        corners = list(outline.corners)
        corners += [m for m in more if all(abs((m - c + size / 2) % size - size / 2) > 1e-6 for c in outline.corners)]
        finer = Outline(outline.loop, tuple(sorted(corners)), outline.notches)
        spans = finer.spans()
        for span in own:
            off = [abs((a - span.start + size / 2) % size - size / 2) for a, _ in spans]
            sides[span] = Side(name, int(np.argmin(off)))
        hems = wanted[name].get("hems", [])
        if not isinstance(hems, list) or not all(isinstance(h, int) and 1 <= h <= len(numbers[name]) for h in hems):
            raise InputError(f"panels.{name}.hems: {hems!r}; allowed: numbers of edges, 1 to {len(numbers[name])}")
        starts = [numbers[name][h - 1] for h in hems]
        turned = tuple(k for k, (a, _) in enumerate(spans) if any(abs(a - s) < 1e-6 for s in starts))
        out.append(replace(panel, edges=tuple(between(outline.loop, a, b) for a, b in spans), hems=turned))
    return tuple(out), sides


def _body(said: Any) -> dict[str, float]:
    """Measures of whom it was drawn for [m]; those that are not stated are the wearer's."""
    table = _known(said, tuple(MEASURES), "body")
    out = {}
    for key, value in table.items():
        low, high = MEASURES[key]
        if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
            raise InputError(f"body.{key}: {value!r}; allowed: {low:g} to {high:g}")
        out[key.removesuffix("_cm")] = 0.01 * value
    return out
