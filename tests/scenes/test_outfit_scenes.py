"""Scenes of several garments: `[[garment]]`, in the order worn; what is said of one, of all, and what is none."""

import numpy as np
import pytest

from taichi_cloth.garment.sewn.worn import Worn
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.measure.crossing_check import check
from taichi_cloth.scenes.models.outfit_model import OutfitModel
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare.garment_setup import Dressed, dressed_parts
from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene, make_scene
from taichi_cloth.scenes.scene.schema import Scene

OUTFIT = "outfit-summer"
TWO = """
[[garment]]
pattern = "skirt"
material = "denim"
representation = "mesh"

[[garment]]
scene = "tshirt"
name = "shirt"
representation = "mesh"
yarn.count = "Ne 40"
colours = { front = { warp = "navy" } }

[body]
gender = "female"
"""


def written(tmp_path, text: str = TWO) -> str:
    path = tmp_path / "outfit.toml"
    path.write_text(text)
    return str(path)


def test_each_garment_is_a_scene_of_its_own(tmp_path):
    scene = load_scene(written(tmp_path))
    skirt, shirt = scene.garments
    assert scene.subject == "outfit"
    assert (skirt.title, shirt.title) == ("skirt", "shirt")
    assert skirt.garment is not None
    assert skirt.garment.material == "denim"
    alone = load_scene("tshirt", ["garment.representation=mesh", "yarn.count=Ne 40", "garment.colours.front.warp=navy"])
    assert shirt.garment == alone.garment
    assert (shirt.yarn, shirt.weave, shirt.fabric) == (alone.yarn, alone.weave, alone.fabric)
    assert shirt.body == skirt.body == scene.body
    assert scene.forces is not None
    assert scene.forces.self_contact is not None
    assert Scene.model_validate_json(scene.model_dump_json(exclude_unset=True)) == scene  # as a run keeps it


def test_overrides_are_of_all_or_of_one(tmp_path):
    scene = load_scene(written(tmp_path), ["garment.hem_mm=12", "garment.shirt.length_cm=70", "garment.skirt.flare=2"])
    skirt, shirt = (one.garment for one in scene.garments)
    assert skirt is not None
    assert shirt is not None
    assert (skirt.hem_mm, skirt.length_cm, skirt.flare) == (12, None, 2)
    assert (shirt.hem_mm, shirt.length_cm, shirt.flare) == (12, 70, None)
    silk = load_scene(written(tmp_path), ["garment.shirt.material=silk-habotai"]).garments
    assert silk[1].yarn is not None
    assert silk[1].yarn.count == "20/22 den x 2"
    assert silk[0] == scene.garments[0].model_copy(update={"garment": silk[0].garment})


def test_files_are_meant_from_where_they_are_named(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "own.toml").write_text('[garment]\npattern = "a.json"\nrepresentation = "mesh"\n')
    text = TWO.replace('scene = "tshirt"', 'scene = "there/own.toml"').replace(
        'pattern = "skirt"', 'pattern = "b.json"'
    )
    scene = load_scene(written(tmp_path, text))
    assert [one.garment.pattern for one in scene.garments if one.garment] == [
        str(tmp_path / "b.json"),
        str(tmp_path / "there" / "a.json"),
    ]


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["garment.jacket.length_cm=3"], r"'jacket' is neither a garment nor a key of one; garments: trousers, tshirt"),
        (["yarn.count=Ne 3"], r"each garment of an outfit has its own; say garment.yarn.count for all"),
        (["garment.tshirt.lenght_cm=3"], r"garment 2: lenght_cm: unknown key; .*did you mean \"length_cm\"\?"),
        (["garment.tshirt.yarn.cuont=3"], r"garment 2: yarn.cuont: unknown key; .*did you mean \"count\"\?"),
        (["garment.trousers.name=tshirt"], r"two garments called 'tshirt'; give each a garment.name of its own"),
        (["garment.trousers.name=yarn"], r"garment.name: 'yarn'; allowed: a word that is no key of a garment"),
        (["forces.self_contact=false"], r"forces.self_contact: garments of an outfit touch by it; leave it out"),
        (["garment.tshirt.representation=mesh"], r"garment.representation: garments of an outfit share one"),
        (["garment.tshirt=3"], r"expected garment.tshirt.KEY=VALUE"),
        (["garment.tshirt.weave.ends=3"], r"tshirt: weave.ends, weave.picks: a \[garment\] has as many as"),
    ],
)
def test_bad_overrides_give_one_line(overrides, line):
    with pytest.raises(InputError, match=line) as error:
        load_scene(OUTFIT, overrides)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("garment = [1, 2]", r"garment 1: '1'; allowed: a table of keys"),
        ('[[garment]]\npattern = "skirt"', r"1 \[\[garment\]\]; allowed: 2 to 8, or one \[garment\]"),
        ('[[garment]]\nscene = "dres"\n[[garment]]', r"unknown scene 'dres'; .*did you mean \"dress\"\?"),
        ('[[garment]]\nscene = "drape"\n[[garment]]', r"garment 1: scene: 'drape' has no \[garment\]"),
        ('[yarn]\n[[garment]]\npattern = "skirt"\n[[garment]]', r"\[yarn\]: each garment of an outfit has its own"),
        (
            f'{TWO}[cloth]\nrepresentation = "mesh"\n',
            r"a scene shows one of \[garment\], \[\[garment\]\], \[cloth\] and \[twist\]",
        ),
        (TWO.replace('pattern = "skirt"', 'patern = "skirt"'), r"garment 1: patern: unknown key"),
    ],
)
def test_bad_files_give_one_line(tmp_path, text, line):
    with pytest.raises(InputError, match=line) as error:
        load_scene(written(tmp_path, text))
    assert "\n" not in str(error.value)


def test_an_outfit_of_dictionaries():
    scene = make_scene(
        {"garment": [{"pattern": "skirt", "representation": "mesh"}, {"scene": "tshirt", "representation": "mesh"}]}
    )
    assert [one.title for one in scene.garments] == ["skirt", "tshirt"]


def test_a_plan_names_each_garment():
    stages = {stage.name: stage.why for stage in plan(load_scene(OUTFIT, ["garment.representation=mesh"])).stages}
    assert stages["pattern"].startswith("trousers: 4 panels, 6 seams")
    assert "; tshirt: 4 panels, 10 seams" in stages["pattern"]
    assert stages["material"].startswith("trousers: areal density 413 g/m²")
    assert "cloth on cloth" in stages


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in built_in_scenes() if name.startswith("outfit-")])
def test_outfits_walk_and_nothing_passes_through(name):
    walk = ["garment.representation=mesh", "body.motion=walk"]
    *_, last = check(name, walk, frames=30, arch="cpu", threads=1)
    assert last.startswith("30 frames: none of ")


@pytest.mark.slow
def test_fibres_of_each_are_drawn_where_its_mesh_is():
    """Garments that lie where they start, planes before planes: the picture of fibres has each one's colours where
    that of meshes has them, and the inner one nowhere before the outer."""
    pictures = []
    for form in ("mesh", "fibre"):
        options = [f"garment.representation={form}", "garment.key_points=300", "light.occlusion=false"]
        scene = load_scene(OUTFIT, [*options, "garment.tshirt.weave.weft_colours='#f4f1ea'"])
        parts = dressed_parts(scene)
        start = parts.garment.atlas.start().astype(np.float32)
        worn = Worn(start, gap=0.0, depth=0.0, stretch=0.0, taut=0.0, speed=0.0, frames=0)
        model = OutfitModel.worn(scene, Dressed(**vars(parts), worn=worn, from_disk=True))
        pictures.append(next(image for _, image in View(model, (120, 150)).turntable(1, [0])).astype(float))
    apart = np.abs(pictures[0] - pictures[1]).mean(axis=2)
    assert np.median(apart) < 4
    assert np.mean(apart > 60) < 0.02
