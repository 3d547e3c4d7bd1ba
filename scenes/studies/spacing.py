"""Key-point spacing: the same fabric on ever finer key points, each with the step that its springs allow."""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.solvers.verlet import Verlet

from ..measure.moved import rms, timed
from ..measure.study import Axis, Row, Study
from .solvers.cases import SIDE, case_of
from .swing import FRAME_RATE, LENGTH, swing

__all__ = ["STUDY", "rows"]

SWING = (4, 8, 16, 32, 64)  # cells along the sheet
HANG = (5, 10, 20, 40, 80)  # cells along a side
DEFAULT = 40
"""12.5 mm between key points: `hanging` has that, and `drape` 12.8 mm."""
HANG_SECONDS = 0.15
SWING_FRAMES = 20


def rows(quick: bool) -> Iterator[Row]:
    if not quick:
        yield from _swing_rows(SWING, 2)
    yield from _hang_rows(HANG[1:4] if quick else HANG, 2)


def _swing_rows(cells: tuple[int, ...], finer: int) -> Iterator[Row]:
    best, _ = swing(cells[-1] * finer)
    for n in cells:
        swing(n, frames=1)  # compiles
        begin = time.process_time()
        found, _ = swing(n)
        cost = (time.process_time() - begin) * FRAME_RATE / SWING_FRAMES
        off = np.sqrt(((found - best) ** 2).sum(-1).mean((1, 2))).max()
        yield _row("swing, soft", LENGTH / n, float(off), cost, False)


def _hang_rows(cells: tuple[int, ...], finer: int) -> Iterator[Row]:
    most = cells[-1] * finer
    best, _ = _hang(most)
    for n in cells:
        found, cost = _hang(n)
        off = rms(found[:: n // cells[0], :: n // cells[0]], best[:: most // cells[0], :: most // cells[0]])
        yield _row("hang, cotton", SIDE / n, off, cost, n == DEFAULT)


def _hang(cells: int) -> tuple[NDArray[np.float64], float]:
    case = case_of("hang", cells + 1)

    def make() -> Simulation:
        return Simulation(case.sheet, Verlet(case.sheet, case.forces), forces=case.forces, positions=case.start)

    simulation, cost = timed(make, HANG_SECONDS)
    return simulation.positions.astype(np.float64), cost


def _row(panel: str, spacing: float, error: float, cost: float, default: bool) -> Row:
    knob = f"{1e3 * spacing:.3g} mm"
    return Row(panel=panel, method="Verlet", knob=knob, value=spacing, error=error, seconds=cost, default=default)


STUDY = Study(
    name="spacing",
    title="Key-point spacing",
    about="One fabric on ever finer key points, each with the step that its springs allow. Swing: a soft sheet of "
    "0.4 m × 0.1 m that falls from 50° for 0.2 s; error: the largest over the frames, root mean square over ten key "
    "points that all sheets share. Hang: cotton shirting of 0.5 m × 0.5 m held at two corners, after 0.15 s; root mean "
    "square over 6 × 6 shared key points. Reference: half the finest spacing shown.",
    error=Axis("error, rms", "mm", 1e3),
    time=Axis("CPU time for a simulated second", "ms", 1e3),
    rows=rows,
    why={"hang, cotton: Verlet": "wider ones cannot make folds as narrow as this cloth's, which is seen"},
    claimed={"swing, soft: Verlet": 2.0},
)
