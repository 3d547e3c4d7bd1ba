"""Cloth whose threads are set by their sett: how key points adapt, what is refused, what a picture and a plan show."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes import __main__ as command_line
from taichi_cloth.scenes.models.cell_fibres import CellFibres
from taichi_cloth.scenes.models.cloth_model import ClothModel, mesh_colours
from taichi_cloth.scenes.paper.own_scenes import PAPER_DRAPE
from taichi_cloth.scenes.picture import view as picture
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare.cell_layout import prepare_sheet
from taichi_cloth.scenes.prepare.sett import on_cells, sett_of, spacing_on, threads_to_a_cell
from taichi_cloth.scenes.prepare.thread_colours import colour_repeats
from taichi_cloth.scenes.prepare.yarns import draft_of
from taichi_cloth.scenes.scene import draft_file as draft_files
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.scene.schema import Weave
from taichi_cloth.weave.draft import Draft
from taichi_cloth.weave.wif import read_wif

WIF = str(Path(__file__).parents[1] / "data" / "wif" / "two-color-liftplan.wif")
BARE = """[WIF]
Version=1.1
[CONTENTS]
WEAVING=true
WARP=true
WEFT=true
THREADING=true
LIFTPLAN=true
[THREADING]
1=1
2=2
[LIFTPLAN]
1=1
2=2
[WEAVING]
Shafts=2
[WEFT]
Threads=2
[WARP]
Threads=2
"""
SETT = ["fabric.ends_per_cm=24", "fabric.picks_per_cm=22"]
SMALL = ["cloth.rows=9", "cloth.columns=9", "cloth.width_m=0.1", "cloth.length_m=0.1", "output.frames=2", *SETT]
SMALL += ["forces.self_contact=false"]  # what is looked at is drawn; its kernel takes seconds to load
PLAIN = ["light.occlusion=false", "light.shadows=false", "stage.ground=false"]

pytestmark = pytest.mark.usefixtures("keep_taichi")


@pytest.mark.parametrize("name", ["drape", "flag", "hanging", "stretch"])
@pytest.mark.parametrize("per_cm", [(5.0, 5.0), (20.0, 20.0), (28.0, 45.0), (33.3, 17.9)])
def test_key_points_adapt_so_that_the_sett_holds(name: str, per_cm: tuple[float, float]) -> None:
    scene = load_scene(name, [f"fabric.ends_per_cm={per_cm[0]}", f"fabric.picks_per_cm={per_cm[1]}"])
    own, cloth = scene.cloth, on_cells(scene).cloth
    assert own is not None
    assert cloth is not None
    assert (cloth.width_m, cloth.length_m) == (own.width_m, own.length_m)
    wished = min(own.columns - 1, 100 * own.width_m * per_cm[0]), min(own.rows - 1, 100 * own.length_m * per_cm[1])
    assert cloth.columns - 1 == pytest.approx(wished[0], rel=0.16)
    assert cloth.rows - 1 == pytest.approx(wished[1], rel=0.16)
    sett = sett_of(scene)
    assert sett is not None
    across, along = threads_to_a_cell(on_cells(scene), sett)
    for threads, wanted in (
        ((cloth.columns - 1) * across, 100 * per_cm[0] * cloth.width_m),
        ((cloth.rows - 1) * along, 100 * per_cm[1] * cloth.length_m),
    ):
        assert threads == pytest.approx(wanted, rel=2e-3, abs=1.6 + 2e-3 * wanted)
    assert on_cells(on_cells(scene)).cloth == cloth


def test_threads_farther_apart_than_key_points_bring_key_points_with_them() -> None:
    cloth = on_cells(load_scene("drape", ["fabric.ends_per_cm=0.3", "fabric.picks_per_cm=0.2"])).cloth
    assert cloth is not None
    assert (cloth.columns, cloth.rows) == (31, 21)
    assert spacing_on((30.0, 2800.0), (0.012, 0.012)) == ((1 / 30, 34 / 2800), (1, 34))


@pytest.mark.parametrize("name", [PAPER_DRAPE, "stretch"])
def test_a_scene_without_a_sett_is_left_as_it_is(name: str) -> None:
    scene = load_scene(name)
    assert sett_of(scene) is None
    assert on_cells(scene) is scene


def test_a_wif_files_own_spacing_is_a_sett() -> None:
    sett = sett_of(load_scene("drape", [f"weave.draft={WIF}"]))
    assert sett is not None
    own = sett.draft.warp_spacing_m
    assert own is not None
    assert sett.ends == pytest.approx(len(own) / own.sum())


def test_a_file_of_one_small_repeat_is_shown_as_cloth() -> None:
    """4 × 6 threads come six and four times; what is stated, and what is large enough, comes as it is."""
    for name, stated, size in (
        ("two-color-liftplan.wif", {}, (24, 24)),
        ("two-color-liftplan.wif", {"ends": 4, "picks": 9}, (4, 9)),
        ("schort.wif", {}, (52, 38)),
    ):
        draft = draft_of(Weave.model_validate({"draft": str(Path(WIF).with_name(name)), **stated}))
        assert (draft.ends, draft.picks) == size


def test_a_wif_file_without_spacing_leaves_a_garment_its_sett_and_its_yarn() -> None:
    files = Path(__file__).parents[1] / "data" / "wif"
    scene = load_scene("tshirt", [f"weave.draft={files / 'schort.wif'}"])
    sett = sett_of(scene)
    assert sett is not None
    assert (sett.ends, sett.picks) == pytest.approx((2800, 2800))
    assert scene.yarn is not None
    assert scene.yarn.count == "Ne 30"
    assert scene.weave is not None
    assert scene.weave.weft_colours is None  # the file's own
    spaced = load_scene("tshirt", [f"weave.draft={files / 'two-color-liftplan.wif'}"])
    assert spaced.yarn is not None
    assert spaced.yarn.count is None
    assert sett_of(spaced).ends == pytest.approx(100 / 0.212)  # pyright: ignore[reportOptionalMemberAccess]


def test_colours_of_a_family_for_which_a_wif_file_has_none_stay_the_scenes(tmp_path: Path) -> None:
    (tmp_path / "bare.wif").write_text(BARE)
    table = "[COLOR PALETTE]\nRange=0,255\nEntries=1\n[COLOR TABLE]\n1=255,0,0\n"
    (tmp_path / "warp.wif").write_text(
        f"{BARE}Color=1\n{table}".replace("LIFTPLAN=true", "LIFTPLAN=true\nCOLOR TABLE=true")
    )
    stated = load_scene("tshirt").weave
    bare, warp = (load_scene("tshirt", [f"weave.draft={tmp_path / name}.wif"]) for name in ("bare", "warp"))
    assert stated is not None
    assert bare.weave is not None
    assert warp.weave is not None
    assert (bare.weave.warp_colours, bare.weave.weft_colours) == (stated.warp_colours, stated.weft_colours)
    assert (warp.weave.warp_colours, warp.weave.weft_colours) == (None, stated.weft_colours)
    np.testing.assert_allclose(colour_repeats(warp)[0], [[1.0, 0.0, 0.0]] * 2)
    other = load_scene("tshirt", [f"weave.draft={tmp_path / 'bare.wif'}", "weave.weft_colours=navy"]).weave
    assert other is not None
    assert other.weft_colours == "navy"


def test_a_wif_file_is_read_once_until_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, read = tmp_path / "own.wif", []
    path.write_bytes((Path(WIF).parent / "schort.wif").read_bytes())

    def counted(name: str) -> Draft:
        read.append(name)
        return read_wif(name)

    monkeypatch.setattr(draft_files, "read_wif", counted)
    scene = load_scene("tshirt", [f"weave.draft={path}"])
    first = sett_of(scene)
    assert first is not None
    assert draft_of(scene.weave or Weave()).warp_up.shape == first.draft.warp_up.shape
    assert read == [str(path)]
    path.write_bytes(Path(WIF).read_bytes())
    assert draft_files.draft_file(str(path)).warp_up.shape != first.draft.warp_up.shape
    assert read == [str(path)] * 2


def test_the_density_drawn_is_that_of_its_yarn_and_sett() -> None:
    """Ne 30, 24 × 22 a cm: threads/cm · tex · (1 + c) / 10, with 3 to 12 % crimp, less what finishing takes."""
    model = ClothModel(load_scene("drape", [*SMALL, "yarn.plies=1", "yarn.count_ne=30", "fabric.flattening=1.5"]))
    assert model.fibres is not None
    left = 1.0 - model.fibres.prepared.layout.warp.yarn.loss
    assert 0.9 < left <= 1.0
    straight = (24 + 22) * (590.5 / 30) / 10 * left
    assert 1.03 * straight < 1e3 * model.drawn_density() < 1.12 * straight
    facts = {fact.name: fact for fact in model.facts()}
    moved = model.simulation.sheet.material.density
    assert model.drawn_density() == pytest.approx(moved, rel=0.01)
    assert facts["weight"].value == f"{1e3 * moved:.0f} g/m²"
    assert sum("g/m²" in fact.value + fact.textbook for fact in facts.values()) == 1
    assert "substeps a frame" in facts
    assert facts["ends × picks per cm"].value == "24.0 × 22.0"


def test_plan_counts_threads_and_stores_none() -> None:
    counted = plan(load_scene("drape", ["fabric.ends_per_cm=20", "fabric.picks_per_cm=20"]))
    stages = {stage.name: stage.why for stage in counted.stages}
    assert "2003 ends × 2003 picks, 20.0 × 20.0 a cm, 26 × 26 to a cell" in stages["weave"]
    assert "in batches" in stages["splatter"]
    assert counted.blocks == 2 * 2002 * 2002
    assert counted.bytes < 2e9


@pytest.mark.parametrize(
    ("name", "more", "said"),
    [
        ("drape", ["cloth.follow=paper"], 'cloth.follow: "paper" has a key point at each crossing'),
        ("tshirt", ["garment.follow=paper"], 'garment.follow: "paper" has a key point'),
        ("drape", ["fabric.ends_per_cm=1e308"], "fabric.ends_per_cm: 1e+308"),
        ("drape", ["fabric.ends_per_cm=0.001"], "fabric.ends_per_cm: 0.001 on a cloth"),
        ("drape", ["cloth.width_m=0.01", "fabric.ends_per_cm=1"], "3 threads or more"),
        ("drape", ["weave.ends=40"], "weave.ends, weave.picks: a [cloth] has as many as its size"),
        ("drape", ['weave.patches=[{draft="plain",end=0,pick=0,ends=4,picks=4}]'], "weave.patches: not of a cloth"),
        ("drape", ["yarn.count_tex=400", 'fabric.when_jammed="refuse"'], "jam at 24.0 ends/cm"),
        ("tshirt", ["fabric.ends_per_cm=240"], "as which no yarn is pressed: space them wider, or take a yarn of"),
    ],
)
def test_what_a_cloth_with_a_sett_cannot_have_is_refused_in_one_line(
    name: str, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [part for text in (*SETT, *more) for part in ("--set", text)]
    with pytest.raises(SystemExit) as stopped:
        command_line.main(["plan", name, *options])
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.parametrize(("stripe", "finer"), [(4, 22), (40, 6)])
def test_a_mesh_has_the_colours_of_its_threads(stripe: int, finer: int) -> None:
    """At as many points as its stripes want, and no more than there are threads."""
    warp = f"weave.warp_colours='red*{stripe} blue*{stripe}'"
    scene = on_cells(load_scene("drape", [*SMALL, *PLAIN, "cloth.representation=mesh", warp]))
    cloth, sett = scene.cloth, sett_of(scene)
    assert cloth is not None
    assert sett is not None
    across, _ = threads_to_a_cell(scene, sett)
    found, colours = mesh_colours(scene)
    assert found == finer
    colours = colours.reshape((cloth.rows - 1) * finer + 1, -1, 3)
    threads = np.arange((cloth.columns - 1) * across + 1)
    nearest = np.floor(threads * finer / across + 0.5).astype(int)
    red = np.bincount(nearest, threads % (2 * stripe) < stripe) / np.bincount(nearest)
    assert np.corrcoef(colours[3, :, 0], red)[0, 1] > 0.98


def test_a_mesh_of_one_colour_has_the_key_points_alone() -> None:
    white = ["weave.warp_colours=white", "weave.weft_colours=white"]
    model = ClothModel(load_scene("drape", [*SMALL, *PLAIN, *white, "cloth.representation=mesh"]))
    assert len(model.mesh().vertices) == model.simulation.positions[..., 0].size


def test_a_mesh_of_stripes_lies_between_its_key_points() -> None:
    stripes = "weave.warp_colours='red*40 blue*40'"
    model = ClothModel(load_scene("drape", [*SMALL, *PLAIN, "cloth.representation=mesh", stripes]))
    rows, columns = model.simulation.sheet.shape
    points = model.mesh().vertices.reshape((rows - 1) * model.finer + 1, -1, 3)
    assert points[:: model.finer, :: model.finer] == pytest.approx(model.simulation.positions)
    assert len(model.mesh().faces) == 2 * (rows - 1) * (columns - 1) * model.finer**2


@pytest.fixture(scope="module")
def model() -> ClothModel:
    return ClothModel(load_scene("drape", [*SMALL, *PLAIN, "solver.name=verlet"]))  # compiles in a quarter of the time


def test_a_picture_is_made_of_what_the_camera_sees(model: ClothModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sheet and its fibres have the same mean light on the cloth to 5 %, and the same again when drawn again."""
    assert isinstance(model.fibres, CellFibres)
    model.step(1)
    view = View(model, (96, 64))
    ((_, image),) = view.turntable(1, [0])
    ((_, again),) = view.turntable(1, [0])
    assert (image == again).all()
    middle = image[28:36, 40:56].astype(float)
    assert (model.fibres.source.survey(view.camera()).grid > 0).all()  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(picture, "TARGET", 0.02)
    ((_, fine),) = view.turntable(1, [0])
    assert middle.mean() == pytest.approx(fine[28:36, 40:56].mean(), rel=0.05)
    assert np.abs(middle - image[0, 0]).max() > 40


def test_every_pixel_knows_its_thread(model: ClothModel, tmp_path: Path) -> None:
    shots = list(View(model, (96, 64)).bare_shots())
    (panel,) = model.panels()
    assert panel.source is not None
    camera: Any = shots[0].camera
    seen = panel.source.survey(camera)
    chosen = np.flatnonzero(seen.counts).astype(np.int32)
    yarn, part = panel.source.numbers(seen, chosen)  # pyright: ignore[reportArgumentType]
    ends = model.numbers().yarns
    assert yarn.max() < len(ends)
    assert [ends[int(k)]["system"] for k in yarn[:50]] == [("warp", "weft")[p] for p in part[:50]]
    prepared = prepare_sheet(model.scene)
    assert prepared is not None
    assert prepared.cells is not None
    assert len(ends) == sum(prepared.cells.woven)


def test_refusing_needs_no_model() -> None:
    with pytest.raises(InputError, match="follow"):
        on_cells(load_scene("drape", [*SETT, "cloth.follow=paper"]))
