"""Error against run time of the solvers.

Two cases of cotton shirting, 0.5 m × 0.5 m, bent to an arc at the start, so that which way it folds is not left to
rounding: *hang*, held at two corners and let go, and *drape*, laid on a ball. Stiffness: all moduli × a factor.
Reference: Verlet in float64 (`report_reference.py`). Error: root mean square of the distance between key points and
their places in the reference, at the same physical time.
"""

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.errors import InputError, Unstable
from taichi_cloth.forces import Forces, Sphere
from taichi_cloth.materials import named_material
from taichi_cloth.sheet import Sheet
from taichi_cloth.simulation import Simulation
from taichi_cloth.solvers.base import Solver
from taichi_cloth.solvers.implicit import Implicit
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.springs import calibrate

from .report_reference import reference

__all__ = ["CASES", "SolverRow", "read_rows", "scene", "solver_rows", "write_rows"]

CASES = {"hang": 0.3, "drape": 0.15}
"""Simulated time [s] after which the error is taken; later the folds depend on rounding."""

SIDE, ARC = 0.5, 0.4  # [m], of the sheet and radius of the arc
FRAME_RATE = 60.0
Make = Callable[[Sheet, Forces, float], Solver]

SOLVERS: dict[str, tuple[Make, tuple[int, ...]]] = {
    "verlet": (lambda sheet, forces, step: Verlet(sheet, forces, frame_rate=FRAME_RATE), (1,)),
    "implicit": (lambda sheet, forces, step: Implicit(sheet, forces, frame_rate=FRAME_RATE, step=step), (1, 2, 4, 8)),
    "implicit, order 1": (
        lambda sheet, forces, step: Implicit(sheet, forces, frame_rate=FRAME_RATE, step=step, order=1),
        (1, 2, 4, 8),
    ),
}
"""What makes each solver, and the substeps a frame that are tried; Verlet's step follows from the springs."""


@dataclass(frozen=True, kw_only=True)
class SolverRow:
    """A run. stiffness: factor on the fabric's moduli. step [s]. error [m]. ms_per_s: CPU time [ms] for a simulated
    second. stretch: largest strain of a thread at the end; nan with the error where the run was stopped."""

    case: str
    stiffness: float
    points: int
    solver: str
    step: float
    error: float
    ms_per_s: float
    stretch: float


def scene(case: str, stiffness: float, points: int) -> tuple[Sheet, Forces, NDArray[np.float64]]:
    """Sheet of points × points, forces and start of a case."""
    base = named_material("cotton-shirting")
    names = ("tensile_warp", "tensile_weft", "shear", "bending_warp", "bending_weft")
    material = replace(base, **{name: getattr(base, name) * stiffness for name in names})
    spacing = SIDE / (points - 1)
    pinned = np.zeros((points, points), bool)
    if case == "hang":
        pinned[0, [0, -1]] = True
    springs = calibrate(material, spacing_x=spacing, spacing_y=spacing)
    sheet = Sheet.rectangle(points, points, material=material, springs=springs, pinned=pinned)
    flat = sheet.flat()
    angle = (flat[..., 0] - SIDE / 2) / ARC
    up = 1.0 if case == "hang" else -1.0
    start = np.stack([ARC * np.sin(angle), up * ARC * (1 - np.cos(angle)), SIDE / 2 - flat[..., 1]], axis=-1)
    ball = Sphere(centre=(0.013, -0.13, 0.021), radius=0.125)
    return sheet, Forces(sphere=ball if case == "drape" else None), start


def run(
    sheet: Sheet, forces: Forces, start: NDArray[np.float64], solver: Solver, seconds: float
) -> tuple[NDArray[np.float64] | None, float]:
    """Positions at the end, None where the run was stopped, and the CPU time [ms] a simulated second.

    A frame before, of a simulation of its own, compiles."""
    try:
        Simulation(sheet, solver, forces=forces, positions=start).step()
        simulation = Simulation(sheet, solver, forces=forces, positions=start)
        begun = time.process_time()
        for _ in range(round(seconds * FRAME_RATE)):
            simulation.step()
        return simulation.positions.astype(np.float64), 1e3 * (time.process_time() - begun) / seconds
    except Unstable:
        return None, float("nan")


def _distance(one: NDArray[np.float64], two: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.sum((one - two) ** 2, axis=-1))))


def solver_rows(
    case: str,
    stiffness: float,
    *,
    points: int = 32,
    solvers: dict[str, tuple[Make, tuple[int, ...]]] | None = None,
    share: float = 0.45,
) -> list[SolverRow]:
    """Rows of one case at one stiffness. share: the reference's step in longest stable ones. The first row is the
    reference with a step twice as long, without a time: below its error nothing can be told apart."""
    sheet, forces, start = scene(case, stiffness, points)
    seconds = CASES[case]
    best, count = reference(sheet, forces, start, seconds, share=share)
    if not np.isfinite(best).all():
        raise InputError(
            f"report: the reference of {case} × {stiffness:g} is not finite; use a softer or coarser sheet"
        )
    coarse, _ = reference(sheet, forces, start, seconds, share=2 * share)
    same = {"case": case, "stiffness": stiffness, "points": points}

    def row(name: str, step: float, positions: NDArray[np.float64] | None, cost: float) -> SolverRow:
        error = stretch = float("nan")
        if positions is not None:
            error = _distance(positions, best)
            stretch = max(float(part.max()) for part in sheet.stretch(positions))
        return SolverRow(**same, solver=name, step=step, error=error, ms_per_s=cost, stretch=stretch)

    rows = [row("reference", 2 * seconds / count, coarse, float("nan"))]
    for name, (make, tried) in (solvers or SOLVERS).items():
        for substeps in tried:
            solver = make(sheet, forces, 1 / FRAME_RATE / substeps)
            rows.append(row(name, solver.step, *run(sheet, forces, start, solver, seconds)))
    return rows


def write_rows(rows: Sequence[SolverRow], path: Path | str) -> None:
    """Rows as CSV with a head."""
    with Path(path).open("w", newline="") as file:
        writer = csv.DictWriter(file, list(SolverRow.__dataclass_fields__))
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in asdict(row).items()})


def read_rows(path: Path | str) -> list[SolverRow]:
    """Rows that `write_rows` wrote."""
    kinds = {"case": str, "solver": str, "points": int}
    with Path(path).open(newline="") as file:
        return [SolverRow(**{k: kinds.get(k, float)(v) for k, v in line.items()}) for line in csv.DictReader(file)]
