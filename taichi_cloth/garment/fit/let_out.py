"""Letting out after a fitting: what a first sewing shows to be tight is cut wider, level by level, as a tailor does.

Girths tell what a body asks of a loop of cloth at a height. They do not tell at which height cloth comes to lie that
goes over a bust or under an arm, nor how much of a loop is before the body, nor what an arm asks of an armhole: the
sewn garment does (`sewn/tried_on.py`).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.piece import Piece, Work, crosses

__all__ = ["LetOut", "axes", "both", "let_out"]

F64 = NDArray[np.float64]

LetOut = Mapping[str, tuple[F64, F64]]
"""By panel: distances along the first of its `axes` [m], rising, and how many times as wide it is to be there."""

MOST = 1.25
"""Times as wide as it was, at most: what asks for more is no matter of ease."""


def axes(rotation: F64, part: str) -> tuple[F64, F64]:
    """(2,) along which a panel is tight or not level by level, and (2,) along which it is wide there: up and across;
    of a sleeve, as `limbs.py` lays it, down the arm and round it."""
    if part.startswith("arm"):
        return np.array([1.0, 0.0]), np.array([0.0, 1.0])
    rise = rotation[1, :2] / max(float(np.linalg.norm(rotation[1, :2])), 1e-9)
    return rise, np.array([rise[1], -rise[0]])


def both(first: LetOut, second: LetOut) -> LetOut:
    """One letting out after another: along the same axes, on which widening moves nothing."""
    out = dict(first)
    for name, (at, by) in second.items():
        before = np.interp(at, *first[name]) if name in first else 1.0
        out[name] = at, np.minimum(by * before, MOST)
    return out


def let_out(work: Work, by: LetOut) -> list[str]:
    """Widens graded pieces; gives a line of how much, of the part of the body and the side that got the most."""
    most = dict[str, float]()
    for name, (at, factor) in by.items():
        piece = work.pieces[name]
        up, across = axes(piece.rotation, piece.part)
        drawn, base = piece.graded, _base(piece, across)
        out = []
        for edge in drawn:
            c = edge @ across
            out.append(edge + np.outer((c - base) * (np.interp(edge @ up, at, factor) - 1), across))
        if crosses(out) and not crosses(drawn):
            continue
        piece.graded = out
        there = np.concatenate(drawn) @ across
        more = float(factor.max() - 1) * float(np.ptp(there))
        what = f"{piece.side} of {piece.part.replace('_l', ', left').replace('_r', ', right')}"
        most[what] = max(most.get(what, 0.0), more)
    if not most:
        return []
    return ["let out after it was tried on: " + ", ".join(f"{what} {100 * most[what]:.1f} cm" for what in sorted(most))]


def _base(piece: Piece, across: F64) -> float:
    """What stays where it is: the middle of the body or of a leg, of halves; of all else their own middle."""
    way = piece.rotation[:, :2] @ across
    middle = np.concatenate(piece.graded) @ across
    own = float(middle.min() + middle.max()) / 2
    if piece.part.startswith(("arm", "leg")):
        return 0.0
    return -float(piece.shift[0]) / float(way[0]) if abs(way[0]) > 0.5 else own
