"""Grading: each panel's outline as the body that wears it asks, and both sides of every seam alike.

A panel is graded in its own plane, along its level and its rising direction, so that one that leans stays plane. What
is a sector of a ring, as of a circle skirt, keeps its angle and has one factor round, or it is a ring no more.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.maps import Map, across, heights
from taichi_cloth.garment.fit.piece import UP, Piece, Work, arc_of, circle, crosses, turned_towards
from taichi_cloth.garment.pattern.curves import length

__all__ = ["BELOW", "SLEEVED", "even_out", "find_rings", "grade", "of_ring", "top_edge"]

F64 = NDArray[np.float64]

LYING = 0.3
"""Sine of a panel's slope under which it lies flat."""
RING, LEANS = 25.0, 0.5
"""Degrees by which the top edge of a sector of a ring turns, at least, and rise over run of its ends, at most, on the
trunk: armholes turn, too."""
BELOW, SLEEVED = 0.035, 0.05
"""Of an armhole's lowest point under the arm where the garment rests, at least, and with a sleeve in it [m]."""
WITHIN = 1.05
"""Of the outer arc's radius, within which the inner one's circle lies: hems longer behind have another centre."""
SEWN, FREE = 5.0, 1.0
"""How much an edge keeps to the length it should have when corners are moved."""


def grade(work: Work, drafted: Landmarks, worn: Landmarks, armhole: float | None = None) -> None:
    """Graded outlines and where they stand, of all pieces but those on arms (`limbs.py`). armhole: height of its lowest
    point as drawn [m]: it comes to lie under the arm, else cloth is drawn into the armpit."""
    up = heights(drafted, worn)
    if armhole is not None:
        up = _deepened(up, armhole, worn, SLEEVED if work.of("arm_l", "arm_r") else BELOW)
    for piece in work.pieces.values():
        if piece.part.startswith("arm"):
            continue
        wide = across(drafted, worn, piece.part)
        rise = piece.rotation[1, :2]
        steep = float(np.linalg.norm(rise))
        if steep < LYING or piece.ring is not None:
            k = top_edge(work, piece) if piece.ring is None else piece.ring
            f = float(wide(piece.level(k).max()))
            piece.graded = [edge * f for edge in piece.edges]
            line, new = piece.edges[k], piece.graded[k]
            if piece.ring is not None:
                line = arc_of(piece.edges, k)
                top = float(piece.level(k).mean())
                piece.graded = of_ring(piece.edges, k, f, lambda down, top=top: up(top) - up(top - down))
                new = arc_of(piece.graded, k)
            old = piece.rotation[:, :2] @ line[[0, -1]].mean(axis=0) + piece.at + piece.lift * UP
            new = new[[0, -1]].mean(axis=0)
            there = np.array([old[0] * f, float(up(old[1])), old[2]])
            piece.shift = there - piece.rotation[:, :2] @ new
            continue
        rise = rise / steep
        level = np.array([rise[1], -rise[0]])
        way = piece.rotation[:, :2] @ level
        low, high = piece.world().min(axis=0), piece.world().max(axis=0)
        half = float(np.sign(low[0] + high[0]))
        across_ = np.concatenate(piece.edges) @ level
        base = (
            float(across_.min() + across_.max()) / 2
        )  # about what it widens: its middle, the body's, or the leg's axis
        if abs(way[0]) > 0.5:
            if piece.part.startswith("leg"):
                base = (drafted.leg[0, 0] * half - piece.at[0]) / way[0]
            elif piece.part in ("trunk", "skirt", "head"):
                base = -piece.at[0] / way[0]
        y0 = piece.at[1] + piece.lift
        middle = y0 + steep * float(np.mean(np.concatenate(piece.edges) @ rise))
        piece.graded = []
        for edge in piece.edges:
            t, c = edge @ rise, edge @ level
            y = y0 + steep * t
            piece.graded.append(np.outer((up(y) - up(middle)) / steep, rise) + np.outer((c - base) * wide(y), level))
        shift = piece.rotation[:, :2] @ (rise * ((middle - y0) / steep) + level * base) + piece.at
        shift[1] = float(up(middle))
        if piece.part.startswith("leg"):
            shift[0] = worn.leg[0, 0] * half
        elif abs(way[0]) <= 0.5 or (piece.part == "skirt" and abs(piece.normal[2]) < 0.9):
            shift[0] *= float(wide(middle))
        piece.shift = shift


def of_ring(edges: list[F64], arc: int, wide: float, long: Callable[[F64], F64]) -> list[F64]:
    """Edges of a sector of a ring, its angle kept, its arc `wide` times as long; long: from how far below the arc a
    point lies to how far it comes to lie [m]."""
    centre, radius = circle(edges[arc])
    out = []
    for edge in edges:
        away = edge - centre
        r = np.maximum(np.linalg.norm(away, axis=1), 1e-6)
        out.append(wide * centre + away * ((wide * radius + long(r - radius)) / r)[:, None])
    return out


def _deepened(up: Map, armhole: float, worn: Landmarks, below: float) -> Map:
    """A map of heights that brings an armhole `below` the arm: all lower between neck and waist, those stay."""
    own, target = float(up(armhole)), worn.height["underarm"] - below
    waist, neck = worn.height["waist"], worn.height["neck"]
    if not target < own < neck - 0.02 or target < waist + 0.02:
        return up
    return lambda y: _beyond(np.asarray(up(y), np.float64), [waist, own, neck], [waist, target, neck])


def _beyond(y: F64, x: list[float], to: list[float]) -> F64:
    inside = np.interp(y, x, to)
    return np.where((y >= x[0]) & (y <= x[-1]), inside, y)


def top_edge(work: Work, piece: Piece) -> int:
    """The highest of the piece's edges that run level, are no splinters, and are sewn neither beside nor below."""
    middle = float(piece.world()[:, 1].mean())
    other = {
        own.edge
        for own, there in work.pairs(piece.name)
        if work.pieces[there.panel].side != piece.side or work.pieces[there.panel].world()[:, 1].mean() < middle
    }
    darts = [seam for seam in work.seams if seam.first.panel == seam.second.panel == piece.name]
    other |= {side.edge for seam in darts for side in (seam.first, seam.second)}
    long = [piece.edge_length(k) for k in range(len(piece.edges))]
    left = [k for k in range(len(long)) if k not in other] or list(range(len(long)))
    longest = max(long[k] for k in left)

    def height(k: int) -> float:
        w = piece.world(k)
        return float(w[:, 1].mean()) if long[k] > 0.15 * longest and np.ptp(w[:, 1]) < 0.6 * long[k] else -9.0

    return max(left, key=height)


def find_rings(work: Work) -> None:
    """Which pieces are sectors of rings, as of a circle skirt or a yoke: a deep arc at the top, its middle above it."""
    for piece in work.of("skirt", "trunk"):
        k = _inner(piece, top_edge(work, piece))
        rise = piece.rotation[1, :2]
        arc = arc_of(piece.edges, k)
        above = float((circle(arc)[0] - arc.mean(axis=0)) @ rise) > 0
        ends = np.abs(piece.rotation[:, :2] @ (arc[-1] - arc[0]))
        level = ends[1] < LEANS * max(float(ends[0]), float(ends[2]))
        turns = abs(_turn(piece.edges[k])) > RING
        if turns and above and (piece.part == "skirt" or (level and _beside(work, piece, k))):
            piece.ring = k


def _turn(edge: F64) -> float:
    """Degrees by which an edge (k, 2) turns from its start to its end."""
    d = np.diff(edge, axis=0)
    z = d[:, 0] + 1j * d[:, 1]
    return float(np.degrees(np.angle(z[1:] / z[:-1]).sum()))


def _inner(piece: Piece, k: int) -> int:
    """Of two arcs, one's circle within the other's, the inner one: of a sector wider than half a turn the middle of the
    hem may lie over the waist, and what it is sewn to under its own middle."""
    if abs(_turn(piece.edges[k])) <= RING:
        return k
    centre, radius = circle(piece.edges[k])
    for j, edge in enumerate(piece.edges):
        other, own = circle(edge)
        within = float(np.linalg.norm(other - centre)) + own < WITHIN * radius
        if abs(_turn(edge)) > RING and own < radius and within:
            k, radius = j, own
    return k


def _beside(work: Work, piece: Piece, k: int) -> bool:
    """Whether the edges next to one, and no others, are sewn to the body's other side: as those of a yoke are. Next to
    a neckline are shoulders, and below them the sides."""
    n = len(piece.edges)
    turned = {own.edge for own, other in work.pairs(piece.name) if work.pieces[other.panel].side != piece.side}
    return turned == {(k - 1) % n, (k + 1) % n}


def even_out(work: Work, rounds: int = 4) -> None:
    """Both sides of each seam grow by the same factor, the geometric mean of theirs: corners are moved by least squares
    on the edges, sewn ones first, and curves turn with their chords. Gathers keep their ratio."""
    for _ in range(rounds):
        wanted: dict[tuple[str, int], list[float]] = {}
        for seam in work.seams:
            sides = (seam.first, seam.second)
            if not all(work.pieces[side.panel].graded for side in sides):
                continue
            now = [length(work.pieces[s.panel].graded[s.edge]) for s in sides]
            drawn = [work.pieces[s.panel].edge_length(s.edge) for s in sides]
            if min(*now, *drawn) < 1e-6:
                continue
            mean = np.sqrt(now[0] * now[1] / (drawn[0] * drawn[1]))
            for side, own, old in zip(sides, now, drawn, strict=True):
                wanted.setdefault((side.panel, side.edge), []).append(float(mean * old / own))
        for piece in work.pieces.values():
            n = len(piece.graded)  # 0 of a sleeve that is not laid yet
            if not any((piece.name, k) in wanted for k in range(n)):
                continue
            start = np.array([edge[0] for edge in piece.graded])
            chord = np.array([edge[-1] - edge[0] for edge in piece.graded])
            factor = np.array([np.mean(wanted.get((piece.name, k), [1.0])) for k in range(n)])
            keeps = np.array([SEWN if (piece.name, k) in wanted else FREE for k in range(n)])
            keeps /= np.maximum(np.linalg.norm(chord, axis=1), 0.01)
            rows = np.zeros((n + 1, n))
            rows[np.arange(n), np.arange(n)] = -keeps
            rows[np.arange(n), (np.arange(n) + 1) % n] += keeps
            rows[n] = 1.0 / n
            right = np.vstack([(keeps * factor)[:, None] * chord, start.mean(axis=0)])
            corner = np.linalg.lstsq(rows, right, rcond=None)[0]
            evened = [turned_towards(edge, corner[k], corner[(k + 1) % n]) for k, edge in enumerate(piece.graded)]
            if not crosses(evened) or crosses(piece.graded):  # a narrow strap may turn over itself
                piece.graded = evened
