"""No loop of cloth tighter than the body where it is worn: levels that are get wider, and only those.

The ease that was drafted stays, as widths go by girths; this is a floor under it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from taichi_cloth.garment.fit.grade import BELOW, even_out, of_ring
from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.levels import worn_levels
from taichi_cloth.garment.fit.piece import UP, Piece, Work, arc_of, circle, crosses
from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.cut import intervals
from taichi_cloth.garment.pattern.pattern import Side

__all__ = ["EASE", "MORE", "lengthen_jumpsuit", "raise_tight", "tiers", "widen", "widths"]

F64 = NDArray[np.float64]

EASE, MORE = 1.04, 0.02
"""Least girth of a loop of cloth over the body's there, and what is added to one that has to be widened [m]."""
TIGHT = 0.88
"""Girth of a top over the body's under which it is rather raised than widened."""
CLOSED = 0.4
"""Share of the body's girth under which the cloth of a level is no loop: the garment ends above or below."""
HALF = 0.25
"""The same of what lies before it or behind: straps over a bare back make no loop."""
STEP = 0.01
SPREAD = 3
"""Steps up and down over which a level's widening is spread."""
BEYOND = 0.10
"""Of a piece's top and bottom within which it still counts as there: its neighbours may be drawn as much higher [m]."""
MARGIN = 0.015
"""From a piece's top and bottom within which its width is that beyond: those edges may lean or curve [m]."""
UNDER = 0.005
"""Armholes of the highest level at which a top is a loop [m]."""
KEPT, FADE = 0.01, 0.06
"""Over the highest of the levels that are looked at, to where it is widened like that, of a top up to its armholes; and
then until it is not [m]."""
ROOM = 0.04
"""Of a jumpsuit over the body's height from fork to shoulder [m]."""
UPRIGHT = 1.5
"""Rise over run of the edges of a slit."""
MOST = 1.5
"""Of a level at a time."""
ROUNDS = 3


def widen(work: Work, worn: Landmarks, higher: float, *, last: bool = False) -> list[str]:
    """Widens graded pieces of trunk, skirt and legs, and collars; gives a line for each stretch of levels that was
    too tight. higher: than they are worn, where loops round legs close, and may stay [m]. last: all but collars, and
    seams are not evened out after it, which takes widths back that were given: what one side of a seam is longer then
    is eased onto the other."""
    notes = []
    crotch = worn.height["crotch"]
    for tier in tiers(work, work.of("trunk", "skirt", "leg_l", "leg_r")):
        low = crotch + 0.01 if any(piece.part.startswith("leg") for piece in tier) else _closed_from(work, tier, crotch)
        high = min(worn.height["underarm"], _open_from(work, tier)) - UNDER
        notes += _levels(work, tier, worn, low, high, "trunk", last=last)
    low = crotch - 0.02
    for part in ("leg_l", "leg_r"):
        for tier in tiers(work, work.of(part)):  # a cuff is a loop of its own
            notes += _levels(work, tier, worn, 0.12 * worn.height["top"], low, part, higher, last=last)
    if last:
        return notes
    collars = [piece for piece in work.of("head") if abs(piece.normal[2]) > 0.7]
    if collars:
        notes += _levels(work, collars, worn, worn.height["neck"] - 0.05, worn.height["neck"] + 0.2, "neck")
    return notes


def raise_tight(work: Work, worn: Landmarks) -> list[str]:
    """Skirts whose top is too tight where seams would hang them, as under a long bodice that is gathered onto them, go
    up to where they fit, and what they hang on is shortened below the arms. Trousers are widened instead: their fork
    would go up with them, and draw the rest off the shoulders."""
    low, waist = worn.height["crotch"], worn.height["waist"]
    for tier in tiers(work, work.of("skirt", "leg_l", "leg_r", "trunk")):
        top = max(float(piece.level(worn=True).max()) for piece in tier)
        if any(piece.part != "skirt" for piece in tier) or not low < top < waist - 0.02:
            continue
        loop = sum(float(widths(piece, np.array([top - 0.01]))[0]) for piece in tier)
        if not CLOSED * worn.ring(top)[0] < loop < TIGHT * worn.ring(top)[0]:
            continue
        up = np.arange(top, waist + STEP, STEP)
        fits = [y for y in up if loop >= EASE * worn.ring(float(y))[0]]
        by = float((fits[0] if fits else waist) - top)
        _raised(work, worn, top, by)
        return [f"waist: raised by {100 * by:.0f} cm to where the body is as narrow as its {100 * loop:.0f} cm"]
    return []


def lengthen_jumpsuit(work: Work, worn: Landmarks) -> list[str]:
    """Trousers that shoulders carry come ROOM lower, and what they hang on is as much longer below the arms: cloth goes
    over the bust and through the fork, and what is too short for that draws itself off the shoulders."""
    legs = work.of("leg_l", "leg_r")
    if not legs:
        return []
    _raised(work, worn, max(float(piece.level(worn=True).max()) for piece in legs), -ROOM)
    return [f"trunk: {100 * ROOM:.0f} cm longer, as trousers hang on it"]


def _raised(work: Work, worn: Landmarks, top: float, by: float) -> None:
    """Skirts and trousers, whose top is at a height, go up, and what is between them and the arms gets shorter [m]."""
    for piece in work.of("skirt", "leg_l", "leg_r"):
        piece.shift = piece.shift + by * UP
    arm = worn.height["underarm"] - BELOW
    for piece in work.of("trunk"):
        _shortened(piece, arm, (arm - top - by) / (arm - top))
    even_out(work, rounds=2)


def _shortened(piece: Piece, under: float, by: float) -> None:
    """Its heights under a height [m] times `by`."""
    rise, _, steep = _frame(piece)
    if steep < 0.3:
        return
    limit = (under - float(piece.shift[1])) / steep
    out = []
    for edge in piece.graded:
        t = edge @ rise
        out.append(edge + np.outer(np.minimum(t - limit, 0.0) * (by - 1), rise))
    piece.graded = out


def tiers(work: Work, pieces: list[Piece]) -> list[list[Piece]]:
    """Pieces that go round the body side by side: a waistband's, a skirt's. Seams between them run over most of the
    height of one of them, not along its top or bottom; those of narrow rings, as tiers of a skirt, that hang aslant are
    told by their arcs."""
    number = {piece.name: k for k, piece in enumerate(pieces)}
    span = [(float(y.min()), float(y.max())) for y in (piece.level(worn=True) for piece in pieces)]
    tier = list(range(len(pieces)))
    for a, b in work.joined():
        if a.panel not in number or b.panel not in number:
            continue
        i, j = number[a.panel], number[b.panel]
        shared = min(span[i][1], span[j][1]) - max(span[i][0], span[j][0])
        sides = pieces[i].is_end(a.edge) and pieces[j].is_end(b.edge)
        if sides or shared > 0.5 * min(span[i][1] - span[i][0], span[j][1] - span[j][0]):
            old, new = tier[j], tier[i]
            tier = [new if t == old else t for t in tier]
    return [[piece for piece, t in zip(pieces, tier, strict=True) if t == one] for one in sorted(set(tier))]


def _closed_from(work: Work, tier: list[Piece], crotch: float) -> float:
    """The height over which skirts go round both legs: over their slits [m]."""
    sewn, slits = work.sewn(), [0.0]
    for piece in tier:
        for k in range(len(piece.graded)):
            w = piece.worn(k)
            rise, run = np.ptp(w[:, 1]), float(np.ptp(w[:, [0, 2]], axis=0).max())
            if (piece.name, k) not in sewn and rise > UPRIGHT * run and w[:, 1].min() < crotch:
                slits.append(float(w[:, 1].max()))
    return max(slits)


def _open_from(work: Work, tier: list[Piece]) -> float:
    """The height up to which tops go round the body: the lowest point of their armholes and of their neckline, which
    are sewn to sleeves, collars or hoods, or free and for the most part in the upper half [m]."""
    level = worn_levels(work, tier)
    seams = {own: work.pieces[to.panel].part for piece in tier for own, to in work.pairs(piece.name)}
    sewn, low = work.sewn(), [np.inf]
    for piece in tier:
        everywhere = np.concatenate(level[piece.name])
        middle = float(everywhere.min() + everywhere.max()) / 2
        for k, y in enumerate(level[piece.name]):
            on = seams.get(Side(piece.name, k), "trunk" if (piece.name, k) in sewn else "")
            if piece.part == "trunk" and (on[:4] in ("arm_", "head") or (not on and y.mean() > middle)):
                low.append(float(y.min()))
    return min(low)


def _levels(
    work: Work,
    pieces: list[Piece],
    worn: Landmarks,
    low: float,
    high: float,
    what: str,
    higher: float = 0.0,
    *,
    last: bool = False,
) -> list[str]:
    if not pieces:
        return []
    level = worn_levels(work, pieces)
    own_heights = np.concatenate([y for edges in level.values() for y in edges])
    heights = np.arange(max(low, own_heights.min()), min(high, own_heights.max()), STEP)
    if len(heights) < 2:
        return []
    girth = np.array([_girth(worn, float(y) + higher, what) for y in heights])
    need, first = EASE * girth, None
    for number in range(ROUNDS):
        if number:
            level = worn_levels(work, pieces)
        each = np.array([widths(piece, heights, level[piece.name]) for piece in pieces])
        own = each.sum(axis=0)
        before, behind = (np.array([piece.tube or piece.normal[2] * sign > 0 for piece in pieces]) for sign in (1, -1))
        halves = np.minimum(each[before].sum(axis=0), each[behind].sum(axis=0))
        whole = halves > HALF * girth
        tight = whole & (own > CLOSED * girth) & (own < need)
        if not tight.any():
            break
        if first is None:
            first = own.copy(), tight.copy()
        factor = np.where(tight, (need + (0.0 if last and what == "trunk" else MORE)) / np.maximum(own, 1e-6), 1.0)
        factor = np.minimum(factor, MOST)
        factor = gaussian_filter1d(maximum_filter1d(factor, 2 * SPREAD + 1), 1.0, mode="nearest")
        # Over the levels that are looked at, what lies on shoulders, or a waist on the legs' hips, keeps its width.
        upto = np.append(heights, heights[-1] + np.array([KEPT, KEPT + FADE]))
        by = np.append(np.maximum(factor, 1.0), [max(factor[-1], 1.0), 1.0])
        for piece in pieces:
            drawn = piece.graded
            _widened(piece, upto, by, level[piece.name])
            if crosses(piece.graded) and not crosses(drawn):
                piece.graded = drawn
        if not last:
            even_out(work, rounds=2)
    if first is None:
        return []
    own, tight = first
    worst = int(np.argmax(np.where(tight, need / np.maximum(own, 1e-6), 0.0)))
    return [
        f"{_named(heights[worst], worn, what)}: {100 * own[worst]:.0f} cm round on {100 * girth[worst]:.0f} cm of "
        f"body: widened to {100 * (need[worst] + MORE):.0f} cm"
    ]


def _named(y: float, worn: Landmarks, what: str) -> str:
    if what != "trunk":
        return {"leg_l": "left leg", "leg_r": "right leg"}.get(what, what)
    if y < worn.height["crotch"]:
        return "hem round both legs"
    return min(("hip", "waist", "underbust", "bust"), key=lambda name: abs(worn.height[name] - y))


def _girth(worn: Landmarks, y: float, what: str) -> float:
    """Of the part of the body at a height [m]."""
    h, g = worn.height, worn.girth
    if what == "trunk":
        return worn.ring(y)[0]
    if what == "neck":
        return g["neck"]
    return float(np.interp(y, [0.06, h["knee"], h["crotch"] - 0.03], [g["ankle"], g["knee"], g["thigh"]]))


def _frame(piece: Piece) -> tuple[F64, F64, float]:
    """(2,) rising and (2,) level in the piece's plane, and the sine of its slope."""
    rise = piece.rotation[1, :2]
    steep = float(np.linalg.norm(rise))
    rise = rise / max(steep, 1e-9)
    return rise, np.array([rise[1], -rise[0]]), steep


def widths(piece: Piece, heights: F64, level: list[F64] | None = None) -> F64:
    """(n,) of a graded piece at heights [m]: darts in it are no cloth. Of a sector of a ring as its arcs are long.
    level: at which heights the points of its edges are worn (`worn_levels`); None: as they lie in its plane."""
    _, across, steep = _frame(piece)
    out = np.zeros(len(heights))
    if piece.ring is not None:
        y = piece.level(worn=True)
        low, high = float(y.min()), float(y.max())
        there = (heights >= low - BEYOND) & (heights <= high + BEYOND)
        arc = arc_of(piece.graded, piece.ring)
        radius = circle(arc)[1]
        out[there] = length(arc) * (1 + (high - heights[there]) / max(radius, 1e-3))
        return out
    if steep < 0.3:
        return out
    starts, tips = {a for a, _ in piece.notches}, {b for _, b in piece.notches}  # sewn, side darts take nothing of it
    level = level or [piece.level(k, worn=True) for k in range(len(piece.graded))]
    kept = [k for k in range(len(piece.graded)) if k not in tips]
    upto = [1 if k in starts else -1 for k in kept]
    ring = np.concatenate(
        [np.stack([piece.graded[k][:n] @ across, level[k][:n]], -1) for k, n in zip(kept, upto, strict=True)]
    )
    low, high = float(ring[:, 1].min()), float(ring[:, 1].max())
    first, last = _whole(piece, across, level)
    for n, y in enumerate(heights):
        if low - BEYOND <= y <= high + BEYOND:
            pieces = intervals(ring, float(np.clip(y, first, last)), 1)
            out[n] = float((pieces[:, 1] - pieces[:, 0]).sum())
    return out


def _whole(piece: Piece, across: F64, level: list[F64]) -> tuple[float, float]:
    """Between which heights [m] a piece goes from one side to the other: over the hem, which may slant or
    curve, and under the top. Outlines run counter-clockwise, so along the hem with `across`, along the top against it.
    """
    lows, highs = [], []
    everything = np.concatenate(level)
    notches = {k for pair in piece.notches for k in pair}
    for k, edge in enumerate(piece.graded):
        if k in notches:
            continue
        way = edge[-1] - edge[0]
        share = float(way @ across) / max(float(np.linalg.norm(way)), 1e-9)
        if share > 0.6:
            lows.append(float(level[k].max()))
        elif share < -0.6:
            highs.append(float(level[k].min()))
    low, high = float(everything.min()), float(everything.max())
    first = max((v for v in lows if v < low + 0.5 * (high - low)), default=low) + MARGIN
    last = min((v for v in highs if v > low + 0.5 * (high - low)), default=high) - MARGIN
    return (first, last) if first < last else ((low + high) / 2, (low + high) / 2)


def _widened(piece: Piece, heights: F64, factor: F64, worn: list[F64]) -> None:
    """worn: at which heights the points of its edges are [m]."""
    rise, level, steep = _frame(piece)
    if piece.ring is not None:
        y = piece.level(worn=True)
        f = float(np.interp(np.linspace(y.min(), y.max(), 9), heights, factor).max())
        top = float(piece.level(piece.ring, worn=True).mean())
        piece.graded = of_ring(piece.graded, piece.ring, f, lambda down: down)
        piece.shift = piece.shift + (top - float(piece.level(piece.ring, worn=True).mean())) * UP
        return
    if steep < 0.3:
        return
    way = piece.rotation[:, :2] @ level
    across = np.concatenate(piece.graded) @ level
    base = float(across.min() + across.max()) / 2
    if piece.part.startswith("leg"):
        base = 0.0
    elif abs(way[0]) > 0.5:
        base = -float(piece.shift[0]) / float(way[0])
    out = []
    for edge, y in zip(piece.graded, worn, strict=True):
        t, c = edge @ rise, edge @ level
        f = np.interp(y, heights, factor)
        out.append(np.outer(t, rise) + np.outer(base + (c - base) * f, level))
    piece.graded = out
