"""Sewing patterns in the JSON form of GarmentCode (Korosteleva & Sorkine-Hornung 2023) and of the
Garment-Pattern-Generator before it: panels with straight, Bézier and circular edges, stitches, units."""

from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import arc, bezier, from_relative
from taichi_cloth.garment.pattern.loops import without_loops
from taichi_cloth.garment.pattern.pattern import LARGEST_PANEL, Flat, Panel, Pattern, Seam, Side
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_json

__all__ = ["read_garmentcode"]

F64 = NDArray[np.float64]
LARGEST_FILE = 5_000_000  # bytes
MOST_RELATIVE = 100.0
"""Of a control point, in lengths of its edge."""
LARGEST_RADIUS = 1e5
"""Of a circular edge [m]: a metre of it is straight to a micrometre."""


def read_garmentcode(path: Path | str) -> Pattern:
    """A pattern from a file, in metres. Raises InputError with the file, the panel and what is wrong with it."""
    file = Path(path)
    document = read_json(file, most=LARGEST_FILE, give="GarmentCode's specification in JSON")
    try:
        return _pattern(file.stem, document)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _get(owner: Any, key: str, kind: type | tuple[type, ...], where: str, default: Any = None) -> Any:
    value = owner.get(key, default) if isinstance(owner, dict) else None
    if value is None or not isinstance(value, kind) or (isinstance(value, bool) and kind in (int, float)):
        wanted = kind.__name__ if isinstance(kind, type) else " or ".join(k.__name__ for k in kind)
        raise InputError(f"{where}.{key}: {'missing' if value is None else repr(value)[:60]}; allowed: a {wanted}")
    return value


def _numbers(value: Any, count: int, where: str, most: float = np.inf) -> F64:
    good = isinstance(value, list) and len(value) == count
    if not good or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
        raise InputError(f"{where}: {str(value)[:60]}; allowed: {count} numbers")
    out = np.asarray(value, np.float64)
    if not np.isfinite(out).all() or np.abs(out).max() > most:
        limit = "finite numbers" if np.isinf(most) else f"numbers up to {most:g}"
        raise InputError(f"{where}: {str(value)[:60]}; allowed: {limit}")
    return out


def _metres(value: Any, count: int, units: float, where: str) -> F64:
    """Lengths [m]. A pattern in another unit than it states is refused before anything is made of it."""
    return _numbers(value, count, where, most=LARGEST_PANEL * units) / units


def _pattern(name: str, document: Any) -> Pattern:
    body = _get(document, "pattern", dict, "file")
    properties = document.get("properties", {})
    units = _get(properties, "units_in_meter", (int, float), "properties", 100)
    if not 0 < units < 1e6:
        raise InputError(f"properties.units_in_meter: {units}; allowed: above 0, such as 100 for centimetres")
    notation = properties.get("curvature_coords", "relative")
    if notation not in ("relative", "absolute"):
        raise InputError(f"properties.curvature_coords: {notation!r}; allowed: relative, absolute")
    named = _get(body, "panels", dict, "pattern")
    panels, notes = [], []
    for key in named:  # `panel_order` says how a picture lists them, and is not always whole
        panel = _panel(key, named[key], float(units), notation == "relative")
        panel, cut_off = without_loops(panel)
        panels.append(panel)
        notes += cut_off
    stitches = body.get("stitches", [])
    if not isinstance(stitches, list):
        raise InputError("pattern.stitches: allowed: a list")
    return Pattern(name, tuple(panels), tuple(_seam(k, s) for k, s in enumerate(stitches)), notes=tuple(notes))


def _panel(name: str, panel: Any, units: float, relative: bool) -> Panel:
    where = f"panels.{name}"
    rows = _get(panel, "vertices", list, where)
    vertices = [_metres(v, 2, units, f"{where}.vertices") for v in rows]
    edges, marks = [], []
    for k, edge in enumerate(_get(panel, "edges", list, where)):
        at = f"{where}.edges[{k}]"
        ends = _get(edge, "endpoints", list, at)
        if len(ends) != 2 or not all(isinstance(e, int) and 0 <= e < len(vertices) for e in ends):
            raise InputError(f"{at}.endpoints: {ends}; allowed: two numbers of vertices, 0 to {len(vertices) - 1}")
        edges.append(_curve(vertices[ends[0]], vertices[ends[1]], edge.get("curvature"), units, relative, at))
        if isinstance(edge.get("label"), str) and edge["label"]:
            marks.append((k, edge["label"]))
    shift = _metres(panel.get("translation", [0, 0, 0]), 3, units, f"{where}.translation")
    turn = _numbers(panel.get("rotation", [0, 0, 0]), 3, f"{where}.rotation")
    label = panel.get("label") or ""
    return Panel(name, tuple(edges), Flat(_rotation(turn), shift), label=str(label), marks=tuple(marks))


def _curve(start: F64, end: F64, bend: Any, units: float, relative: bool, where: str) -> F64:
    """Polyline (k, 2) [m] of an edge in any of the notations."""
    if bend is None:
        return np.stack([start, end])

    def control(point: Any) -> F64:
        if relative:
            return from_relative(start, end, _numbers(point, 2, f"{where}.curvature", most=MOST_RELATIVE))
        return _metres(point, 2, units, f"{where}.curvature")

    if isinstance(bend, list):
        return bezier(np.stack([start, control(bend), end]))
    kind = _get(bend, "type", str, f"{where}.curvature")
    values = _get(bend, "params", list, f"{where}.curvature")
    count = {"quadratic": 1, "cubic": 2, "circle": 3}.get(kind)
    if count is None:
        raise InputError(f"{where}.curvature.type: {kind!r}; allowed: quadratic, cubic, circle")
    if len(values) != count:
        raise InputError(f"{where}.curvature.params: {len(values)} of them; a {kind} curve has {count}")
    if kind == "circle":
        radius = float(_numbers(values[:1], 1, f"{where}.curvature", most=LARGEST_RADIUS * units)[0]) / units
        return arc(start, end, radius, large=bool(values[1]), right=bool(values[2]))
    return bezier(np.stack([start, *(control(v) for v in values), end]))


def _rotation(degrees: F64) -> F64:
    """R = Rz · Ry · Rx."""
    (cx, sx), (cy, sy), (cz, sz) = ((np.cos(a), np.sin(a)) for a in map(radians, degrees))
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return z @ y @ x


def _seam(number: int, stitch: Any) -> Seam:
    """Loops of both panels run the same way round, so a seam's ends meet crosswise; "right_wrong" ones meet alike."""
    where = f"stitches[{number}]"
    if not isinstance(stitch, list) or not 2 <= len(stitch) <= 3 or (len(stitch) == 3 and stitch[2] != "right_wrong"):
        raise InputError(f'{where}: allowed: two sides {{"panel", "edge"}}, and perhaps "right_wrong"')
    sides = [Side(_get(s, "panel", str, where), _get(s, "edge", int, where)) for s in stitch[:2]]
    return Seam(sides[0], sides[1], alike=len(stitch) == 3)
