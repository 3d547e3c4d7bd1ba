"""How far a picture is from a path tracer's: pictures whose distance is known, the table, and where Mitsuba is not."""

import csv
import importlib.util
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_cloth.ground import runtime
from taichi_cloth.ground.mixing import SURFACE_SHARE
from taichi_cloth.render.light.bulk import dyed
from taichi_cloth.scenes.__main__ import _status
from taichi_cloth.scenes.measure import likeness as likenesses
from taichi_cloth.scenes.measure.likeness import Likeness, likeness, luminance, shown_alike
from taichi_cloth.scenes.studies import make
from taichi_cloth.scenes.studies.appearance import LIMITS, outside, row_of, section
from taichi_cloth.scenes.studies.looks.cases import CASES, PLAIN, fibre_starts
from taichi_cloth.scenes.studies.looks.path_traced import absorption, in_no_light

SIDE = 60


@pytest.fixture
def no_flip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(likenesses, "flip", lambda ours, reference: np.zeros(ours.shape[:2]))


def picture(seed: int = 1) -> np.ndarray:
    """Something of every brightness, covered but for a strip."""
    rgba = np.random.default_rng(seed).uniform(0.2, 1.0, (SIDE, SIDE, 4))
    rgba[..., 3] = 1.0
    rgba[:, :5] = 0.0
    return rgba


def slope() -> np.ndarray:
    return np.tile(np.linspace(0, 1, SIDE), (SIDE, 1))


@pytest.mark.usefixtures("no_flip")
def test_a_picture_of_half_the_light_has_half_of_everything_but_saturation() -> None:
    """The blurred error of half a picture is half the root mean square of the blurred one over its mean."""
    reference = picture()
    ours = reference * [0.5, 0.5, 0.5, 1.0]
    found = likeness(ours, reference, slope())
    assert found.luminance == pytest.approx(0.5)
    assert found.colours == pytest.approx((0.5, 0.5, 0.5))
    assert found.blurred == pytest.approx(0.5, rel=0.01)  # noise is blurred away
    np.testing.assert_allclose(found.depths, 0.5)
    assert found.saturation[0] == pytest.approx(found.saturation[1])
    same = likeness(reference, reference, slope())
    assert (same.luminance, same.blurred) == (pytest.approx(1.0), 0.0)


@pytest.mark.usefixtures("no_flip")
def test_depths_are_told_apart_by_openness_and_colours_by_themselves() -> None:
    """Blue is lost where openness is below its median: in the first three of six bins and not in the others."""
    openness, reference = slope(), picture()
    reference[..., :4] = 1.0
    ours = reference.copy()
    ours[openness < 0.5, 2] = 0.25
    found = likeness(ours, reference, openness)
    np.testing.assert_allclose(found.depths[:, :2], 1.0)
    np.testing.assert_allclose(found.depths[:, 2], [0.25, 0.25, 0.25, 1, 1, 1])
    assert found.saturation == (pytest.approx(1 - 0.625), 0.0)


def test_what_only_one_picture_covers_does_not_count_and_is_shown_black() -> None:
    reference = picture()
    ours = np.where(reference[..., 3:] > 0, reference, 1.0)  # something bright where the reference is empty
    one, two = shown_alike(ours, reference)
    np.testing.assert_allclose(one, two)
    assert not one[:, :5].any()
    bright = np.quantile(luminance(reference)[reference[..., 3] > 0], 0.95)
    grey = np.full((2, 2, 4), bright)
    grey[..., 3] = 1.0
    np.testing.assert_allclose(luminance(grey), bright)


@pytest.mark.usefixtures("no_flip")
def test_a_pattern_smaller_than_the_blur_is_no_error_and_a_wide_one_is() -> None:
    """Stripes of ±20 %, 2 px wide and 60 px wide: the one is blurred away, of the other most is left."""
    flat = np.ones((180, 180, 4))
    x = np.arange(180)
    for width, least, most in ((2, 0.0, 0.005), (60, 0.15, 0.2)):
        ours = flat.copy()
        ours[..., :3] *= (1 + 0.2 * (-1.0) ** (x // width))[:, None]
        assert least <= likeness(ours, flat, np.tile(x / 180, (180, 1))).blurred <= most


def test_a_thick_mass_of_fibres_that_absorb_nothing_is_white() -> None:
    found = absorption([1.0, 0.6, 0.15])
    assert found[0] == 0.0
    assert (np.diff(found) > 0).all()
    # Chiang et al. 2016, equation 9, the other way round, at the azimuthal roughness of 0.4
    scale = 5.969 - 0.215 * 0.4 + 2.532 * 0.4**2 - 10.73 * 0.4**3 + 5.574 * 0.4**4 + 0.245 * 0.4**5
    np.testing.assert_allclose(np.exp(-np.sqrt(found) * scale), dyed([1.0, 0.6, 0.15]))
    assert (absorption([0.0, SURFACE_SHARE]) == absorption(0.01)).all()  # as dark as it gets


@pytest.mark.slow
@pytest.mark.parametrize("spread", [25.0, 90.0])
def test_a_thick_mass_of_fibres_has_the_colour_that_was_asked_for(spread: float, tmp_path: Path) -> None:
    """By the path tracer, under an even sky: straight fibres of diameter 1 fill 0.4 of it, within so many degrees of
    one direction."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    colours, wide, deep = np.array([0.02, 0.1, 0.4]), 260.0, 130.0
    rng = np.random.default_rng(3)
    along, curves = np.linspace(-0.6 * wide, 0.6 * wide, 6), tmp_path / "fibres.txt"
    with curves.open("w") as out:
        for _ in range(int(0.4 * wide * deep / (np.pi / 4))):
            y, z, turn = (
                rng.uniform(-deep, 0),
                rng.uniform(-wide / 2, wide / 2),
                np.radians(rng.uniform(-spread, spread)),
            )
            out.writelines(f"{s * np.cos(turn):.3f} {y:.3f} {z + s * np.sin(turn):.3f} 0.5\n" for s in along)
            out.write("\n")
    look = mi.ScalarTransform4f().look_at([70, 1000, 120], [0, 0, 0], [0, 0, 1])
    film = {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}}
    eye = {"type": "perspective", "fov": 2.0, "near_clip": 1.0, "far_clip": 1e6, "to_world": look, "film": film}
    lit = {"sensor": eye, "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}}
    found = np.array(mi.render(mi.load_dict({**in_no_light(curves, colours), **lit}), spp=16))[..., :3].mean(
        axis=(0, 1)
    )
    assert found[0] == pytest.approx(SURFACE_SHARE, abs=0.01)  # lighter than was asked: as dark as it gets
    np.testing.assert_allclose(found[1:], colours[1:], rtol=0.15)


def test_fibres_are_told_apart_by_gaps_between_their_particles() -> None:
    x = np.zeros((7, 3), np.float32)
    x[:, 0] = [0.0, 1.0, 2.0, 5.0, 6.0, 0.0, 1.0]
    np.testing.assert_array_equal(fibre_starts(x, np.full(7, 1.5, np.float32)), [0, 3, 5, 7])


def found(**changes: Any) -> Likeness:
    usual = Likeness(
        luminance=1.0, colours=(1.0, 1.0, 1.0), blurred=0.05, depths=np.ones((6, 3)), saturation=(0.8, 0.8), flip=0.2
    )
    return replace(usual, **changes)


def test_what_is_outside_is_said_and_what_was_not_fitted_may_be_half_as_far_again_off() -> None:
    assert outside(found(), LIMITS) == []
    depths = np.ones((6, 3))
    depths[0] = 0.8, 1.1, 1.3
    off = found(luminance=1.06, blurred=0.12, depths=depths, saturation=(0.8, 0.76), flip=0.4)
    words = ["luminance 1.06", "blurred error 0.12", "depths to red 0.80, blue 1.30", "FLIP 0.40", "saturation +0.040"]
    assert outside(off, LIMITS) == words
    assert outside(off, LIMITS.wider(1.5)) == ["depths to blue 1.30"]


def test_the_table_has_a_row_a_case_and_its_csv_every_number() -> None:
    rows = [row_of(case, found(luminance=0.97), (0.5, 60.0)) for case in CASES]
    image = np.zeros((8, 8, 3), np.uint8)
    made = section(rows, ["all within."] * len(rows), [image] * 3, quick=False)
    assert made.image is not None
    assert made.image.startswith(b"\x89PNG")
    assert all(len(line) == len(made.head) for line in made.table)
    lines = list(csv.DictReader(StringIO(made.csv)))
    assert [line["case"] for line in lines] == [case.name for case in CASES]
    assert {line["luminance"] for line in lines} == {"0.97"}
    assert lines[0]["depths_blue"] == "1.00 1.00 1.00 1.00 1.00 1.00"
    assert sum(line["fitted"] == "False" for line in lines) >= 3


def test_without_the_extra_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    usual = importlib.util.find_spec
    monkeypatch.setattr(make, "find_spec", lambda name: None if name == "mitsuba" else usual("csv"))
    assert _status(["report", "--only", "appearance", "--out", str(tmp_path / "r")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "appearance needs mitsuba" in said
    assert 'pip install "taichi-cloth[reference]"' in said
    assert list(tmp_path.iterdir()) == []


def test_a_report_of_all_leaves_out_what_cannot_be_made_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(make, "find_spec", lambda name: None)
    monkeypatch.setattr(make, "STUDIES", ("appearance",))
    monkeypatch.setattr(runtime, "start", lambda *_, **__: runtime.Runtime("x64", 1))
    make.make_report(only=None, quick=True, out=tmp_path / "r")
    said = capsys.readouterr()
    assert "left out: appearance needs mitsuba and flip_evaluator" in " ".join((said.out + said.err).split())
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["index.html", "report.md"]


@pytest.mark.slow  # a quarter of a minute, most of it path tracing
@pytest.mark.usefixtures("keep_taichi")
def test_plain_weave_is_as_bright_as_path_traced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("matplotlib", "mitsuba", "flip_evaluator"):
        pytest.importorskip(package)
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path / "kept"))
    make.make_report(only="appearance", quick=True, out=tmp_path / "r")
    with (tmp_path / "r" / "appearance.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert 0.9 < float(row["luminance"]) < 1.1
    assert float(row["blurred"]) < 0.15
    assert float(row["flip"]) < 0.4
    assert PLAIN.fitted
    assert (tmp_path / "r" / "appearance.png").read_bytes().startswith(b"\x89PNG")
