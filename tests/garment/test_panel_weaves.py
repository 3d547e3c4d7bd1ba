"""Drafts on parts of a cloth and on panels of a garment: what lies on top where, in which colours, from which files."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.mixing import WHITE, sent_back
from taichi_cloth.scenes.paper.own_scenes import scene_file
from taichi_cloth.scenes.prepare.garment_setup import dressed_parts, woven_garment
from taichi_cloth.scenes.prepare.thread_colours import AMONG, outer_colours, panel_colours
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.prepare.yarns import draft_of
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.scene.schema import Scene, Weave, WeavePatch
from taichi_cloth.weave.colour_order import thread_repeat
from taichi_cloth.weave.draft import named_weave
from taichi_cloth.weave.wif import read_wif

WIF = Path(__file__).parents[1] / "data" / "wif" / "schort.wif"


def panel_names(scene: Scene) -> list[str]:
    return [piece.panel.name for piece in dressed_parts(scene).garment.atlas.panels]


COARSE = ["garment.key_points=500", "garment.threads_per_key_point=2"]


def test_a_patch_is_another_draft_on_a_part_of_the_cloth() -> None:
    patches = [
        WeavePatch(draft="twill-2/2", end=2, pick=1, ends=5, picks=4),
        WeavePatch(draft="satin-5", end=4, pick=3, ends=6, picks=4),
    ]
    up = draft_of(Weave(draft="plain", ends=10, picks=9, patches=patches)).warp_up
    expected = named_weave("plain", ends=10, picks=9).warp_up.copy()
    expected[1:5, 2:7] = named_weave("twill-2/2", ends=5, picks=4).warp_up
    expected[3:7, 4:10] = named_weave("satin-5", ends=6, picks=4).warp_up
    assert (up == expected).all()


@pytest.mark.parametrize(("end", "pick"), [(6, 0), (0, 7)])
def test_a_patch_lies_within_the_cloth(end: int, pick: int) -> None:
    patch = WeavePatch(draft="plain", end=end, pick=pick, ends=5, picks=3)
    with pytest.raises(
        InputError, match=r"weave\.patches\[0\]: reaches to end \d+ and pick \d+; allowed: up to 10 and 9"
    ):
        draft_of(Weave(ends=10, picks=9, patches=[patch]))


def test_a_panel_has_a_draft_of_its_own_and_the_others_keep_the_weave() -> None:
    scene = load_scene(scene_file("tshirt"), [*COARSE, "garment.weaves.front=satin-5"])
    atlas = dressed_parts(scene).garment.atlas
    up = prepare_fabric(woven_garment(scene, atlas)).layout.cloth.warp_up
    for piece in atlas.panels:
        picks, ends = ((n - 1) * 2 + 1 for n in piece.shape)
        here = up[2 * piece.row :, 2 * piece.col :][:picks, :ends]
        own = piece.panel.name == "front"
        assert (here == named_weave("satin-5", ends=ends, picks=picks).warp_up).all() == own
        assert np.mean(here) == pytest.approx(0.8 if own else 0.25, abs=0.01)  # satin: warp on top; twill 1/3: weft


def test_a_wif_on_a_garment_brings_its_colours() -> None:
    """On all of it, or on one panel, unless orders are stated."""
    brought = read_wif(WIF)
    assert brought.warp_colour is not None
    order = "red*3 white*2"
    whole = load_scene(scene_file("tshirt"), [*COARSE, f"weave.draft={WIF}", f"garment.colours.front.weft={order}"])
    panel = load_scene(scene_file("tshirt"), [*COARSE, f"garment.weaves.front={WIF}"])
    assert panel.weave is not None
    for scene, name, warp, weft in (
        (whole, "back", brought.warp_colour, brought.weft_colour),
        (whole, "front", brought.warp_colour, thread_repeat(order)),
        (panel, "front", brought.warp_colour, brought.weft_colour),
        (panel, "back", thread_repeat(str(panel.weave.warp_colours)), thread_repeat(str(panel.weave.weft_colours))),
    ):
        colours = panel_colours(scene, panel_names(scene))[name]
        assert (colours.warp == warp).all()
        assert (colours.weft == weft).all()


def test_a_garment_without_orders_has_its_yarns_colours() -> None:
    changes = ["garment.representation=mesh", "yarn.colour=#ff0000", "weft_yarn.colour=#0000ff"]
    scene = load_scene("trousers", [*COARSE, *changes])
    assert scene.weave is not None
    plain = scene.model_copy(update={"weave": scene.weave.model_copy(update={"warp_colours": None})})
    stated = thread_repeat(str(scene.weave.weft_colours))
    for colours in panel_colours(plain, panel_names(plain)).values():
        assert colours.warp.tolist() == [[1.0, 0.0, 0.0]]
        assert (colours.weft == stated).all()


def test_the_side_of_a_mesh_that_lies_outside_has_the_colour_of_what_floats_there() -> None:
    """A 3/1 twill is three parts of its warp, but for a panel of another weave; in the light that they send back, each
    beside the other: of white among black `AMONG` is left, in a cloth of one colour nothing is lost."""
    scene = load_scene("trousers", ["weave.warp_colours=#ff0000", "weave.weft_colours=#0000ff"])
    assert scene.garment is not None
    scene.garment.weaves["left_back"] = "plain"
    red, blue = sent_back(np.eye(3)[[0, 2]])
    found = outer_colours(scene, ["left_front", "left_back"])
    near = (1 - AMONG) / WHITE
    red, blue = red + near * red * (blue - red), blue + near * blue * (red - blue)
    assert red[0] / sent_back(1.0) == pytest.approx(AMONG, abs=0.02)
    np.testing.assert_allclose(found["left_front"], 0.75 * red + 0.25 * blue, atol=1e-6)
    np.testing.assert_allclose(found["left_back"], 0.5 * red + 0.5 * blue, atol=1e-6)
    alike = outer_colours(load_scene("trousers", ["weave.warp_colours=#ff0000", "weave.weft_colours=#ff0000"]), ["x"])
    np.testing.assert_allclose(alike["x"], sent_back(np.eye(3)[0]), atol=1e-6)


def test_files_of_panels_are_meant_from_where_the_scene_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for draft in ("own.wif", "other.wif"):
        shutil.copy(WIF, tmp_path / draft)
    text = '[garment.weaves]\nfront = "own.wif"\nback = "plain"\n[garment.prints.front]\nfile = "print.png"\n'
    text += "[yarn]\n[weave]\n[body]\n"
    (tmp_path / "scene.toml").write_text(text)
    name = str(tmp_path / "scene.toml")
    garment = load_scene(name).garment
    assert garment is not None
    assert garment.weaves == {"front": str(tmp_path / "own.wif"), "back": "plain"}
    assert garment.prints["front"].file == str(tmp_path / "print.png")
    monkeypatch.chdir(tmp_path)  # an override's is meant from where the command runs
    garment = load_scene(name, ["garment.weaves.front=other.wif", 'garment.prints.front={file="here.png"}']).garment
    assert garment is not None
    assert garment.weaves["front"] == "other.wif"
    assert garment.prints["front"].file == "here.png"


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ("garment.weaves.frond=plain", "garment.weaves: no panel 'frond'; known: front, back"),
        ("garment.weaves.front=twil-2/2", "twil-2/2"),
        ("garment.weaves.front=none.wif", "none.wif"),
        ('weave.patches=[{draft="plain", end=0, pick=0, ends=2, picks=2}]', "weave.patches: .* say garment.weaves"),
    ],
)
def test_what_is_no_weave_of_a_panel_is_refused(change: str, line: str) -> None:
    def woven() -> None:
        scene = load_scene(scene_file("tshirt"), [*COARSE, change])
        prepare_fabric(woven_garment(scene, dressed_parts(scene).garment.atlas))

    with pytest.raises(InputError, match=line):
        woven()
