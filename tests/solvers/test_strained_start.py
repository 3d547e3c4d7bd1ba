"""Starts that no cloth survives come to rest before time begins, or are refused; all others are left alone."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, Plane, Sphere
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material, named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.strained_start import LONGEST, TEARING, overstrain, survived
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

SIDE, SPACING = 12, 0.03
COTTON = replace(named_material("cotton-shirting").linear, air_damping=4.0)
REAL = replace(COTTON, tensile_warp=1e5, tensile_weft=1e5)
FAR = Forces(  # as in the tests of whole yarns: one kernel
    sphere=Sphere(centre=(0.0, -900.0, 0.0), radius=0.25, friction=0.3), plane=Plane(height=-1000.0, friction=0.3)
)


def sheet_of(material: Material, *rows: int) -> Sheet:
    """rows: that are held."""
    held = np.zeros((SIDE, SIDE), bool)
    held[list(rows)] = True
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    return Sheet.rectangle(SIDE, SIDE, material=material, springs=springs, pinned=held)


def started(sheet: Sheet, positions: np.ndarray) -> Simulation:
    """Held key points where they are in the flat sheet."""
    x = np.where(sheet.pinned[..., None], sheet.flat(), positions)
    pins = (Pins(sheet.pinned),) if sheet.pinned.any() else ()
    return Simulation(sheet, Yarns(sheet, FAR), forces=FAR, positions=x, pins=pins)


def bad_starts(flat: np.ndarray) -> dict[str, np.ndarray]:
    rng = np.random.Generator(np.random.Philox(key=7))
    return {
        "a point": 0.0 * flat,
        "a line": flat * [1.0, 0.0, 0.0],
        "shuffled": rng.permutation(flat.reshape(-1, 3)).reshape(flat.shape),
        "ten times as long": 10.0 * flat,
        "a crumpled ball": 0.03 * rng.standard_normal(flat.shape),
    }


@pytest.mark.parametrize("start", list(bad_starts(np.zeros((SIDE, SIDE, 3)))))
def test_a_start_that_no_cloth_survives_comes_to_rest(start: str) -> None:
    """Threads of 10⁵ N/m, whose sound runs at 930 m/s: hanging at rest after three seconds, and no key point was ever
    faster than 60 m/s, where a fall makes 3."""
    sheet = sheet_of(REAL, 0)
    run = started(sheet, bad_starts(sheet.flat())[start])
    assert run.solver.overstrained(run.state)
    speeds = []
    for _ in range(180):
        run.step()
        speeds.append(np.linalg.norm(sheet.steps(run.state), axis=-1) / run.solver.step)
    assert np.max(speeds) < 60.0
    assert speeds[-1].mean() < 0.1
    assert max(float(np.abs(part).max()) for part in sheet.stretch(run.positions)) < 1e-3


def test_time_does_not_pass_while_a_start_is_settled() -> None:
    """A free sheet, crumpled: what pulls it together comes from within, so that its middle stays where it was."""
    sheet = sheet_of(REAL)
    x = bad_starts(sheet.flat())["a crumpled ball"]
    run = started(sheet, x)
    run.solver.settle(run.state)
    assert overstrain(sheet, run.positions) <= 1
    weight = sheet.mass[..., None] / sheet.mass.sum()
    assert np.linalg.norm((weight * (run.positions - x)).sum((0, 1))) < 2e-4
    assert not sheet.steps(run.state).any()


@pytest.mark.parametrize(("material", "strain"), [(COTTON, 0.3), (REAL, 0.15)])
def test_a_start_that_cloth_survives_is_left_alone(material: Material, strain: float) -> None:
    """Drawn by that much and let go it springs back: nobody settles it."""
    sheet = sheet_of(material)
    run = started(sheet, (1 + strain) * sheet.flat())
    assert not run.solver.overstrained(run.state)
    before = run.positions
    run.step()
    assert np.ptp(run.positions[..., 0]) < np.ptp(before[..., 0]) - 0.1 * strain * SIDE * SPACING


def test_what_threads_survive_is_half_their_length_or_the_energy_that_tears_them() -> None:
    assert survived(COTTON)[:2] == (LONGEST, LONGEST)
    weft, warp, sheared = survived(replace(REAL, drawn_warp=4e5, crimp_warp=0.03, shear=1e5))
    assert weft == pytest.approx((2 * TEARING * COTTON.density / 1e5) ** 0.5)
    assert warp == pytest.approx(0.03 + weft / 2)
    assert sheared == pytest.approx(weft / 2)
    sheet = sheet_of(COTTON)
    assert overstrain(sheet, 1.25 * sheet.flat()) == pytest.approx(0.5)
    assert overstrain(sheet, 0.25 * sheet.flat()) == pytest.approx(1.5)


def test_pins_that_are_too_far_apart_are_refused_in_one_line() -> None:
    sheet = sheet_of(REAL, 0, SIDE - 1)
    x = sheet.flat() * [1.0, 3.0, 1.0]
    run = Simulation(sheet, Yarns(sheet, FAR), forces=FAR, positions=x, pins=(Pins(sheet.pinned),))
    with pytest.raises(InputError, match=r"start: threads are strained .* let pins be no further apart") as refused:
        run.step()
    assert "\n" not in str(refused.value)


def test_a_start_with_holes_in_it_is_refused() -> None:
    sheet = sheet_of(REAL, 0)
    x = sheet.flat()
    x[3, 4] = np.nan
    with pytest.raises(InputError, match="positions that are not finite"):
        started(sheet, x)


@pytest.mark.parametrize("start", ["a point", "ten times as long"])
def test_verlet_has_such_starts_settled_by_whole_yarns(start: str) -> None:
    sheet = sheet_of(COTTON, 0)
    x = np.where(sheet.pinned[..., None], sheet.flat(), bad_starts(sheet.flat())[start])
    run = Simulation(sheet, Verlet(sheet, FAR), forces=FAR, positions=x, pins=(Pins(sheet.pinned),))
    for _ in range(180):
        run.step()
    assert np.linalg.norm(sheet.steps(run.state), axis=-1).mean() < 0.1 * run.solver.step
    assert max(float(np.abs(part).max()) for part in sheet.stretch(run.positions)) < 0.01


def test_a_settled_run_that_was_saved_goes_on_to_the_same_bytes(tmp_path) -> None:
    sheet = sheet_of(REAL, 0)
    x = bad_starts(sheet.flat())["shuffled"]
    whole, rest = started(sheet, x), started(sheet, x)
    for _ in range(2):
        whole.step()
    whole.save(tmp_path / "state.npz")
    rest.restore(tmp_path / "state.npz")
    for one in (whole, rest):
        one.step()
    assert rest.state.values.tobytes() == whole.state.values.tobytes()
