"""Where Verlet's step stops being stable: found by experiment, beside what `longest_step` says."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.forces import Forces, FrameForces
from taichi_cloth.sheet import Sheet
from taichi_cloth.solvers.verlet import Verlet

__all__ = ["found_limit"]

SUBSTEPS = 2000
SMALL, LARGE = 1e-5, 1e-2  # of the spacing: the disturbance at the start, and what counts as grown
CLOSE = 1e-3


def found_limit(sheet: Sheet) -> tuple[float, float]:
    """The longest stable step [s] by bisection of runs of a small disturbance, and the one that is predicted."""
    forces = Forces(gravity=(0.0, 0.0, 0.0))
    solver = Verlet(sheet, forces)
    flat = sheet.flat()
    rng = np.random.Generator(np.random.Philox(key=1))
    noise = SMALL * sheet.springs.spacing_x * np.sign(rng.standard_normal(flat.shape))

    def grows(share: float) -> bool:
        state = sheet.state(flat + noise)
        sheet.set_steps(state, np.zeros_like(flat))
        solver.unchecked(share * solver.limit, SUBSTEPS).advance(state, FrameForces())
        off: NDArray[np.float32] = sheet.positions(state) - flat.astype(np.float32)
        return not float(np.abs(off[..., :2]).max()) < LARGE * sheet.springs.spacing_x

    low, high = 0.8, 1.2
    if grows(low) or not grows(high):
        return float("nan"), solver.limit
    while high - low > CLOSE:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return (low + high) / 2 * solver.limit, solver.limit
