"""What every solver is: a thing that moves a state on by one frame."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.sheet.energy import accelerations
from taichi_cloth.sheet.sheet import Sheet, SheetState

__all__ = ["Solver"]


class Solver(ABC):
    """A method of integration, made for one sheet, one set of forces and one frame rate."""

    sheet: Sheet

    substeps: int
    """Steps a frame."""

    step: float
    """Length of a step [s]."""

    instead: str = ""
    """What to name in its place, as a scene does, where its steps prove hopeless."""

    spent: float = 0.0
    """Time [s] in the kernels of all frames so far."""

    constraints: tuple[Constraint, ...] = ()
    """What acts on key points beside springs, after each step."""

    @property
    def lacks(self) -> str:
        """What of it a graphics device cannot do; "" where it can do all."""
        return f"the solver {type(self).__name__.lower()}"

    @property
    def remembered(self) -> int:
        """Numbers of a key point that a state keeps beside its place and step: first what constraints remember, then
        the solver's own, last what constraints keep."""
        return sum(one.remembers + one.keeps for one in self.constraints)

    def anchors(self, state: SheetState) -> NDArray[np.float32]:
        """A view of where what rubs within the sheet pulls nothing, (ANCHORS, *padded shape) [m], see `slipping.py`;
        (0, …) where nothing rubs."""
        return state.values[:0]

    @property
    def explicit(self) -> Sheet:
        """The sheet with those springs only whose pull follows from where key points are. What others hold, which are
        solved, is not told from a state."""
        return self.sheet

    @property
    def settings(self) -> tuple[object, ...]:
        """What else the motion depends on: a saved state is of a solver with the same."""
        return ()

    def rounding(self, ulp: float) -> float:
        """Speed [m/s] that key points get from rounding coordinates whose neighbouring numbers are `ulp` [m] apart."""
        return 0.0

    def shorten(self, state: SheetState, reached: SheetState | None) -> bool:
        """Whether what the sheet has become asks for shorter steps than were taken; then they are from now on, and the
        steps in `state` with them.

        state: from which to go on. reached: where the last frame led from there, or the same before the first; None:
        to what is no sheet any more, so that steps are wanted that are stable in any shape.
        """
        return False

    let_off = 0
    """How often in the last frame constraints could not keep apart what they should, and let it through."""

    @property
    def torn(self) -> str:
        """What in the last frame was more than cloth carries, and than any steps follow; "" where nothing was."""
        return ""

    def overstrained(self, state: SheetState) -> bool:
        """Whether threads are strained beyond what cloth survives at this start, so that it has to be settled."""
        return False

    def settle(self, state: SheetState) -> None:
        """Brings such a start to rest, in place, before the first frame. Raises InputError where that cannot be."""
        assert not self.overstrained(state)

    @property
    def found(self) -> tuple[float, ...]:
        """What a run has found out about its steps, for one that goes on from it."""
        return ()

    def go_on(self, found: tuple[float, ...]) -> None:
        """Takes the steps of the run that found that."""
        assert not found

    def accelerations(self, sheet: Sheet, positions: NDArray, gravity: tuple[float, float, float]) -> NDArray:
        """Of key points (rows, cols, 3) [m/s²] at those positions [m], by springs and gravity."""
        return accelerations(sheet, positions, gravity)

    def make_ready(self, state: SheetState) -> None:  # noqa: B027 (there may be none)
        """Makes now what the first frame would: fields. Taichi finds a kernel that another process compiled only where
        the same fields were made there before those of the kernel."""

    @abstractmethod
    def advance(self, state: SheetState, forces: FrameForces) -> None:
        """Moves the state on by one frame, in place.

        The steps of pinned key points stand in the state and are kept: they move by them every substep.
        """
