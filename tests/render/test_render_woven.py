"""A mesh of cloth answers lights and the sky as a path tracer's woven fibres do, and makes no light."""

import numpy as np
import pytest
import trimesh

from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.mixing import WHITE, sent_back
from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.stage.woven import BODY, LAID, NAP
from taichi_cloth.render.tiles.mesh import Mesh

EVEN = (1.0, 1.0, 1.0)
COLOURS = 0.9, 0.5, 0.1
VIEW = look_at((0, 0, 50.0), (0, 0, 0), width=160, height=160, fov=3)
TRACED = {(0.342, 0.866): 1.16, (0.707, 0.866): 1.02, (0.995, 0.866): 0.95, (0.995, 0.469): 0.91}
"""Light over Lambert's law by the cosines to light and eye: of flat white pieces of plain, twill and satin, the mean
over lights from all sides (`docs/appearance.md`)."""
SKY = {1.0: (0.94, 1.04, 1.05), 0.6: (1.07, 1.22, 1.43), 0.4: (1.14, 1.33, 1.72)}
"""The same of half a sky, of each colour, by the cosine to the eye: of two plain weaves, a twill and a satin."""


def seen(woven: float, lighting: Lighting, normal: np.ndarray) -> np.ndarray:
    """Of a ball, where it has that normal."""
    sphere = trimesh.creation.icosphere(5, radius=1.0)
    colour = tuple(float(sent_back(c)) for c in COLOURS)
    mesh = Mesh(sphere.vertices, sphere.faces, colour, np.asarray(sphere.vertices), woven=woven)
    backdrop = paint(VIEW, mesh=mesh, lighting=lighting)
    assert backdrop is not None
    x, y, _ = VIEW.project([normal])[0]
    return fetched(backdrop.colour)[int(y), int(x)].astype(np.float64)


@pytest.mark.parametrize(("light", "eye"), TRACED)
def test_lights_come_back_as_from_path_traced_fibres(light: float, eye: float) -> None:
    normal = np.array([np.sqrt(1 - eye * eye), 0.0, eye])
    x, y, z = (light * normal + np.array([0.0, np.sqrt(1 - light * light), 0.0])).tolist()
    lighting = Lighting(direction=(x, y, z), key=1.0, fill=0.0, key_colour=EVEN, key_follows_camera=False)
    ratio = seen(1.0, lighting, normal) / seen(0.0, lighting, normal)
    assert ratio == pytest.approx([TRACED[light, eye]] * 3, rel=0.1)


@pytest.mark.parametrize("eye", SKY)
def test_the_sky_comes_back_the_more_the_darker_and_the_flatter_seen_a_cloth_is(eye: float) -> None:
    lighting, normal = Lighting(key=0.0, fill=1.0, sky=EVEN, ground=EVEN), np.array([np.sqrt(1 - eye * eye), 0.0, eye])
    assert seen(1.0, lighting, normal) / seen(0.0, lighting, normal) == pytest.approx(SKY[eye], rel=0.08)


def test_a_white_sheet_makes_no_light_of_a_flat_one() -> None:
    """What it sends back in all directions, of light from any."""
    light, eye = np.meshgrid((np.arange(100) + 0.5) / 100, (np.arange(400) + 0.5) / 400, indexing="ij")
    over = np.minimum(BODY + LAID * (light * eye) ** 2 + NAP / (light + 0.2 * eye + 0.1), 1 / WHITE)
    sent = WHITE * (2 * eye * over).mean(axis=1)
    assert sent.max() < 1.0 + 1e-9
    assert (2 * (light[:, :1] * sent[:, None])).mean() == pytest.approx(WHITE, rel=0.03)
