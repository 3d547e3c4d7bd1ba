"""Pieces of a sewing pattern in DXF, as CAD systems of the trade write them (ASTM D6673, and AAMA before it).

A block is a piece. Layers: 1 outline (cut), 2 turn points, 3 curve points, 4 and 80 to 83 notches, 6 mirror line,
7 grain, 14 sew line; texts such as "Piece Name: FRONT" say the rest. What is drawn is a layout: which edges meet and
where a piece is worn stands in a TOML beside it (`dxf_pattern.py`). Needs ezdxf: the extra `patterns`.
"""

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.outline import Outline, closed, unfolded
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes, shown_path

__all__ = ["UNITS", "CutPiece", "read_pieces"]

F64 = NDArray[np.float64]

LARGEST_FILE = 20_000_000  # bytes
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Metres in one."""
INSUNITS = {1: "in", 4: "mm", 5: "cm", 6: "m"}
"""Of a DXF's header."""
OUTLINE, TURN, MIRROR, GRAIN, SEW = "1", "2", "6", "7", "14"
NOTCHES = ("4", "80", "81", "82", "83")
FLATNESS = 1e-4
"""Of curves [m]."""
MOST_PIECES = 500


@dataclass(frozen=True, eq=False)
class CutPiece:
    """name, size: as the file has them, size "" where it says none. outline: [m], as drawn. grain: its direction from
    +y towards +x in the drawing [rad]; None: not drawn. sewn: whether the outline is a sew line; else it is the cut."""

    name: str
    size: str
    outline: Outline
    grain: float | None
    sewn: bool


def read_pieces(path: Path | str, unit: str | None = None) -> list[CutPiece]:
    """All pieces of a file. unit: of UNITS, where the file does not say its own or says a wrong one.

    Raises InputError with the file, the piece and what is wrong with it.
    """
    if unit is not None and unit not in UNITS:
        raise InputError(f"unit: {unit!r}; known: {', '.join(UNITS)}")
    file = Path(path)
    data = read_bytes(file, most=LARGEST_FILE, give="a pattern as DXF (ASTM/AAMA)")
    document = _document(file, data)
    try:
        scale = UNITS[unit or _unit(document)]
        blocks = list(_blocks(document))
        if len(blocks) > MOST_PIECES:
            raise InputError(f"{len(blocks)} pieces; allowed: up to {MOST_PIECES}")
        pieces = [piece for block in blocks if (piece := _piece(block, scale)) is not None]
        if not pieces:
            raise InputError("no block with a closed outline on layer 1 or 14; give a pattern as DXF (ASTM/AAMA)")
        return pieces
    except InputError as error:
        raise InputError(f"{shown_path(file)}: {error}") from None
    except Exception as error:
        # What a damaged file leads its entities to is theirs to choose.
        raise InputError(f"{shown_path(file)}: a damaged DXF ({type(error).__name__}: {error})") from None


def _document(file: Path, data: bytes) -> Any:
    try:
        from ezdxf import recover
    except ImportError:
        raise InputError(f'{shown_path(file)}: DXF needs ezdxf; pip install ".[patterns]"') from None
    logger = logging.getLogger("ezdxf")
    before, logger.level = logger.level, logging.CRITICAL
    try:
        return recover.read(BytesIO(data))[0]
    except Exception as error:
        raise InputError(
            f"{shown_path(file)}: no DXF, or a damaged one ({type(error).__name__}: {error}); give a pattern as DXF "
            "(ASTM/AAMA)"
        ) from None
    finally:
        logger.level = before


def _texts(entities: Any) -> dict[str, str]:
    """What "Key: value" texts say, keys in lower case without spaces."""
    found: dict[str, str] = {}
    for entity in entities:
        if entity.dxftype() in ("TEXT", "MTEXT", "ATTDEF", "ATTRIB"):
            text = entity.text if entity.dxftype() == "MTEXT" else entity.dxf.text
            said = re.match(r"\s*([A-Za-z ]+?)\s*[:=]\s*(.*?)\s*$", text)
            if said:
                found.setdefault(said[1].lower().replace(" ", ""), said[2])
    return found


def _unit(document: Any) -> str:
    """Of the file: its text, else its header, else millimetres, as ASTM has it."""
    said = _texts(document.modelspace()).get("units", "").lower()
    if said:
        known = {"metric": "mm", "english": "in", "imperial": "in", "inches": "in"} | {name: name for name in UNITS}
        if said not in known:
            raise InputError(f"units: {said!r}; known: METRIC, ENGLISH; state unit in the TOML beside it")
        return known[said]
    return INSUNITS.get(document.header.get("$INSUNITS", 0), "mm")


def _blocks(document: Any) -> Iterator[Any]:
    """Each piece's block once: those that the drawing shows, or all where it shows none."""
    shown = [insert.dxf.name for insert in document.modelspace().query("INSERT")]
    names = dict.fromkeys(shown) or [block.name for block in document.blocks if not block.name.startswith("*")]
    for name in names:
        if name in document.blocks:
            yield document.blocks[name]


def _piece(block: Any, scale: float) -> CutPiece | None:
    layers: dict[str, list[Any]] = {}
    for entity in block:
        layers.setdefault(entity.dxf.layer.strip(), []).append(entity)
    said = _texts(block)
    name = said.get("piecename") or block.name
    lines = {layer: [line for e in layers.get(layer, []) for line in _lines(e, scale)] for layer in (OUTLINE, SEW)}
    loops = {layer: loop for layer in (SEW, OUTLINE) if (loop := closed(lines[layer])) is not None}
    if not loops:
        return None
    layer = SEW if SEW in loops else OUTLINE
    loop = loops[layer]
    try:
        turns = [scale * _xy(e.dxf.location) for e in layers.get(TURN, []) if e.dxftype() == "POINT"]
        notches = [_notch(e, scale, loop) for kind in NOTCHES for e in layers.get(kind, [])]
        outline = Outline.of(loop, turns, [p for p in notches if p is not None])
        fold = [line for e in layers.get(MIRROR, []) for line in _lines(e, scale)]
        if fold:
            outline = unfolded(outline, fold[0][[0, -1]])
    except InputError as error:
        raise InputError(f"piece {name}: {error}") from None
    grain = [line for e in layers.get(GRAIN, []) for line in _lines(e, scale)]
    way = max((line[-1] - line[0] for line in grain), key=lambda d: float(np.linalg.norm(d)), default=None)
    turned = None if way is None or not np.linalg.norm(way) else float(np.arctan2(way[0], way[1]))
    return CutPiece(name, said.get("size", ""), outline, turned, layer == SEW)


def _xy(point: Any) -> F64:
    out = np.array([point[0], point[1]], np.float64)
    if not np.isfinite(out).all():
        raise InputError("coordinates that are not finite; allowed: finite numbers")
    return out


def _lines(entity: Any, scale: float) -> list[F64]:
    """Polylines (k, 2) of an entity [m]; none of one that is no line."""
    from ezdxf.path import make_path

    if entity.dxftype() not in ("LINE", "POLYLINE", "LWPOLYLINE", "ARC", "CIRCLE", "SPLINE", "ELLIPSE"):
        return []
    points = np.array([_xy(p) for p in make_path(entity).flattening(FLATNESS / scale)], np.float64).reshape(-1, 2)
    return [points * scale] if len(points) > 1 else []


def _notch(entity: Any, scale: float, loop: F64) -> F64 | None:
    """Where a notch stands: its point, or that end of its line that is nearer to the outline."""
    if entity.dxftype() == "POINT":
        return scale * _xy(entity.dxf.location)
    lines = _lines(entity, scale)
    if not lines:
        return None
    ends = lines[0][[0, -1]]
    return ends[int(np.linalg.norm(ends[:, None] - loop[None], axis=2).min(axis=1).argmin())]
