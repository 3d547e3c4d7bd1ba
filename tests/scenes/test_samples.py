"""Pictures of few pixels are as bright, and cover as much, as finer ones."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground import runtime
from taichi_cloth.render.image.image import linear_to_srgb
from taichi_cloth.render.image.tone import TONES, Tone, tone_curve
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.models.model import Model
from taichi_cloth.scenes.picture import view as view_module
from taichi_cloth.scenes.picture.samples import averaged, over, samples_of, shown
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.scene.load import load_scene

SIZE = 96, 72

pytestmark = pytest.mark.usefixtures("taichi_runtime")


@pytest.fixture(scope="module")
def model(taichi_runtime: runtime.Runtime) -> Model:
    """A small swatch that is seen with 3 pixels a thread."""
    return build(
        load_scene("swatch", ["weave.ends=20", "weave.picks=14", "stage.ground=false", "output.size=[96, 72]"])
    )


def means(model: Model, scale: int) -> tuple[np.ndarray, int]:
    """Mean premultiplied light and coverage (4,), and samples a pixel."""
    (shot,) = View(model, SIZE, scale=scale).shots()
    return shot.splatter.linear().mean(axis=(0, 1), dtype=np.float64), shot.scale


def test_thin_fibres_cover_as_much_and_are_as_bright_as_on_many_pixels(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    (few, samples), (many, scale) = means(model, 1), means(model, 4)
    assert (samples, scale) == (2, 4)
    assert few == pytest.approx(many, rel=0.012)
    monkeypatch.setattr(view_module, "samples_of", lambda panel, camera: 1)
    assert means(model, 1)[0][3] > 1.018 * many[3]  # gaps filled


def test_samples_become_pixels_in_linear_light(model: Model) -> None:
    view = View(model, SIZE)
    (shot,) = view.shots()
    ((_, image),) = view.turntable(1, [0])
    width, height = SIZE
    assert image.shape == (height, width, 3)
    light = view.light_of(shot)
    assert light.shape == (2 * height, 2 * width, 3)
    light = light.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    want = 255 * linear_to_srgb(tone_curve(view.lighting.tone, light))
    assert np.abs(image - want).max() < 1.5


def test_only_thin_fibres_have_several_samples(model: Model) -> None:
    (panel,), (camera,) = model.panels(), [shot.camera for shot in View(model, SIZE, scale=2).shots()]
    assert [samples_of(panel, one) for one in (camera, replace(camera, focal=20 * camera.focal))] == [2, 1]


@pytest.mark.parametrize("tone", TONES)
def test_light_is_shown_as_rasters_table_has_it(tone: Tone) -> None:
    light = np.random.default_rng(3).uniform(0, 1.2, (5, 7, 3)).astype(np.float32)
    assert np.abs(shown(tone, light) - 255 * linear_to_srgb(tone_curve(tone, light))).max() < 1.5


def test_what_lies_over_hides_what_stands_behind() -> None:
    rgba = np.array([[[0.1, 0.2, 0.3, 0.5], [0.4, 0.4, 0.4, 1.0]]], np.float32)
    light = over(rgba, np.array([1.0, 0.0, 0.0]))
    assert light[0] == pytest.approx(np.array([[0.6, 0.2, 0.3], [0.4, 0.4, 0.4]]))
    assert averaged(light.repeat(2, axis=0).repeat(2, axis=1), 2) == pytest.approx(light)
