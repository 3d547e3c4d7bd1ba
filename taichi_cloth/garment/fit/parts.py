"""On which part of the body each panel of a pattern is: read off where its file puts it, and its seams.

No kinds of garment are known. A sleeve stands beside the trunk, a hood or a collar over the neck; what is low is a
skirt round both legs, unless a front and a back of the same half are sewn together on its inner side: a tube.
"""

import numpy as np

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.piece import Piece, Work

__all__ = ["assign", "crotch_of", "is_floor"]

OVER = 0.85
"""The highest point of a garment drafted from the floor lies over this, of any other below it: any garment reaches the
waist of its body, and no hood is as far over the origin of SMPL's template [m]."""
ASIDE = 0.21
"""Of a sleeve's middle from the middle plane, at least [m]."""
SMALL = 0.035
"""Of a collar, at most [m²]."""
OVER_MIDDLE = 0.5
"""Of a half of trousers' reach to its own side, by which it may reach over the middle plane."""
INNER = 0.35
"""Of a panel's reach from the middle plane within which an inner seam of trousers lies."""


def is_floor(work: Work) -> bool:
    """Whether heights of a file are counted from the floor."""
    return max(float(piece.world()[:, 1].max()) for piece in work.pieces.values()) > OVER


def assign(work: Work, drafted: Landmarks) -> None:
    """Gives each piece its part and its side."""
    h = drafted.height
    for piece in work.pieces.values():
        w = piece.world()
        low, high = w.min(axis=0), w.max(axis=0)
        middle, n = (low + high) / 2, piece.normal
        piece.side = _side(n, middle)
        label = piece.label
        if _is_arm(piece, h):
            piece.part = "arm_l" if middle[0] > 0 else "arm_r"
        elif label in ("", "body") and (
            middle[1] > h["neck"] or (piece.panel.area < SMALL and low[1] > 0.9 * h["bust"])
        ):
            piece.part = "head"
        elif label == "leg" or (label == "" and high[1] < h["underbust"] and low[1] < h["crotch"] - 0.02):
            piece.part = "skirt"
        else:
            piece.part = "trunk"
    for _ in range(3):  # what is sewn to sleeves alone is a cuff
        for name, piece in work.pieces.items():
            to = {work.pieces[other.panel].part for _, other in work.pairs(name)}
            aside = np.abs(piece.world()[:, 0]).min() > 0.1 and piece.label == ""
            arms = {part for part in to if part.startswith("arm")}
            if aside and not piece.part.startswith("arm") and arms and "trunk" not in to:
                piece.part = "arm_l" if piece.world()[:, 0].mean() > 0 else "arm_r"
    for name, piece in work.pieces.items():  # a lapel is sewn to the collar and to one side of the trunk alone
        to = [work.pieces[other.panel] for _, other in work.pairs(name)]
        beyond = any(other.part != "head" and (other.part != "trunk" or other.side != piece.side) for other in to)
        if piece.part == "trunk" and not beyond and any(other.part == "head" for other in to):
            piece.part = "head"
    _trousers(work)


def crotch_of(work: Work) -> float | None:
    """Height of the lowest point of the seams between left and right legs [m]; None: no trousers."""
    heights = [
        min(float(work.at(side)[:, 1].min()) for side in sides)
        for sides in work.joined()
        if {work.pieces[side.panel].part for side in sides} == {"leg_l", "leg_r"}
    ]
    return min(heights, default=None)


def _side(n: np.ndarray, middle: np.ndarray) -> str:
    if abs(n[2]) > 0.5:
        return "front" if n[2] > 0 else "back"
    if abs(n[0]) > 0.5:
        return "left" if n[0] > 0 else "right"
    return "front" if middle[2] > 0 else "back"


def _is_arm(piece: Piece, h: dict[str, float]) -> bool:
    if piece.label:
        return piece.label == "arm"
    w = piece.world()
    low, high = w.min(axis=0), w.max(axis=0)
    apart = low[0] * high[0] > 0 and float(np.abs(w[:, 0]).min()) > 0.05
    middle = (low + high) / 2
    far = abs(middle[0]) > ASIDE
    return apart and far and abs(piece.normal[2]) > 0.7 and high[1] > h["underbust"] and middle[1] > h["hip"]


def _beside(piece: Piece) -> bool:
    """Whether it lies on one side of the middle plane, but for a fork: halves of wide circle skirts lie on both."""
    x = piece.world()[:, 0]
    return min(float(x.max()), float(-x.min())) < OVER_MIDDLE * max(float(x.max()), float(-x.min()))


def _trousers(work: Work) -> None:
    """Tubes for the legs: a front and a back of the same half that are sewn together on its inner side, and what is
    sewn to them in that half."""
    low = {piece.name: piece for piece in work.of("skirt") if _beside(piece)}
    half = {name: float(np.sign(piece.world()[:, 0].mean())) for name, piece in low.items()}
    legs: set[str] = set()
    for a, b in work.joined():
        if a.panel not in low or b.panel not in low or half[a.panel] != half[b.panel]:
            continue
        if {low[a.panel].side, low[b.panel].side} != {"front", "back"}:
            continue
        inner = [abs(float(work.at(s)[:, 0].mean())) for s in (a, b)]
        reach = [float(np.abs(low[s.panel].world()[:, 0]).max()) for s in (a, b)]
        if all(i < INNER * r for i, r in zip(inner, reach, strict=True)):
            legs |= {a.panel, b.panel}
    grown = bool(legs)
    while grown:
        more = {
            other.panel
            for name in legs
            for _, other in work.pairs(name)
            if other.panel in low and half[other.panel] == half[name]
        }
        grown = not more <= legs
        legs |= more
    for name in legs:
        low[name].part = "leg_l" if half[name] > 0 else "leg_r"
