"""Friction between layers: what lies on a slope, alone and beneath another, slides at the angle and as fast as Coulomb
says; a stack stays where it is."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from layers import SOFT, SPACING, THICKNESS
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.crossings.crossings import find_crossings
from taichi_cloth.motion.forces import Forces, Plane, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

G, FRICTION, AIR = 9.81, 0.2, 0.5
THIN_AIR = replace(SOFT, air_damping=AIR)
SPRINGS = calibrate(THIN_AIR, spacing_x=SPACING, spacing_y=SPACING)
SPAN = 6  # rows of a panel of the stack
SOLVERS = [Verlet, pytest.param(Yarns, marks=pytest.mark.slow)]


@cache
def slope(covered: bool) -> tuple[Sheet, float]:
    """A panel that is held, a strip of 11 rows that lies on it, and maybe a cover of 8 on that, its highest row held;
    and how much heavier the strip presses than it weighs, both of its sides together."""
    cells = np.ones((39, 6), bool)
    cells[18:20] = cells[30:32] = False
    if not covered:
        cells[32:] = False
    row = np.arange(40)[:, None]
    sheet = Sheet.of_cells(cells, material=THIN_AIR, springs=SPRINGS, pinned=(row < 19) | (row == 32))
    return sheet, 1 + 2 * float(sheet.mass[33:].sum() / sheet.mass[20:31].sum())


def slid(kind: type[Verlet] | type[Yarns], covered: bool, steepness: float) -> tuple[NDArray, float]:
    """Where the strip is after each of 24 frames [m], on a slope of so many times the tangent at which it begins to
    slide; and how fast it should get faster [m/s²]."""
    sheet, load = slope(covered)
    angle = np.arctan(steepness * FRICTION * load)
    x = sheet.flat()[..., [0, 2, 1]]
    x[20:31] += [0.003, THICKNESS, 0.013 - x[20, 0, 2]]
    x[32:] += [0.005, 2 * THICKNESS, 0.045 - x[32, 0, 2]]
    x[32, :, 1] += 0.1 * THICKNESS  # what is held does not pinch the strip
    down = G * np.array([0.0, -np.cos(angle), np.sin(angle)])
    forces = Forces(gravity=tuple(down), self_contact=SelfContact(thickness=THICKNESS, friction=FRICTION))
    solver = kind(sheet, forces, threads=1, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    at = []
    for _ in range(24):
        simulation.step()
        at.append(simulation.positions[20:31, :, 2].mean())
    return np.array(at, float), G * (np.sin(angle) - FRICTION * load * np.cos(angle))


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("covered", [False, True])
def test_a_strip_slides_at_the_angle_that_coulomb_says(kind: type[Verlet] | type[Yarns], covered: bool) -> None:
    """Alone at tan θ = µ; between two layers, of which the upper one is held back, at µ (1 + 2 M/m). In 0.4 s it comes
    less than 0.05 mm at 0.95 of it, as it settles, and whole millimetres at 1.05."""
    stays, _ = slid(kind, covered, 0.95)
    goes, _ = slid(kind, covered, 1.05)
    assert abs(stays[-1] - stays[0]) < 5e-5
    assert goes[-1] - goes[0] > 4e-3


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize(("covered", "error"), [(False, 0.04), (True, 0.12)])
def test_a_strip_slides_as_fast_as_coulomb_says(kind: type[Verlet] | type[Yarns], covered: bool, error: float) -> None:
    """a = g (sin θ − µ load cos θ), less what the air takes, from the third to the eighth frame."""
    at, exact = slid(kind, covered, 1.6)
    speed = 60 * np.diff(at)[2:8]
    faster = 60 * (speed[-1] - speed[0]) / 5 + AIR * speed.mean()
    assert faster == pytest.approx(exact, rel=error)


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("steepness", [0.95, 1.6])
def test_a_floor_holds_the_place_of_what_lies_on_it_and_lets_go_of_what_slides(
    kind: type[Verlet] | type[Yarns], steepness: float
) -> None:
    """Cloth that meets cloth on a slope of so many times the tangent of the floor's friction: it stays within 5 µm in
    0.4 s, or gets faster by g (sin θ − µ cos θ), less what the air takes."""
    sheet, x = stack(1)
    angle = np.arctan(steepness * FRICTION)
    down = G * np.array([0.0, -np.cos(angle), np.sin(angle)])
    plane = Plane(gap=THICKNESS, friction=FRICTION)
    forces = Forces(gravity=tuple(down), self_contact=SelfContact(thickness=THICKNESS), plane=plane)
    solver = kind(sheet, forces, threads=1, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    at = []
    for _ in range(24):
        simulation.step()
        at.append(float(simulation.positions[..., 2].mean()))
    speed = 60 * np.diff(at)[8:]
    faster = 60 * (speed[-1] - speed[0]) / (len(speed) - 1) + SOFT.air_damping * speed.mean()
    if steepness < 1:
        assert abs(at[-1] - at[8]) < 5e-6
    else:
        assert faster == pytest.approx(G * (np.sin(angle) - FRICTION * np.cos(angle)), rel=0.02)


def stack(panels: int) -> tuple[Sheet, NDArray]:
    """So many panels on each other, up to 3 mm to the side of where they should be."""
    period = SPAN + 1
    cells = np.ones((panels * period - 2, SPAN - 1), bool)
    for k in range(1, panels):
        cells[k * period - 2 : k * period] = False
    sheet = Sheet.of_cells(cells, material=SOFT, springs=SPRINGS)
    x, rng = sheet.flat()[..., [0, 2, 1]], np.random.default_rng(1)
    for k in range(panels):
        mine = slice(k * period, k * period + SPAN)
        aside = rng.uniform(-0.003, 0.003, 2)
        x[mine] += [aside[0], (1 + 1.02 * k) * THICKNESS, aside[1] - x[mine.start, 0, 2]]
    return sheet, x


@pytest.mark.parametrize("kind", SOLVERS)
def test_ten_sheets_stay_on_each_other(kind: type[Verlet] | type[Yarns]) -> None:
    """Whole thicknesses apart, at rest: below 1 mm/s, and 0.1 mm of creep, 5 µm to the side, in the second and third
    second; and a frame follows from the state that it begins with."""
    sheet, x = stack(10)
    forces = Forces(self_contact=SelfContact(thickness=THICKNESS), plane=Plane(gap=THICKNESS))
    solver = kind(sheet, forces, threads=1, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    for _ in range(60):
        simulation.step()
    lay, present, speeds = simulation.positions, sheet.present, []
    for _ in range(120):
        before = simulation.positions
        simulation.step()
        speeds.append(60 * np.sqrt(((simulation.positions - before)[present] ** 2).sum(-1).mean()))
    now = simulation.positions
    assert np.mean(speeds) < 1e-3
    assert np.linalg.norm((now - lay)[present], axis=-1).max() < 1e-4
    assert np.abs((now - lay)[present][:, [0, 2]]).max() < 5e-6
    assert now[present][:, 1].max() == pytest.approx(10 * THICKNESS, abs=0.3 * THICKNESS)
    assert find_crossings(now.reshape(-1, 3), sheet.triangles).count == 0
    state = simulation.state.values.copy()
    simulation.step()
    after = simulation.state.values.copy()
    simulation.state.values[:] = state
    simulation.step()
    assert np.array_equal(simulation.state.values, after)
