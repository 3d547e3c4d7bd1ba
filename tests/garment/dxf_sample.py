"""Writes the DXF of tests/data/patterns: our own T-shirt as a CAD system of the trade would. `python -m dxf_sample`.

The front is drawn as a half up to its mirror line, the sleeve once; both have notches. Grain runs along x, as in most
files of the trade.
"""

from pathlib import Path

import numpy as np
from ezdxf.filemanagement import new

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.drafts import draft
from taichi_cloth.garment.pattern.measure import figure_of
from taichi_cloth.garment.pattern.pattern import Pattern
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body

F64 = np.ndarray
FOLDER = Path(__file__).parents[1] / "data" / "patterns"
AT_HOLE = {"front": (0.09,), "back": (0.08, 0.09)}
"""Of notches along an armhole from under the arm [m]."""


def laid(points: F64) -> F64:
    """Up turned to +x, in millimetres."""
    return 1e3 * np.stack([points[:, 1], -points[:, 0]], -1)


def add_piece(document, name: str, edges: list[F64], *, notches=(), fold=None, at=(0, 0), size="M", sew=None) -> None:
    """A block and what shows it. edges: closed, upright [m]. sew: an inner outline on layer 14."""
    block = document.blocks.new(name=f"{name}-{size}")
    outline = np.concatenate([edge[:-1] for edge in edges])
    block.add_polyline2d([tuple(p) for p in laid(outline)], close=True, dxfattribs={"layer": "1"})
    for edge in edges:
        block.add_point(tuple(laid(edge[:1])[0]), dxfattribs={"layer": "2"})
    for point in notches:
        block.add_point(tuple(laid(point[None])[0]), dxfattribs={"layer": "4"})
    if fold is not None:
        a, b = laid(np.asarray(fold))
        block.add_line(tuple(a), tuple(b), dxfattribs={"layer": "6"})
    if sew is not None:
        block.add_polyline2d([tuple(p) for p in laid(sew)], close=True, dxfattribs={"layer": "14"})
    middle = laid(outline).mean(axis=0)
    reach = np.array([80.0, 0.0])
    block.add_line(tuple(middle - reach), tuple(middle + reach), dxfattribs={"layer": "7"})
    for k, text in enumerate((f"Piece Name: {name}", f"Size: {size}", "Quantity: 1")):
        block.add_text(text, dxfattribs={"layer": "1", "height": 8}).set_placement(tuple(middle - [0, 12 * k]))
    document.modelspace().add_blockref(f"{name}-{size}", at)


def new_document(unit: str = "METRIC"):
    document = new("R12")
    for k, text in enumerate(("Style Name: own tee", "Sample Size: M", f"Units: {unit}")):
        document.modelspace().add_text(text, dxfattribs={"height": 8}).set_placement((0, -40 - 12 * k))
    return document


def tee(pattern: Pattern):
    """Of the built-in T-shirt."""
    document = new_document()
    front, back, sleeve = (list(pattern.panel(name).edges) for name in ("front", "back", "left_sleeve"))
    hem, side, hole, shoulder, neck = front[:5]
    top = along(neck, np.array([0.5]))[0]
    half = [
        np.array([[0.0, hem[0, 1]], hem[-1]]),
        side,
        hole,
        shoulder,
        np.vstack([neck[neck[:, 0] > 1e-6], top[None]]),
        np.array([top, [0.0, hem[0, 1]]]),
    ]
    add_piece(document, "FRONT", half, notches=marks(hole, AT_HOLE["front"]), fold=half[-1], at=(0, 0))
    holes = [*marks(back[2], AT_HOLE["back"]), *marks(back[6][::-1], AT_HOLE["back"])]
    add_piece(document, "BACK", back, notches=holes, at=(0, 700))
    # Of the left sleeve the right half of the cap, as seen from outside, goes to the back.
    cap = np.vstack([sleeve[2], sleeve[3][1:]])
    grown = length(cap) / (length(front[2]) + length(back[2]))
    onto = [grown * s for s in AT_HOLE["back"]]
    onto += [length(sleeve[2]), *(length(cap) - grown * s for s in AT_HOLE["front"])]
    add_piece(document, "SLEEVE", [sleeve[0], sleeve[1], cap, sleeve[4]], notches=marks(cap, onto), at=(0, 1400))
    return document


def marks(edge: F64, at) -> list[F64]:
    return list(along(edge, np.asarray(at) / length(edge)))


if __name__ == "__main__":
    own = draft("tshirt", figure_of(prepare_body(BodySection())))
    tee(own).saveas(FOLDER / "own_tee.dxf")
