"""What cloth has beside springs (friction of bending and shear, torsion, locking): what a frame costs with all of it,
without each, and without any; and how far off the motion is then.

All runs of a solver are moved a few frames each in turn, so that what else the machine does falls on each alike. The
first of these is not timed: solvers that share a kernel fill its memory anew.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import median
from time import process_time

import numpy as np

from taichi_cloth.mechanics.presets import WITHIN
from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

from ...measure.study import Row
from .cases import CASES, F64, FRAME_RATE, case_of, judged, motion_error

__all__ = ["ALL", "NONE", "rows"]

CASE = "hang"
POINTS, FEW = 48, 12
"""Key points along each side, in full and quickly."""

SOLVERS: dict[str, type[KernelSolver]] = {"whole yarns": Yarns, "Verlet": Verlet}
ALL, NONE = "all of it", "springs alone"
TURN = 6
"""Frames of a run before that of the next."""

FLOAT32 = 1.5e-8
"""By how much the start of a run is off [m] that tells how sure the others are."""

FLOOR = "reference"


@dataclass(eq=False)
class _Run:
    """simulation: of the sheet. course: what its key points went through [m]. times: CPU time of frames [s]."""

    simulation: Simulation
    course: list[F64] = field(default_factory=list)
    times: list[float] = field(default_factory=list)

    def step(self, timed: bool) -> None:
        begun = process_time()
        self.simulation.step()
        if timed:
            self.times.append(process_time() - begun)
        self.course.append(self.simulation.positions.astype(np.float64))

    @property
    def substeps(self) -> int:
        solver = self.simulation.solver
        assert isinstance(solver, KernelSolver)
        return solver.substeps


def rows(quick: bool) -> Iterator[Row]:
    """Solver by solver; quickly of whole yarns alone, which are what a scene gets."""
    points = FEW if quick else POINTS
    for name, solver in list(SOLVERS.items())[: 1 if quick else None]:
        yield from _of(name, solver, points)


def _of(name: str, solver: type[KernelSolver], points: int) -> Iterator[Row]:
    names = tuple(WITHIN)
    kept = {ALL: names} | {f"without {one}": tuple(other for other in names if other != one) for one in names}
    runs = {method: _run(solver, points, which) for method, which in (kept | {NONE: ()}).items()}
    runs[FLOOR] = _run(solver, points, names, off=FLOAT32)
    for _ in range(CASES[CASE] // TURN):
        for one in runs.values():
            for number in range(TURN):
                one.step(timed=number > 0)
    sheet = runs[ALL].simulation.sheet
    best = judged(sheet, np.stack(runs[ALL].course))
    panel = f"{CASE}, {points} × {points}, {name}"
    for method, one in runs.items():
        error = motion_error(judged(sheet, np.stack(one.course)), best)
        floor = method == FLOOR
        yield Row(
            panel=panel,
            method=method,
            knob="a start that is 15 nm off" if floor else f"{one.substeps}",
            error=error,
            seconds=float("nan") if floor else median(one.times),
            default=method == NONE,
        )


def _run(solver: type[KernelSolver], points: int, within: tuple[str, ...], off: float = 0.0) -> _Run:
    """off: by how much its start is, at random [m]."""
    case = case_of(CASE, points, within=within)
    nudge = off * np.random.Generator(np.random.Philox(key=1)).uniform(-1, 1, case.start.shape)
    made = solver(case.sheet, case.forces, frame_rate=FRAME_RATE, threads=1)  # pyright: ignore[reportCallIssue]
    return _Run(Simulation(case.sheet, made, forces=case.forces, positions=case.start + nudge))
