"""A panel while it is placed and graded: its edges in metres, where it stands, and what has been found out about it."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side, area, crossing

__all__ = ["ON_ARC", "UP", "Piece", "Work", "arc_of", "circle", "crosses", "pieces_of", "turned_towards"]

F64 = NDArray[np.float64]

UP = np.array([0.0, 1.0, 0.0])

FINE = 0.02
"""Longest straight part of an edge: where widths change with height it is graded into a curve [m]."""


ON_ARC = 0.05, 0.015
"""From an arc within which edges lie on it, in radii and [m]: tiers of wide skirts are lower than a share of theirs."""


@dataclass(eq=False)
class Piece:
    """edges: polylines (k, 2), the outline counter-clockwise, right side towards the reader. graded: the same, for the
    body. rotation, at: of the drawn edges; `lift` is added to heights. shift: of the graded ones. part: trunk, head,
    skirt, arm_l, arm_r, leg_l, leg_r. side: front, back, left, right. tube: goes round its part alone,
    sewn to itself. notches: both edges of each dart that opens to the side, in their order."""

    panel: Panel
    edges: list[F64]
    rotation: F64
    at: F64
    part: str = ""
    side: str = ""
    lift: float = 0.0
    graded: list[F64] = field(default_factory=list)
    shift: F64 = field(default_factory=lambda: np.zeros(3))
    ring: int | None = None
    tube: bool = False
    notches: tuple[tuple[int, int], ...] = ()

    @property
    def name(self) -> str:
        return self.panel.name

    @property
    def label(self) -> str:
        """What the file calls the panel: arm, leg, body or "" for what says nothing."""
        return self.panel.label if self.panel.label in ("arm", "leg", "body") else ""

    @property
    def normal(self) -> F64:
        """(3,) of the right side."""
        return self.rotation[:, 2]

    def world(self, edge: int | None = None) -> F64:
        """(n, 3) of the drawn outline or one edge as stacked [m]."""
        xy = np.concatenate([e[:-1] for e in self.edges]) if edge is None else self.edges[edge]
        return np.pad(xy, ((0, 0), (0, 1))) @ self.rotation.T + self.at + self.lift * UP

    def worn(self, edge: int | None = None) -> F64:
        """(n, 3) of the graded outline or one edge where it starts on the body [m]."""
        return self.standing(np.concatenate([e[:-1] for e in self.graded]) if edge is None else self.graded[edge])

    def standing(self, xy: F64) -> F64:
        """(n, 3) of points (n, 2) of the graded piece where they start [m]."""
        return np.pad(xy, ((0, 0), (0, 1))) @ self.rotation.T + self.shift

    def level(self, edge: int | None = None, *, worn: bool = False) -> F64:
        """(n,) heights at which the outline or one edge is worn [m]: those of the plane, but of a sector of a ring its
        ends' height and how far down the ring a point is. worn: of the graded edges."""
        edges, shift = (self.graded, self.shift) if worn else (self.edges, self.at + self.lift * UP)
        xy = np.concatenate([e[:-1] for e in edges]) if edge is None else edges[edge]
        if self.ring is None:
            return xy @ self.rotation[1, :2] + shift[1]
        arc = arc_of(edges, self.ring)
        centre, radius = circle(arc)
        ends = float((arc[[0, -1]] @ self.rotation[1, :2]).mean() + shift[1])
        return ends - (np.linalg.norm(xy - centre, axis=1) - radius)

    def is_end(self, edge: int) -> bool:
        """Whether an edge is one of the two ends of a sector of a ring, next to its inner arc."""
        n = len(self.edges)
        return self.ring is not None and edge in ((self.ring - 1) % n, (self.ring + 1) % n)

    def mark(self, edge: int) -> str:
        return dict(self.panel.marks).get(edge, "")

    def edge_length(self, edge: int) -> float:
        return length(self.edges[edge])


@dataclass(eq=False)
class Work:
    """A pattern while it is placed: its pieces by name and its seams."""

    pattern: Pattern
    pieces: dict[str, Piece]
    seams: tuple[Seam, ...]

    def pairs(self, name: str) -> list[tuple[Side, Side]]:
        """(own side, other side) of all seams of a panel with others."""
        both = [(s.first, s.second) for s in self.seams] + [(s.second, s.first) for s in self.seams]
        return [(own, other) for own, other in both if own.panel == name and other.panel != name]

    def joined(self) -> list[tuple[Side, Side]]:
        """Both sides of all seams between two panels."""
        return [(s.first, s.second) for s in self.seams if s.first.panel != s.second.panel]

    def sewn(self) -> set[tuple[str, int]]:
        """Panels and edges that a seam joins."""
        return {(side.panel, side.edge) for seam in self.seams for side in (seam.first, seam.second)}

    def at(self, side: Side) -> F64:
        """(k, 3) of one side of a seam as stacked [m]."""
        return self.pieces[side.panel].world(side.edge)

    def of(self, *parts: str) -> list[Piece]:
        return [piece for piece in self.pieces.values() if piece.part in parts]


def circle(arc: F64) -> tuple[F64, float]:
    """Centre (2,) and radius of the circle through the ends and the middle of an arc (k, 2) [m]."""
    a, b, c = (arc[k] for k in (0, len(arc) // 2, -1))
    rows = 2 * np.array([b - a, c - a])
    if abs(np.linalg.det(rows)) < 1e-9:
        return (a + c) / 2 + np.array([0.0, 1e3]), 1e3
    centre = np.linalg.solve(rows, np.array([b @ b - a @ a, c @ c - a @ a]))
    return centre, float(np.linalg.norm(a - centre))


def arc_of(edges: list[F64], k: int) -> F64:
    """(n, 2) of the arc that edge k is of, with what lies on the same circle before and after it: files cut an arc
    where what it is sewn to ends."""
    centre, radius = circle(edges[k])
    n = len(edges)

    def on_it(j: int) -> bool:
        away = np.linalg.norm(edges[j % n] - centre, axis=1) - radius
        return bool(np.abs(away).max() < min(ON_ARC[0] * radius, ON_ARC[1]))

    first = last = k
    while last - first < n - 2 and on_it(first - 1):
        first -= 1
    while last - first < n - 2 and on_it(last + 1):
        last += 1
    parts = [edges[j % n] for j in range(first, last + 1)]
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]])


def pieces_of(pattern: Pattern) -> Work:
    """Right sides out: of a file's panel the one from which its loop of edges runs counter-clockwise. Those that run
    clockwise are mirrored and turned half round, which moves none of their points. Which ends meet is settled before.
    """
    seams = tuple(Seam(s.first, s.second, pattern.is_alike(s)) for s in pattern.seams)
    pieces = {}
    for panel in pattern.panels:
        assert isinstance(panel.place, Flat)
        notches = _notches(panel, seams)
        edges, rotation = [_dense(edge) for edge in panel.edges], panel.place.rotation.copy()
        if area(panel.outline) < 0:
            edges = [edge * np.array([-1.0, 1.0]) for edge in edges]
            rotation = rotation @ np.diag([-1.0, 1.0, -1.0])
        pieces[panel.name] = Piece(panel, edges, rotation, panel.place.translation.copy(), notches=notches)
    return Work(pattern, pieces, seams)


def _notches(panel: Panel, seams: tuple[Seam, ...]) -> tuple[tuple[int, int], ...]:
    """Darts whose mouth is upright where the file has the panel."""
    assert isinstance(panel.place, Flat)
    out, n = [], len(panel.edges)
    for seam in seams:
        if not seam.first.panel == seam.second.panel == panel.name:
            continue
        a, b = seam.first.edge, seam.second.edge
        if (a + 1) % n != b:
            a, b = b, a
        mouth = panel.place.rotation[:, :2] @ (panel.edges[b][-1] - panel.edges[a][0])
        if (a + 1) % n == b and abs(mouth[1]) > np.hypot(mouth[0], mouth[2]):
            out.append((a, b))
    return tuple(out)


def _dense(edge: F64) -> F64:
    out = [edge[:1]]
    for a, b in pairwise(edge):
        n = max(1, int(np.ceil(np.linalg.norm(b - a) / FINE)))
        out.append(a + np.linspace(0, 1, n + 1)[1:, None] * (b - a))
    return np.concatenate(out)


def crosses(edges: list[F64]) -> bool:
    """Whether an outline crosses itself."""
    return crossing(np.concatenate([edge[:-1] for edge in edges])) is not None


def turned_towards(edge: F64, start: F64, end: F64) -> F64:
    """An edge (k, 2), turned and scaled with its chord so that it goes from `start` to `end` (2,)."""
    old, new = complex(*(edge[-1] - edge[0])), complex(*(end - start))
    turn = new / old if abs(old) > 1e-9 else 1.0
    z = ((edge[:, 0] - edge[0, 0]) + 1j * (edge[:, 1] - edge[0, 1])) * turn
    out = np.stack([z.real, z.imag], -1) + start
    out[0], out[-1] = start, end
    return out
