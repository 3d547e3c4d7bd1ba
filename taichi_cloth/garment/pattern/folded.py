"""A ring sector that falls from a waist in folds with its lengths kept, round and down: circle skirts and their tiers.

Of a full circle the hem is several times as long as a cone that hangs as steeply has room for. A `Cone` is right to
the second order of its waves, which is enough of a flared skirt; a full circle starts stretched and squeezed by a half,
and what springs back out of that crumples. Here waves are as high as it takes for each level to be as long as the
cloth is there, points lie along them by length, and how far down each lies follows from how far out it came.

The two ends of a sector that is nearly a whole ring lie side by side in the flat, nearer than two key points may be, so
that both would be cut from the same ones. Such a sector is cut in two along its middle.

A godet starts as a fin: folded along its middle and square to the panel that it is let into, its two sides at the slit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.pattern import Cone, Flat, Hold, Panel, Pattern, Seam, Side

__all__ = ["Fin", "Folded", "halved"]

F64 = NDArray[np.float64]

STEEPEST = 0.6
"""How fast the mean of the folds goes out with each length down, at most."""
DEEP = 1.0
"""Of the table of a sector that is no tier [m]."""
LEVELS, ROUND = 48, 721
"""Of the table of places, down and round."""
LEAST = 0.15
"""How far down a piece goes with each length of its own, at least: near a full circle's waist folds cannot begin as
fast as cloth is added there."""

WIDEST = np.radians(300.0)
"""Of a sector in one piece [rad]."""
NEAR = 0.1
"""Of a sector's inner arc, from its middle to a joint of two edges, up to which it is cut there."""


@dataclass(frozen=True, eq=False)
class Folded(Cone):
    """As `Cone`. begins: how far down the skirt the sector's arc is [m]. profile: (k, 2) how far down, and how long the
    cloth is there round the whole turn [m], of the skirt that the sector is a tier of; empty: of the sector alone."""

    begins: float = 0.0
    profile: F64 = field(default_factory=lambda: np.zeros((0, 2)))

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        down = np.hypot(xy[:, 0], self.inner - xy[:, 1]) - self.inner
        turn = np.arctan2(xy[:, 0], self.inner - xy[:, 1]) * self.share / self.angle
        table, deep = self._table, self.begins + down
        at = table(np.stack([np.clip(deep, 0.0, table.grid[0][-1]), np.clip(turn, -0.5, 0.5)], -1))
        at[:, 2] += deep - np.clip(deep, 0.0, table.grid[0][-1])
        sideways = np.cross(np.array([0.0, 1.0, 0.0]), self.outward)
        up = np.array([0.0, 1.0, 0.0])
        return self.origin + at[:, :1] * self.outward + at[:, 1:2] * sideways - at[:, 2:] * up

    def hanging(self, xy: F64) -> F64:
        """(n,) heights of points (n, 2) of the panel where the whole skirt hangs straight down [m]."""
        return self.origin[1] - self.begins - np.hypot(xy[:, 0], self.inner - xy[:, 1]) + self.inner

    @cached_property
    def _table(self) -> RegularGridInterpolator:
        """Out, aside and down [m] of how far down the cloth, and of a share of the turn."""
        whole = self.angle / self.share
        alone = np.array([[0.0, self.inner * whole], [DEEP, (self.inner + DEEP) * whole]])
        given = self.profile if len(self.profile) else alone
        d = np.linspace(0.0, float(given[-1, 0]), LEVELS)
        a, b = self.radius
        angle = np.linspace(-np.pi, np.pi, ROUND)
        first = _walked(np.stack([a * np.cos(angle), b * np.sin(angle)], -1))
        long = np.interp(d, given[:, 0], given[:, 1])
        growth = np.gradient(long, d)
        slope = np.minimum(self.hang * growth / (2 * np.pi), STEEPEST)
        wide = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(d))])
        wide = np.clip((long - long[0]) / (2 * np.pi), 0.0, wide)
        long = np.maximum(long - long[0] + first[-1], first[-1])
        wave = np.cos(self.folds * 2 * np.pi * (first / first[-1] - 0.5))
        turn = np.linspace(0.0, 1.0, ROUND)
        places = np.zeros((LEVELS, ROUND, 3))

        def ring(k: int, high: float) -> F64:
            """(ROUND, 3) of a level whose waves are so high, points at equal lengths."""
            out = wide[k] - high * wave
            line = np.stack([(a + out) * np.cos(angle), (b + out) * np.sin(angle)], -1)
            walked = _walked(line)
            now, deep = _at_shares(line, walked), np.zeros(ROUND)
            for _ in range(2 if k else 0):  # how far down points lie adds to their lengths, too
                now, share = _at_shares(line, walked), walked / walked[-1]
                step = d[k] - d[k - 1]
                gone = ((now - places[k - 1, :, :2]) ** 2).sum(axis=1)
                deep = places[k - 1, :, 2] + np.sqrt(np.maximum(step**2 - gone, (LEAST * step) ** 2))
                walked = _walked(np.column_stack([line, np.interp(share, turn, deep)]))
            return np.column_stack([now, deep])

        for k in range(LEVELS):
            low, high = 0.0, (a + b) / 2 + wide[k]
            for _ in range(18):  # the higher the longer
                middle = (low + high) / 2
                low, high = (middle, high) if _walked(ring(k, middle))[-1] < long[k] else (low, middle)
            places[k] = ring(k, low)
        return RegularGridInterpolator((d, turn - 0.5), places)


def _at_shares(line: F64, walked: F64) -> F64:
    """(ROUND, 2) at equal parts of the lengths that were walked along a line (n, 2)."""
    at = np.linspace(0.0, walked[-1], ROUND)
    return np.stack([np.interp(at, walked, line[:, c]) for c in (0, 1)], -1)


def _walked(line: F64) -> F64:
    """(n,) lengths along a line (n, 2 or 3) from its start."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def halved(pattern: Pattern) -> Pattern:
    """The same with each sector wider than WIDEST cut in two along its middle, where a seam joins both: the second half
    of `skirt` is `skirt_half`. What its arcs are sewn to is cut there, too."""
    for panel in pattern.panels:
        if isinstance(panel.place, Folded) and panel.place.angle > WIDEST:
            pattern = _in_two(pattern, panel.name, panel.place)
    return pattern


def _in_two(pattern: Pattern, name: str, place: Folded) -> Pattern:
    middle = list[F64]()  # where it is cut, on the inner arc and on the outer one
    for which in (min, max):
        panel = pattern.panel(name)
        away, edge, share = which(_on_the_middle(panel, place.inner))
        long, reach = length(panel.edges[edge]), NEAR * place.inner * place.angle * away / place.inner
        if share * long > reach and (1 - share) * long > reach:
            pattern = _with_joint(pattern, Side(name, edge), share)
            edge, share = edge + 1, 0.0
        edges = pattern.panel(name).edges
        middle.append(edges[(edge + round(share)) % len(edges)][0])
    panel = pattern.panel(name)
    n = len(panel.edges)
    start = np.array([edge[0] for edge in panel.edges])
    first, last = (int(np.argmin(np.linalg.norm(start - point, axis=1))) for point in middle)
    two, panels, to = f"{name}_half", list[Panel](), dict[Side, Side]()
    for own, begin, end in ((name, first, last), (two, last, first)):
        kept = [(begin + k) % n for k in range((end - begin) % n)]
        at = {k: number for number, k in enumerate(kept)}
        to |= {Side(name, k): Side(own, number) for k, number in at.items()}
        edges = (*(panel.edges[k] for k in kept), np.array([start[end], start[begin]]))
        hems = tuple(at[k] for k in panel.hems if k in at)
        marks = tuple((at[k], mark) for k, mark in panel.marks if k in at)
        panels.append(replace(panel, name=own, edges=edges, hems=hems, marks=marks))

    def moved(side: Side) -> Side:
        return to.get(side, side)

    seams = [replace(seam, first=moved(seam.first), second=moved(seam.second)) for seam in pattern.seams]
    cut = Seam(*(Side(one.name, len(one.edges) - 1) for one in panels), alike=False)
    others = [(one,) if one.name != name else tuple(panels) for one in pattern.panels]
    return replace(
        pattern,
        panels=tuple(one for pair in others for one in pair),
        seams=(*seams, cut),
        holds=tuple(replace(hold, side=moved(hold.side)) for hold in pattern.holds),
        hung=tuple(replace(hold, side=moved(hold.side)) for hold in pattern.hung),
    )


def _on_the_middle(panel: Panel, inner: float) -> Iterator[tuple[float, int, float]]:
    """Where a sector's outline crosses its middle line: how far from the centre [m], the edge, and the share of its
    length up to there."""
    for number, edge in enumerate(panel.edges):
        x = edge[:, 0]
        for k in np.flatnonzero((x[:-1] > 0) != (x[1:] > 0)):
            point = edge[k] + x[k] / (x[k] - x[k + 1]) * (edge[k + 1] - edge[k])
            if point[1] < inner:
                upto = length(np.concatenate([edge[: k + 1], point[None]]))
                yield float(inner - point[1]), number, upto / length(edge)


def _with_joint(pattern: Pattern, side: Side, share: float) -> Pattern:
    """The same with an edge cut in two at a share of its length, and all that it is sewn to."""
    at = {side: share}
    for seam in pattern.seams:
        if side in (seam.first, seam.second):
            other = seam.second if seam.first == side else seam.first
            at[other] = share if pattern.is_alike(seam) else 1 - share

    def parts(old: Side) -> list[Side]:
        edge = old.edge + sum(one.panel == old.panel and one.edge < old.edge for one in at)
        return [Side(old.panel, edge + k) for k in range(1 + (old in at))]

    def of(panel: Panel) -> Panel:
        edges = list[F64]()
        for k, edge in enumerate(panel.edges):
            cut = at.get(Side(panel.name, k))
            edges += [edge] if cut is None else _cut(edge, cut)
        hems = tuple(one.edge for k in panel.hems for one in parts(Side(panel.name, k)))
        marks = tuple((one.edge, mark) for k, mark in panel.marks for one in parts(Side(panel.name, k)))
        return replace(panel, edges=tuple(edges), hems=hems, marks=marks)

    seams = list[Seam]()
    for seam in pattern.seams:
        alike = pattern.is_alike(seam)
        one, other = parts(seam.first), parts(seam.second)[:: 1 if alike else -1]
        seams += [Seam(a, b, alike) for a, b in zip(one, other, strict=True)]
    holds, hung = ([Hold(one, hold.place) for hold in held for one in parts(hold.side)]
                   for held in (pattern.holds, pattern.hung))  # fmt: skip
    return replace(
        pattern,
        panels=tuple(of(panel) for panel in pattern.panels),
        seams=tuple(seams),
        holds=tuple(holds),
        hung=tuple(hung),
    )


def _cut(edge: F64, share: float) -> list[F64]:
    long = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge, axis=0), axis=1))])
    to = share * long[-1]
    k = int(np.searchsorted(long, to))
    point = np.array([[np.interp(to, long, edge[:, axis]) for axis in (0, 1)]])
    return [np.concatenate([edge[:k], point]), np.concatenate([point, edge[k if long[k] > to else k + 1 :]])]


@dataclass(frozen=True, eq=False)
class Fin(Flat):
    """A wedge folded along its middle, right side out, that stands square to its own plane: there as a plane it would
    lie across what it is let into, and across the next one.

    apex: (2,) of the wedge [m]. middle: (2,) unit, from there along the fold. half: angle from that to either side
    [rad]. fall: (3,) unit, the way of the slit in the world, in the plane. ajar: angle of its sides to that, less than
    `half` [rad]. Rotation and translation: as of the plane.
    """

    apex: F64
    middle: F64
    half: float
    fall: F64
    ajar: float

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]: either half a plane, through its side and the fold."""
        off, square = xy - self.apex, np.array([-self.middle[1], self.middle[0]])
        far = np.linalg.norm(off, axis=1)
        turn = np.arctan2(off @ square, off @ self.middle)
        outward = self.rotation[:, 2] - (self.rotation[:, 2] @ self.fall) * self.fall
        outward /= np.linalg.norm(outward)
        sideways = np.cross(outward, self.fall)
        sideways *= np.sign(sideways @ self.rotation[:, :2] @ square)
        out = np.arccos(np.cos(self.half) / np.cos(self.ajar))  # of the fold, which is `half` from both sides
        fold = np.cos(out) * self.fall + np.sin(out) * outward
        side = np.cos(self.ajar) * self.fall + np.sin(self.ajar) * np.sign(turn)[:, None] * sideways
        to_side, to_fold = (np.sin(angle)[:, None] for angle in (np.abs(turn), self.half - np.abs(turn)))
        way = (to_fold * fold + to_side * side) / np.sin(self.half)
        return super().points(self.apex[None]) + far[:, None] * way
