"""The same spheres, camera and light in Mitsuba 3 (extra "reference"): what is covered, how deep, where the shadow is.

Mitsuba's own perspective sensor shoots one ray through the middle of each pixel; its scalar variant needs no LLVM.
"""

from typing import Any

import numpy as np
import pytest

from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.passes import render_passes
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.stage import stage_under

mi: Any = pytest.importorskip("mitsuba")

EYE, TARGET, FOV = (0.5, 0.45, 1.3), (0.0, 0.0, 0.0), 26.0
WIDTH, HEIGHT = 320, 240
TOWARDS = np.array([0.5, 0.75, 0.3]) / np.linalg.norm([0.5, 0.75, 0.3])
FLOOR = -0.3


@pytest.fixture(scope="module")
def spheres() -> tuple[np.ndarray, np.ndarray]:
    """2,000 spheres on a folded sheet and round it: places (n, 3) and radii (n,) [m]."""
    random = np.random.default_rng(8)
    x, z = random.uniform(-0.25, 0.25, (2, 2000))
    y = 0.06 * np.sin(18 * x) + 0.04 * np.cos(23 * z) + random.normal(0, 0.006, 2000)
    return np.stack([x, y, z], 1), random.uniform(0.008, 0.016, 2000)


@pytest.fixture(scope="module")
def reference(spheres: tuple[np.ndarray, np.ndarray]) -> Any:
    mi.set_variant("scalar_rgb")
    shapes = {
        f"s{k}": {"type": "sphere", "center": at.tolist(), "radius": float(r)}
        for k, (at, r) in enumerate(zip(*spheres, strict=True))
    }
    view = mi.ScalarTransform4f().look_at(origin=list(EYE), target=list(TARGET), up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    sensor = {"type": "perspective", "fov_axis": "y", "fov": FOV, "to_world": view, "film": film, "near_clip": 0.01}
    return mi.load_dict({"type": "scene", "sensor": sensor, **shapes})


def particles(spheres: tuple[np.ndarray, np.ndarray]) -> Particles:
    return Particles(*spheres, (0.6, 0.6, 0.6), (1, 0, 0), (0, 1, 0), opacity=1.0)


def test_coverage_and_depth_agree(spheres: tuple[np.ndarray, np.ndarray], reference: Any) -> None:
    view = look_at(EYE, TARGET, width=WIDTH, height=HEIGHT, fov=FOV)
    expected = np.zeros((HEIGHT, WIDTH))
    sensor = reference.sensors()[0]
    for y in range(HEIGHT):
        for x in range(WIDTH):
            ray, _ = sensor.sample_ray(0.0, 0.5, [(x + 0.5) / WIDTH, (y + 0.5) / HEIGHT], [0.5, 0.5])
            hit = reference.ray_intersect(ray)
            if hit.is_valid():
                expected[y, x] = np.array(hit.p) @ view.forward + view.translation[2]
    cloud = particles(spheres)
    splatter = Splatter(WIDTH, HEIGHT).load(cloud)
    splatter.render(view)
    made = render_passes(splatter, view, cloud, ("depth", "mask"))
    assert made.mask is not None
    assert made.depth is not None
    ours, theirs = made.mask > 0.5, expected > 0
    iou = (ours & theirs).sum() / (ours | theirs).sum()
    both = (made.depth > 0) & theirs
    error = np.median(np.abs(made.depth - expected)[both]) / spheres[1].mean()
    print(f"coverage IoU {iou:.4f}, median depth error {error:.3f} radii")
    assert iou >= 0.98
    assert error < 0.5


def test_shadow_lies_where_it_should(spheres: tuple[np.ndarray, np.ndarray], reference: Any) -> None:
    at = np.linspace(-0.75, 0.55, 120)
    x, z = np.meshgrid(at, at)
    points = np.stack([x.ravel(), np.full(x.size, FLOOR), z.ravel()], 1)
    towards = TOWARDS.tolist()
    dark = np.array([reference.ray_test(mi.Ray3f(p.tolist(), towards)) for p in points]).reshape(x.shape)

    cloud = particles(spheres)
    view = look_at(EYE, TARGET, width=WIDTH, height=HEIGHT, fov=FOV)
    light = Lighting(direction=tuple(TOWARDS.tolist()), key_follows_camera=False, shadows=True, size=0.5)
    splatter = Splatter(WIDTH, HEIGHT).load(cloud)
    splatter.render(view, lighting=light)
    map_ = splatter.light.key_map()
    assert map_ is not None
    ours = (map_.shadow_at(points) < 0.5).reshape(x.shape)
    iou = (ours & dark).sum() / (ours | dark).sum()
    stage = stage_under(cloud)
    assert stage is not None
    shadow = 1 - stage.key_passing(TOWARDS)
    cells = stage.half * ((np.arange(len(shadow)) + 0.5) / len(shadow) * 2 - 1)

    def centre(weight: np.ndarray, across: np.ndarray, along: np.ndarray) -> np.ndarray:
        return np.array([(weight.sum(0) * across).sum(), (weight.sum(1) * along).sum()]) / weight.sum()

    expected = centre(dark, at, at)
    fall = (stage.ground - FLOOR) * TOWARDS[[0, 2]] / TOWARDS[1]  # the stage's floor lies higher
    on_stage = centre(shadow, cells + stage.centre[0], cells + stage.centre[1]) - fall
    print(f"shadow IoU {iou:.4f}, off by {1e3 * np.abs(centre(ours, at, at) - expected).max():.1f} mm of 500 mm,")
    print(f"the stage's by {1e3 * np.abs(on_stage - expected).max():.1f} mm")
    assert iou > 0.9
    np.testing.assert_allclose(centre(ours, at, at), expected, atol=0.005)
    np.testing.assert_allclose(on_stage, expected, atol=0.015)
