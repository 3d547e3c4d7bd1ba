"""How the motion settles as key points, or steps, grow finer: a sheet that swings, measured against itself.

The sheet hangs from one edge, is let go at an angle and falls. Errors are of the positions of the
coarsest key points at all frames, root mean square over key points, the largest over the frames. The order comes from
three runs in a row, each twice as fine as the one before: p = log2(|x₁ − x₂| / |x₂ − x₃|).
"""

from dataclasses import dataclass
from itertools import pairwise
from math import cos, log2, nan, radians, sin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

__all__ = ["LENGTH", "Row", "spacing_rows", "step_rows", "swing"]

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


@dataclass(frozen=True)
class Row:
    """fine: key points along the sheet, or steps a frame. error: [m] against the finest run. order: from this run and
    the two finer ones; nan where there are none."""

    fine: int
    error: float
    order: float


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


def _rows(fine: list[int], paths: list[NDArray[np.float64]]) -> list[Row]:
    def apart(one: NDArray[np.float64], two: NDArray[np.float64]) -> float:
        return float(np.sqrt(((one - two) ** 2).sum(-1).mean((1, 2))).max())

    steps = [apart(one, two) for one, two in pairwise(paths)]
    orders = [log2(one / two) for one, two in pairwise(steps)]
    orders += [nan] * (len(paths) - len(orders))
    return [Row(k, apart(x, paths[-1]), p) for k, x, p in zip(fine, paths, orders, strict=True)]


def spacing_rows(cells: tuple[int, ...] = (8, 16, 32, 64)) -> list[Row]:
    """The same fabric at ever finer spacing; each number twice the one before, the first a multiple of 4.

    Every sheet takes the step of the finest, so that only the spacing differs.
    """
    finest, count = swing(cells[-1])
    step = 1 / FRAME_RATE / count
    paths = [swing(k, step)[0] for k in cells[:-1]]
    return _rows([k + 1 for k in cells], [*paths, finest])


def step_rows(cells: int = 16, substeps: tuple[int, ...] = (8, 16, 32, 64)) -> list[Row]:
    """The same sheet at ever shorter steps; each number twice the one before, all stable. It starts a little too
    long, so that there is an error to see above the rounding of float32."""
    return _rows(list(substeps), [swing(cells, 1 / FRAME_RATE / count, 1.02, 8)[0] for count in substeps])
