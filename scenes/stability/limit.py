"""Where Verlet's step stops being stable: found by experiment, beside what `longest_step` says."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.stability import highest_frequency, longest_step
from taichi_cloth.solvers.verlet import Verlet

__all__ = ["found_limit"]

SUBSTEPS = 2000
SMALL, LARGE = 1e-5, 1e-2  # of the spacing: the disturbance at the start, and what counts as grown
CLOSE = 1e-3


def found_limit(sheet: Sheet, shape: NDArray[np.float64] | None = None) -> tuple[float, float]:
    """The longest stable step [s] by bisection of runs of a small disturbance, and the one that is predicted.

    shape: (rows, cols, 3) [m] in the x–y plane, in which no force acts on what is free; None: at rest.
    """
    forces = Forces(gravity=(0.0, 0.0, 0.0))
    solver, material = Verlet(sheet, forces), sheet.material
    frequency = highest_frequency(sheet, shape)
    said = longest_step(frequency, fibre_damping=material.fibre_damping, air_damping=material.air_damping)
    still = sheet.flat() if shape is None else shape
    rng = np.random.Generator(np.random.Philox(key=1))
    noise = SMALL * sheet.springs.spacing_x * np.sign(rng.standard_normal(still.shape))
    noise[sheet.pinned] = 0.0

    def grows(share: float) -> bool:
        state = sheet.state(still + noise)
        sheet.set_steps(state, np.zeros_like(still))
        solver.unchecked(share * said, SUBSTEPS).advance(state, FrameForces())
        off: NDArray[np.float32] = sheet.positions(state) - still.astype(np.float32)
        return not float(np.abs(off[..., :2]).max()) < LARGE * sheet.springs.spacing_x

    low, high = 0.8, 1.2
    if grows(low) or not grows(high):
        return float("nan"), said
    while high - low > CLOSE:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return (low + high) / 2 * said, said
