"""Stills, EXR and WebP: what the files hold, and that they are whole or not there."""

import importlib
import json
import resource
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.image.exr import write_exr
from taichi_cloth.render.image.image import read_png, srgb_to_linear
from taichi_cloth.render.image.webp import write_webp
from taichi_cloth.render.light import particle_light
from taichi_cloth.scenes.__main__ import main
from taichi_cloth.scenes.commands import still as still_module
from taichi_cloth.scenes.models import fabric_model
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare import weave_layout
from taichi_cloth.scenes.scene.load import load_scene

SMALL = ["--set", "weave.ends=8", "--set", "weave.picks=6", "--size", "120x90"]


pytestmark = pytest.mark.usefixtures("keep_taichi")


def still(folder: Path, *more: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["still", "swatch", *SMALL, "--out", str(folder), *more])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory, taichi_runtime: runtime.Runtime) -> Path:
    folder = tmp_path_factory.mktemp("still")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runtime, "start", lambda *a, **k: taichi_runtime)
        assert still(folder, "--passes", "colour,depth,normal,mask,id", "--format", "png16") == 0
    return folder


def test_files_lie_on_one_another_and_say_what_they_are(pictures: Path) -> None:
    about = json.loads((pictures / "still.json").read_text())
    names = ["colour.png", "depth.png", "normal.png", "mask.png", "yarn.png", "part.png"]
    assert list(about["files"]) == names
    images = {name: read_png(pictures / name) for name in names}
    assert {image.shape[:2] for image in images.values()} == {(90, 120)}
    assert {image.dtype for image in images.values()} == {np.dtype(np.uint16)}
    seen = images["depth.png"] > 0
    assert (seen == (images["mask.png"] > 32767)).mean() > 0.99  # of more samples a pixel, as the colour
    assert (seen == (images["yarn.png"] > 0)).all()
    assert (images["normal.png"][images["mask.png"] == 0] == 0).mean() > 0.99
    length = np.linalg.norm((images["normal.png"][seen].astype(float) - 32768) / 32767, axis=-1)
    np.testing.assert_allclose(length, 1, atol=1e-4)
    assert set(np.unique(images["yarn.png"])) <= set(range(15))
    assert len(about["yarns"]) == 14
    assert about["yarns"]["9"] == {"system": "weft", "index": 0}
    assert about["parts"] == {"1": "warp", "2": "weft"}
    weft = images["yarn.png"] > 8
    assert (images["part.png"][seen] == np.where(weft, 2, 1)[seen]).all()


@pytest.mark.parametrize("supersample", ["1", "2"])
def test_the_mask_covers_what_the_colour_shows(tmp_path: Path, supersample: str) -> None:
    """No light on threads before a white background: what is not white is covered. Of one sample a pixel the mask would
    cover 0.02 more."""
    flat = [("light.background", "['#ffffff','#ffffff']"), ("stage.ground", "false"), ("light.tone", "srgb")]
    flat += [("weave.ends", "60"), ("weave.picks", "44")]
    flat += [(f"light.{name}_strength", "0") for name in ("key", "fill")]
    options = [word for name, value in flat for word in ("--set", f"{name}={value}")]
    more = "--format", "png16", "--supersample", supersample, "--passes", "colour,mask"
    assert still(tmp_path, *options, *more) == 0
    colour, mask = (read_png(tmp_path / f"{name}.png") / 65535 for name in ("colour", "mask"))
    assert np.mean(1 - srgb_to_linear(colour[..., 1])) == pytest.approx(mask.mean(), abs=2e-3)


def test_json_brings_depths_back_onto_the_cloth(pictures: Path) -> None:
    about = json.loads((pictures / "still.json").read_text())
    depth, note, (camera,) = read_png(pictures / "depth.png"), about["files"]["depth.png"], about["cameras"]
    row, column = np.nonzero(depth)
    z = note["offset_m"] + note["scale_m"] * depth[row, column]
    assert note["near_m"] == pytest.approx(z.min(), abs=note["scale_m"])
    assert note["far_m"] == pytest.approx(z.max(), abs=note["scale_m"])
    ray = np.stack([column + 0.5, row + 0.5, np.ones(len(row))], -1) @ np.linalg.inv(camera["K"]).T
    world = (ray * z[:, None] - camera["t"]) @ np.array(camera["R"])
    assert np.abs(world[:, [0, 2]]).max() < 0.005  # eight ends at 28.5 a cm and their fringe
    assert np.abs(world[:, 1]).max() < 0.003
    x, y = cv2.projectPoints(
        world, cv2.Rodrigues(np.array(camera["R"]))[0], np.array(camera["t"]), np.array(camera["K"]), None
    )[0][:, 0].T
    np.testing.assert_allclose(x, column + 0.5, atol=1e-3)
    np.testing.assert_allclose(y, row + 0.5, atol=1e-3)


def test_supersampling_keeps_the_framing(tmp_path: Path, pictures: Path) -> None:
    assert still(tmp_path, "--supersample", "1", "--format", "png16") == 0
    one, two = (read_png(f / "colour.png").astype(float) / 65535 for f in (tmp_path, pictures))
    assert np.abs(one - two).mean() < 0.02
    first, second = (json.loads((f / "still.json").read_text())["cameras"] for f in (tmp_path, pictures))
    np.testing.assert_allclose(first[0]["K"], second[0]["K"], rtol=1e-9)


def test_in_batches_it_is_the_same_picture(tmp_path: Path, pictures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fabric that is too large to hold: in light, on its floor, with all passes."""
    # Light of a fabric that is held is found for some particles along its fibres; a sample has no such order.
    monkeypatch.setattr(particle_light, "chain_step", lambda *a: None)
    assert still(tmp_path / "whole", "--format", "png16") == 0
    monkeypatch.setattr(weave_layout, "HELD", 0)
    assert still(tmp_path, "--passes", "colour,depth,normal,mask,id", "--format", "png16") == 0
    about, whole = (json.loads((folder / "still.json").read_text()) for folder in (tmp_path, pictures))
    assert about["yarns"] == whole["yarns"]
    assert about["cameras"] == whole["cameras"]
    for name in about["files"]:
        of_whole = tmp_path / "whole" if name == "colour.png" else pictures
        one, two = (read_png(folder / name).astype(float) for folder in (tmp_path, of_whole))
        assert (np.abs(one - two) <= (655 if name == "colour.png" else 0)).mean() > 0.97, name
        if name == "colour.png":
            assert one.mean() == pytest.approx(two.mean(), rel=0.001)


def test_what_comes_in_batches_has_the_light_of_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cast by a tenth of it: threads of few fibres. A tenth of its particles, enlarged, would leave it 0.79."""

    def light() -> float:
        view = View(build(scene), (120, 80))
        shot = next(view.shots())
        rgba = shot.splatter.linear() if shot.linear is None else shot.linear
        return float(rgba[..., :3].sum() / rgba[..., 3].sum())

    threads = ["weave.draft=plain", "weave.ends=24", "weave.picks=16", "yarn.count=Ne 40", "fabric.ends_per_cm=45"]
    threads += ["fabric.picks_per_cm=28", "yarn.fibres=40", "fabric.steps=6", "fabric.pose=flat", "fabric.fringe=0"]
    scene = load_scene("swatch", threads)
    whole = light()
    monkeypatch.setattr(weave_layout, "HELD", 0)
    monkeypatch.setattr(fabric_model, "LIT", 20_000)
    assert light() == pytest.approx(whole, rel=0.06)


@pytest.mark.slow
def test_ten_million_particles_take_less_than_four_gigabytes(tmp_path: Path) -> None:
    """In a process of its own, with every pass, light and floor."""
    large = ["weave.ends=140", "weave.picks=140", "yarn.fibres=24", "fabric.steps=6"]
    command = [sys.executable, "-m", "taichi_cloth.scenes", "still", "swatch", "--size", "320x200", "--out", tmp_path]
    command += [*(word for value in large for word in ("--set", value)), "--passes", "colour,depth,normal,mask,id"]
    subprocess.run(command, check=True, timeout=900, stdout=subprocess.DEVNULL)
    assert 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 4e9
    assert plan(load_scene("swatch", large)).particles > 9_900_000
    assert read_png(tmp_path / "colour.png").std() > 10
    assert len(np.unique(read_png(tmp_path / "yarn.png"))) > 200


def test_in_batches_there_are_no_textures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(weave_layout, "HELD", 0)
    assert still(tmp_path, "--set", "fibre.sprite=fuzzy") == 2
    assert 'take "thread" or "soft"' in capfd.readouterr().err
    assert "in batches" in next(s.why for s in plan(load_scene("swatch", SMALL[1:4:2])).stages if s.name == "splatter")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--passes", "colour,dept"], 'did you mean "depth"'),
        (["--passes", ""], "none given"),
        (["--format", "jpg"], "png, png16, exr"),
        (["--supersample", "3"], "allowed: 1, 2, 4"),
        (["--size", "9000x90"], "over 16384 pixels"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(
    arguments: list[str], words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert still(tmp_path / "new", *arguments) == 2
    error = capfd.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_nothing_is_written_when_drawing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*a: object, **k: object) -> None:
        raise InputError("no")

    monkeypatch.setattr(still_module, "render_passes", fail)
    assert still(tmp_path, "--passes", "colour,id") == 2
    assert list(tmp_path.iterdir()) == []


def test_exr_keeps_every_bit(tmp_path: Path) -> None:
    library = pytest.importorskip("OpenEXR")
    depth = np.random.default_rng(0).random((20, 30)).astype(np.float32)
    number = np.arange(600).reshape(20, 30)
    write_exr(tmp_path / "a.exr", {"Z": depth, "id": number})
    with library.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: channel.pixels.copy() for name, channel in file.channels().items()}
    assert (found["Z"] == depth).all()
    assert (found["id"] == number).all()
    with pytest.raises(InputError, match="all of one"):
        write_exr(tmp_path / "b.exr", {"Z": depth, "id": number[:3]})
    with pytest.raises(OSError, match=r"."):
        write_exr(tmp_path / "none" / "b.exr", {"Z": depth})
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_without_openexr_a_line_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    load = importlib.import_module

    def missing(name: str, *more: str) -> object:
        if name == "OpenEXR":
            raise ImportError(name)
        return load(name, *more)

    monkeypatch.setattr(importlib, "import_module", missing)
    assert still(tmp_path / "new", "--format", "exr") == 2
    assert "pip install 'taichi-cloth[exr]'" in capfd.readouterr().err
    assert not (tmp_path / "new").exists()


def test_webp_plays_and_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [np.full((40, 90, 3), (20 * k, 200 - 20 * k, 90), np.uint8) for k in range(6)]
    path = tmp_path / "a.webp"
    write_webp(path, frames, fps=18, width=45)
    done, film = cv2.imreadanimation(str(path))
    assert done
    assert len(film.frames) == 6
    assert film.frames[0].shape[:2] == (20, 45)
    assert sum(film.durations) == pytest.approx(1000 * 6 / 18, abs=1)
    np.testing.assert_allclose(film.frames[3][5, 5, :3], (90, 140, 60), atol=6)
    for bad, words in (([], "no frames"), ([frames[0], frames[0][1:]], "all of one size")):
        with pytest.raises(InputError, match=words):
            write_webp(path, bad, fps=18)
    before = path.read_bytes()
    monkeypatch.setattr(cv2, "imencodeanimation", lambda *a: (False, None))
    with pytest.raises(InputError, match="could not encode"):
        write_webp(path, frames, fps=18)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.webp"]


def test_plan_says_what_a_picture_leaves_out() -> None:
    def stages(name: str, *overrides: str) -> dict[str, bool]:
        return {stage.name: stage.built for stage in plan(load_scene(name, list(overrides))).stages}

    swatch = stages("swatch")
    assert swatch["floor"]
    assert not swatch["meshes"]
    assert not swatch["passes"]
    assert swatch["light pass"]
    assert swatch["occlusion"]
    dark = stages("swatch", "light.shadows=false", "light.occlusion=false")
    assert not dark["light pass"]
    assert not dark["occlusion"]
    assert not stages("swatch", "stage.ground=false")["floor"]
    assert not stages("yarn")["floor"]
    assert stages("yarn", "stage.ground=true")["floor"]


def test_light_along_a_fibre_is_as_if_found_for_each_of_its_particles() -> None:
    """A fibre goes over and under: crowns would be darker by a tenth, if light were found once a crossing."""
    view = View(build(load_scene("plain", ["weave.ends=10", "weave.picks=10", "yarn.fibres=16"])), (96, 64))
    (shot,) = view.shots()
    found = shot.splatter.linear().mean(axis=(0, 1))
    shot.splatter.light.hold(shot.splatter.cast_light(shot.camera, view.lighting), each=True)
    shot.splatter.render(shot.camera, lighting=view.lighting, finish=view.finish)
    assert found == pytest.approx(shot.splatter.linear().mean(axis=(0, 1)), rel=0.025)
