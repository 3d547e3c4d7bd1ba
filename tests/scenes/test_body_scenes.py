"""Sheets that meet a body: built where the scene has one, pinned to it, and never far inside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.body.colliders.grid import _inside
from taichi_cloth.body.colliders.query import PrimitiveQuery
from taichi_cloth.body.figure import build
from taichi_cloth.body.figure.anthropometry import Gender
from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.primitives import primitives
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitive_file import primitives_json
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.ready import SEEDS, fit_body, ready_primitives
from taichi_cloth.body.primitives.samples import mesh_distance
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.constraint import shared_fields
from taichi_cloth.scenes.body.report_body import garment_points
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare import body_setup
from taichi_cloth.scenes.prepare.sheet_setup import sheet_simulation, standing_in
from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene

SMALL = ["cloth.representation=mesh", "cloth.columns=31", "cloth.rows=21"]
SMALL += ["forces.self_contact=false"]  # what meets here is cloth and body; cloth and cloth take seconds to load
"""Changes of a built-in scene that make it quick."""


def depth(model: ClothModel) -> float:
    """How deep the deepest key point that is not carried by the body is in its primitives now [m]; negative: outside.

    Key points are brought to the body at rest, primitive by primitive.
    """
    assert model.body is not None
    simulation, colliders = model.simulation, model.body.colliders
    points = simulation.positions[~simulation.sheet.pinned].astype(np.float64)
    where = colliders.at(simulation.time)
    deepest = -np.inf
    for p in colliders.primitives:
        back = np.linalg.inv(where[p.bone])
        distance, _, _ = nearest_distance([p], points @ back[:3, :3].T + back[:3, 3])
        deepest = max(deepest, -float(distance.min()))
    return deepest


def test_a_scene_without_a_body_builds_none_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a body was made")

    monkeypatch.setattr(build, "built_in_body", refuse)
    made = shared_fields.cache_info().misses
    scene = load_scene("drape", [*SMALL, "forces.sphere.radius_m=0.2"])
    model = ClothModel(scene)
    assert model.body is None
    assert model.simulation.forces.body is None
    model.step(1)
    assert shared_fields.cache_info().misses == made
    assert model.panels()[0].meshes[-1] is model.ball
    stages = {stage.name: stage for stage in plan(scene).stages}
    assert not stages["body"].built
    assert "no [body]" in stages["body"].why
    assert not stages["thin limbs"].built


def test_the_plan_names_the_body() -> None:
    stages = {stage.name: stage for stage in plan(load_scene("sheet-walk", SMALL)).stages}
    assert stages["body"].built
    assert "built-in female, motion walk" in stages["body"].why
    assert "the body's primitives" in stages["contact"].why
    assert "skin" in stages["meshes"].why
    assert stages["thin limbs"].built
    assert "left hand, right hand" in stages["thin limbs"].why


def test_the_plan_says_where_key_points_are_close_enough() -> None:
    scene = load_scene("drape-body", ["cloth.representation=mesh", "cloth.gap_mm=4"])
    stages = {stage.name: stage for stage in plan(scene).stages}
    assert not stages["thin limbs"].built
    assert "from 3.9 mm" in stages["thin limbs"].why


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("cloth.pins.body=[{bone='spine9'}]", "did you mean"),
        ("cloth.pins.body=[{bone='spine3', rows=[0.5, 0.2]}]", "lesser share first"),
        ("body.contact=mesh", "primitives"),
        ("body.start_s=-1", "start_s"),
    ],
)
def test_bad_words_are_one_line(override: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        load_scene("drape-body", [override])
    assert "\n" not in str(caught.value)


def test_a_body_needs_cloth_and_pins_need_a_body() -> None:
    with pytest.raises(InputError, match="add one of them"):
        load_scene("plain", ["body.gender=male"])
    with pytest.raises(InputError, match=r"cloth.pins.body attaches"):
        load_scene("drape", ["cloth.pins.body=[{bone='head'}]"])


def test_pins_that_overlap_or_hold_nothing_are_refused() -> None:
    for pins, says in (
        ("[{bone='head', rows=[0, 1]}, {bone='neck', rows=[1, 1]}]", "may not overlap"),
        ("[{bone='head', columns=[0.501, 0.502]}]", "no key point there"),
    ):
        with pytest.raises(InputError, match=says):
            sheet_simulation(load_scene("drape-body", [*SMALL, f"cloth.pins.body={pins}"]))


def test_pinned_regions_go_where_their_bones_go() -> None:
    scene = load_scene("drape-body", [*SMALL, "body.motion=turn", "body.blend_in_s=0.1"])
    body = standing_in(scene)
    simulation = sheet_simulation(scene, body)
    assert body is not None
    assert body.bones is not None
    held = simulation.sheet.pinned
    assert held.sum() >= 2
    (group,) = simulation.pins
    start = group.at(0.0)
    np.testing.assert_array_equal(start.astype(np.float32), simulation.positions[held])
    moved = body.bones(1.2)[body.body.skeleton.index("spine3")]
    np.testing.assert_allclose(group.at(1.2), start @ moved[:3, :3].T + moved[:3, 3], atol=1e-9)
    assert np.linalg.norm(group.at(1.2) - start, axis=1).max() > 0.01


def test_the_body_waits_for_its_motion() -> None:
    scene = load_scene("sheet-walk", [*SMALL, "body.start_s=0.5"])
    body = standing_in(scene)
    assert body is not None
    assert body.bones is not None
    np.testing.assert_array_equal(body.bones(0.5), body.bones(0.0))
    assert np.abs(body.bones(1.5) - body.bones(0.0)).max() > 0.01


def test_the_query_kernel_agrees_with_float64() -> None:
    """Outside and near the surface to 2 µm (float32 of metres), for every kind; the normal with it."""
    solids = [
        Primitive(kind="sphere", start=np.array([0.1, 1.2, 0]), end=np.array([0.1, 1.2, 0]), radii=(0.1, 0.1)),
        Primitive(kind="cylinder", start=np.array([0, 0.8, 0]), end=np.array([0.3, 1.0, 0.1]), radii=(0.09, 0.05)),
        Primitive(kind="cylinder", start=np.zeros(3), end=np.array([0, 0.02, 0]), radii=(0.03, 0.08)),
        Primitive(
            kind="elliptic", start=np.array([0, 0.5, 0]), end=np.array([0, 0.9, 0]), radii=(0.08, 0.15),
            across=np.array([0.8, 0, 0.6]), rounding=0.02,
        ),
    ]  # fmt: skip
    points = np.random.default_rng(3).uniform([-0.5, -0.2, -0.5], [0.6, 1.5, 0.5], (20_000, 3)).astype(np.float32)
    distance, normal = PrimitiveQuery(solids)(points)
    exact, gradient, _ = nearest_distance(solids, points)
    assert np.abs(distance - exact).max() < 2e-6
    far = exact > 1e-3  # inside, and where two are as near, either normal is right
    assert np.quantile(np.abs(normal - gradient)[far].max(axis=1), 0.999) < 1e-3


def test_ready_primitives_are_known_again() -> None:
    body = built_in_body(gender="female")
    found = ready_primitives(body)
    assert found is not None
    assert len(found) == 32
    names = body.skeleton.names
    assert all(0 <= p.bone < len(names) for p in found)
    assert {p.part: names[p.bone] for p in found}["left hand"] == "hand_l"
    shifted = type(body)(
        name="other", vertices=body.vertices * 1.001, faces=body.faces, skeleton=body.skeleton, weights=body.weights
    )
    assert ready_primitives(shifted) is None


def test_primitives_of_a_file_are_touched(tmp_path: Path) -> None:
    body = built_in_body(gender="female")
    found = ready_primitives(body)
    assert found is not None
    path = tmp_path / "body.json"
    path.write_bytes(primitives_json(found[:7]))
    scene = load_scene("drape-body", [*SMALL, f"body.primitives={path}"])
    read = standing_in(scene)
    assert read is not None
    assert [p.part for p in read.colliders.primitives] == [p.part for p in found[:7]]
    path.write_bytes(primitives_json([replace(found[0], bone=20)]))
    with pytest.raises(InputError, match="bone 20; allowed: 0 to 19"):
        standing_in(scene)
    path.write_bytes(primitives_json([replace(found[0], start=found[0].start + 1, end=found[0].end + 1)]))
    with pytest.raises(InputError, match="off the body"):
        standing_in(scene)


@pytest.mark.slow
def test_grids_of_a_body_know_its_skin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With nodes 40 mm apart the nearest of all grids is within half of that of the exact distance to the skin."""
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path))
    monkeypatch.setattr(body_setup, "GRID_SPACING", 0.04)
    scene = load_scene("drape-body", [*SMALL, "body.contact=grid"])
    met = standing_in(scene)
    assert met is not None
    grids, body = met.colliders.grids, met.body
    assert not met.colliders.primitives
    assert len(grids) == 17
    assert {g.part: body.skeleton.names[g.bone] for g in grids}["left hand"] == "hand_l"
    points = garment_points(body, 400)
    exact = mesh_distance(points, body.vertices, body.faces)
    exact[_inside(body.vertices[body.faces], points)] *= -1
    off = np.min([g.at(points)[0] for g in grids], axis=0) - exact
    assert np.abs(off).max() < 0.02
    again = standing_in(scene)
    assert again is not None
    np.testing.assert_array_equal(again.colliders.grids[3].values, grids[3].values)


@pytest.mark.slow
@pytest.mark.parametrize("gender", ["female", "male"])
def test_ready_primitives_are_those_that_a_fit_gives(gender: Gender) -> None:
    """To 1 mm: rounding of the machine's linear algebra may end the fit elsewhere by less."""
    body = built_in_body(gender=gender)
    found = ready_primitives(body)
    assert found is not None
    for kept, made in zip(found, fit_body(body, seed=SEEDS[gender]), strict=True):
        assert (kept.kind, kept.part, kept.bone) == (made.kind, made.part, made.bone)
        np.testing.assert_allclose(kept.start, made.start, atol=1e-3)
        np.testing.assert_allclose(kept.end, made.end, atol=1e-3)
        np.testing.assert_allclose(kept.radii, made.radii, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "frames"), [("drape-body", 90), ("sheet-walk", 300)])
def test_sheets_on_a_body_stay_outside_and_whole(name: str, frames: int) -> None:
    """From the tenth frame on (the towel starts with its edge in the neck, and is let out) free key points are never
    deeper than 0.5 mm in a primitive (the gap keeps 4 mm between), the body standing or
    walking, and threads stay within 15 %."""
    model = ClothModel(load_scene(name, ["cloth.representation=mesh", f"output.frames={frames}"]))
    deepest = stretch = 0.0
    for frame in range(1, frames + 1):
        model.step(frame)
        if frame % 5 == 0 and frame >= 10:
            deepest = max(deepest, depth(model))
            stretch = max(
                stretch, *(float(s.max()) for s in model.simulation.sheet.stretch(model.simulation.positions))
            )
    assert deepest < 5e-4
    assert stretch < 0.15


def test_the_scenes_of_bodies_are_there() -> None:
    assert {"drape-body", "sheet-walk"} <= set(built_in_scenes())
    assert Path(primitives.__file__).with_name("female.json").is_file()
