"""What solvers have in common whose frame is one kernel (`frame.py`): its fields, threads, constants, constraints."""

import contextlib
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.device_memory import require_device_memory
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.capacity import capacity_of
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.crew import PARTS, Pace, parts_of
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.motion.frame import Frame, meets_itself
from taichi_cloth.motion.numbers import acting, numbers_of
from taichi_cloth.motion.repeated import Repeated
from taichi_cloth.motion.slipping import ANCHORS, slip_numbers
from taichi_cloth.motion.solver import Solver
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.motion.stencil import Features
from taichi_cloth.sheet.sheet import LANES, Sheet, SheetState

__all__ = ["KernelSolver", "stamped"]

WORTH_THREADS = 1_000
"""Key points from which a second thread pays: a factor of 1.4 at 33², 1.9 at 46², 1.6 to 1.8 at 79², 1.8 at 257²."""

MOST_THREADS = PARTS // 2
MOST_CLOTHS = 8
"""In one sheet: all sheets of several share a kernel."""

_clock: list[StageClock | None] = [None]


@contextlib.contextmanager
def stamped(clock: StageClock | None) -> Iterator[None]:
    """Solvers that are made within tell this clock where their stages end."""
    _clock.append(clock)
    try:
        yield
    finally:
        _clock.pop()


class KernelSolver(Solver):
    """A solver of one sheet whose frames a kernel moves.

    frame_of: the `Frame` with the solver's own stages. substeps: of a frame of 1/frame_rate [s], at the start. threads:
    at most; None takes 1, or those of the runtime where the sheet is large enough. constraints: what corrects key
    points after the springs of each substep, in that order.
    Raises InputError on forces that none of the constraints answers.
    """

    frame_of: type[Frame]
    answers: tuple[str, ...] = ()
    """Fields of `Forces` that it sees to itself, beside gravity, wind and fixed shapes."""

    alone_where_repeated = True
    """Whether constraints that are repeated keep it to one thread: they are most of a substep, one thread's work."""

    clock: StageClock | None
    """What is told where the stages of frames end; with one, a kernel of its own is compiled."""

    loops_of: Any = None
    """The frame as parallel loops, a class as `loops.FrameLoops`; None where there are none."""

    loops_from: float | None = None
    """Key points from which a CPU goes through them, too; None takes `loops_win_from` where cloth has no constraint and
    more threads than one."""

    loops_win_from: float = float("inf")
    """Key points from which loops are faster on two cores than threads that share a kernel (docs/devices.md)."""

    springs_are_threads = True
    """Whether the threads are springs of the stencil. Otherwise what solves them moves key points after it."""

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float,
        substeps: int,
        threads: int | None,
        constraints: tuple[Constraint, ...],
    ) -> None:
        if len(sheet.cloths) > MOST_CLOTHS:
            raise InputError(f"sheet: {len(sheet.cloths)} cloths; allowed: up to {MOST_CLOTHS}")
        self.sheet, self.forces, self.frame_rate, self.constraints = sheet, forces, frame_rate, constraints
        self.clock = _clock[-1]
        behind = 0
        for one in reversed(constraints):
            one.clock, one.kept_behind = self.clock, behind
            behind += one.keeps
        for name in ("body", "strain_limit", "self_contact"):
            if (
                getattr(forces, name) is not None
                and name not in self.answers
                and not any(one.answers == name for one in constraints)
            ):
                raise InputError(f"forces.{name}: no constraint of the solver answers it; see constraints_for")
        most = threads or (runtime.threads() if sheet.present.sum() >= WORTH_THREADS else 1)
        alone = self.alone_where_repeated and any(one.repeated for one in constraints)
        self.threads = 1 if alone else min(most, MOST_THREADS)
        shapes, springs = forces.plane is not None or forces.sphere is not None, [c.springs for c in sheet.cloths]
        self.features = Features(
            threads=self.springs_are_threads,
            hinges=sheet.springs.law == "hinge",
            diagonals=any(s.diagonal > 0 or not s.slips for s in springs),
            wind=forces.wind is not None,
            sphere=forces.sphere is not None,
            plane=forces.plane is not None,
            grips=shapes and meets_itself(constraints),
            twists=any(s.twist > 0 for s in springs),
            slips=any(s.slips for s in springs),
            leads=self.springs_are_threads and not constraints,
            apart=not self.springs_are_threads
            or bool(constraints)
            or sheet.most(lambda cloth: cloth.material.fibre_damping) > 0,
        )
        self.take_steps(substeps)
        self._pace = Pace(self.threads)

    @property
    def lacks(self) -> str:
        """What of it there are no parallel loops for, which devices need; "" where nothing."""
        wanting = [one.known_as for one in self.constraints if not one.spreads]
        if self.loops_of is None:
            wanting.append(f"the solver {type(self).__name__.lower()}")
        return ", ".join(dict.fromkeys(wanting))

    @property
    def spread(self) -> bool:
        """Whether a frame is gone through in parallel loops; said once Taichi runs. Raises InputError on a device that
        needs what it lacks: one of its threads would take minutes a frame."""
        if not runtime.on_host():
            if self.lacks:
                raise InputError(f"{self.lacks}: no parallel form yet, as a device needs it; use --arch cpu")
            return True
        least = self.loops_from
        if least is None:
            least = self.loops_win_from if not self.constraints and runtime.threads() > 1 else float("inf")
        return not self.lacks and self.clock is None and bool(self.sheet.present.sum() >= least)

    @property
    def remembered(self) -> int:
        return super().remembered + (ANCHORS if self.features.slips else 0)

    def anchors(self, state: SheetState) -> NDArray[np.float32]:
        first = 6 + sum(one.remembers for one in self.constraints)
        return state.values[first : first + (ANCHORS if self.features.slips else 0)]

    def take_steps(self, substeps: int) -> None:
        """From now on so many a frame."""
        self.substeps, self.step = substeps, 1 / self.frame_rate / substeps
        self.numbers, *self.others = (numbers_of(cloth, self.forces, self.step) for cloth in self.sheet.cloths)
        for one in self.constraints:
            one.join(substeps, self.step)

    def rescale(self, state: SheetState, before: float) -> None:
        """Steps of `before` [s] in the state to those of the same motion now: x(t) − x(t − h) = v h − a h²/2."""
        sheet, share = self.sheet, self.step / before
        a = self.accelerations(sheet, sheet.positions(state), self.forces.gravity)
        steps = share * (sheet.steps(state) + a * (before * (before - self.step) / 2))
        sheet.set_steps(state, steps)
        for one in self.constraints:
            one.rescale(state, share)

    def advance(self, state: SheetState, forces: FrameForces) -> None:
        before = state.values.copy() if any(one.stops for one in self.constraints) else None
        self._advance(state, forces)
        while before is not None and sum(one.again() for one in self.constraints):  # all are asked
            state.values[:] = before
            self._advance(state, forces)
        self.let_off = sum(one.let_off for one in self.constraints)

    def _advance(self, state: SheetState, forces: FrameForces) -> None:
        """One frame, whatever constraints think of it."""
        frame = self._filled(state)
        first, last = np.asarray(forces.wind_start), np.asarray(forces.wind_end)
        wind, change = first.tolist(), ((last - first) / self.substeps).tolist()
        for one in self.constraints:
            one.begin(state, forces)
        threads, begin = self._pace.threads(), perf_counter()
        routines = bool(self.constraints) or not self.springs_are_threads
        done, pausing = 0, next((one for one in self.constraints if one.stops), None)
        planes = state.values[: len(state.values) - sum(one.keeps for one in self.constraints)]
        # Plain code: half the time to compile, and as fast a frame. With a clock it is of this process alone.
        plain = partial(runtime.plain_code, routines=routines, kept=self.clock is None)
        run = Repeated(frame.run, state.in_a_row, *wind, *change, 0, 0, 1, threads, self.features)
        with plain(whole=frame.loops is None):
            if frame.loops is not None:
                frame.loops.enter(planes)
            while True:
                done, until, fresh = done, self.substeps, True
                if pausing is not None:
                    done, until, fresh = pausing.stop(state, done, frame.loops)
                if done == self.substeps:
                    break
                if frame.loops is not None:
                    frame.loops.go(wind, change, done, until)
                else:
                    run(first=done, last=until, fresh=int(fresh or done == 0))
                done = until
            if frame.loops is not None:
                frame.loops.leave(planes)
            took = perf_counter() - begin
        with plain():
            self.look(frame)
        self._pace.took(took)
        self.spent += took
        for one in self.constraints:
            one.end(state)

    def make_ready(self, state: SheetState) -> None:
        if runtime.generation():
            self._filled(state)

    def _filled(self, state: SheetState) -> Any:
        size = capacity_of(self.sheet.padded_shape)
        spread = self._loops() if self.spread else None
        for one in self.constraints:
            one.spread = spread is not None
        frame = _frame(
            runtime.generation(),
            self.frame_of,
            size,
            self.threads if runtime.on_host() else 1,  # on a device they might wait for each other for ever
            self.constraints,
            self.clock,
            self.features.slips,
            spread,
            MOST_CLOTHS if self.sheet.bands else 1,
        )
        if frame.holder is None and not runtime.on_host():
            points = int(self.sheet.present.sum())
            require_device_memory("sheet", points, (frame, *(getattr(one, "fields", None) for one in self.constraints)))
        if frame.holder != (self, self.numbers):
            self.fill(frame, state)
            frame.holder = self, self.numbers
        return frame

    def _loops(self) -> Callable[[Frame], Any]:
        """Makes the loops of a frame; the same object for sheets that can share them."""
        packets = len(parts_of(self.sheet.padded(self.sheet.present) > 0)[0])
        lanes = LANES if runtime.on_host() else 1
        return loops_for(self.loops_of, self.features, packets, lanes, self.sheet.padded_shape)

    def fill(self, frame: Any, state: SheetState) -> None:
        """What stays the same from frame to frame, into fields that hold that of another solver, or of other steps."""
        frame.fill(self.sheet, state, [self.numbers, *self.others])
        if self.features.slips:
            named = [
                list(slip_numbers(one.springs, self.step**2 * acting(one.material.air_damping, self.step)).values())
                for one in self.sheet.cloths
            ]
            frame.slipping.take(np.array(named, np.float32))

    def look(self, frame: Any) -> None:
        """At the fields after a frame."""


@lru_cache(maxsize=16)
def _frame(
    generation: int,
    frame_of: type[Frame],
    size: int,
    threads: int,
    constraints: tuple[Constraint, ...],
    clock: StageClock | None,
    slips: bool,
    spread: Callable[[Frame], Any] | None,
    cloths: int,
) -> Frame:
    """Sheets of one class share it. generation: of the Taichi runtime; a new start throws all fields away."""
    frame = frame_of(size, threads, constraints, clock, slips, cloths)
    if spread is not None:
        frame.loops = spread(frame)
    runtime.close_tree()
    return frame


@lru_cache(maxsize=16)
def loops_for(loops_of: Any, *of_sheet: Any) -> Callable[[Frame], Any]:
    return lambda frame: loops_of(frame, *of_sheet)
