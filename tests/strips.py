"""Strips of cloth that the dynamics tests share: one grid shape, so that one kernel serves most of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import BendingLaw, calibrate
from taichi_cloth.solvers.verlet import Verlet

ROWS, COLS = 41, 3
PLAIN = Material(
    tensile_warp=50.0,
    tensile_weft=50.0,
    shear=5.0,
    bending_warp=1e-5,
    bending_weft=1e-5,
    density=0.15,
    air_damping=0.0,
)
NOTHING = Forces(gravity=(0.0, 0.0, 0.0))


def strip(
    *,
    length: float = 0.4,
    rows: int = ROWS,
    pinned: tuple[int, ...] = (),
    bending: BendingLaw = "hinge",
    spacing_x: float | None = None,
    **changes: float,
) -> Sheet:
    """A strip along the warp of `length` [m] with `rows` of the grid's rows in use. pinned: rows held."""
    material = replace(PLAIN, **changes)
    b = length / (rows - 1)
    cells = np.zeros((ROWS - 1, COLS - 1), bool)
    cells[: rows - 1] = True
    held = np.zeros((ROWS, COLS), bool)
    held[list(pinned)] = True
    springs = calibrate(material, spacing_x=spacing_x or b, spacing_y=b, bending=bending)
    return Sheet.of_cells(cells, material=material, springs=springs, pinned=held)


def simulate(
    sheet: Sheet,
    *,
    forces: Forces = NOTHING,
    positions: NDArray | None = None,
    velocities: NDArray | float = 0.0,
    pins: tuple[Pins, ...] = (),
    ties: tuple[Ties, ...] = (),
    choose: Callable[..., tuple[Constraint, ...]] = constraints_for,
    **solver,
) -> Simulation:
    return Simulation(
        sheet,
        Verlet(sheet, forces, constraints=choose(sheet, forces, ties=ties), **solver),
        forces=forces,
        positions=sheet.flat() if positions is None else positions,
        velocities=velocities,
        pins=pins,
    )


def run(simulation: Simulation, frames: int) -> NDArray:
    """Positions (frames + 1, rows, cols, 3) [m]."""
    out = [simulation.positions]
    for _ in range(frames):
        simulation.step()
        out.append(simulation.positions)
    return np.stack(out)
