"""The cloth of the built-in garments hides what is behind it, and their pictures hold all of it."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.garment.pattern.drafts import DRAFTS
from taichi_cloth.render.data.camera import frame
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.scenes.models.garment_model import box_round
from taichi_cloth.scenes.models.model import OPACITY
from taichi_cloth.scenes.paper.own_scenes import scene_file
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.scene.load import load_scene

SIZE = 320
SEEN_THROUGH = 0.012
"""Share of what is behind that may be seen: 0.5 to 0.8 % were measured, and 10 to 18 % while drawn fibres covered less
than their threads do."""


def follows_key_points(name: str) -> bool:
    yarn = load_scene(scene_file(name)).yarn
    return yarn is not None and yarn.count is None


@pytest.mark.parametrize("name", [name for name in DRAFTS if follows_key_points(name)])
def test_the_cloth_of_a_garment_hides_what_is_behind(name: str) -> None:
    """Of threads as wide as their spacing: a cloth with a stated count and sett is as open as these make it."""
    scene = load_scene(scene_file(name))
    assert scene.weave is not None
    assert scene.fabric is not None
    flat = {"ends_per_cm": 4.0, "picks_per_cm": 4.0, "fringe": 0.0, "irregularity": 0.0}
    scene = scene.model_copy(
        update={
            "weave": scene.weave.model_copy(update={"ends": 24, "picks": 24}),
            "fabric": scene.fabric.model_copy(update=flat),
        }
    )
    layout = prepare_fabric(scene).layout
    points = pose_points(layout)
    cloud = build_fabric(layout).cloud(points)
    whole = frame(points.reshape(-1, 3), width=SIZE, height=SIZE, azimuth=20.0, elevation=89.0, fov=5.0)
    solid = (cloud.position, cloud.radius, cloud.colour, cloud.tangent, cloud.normal, cloud.half_length)
    splatter = Splatter(SIZE, SIZE).load(Particles(*solid, opacity=OPACITY))
    splatter.render(replace(whole, focal=2 * whole.focal))
    assert 1 - np.mean(splatter.linear()[..., 3]) < SEEN_THROUGH


@pytest.mark.parametrize("azimuth", [0.0, 20.0, 65.0, 110.0])
def test_a_picture_of_a_garment_holds_all_of_it(azimuth: float) -> None:
    """Also where its box is seen across a corner: the box is eight corners, not the two ends of a diagonal."""
    points = np.random.Generator(np.random.Philox(key=3)).uniform(-1, 1, (600, 3)) * [0.4, 0.7, 0.3]
    camera = frame(box_round(points), width=300, height=640, azimuth=azimuth, elevation=6.0, fov=24.0)
    x, y, _ = camera.project(points).T
    assert 0 <= x.min() < x.max() <= 300
    assert 0 <= y.min() < y.max() <= 640
