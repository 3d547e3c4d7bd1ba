"""Friction within a cloth, torsion and locking in a scene: by name, by number, or not at all."""

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.presets import preset_properties
from taichi_cloth.scenes.fabric.ticket import ticket_of
from taichi_cloth.scenes.plan.plan_cloth import within_stages
from taichi_cloth.scenes.prepare.construction import own_material
from taichi_cloth.scenes.prepare.sheet_setup import material_of, moved_by, sheet_of
from taichi_cloth.scenes.scene.load import make_scene
from taichi_cloth.scenes.scene.schema import Scene
from taichi_cloth.sheet.materials import MATERIALS, Material


def cotton(**properties: object) -> Scene:
    sheet = {"columns": 21, "rows": 21, "material": "cotton-shirting", "representation": "mesh"}
    return make_scene({"cloth": {**sheet, "properties": properties}})


def material(**properties: object) -> Material:
    scene = cotton(**properties)
    assert scene.cloth is not None
    return material_of(scene.cloth, scene.solver, own_material(scene))


def test_a_scene_that_says_nothing_moves_by_springs_alone() -> None:
    scene = cotton()
    assert own_material(scene) is None
    assert material() == MATERIALS["cotton-shirting"] == material().elastic
    built, left = within_stages(scene)
    assert not built
    assert left["within cloth"].startswith(
        "without couple, torsion, shear-hysteresis, locking: cloth.properties.within"
    )


def test_all_or_some_of_what_the_fabric_has_moves_as_well() -> None:
    woven = preset_properties("cotton-shirting")
    cloth = material(within="all")
    assert cloth.couple_warp == pytest.approx(woven.si("couple_warp") / 2)
    assert cloth.torsion == pytest.approx(woven.si("torsion"))
    assert cloth.shear_friction == pytest.approx(woven.si("shear_hysteresis") / 2)
    assert cloth.locking == pytest.approx(woven.si("locking_angle"))
    some = material(within=["torsion", "locking"])
    assert (some.couple_warp, some.shear_friction) == (0.0, 0.0)
    assert (some.torsion, some.locking) == (cloth.torsion, cloth.locking)
    built, left = within_stages(cotton(within=["torsion"]))
    assert built["within cloth"].startswith("torsion J 8.47 µN·m; without couple, shear-hysteresis, locking: ")
    assert not left


def test_a_number_that_is_stated_moves_whatever_else_does_and_the_ticket_says_whose_it_is() -> None:
    scene = cotton(couple_warp_mn=3, locking_angle_deg=40)
    moves = moved_by(scene)
    assert (moves["couple_warp"].value, moves["couple_warp"].origin) == (pytest.approx(3.0), "stated")
    assert "torsion" not in moves
    assert scene.cloth is not None
    assert sheet_of(scene.cloth, scene.solver, own_material(scene)).springs.slips
    draped = ticket_of(scene).material  # a disc has all of it
    assert draped.couple_warp == pytest.approx(1.5e-3)
    assert draped.torsion == pytest.approx(preset_properties("cotton-shirting").si("torsion"))


@pytest.mark.parametrize("change", [{"within": "some"}, {"within": ["twist"]}, {"couple_warp_mn": -1}])
def test_what_cannot_be_is_refused_in_one_line(change: dict[str, object]) -> None:
    with pytest.raises(InputError) as caught:
        cotton(**change)
    assert "\n" not in str(caught.value)
    assert "cloth.properties" in str(caught.value)
