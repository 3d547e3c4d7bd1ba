"""The solver that a sheet gets by itself, and what each is said to cost."""

from dataclasses import replace

import pytest

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.ground import runtime
from taichi_cloth.motion.forces import Forces, StrainLimit
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare.sheet_setup import sheet_simulation
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.choice import WITHIN, choose
from taichi_cloth.solvers.named import SOLVERS
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import CHAINED, LONGEST

SOFT = Material(tensile_warp=100.0, tensile_weft=100.0, shear=50.0, bending_warp=0.0, bending_weft=0.0, density=0.1)
SMALL = ["cloth.representation=mesh", "cloth.columns=9", "cloth.rows=9"]


def sheet_of(**changes: float) -> Sheet:
    material = replace(SOFT, **changes)
    springs = calibrate(material, spacing_x=0.02, spacing_y=0.02)
    return Sheet.rectangle(12, 12, material=material, springs=springs)


def test_soft_threads_go_to_verlet_and_stiff_ones_to_whole_yarns_whose_cost_does_not_grow() -> None:
    soft, stiff, stiffer = (choose(sheet_of(tensile_warp=k, tensile_weft=k), Forces()) for k in (100.0, 1e5, 1e7))
    assert (soft.name, stiff.name, stiffer.name) == ("verlet", "yarns", "yarns")
    assert soft.ratio == 2.0
    assert stiffer.costs["verlet"].share == pytest.approx(10 * stiff.costs["verlet"].share, rel=0.01)
    assert stiffer.costs["yarns"] == stiff.costs["yarns"]


def test_stiff_shear_is_solved_in_chains_where_that_costs_less() -> None:
    chosen = choose(sheet_of(shear=1e6, tensile_warp=1e6, tensile_weft=1e6), Forces())
    assert chosen.name == "yarns"
    assert chosen.costs["yarns"].step == LONGEST
    assert chosen.costs["yarns"].share == pytest.approx(CHAINED * choose(sheet_of(), Forces()).costs["yarns"].share)


def test_what_verlet_cannot_do_as_well_goes_to_whole_yarns_whatever_it_costs() -> None:
    curved = sheet_of(drawn_warp=120.0, crimp_warp=0.01)
    assert choose(curved, Forces()).name == "yarns"
    assert choose(sheet_of(), Forces(strain_limit=StrainLimit(strain=0.1))).name == "yarns"


def test_verlet_is_counted_with_threads_as_stiff_as_they_get() -> None:
    curved = choose(sheet_of(drawn_warp=1e4, drawn_weft=1e4, crimp_warp=0.01, crimp_weft=0.01), Forces())
    straight = choose(sheet_of(tensile_warp=1e4, tensile_weft=1e4), Forces())
    assert curved.ratio == straight.ratio == 200.0
    assert curved.costs["verlet"].step == pytest.approx(straight.costs["verlet"].step, rel=0.01)


def test_friction_within_costs_each_solver_its_own_share() -> None:
    """At the same stiffness before anything slips, so that steps are the same."""
    without = choose(sheet_of(bending_warp=1e-5, bending_weft=1e-5), Forces())
    held = choose(sheet_of(bending_warp=1e-5, bending_weft=1e-5, shear_friction=1e-12), Forces())
    for name, factor in WITHIN.items():
        steps = without.costs[name].step / held.costs[name].step
        assert held.costs[name].share == pytest.approx(factor * steps * without.costs[name].share, rel=1e-6)
    assert WITHIN["verlet"] > WITHIN["yarns"] > 1


@pytest.mark.parametrize("stiff", ["50", "1e5"])
@pytest.mark.parametrize("name", ["auto", *SOLVERS])
def test_a_plan_names_the_solver_that_moves_the_scene(name: str, stiff: str) -> None:
    both = [f"cloth.properties.tensile_{family}_n_per_m={stiff}" for family in ("warp", "weft")]
    scene = load_scene("drape", [*SMALL, *both, "cloth.properties.shear_n_per_m=20", f"solver.name={name}"])
    said = {stage.name: stage.why for stage in plan(scene).stages}
    solver = sheet_simulation(scene).solver
    assert isinstance(solver, SOLVERS[said["solver"].split(",")[0]])
    assert f", {solver.substeps} substeps" in said["solver"]
    if name == "auto":
        assert isinstance(solver, SOLVERS["verlet" if stiff == "50" else "yarns"])
    else:
        assert isinstance(solver, SOLVERS[name])
        assert "the scene names it" in said["solver's cost"]


def test_large_sheets_go_through_loops_on_two_threads_where_they_meet_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Verlet, "loops_win_from", 144)
    monkeypatch.setattr(runtime, "threads", lambda: 2)
    sheet, limit = sheet_of(), Forces(strain_limit=StrainLimit(strain=0.1))
    assert Verlet(sheet, Forces()).spread
    assert not Verlet(sheet, limit, constraints=constraints_for(sheet, limit)).spread
    monkeypatch.setattr(Verlet, "loops_win_from", 145)
    assert not Verlet(sheet, Forces()).spread
    monkeypatch.setattr(Verlet, "loops_win_from", 144)
    monkeypatch.setattr(runtime, "threads", lambda: 1)
    assert not Verlet(sheet, Forces()).spread
