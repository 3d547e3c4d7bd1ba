"""Skin: light goes on under it, red the farthest, and it shines a little; nothing else of a mesh does."""

import numpy as np
import pytest
import trimesh

from taichi_cloth.ground.copies import fetched
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.stage.skin import BLEED, REFLECTED
from taichi_cloth.render.tiles.mesh import Mesh, join

EVEN = (1.0, 1.0, 1.0)
ALBEDO = 0.5
VIEW = look_at((0, 0, 5.0), (0, 0, 0), width=128, height=128, fov=30)


def ball(skin: float) -> Mesh:
    sphere = trimesh.creation.icosphere(5, radius=1.0)
    return Mesh(sphere.vertices, sphere.faces, (ALBEDO,) * 3, np.asarray(sphere.vertices), skin=skin)


def lights(towards: tuple[float, float, float], key: float, fill: float = 0.0) -> Lighting:
    return Lighting(
        direction=towards, key=key, fill=fill, key_colour=EVEN, sky=EVEN, ground=EVEN, key_follows_camera=False
    )


def seen(mesh: Mesh, lighting: Lighting, place: tuple[float, float, float], camera: Camera = VIEW) -> np.ndarray:
    backdrop = paint(camera, mesh=mesh, lighting=lighting)
    assert backdrop is not None
    x, y, _ = camera.project([place])[0]
    return fetched(backdrop.colour)[int(y), int(x)].astype(np.float64)


def test_beyond_the_terminator_skin_is_red_as_a_blurred_edge_is() -> None:
    """Lit from the side the middle of a ball is the terminator: there max(n.l, 0), blurred, is half of its width."""
    light = lights((1, 0, 0), 1.0)
    assert seen(ball(0.0), light, (-0.02, 0, 1)) == pytest.approx((0, 0, 0), abs=1e-6)
    at = seen(ball(1.0), light, (0.0, 0, 1))
    assert at == pytest.approx(ALBEDO * np.array(BLEED) / 2, abs=0.012)
    assert at[0] > at[1] > at[2] > 0


def test_it_shines_where_a_mirror_would_and_makes_no_light() -> None:
    light = lights((0, 0, 1), 1.0)
    matt, skin = (seen(ball(one), light, (0, 0, 1)) for one in (0.0, 1.0))
    assert matt == pytest.approx([ALBEDO] * 3, rel=0.01)
    assert skin - matt == pytest.approx([REFLECTED * 22 / 8] * 3, abs=0.01)
    for place in ((0, 0, 1), (0.7, 0, 0.7), (0.95, 0, 0.3)):  # in an even light all round, no more than comes
        assert seen(ball(1.0), lights((0, 0, 1), 0.0, 1.0), place).max() <= 1.0
        assert seen(ball(1.0), lights((0, 0, 1), 0.0, 1.0), place).min() >= ALBEDO


def test_of_joined_meshes_each_keeps_its_own() -> None:
    both = join([ball(0.0), ball(1.0)])
    assert np.asarray(both.skin).tolist() == [0.0] * 10242 + [1.0] * 10242
