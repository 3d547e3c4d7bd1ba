"""Where whole yarns become cheaper than Verlet: cost at equal error against how much stiffer threads are than shear."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, log, nan

from .cases import CASES, Case, Judged, case_of, judged, motion_error
from .reference import reference
from .settings import Setting, verlet, yarns

__all__ = ["NAMES", "Cost", "costs", "crossing"]

RATIOS = (3.0, 10.0, 30.0, 100.0, 300.0)
SIZES = (24, 48, 80)
QUICK = ((3.0, 30.0, 300.0), (24,))
"""Ratios and sizes."""

NEAR = 5e-4
"""Error of mean height [m] that each solver is to keep: a thousandth of the sheet's side."""

NAMES = ("Verlet", "whole yarns")
CASE = "hang"
FINER = (None, 80, 160)
"""Substeps of whole yarns that are tried, until one keeps the error; Verlet takes its longest stable step."""

RUNS = 3


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Of `solver` on points × points key points whose threads are `ratio` times as stiff as their shear: substeps a
    frame of the cheapest setting that keeps the error [m], and its CPU time [s] a frame, the least of a few runs; nan
    where none does."""

    solver: str
    points: int
    ratio: float
    substeps: int
    error: float
    seconds: float


def costs(quick: bool) -> Iterator[Cost]:
    ratios, sizes = QUICK if quick else (RATIOS, SIZES)
    for points in sizes:
        for ratio in ratios:
            case = case_of(CASE, points, ratio=ratio)
            frames = CASES[CASE]
            best = judged(case.sheet, reference(case.sheet, case.forces, case.start, case.seconds, frames=frames)[0])
            for name, tried in zip(NAMES, ([verlet(case)], [yarns(case, count) for count in FINER]), strict=True):
                near = (_run(case, setting, best) for setting in tried)
                count, error, seconds = next((one for one in near if one[1] <= NEAR), (0, nan, nan))
                yield Cost(solver=name, points=points, ratio=ratio, substeps=count, error=error, seconds=seconds)


def _run(case: Case, setting: Setting, best: Judged) -> tuple[int, float, float]:
    """Substeps, error [m], and CPU time [s] a frame."""
    course, seconds = setting.tried()
    error = nan if course is None else motion_error(judged(case.sheet, course), best)
    if course is not None:
        seconds = min(seconds, *(setting.tried()[1] for _ in range(RUNS - 1)))
    return setting.substeps, error, seconds * case.seconds / CASES[CASE]


def crossing(found: list[Cost], points: int) -> float:
    """Ratio from which on whole yarns are cheaper, between two that were measured; nan where it is not among them."""
    by = {(one.solver, one.ratio): one.seconds for one in found if one.points == points}
    ratios = sorted({ratio for _, ratio in by})
    over = [log(by[NAMES[0], ratio] / by[NAMES[1], ratio]) for ratio in ratios]
    for k in range(len(ratios) - 1):
        if isfinite(over[k] + over[k + 1]) and over[k] <= 0 < over[k + 1]:
            share = over[k] / (over[k] - over[k + 1])
            return ratios[k] * (ratios[k + 1] / ratios[k]) ** share
    return nan
