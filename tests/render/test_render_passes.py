"""The data passes against closed forms: depth, coverage, normals and numbers, pixel by pixel."""

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.pass_raster import raster_passes
from taichi_cloth.render.splat.passes import PASSES, Passes, render_passes
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.paint import paint, unproject
from taichi_cloth.render.tiles.mesh import Mesh

FOCAL = 100.0


def camera(width: int = 64, height: int = 48) -> Camera:
    """At the origin, looking along z: at depth 1 m one pixel is 1 cm."""
    return Camera(np.eye(3), np.zeros(3), FOCAL, width / 2, height / 2, width, height, near=0.01)


def drawn(particles: Particles, view: Camera, which: tuple[str, ...] = PASSES, **options) -> Passes:
    splatter = Splatter(view.width, view.height).load(particles)
    splatter.render(view)
    return render_passes(splatter, view, particles, which, **options)


def balls(place, radius, **options) -> Particles:
    defaults = {"colour": (0.5, 0.5, 0.5), "tangent": (1, 0, 0), "normal": (0, 0, -1), "opacity": 1.0}
    return Particles(place, radius, **{**defaults, **options})


def test_depth_is_the_front_of_the_spheres() -> None:
    random = np.random.default_rng(2)
    place = np.stack([random.uniform(-0.4, 0.4, 40), random.uniform(-0.3, 0.3, 40), random.uniform(2, 3, 40)], 1)
    radius = random.uniform(0.05, 0.12, 40)
    view = look_at((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), width=320, height=240, fov=20)
    depth = drawn(balls(place, radius), view, ("depth",)).depth
    x, y = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
    ray = np.stack([(x - view.cx) / view.focal, (y - view.cy) / view.focal, np.ones_like(x)], -1)
    expected, nearest = np.full((240, 320), np.inf), np.argsort(place[:, 2])
    for at, r in zip(place[nearest] @ view.rotation.T, radius[nearest], strict=True):
        middle, square = ray @ at, (ray**2).sum(-1)
        inside = middle**2 - square * (at @ at - r**2)
        front = (middle - np.sqrt(np.maximum(inside, 0))) / square
        expected = np.where((inside > 0) & ~np.isfinite(expected), front, expected)  # nearest middle first
    assert depth is not None
    hit = np.isfinite(expected)
    assert ((depth > 0) == hit).mean() > 0.985
    error = np.abs(depth - expected)[(depth > 0) & hit]
    assert np.median(error) < 0.06 * radius.mean()  # drawn as if seen from afar
    assert np.quantile(error, 0.95) < 0.3 * radius.mean()


def test_chain_of_threads_has_the_depth_of_a_cylinder() -> None:
    along = np.linspace(-0.3, 0.3, 61)
    place = np.stack([along, 0 * along, 1 + 0 * along], 1)
    depth = drawn(balls(place, 0.1, half_length=0.015), camera(), ("depth",)).depth
    assert depth is not None
    y = (np.arange(48) + 0.5 - 24) / FOCAL
    inside = np.abs(y) < 0.085
    np.testing.assert_allclose(depth[inside, 32], 1 - np.sqrt(0.01 - y[inside] ** 2), atol=0.006)


def test_mask_is_the_area_and_follows_the_colour_image() -> None:
    view = camera()
    for radius, opacity in ((0.06, 1.0), (0.15, 0.4)):
        disc = balls([[0.013, -0.021, 1.0]], radius, opacity=opacity)
        splatter = Splatter(64, 48).load(disc)
        splatter.render(view)
        mask = render_passes(splatter, view, disc, ("mask",)).mask
        assert mask is not None
        assert mask.sum() == pytest.approx(opacity * np.pi * (radius * FOCAL) ** 2, rel=0.02)
        np.testing.assert_allclose(mask, splatter.linear()[..., 3], atol=1e-6)


@pytest.mark.parametrize("thread", [False, True])
def test_mask_of_many_is_the_alpha_of_the_colour_image(thread: bool) -> None:
    random = np.random.default_rng(4)
    place = np.stack([random.uniform(-0.5, 0.5, 900), random.uniform(-0.4, 0.4, 900), random.uniform(1, 2, 900)], 1)
    tangent = random.normal(size=(900, 3))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    cloud = balls(place, 0.02, half_length=0.05 if thread else None, tangent=tangent, opacity=0.5)
    splatter = Splatter(64, 48, opaque=0.0).load(cloud)
    splatter.render(camera())
    mask = render_passes(splatter, camera(), cloud, ("mask",)).mask
    assert mask is not None
    np.testing.assert_allclose(mask, splatter.linear()[..., 3], atol=2e-6)


def test_numbers_are_exact_and_never_blended() -> None:
    x, y = np.meshgrid([-0.2, 0.0, 0.2], [-0.1, 0.1])
    place = np.stack([x.ravel(), y.ravel(), np.ones(6)], 1)
    made = drawn(balls(place, 0.05, yarn=[5, 900, 0, 17, 65000, 3], part=[0, 1, 2, 0, 1, 2]), camera(), ("id",))
    assert made.depth is None
    assert made.normal is None
    assert made.yarn is not None
    assert made.part is not None
    assert set(np.unique(made.yarn)) == {-1, 0, 3, 5, 17, 900, 65000}
    assert [made.yarn[int(24 + 100 * q), int(32 + 100 * p)] for p, q, _ in place] == [5, 900, 0, 17, 65000, 3]
    assert [made.part[int(24 + 100 * q), int(32 + 100 * p)] for p, q, _ in place] == [0, 1, 2, 0, 1, 2]
    assert (made.yarn == -1).sum() == pytest.approx(64 * 48 - 6 * np.pi * 25, abs=12)


def test_faint_things_in_front_do_not_count() -> None:
    place = [[0, 0, 1.0], [0, 0, 1.5]]
    made = drawn(
        balls(place, 0.2, opacity=[0.3, 1.0], openness=[1, 1], yarn=[1, 2], normal=[[1, 0, 0], [0, 0, -1]]), camera()
    )
    assert made.yarn is not None
    assert made.depth is not None
    assert made.normal is not None
    assert made.yarn[24, 32] == 2
    assert made.depth[24, 32] == pytest.approx(1.3, abs=1e-3)
    np.testing.assert_allclose(made.normal[24, 32], np.array([0.3, 0, -0.7]) / np.hypot(0.3, 0.7), atol=1e-4)
    assert (made.normal[0, 0] == 0).all()


def test_mesh_is_in_every_pass() -> None:
    corners = [[-0.2, -0.2, 1], [0.2, -0.2, 1], [0.2, 0.2, 1], [-0.2, 0.2, 1]]
    plate = Mesh(corners, [[0, 1, 2], [0, 2, 3]], (1, 1, 1), part=7)
    view = camera()
    cloud = balls([[-0.1, 0, 0.9], [0.1, 0, 1.1]], 0.05, part=[1, 2])
    backdrop = paint(view, mesh=plate)
    splatter = Splatter(64, 48).load(cloud)
    splatter.render(view, backdrop=backdrop)
    made = render_passes(splatter, view, cloud, backdrop=backdrop, mesh=plate)
    assert made.depth is not None
    assert made.part is not None
    assert made.mask is not None
    assert made.normal is not None
    assert (made.part[24, 20], made.part[24, 41], made.part[24, 3]) == (1, 7, -1)
    assert made.depth[24, 41] == pytest.approx(1.0, abs=1e-5)
    assert made.depth[24, 20] == pytest.approx(0.85, abs=2e-3)
    assert made.mask[10, 32] == 1
    np.testing.assert_allclose(made.normal[10, 32], [0, 0, -1], atol=1e-5)


def test_matrices_bring_depths_back_to_the_world() -> None:
    view = look_at((0.4, 0.3, 1.0), (0.0, 0.0, 0.0), width=320, height=240, fov=25)
    place = np.random.default_rng(5).uniform(-0.15, 0.15, (60, 3))
    depth = drawn(balls(place, 0.02), view, ("depth",)).depth
    assert depth is not None
    row, column = np.nonzero(depth)
    points = unproject(view, row, column, depth[row, column])
    away = np.linalg.norm(points[:, None] - place[None], axis=-1)
    assert np.quantile(np.abs(away - 0.02).min(axis=1), 0.95) < 0.002  # they lie on the balls
    m = view.matrices()
    back = (points @ np.array(m["R"]).T + m["t"]) @ np.array(m["K"]).T
    np.testing.assert_allclose(back[:, :2] / back[:, 2:], np.stack([column, row], 1) + 0.5, atol=1e-3)


def test_what_is_not_asked_for_is_not_held(monkeypatch: pytest.MonkeyPatch) -> None:
    held = {}
    kernel = raster_passes

    def spy(*arguments) -> None:
        held.update(planes=len(arguments[-2]), hit=arguments[-1].size)
        kernel(*arguments)

    monkeypatch.setattr("taichi_cloth.render.splat.passes.raster_passes", spy)
    cloud = balls([[0, 0, 1.0]], 0.1)
    drawn(cloud, camera(), ("mask",))
    assert held == {"planes": 1, "hit": 1}
    drawn(cloud, camera(), ("normal",))
    assert held == {"planes": 5, "hit": 1}
    splatter = Splatter(64, 48).load(cloud)
    held.clear()
    splatter.render(camera())  # the colour image alone never asks
    assert not held


def test_what_cannot_be_is_refused() -> None:
    cloud = balls([[0, 0, 1.0]], 0.1)
    splatter = Splatter(64, 48).load(cloud)
    with pytest.raises(InputError, match="nothing rendered yet"):
        render_passes(splatter, camera(), cloud)
    splatter.render(camera())
    with pytest.raises(InputError, match=r"unknown pass 'dept'.*did you mean \"depth\""):
        render_passes(splatter, camera(), cloud, ("dept",))
    with pytest.raises(InputError, match="2 particles; allowed: the 1"):
        render_passes(splatter, camera(), balls([[0, 0, 1], [0, 0, 2]], 0.1))
