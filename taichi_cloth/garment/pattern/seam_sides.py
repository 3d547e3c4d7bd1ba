"""Two sides of a seam, each one edge or several that follow each other, cut so that they meet pair by pair.

Notches say what meets what: where both sides have as many, counting the joints between their edges, they meet in their
order; else lengths are shared out evenly, as gathers and ease are.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from taichi_cloth.garment.pattern.outline import Outline
from taichi_cloth.ground.errors import InputError

__all__ = ["Span", "matched", "ordered"]

APART = 0.15
"""Of a side's length: notches that would have to move by more are not meant for each other."""
CLOSE = 2e-3
"""Between cuts that are one [m]."""


@dataclass(frozen=True)
class Span:
    """A part of a panel's outline, from one place along it to another [m]."""

    panel: str
    start: float
    end: float

    @property
    def long(self) -> float:
        return self.end - self.start


def ordered(spans: list[Span], outlines: dict[str, Outline], *, along: bool) -> list[Span]:
    """Spans in the order in which a side runs: along the outlines, or against them. Those of one panel may be listed
    either way. Raises InputError where they do not follow each other."""

    def follow(run: list[Span]) -> bool:
        for one, two in pairwise(run):
            if one.panel == two.panel:
                gap = (two.start - one.end) if along else (one.start - two.end)
                size = outlines[one.panel].size
                if abs((gap + size / 2) % size - size / 2) > CLOSE:
                    return False
        return True

    if follow(spans):
        return spans
    if len({span.panel for span in spans}) == 1 and follow(spans[::-1]):
        return spans[::-1]
    raise InputError("edges of one side do not follow each other; allowed: neighbours, in order along the seam")


def matched(
    first: list[Span], second: list[Span], outlines: dict[str, Outline]
) -> tuple[list[tuple[Span, Span]], str | None]:
    """Pairs of spans that are sewn together, and a line where notches do not fit. first runs along its outlines,
    second against them."""
    own, other = _Run(first, outlines, along=True), _Run(second, outlines, along=False)
    pairs, note = _pairs(own, other)
    at = np.array([0.0, *(a for a, _ in pairs), own.long])
    to = np.array([0.0, *(b for _, b in pairs), other.long])
    cuts = [(a, b) for a, b in pairs]
    cuts += [(a, float(np.interp(a, at, to))) for a in own.joints]
    cuts += [(float(np.interp(b, to, at)), b) for b in other.joints]
    kept: list[tuple[float, float]] = [(0.0, 0.0)]
    for a, b in sorted(cuts):
        if a - kept[-1][0] < CLOSE or b - kept[-1][1] < CLOSE:
            continue
        if a < own.long - CLOSE and b < other.long - CLOSE:
            kept.append((a, b))
    # A joint is a joint: what lies next to it is moved onto it, on either side.
    ends = [(own.at_joint(a), other.at_joint(b)) for a, b in kept] + [(own.long, other.long)]
    return [(own.part(a, c), other.part(b, d)) for (a, b), (c, d) in pairwise(ends)], note


class _Run:
    """One side as a length from 0 on [m]."""

    def __init__(self, spans: list[Span], outlines: dict[str, Outline], *, along: bool) -> None:
        self.spans, self.along = spans, along
        self.ends = np.concatenate([[0.0], np.cumsum([span.long for span in spans])])
        self.long = float(self.ends[-1])
        self.joints = [float(v) for v in self.ends[1:-1]]
        self.notches: list[float] = []
        for span, begin in zip(spans, self.ends[:-1], strict=True):
            outline = outlines[span.panel]
            for n in outline.notches:
                s = (n - span.start) % outline.size
                if CLOSE < s < span.long - CLOSE:
                    self.notches.append(float(begin + (s if along else span.long - s)))
        self.notches.sort()

    def marks(self) -> list[float]:
        """Notches and joints; a notch at a joint is one with it."""
        apart = [n for n in self.notches if all(abs(n - j) > CLOSE for j in self.joints)]
        return sorted([*apart, *self.joints])

    def at_joint(self, s: float) -> float:
        near = min(self.joints, key=lambda j: abs(j - s), default=s)
        return near if abs(near - s) < CLOSE else s

    def part(self, a: float, b: float) -> Span:
        """Between two lengths that no joint lies between."""
        k = int(np.clip(np.searchsorted(self.ends, (a + b) / 2) - 1, 0, len(self.spans) - 1))
        span, begin = self.spans[k], float(self.ends[k])
        if self.along:
            return Span(span.panel, span.start + a - begin, span.start + b - begin)
        return Span(span.panel, span.end - (b - begin), span.end - (a - begin))


def _pairs(own: _Run, other: _Run) -> tuple[list[tuple[float, float]], str | None]:
    """Lengths along both sides that meet, by notches, and a line where there are some that do not fit."""
    for a, b in ((own.marks(), other.marks()), (own.notches, other.notches)):
        if a and len(a) == len(b):
            apart = max(abs(x / own.long - y / other.long) for x, y in zip(a, b, strict=True))
            if apart < APART:
                return list(zip(a, b, strict=True)), None
    if not own.notches and not other.notches:
        return [], None
    names = " and ".join(sorted({span.panel for span in (*own.spans, *other.spans)}))
    return [], (
        f"seam of {names}: {len(own.notches)} and {len(other.notches)} notches do not pair: its length is shared evenly"
    )
