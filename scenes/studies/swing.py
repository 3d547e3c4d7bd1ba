"""A sheet that swings: it hangs from one edge, is let go at an angle and falls. The same fabric at any spacing."""

from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

__all__ = ["FRAME_RATE", "LENGTH", "swing"]

LENGTH, WIDTH = 0.4, 0.1  # [m]
SWINGING = Material(
    tensile_warp=60.0,
    tensile_weft=60.0,
    shear=6.0,
    bending_warp=2e-4,
    bending_weft=2e-4,
    density=0.15,
    air_damping=0.5,
)
FRAME_RATE = 100.0


def swing(
    cells: int, step: float | None = None, stretch: float = 1.0, frames: int = 20
) -> tuple[NDArray[np.float64], int]:
    """(frames, 5, 2, 3) [m] of key points that all sheets share; substeps of a frame. cells: along the sheet, 4 k.
    stretch: of the sheet along itself at the start."""
    a = LENGTH / cells
    across = round(WIDTH / a)
    rows, cols = cells + 1, across + 1
    held = np.zeros((rows, cols), bool)
    held[0] = True
    springs = calibrate(SWINGING, spacing_x=a, spacing_y=a)
    sheet = Sheet.rectangle(rows, cols, material=SWINGING, springs=springs, pinned=held)
    flat, angle = sheet.flat(), radians(50)
    flat[..., 1] *= stretch
    x = np.stack([flat[..., 0], -flat[..., 1] * cos(angle), flat[..., 1] * sin(angle)], axis=-1)
    forces = Forces()
    solver = Verlet(sheet, forces, frame_rate=FRAME_RATE, step=step, threads=1)
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    out = []
    for _ in range(frames):
        simulation.step()
        out.append(simulation.positions[:: cells // 4, ::across].astype(np.float64))
    return np.stack(out), solver.substeps
