"""A sewing pattern: panels of flat cloth, the seams between their edges, and where each panel starts round the body.

Units: metres; y is up, x to the body's left, z to its front. A panel's own coordinates are those of the flat cloth,
right side towards the reader; the warp runs along `grain`, measured from +y towards +x.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = [
    "LARGEST_PANEL",
    "Bent",
    "Cone",
    "Course",
    "Flat",
    "Hold",
    "Panel",
    "Pattern",
    "Seam",
    "Side",
    "Wrap",
    "area",
    "crossing",
]

F64 = NDArray[np.float64]

LARGEST_PANEL = 10.0
"""How far any point of a panel may be from its own origin, and a panel from the body's [m]."""
MOST_POINTS = 5_000
"""Of a panel's outline: whether it crosses itself is asked of all pairs."""
ROWS = 256
"""Of such pairs at a time."""


@dataclass(frozen=True, eq=False)
class Flat:
    """A panel that starts as a plane: rotation (3, 3) of its (x, y, 0), then translation (3,) [m]."""

    rotation: F64
    translation: F64

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        return np.pad(xy, ((0, 0), (0, 1))) @ self.rotation.T + self.translation


@dataclass(frozen=True, eq=False)
class Bent:
    """A panel that starts as a plane, but for what is beyond a line, which is bent back square to it: trousers' forks,
    which lay across each other else.

    plane: of the rest. side: 1 or −1, of x that the line is on. line: side · x of the plane beyond which none of the
    panel is [m]. radius: of the bend [m].
    """

    plane: Flat
    side: float
    line: float
    radius: float

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        flat = self.line - self.radius
        beyond = np.maximum(self.side * xy[:, 0] - flat, 0.0)
        turn = np.minimum(beyond / self.radius, np.pi / 2)
        x = np.minimum(self.side * xy[:, 0], flat) + self.radius * np.sin(turn)
        back = self.radius * (1.0 - np.cos(turn)) + beyond - self.radius * turn
        placed = np.stack([self.side * x, xy[:, 1], -back], -1)
        return placed @ self.plane.rotation.T + self.plane.translation


@dataclass(frozen=True, eq=False)
class Wrap:
    """A panel that starts bent round an axis, lengths along x kept.

    origin: (3,) where the panel's y = 0 meets the axis [m]. axis, outward: (3,) unit, square to each other: the way of
    +y, and from the axis to the panel's x = `middle`. radius: (outward, sideways) semi-axes of the section [m].
    taper: relative growth of the section with y [1/m]. at: how far round the section the panel's x = `middle` is [m].
    top: the panel's y that lies at the origin [m].
    """

    origin: F64
    axis: F64
    outward: F64
    radius: tuple[float, float]
    middle: float = 0.0
    taper: float = 0.0
    at: float = 0.0
    top: float = 0.0

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        sideways = np.cross(self.axis, self.outward)
        a, b = self.radius
        angle = np.linspace(-np.pi, np.pi, 1441)
        ring = np.stack([a * np.cos(angle), b * np.sin(angle)], -1)
        walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
        y = xy[:, 1] - self.top
        scale = np.maximum(1.0 + self.taper * y, 0.05)
        reach = (xy[:, 0] - self.middle) / scale + walked[-1] / 2 + self.at
        if self.at:  # a panel that is one of several may reach past the seam at the back
            reach, beyond = reach % walked[-1], np.zeros(len(xy))
        else:
            beyond = reach - np.clip(reach, 0.0, walked[-1])  # wider than the ring: the rest hangs on straight
        turn = np.interp(reach, walked, angle)
        return (
            self.origin
            + y[:, None] * self.axis
            + (scale * (a * np.cos(turn)))[:, None] * self.outward
            + (scale * (b * np.sin(turn)))[:, None] * sideways
            + np.abs(beyond)[:, None] * -self.outward
        )


@dataclass(frozen=True, eq=False)
class Cone:
    """A ring sector round the vertical, its inner arc level round a waist, falling in folds.

    origin: (3,) middle of the waist [m]. outward: (3,) unit, level, from the axis to the sector's middle line.
    radius: (outward, sideways) semi-axes of the waist [m]. inner: radius of the inner arc [m]; its middle is at
    (0, 0) of the panel, the apex at (0, inner). angle: of the sector [rad]. share: of the whole turn that it covers.
    folds: round the whole turn. hang: how fast the cone widens, over how fast the cloth does; waves of
    r = R + w cos(folds · θ) take up the rest, of length 2πR (1 + (w folds / R)²/4) round the turn.
    """

    origin: F64
    outward: F64
    radius: tuple[float, float]
    inner: float
    angle: float
    share: float = 0.5
    folds: int = 8
    hang: float = 0.75

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        sideways = np.cross(np.array([0.0, 1.0, 0.0]), self.outward)
        down = np.hypot(xy[:, 0], self.inner - xy[:, 1]) - self.inner
        turn = np.arctan2(xy[:, 0], self.inner - xy[:, 1]) * 2 * np.pi * self.share / self.angle
        a, b = self.radius
        angle = np.linspace(-np.pi, np.pi, 1441)
        ring = np.stack([a * np.cos(angle), b * np.sin(angle)], -1)
        walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
        around = np.interp(turn, (walked / walked[-1] - 0.5) * 2 * np.pi, angle)
        whole = self.angle / (2 * np.pi * self.share)  # the cloth's girth grows by 2π of this with each length down
        slope = min(self.hang * whole, 0.9)
        wide, deep = down * slope, down * np.sqrt(1 - slope * slope)
        mean = (a + b) / 2 + np.maximum(wide, 0.0)
        spare = np.maximum(((a + b) / 2 + np.maximum(down, 0.0) * whole) / mean - 1, 0.0)
        wide = wide - 2 * mean / self.folds * np.sqrt(spare) * np.cos(self.folds * turn)
        return (
            self.origin
            + ((a + wide) * np.cos(around))[:, None] * self.outward
            + ((b + wide) * np.sin(around))[:, None] * sideways
            - deep[:, None] * np.array([0.0, 1.0, 0.0])
        )


@dataclass(frozen=True, eq=False)
class Course:
    """Where the points along one edge of a panel belong. flat: (n, 2) points close together along it; places: (n, 3)
    where each does [m]."""

    flat: F64
    places: F64

    def points(self, xy: F64) -> F64:
        """(m, 2) of the edge to (m, 3) of the world [m]."""
        return self.places[((xy[:, None] - self.flat[None]) ** 2).sum(axis=2).argmin(axis=1)]


@dataclass(frozen=True, eq=False)
class Panel:
    """edges: polylines (k, 2) [m], each from the end of the one before, closed. grain: of the warp [rad].
    hems: numbers of edges that are turned and hemmed. label: what part of the body it is on, where a file says so.
    marks: numbers of edges with the labels that a file gives them."""

    name: str
    edges: tuple[F64, ...]
    place: Flat | Bent | Wrap | Cone
    grain: float = 0.0
    hems: tuple[int, ...] = ()
    label: str = ""
    marks: tuple[tuple[int, str], ...] = ()

    @cached_property
    def outline(self) -> F64:
        """(n, 2) [m], each point once."""
        return np.concatenate([edge[:-1] for edge in self.edges])

    @cached_property
    def world(self) -> F64:
        """(n, 3) of the outline where the panel starts [m]."""
        return self.place.points(self.outline)

    @property
    def area(self) -> float:
        """[m²]"""
        return abs(area(self.outline))


@dataclass(frozen=True)
class Side:
    """One side of a seam: a panel by its name and one of its edges by its number."""

    panel: str
    edge: int


@dataclass(frozen=True)
class Seam:
    """Two edges sewn together over their whole lengths; unequal ones are gathered.

    alike: start meets start. None: whichever brings the ends nearer where the panels start.
    """

    first: Side
    second: Side
    alike: bool | None = None


@dataclass(frozen=True)
class Hold:
    """An edge that the body carries, as a waistband, where `place` has it (None: where its panel starts). Tops need
    none: they hang on the shoulders by friction.
    """

    side: Side
    place: Flat | Bent | Wrap | Cone | Course | None = None


@dataclass(frozen=True, eq=False)
class Pattern:
    """Raises InputError on what is none: panels that are open, tiny or cross themselves, seams without an edge.

    notes: what was changed of what a file says, one line each. drafted: None where panels stand as on a body; else
    their places tell only which way they face and their labels the part of the body, and these are measures [m] of whom
    they were drawn for, where they are known (`fit/lay_out.py`). hung: what is held while seams close, and no longer.
    """

    name: str
    panels: tuple[Panel, ...]
    seams: tuple[Seam, ...]
    holds: tuple[Hold, ...] = ()
    notes: tuple[str, ...] = ()
    drafted: dict[str, float] | None = None
    hung: tuple[Hold, ...] = ()

    def __post_init__(self) -> None:
        if not self.panels:
            raise InputError(f"pattern {self.name}: no panels; allowed: one or more")
        names = [panel.name for panel in self.panels]
        for panel in self.panels:
            _check_panel(self.name, panel)
            if names.count(panel.name) > 1:
                raise InputError(f"pattern {self.name}: two panels called {panel.name!r}; allowed: one of a name")
        known = dict(zip(names, self.panels, strict=True))
        for number, seam in enumerate(self.seams):
            for side in (seam.first, seam.second):
                if side.panel not in known:
                    hint = did_you_mean(side.panel, names)
                    raise InputError(f"pattern {self.name}: stitch {number}: no panel {side.panel!r}{hint}")
                if not 0 <= side.edge < len(known[side.panel].edges):
                    count = len(known[side.panel].edges)
                    where = f"pattern {self.name}: stitch {number}"
                    raise InputError(f"{where}: edge {side.edge} of {side.panel}; allowed: 0 to {count - 1}")
            if seam.first == seam.second:
                raise InputError(f"pattern {self.name}: stitch {number}: joins an edge of {seam.first.panel} to itself")

    def panel(self, name: str) -> Panel:
        return next(panel for panel in self.panels if panel.name == name)

    def edge(self, side: Side) -> F64:
        """Polyline (k, 2) [m] of one side of a seam."""
        return self.panel(side.panel).edges[side.edge]

    def is_alike(self, seam: Seam) -> bool:
        """Whether start meets start: as stated, or whichever brings both ends nearer where the panels start; panels
        whose outlines run the same way round meet end to start, which decides where that says nothing."""
        if seam.alike is not None:
            return seam.alike
        a, b = (self.panel(s.panel).place.points(self.edge(s)[[0, -1]]) for s in (seam.first, seam.second))
        together = float(np.linalg.norm(a - b, axis=1).sum())
        crossed = float(np.linalg.norm(a - b[::-1], axis=1).sum())
        return together < 0.98 * crossed

    def pairs(self, seam: Seam, count: int) -> tuple[F64, F64]:
        """`count` points (count, 2) along each side of a seam [m] that belong together."""
        share = np.linspace(0.0, 1.0, count)
        back = share if self.is_alike(seam) else 1.0 - share
        return along(self.edge(seam.first), share), along(self.edge(seam.second), back)

    def seam_length(self, seam: Seam) -> float:
        """Of the longer side [m]."""
        return max(length(self.edge(seam.first)), length(self.edge(seam.second)))

    def dart_width(self, seam: Seam) -> float:
        """What a dart takes out at its mouth [m]: where two edges of one panel that share an end are sewn together, the
        distance of their others; 0 of any other seam."""
        if seam.first.panel != seam.second.panel:
            return 0.0
        ends = self.edge(seam.first)[[0, -1]], self.edge(seam.second)[[0, -1]]
        apart = np.linalg.norm(ends[0][:, None] - ends[1][None], axis=2)
        return float(np.linalg.norm(ends[0][::-1] - ends[1], axis=1).max()) if apart.min() < 1e-4 else 0.0

    @property
    def points_for_darts(self) -> int:
        """Key points with which two cells lie across its narrowest dart, to 2 %, as many as can be drawn together; 0
        without darts."""
        widths = [width for seam in self.seams if (width := self.dart_width(seam))]
        return ceil(sum(panel.area for panel in self.panels) / (min(widths) / 2.05) ** 2) if widths else 0

    def scaled(self, width: float, height: float) -> "Pattern":
        """The pattern with every x times `width` and every y times `height`; starting places likewise."""
        factors = np.array([width, height])
        panels = []
        for panel in self.panels:
            place, by = panel.place, np.array([width, height, width])
            if isinstance(place, Flat):
                place = replace(place, translation=place.translation * by)
            elif isinstance(place, Bent):
                plane = replace(place.plane, translation=place.plane.translation * by)
                place = replace(place, plane=plane, line=place.line * width)
            else:
                place = replace(place, origin=place.origin * by)
            panels.append(replace(panel, edges=tuple(edge * factors for edge in panel.edges), place=place))
        return replace(self, panels=tuple(panels))


def area(p: F64) -> float:
    """Of a closed polygon (n, 2), each point once [m²]; below 0 where it runs clockwise."""
    return float(np.sum(p[:, 0] * np.roll(p[:, 1], -1) - np.roll(p[:, 0], -1) * p[:, 1])) / 2


def _check_panel(pattern: str, panel: Panel) -> None:
    where = f"pattern {pattern}: panel {panel.name}"
    if len(panel.edges) < 2 or any(len(edge) < 2 for edge in panel.edges):
        raise InputError(f"{where}: {len(panel.edges)} edges; allowed: two or more, of two points or more")
    if not all(np.isfinite(edge).all() for edge in panel.edges):
        raise InputError(f"{where}: coordinates that are not finite; allowed: finite numbers")
    count = sum(map(len, panel.edges))
    if count > MOST_POINTS:
        raise InputError(f"{where}: an outline of {count:,} points; allowed: up to {MOST_POINTS:,}")
    reach = max(float(np.abs(edge).max()) for edge in panel.edges)
    if reach > LARGEST_PANEL:
        raise InputError(
            f"{where}: reaches {reach:.3g} m; allowed: up to {LARGEST_PANEL:g} m; mend the unit of lengths"
        )
    size = float(np.ptp(panel.outline, axis=0).max())
    for k, edge in enumerate(panel.edges):
        if np.abs(edge[-1] - panel.edges[(k + 1) % len(panel.edges)][0]).max() > 1e-6 * max(size, 1e-6):
            raise InputError(f"{where}: edge {k} does not end where the next one starts; allowed: one closed loop")
    if panel.area < 1e-6:
        raise InputError(f"{where}: an area of {1e6 * panel.area:.3g} mm²; allowed: 1 mm² or more")
    crossed = crossing(panel.outline)
    if crossed is not None:
        x, y = crossed
        raise InputError(f"{where}: the outline crosses itself at ({x:.4g}, {y:.4g}) m; allowed: a simple loop")


def crossing(p: F64) -> Any:
    """A point where two edges of a closed polygon (n, 2) cross, or None. All pairs, some rows of them at a time."""
    q = np.roll(p, -1, axis=0)
    d = q - p
    n = len(p)

    def side(edge: slice, ends: F64) -> F64:
        """On which side of some edges points lie, (edges, points)."""
        a, along_ = p[edge, None], d[edge, None]
        return along_[..., 0] * (ends[None, :, 1] - a[..., 1]) - along_[..., 1] * (ends[None, :, 0] - a[..., 0])

    everything = slice(None)
    for first in range(0, n, ROWS):
        rows = slice(first, first + ROWS)
        s0, s1 = side(everything, p[rows]), side(everything, q[rows])
        i, j = np.nonzero((side(rows, p) * side(rows, q) < 0) & (s0 * s1 < 0).T)
        real = (np.abs(i + first - j) > 1) & (np.abs(i + first - j) < n - 1)
        if real.any():
            k = int(np.argmax(real))
            a, b = int(i[k]), int(j[k])
            t = s0[b, a] / (s0[b, a] - s1[b, a])
            return p[a + first] + t * d[a + first]
    return None
