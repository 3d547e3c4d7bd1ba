"""A closed outline cut into edges at its corners, with notches along it; halves that are drawn once, unfolded.

Places along an outline are lengths from its first point, counter-clockwise [m].
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.pattern import area
from taichi_cloth.ground.errors import InputError

__all__ = ["Outline", "between", "closed", "lengths", "unfolded"]

F64 = NDArray[np.float64]

SAME = 1e-6
"""Between points that are one [m]."""
JOINED = 5e-4
"""Between ends of lines that follow each other [m]."""
ON = 2e-3
"""From the outline, of a point that is meant to lie on it [m]."""
NEAR = 0.03
"""Of a notch from the outline, which is the sew line where notches stand at the cut [m]."""
CORNER = np.radians(30)
"""Where a file has no turn points, an outline that turns by more has a corner [rad]."""
SMOOTH = np.radians(12)
"""By which an edge may turn where it is unfolded and still be one edge [rad]."""
MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Outline:
    """loop: (n, 2) counter-clockwise, each point once [m]. corners: rising places of where edges begin. notches: rising
    places."""

    loop: F64
    corners: tuple[float, ...]
    notches: tuple[float, ...] = ()

    @staticmethod
    def of(loop: F64, turns: list[F64], notches: list[F64]) -> "Outline":
        """From a closed polyline (n, 2), either way round, and points of its corners and notches. Raises InputError."""
        loop = _simple(loop)
        if len(loop) > MOST_POINTS:
            raise InputError(f"an outline of {len(loop):,} points; allowed: up to {MOST_POINTS:,}")
        if len(loop) < 3 or abs(area(loop)) < 1e-6:
            raise InputError(f"an outline of {1e6 * abs(area(loop)):.3g} mm²; allowed: 1 mm² or more")
        if area(loop) < 0:
            loop = np.concatenate([loop[:1], loop[:0:-1]])
        on = [place for p in turns for place, off in [_place(loop, p, snap=ON)] if off < ON]
        if len(on) < 2:
            on = _turning(loop)
        marks = sorted(place for p in notches for place, off in [_place(loop, p)] if off < NEAR)
        return Outline(loop, tuple(_distinct(on, ON)), tuple(_distinct(marks, ON)))

    @property
    def size(self) -> float:
        """Length all round [m]."""
        return float(lengths(self.loop)[-1])

    def edges(self) -> list[F64]:
        """Polylines, each from the end of the one before."""
        return [between(self.loop, a, b) for a, b in self.spans()]

    def spans(self) -> list[tuple[float, float]]:
        """(from, to) of each edge; the last one ends beyond the whole length, where the first begins."""
        return list(pairwise([*self.corners, self.corners[0] + self.size]))

    def marks(self, edge: int) -> list[float]:
        """Lengths along an edge at which its notches are, its ends apart [m]."""
        a, b = self.spans()[edge]
        on = [(n - a) % self.size for n in self.notches]
        return sorted(s for s in on if ON < s < b - a - ON)


def lengths(loop: F64) -> F64:
    """(n + 1,) places of the points of a closed polyline, and its whole length."""
    steps = np.linalg.norm(np.diff(np.vstack([loop, loop[:1]]), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def between(loop: F64, a: float, b: float) -> F64:
    """(k, 2) along a closed polyline from one place to another; b may lie up to one length beyond the end."""
    once = lengths(loop)
    whole = float(once[-1])
    at = np.concatenate([once[:-1], once[:-1] + whole, once[:1] + 2 * whole])
    points = np.vstack([loop, loop, loop[:1]])
    inner = np.nonzero((at > a + SAME) & (at < b - SAME))[0]
    ends = [np.array([np.interp(s, at, points[:, k]) for k in (0, 1)]) for s in (a, b)]
    return np.vstack([ends[0][None], points[inner], ends[1][None]])


def closed(lines: list[F64]) -> F64 | None:
    """The longest closed loop (n, 2) that polylines make, end to end; None: there is none."""
    left, loops = [line for line in lines if len(line) > 1], []
    while left:
        chain = left.pop(0)
        grown = True
        while grown and np.linalg.norm(chain[0] - chain[-1]) > JOINED:
            grown = False
            for k, line in enumerate(left):
                if np.linalg.norm(line[0] - chain[-1]) < JOINED or np.linalg.norm(line[-1] - chain[-1]) < JOINED:
                    line = line if np.linalg.norm(line[0] - chain[-1]) < JOINED else line[::-1]
                    chain, grown = np.vstack([chain, line[1:]]), True
                    left.pop(k)
                    break
        if len(chain) > 3 and np.linalg.norm(chain[0] - chain[-1]) <= JOINED:
            loops.append(chain[:-1])
    return max(loops, key=lambda loop: abs(area(loop)), default=None)


def unfolded(half: Outline, fold: F64) -> Outline:
    """A piece of which half is drawn, up to its mirror line (2, 2). Raises InputError where no edge lies on that."""
    way = (fold[1] - fold[0]) / max(float(np.linalg.norm(fold[1] - fold[0])), 1e-12)
    across = np.array([-way[1], way[0]])
    off = np.abs((half.loop - fold[0]) @ across)
    on = np.nonzero(off < ON)[0]
    if len(on) < 2:
        raise InputError("no edge of the outline lies on its mirror line; allowed: a half, drawn up to it")
    at, whole = lengths(half.loop)[:-1], half.size
    gaps = [(at[on[(k + 1) % len(on)]] - at[on[k]]) % whole for k in range(len(on))]
    k = int(np.argmax(gaps))  # the way round between two points of the fold is the half itself
    first, last = float(at[on[k]]), float(at[on[k]] + gaps[k])
    own = between(half.loop, first, last)
    mirrored = own - 2 * np.outer((own - fold[0]) @ across, across)
    loop = np.vstack([own, mirrored[-2:0:-1]])
    size = last - first
    marks = [(n - first) % whole for n in half.notches]
    marks = [n for n in marks if n < size + ON]
    corners = [c for c in ((c - first) % whole for c in half.corners) if ON < c < size - ON]
    ends = [0.0] if _turn(mirrored[1], own[0], own[1]) > SMOOTH else []
    ends += [size] if _turn(own[-2], own[-1], mirrored[-2]) > SMOOTH else []
    both = [*corners, *(2 * size - c for c in corners), *ends]
    if area(loop) < 0:  # not met: the half keeps its way round
        raise InputError("a mirror line that the outline crosses; allowed: a half, drawn up to it")
    notches = _distinct([n % (2 * size) for m in marks for n in (m, 2 * size - m)], ON)
    return Outline(loop, tuple(_distinct(both, ON)), tuple(notches))


def _simple(loop: F64) -> F64:
    """Without points that repeat the one before."""
    keep = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1) > SAME
    return loop[keep]


def _place(loop: F64, point: F64, snap: float = 0.0) -> tuple[float, float]:
    """Of the point of a closed polyline nearest to another, and how far off that is [m]. snap: how near a point of the
    polyline itself is it, as a corner is one of them."""
    at = lengths(loop)
    to = np.linalg.norm(loop - point, axis=1)
    k = int(to.argmin())
    if to[k] < snap:
        return float(at[k]), float(to[k])
    d = np.roll(loop, -1, axis=0) - loop
    t = np.clip(((point - loop) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-18), 0.0, 1.0)
    off = np.linalg.norm(loop + t[:, None] * d - point, axis=1)
    k = int(off.argmin())
    return float((at[k] + t[k] * np.linalg.norm(d[k])) % at[-1]), float(off[k])


def _turning(loop: F64) -> list[float]:
    """Places at which an outline has corners; two where it has none, so that it has edges."""
    at = lengths(loop)
    turn = [_turn(loop[k - 1], loop[k], loop[(k + 1) % len(loop)]) for k in range(len(loop))]
    found = [float(at[k]) for k in range(len(loop)) if turn[k] > CORNER]
    return found if len(found) > 1 else [0.0, float(at[len(loop) // 2])]


def _turn(before: F64, here: F64, after: F64) -> float:
    """By how much a polyline turns at a point [rad]."""
    a, b = here - before, after - here
    return abs(float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def _distinct(places: list[float], apart: float) -> list[float]:
    """In rising order, without those that repeat the one before."""
    out: list[float] = []
    for place in sorted(places):
        if not out or place - out[-1] > apart:
            out.append(place)
    return out
