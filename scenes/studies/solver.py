"""Error against run time of the solvers.

Two cases of cotton shirting, 0.5 m × 0.5 m, bent to an arc at the start, so that which way it folds is not left to
rounding: *hang*, held at two corners and let go, and *drape*, laid on a ball. Stiffness: all moduli × a factor.
Reference: Verlet in float64 (`reference.py`). Error: root mean square of the distance between key points and
their places in the reference, at the same physical time. In some panels the threads alone are stiffer than those of the
preset, as real ones are once their crimp is drawn out.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import asin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.forces import Forces, Sphere
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.motion.solver import Solver
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

from ..measure.study import Axis, Row, Study, microseconds
from . import worn
from .moved import rms, timed
from .reference import reference

__all__ = ["CASES", "STUDY", "rows", "run", "scene", "solver_rows"]

CASES = {"hang": 0.3, "drape": 0.15}
"""Simulated time [s] after which the error is taken; later the folds depend on rounding."""

ALL_MODULI = (0.01, 1.0, 1e4)
THREADS = (100.0, 1e4)
FULL = [
    (case, stiffness, threads)
    for case in CASES
    for stiffness, threads in (*((k, 1.0) for k in ALL_MODULI), *((1.0, k) for k in THREADS))
]
"""Case, factor of all moduli, factor of the threads'."""

QUICK = [("hang", 1.0, 1.0), ("hang", 1.0, 100.0), ("drape", 1.0, 1.0)]
SIDE, ARC = 0.5, 0.4  # [m], of the sheet and radius of the arc
FRAME_RATE = 60.0
VERLET = (1, 2, 4, 8)
"""Parts into which the step that Verlet, or whole yarns, take by themselves is cut."""

SWEEPS = (1, 2, 4)
"""Over warp and weft, a substep of whole yarns."""

SOFT = 1.0
"""Factor of all moduli up to which whole yarns are tried: their step is that of shear and bending."""


def scene(case: str, stiffness: float, points: int, threads: float = 1.0) -> tuple[Sheet, Forces, NDArray[np.float64]]:
    """Sheet of points × points, forces and start of a case. stiffness, threads: factors of all moduli, and of those of
    the threads beside that."""
    base = named_material("cotton-shirting")
    factors = dict.fromkeys(("shear", "bending_warp", "bending_weft"), stiffness)
    factors |= dict.fromkeys(("tensile_warp", "tensile_weft"), stiffness * threads)
    material = replace(base, **{name: factor * getattr(base, name) for name, factor in factors.items()})
    spacing = SIDE / (points - 1)
    pinned = np.zeros((points, points), bool)
    if case == "hang":
        pinned[0, [0, -1]] = True
    springs = calibrate(material, spacing_x=spacing, spacing_y=spacing)
    sheet = Sheet.rectangle(points, points, material=material, springs=springs, pinned=pinned)
    flat = sheet.flat()
    bend = 2 * asin(spacing / 2 / ARC) / spacing  # chords as long as threads, so that none is strained
    angle = (flat[..., 0] - SIDE / 2) * bend
    up = 1.0 if case == "hang" else -1.0
    start = np.stack([ARC * np.sin(angle), up * ARC * (1 - np.cos(angle)), SIDE / 2 - flat[..., 1]], axis=-1)
    ball = Sphere(centre=(0.013, -0.13, 0.021), radius=0.125)
    return sheet, Forces(sphere=ball if case == "drape" else None), start


def run(
    sheet: Sheet, forces: Forces, start: NDArray[np.float64], solver: Solver, seconds: float
) -> tuple[NDArray[np.float64] | None, float]:
    """Positions at the end, None where the run was refused or stopped, and the CPU time [s] a simulated second."""
    try:
        simulation, cost = timed(lambda: Simulation(sheet, solver, forces=forces, positions=start), seconds)
    except (InputError, Unstable):
        return None, float("nan")
    return simulation.positions.astype(np.float64), cost


def solver_rows(
    case: str, stiffness: float, *, threads: float = 1.0, points: int = 24, share: float = 0.1, fewer: bool = False
) -> Iterator[Row]:
    """Rows of one case at one stiffness: factors as of `scene`. share: the reference's step in longest stable ones. The
    first row is the reference with a step twice as long, without a time: below its error nothing can be told apart."""
    sheet, forces, start = scene(case, stiffness, points, threads)
    seconds = CASES[case]
    best, count = reference(sheet, forces, start, seconds, share=share)
    if not np.isfinite(best).all():
        raise InputError(
            f"report: the reference of {case} × {stiffness:g} is not finite; use a softer or coarser sheet"
        )
    what = f"{stiffness:g} × cotton" if threads == 1 else f"cotton, threads × {threads:g}"
    panel = f"{case}, {what}, {points} × {points}"

    def row(
        method: str, knob: str, step: float, positions: NDArray[np.float64] | None, cost: float, usual: bool
    ) -> Row:
        error = float("nan") if positions is None else rms(positions, best)
        return Row(panel=panel, method=method, knob=knob, value=step, error=error, seconds=cost, default=usual)

    coarse, _ = reference(sheet, forces, start, seconds, share=2 * share)
    yield row("reference", "reference, step × 2", 2 * seconds / count, coarse, float("nan"), False)
    usual = Verlet(sheet, forces, frame_rate=FRAME_RATE)
    for parts in VERLET[:2] if fewer else VERLET:
        solver = Verlet(sheet, forces, frame_rate=FRAME_RATE, step=usual.step / parts)
        yield row(
            "Verlet", microseconds(solver.step), solver.step, *run(sheet, forces, start, solver, seconds), parts == 1
        )
    if stiffness <= SOFT:
        yield from (row(*found) for found in yarn_runs(sheet, forces, start, seconds, fewer=fewer))


def yarn_runs(
    sheet: Sheet, forces: Forces, start: NDArray[np.float64], seconds: float, *, fewer: bool
) -> Iterator[tuple[str, str, float, NDArray[np.float64] | None, float, bool]]:
    """Runs of whole yarns, by sweeps and steps: method, knob, step [s], positions, cost, whether it is the default."""
    usual = Yarns(sheet, forces, frame_rate=FRAME_RATE)
    for sweeps in SWEEPS[:2] if fewer else SWEEPS:
        for parts in VERLET[:2] if fewer else VERLET[:3]:
            solver = Yarns(sheet, forces, frame_rate=FRAME_RATE, step=usual.step / parts, sweeps=sweeps)
            method = f"whole yarns, {sweeps} sweep{'s' * (sweeps > 1)}"
            found, cost = run(sheet, forces, start, solver, seconds)
            yield method, microseconds(solver.step), solver.step, found, cost, parts == 1 and sweeps == usual.sweeps


def rows(quick: bool) -> Iterator[Row]:
    for case, stiffness, threads in QUICK if quick else FULL:
        yield from solver_rows(case, stiffness, threads=threads, points=12 if quick else 24, fewer=quick)
    if not quick:
        yield from worn.rows()


STUDY = Study(
    name="solver",
    title="Solvers: Verlet and whole yarns",
    about="Cotton shirting of 0.5 m × 0.5 m, bent to an arc, held at two corners and let go (hang, 0.3 s) or laid on a "
    "ball (drape, 0.15 s); all moduli × a factor, or those of the threads alone. Error: root mean square distance of "
    "key points from Verlet in float64 at a tenth of its longest step, at the same physical time; dashed, that "
    "reference against itself with twice the step. Where Verlet's line stays level far above that, float32 is what is "
    "left: differences grow as cotton buckles. The skirt (in full only): the built-in one, from its rest; reference: "
    "Verlet in float32 at an eighth of the scene's step, or at a quarter with springs that carry the whole stiffness.",
    error=Axis("error, rms", "mm", 1e3),
    time=Axis("CPU time for a simulated second", "ms", 1e3),
    rows=rows,
    why={
        "Verlet": "its error is a small part of what the spacing of key points costs, which no step mends",
        "whole yarns, 2 sweeps": "shorter steps gain what they cost; more sweeps gain nothing while cloth hangs, and "
        "a fresh fold asks for two",
        "Verlet, strain limit": "a share below 1 is cloth that gives until the crimp of its yarns is drawn out, and "
        "steps twice as long are worth a few millimetres of that",
    },
)
