"""Explicit Störmer–Verlet (paper 3.2): x(t + h) = x(t) + (x(t) − x(t − h)) + a h², a frame in one kernel.

The step follows from the springs: h = safety × the longest that is stable (`stability.py`), so a person names a frame
rate only. Where springs become stiffer together than at rest it follows them (`step_choice.py`): the frame is taken
again with shorter steps, and so are those after it.
"""

from copy import copy

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.loops.verlet_loops import VerletLoops
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.numbers import numbers_of
from taichi_cloth.sheet.sheet import Sheet, SheetState
from taichi_cloth.solvers.spring_solver import SpringSolver
from taichi_cloth.solvers.step_choice import StepChoice
from taichi_cloth.solvers.strained_start import settle
from taichi_cloth.solvers.verlet_frame import VerletFrame
from taichi_cloth.solvers.yarns import Yarns

__all__ = ["Verlet"]


class Verlet(SpringSolver):
    """The paper's method for one sheet.

    frame_rate: frames a second [1/s]. step: asked for [s]; None takes the longest that is safe. safety: share of the
    stable limit. threads, constraints: see `KernelSolver`.
    Raises InputError on a step that is not stable, with the one that is, and on forces that no constraint answers.
    """

    frame_of = VerletFrame
    loops_of = VerletLoops
    loops_win_from = 131_072
    instead = 'solver.name = "yarns", '

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float = 60.0,
        step: float | None = None,
        safety: float = 0.9,
        threads: int | None = None,
        constraints: tuple[Constraint, ...] = (),
    ) -> None:
        if any(cloth.material.curved for cloth in sheet.cloths):
            raise InputError('solver.name: "verlet" has springs of one stiffness; threads with a curve need "yarns"')
        self.choice = StepChoice(sheet, frame_rate=frame_rate, safety=safety)
        self._now = 0.0  # the bound of the frequency at the end of the last frame [rad/s]
        longest = self.choice.longest
        if step is not None and not 0 < step <= longest:
            raise InputError(
                f"solver.step: {step!r} s; the springs of this sheet allow at most {longest:.4g} s "
                f"({safety:g} of the stable limit); leave it out, or name one above 0 up to that"
            )
        substeps = self.choice.substeps(step or longest)
        super().__init__(
            sheet, forces, frame_rate=frame_rate, substeps=substeps, threads=threads, constraints=constraints
        )

    def unchecked(self, step: float, substeps: int) -> "Verlet":
        """The same with any step [s], stable or not, to find by experiment where the limit is. Without constraints,
        which are made for a step of their own."""
        assert not self.constraints
        other = copy(self)
        other.step, other.substeps = step, substeps
        other.numbers = numbers_of(self.sheet.cloths[0], self.forces, step)
        return other

    def shorten(self, state: SheetState, reached: SheetState | None) -> bool:
        choice = self.choice
        if reached is None:
            choice.any_shape()
        else:
            locked = self.locked > choice.locked and choice.lock(self.locked)
            bound = choice.bound.at(self._shape(state)) if reached is state else self._now
            nearer = choice.crossed(self.step, bound) and choice.look(self.step, self._shape(reached), bound)
            if not (locked or nearer):
                return False
        substeps = choice.substeps(choice.longest)
        if substeps <= self.substeps:
            return False
        before = self.step
        self.take_steps(substeps)
        self.rescale(state, before)
        return True

    def settle(self, state: SheetState) -> None:
        """By whole yarns: springs that far from rest throw key points past each other in any step."""
        others = tuple(one for one in self.constraints if one.answers not in Yarns.answers)
        settle(Yarns(self.sheet, self.forces, frame_rate=self.frame_rate, constraints=others), state)
        self.take_steps(self.substeps)

    def _shape(self, state: SheetState) -> NDArray[np.float64]:
        return self.sheet.positions(state).astype(np.float64)

    @property
    def found(self) -> tuple[float, ...]:
        locked = (self.choice.locked,) if self.locks else ()
        return self.substeps, self.choice.frequency, self.choice.seen, *locked

    def go_on(self, found: tuple[float, ...]) -> None:
        substeps, self.choice.frequency, self.choice.seen, *locked = found
        self.choice.locked = locked[0] if locked else 0.0
        if substeps != self.substeps:
            self.take_steps(int(substeps))

    def fill(self, frame: VerletFrame, state: SheetState) -> None:
        super().fill(frame, state)
        frame.stiff.take(self.choice.bound, self.step)

    def look(self, frame: VerletFrame) -> None:
        super().look(frame)
        loops = frame.loops
        self._now = (frame.stiffest() if loops is None else loops.stiffest()) ** 0.5 / self.step
