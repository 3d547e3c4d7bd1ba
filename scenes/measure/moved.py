"""Simulations that a study times, and how far apart two of them end."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.simulation import Simulation

__all__ = ["rms", "timed"]


def timed(
    make: Callable[[], Simulation], seconds: float, each: Callable[[Simulation], object] | None = None
) -> tuple[Simulation, float]:
    """A simulation after so many seconds [s], and the CPU time [s] a simulated second. A frame before, of one of its
    own, compiles. each: looks at every frame."""
    make().step()
    simulation = make()
    begun = time.process_time()
    for _ in range(round(seconds / simulation.frame_time)):
        simulation.step()
        if each is not None:
            each(simulation)
    return simulation, (time.process_time() - begun) / simulation.time


def rms(one: NDArray[np.float64], two: NDArray[np.float64]) -> float:
    """Root mean square distance of key points (..., 3) [m]."""
    return float(np.sqrt(((one - two) ** 2).sum(axis=-1).mean()))
