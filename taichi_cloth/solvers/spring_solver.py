"""What Verlet and whole yarns have in common: positions in float32, and starts that no cloth survives."""

from typing import Any

from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.sheet.sheet import SheetState
from taichi_cloth.solvers.stability import rounding_speed
from taichi_cloth.solvers.strained_start import overstrain

__all__ = ["SpringSolver"]


class SpringSolver(KernelSolver):
    """A solver of one sheet whose explicit springs set the step."""

    locked = 0.0
    """The largest share of the stiffness of locking that a cell had in the last frame."""

    @property
    def locks(self) -> bool:
        """Whether any of its cloth locks."""
        return self.sheet.most(lambda cloth: cloth.springs.lock) > 0

    def look(self, frame: Any) -> None:
        if self.locks:
            self.locked = frame.slipping.most_locked()

    def rounding(self, ulp: float) -> float:
        return max(
            rounding_speed(self.step, ulp, air_damping=m.air_damping, fibre_damping=m.fibre_damping)
            for m in (cloth.material for cloth in self.sheet.cloths)
        )

    def overstrained(self, state: SheetState) -> bool:
        return overstrain(self.sheet, self.sheet.positions(state)) > 1
