"""A study as data: what was tried, how far off it was, and how long it took.

Every number that makes the program approximate has a knob; a study turns one or more knobs and measures. The rows are
all there is of a study: diagram, table, orders and where the default stands follow from them (`diagram`, `page`).
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite, log2, nan
from statistics import median

__all__ = ["Axis", "Row", "Study", "cpu_seconds", "lines_of", "microseconds", "orders", "standing_of"]

SHORTEST = 5e-3
"""Time [s] of work below which the clock is too coarse."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One run. panel: the diagram it belongs to. method: its line there. knob: its setting, in words. value: the
    setting as a number that is smaller the finer it is; nan where it has none. error: in the study's unit in SI, 0
    where the method is exact. seconds: CPU time. default: whether a built-in scene stands there, or one that says
    nothing."""

    panel: str
    method: str
    knob: str
    error: float
    seconds: float
    value: float = nan
    default: bool = False


@dataclass(frozen=True)
class Axis:
    """What an axis shows: words, unit, and units in one SI unit."""

    words: str
    unit: str
    scale: float

    @property
    def label(self) -> str:
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    def text(self, value: float) -> str:
        number = self.scale * value
        return (f"{number:,.0f}" if number >= 1000 else f"{number:.3g}") + (f" {self.unit}" if self.unit else "")


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study and what has to be said of it.

    about: what is measured, and the reference. claimed: the order of a method in its knob's number, by "panel: method"
    or by method. why: what speaks for a default that is not the knee, by the same. floor: rows of this method are no
    method but the reference against itself: a level, not a line.
    rows: measures, quickly or in full, a row at a time; Taichi has been started.
    """

    name: str
    title: str
    about: str
    error: Axis
    time: Axis
    rows: Callable[[bool], Iterator[Row]]
    claimed: Mapping[str, float] = field(default_factory=dict)
    why: Mapping[str, str] = field(default_factory=dict)
    floor: str = "reference"


def microseconds(seconds: float) -> str:
    """As a knob's words, with three digits."""
    return f"{float(f'{1e6 * seconds:.3g}'):g} µs"


def cpu_seconds(work: Callable[[], object], runs: int = 5) -> float:
    """Median CPU time [s] of all threads of this process, after a first run that compiles and warms. What takes less
    than SHORTEST is done several times in each run."""
    work()
    begin = time.process_time()
    work()
    times = [time.process_time() - begin]
    batch = max(1, round(SHORTEST / max(times[0], 1e-7)))
    for _ in range(runs if batch > 1 else runs - 1):
        begin = time.process_time()
        for _ in range(batch):
            work()
        times.append((time.process_time() - begin) / batch)
    return median(times)


def lines_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows by panel and method, in the order in which these first came; in each, from the coarsest on."""
    out: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        out.setdefault((row.panel, row.method), []).append(row)
    for line in out.values():
        if all(isfinite(row.value) for row in line):
            line.sort(key=lambda row: -row.value)
    return out


def orders(line: Sequence[Row]) -> list[float]:
    """log(error ratio) / log(ratio of the knob's numbers) between neighbours of a line; empty without numbers."""
    out = []
    for one, two in pairwise(line):
        if one.error > 0 and two.error > 0 and one.value > two.value > 0:
            out.append(log2(one.error / two.error) / log2(one.value / two.value))
    return out


def standing_of(study: Study, rows: Sequence[Row]) -> list[str]:
    """Of each default, a sentence: what it costs, what a neighbour on its line would, and where its knee is: the
    setting with the least error × time, from which a finer one buys less accuracy than it costs time."""
    out = []
    for (panel, method), line in lines_of(rows).items():
        at = f"{panel}, {method}: the default,"
        out += [
            f"{at} {row.knob}, is as good as the reference, in {study.time.text(row.seconds)}."
            for row in line
            if row.default and row.error == 0
        ]
        known = [r for r in line if isfinite(r.error) and isfinite(r.seconds) and r.error > 0 and r.seconds > 0]
        for k, row in enumerate(known):
            if not row.default:
                continue
            words = f"{at} {row.knob}, is off by {study.error.text(row.error)}"
            words += f" in {study.time.text(row.seconds)}"
            for there, what in ((k - 1, "coarser"), (k + 1, "finer")):
                if 0 <= there < len(known):
                    other = known[there]
                    words += (
                        f"; {what}, {other.knob}: error × {other.error / row.error:.2g}"
                        f" for time × {other.seconds / row.seconds:.2g}"
                    )
            best = min(known, key=lambda r: r.error * r.seconds)
            words += "; it is the knee" if best is row else f"; the knee is {best.knob}"
            reason = study.why.get(f"{panel}: {method}", study.why.get(method, ""))
            out.append(words + (f", but {reason}." if reason and best is not row else "."))
    return out
