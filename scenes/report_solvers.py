"""Error against run time of the solvers.

Two cases of cotton shirting, 0.5 m × 0.5 m: *hang*, held level at two corners and let go, and *drape*, dropped on a
ball. Stiffness: all moduli × a factor. Reference: Verlet with a quarter of its longest step. Error: root mean square of
the distance between key points and their places in the reference, at the same physical time.
"""

import csv
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.errors import InputError
from taichi_cloth.forces import Forces, Sphere
from taichi_cloth.materials import named_material
from taichi_cloth.sheet import Sheet
from taichi_cloth.simulation import Simulation, Unstable
from taichi_cloth.solvers.base import Solver
from taichi_cloth.solvers.implicit import Implicit
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.springs import calibrate

__all__ = ["CASES", "SolverRow", "read_rows", "solver_rows", "write_rows"]

CASES = {"hang": 0.5, "drape": 0.3}
"""Simulated time [s] after which the error is taken; later the drape's folds depend on rounding."""

SIDE = 0.5  # [m]
FRAME_RATE = 60.0


@dataclass(frozen=True, kw_only=True)
class SolverRow:
    """A run. stiffness: factor on the fabric's moduli. step [s]. sweeps: a step. error [m]. ms_per_s: CPU time [ms] for
    a simulated second. stretch: largest strain of a thread at the end; nan with the error where the run was stopped."""

    case: str
    stiffness: float
    points: int
    solver: str
    step: float
    sweeps: int
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
    lift = 1e-3 * np.sin(7 * flat[..., 0]) * np.cos(5 * flat[..., 1])  # which way it buckles is not left to rounding
    start = np.stack([flat[..., 0] - SIDE / 2, lift, SIDE / 2 - flat[..., 1]], axis=-1)
    ball = Sphere(centre=(0.013, -0.13, 0.021), radius=0.125)
    return sheet, Forces(sphere=ball if case == "drape" else None), start


def run(
    sheet: Sheet, forces: Forces, start: NDArray[np.float64], solver: Solver, seconds: float
) -> tuple[NDArray[np.float32] | None, float]:
    """Positions at the end, None where the run was stopped, and the CPU time [ms] a simulated second.

    The second half of the frames is timed, and the first ones, which compile, are not.
    """
    simulation = Simulation(sheet, solver, forces=forces, positions=start)
    frames, times = round(seconds * FRAME_RATE), []
    try:
        for _ in range(frames):
            before = time.process_time()
            simulation.step()
            times.append(time.process_time() - before)
    except Unstable:
        return None, float("nan")
    return simulation.positions, 1e3 * FRAME_RATE * median(times[len(times) // 2 :])


def implicit_settings() -> Iterable[tuple[float, int]]:
    """Steps [s] and sweeps to try."""
    frame = 1 / FRAME_RATE
    return [(frame / k, 1) for k in (2, 4, 8, 16, 32, 64)] + [(frame / k, 4) for k in (1, 2, 4, 8, 16)]


def solver_rows(
    case: str,
    stiffness: float,
    *,
    points: int = 32,
    others: dict[str, Callable[[Sheet, Forces, float, int], Solver]] | None = None,
    only_others: bool = False,
) -> list[SolverRow]:
    """Rows of one case at one stiffness. others: more solvers, made from sheet, forces, step, sweeps."""
    sheet, forces, start = scene(case, stiffness, points)
    seconds = CASES[case]
    longest = Verlet(sheet, forces, frame_rate=FRAME_RATE).step
    reference, _ = run(sheet, forces, start, Verlet(sheet, forces, frame_rate=FRAME_RATE, step=longest / 4), seconds)
    if reference is None:
        raise InputError(f"report: the reference of {case} × {stiffness:g} was stopped; use a softer or coarser sheet")
    made: list[tuple[str, int, Solver]] = []
    if not only_others:
        made += [("verlet", 1, Verlet(sheet, forces, frame_rate=FRAME_RATE, step=longest / k)) for k in (1, 2)]
        made += [
            ("implicit", q, Implicit(sheet, forces, frame_rate=FRAME_RATE, step=h, sweeps=q))
            for h, q in implicit_settings()
        ]
    for name, make in (others or {}).items():
        made += [(name, q, make(sheet, forces, h, q)) for h, q in implicit_settings()]
    rows = []
    for name, sweeps, solver in made:
        positions, cost = run(sheet, forces, start, solver, seconds)
        error = stretch = float("nan")
        if positions is not None:
            error = float(np.sqrt(np.mean(np.sum((positions.astype(float) - reference) ** 2, axis=-1))))
            stretch = max(float(part.max()) for part in sheet.stretch(positions))
        rows.append(
            SolverRow(
                case=case,
                stiffness=stiffness,
                points=points,
                solver=name,
                step=solver.step,
                sweeps=sweeps,
                error=error,
                ms_per_s=cost,
                stretch=stretch,
            )
        )
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
    kinds = {"case": str, "solver": str, "points": int, "sweeps": int}
    with Path(path).open(newline="") as file:
        return [SolverRow(**{k: kinds.get(k, float)(v) for k, v in line.items()}) for line in csv.DictReader(file)]
