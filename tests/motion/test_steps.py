"""Verlet's steps follow the shape: how stiff a sheet has become, and runs whose steps are shortened on the way."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from strips import COLS, NOTHING, PLAIN, ROWS, run, simulate, strip

from taichi_cloth.ground.errors import Unstable
from taichi_cloth.motion.forces import Forces, FrameForces, StrainLimit
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.stability.limit import found_limit
from taichi_cloth.scenes.stability.outcome import STABLE
from taichi_cloth.scenes.stability.sheets import Cell, ran
from taichi_cloth.sheet.energy import elastic_forces
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.stability import FrequencyBound, highest_frequency, longest_step
from taichi_cloth.solvers.verlet import Verlet


def square(**pins) -> Sheet:
    """12 × 12 key points with diagonals stiffer than threads."""
    material = replace(PLAIN, shear=150.0, air_damping=4.0)
    springs = calibrate(material, spacing_x=0.02, spacing_y=0.02)
    return Sheet.rectangle(12, 12, material=material, springs=springs, **pins)


def rng() -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=17))


def dense(sheet: Sheet, x: np.ndarray) -> float:
    """ω_max by differences of the forces at x."""
    free = np.flatnonzero(np.repeat(sheet.inverse_mass.ravel(), 3) > 0)
    small, rows = 1e-6 * sheet.springs.spacing_y, []
    for k in free:
        ends = []
        for sign in (1.0, -1.0):
            moved = x.ravel().copy()
            moved[k] += sign * small
            ends.append(elastic_forces(sheet, moved.reshape(x.shape)).ravel()[free])
        rows.append((ends[1] - ends[0]) / (2 * small))
    root = np.sqrt(np.repeat(sheet.inverse_mass.ravel(), 3)[free])
    k = root[:, None] * np.stack(rows) * root
    return float(np.linalg.eigvalsh((k + k.T) / 2)[-1] ** 0.5)


@pytest.mark.parametrize("bending", ["hinge", "spring"])
def test_the_highest_frequency_of_a_shape_is_that_of_its_forces(bending) -> None:
    """Of a strip that is longer everywhere, bent and uneven: within 1e-3. Where springs are pressed it is not below."""
    sheet = strip(rows=9, pinned=(0,), bending=bending, shear=20.0)
    x = 1.2 * sheet.flat() + 2e-2 * sheet.springs.spacing_y * rng().standard_normal((ROWS, COLS, 3))
    x[..., 2] += 0.3 * x[..., 1] ** 2
    exact = dense(sheet, x)
    assert highest_frequency(sheet, x) == pytest.approx(exact, rel=1e-3)
    assert exact < FrequencyBound(sheet).at(x) < 1.5 * exact
    pressed = 0.9 * sheet.flat()
    assert dense(sheet, pressed) < 1.001 * highest_frequency(sheet, pressed)


def test_no_shape_is_beyond_the_frequency_of_any() -> None:
    """Shaken, blown up, and folded so that all threads lie along one line, which comes within 2 % of it."""
    sheet = strip(shear=0.0)
    most = FrequencyBound(sheet).anywhere()
    for amount in (0.1, 1.0, 10.0):
        x = sheet.flat() + amount * sheet.springs.spacing_y * rng().standard_normal((ROWS, COLS, 3))
        assert highest_frequency(sheet, x) < most
    line = np.zeros((ROWS, COLS, 3))
    line[..., 0] = sheet.flat()[..., 0] + sheet.flat()[..., 1]
    assert 0.98 * most < highest_frequency(sheet, line) <= most


@pytest.mark.parametrize("bending", ["hinge", "spring"])
def test_the_kernel_finds_the_bound_of_a_frame_s_end(bending) -> None:
    """Against NumPy: not below by more than rounding, above by at most √3^(1/16). Springs damped, as in all tests of
    their kernel."""
    tau = 2e-4 if bending == "spring" else 0.0
    sheet = strip(pinned=(0,), bending=bending, shear=20.0, fibre_damping=tau)
    x = sheet.flat() + 0.3 * sheet.springs.spacing_y * rng().standard_normal((ROWS, COLS, 3))
    solver = Verlet(sheet, NOTHING, frame_rate=20_000.0)
    for shape in (x, 1.5 * x, sheet.flat()):
        state = sheet.state(shape)
        solver.advance(state, FrameForces())
        exact = solver.choice.bound.at(sheet.positions(state).astype(float))
        assert 0.99999 < solver._now / exact < 1.0175


@pytest.mark.parametrize("pulled", [0.2, 0.5])
def test_verlets_limit_is_where_the_frequency_of_the_shape_says(pulled: float) -> None:
    """A sheet held at its whole border, larger both ways: by bisection of runs, within 2 %."""
    held = np.zeros((ROWS, COLS), bool)
    held[[0, -1]] = held[:, [0, -1]] = True
    sheet = replace(strip(shear=20.0), pinned=held)
    found, said = found_limit(sheet, (1 + pulled) * sheet.flat())
    assert found == pytest.approx(said, rel=0.02)
    assert said < 0.99 * 2 / highest_frequency(sheet)


def pulled(share: float, seconds: float, **solver) -> Simulation:
    """`square`, whose last row is drawn away by a share of its length."""
    first, last = np.zeros((2, 12, 12), bool)
    first[0], last[-1] = True, True
    sheet = square(pinned=first | last)
    x = sheet.flat()
    away = share * (x[-1] - x[0])
    pins = (Pins(first), Pins(last, lambda time: x[-1] + min(time / seconds, 1.0) * away))
    return simulate(sheet, positions=x, pins=pins, **solver)


def test_a_sheet_that_gets_stiffer_gets_shorter_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pulled by a fifth in two seconds: after each frame its step is within the limit of its shape. With the steps of
    its start it blows up."""
    simulation = pulled(0.2, 2.0)
    solver, sheet = simulation.solver, simulation.sheet
    start = solver.step
    for _ in range(150):
        simulation.step()
        frequency = highest_frequency(sheet, simulation.positions.astype(float))
        assert solver.step < longest_step(frequency, air_damping=4.0)
    assert solver.step < 0.97 * start
    assert simulation.time == pytest.approx(150 / 60)
    monkeypatch.setattr(Verlet, "shorten", lambda *_: False)
    with pytest.raises(Unstable):
        run(pulled(0.2, 2.0), 150)


def test_a_pull_within_one_frame_is_taken_with_steps_for_any_shape() -> None:
    """By 30 % in 1/60 s: the frame ends in nothing that is a sheet, and is taken again."""
    simulation = pulled(0.3, 1 / 60, safety=1.0)
    most = FrequencyBound(simulation.sheet).anywhere()
    run(simulation, 60)
    assert np.isfinite(simulation.state.values).all()
    assert simulation.solver.step <= longest_step(most, air_damping=4.0)


def test_a_start_that_is_stiffer_than_rest_gets_steps_of_its_own() -> None:
    sheet = square()
    x = sheet.flat() * [1.0, 1.8, 1.0]
    usual, own = simulate(sheet).solver.step, simulate(sheet, positions=x).solver.step
    assert own < 0.95 * usual
    assert own < longest_step(highest_frequency(sheet, x), air_damping=4.0)


def test_shorter_steps_are_of_the_same_motion() -> None:
    """A free strip that falls, turns and shakes: shortened after 10 frames it goes on for 10 more as one whose steps
    were short from the start, to 1 mm of its 0.4 m. With the old steps it would be off by 87 mm."""
    sheet = strip(length=0.4, spacing_x=0.01)
    down = Forces(gravity=(0.0, 0.0, -9.81))
    x = sheet.flat() * [1.0, 1.01, 1.0]
    v = np.cross([2.0, 0.0, 3.0], x)
    paths = []
    for shortened in (False, True):
        step = None if shortened else 0.9 * longest_step(FrequencyBound(sheet).anywhere())
        simulation = simulate(sheet, forces=down, positions=x, velocities=v, step=step)
        run(simulation, 10)
        before = simulation.solver.step
        if shortened:
            assert simulation.solver.shorten(simulation.state, None)
            assert simulation.solver.step < 0.8 * before
        paths.append(run(simulation, 10))
    assert np.abs(paths[0] - paths[1]).max() < 1e-3


def test_pulls_of_the_limit_go_with_the_steps() -> None:
    """A strip that hangs still on its limit goes on hanging when steps are shortened: no faster than 1 cm/s, and its
    pulls are those that such a strip has whose steps were short from the start, within 2 %."""
    hanging = Forces(gravity=(0.0, 9.81, 0.0), strain_limit=StrainLimit(strain=0.02, passes=8))
    soft = {"tensile_warp": 20.0, "tensile_weft": 20.0, "shear": 2.0, "air_damping": 8.0}
    sheet = strip(pinned=(0,), spacing_x=0.01, **soft)  # pyright: ignore[reportArgumentType]
    pulls = []
    for step in (1 / 60 / 40, 1 / 60 / 80):
        simulation = simulate(sheet, forces=hanging, step=step)
        run(simulation, 120)
        pulls.append(simulation.state.values[7].max())
    simulation = simulate(sheet, forces=hanging, step=1 / 60 / 40)
    run(simulation, 120)
    solver = simulation.solver
    assert isinstance(solver, Verlet)
    before = solver.step
    solver.take_steps(80)
    solver.rescale(simulation.state, before)
    share = float(simulation.state.values[7].max() / pulls[1])
    assert pulls[0] / pulls[1] == pytest.approx(4.0, rel=0.1)
    assert share == pytest.approx(1.0, rel=0.1)
    paths = run(simulation, 2)
    assert np.abs(np.diff(paths, axis=0)).max() * 60 < 0.01


def test_a_run_that_goes_on_after_its_steps_were_shortened_is_the_run_left_alone(tmp_path: Path) -> None:
    whole = pulled(0.2, 2.0)
    usual = whole.solver.step
    run(whole, 120)
    assert whole.solver.step < usual
    whole.save(tmp_path / "state.npz")
    run(whole, 20)
    again = pulled(0.2, 2.0)
    again.restore(tmp_path / "state.npz")
    assert again.solver.step < usual
    run(again, 20)
    assert again.state.values.tobytes() == whole.state.values.tobytes()
    assert again.solver.found == whole.solver.found


def test_a_cell_of_the_matrix_is_pulled_beyond_its_first_steps() -> None:
    found = ran(Cell(solver="verlet", start="pulled"), 2.5)
    assert found.verdict == STABLE, found
    assert found.stretch > 0.3


def test_steps_in_which_neighbours_pass_each_other_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A strip blown up fiftyfold, whose first row is held and whose start nobody settles: every state is finite and no
    thread longer than at the start, but springs turn over unseen, and the energy is made up."""
    monkeypatch.setattr(Verlet, "overstrained", lambda self, state: False)
    sheet = strip(pinned=(0,))
    x = 50.0 * sheet.flat()
    x[0] = sheet.flat()[0]
    with pytest.raises(Unstable, match=r"pass their neighbours by .* in one step of .* µs \(allowed: 2\)"):
        run(simulate(sheet, positions=x), 10)


def test_steps_are_left_alone_where_nothing_gets_stiffer() -> None:
    """Cotton that falls on its own: the steps of its start are kept."""
    sheet = strip(pinned=(0,), air_damping=2.0)
    simulation = simulate(sheet, forces=Forces(gravity=(0.0, 0.0, -9.81)))
    usual = simulation.solver.found
    run(simulation, 60)
    assert simulation.solver.found == usual
