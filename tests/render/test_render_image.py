"""sRGB, PNG files that are whole or not there, contact sheets, sprite sheets and films."""

import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.camera import frame
from taichi_cloth.render.data.finish import FINISHES, Finish, finish_for
from taichi_cloth.render.data.light import Background, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.data.sprites import SpriteSheet, fibre_sprite, round_sprite, sheet_from_png, soft_sprite
from taichi_cloth.render.image.image import (
    contact_sheet,
    linear_to_srgb,
    read_png,
    srgb_to_linear,
    write_png,
)
from taichi_cloth.render.image.video import Codec, write_mp4
from taichi_cloth.render.splat.splat import Splatter


def test_all_256_levels_survive_linear_light() -> None:
    levels = np.arange(256)
    linear = srgb_to_linear(levels / 255)
    assert (np.round(linear_to_srgb(linear) * 255) == levels).all()
    assert linear_to_srgb([-1.0, 2.0]) == pytest.approx([0, 1])


def test_png_round_trips_in_8_and_16_bits(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    for dtype in (np.uint8, np.uint16):
        for shape in ((5, 7), (5, 7, 3), (5, 7, 4)):
            image = random.integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
            write_png(tmp_path / "a.png", image)
            again = read_png(tmp_path / "a.png")
            assert again.dtype == dtype
            assert (again == image).all()
    red = np.zeros((2, 2, 3), np.uint8)
    red[..., 0] = 255
    write_png(tmp_path / "red.png", red)
    read = cv2.imread(str(tmp_path / "red.png"))
    assert read is not None
    assert read[0, 0].tolist() == [0, 0, 255]  # OpenCV's order is BGR


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.png"
    write_png(path, np.zeros((2, 2, 3), np.uint8))
    before = path.read_bytes()

    def broken(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(OSError, match="disk full"):
        write_png(path, np.ones((2, 2, 3), np.uint8))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_images_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="float64"):
        write_png(tmp_path / "a.png", np.zeros((2, 2, 3)))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="shape"):
        write_png(tmp_path / "a.png", np.zeros((2, 2, 2), np.uint8))
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(InputError, match="not an image"):
        read_png(tmp_path / "text.png")
    with pytest.raises(InputError, match="No such file"):
        read_png(tmp_path / "missing.png")


def test_contact_sheet_places_thumbnails_in_rows(tmp_path: Path) -> None:
    images = [np.full((40, 80, 3), 20 * k, np.uint8) for k in range(5)]
    write_png(tmp_path / "4.png", images[4])
    sheet = contact_sheet([*images[:4], tmp_path / "4.png"], columns=3, thumbnail=40, gap=4)
    assert sheet.shape == (2 * 24 + 4, 3 * 44 + 4, 3)
    for k in range(5):
        assert (sheet[4 + k // 3 * 24 + 10, 4 + k % 3 * 44 + 20] == 20 * k).all()
    assert (sheet[40, 120] == 255).all()  # the empty place
    with pytest.raises(InputError, match="no images"):
        contact_sheet([])


def test_sprite_sheet_pyramid_keeps_the_mean() -> None:
    sheet = SpriteSheet(np.stack([round_sprite(16), soft_sprite(16), fibre_sprite(16)]))
    per_sprite = sheet.pyramid().reshape(3, -1)
    assert per_sprite.shape[1] == 336
    for begin, end in pairwise((0, 256, 320, 336)):
        assert per_sprite[:, begin:end].mean(axis=1) == pytest.approx(sheet.alpha.mean(axis=(1, 2)), rel=1e-5)
    assert soft_sprite(64).sum() * (2 / 64) ** 2 == pytest.approx(np.pi / 3, rel=1e-3)
    assert (fibre_sprite(32, seed=4) == fibre_sprite(32, seed=4)).all()


def test_sprites_come_from_the_alpha_of_pngs(tmp_path: Path) -> None:
    for name, dtype, top in (("eight", np.uint8, 255), ("sixteen", np.uint16, 65535)):
        rgba: Any = np.zeros((16, 16, 4), dtype)
        rgba[4:12, 4:12, 3] = top
        write_png(tmp_path / f"{name}.png", rgba)
    sheet = sheet_from_png([tmp_path / "eight.png", tmp_path / "sixteen.png"], size=8)
    assert (sheet.alpha[0] == sheet.alpha[1]).all()
    assert sheet.alpha[0, 4, 4] == 1
    write_png(tmp_path / "opaque.png", np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(InputError, match="alpha channel"):
        sheet_from_png([tmp_path / "opaque.png"])
    with pytest.raises(InputError, match="power of two"):
        SpriteSheet(np.zeros((1, 5, 5)))
    with pytest.raises(InputError, match="0 to 1"):
        SpriteSheet(np.full((1, 4, 4), 2.0))


@pytest.mark.slow
def test_small_textured_splats_keep_their_coverage() -> None:
    """A far splat reads a coarse level of its sprite, so that nothing flickers between the texels."""
    sheet = SpriteSheet(soft_sprite(64)[None])
    x, y = np.meshgrid(np.linspace(-0.25, 0.25, 8), np.linspace(-0.18, 0.18, 7))
    camera = frame([(0, 0, 0)], radius=0.3, width=64, height=48)
    scale = camera.focal / camera.translation[2]
    for radius in (0.5, 1.0, 3.0):
        place = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
        particles = Particles(place, radius / scale, (1, 1, 1), (1, 0, 0), (0, 0, 1), opacity=1.0)
        splatter = Splatter(64, 48, sprites=sheet).load(particles)
        splatter.render(camera)
        expected = len(place) * np.pi * radius**2 / 3
        assert splatter.linear()[..., 3].sum() == pytest.approx(expected, rel=0.08)


def test_sprite_numbers_are_checked() -> None:
    particles = Particles([(0, 0, 0)], 1.0, (1, 1, 1), (1, 0, 0), (0, 0, 1), sprite=[3])
    with pytest.raises(InputError, match="sprite: 3 to 3; allowed: 0 to 0"):
        Splatter(64, 48, sprites=SpriteSheet(soft_sprite(8)[None])).load(particles)


def test_finishes_and_lights_check_their_values() -> None:
    assert finish_for("wool") is FINISHES["wool"]
    with pytest.raises(InputError, match='did you mean "cotton"'):
        finish_for("coton")
    with pytest.raises(InputError, match=r"finish.exponent"):
        Finish(exponent=1.0)
    with pytest.raises(InputError, match="no length"):
        Lighting(direction=(0, 0, 0))
    with pytest.raises(InputError, match=r"lighting.key"):
        Lighting(key=-1)
    with pytest.raises(InputError, match=r"background.top"):
        Background(top=(0, -1, 0))
    assert Lighting(exposure=1).radiances() == pytest.approx(2 * Lighting().radiances())


def film() -> list[np.ndarray]:
    y, x = np.mgrid[:45, :63]
    return [np.stack([4 * y + 5 * k, 3 * x, 2 * (x + y)], -1).astype(np.uint8) for k in range(6)]


@pytest.mark.parametrize("codec", ["h264", "vp9"])
def test_film_can_be_read_back(codec: Codec, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    if codec == "h264":
        pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "film.mp4"
    data = []
    for _ in range(2):
        assert write_mp4(path, film(), fps=25, codec=codec) == codec
        data.append(path.read_bytes())
    assert data[0] == data[1]
    assert capfd.readouterr() == ("", "")
    capture = cv2.VideoCapture(str(path))
    frames = []
    while True:
        there, image = capture.read()
        if not there:
            break
        frames.append(image[..., ::-1])
    assert len(frames) == 6
    assert frames[0].shape == (46, 64, 3)  # made even
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(25)
    assert np.abs(frames[3][:45, :63].astype(int) - film()[3]).mean() < 8
    assert [p.name for p in tmp_path.iterdir()] == ["film.mp4"]


def test_films_that_cannot_be_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with pytest.raises(InputError, match="no frames"):
        write_mp4(path, [], fps=25)
    with pytest.raises(InputError, match="fps"):
        write_mp4(path, film(), fps=0)
    with pytest.raises(InputError, match="as the first frame"):
        write_mp4(path, [film()[0], film()[1][:-2]], fps=25)
    assert list(tmp_path.iterdir()) == []
