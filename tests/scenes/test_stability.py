"""The matrix: what a cell may come to, and cells that are quick; what was mended for it."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion import kernel_solver
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.stability.limit import found_limit
from taichi_cloth.scenes.stability.outcome import NEITHER, REFUSED, STABLE, tried
from taichi_cloth.scenes.stability.program import program_cases
from taichi_cloth.scenes.stability.sheets import Cell, cells, energy_made, ran
from taichi_cloth.scenes.stability.starts import STARTS
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import Springs
from taichi_cloth.solvers.stability import rounding_speed
from taichi_cloth.solvers.verlet import Verlet


def test_the_matrix_has_every_start_stiffness_step_mass_and_spacing() -> None:
    every = cells()
    assert {(c.solver, c.start) for c in every} == {(s, start) for s in ("", "verlet") for start in STARTS}
    assert {c.stiffness for c in every} == {10.0**k for k in range(9)}
    assert {round(1 / c.frame) for c in every} == {240, 60, 10}
    assert max(c.ratio for c in every) == 1e6
    assert min(c.spacing for c in every) == 1e-4
    assert {c.start for c in every if c.limited} == set(STARTS)
    assert {(c.threads, c.shear, c.bending) for c in every} >= {(1e6, 1, 1), (1, 100, 1), (1, 1, 1e4)}
    assert len(set(every)) == len(every)
    assert set(cells(quick=True)) <= set(every)


@pytest.mark.parametrize(
    ("cell", "verdict", "says"),
    [
        (Cell(solver="verlet"), STABLE, ""),
        (Cell(solver="verlet", start="thrown"), STABLE, ""),
        (Cell(solver="verlet", stiffness=1e4), REFUSED, 'solver.name = "yarns"'),
        (Cell(solver="verlet", start="shuffled", limited=True), STABLE, ""),
        (Cell(start="no rest length"), REFUSED, "springs.spacing_x: 0.0"),
        (Cell(start="no mass"), REFUSED, "material.density: 0.0"),
        (Cell(threads=1e6, start="held"), STABLE, ""),
        (Cell(threads=1e4, start="crumpled"), STABLE, ""),
        (Cell(start="point"), STABLE, ""),
        (Cell(start="inside out"), STABLE, ""),
        (Cell(bending=1e8), REFUSED, "rounding alone would shake"),
    ],
    ids=lambda value: value.what if isinstance(value, Cell) else "",
)
def test_a_cell_is_stable_or_refused_with_its_line(cell: Cell, verdict: str, says: str) -> None:
    found = ran(cell, 0.2)
    assert found.verdict == verdict, found
    assert says in found.line
    assert "\n" not in found.line
    if verdict == STABLE:
        assert found.drift < 0.05
        assert found.line == ""


def test_what_is_neither_is_said_to_be() -> None:
    def broken() -> str:
        raise ZeroDivisionError("by zero")

    assert tried("part", "case", broken).verdict == NEITHER
    assert "ZeroDivisionError: by zero" in tried("part", "case", broken).line
    assert tried("part", "case", lambda: "fine").verdict == STABLE


@pytest.mark.parametrize("case", program_cases(quick=True), ids=lambda case: f"{case[0]}, {case[1]}")
def test_the_edges_of_the_program_are_stable_or_refused(case) -> None:
    found = tried(*case)
    assert found.verdict in (STABLE, REFUSED), found
    refused = {"V = −0.5 m/s", "no rest length", "no width", "0 × 0"}
    if case[1] != "16384 × 16384":  # that follows from the machine
        assert (found.verdict == REFUSED) == (case[1] in refused), found


def small(**changes: float) -> Sheet:
    from taichi_cloth.sheet.materials import named_material
    from taichi_cloth.sheet.springs import calibrate

    material = replace(named_material("cotton-shirting").linear, **changes)
    held = np.zeros((12, 12), bool)  # of the shape of the matrix' sheets: one kernel
    held[0] = True
    springs = calibrate(material, spacing_x=0.02, spacing_y=0.02)
    return Sheet.rectangle(12, 12, material=material, springs=springs, pinned=held)


@pytest.mark.parametrize(
    "changes",
    [{}, {"shear": 0.0}, {"bending_warp": 1e-3}, pytest.param({"fibre_damping": 2e-4}, marks=pytest.mark.slow)],
)
def test_verlets_limit_is_found_where_it_is_predicted_and_the_automatic_step_is_below(changes: dict) -> None:
    """By bisection of runs, within 2 %; without damping it is 2/ω_max."""
    sheet = small(**changes)
    found, predicted = found_limit(sheet)
    assert found == pytest.approx(predicted, rel=0.02)
    solver = Verlet(sheet, Forces())
    assert solver.step <= 0.9 * predicted < found
    if "fibre_damping" not in changes:
        assert found == pytest.approx(2 / solver.choice.frequency, rel=0.02)


def test_rounding_grows_as_steps_shrink_and_damping_stills_it() -> None:
    """3.2 ε/h √(1/2ch), ε = ulp/√12: a tenth of the step, 10^1.5 times the speed."""
    ulp = 2.0**-25
    speed = rounding_speed(1e-6, ulp, air_damping=4.0)
    assert speed == pytest.approx(3.2 * ulp / 12**0.5 / 1e-6 * (1 / 8e-6) ** 0.5, rel=1e-6)
    assert rounding_speed(1e-7, ulp, air_damping=4.0) == pytest.approx(10**1.5 * speed, rel=1e-6)
    assert rounding_speed(1e-6, 2 * ulp, air_damping=4.0) == pytest.approx(2 * speed, rel=1e-6)
    assert rounding_speed(1e-6, ulp, air_damping=4.0, fibre_damping=1e-6) < 0.01 * speed


def test_rounding_shakes_a_sheet_as_fast_as_predicted() -> None:
    """A sheet of 100 × the stiffness at rest without gravity: its root mean square speed after half a second, within a
    third. All its coordinates lie in 0.26 to 0.48 m, where float32 is equally fine."""
    sheet = small(tensile_warp=1e5, tensile_weft=1e5, shear=6e3, air_damping=4.0)
    solver = Verlet(sheet, Forces(gravity=(0.0, 0.0, 0.0)))
    simulation = Simulation(sheet, solver, forces=Forces(gravity=(0.0, 0.0, 0.0)), positions=sheet.flat() + 0.26)
    for _ in range(30):
        simulation.step()
    free = sheet.inverse_mass > 0
    speed = np.sqrt((sheet.steps(simulation.state)[free].astype(float) ** 2).sum(-1).mean()) / solver.step
    assert speed == pytest.approx(solver.rounding(2.0**-25), rel=0.34)


def test_a_sheet_that_starts_too_long_may_stay_so_but_not_grow() -> None:
    sheet = small()
    x = sheet.flat() * [1.0, 2.5, 1.0]
    brief = Verlet(sheet, Forces(), frame_rate=2000.0)
    simulation = Simulation(sheet, brief, forces=Forces(), positions=x)
    simulation.step()
    torn = simulation.state.copy()
    torn.values[1] *= 300.0
    with pytest.raises(Unstable, match=r"stretched by \d+ %"):
        simulation._check(torn)


def test_springs_without_rest_length_or_with_negative_constants_are_refused() -> None:
    good = small().springs
    for name, value in (("spacing_x", 0.0), ("spacing_y", float("nan")), ("diagonal", -1.0)):
        with pytest.raises(InputError, match=f"springs.{name}"):
            replace(good, **{name: value})  # pyright: ignore[reportArgumentType]
    assert isinstance(replace(good, diagonal=0.0), Springs)


def test_what_threads_give_back_is_not_made() -> None:
    """Energies [J] frame by frame: a blow of 10 of which threads take 6 and give back 5."""
    total = np.array([10.0, 10.0, 0.0, 5.0, 3.0])
    assert energy_made(total, np.array([0.0, 0.0, 6.0, 1.0, 0.0])) == 0.0
    assert energy_made(total, np.zeros(5)) == 5.0
    assert energy_made(total, np.array([0.0, 0.0, 3.0, 1.0, 0.0])) == 2.0


def test_threads_cannot_give_back_more_than_was_lost() -> None:
    """They are longer than the rest had energy for: 50 J by their length, where it lost 1 J."""
    assert energy_made(np.array([1.0, 0.0, 30.0]), np.array([0.0, 50.0, 50.0])) == 29.0
    # Nor what the rest lost while they held nothing.
    assert energy_made(np.array([8.0, 1.0, 1.0, 6.0]), np.array([0.0, 0.0, 50.0, 50.0])) == 5.0


@pytest.mark.slow  # a kernel of its own
def test_a_blow_that_threads_take_at_their_limit_makes_no_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_solver, "WORTH_THREADS", 0)  # the kernel of the tests of whole yarns
    found = ran(Cell(start="dropped", stiffness=1e2, limited=True))
    assert found.verdict == STABLE, found
    assert found.drift < 0.01
