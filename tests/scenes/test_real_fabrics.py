"""The built-in scenes of cloth are fabrics: what is drawn weighs what is simulated, and contact keeps its thickness."""

import numpy as np
import pytest

from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.constraints.thin_limbs import least_gap, thinnest_held
from taichi_cloth.fabric.layout import drawn_density
from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import SelfContact
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare import garment_setup
from taichi_cloth.scenes.prepare.construction import drawn_of
from taichi_cloth.scenes.prepare.gaps import ARM, FINGER, SKIN_BEYOND, SheetGaps, gaps_of, garment_gaps
from taichi_cloth.scenes.prepare.garment_setup import (
    dressed_parts,
    garment_choice,
    garment_colliders,
    garment_forces,
)
from taichi_cloth.scenes.prepare.sett import on_cells
from taichi_cloth.scenes.prepare.sheet_setup import sheet_simulation, standing_in
from taichi_cloth.scenes.scene.body_section import BodySection
from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene, make_scene
from taichi_cloth.scenes.scene.schema import Scene

SHEETS = sorted(name for name in built_in_scenes() if load_scene(name).cloth)
GARMENTS = sorted(name for name in built_in_scenes() if load_scene(name).garment)
FINE = ["cloth.representation=mesh", "cloth.rows=200", "cloth.columns=200", "cloth.width_m=0.4", "cloth.length_m=0.4"]

pytestmark = pytest.mark.usefixtures("keep_taichi")


def test_the_scenes_are_those_that_there_are() -> None:
    assert {"drape", "drape-body", "flag", "hanging", "sheet-walk", "stretch"} <= set(SHEETS)
    assert set(GARMENTS) >= {"dress", "skirt", "trousers", "tshirt"}


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_weighs_what_is_drawn_and_contact_keeps_what_is_drawn(name: str) -> None:
    """Weight within 1 %. The thickness is kept from ball, floor and body; limbs that would come through between key
    points are touched as if they were as much wider as keeps a finger out, and the plan says so."""
    scene = on_cells(load_scene(name))
    counted = plan(scene)
    assert counted.prepared is not None
    drawn = drawn_of(counted.prepared.layout)
    assert drawn is not None
    body = standing_in(scene)
    simulation = sheet_simulation(scene, body)
    assert drawn_density(counted.prepared.layout) == pytest.approx(simulation.sheet.material.density, rel=0.01)
    thickness = pytest.approx(1e-3 * drawn.facts.thickness_mm, rel=0.01)
    met = [part.gap for part in (simulation.forces.sphere, simulation.forces.plane, body and body.colliders) if part]
    assert met == [thickness] * len(met)
    said = {stage.name: stage.why for stage in counted.stages}["contact"]
    assert said.count("as thick as the cloth is drawn") == len(met)
    if body is not None:
        made, diagonal = body.colliders, simulation.sheet.springs.diagonal_length
        for limb, wider in zip(made.primitives, made.beyond, strict=True):
            least = thinnest_held(diagonal, made.gap + wider, middles=True)
            assert least <= max(FINGER, limb.thinnest) * (1 + 1e-9)
            assert wider == 0 or least == pytest.approx(limb.thinnest)
        assert ("key points lie too far apart" in said) == any(made.beyond)
        assert max(made.beyond) < 1e-3


@pytest.mark.parametrize("name", GARMENTS)
def test_a_garment_weighs_what_is_drawn(name: str) -> None:
    """Its cloth, and all of it, hems twice."""
    scene = load_scene(name)
    prepared = plan(scene).prepared
    assert prepared is not None
    garment = dressed_parts(scene).garment
    density = drawn_density(prepared.layout)
    assert density == pytest.approx(garment.material.density, rel=0.01)
    across, along = garment.atlas.spacing
    hems = (garment.layers - garment.atlas.cells).sum() * across * along
    area = sum(panel.area for panel in garment.pattern.panels)
    assert hems == pytest.approx(_turned_in(garment), rel=0.05)
    assert density * (area + hems) == pytest.approx(density * garment.layers.sum() * across * along, rel=0.01)


def _turned_in(garment: Garment) -> float:
    """Of the hems [m²], as strips as long as their edges: a corner or a curve is some per cent off."""
    edges = [panel.edges[k] for panel in garment.pattern.panels for k in panel.hems]
    return garment.hem * sum(length(edge) for edge in edges)


@pytest.mark.parametrize("name", GARMENTS)
def test_a_garment_keeps_what_is_drawn(name: str) -> None:
    """From its body and its floor; primitives are touched as wide as most skin is, and either so that no arm comes
    through. And its layers from each other."""
    scene = load_scene(name, ["forces.self_contact={}"])
    parts = dressed_parts(scene)
    prepared = plan(scene).prepared
    assert prepared is not None
    drawn = drawn_of(prepared.layout)
    assert drawn is not None
    worn, gaps = garment_colliders(parts), parts.gaps
    assert worn.gap == gaps.floor.size == gaps.layers.size == pytest.approx(1e-3 * drawn.facts.thickness_mm, rel=0.01)
    assert worn.beyond == (SKIN_BEYOND,) * len(parts.primitives)
    assert gaps.said(parts.primitives).endswith("touched as if 3.5 mm wider: primitives do not cover all skin")
    on_skin = scene.model_copy(update={"body": (scene.body or BodySection()).model_copy(update={"contact": "grid"})})
    skin = DistanceGrid(np.zeros(3), 0.1, np.zeros((2, 2, 2), np.float32))
    fine = garment_gaps(on_skin, (1e-3, 1e-3))
    assert fine.body.size == fine.body.thickness == fine.layers.size == fine.floor.size
    assert fine.beyond([skin]) == (0.0,)
    coarse = garment_gaps(on_skin, (12e-3, 12e-3))
    assert thinnest_held(2**0.5 * 12e-3, coarse.body.size + coarse.beyond([skin])[0]) <= ARM * (1 + 1e-9)


def test_a_garments_gaps_are_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the scene to its forces and its solver."""
    asked = []

    def counted(scene: Scene, spacing: tuple[float, float]) -> SheetGaps:
        asked.append(spacing)
        return garment_gaps(scene, spacing)

    monkeypatch.setattr(garment_setup, "garment_gaps", counted)
    scene = load_scene("skirt", ["forces.self_contact={}"])
    parts = dressed_parts(scene)
    layers = garment_forces(scene, parts).self_contact
    assert layers is not None
    assert layers.thickness == parts.gaps.layers.size
    assert garment_choice(scene, parts).name == "yarns"
    assert asked == [parts.garment.atlas.spacing]


def test_a_gap_that_a_scene_states_holds() -> None:
    stated = ["forces.sphere.gap_mm=5", "forces.plane.gap_mm=0", "forces.self_contact.thickness_mm=4"]
    forces = sheet_simulation(load_scene("drape", [*stated, "cloth.representation=mesh"])).forces
    assert forces.sphere is not None
    assert forces.plane is not None
    assert (forces.sphere.gap, forces.plane.gap) == (0.005, 0.0)
    assert forces.self_contact == SelfContact(thickness=0.004, friction=0.36)  # of its cotton
    stated = load_scene("tshirt", ["garment.gap_mm=2", "forces.self_contact={thickness_mm=1}"])
    gaps = garment_gaps(stated, (12e-3, 12e-3))
    assert (gaps.body.size, gaps.layers.size) == (0.002, 0.001)
    assert standing_in(load_scene("drape-body", ["cloth.gap_mm=3"])).colliders.gap == 0.003  # pyright: ignore[reportOptionalMemberAccess]


def test_layers_keep_the_thickness_however_far_apart_key_points_are() -> None:
    for own in ([], FINE):
        layers = gaps_of(load_scene("drape", own)).layers
        assert layers.size == layers.thickness
    said = {s.name: s.why for s in plan(load_scene("drape")).stages}
    assert said["cloth on cloth"].startswith("0.321 mm apart, as thick as the cloth is drawn; friction 0.36")


def test_a_small_ball_does_not_come_through() -> None:
    small = gaps_of(load_scene("drape", ["forces.sphere.radius_m=0.02"])).ball
    assert small.size > small.thickness
    assert small.size == pytest.approx(least_gap(2**0.5 / 78, 0.02))


@pytest.mark.parametrize("middles", [False, True])
def test_the_least_gap_is_that_which_holds_a_limb(middles: bool) -> None:
    for diagonal, radius in ((0.027, 0.008), (0.02, 0.03), (0.014, 0.006)):
        gap = least_gap(diagonal, radius, middles=middles)
        if gap > 0:
            assert thinnest_held(diagonal, gap, middles=middles) == pytest.approx(radius)
        else:
            assert thinnest_held(diagonal, gap, middles=middles) <= radius
    assert least_gap(1e-3, 0.1) == 0.0


def test_a_mesh_of_a_material_keeps_the_thickness_that_it_would_be_drawn_with() -> None:
    thin, thick = (
        gaps_of(make_scene({"cloth": {"material": name, "representation": "mesh"}})).floor.size
        for name in ("silk-habotai", "denim-12oz")
    )
    assert thin < 1.5e-4
    assert thick > 6e-4
    with pytest.raises(InputError, match="gap_mm"):
        load_scene("drape", ["forces.plane.gap_mm=-1"])
