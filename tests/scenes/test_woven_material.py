"""A cloth that moves by what it is woven of: its properties, who says each, and that it weighs what is drawn."""

from pathlib import Path

import pytest

from taichi_cloth.fabric.layout import drawn_density
from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.presets import TRADE
from taichi_cloth.scenes.plan.lines import plan_lines
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare.construction import construction_of, own_material
from taichi_cloth.scenes.prepare.sheet_setup import material_of, moved_by
from taichi_cloth.scenes.scene.load import load_scene, make_scene
from taichi_cloth.scenes.scene.schema import Scene
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet

SHIRTING = {
    "yarn": {"count": "Ne 40", "twist_multiplier": 4.0},
    "weave": {"draft": "plain"},
    "fabric": {"ends_per_cm": 46, "picks_per_cm": 27, "balance": 0.8},
    "cloth": {"columns": 41, "rows": 41},
}


def shirting(**cloth: object) -> Scene:
    return make_scene(SHIRTING | {"cloth": SHIRTING["cloth"] | cloth})


def test_a_cloth_of_yarn_weave_and_sett_is_woven_and_weighs_what_is_drawn() -> None:
    scene = shirting()
    own = own_material(scene)
    assert scene.material == "woven"
    assert own is not None
    assert own.density == pytest.approx(1e-3 * construction_of(scene).areal_density)
    prepared = plan(scene).prepared
    assert prepared is not None
    assert drawn_density(prepared.layout) == pytest.approx(own.density, rel=0.01)
    assert own.drawn_warp > 10 * own.tensile_warp


@pytest.mark.parametrize("name", ["cotton-shirting", "silk-habotai", "wool-suiting", "denim"])
def test_the_construction_of_a_preset_is_drawn_as_heavy_as_it_is(name: str) -> None:
    """Within 2 % of the preset, though threads of close twills are pressed."""
    trade = TRADE[name]
    scene = make_scene(
        {
            "fibre": {"kind": trade.fibre},
            "yarn": {"count": trade.warp, "twist_multiplier": trade.twist_multiplier},
            "weave": {"draft": trade.weave},
            "fabric": {
                "ends_per_cm": trade.ends_per_cm,
                "picks_per_cm": trade.picks_per_cm,
                "flattening": trade.flattening or {"silk": 2.9}.get(trade.fibre, 2.0),
                "finish": trade.finish,
                "balance": 0.7,
            },
            "cloth": {"columns": 31, "rows": 31, "width_m": 0.3, "length_m": 0.3},
        }
    )
    prepared, own = plan(scene).prepared, own_material(scene)
    assert prepared is not None
    assert own is not None
    assert drawn_density(prepared.layout) == pytest.approx(own.density, rel=0.01)
    assert own.density == pytest.approx(named_material(name).density, rel=0.02)


def test_properties_override_key_by_key_and_are_said_to() -> None:
    scene = shirting(properties={"shear_n_per_m": 44.0, "bending_warp_un_m": 7.0})
    assert scene.cloth is not None
    material = material_of(scene.cloth, own=own_material(scene))
    assert (material.shear, material.bending_warp) == (44.0, pytest.approx(7e-6))
    found = moved_by(scene)
    assert str(found["shear"]) == "shear G 44 N/m (properties.shear_n_per_m)"
    assert found["bending_weft"].origin == "woven"
    stages = {stage.name: stage.why for stage in plan(scene).stages}
    assert "bending, warp 7 µN·m (properties.bending_warp_un_m)" in stages["material"]
    assert "(± 10 %, from yarn and weave)" in stages["material"]
    assert "woven" in stages["sheet"]


def test_threads_of_verlet_stay_as_soft_as_they_are_at_first() -> None:
    scene = make_scene(SHIRTING | {"solver": {"name": "verlet"}})
    assert scene.cloth is not None
    assert material_of(scene.cloth, scene.solver, own_material(scene)).drawn_warp == 0.0
    assert "drawn_warp" not in moved_by(scene)


def test_measured_properties_take_the_place_of_woven_and_of_preset_ones(tmp_path: Path) -> None:
    path = tmp_path / "cloth.toml"
    path.write_text("[kes]\nbending_warp = 0.2\nweight = 10.0\n")
    for material in ("woven", "denim"):
        scene = shirting(material=material, measured=str(path))
        own = own_material(scene)
        assert own is not None
        assert own.bending_warp == pytest.approx(0.2 * 98.07e-6)
        assert own.density == pytest.approx(0.1)
        assert moved_by(scene)["bending_warp"].origin == "measured"
    denim = named_material("denim")
    assert (own.bending_weft, own.shear) == (pytest.approx(denim.bending_weft), pytest.approx(denim.shear))


def test_a_preset_that_a_scene_names_stays_as_it_is() -> None:
    scene = shirting(material="denim")
    assert own_material(scene) is None
    assert scene.cloth is not None
    assert material_of(scene.cloth) == named_material("denim")
    said = {stage.name: stage.why for stage in plan(scene).stages}["material"]
    assert said.startswith("areal density 324 g/m², bending, warp 97 µN·m, ")
    assert said.endswith(" (preset denim)")


@pytest.mark.parametrize(
    "own", [{}, {"cloth": {"material": "denim", "representation": "mesh"}}, {"garment": {"representation": "mesh"}}]
)
def test_a_plan_says_the_weight_once_and_a_run_leaves_that_to_its_facts(own: dict[str, dict[str, str]]) -> None:
    """A swatch that lies, a cloth of a preset, and a garment; a run prints the facts of its model below the plan."""
    planned = plan(load_scene("swatch", []) if not own else make_scene(own))
    assert sum("g/m²" in line for line in plan_lines(planned)) == 1
    assert not any("g/m²" in line for line in plan_lines(planned, material=False))


def test_threads_that_follow_key_points_state_no_cloth() -> None:
    scene = make_scene({key: value for key, value in SHIRTING.items() if key != "fabric"})
    assert scene.material == "cotton-shirting"
    with pytest.raises(InputError, match=r'cloth.material: "woven" needs \[yarn\], \[weave\], fabric.ends_per_cm'):
        plan(make_scene({"cloth": {"material": "woven", "representation": "mesh"}}))


def test_another_sett_on_the_command_line_makes_another_cloth() -> None:
    sett = ["fabric.ends_per_cm=24", "fabric.picks_per_cm=22", "yarn.count=30/2"]
    scene = load_scene("drape", sett)
    assert scene.material == "woven"
    assert scene.cloth is not None
    assert scene.cloth.properties.air_damping_per_s == 2.0
    shirt = load_scene("tshirt", sett)
    assert shirt.material == "woven"
    assert shirt.garment is not None
    assert shirt.garment.properties.density_g_per_m2 is None
    assert shirt.garment.properties.within == "all"  # a choice of the scene's, whose numbers are the new cloth's
    assert shirt.fabric is not None
    assert shirt.fabric.flattening == 2.0
    assert own_material(shirt) is not None


def test_the_sheet_has_the_mass_of_the_cloth_it_is_woven_of() -> None:
    from taichi_cloth.scenes.prepare.sheet_setup import sheet_of

    scene = shirting()
    assert scene.cloth is not None
    sheet: Sheet = sheet_of(scene.cloth, scene.solver, own_material(scene))
    assert float(sheet.mass.sum()) == pytest.approx(1e-3 * construction_of(scene).areal_density, rel=1e-6)


def test_a_material_alone_brings_its_yarn_weave_and_sett() -> None:
    scene = make_scene(
        {"cloth": {"material": "silk-habotai", "width_m": 0.3, "length_m": 0.3, "columns": 31, "rows": 31}}
    )
    prepared = plan(scene).prepared
    assert prepared is not None
    assert scene.fibre.kind == "silk"
    assert own_material(scene) is None
    assert drawn_density(prepared.layout) == pytest.approx(named_material("silk-habotai").density, rel=0.01)
    dyed = make_scene({"weave": {"warp_colours": "navy"}, "cloth": {"material": "silk-habotai"}})
    assert dyed.weave is not None
    assert (dyed.weave.draft, dyed.weave.warp_colours) == ("plain", "navy")
    assert make_scene({"cloth": {"material": "silk-habotai", "representation": "mesh"}}).weave is None


@pytest.mark.parametrize(("name", "section"), [("drape", "cloth"), ("tshirt", "garment")])
def test_another_material_on_the_command_line_brings_its_construction(name: str, section: str) -> None:
    """Its own fibre, yarn, weave and sett, in the scene's colours; what is said of them by name holds."""
    scene = load_scene(name, [f"{section}.material=silk-habotai"])
    alone = make_scene({section: {"material": "silk-habotai"}})
    assert construction_of(scene).facts == construction_of(alone).facts
    assert scene.weave is not None
    assert scene.weave.weft_colours == load_scene(name).weave.weft_colours  # pyright: ignore[reportOptionalMemberAccess]
    assert scene.fibre.kind == "silk"
    mesh = load_scene(name, [f"{section}.material=silk-habotai", f"{section}.representation=mesh"])
    assert construction_of(mesh).facts == construction_of(alone).facts


@pytest.mark.parametrize(("name", "section"), [("drape", "cloth"), ("trousers", "garment")])
def test_what_is_said_beside_a_material_changes_that_material(name: str, section: str) -> None:
    """How it looks, or how it is woven, which makes another cloth, that moves by what it is woven of."""
    denim, said = load_scene(name, [f"{section}.material=denim-12oz"]), f"{section}.material=denim-12oz"
    looks = load_scene(name, [said, "fabric.irregularity=0.1", "yarn.hairiness.ends_per_m=9", "weave.weft_colours=red"])
    assert (looks.material, construction_of(looks).facts) == ("denim-12oz", construction_of(denim).facts)
    assert looks.fabric is not None
    assert looks.fabric.irregularity == 0.1
    closer = load_scene(name, [said, "fabric.picks_per_cm=18"])
    assert denim.fabric is not None
    assert closer.fabric == denim.fabric.model_copy(update={"picks_per_cm": 18.0})
    assert (closer.material, closer.weave, closer.yarn) == ("woven", denim.weave, denim.yarn)
    finer = load_scene(name, [said, "fabric.ends_per_cm=30", "fabric.picks_per_cm=20", "yarn.count_ne=10"])
    assert finer.yarn is not None
    assert (finer.material, finer.yarn.count_ne, finer.yarn.count) == ("woven", 10.0, None)
    assert finer.fabric is not None
    assert finer.fabric.finish == "sized"


def test_a_draft_with_a_spacing_beside_a_material_is_woven_with_it() -> None:
    wif = Path(__file__).parents[1] / "data" / "wif" / "two-color-liftplan.wif"
    scene = load_scene("drape", ["cloth.material=silk-habotai", f"weave.draft={wif}"])
    assert (scene.material, scene.fibre.kind) == ("woven", "silk")
    assert make_scene({"fabric": {"ends_per_cm": 40}, "cloth": {"material": "silk-habotai"}}).material == "woven"
    assert make_scene({"fabric": {"steps": 4}, "cloth": {"material": "silk-habotai"}}).material == "silk-habotai"


def test_a_cloth_of_the_trade_is_a_material() -> None:
    scene = make_scene({"cloth": {"material": "poplin", "columns": 31, "rows": 31}})
    own = own_material(scene)
    assert own is not None
    assert own.density == pytest.approx(0.128, rel=0.05)
    assert moved_by(scene)["shear"].origin == "woven"
    with pytest.raises(InputError, match=r'cloth.material: \'popln\'; known: woven, cotton-shirting.*mean "poplin"'):
        make_scene({"cloth": {"material": "popln"}})


def test_a_blend_and_ones_own_fibre_data_reach_the_cloth() -> None:
    cotton = construction_of(shirting())
    mixed = construction_of(make_scene(SHIRTING | {"fibre": {"blend": {"cotton": 65, "polyester": 35}}}))
    assert mixed.warp_fibre.name == "cotton 65 polyester 35"
    assert mixed.warp.fibre_density == pytest.approx(1 / (0.65 / 1520 + 0.35 / 1380))
    assert mixed.warp_fibre.flexural == pytest.approx(0.65 * 0.19 + 0.35 * 0.46)
    own = {"modulus_n_per_tex": 6.0, "flexural_mn_mm2_per_tex2": 0.38, "friction": 0.3, "fineness_dtex": 0.85}
    stiff = construction_of(make_scene(SHIRTING | {"fibre": own}))
    fibre = stiff.warp_fibre
    assert (fibre.modulus, fibre.flexural, fibre.slipping) == (6.0, 0.38, 0.3)
    assert stiff.families[0].single_fibre == pytest.approx(0.085)
    assert stiff.areal_density == pytest.approx(cotton.areal_density)
    with pytest.raises(InputError, match=r"fibre.blend: unknown fibre 'coton'; known: .*did you mean \"cotton\""):
        construction_of(make_scene(SHIRTING | {"fibre": {"blend": {"coton": 65}}}))
