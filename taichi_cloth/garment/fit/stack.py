"""Heights as worn: what hangs on what follows from the seams, and what carries it all from them too.

Heights in a file are a layout: a waistband lies some centimetres under the bodice that it is sewn to.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.piece import Work
from taichi_cloth.garment.pattern.pattern import Side

__all__ = ["Carried", "carried", "over_head", "over_shoulders", "stack"]

F64 = NDArray[np.float64]


BESIDE = 0.5
"""Of the normals of two halves of a hood, across the body: their product, at least."""


@dataclass(frozen=True)
class Carried:
    """by: shoulders, bust, waist, or "" where nothing could. lift: of all, so that it lies there [m]. armhole: height
    of the upper end of its side seams before that, where shoulders carry it [m]."""

    by: str
    lift: float
    armhole: float | None = None


def stack(work: Work) -> None:
    """Lifts of all pieces but those on arms so that seams meet in height: least squares, weighted by length; the
    topmost stays where it is."""
    names = [name for name, piece in work.pieces.items() if not piece.part.startswith("arm")]
    if not names:
        return
    number = {name: k for k, name in enumerate(names)}
    rows, wanted = [], []
    for a, b in work.joined():
        if a.panel not in number or b.panel not in number:
            continue
        weight = np.sqrt(work.pieces[a.panel].edge_length(a.edge))
        first, second = work.at(a), work.at(b)
        upright = min(_steepness(first), _steepness(second)) > 1  # one side may lean: their upper ends meet
        collar = {work.pieces[s.panel].part for s in (a, b)} == {"head", "trunk"}
        if collar and not upright and not _at_back(work, a, b):
            weight *= 0.2  # a hood hangs on the neck's back; the front of a deep neckline lies lower
        levels = [work.pieces[s.panel].level(s.edge) for s in (a, b)]
        heights = [y.max() if upright else y.mean() for y in levels]
        row = np.zeros(len(names))
        row[number[a.panel]], row[number[b.panel]] = weight, -weight
        rows.append(row)
        wanted.append(weight * (heights[1] - heights[0]))
    for k in range(len(names)):  # what no seam joins stays
        row = np.zeros(len(names))
        row[k] = 0.05
        rows.append(row)
        wanted.append(0.0)
    lifts = np.linalg.lstsq(np.array(rows), np.array(wanted), rcond=None)[0]
    body = [name for name in names if work.pieces[name].part != "head"] or names
    top = max(body, key=lambda name: float(work.pieces[name].level().max() + lifts[number[name]]))
    for name, lift in zip(names, lifts, strict=True):
        work.pieces[name].lift = float(lift - lifts[number[top]])


def carried(work: Work, drafted: Landmarks) -> Carried:
    """Shoulders where cloth closes over them between front and back; else bust or waist. Its lift is that at which it
    lies on the landmark; what hangs from the waist stays as drawn."""
    h = drafted.height
    over, sides = _fronts_to_backs(work)
    if over:
        highest = max(float(work.at(side)[:, 1].max()) for pair in over for side in pair)
        low = [y for y in sides if h["waist"] < y + h["neck"] - highest < h["neck"] - 0.08]
        return Carried("shoulders", h["neck"] - highest, max(low, default=None))
    around = work.of("trunk", "skirt", "leg_l", "leg_r")
    if not around:
        return Carried("", 0.0)
    trunk = work.of("trunk")
    top = max(float(piece.level().max()) for piece in around)
    low = min((float(piece.level().min()) for piece in trunk), default=top)
    said = {mark for piece in around for _, mark in piece.panel.marks}
    banded = any(mark == "lower_interface" for piece in trunk for _, mark in piece.panel.marks)
    if "strapless_top" in said or (trunk and top - low > 0.10 * h["top"] and not banded):
        return Carried("bust", h["underarm"] - 0.02 - max(sides, default=top))
    return Carried("waist", 0.0)


def over_shoulders(work: Work) -> list[tuple[Side, Side]]:
    """Both sides of the seams that close over the shoulders."""
    return _fronts_to_backs(work)[0]


def over_head(work: Work) -> list[tuple[Side, Side]]:
    """Both sides of the seams between halves of a hood that stand beside the head, left and right."""
    out = []
    for a, b in work.joined():
        pa, pb = work.pieces[a.panel], work.pieces[b.panel]
        if pa.part == pb.part == "head" and pa.normal[0] * pb.normal[0] < -BESIDE:
            out.append((a, b))
    return out


def _fronts_to_backs(work: Work) -> tuple[list[tuple[Side, Side]], list[float]]:
    """Seams of the trunk from front to back: those over the shoulders, and the heights of both upper ends of those at
    the sides [m]."""
    over, sides = [], []
    for a, b in work.joined():
        pa, pb = work.pieces[a.panel], work.pieces[b.panel]
        if pa.part != "trunk" or pb.part != "trunk" or {pa.side, pb.side} != {"front", "back"}:
            continue
        ends = [(work.at(a), pa.world()), (work.at(b), pb.world())]
        steep = min(_steepness(w) for w, _ in ends)
        near_top = all(w[:, 1].max() > whole[:, 1].max() - 0.10 for w, whole in ends)
        short = all(np.ptp(w[:, 1]) < 0.4 * np.ptp(whole[:, 1]) for w, whole in ends)  # no side of a band
        if steep < 1.5 and near_top and short:
            over.append((a, b))
        elif steep >= 1.5:
            sides += [float(w[:, 1].max()) for w, _ in ends]
    return over, sides


def _steepness(w: F64) -> float:
    """Rise over run of an edge (k, 3)."""
    return float(np.ptp(w[:, 1]) / max(float(np.ptp(w[:, [0, 2]], axis=0).max()), 1e-6))


def _at_back(work: Work, a: Side, b: Side) -> bool:
    return any(work.pieces[s.panel].part == "trunk" and work.pieces[s.panel].side == "back" for s in (a, b))
