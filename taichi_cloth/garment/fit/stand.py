"""Where graded panels start: before, behind and beside the body, CLEAR of it. Files have them much farther off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.grade import top_edge
from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.piece import ON_ARC, Piece, Work, arc_of, circle
from taichi_cloth.garment.fit.widen import tiers, widths
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.folded import Fin, Folded
from taichi_cloth.garment.pattern.pattern import Flat, Wrap

__all__ = ["BETWEEN", "CLEAR", "halves_apart", "stand", "start_of"]

F64 = NDArray[np.float64]

CLEAR = 0.03
"""[m]"""
LAPEL = 0.01
"""Of lapels over the fronts [m]."""
SNUG = 0.012
"""Between the body and the top of a cone [m]."""
AJAR = 0.02
"""From a slit to either side of a godet in it, at least [rad]."""
POINTED = 0.005
"""Between the ends of two edges that meet in a point, at most [m]."""
APART = 0.006
"""Of a frill on a leg from the middle plane, and from the crotch [m]."""
FOLDS, TIERED = 16, 24
"""Round a skirt of sectors of a ring where it starts, and round one of tiers, whose hem is up to ten metres long."""
BETWEEN = 0.002
"""From a right half to its left one where they start, at least [m]."""
TIER = 0.01
"""From the hem of a tier to where the next one starts, over which it gets as long as that is [m]."""


def stand(work: Work, worn: Landmarks) -> None:
    """Moves all pieces but sleeves to where they start."""
    deep = [pair for name, pair in worn.depth.items() if name not in ("top", "neck")]
    front, back = max(d[0] for d in deep) + CLEAR, min(d[1] for d in deep) - CLEAR
    radius = worn.girth["waist"] / (2 * np.pi)
    middle = float(np.mean(worn.depth["waist"]))
    for piece in work.pieces.values():
        if piece.part.startswith("arm"):
            continue
        n, w = piece.normal, piece.worn()
        beside = piece.part == "skirt" and abs(float(w[:, 0].mean())) > 1.5 * radius
        if piece.part == "head":
            _by_the_head(piece, worn)
            if abs(n[2]) > 0.7 and float(w[:, 1].min()) < worn.height["underarm"]:  # a lapel lies on the front
                piece.shift[2] = front + LAPEL if n[2] > 0 else back - LAPEL
        elif abs(n[2]) > 0.9 and not beside:
            piece.shift[2] = front if n[2] > 0 else back
        elif piece.part == "skirt":  # one of many round the body: its top edge to the waist
            there = piece.worn(top_edge(work, piece)).mean(axis=0) - [0, 0, middle]
            flat = n[[0, 2]] / max(float(np.linalg.norm(n[[0, 2]])), 1e-6)
            piece.shift[[0, 2]] += flat * (1.3 * radius + CLEAR) - there[[0, 2]]
    for piece in work.of("skirt", "trunk"):
        _in_its_slit(work, piece)


def halves_apart(work: Work) -> None:
    """Right and left halves of what has legs go aside by what they lie over one another in one plane, sewn to each
    other: a half that was made wider, or turned with its leg, reaches over the middle."""
    for right in work.of("trunk", "leg_r") if work.of("leg_r") else ():
        for _, other in work.pairs(right.name):
            left = work.pieces[other.panel]
            over = float(right.worn()[:, 0].max() - left.worn()[:, 0].min())
            if over > 0 and _half(left) == 1 and _half(right) == -1 and left.side == right.side:
                right.shift[0] -= (over + BETWEEN) / 2
                left.shift[0] += (over + BETWEEN) / 2


def _half(piece: Piece) -> int:
    """1 of the left half of a front or a back, -1 of the right one, 0 of what reaches past the middle by a quarter."""
    x = piece.worn()[:, 0]
    flat = piece.part in ("trunk", "leg_l", "leg_r") and abs(piece.normal[2]) > 0.9
    return int(np.sign(x.min() + x.max())) if flat and abs(x.min() + x.max()) > 0.5 * np.ptp(x) else 0


def _let_into(work: Work, piece: Piece) -> Piece | None:
    """The panel of its own side that all seams of a godet are with; None: it is no godet."""
    pairs = work.pairs(piece.name)
    to = {other.panel for _, other in pairs}
    if len(pairs) < 2 or len(to) > 1 or work.pieces[min(to)].side != piece.side:
        return None
    panel = work.pieces[min(to)]
    return panel if panel.panel.area >= 2 * piece.panel.area else None


def _in_its_slit(work: Work, piece: Piece) -> None:
    """A godet comes to where it is let in: files have all of a panel's side by side, and far under it."""
    panel = _let_into(work, piece)
    if panel is None:
        return
    pairs = work.pairs(piece.name)
    gap = np.mean([panel.worn(b.edge).mean(axis=0) - piece.worn(a.edge).mean(axis=0) for a, b in pairs], axis=0)
    piece.shift = piece.shift + gap * [1, 1, 0]


def _fin(work: Work, piece: Piece) -> Fin | None:
    """A godet that is a wedge, its point where the slit begins; None: any other piece."""
    panel, pairs = _let_into(work, piece), work.pairs(piece.name)
    if panel is None or len(pairs) != 2:
        return None
    (apex, *ends), own = _corner([piece.graded[a.edge] for a, _ in pairs])
    (top, *lows), slit = _corner([panel.worn(b.edge) for _, b in pairs])
    if max(own, slit) > POINTED:
        return None
    ways = [(end - apex) / np.linalg.norm(end - apex) for end in ends]
    middle = (ways[0] + ways[1]) / np.linalg.norm(ways[0] + ways[1])
    half = float(np.arccos(np.clip(ways[0] @ middle, -1.0, 1.0)))
    falls = [(low - top) / np.linalg.norm(low - top) for low in lows]
    fall = (falls[0] + falls[1]) / np.linalg.norm(falls[0] + falls[1])
    ajar = float(np.clip(np.arccos(np.clip(falls[0] @ fall, -1.0, 1.0)), AJAR, 0.9 * half))
    shift = piece.shift + top - piece.standing(apex[None])[0]
    return Fin(piece.rotation, shift, apex, middle, half, fall, ajar)


def _corner(lines: list[F64]) -> tuple[list[F64], float]:
    """Of two polylines (n, k): where they meet, half way between their nearest ends, and the other end of each; how far
    apart those are."""
    ends = [line[[0, -1]] for line in lines]
    apart = np.linalg.norm(ends[0][:, None] - ends[1][None], axis=2)
    i, j = np.unravel_index(int(apart.argmin()), (2, 2))
    return [0.5 * (ends[0][i] + ends[1][j]), ends[0][1 - i], ends[1][1 - j]], float(apart.min())


def start_of(work: Work, piece: Piece, worn: Landmarks) -> tuple[list[F64], Flat | Folded | Wrap]:
    """Edges and where they start: as they stand; what is sewn to itself round its part of the body; godets as fins;
    sectors of a ring in skirts hang round it in folds, with the share of the turn that their arc has of the loop, and
    tiers where the one above them ends."""
    flat = Flat(piece.rotation, piece.shift)
    if piece.tube:
        return _round_arm(piece, worn) if piece.part.startswith("arm") else _round_body(piece, worn)
    sector = _sector(work, piece)
    if sector is None:
        return piece.graded, _round_leg(piece, worn) or _fin(work, piece) or flat
    hangs, above = [sector], _above(work, piece)
    while above is not None and above.piece not in [one.piece for one in hangs]:  # low ones may seem to hang in a ring
        hangs.insert(0, above)
        above = _above(work, above.piece)
    first = hangs[0]
    top = float(first.piece.level(first.piece.ring, worn=True).mean())
    centre, radius = circle(sector.arc)
    middle = along(sector.arc, np.array([0.5]))[0]
    way = (centre - middle) / np.linalg.norm(centre - middle)  # to be +y
    turn = np.array([[way[1], way[0]], [-way[0], way[1]]])
    edges = [(edge - middle) @ turn for edge in piece.graded]
    _, breadth, depth, at = worn.ring(top)
    scale = max(1.0, first.loop / (np.pi * (breadth + depth + 2 * SNUG)))
    axes = (depth + SNUG) * scale, (breadth + SNUG) * scale
    outward = np.array([0.0, 0.0, float(np.sign(piece.normal[2]))])
    begins, profile = 0.0, list[tuple[float, float]]()
    for one in hangs:
        begins = profile[-1][0] + TIER if profile else 0.0
        profile += [(begins, one.loop), (begins + one.long, one.loop * (1 + one.long / circle(one.arc)[1]))]
    own = length(sector.arc)
    return edges, Folded(
        np.array([0.0, top, at]),
        outward,
        axes,
        radius,
        own / radius,
        share=own / sector.loop,
        folds=TIERED if any(other.ring is not None and _above(work, other) for other in work.of("skirt")) else FOLDS,
        begins=begins,
        profile=np.array(profile),
    )


class _Sector(NamedTuple):
    """A sector of a ring that falls in folds. arc: (n, 2) its top. loop: length of the whole turn of such arcs [m].
    long: how far down the next tier begins, or its hem lies [m]."""

    piece: Piece
    arc: F64
    loop: float
    long: float


def _sector(work: Work, piece: Piece, below: int | None = None) -> _Sector | None:
    """Of a skirt's piece before or behind, whose turn others share. below: edge that the next tier hangs on."""
    if piece.ring is None or piece.part != "skirt" or abs(piece.normal[2]) < 0.9:
        return None
    arc = arc_of(piece.graded, piece.ring)
    level, own = piece.level(worn=True), length(arc)
    top = float(piece.level(piece.ring, worn=True).mean())
    beside = _beside(work, piece)
    loop = sum(length(arc_of(other.graded, other.ring)) for other in beside if other.ring is not None)
    if len(beside) < 2:
        tier = next(tier for tier in tiers(work, work.of("skirt", "trunk")) if piece in tier)
        loop = sum(float(widths(other, np.array([top - 0.01]))[0]) for other in tier)
    if loop < 1.2 * own or own < 0.05:
        return None
    low = level.min() if below is None else piece.level(below, worn=True).mean()
    return _Sector(piece, arc, loop, max(top - float(low), TIER))


def _beside(work: Work, piece: Piece) -> list[Piece]:
    """It and what is sewn to its ends, and to theirs: sectors of one ring."""
    out, left = [piece], [piece]
    while left:
        one = left.pop()
        for own, other in work.pairs(one.name):
            there = work.pieces[other.panel]
            if one.is_end(own.edge) and there.is_end(other.edge) and there not in out:
                out.append(there)
                left.append(there)
    return out


def _above(work: Work, piece: Piece) -> _Sector | None:
    """The tier that it hangs on: what its arc is sewn to, where that falls in folds itself."""
    arc = piece.level(piece.ring, worn=True).mean()
    found = [
        (piece.edge_length(own.edge), other)
        for own, other in work.pairs(piece.name)
        if not piece.is_end(own.edge) and abs(piece.level(own.edge, worn=True).mean() - arc) < ON_ARC[1]
    ]
    for _, other in sorted(found, key=lambda one: -one[0]):
        there = work.pieces[other.panel]
        if there.ring is not None and not there.is_end(other.edge) and other.edge != there.ring:
            return _sector(work, there, other.edge)
    return None


def _round_leg(piece: Piece, worn: Landmarks) -> Wrap | None:
    """A frill or cuff below the crotch that reaches over the middle plane: half round its leg, on an ellipse that
    leaves room for the other leg's, with which it would start in one plane. None: any other piece."""
    sign, w = (1.0 if piece.part == "leg_l" else -1.0), piece.worn()
    across = np.concatenate(piece.graded)[:, 0]
    upright = min(abs(float(piece.normal[2])), float(piece.rotation[1, 1])) > 0.9
    over = float((sign * w[:, 0]).min()) < APART and float(w[:, 1].max()) < worn.height["crotch"] - APART
    if not piece.part.startswith("leg") or not upright or not over:
        return None
    y = float(w[:, 1].mean())
    x, z = (float(np.interp(y, worn.leg[::-1, 1], worn.leg[::-1, k])) for k in (0, 2))
    side, round_ = x - APART, 2 * float(np.ptp(across))
    deep = np.linspace(side, round_ / 2, 200)
    h = ((deep - side) / (deep + side)) ** 2
    around = np.pi * (deep + side) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))  # Ramanujan 1914
    outward = np.array([0.0, 0.0, float(np.sign(piece.normal[2]))])
    origin = np.array([sign * x, float(piece.shift[1]), z])
    radius = float(np.interp(round_, around, deep)), side
    return Wrap(origin, np.array([0.0, 1.0, 0.0]), outward, radius, float(across.min() + across.max()) / 2)


def _round_arm(piece: Piece, worn: Landmarks) -> tuple[list[F64], Wrap]:
    """A sleeve of one piece, the middle of its cap on top of the arm, its seam below. It was graded in lengths down the
    arm and across it."""
    edges = [np.stack([edge[:, 1], -edge[:, 0]], -1) for edge in piece.graded]
    axis = -piece.rotation[:, 0]
    outward = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    outward /= np.linalg.norm(outward)
    wide = float(np.ptp(np.concatenate(edges)[:, 0]))
    radius = max(wide, worn.girth["upper_arm"] + 2 * np.pi * CLEAR) / (2 * np.pi)
    return edges, Wrap(piece.shift, axis, outward, (radius, radius))


def _round_body(piece: Piece, worn: Landmarks) -> tuple[list[F64], Wrap]:
    """A band or a skirt of one piece, its middle in front, or behind where it is drawn for there."""
    xy = np.concatenate(piece.graded)
    middle, wide = float(xy[:, 0].min() + xy[:, 0].max()) / 2, float(np.ptp(xy[:, 0]))
    y = float(piece.shift[1])
    if piece.part == "head":
        breadth = depth = worn.girth["neck"] / (2 * np.pi)
        at = float(np.mean(worn.depth["neck"]))
    else:
        _, breadth, depth, at = worn.ring(y + float(xy[:, 1].max()))
    breadth, depth = breadth + SNUG, depth + SNUG
    scale = max(1.0, wide / (np.pi * (breadth + depth)))
    outward = np.array([0.0, 0.0, float(np.sign(piece.normal[2]))])
    place = Wrap(np.array([0.0, y, at]), np.array([0.0, 1.0, 0.0]), outward, (depth * scale, breadth * scale), middle)
    return piece.graded, place


def _by_the_head(piece: Piece, worn: Landmarks) -> None:
    """Halves of hoods beside the head, standing collars before and behind the neck, lying ones round it."""
    n, w = piece.normal, piece.worn()
    neck, head = worn.girth["neck"] / (2 * np.pi), worn.girth["head"] / (2 * np.pi)
    middle = float(np.mean(worn.depth["top"]))
    if abs(n[0]) > 0.7:
        piece.shift[0] += np.sign(w[:, 0].mean()) * (head + CLEAR) - w[:, 0].mean()
        piece.shift[2] += middle - 0.5 * (w[:, 2].min() + w[:, 2].max())
    elif abs(n[2]) > 0.7:
        piece.shift[2] = worn.depth["neck"][0] + CLEAR if n[2] > 0 else worn.depth["neck"][1] - CLEAR
    else:
        way = np.array([w[:, 0].mean(), w[:, 2].mean() - middle])
        broad = min(np.ptp(np.concatenate(piece.graded), axis=0))
        there = way / max(float(np.linalg.norm(way)), 1e-6) * (neck + 0.5 * broad)
        piece.shift[[0, 2]] += there + np.array([0.0, middle]) - w[:, [0, 2]].mean(axis=0)
