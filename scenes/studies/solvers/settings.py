"""Every solver and scheme at every setting that the study of solvers tries, and its run."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.motion.solver import Solver
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarn_fields import Family
from taichi_cloth.solvers.yarns import Yarns

from ...measure.moved import timed
from .cases import CASES, FRAME_RATE, Case
from .reference import Scheme, scheme_course

__all__ = ["LOOPS", "NOW", "ONE_SWEEP", "VERLET", "XPBD", "Setting", "settings", "verlet", "yarns"]

F64 = NDArray[np.float64]
VERLET, NOW, XPBD, ONE_SWEEP = "Verlet", "yarns, n(y), 2 sweeps", "XPBD", "one stable sweep"
LOOPS = ", as a device runs it"
"""After the name of a method that runs as parallel loops: what a device does, here on a CPU."""

SUBSTEPS = (20, None, 80, 160)
"""Of whole yarns; None: as many as they take by themselves."""

SWEEPS = (2, 1, 3, 4)
OTHERS = {XPBD: (40, 160, 640), ONE_SWEEP: (160, 640)}
SHOWN = 160
"""Substeps with which these stand beside the others over time."""

SCHEMES: dict[str, Scheme] = {XPBD: "XPBD", ONE_SWEEP: "one sweep"}
PARTS = (1, 2)
"""Into which the step that Verlet takes by itself is cut."""

STIFFEST_VERLET = 1e3
"""Factor of the threads' stiffness from which on Verlet in float32 is not tried: its rounding would shake the cloth."""


@dataclass(frozen=True)
class Setting:
    """method: a line of the diagram. substeps: of a frame. default: whether a scene that names the method gets it.
    shown: whether it stands for its method over time. run: positions (frames, rows, cols, 3) [m] and CPU time [s] a
    simulated second; raises InputError or Unstable where the solver does."""

    method: str
    substeps: int
    run: Callable[[], tuple[F64, float]] = field(repr=False)
    default: bool = False
    shown: bool = False

    def tried(self) -> tuple[F64 | None, float]:
        """None where the run was refused, or lost."""
        try:
            course, cost = self.run()
        except (InputError, Unstable):
            return None, float("nan")
        return (course, cost) if np.isfinite(course).all() else (None, float("nan"))


class _AlongNow(Yarns):
    """Threads pushed along where they lead after the substep, n(y), in every substep but the first of a frame."""

    def families(self) -> list[Family]:
        return [
            replace(one, numbers=[cloth | {"calm": 1e9 / cloth["rest"]} for cloth in one.numbers])
            for one in super().families()
        ]


def settings(case: Case, *, quick: bool) -> Iterator[Setting]:
    if case.threads <= STIFFEST_VERLET:
        for parts in PARTS[:1] if quick else PARTS:
            yield verlet(case, parts)
    for sweeps in SWEEPS[:1] if quick else SWEEPS:
        for substeps in SUBSTEPS[:3] if quick else SUBSTEPS:
            yield yarns(case, substeps, sweeps=sweeps)
    for substeps in SUBSTEPS[1:2] if quick else SUBSTEPS:
        yield yarns(case, substeps, kind=_AlongNow, method=NOW)
    for method, several in OTHERS.items():
        for substeps in several[:2] if quick else several:
            yield _plain(case, method, substeps)
    if case.threads <= STIFFEST_VERLET:
        for parts in PARTS[:1] if quick else PARTS:
            yield verlet(case, parts, loops=True)
    for substeps in SUBSTEPS[1:2] if quick else SUBSTEPS[1:]:
        yield yarns(case, substeps, loops=True)


def verlet(case: Case, parts: int = 1, *, loops: bool = False) -> Setting:
    """loops: as parallel loops, which is what a device runs."""
    usual = Verlet(case.sheet, case.forces, frame_rate=FRAME_RATE)

    def run() -> tuple[F64, float]:
        step = usual.step / parts
        return _moved(case, lambda: _way(Verlet(case.sheet, case.forces, frame_rate=FRAME_RATE, step=step), loops))

    own = parts == 1 and not loops
    return Setting(VERLET + LOOPS * loops, parts * usual.substeps, run, own, own)


def yarns(
    case: Case, substeps: int | None = None, *, sweeps: int = SWEEPS[0], kind: type[Yarns] = Yarns, method: str = "",
    loops: bool = False,
) -> Setting:  # fmt: skip
    """With so many substeps, at least: a taut thread may ask for more. None: as many as they take by themselves.
    loops: as parallel loops, which is what a device runs."""
    usual = kind(case.sheet, case.forces, frame_rate=FRAME_RATE)
    shown = sweeps == usual.sweeps and substeps is None and not loops
    substeps = substeps or usual.substeps

    def solver() -> Yarns:
        if substeps < usual.substeps:  # longer steps than it lets a scene take
            one = kind(case.sheet, case.forces, frame_rate=FRAME_RATE, sweeps=sweeps)
            one.take_steps(substeps)
            return one
        return kind(case.sheet, case.forces, frame_rate=FRAME_RATE, step=1 / FRAME_RATE / substeps, sweeps=sweeps)

    method = (method or f"yarns, blend, {sweeps} sweep{'s' * (sweeps > 1)}") + LOOPS * loops
    return Setting(
        method, substeps, lambda: _moved(case, lambda: _way(solver(), loops)), shown and kind is Yarns, shown
    )


def _way(solver: Verlet | Yarns, loops: bool) -> Verlet | Yarns:
    if loops:
        solver.loops_from = 0
    return solver


def _plain(case: Case, method: str, substeps: int) -> Setting:
    def run() -> tuple[F64, float]:
        frames, scheme = CASES[case.name], SCHEMES[method]
        options = {"frames": frames, "substeps": substeps, "scheme": scheme}
        begun = process_time()
        course = scheme_course(case.sheet, case.forces, case.start, case.seconds, **options)
        return course, (process_time() - begun) / case.seconds

    return Setting(method, substeps, run, shown=substeps == SHOWN)


def _moved(case: Case, solver: Callable[[], Solver]) -> tuple[F64, float]:
    course: list[F64] = []

    def make() -> Simulation:
        return Simulation(case.sheet, solver(), forces=case.forces, positions=case.start)

    _, cost = timed(make, case.seconds, lambda one: course.append(one.positions.astype(np.float64)))
    return np.stack(course), cost
