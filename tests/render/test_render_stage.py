"""The floor: its shadows against closed forms, and that nobody sees where it ends."""

import numpy as np
import pytest

from taichi_cloth.ground.copies import fetched
from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.light import Background, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.stage.stage import CELLS, Stage, stage_under
from taichi_cloth.render.tiles.mesh import Mesh

OVERHEAD = Lighting(direction=(0.0, 1.0, 0.0), key_follows_camera=False)


def plate(height: float, radius: float = 0.1) -> Stage:
    """A round opaque plate over a floor at 0."""
    half = 0.5
    at = (np.arange(CELLS) + 0.5) / CELLS * 2 * half - half
    cover = (np.hypot(at[:, None], at) < radius).astype(np.float32)
    return Stage(0.0, (0.0, 0.0), half, np.array([height]), cover[None])


@pytest.mark.parametrize("height", [0.02, 0.1, 0.3])
def test_sky_blocked_by_a_disc_is_its_form_factor(height: float) -> None:
    blocked = plate(height).sky_blocked
    assert blocked[CELLS // 2, CELLS // 2] == pytest.approx(0.1**2 / (0.1**2 + height**2), rel=0.02)


def test_key_shadow_lies_away_from_the_light() -> None:
    towards = np.array([0.6, 0.8, 0.0])
    dark = 1 - plate(0.2).key_passing(towards)
    column = (dark.sum(axis=0) * np.arange(CELLS)).sum() / dark.sum()
    row = (dark.sum(axis=1) * np.arange(CELLS)).sum() / dark.sum()
    assert (column + 0.5) / CELLS - 0.5 == pytest.approx(-0.2 * 0.6 / 0.8, abs=2e-3)
    assert (row + 0.5) / CELLS - 0.5 == pytest.approx(0, abs=2e-3)
    assert dark.sum() == pytest.approx(np.pi * 0.1**2 * CELLS**2, rel=0.01)  # as much light as is missing


def test_floor_takes_the_shadow_from_the_key_map() -> None:
    """A square plate over the floor, light at 45 degrees: its outline, moved by its height."""
    x = np.arange(-0.1, 0.1001, 0.004)
    place = np.stack(np.meshgrid(x, [0.2], x, indexing="ij"), -1).reshape(-1, 3)
    cloth = Particles(place, 0.004, (1, 1, 1), (1, 0, 0), (0, 1, 0), opacity=1.0)
    light = Lighting(direction=(1.0, 1.0, 0.0), key_follows_camera=False, shadows=True, size=0.0)
    view = look_at((0, 1.2, 0.8), (0, 0, 0), width=64, height=48, fov=50)
    key = Splatter(64, 48).load(cloth).cast_light(view, light).lights[0]
    assert key is not None
    dark = 1 - Stage(0.0, (0.0, 0.0), 0.5, np.array([0.2]), np.zeros((1, CELLS, CELLS), np.float32)).key_mapped(key)
    column = (dark.sum(axis=0) * np.arange(CELLS)).sum() / dark.sum()
    assert (column + 0.5) / CELLS - 0.5 == pytest.approx(-0.2, abs=2e-3)
    # With the rim of the discs, 0.004 wide, which face the light and are longer on the floor by sqrt(2).
    assert dark.sum() / CELLS**2 == pytest.approx(0.208 * (0.2 + 0.008 * 2**0.5), rel=0.03)
    assert dark.max() > 0.97


def test_floor_is_darkest_below_and_fades_into_the_background() -> None:
    place = np.random.default_rng(0).uniform(-0.1, 0.1, (20_000, 3)) * (1, 0.02, 1) + (0.3, 0.5, -0.2)
    stage = stage_under(Particles(place, 0.002, (1, 1, 1), (1, 0, 0), (0, 1, 0)))
    assert stage is not None
    assert stage.ground == pytest.approx(0.498 - 0.002, abs=1e-3)
    view = look_at((0.3, 1.2, 0.8), (0.3, 0.5, -0.2), width=320, height=240, fov=50)
    light = stage.darkening(view, OVERHEAD)
    border = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
    assert border.min() > 0.999
    assert light[CELLS // 2, CELLS // 2].max() < 0.3
    assert light.max() <= 1
    assert np.abs(np.diff(light, axis=0))[: CELLS // 5].max() < 0.005
    backdrop = paint(view, stage=stage, lighting=OVERHEAD, background=Background(top=(0.8, 0.7, 0.6)))
    assert backdrop is not None
    np.testing.assert_allclose(fetched(backdrop.colour)[0, 0], (0.8, 0.7, 0.6), rtol=1e-4)
    pixel = view.project([(0.3, stage.ground, -0.2)])[0]
    assert fetched(backdrop.colour)[int(pixel[1]), int(pixel[0])].max() < 0.3


def test_floor_is_not_seen_from_below_or_above_the_horizon() -> None:
    view = look_at((0.0, -0.3, 0.8), (0.0, 0.0, 0.0), width=64, height=48)
    backdrop = paint(view, stage=plate(0.05), background=Background(top=(0.5, 0.5, 0.5)))
    assert backdrop is not None
    assert (fetched(backdrop.colour) == 0.5).all()


def test_floor_lies_under_a_mesh_too_and_under_nothing_there_is_none() -> None:
    nothing = Particles(np.zeros((0, 3)), 0.1, (1, 1, 1), (1, 0, 0), (0, 1, 0))
    assert stage_under(nothing) is None
    box = Mesh([[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]], [[0, 1, 2], [0, 2, 3]], (1, 1, 1))
    stage = stage_under(nothing, box)
    assert stage is not None
    assert stage.ground == 2
    assert stage.cover.max() > 0.9
    again = stage_under(nothing, box)
    assert again is not None
    assert (again.cover == stage.cover).all()
