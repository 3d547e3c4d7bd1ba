"""What Verlet and whole yarns have in common: positions in float32, and starts that no cloth survives."""

from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.sheet.sheet import SheetState
from taichi_cloth.solvers.stability import rounding_speed
from taichi_cloth.solvers.strained_start import overstrain

__all__ = ["SpringSolver"]


class SpringSolver(KernelSolver):
    """A solver of one sheet whose explicit springs set the step."""

    def rounding(self, ulp: float) -> float:
        m = self.sheet.material
        return rounding_speed(self.step, ulp, air_damping=m.air_damping, fibre_damping=m.fibre_damping)

    def overstrained(self, state: SheetState) -> bool:
        return overstrain(self.sheet, self.sheet.positions(state)) > 1
