"""The splatter against closed forms, at its edges, and with input that no camera can see."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.light import Background, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.data.sprites import CRISP, SOFT, Profile
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.tiles import lists as lists_module

FOCAL = 100.0


def camera(width: int = 64, height: int = 48) -> Camera:
    """At the origin, looking along z: at depth 1 m one pixel is 1 cm."""
    return Camera(np.eye(3), np.zeros(3), FOCAL, width / 2, height / 2, width, height)


def at_pixels(x: ArrayLike, y: ArrayLike, radius: ArrayLike, *, depth: ArrayLike = 1.0, **options: Any) -> Particles:
    """Particles by their place and radius on the image of `camera()` [px]."""
    x, y, radius, depth = np.broadcast_arrays(x, y, radius, depth)
    place = np.stack([(x - 32.0) * depth / FOCAL, (y - 24.0) * depth / FOCAL, depth], -1).reshape(-1, 3)
    defaults: dict[str, Any] = {
        "colour": (0.5, 0.4, 0.3),
        "tangent": (1.0, 0.0, 0.0),
        "normal": (0.0, 0.0, -1.0),
        "opacity": 1.0,
    }
    return Particles(position=place, radius=(radius * depth / FOCAL).ravel(), **{**defaults, **options})


def coverage(particles: Particles, profile: Profile = SOFT) -> np.ndarray:
    """Alpha (48, 64) of the particles."""
    splatter = Splatter(64, 48, profile=profile).load(particles)
    splatter.render(camera())
    return splatter.linear()[..., 3]


def test_soft_disc_has_its_area_and_centroid() -> None:
    for radius in (1.5, 4.0, 9.0):
        alpha = coverage(at_pixels(31.3, 22.8, radius, opacity=0.85))
        assert alpha.sum() == pytest.approx(0.85 * np.pi * radius**2 / 3, rel=0.03)
        y, x = np.mgrid[:48, :64] + 0.5
        assert (alpha * x).sum() / alpha.sum() == pytest.approx(31.3, abs=0.05)
        assert (alpha * y).sum() / alpha.sum() == pytest.approx(22.8, abs=0.05)


def test_crisp_disc_covers_the_disc_with_a_rim_of_a_pixel() -> None:
    for radius in (1.5, 4.0, 15.0):
        alpha = coverage(at_pixels(31.3, 22.8, radius), CRISP)
        assert alpha.sum() == pytest.approx(np.pi * radius**2, rel=0.02)
    y, x = np.mgrid[:48, :64] + 0.5
    distance = np.hypot(x - 31.3, y - 22.8)
    assert (alpha[distance < 14] == 1).all()
    assert (alpha[distance > 16] == 0).all()


def test_layers_follow_the_law_of_absorption() -> None:
    for count in (1, 2, 5, 20):
        layers = at_pixels(32.5, 24.5, 20.0, depth=1 + 0.01 * np.arange(count), opacity=0.1)
        expected = 1 - np.prod(1 - 0.1 * (20**2 / (20**2 + 0.91)) * np.ones(count))
        assert coverage(layers)[24, 32] == pytest.approx(expected, abs=1e-5)


def test_nearest_is_in_front_whatever_the_order() -> None:
    random = np.random.default_rng(5)
    n = 3000
    scene = at_pixels(
        random.uniform(0, 64, n),
        random.uniform(0, 48, n),
        random.uniform(0.3, 4, n),
        depth=1 + np.arange(n) * 1e-3,
        colour=random.random((n, 3)),
        opacity=random.random(n),
        openness=random.random(n),
    )
    order = random.permutation(n)
    mixed = Particles(
        scene.position[order],
        scene.radius[order],
        scene.colour[order],
        scene.tangent[order],
        scene.normal[order],
        opacity=np.asarray(scene.opacity)[order],
        openness=np.asarray(scene.openness)[order],
    )
    images = [Splatter(64, 48).load(p).render(camera()) for p in (scene, mixed)]
    assert (images[0] == images[1]).all()


def test_same_bytes_for_any_number_of_chunks() -> None:
    random = np.random.default_rng(6)
    n = 2001
    scene = at_pixels(
        random.uniform(-5, 70, n), random.uniform(-5, 53, n), 3.0, depth=np.round(random.uniform(1, 2, n), 2)
    )
    images = []
    for chunks in (1, 2, 3, 7):
        splatter = Splatter(64, 48, chunks=chunks).load(scene)
        images.append(splatter.render(camera()).tobytes() + splatter.linear().tobytes())
    assert len(set(images)) == 1


def test_splats_at_the_edges_keep_the_part_inside() -> None:
    whole = coverage(at_pixels(32.0, 24.0, 6.0)).sum()
    for x, y, share in ((0, 24, 0.5), (64, 24, 0.5), (32, 0, 0.5), (32, 48, 0.5), (0, 0, 0.25), (64, 48, 0.25)):
        assert coverage(at_pixels(x, y, 6.0)).sum() == pytest.approx(share * whole, rel=1e-4)
    for x, y in ((-7.2, 24), (71.2, 24), (32, -7.2), (32, 55.2)):
        assert coverage(at_pixels(x, y, 6.0)).sum() == 0
    assert coverage(at_pixels(64.4, 24.5, 1.0))[24, 63] > 0  # its middle is outside, its rim reaches in


def test_what_cannot_be_seen_changes_nothing() -> None:
    seen = at_pixels([20.0, 40.0], 24.0, 5.0)
    expected = coverage(seen)
    bad = np.nan, np.inf, -np.inf
    n = 12
    position = np.tile([0.0, 0.0, 0.9], (n, 1))
    radius = np.full(n, 0.05)
    position[0:3, 0] = bad
    position[3] = (0, 0, -1)  # behind
    position[4] = (0, 0, 0)  # in the camera
    position[5] = (0, 0, 5e-4)  # astride it: nearer than `near`
    radius[6:11] = (*bad, 0.0, -1.0)
    position[11] = 1e30
    everything = Particles(
        np.concatenate([seen.position, position]),
        np.concatenate([seen.radius, radius]),
        np.full(3, 0.5),
        (1, 0, 0),
        (0, 0, -1),
        opacity=1.0,
    )
    assert (coverage(everything) == expected).all()


def test_other_values_that_are_not_finite_hide_only_their_particle() -> None:
    colour = np.full((3, 3), 0.5)
    colour[1, 2] = np.nan
    tangent = np.tile([1.0, 0, 0], (3, 1))
    tangent[2, 0] = np.inf
    alpha = coverage(at_pixels([12.0, 32.0, 52.0], 24.0, 5.0, colour=colour, tangent=tangent))
    assert (alpha == coverage(at_pixels(12.0, 24.0, 5.0))).all()


@pytest.mark.parametrize("radius", [1e3, 1e9, 1e20, 1e38])
def test_huge_radii_fill_the_image(radius: float) -> None:
    for options in ({}, {"half_length": radius}):
        particle = Particles([(0.001, 0, 1)], radius, (0.5, 0.5, 0.5), (1, 0, 0), (0, 0, -1), opacity=0.5, **options)
        assert coverage(particle) == pytest.approx(np.full((48, 64), 0.5), abs=1e-3)


@pytest.mark.parametrize("profile", [SOFT, CRISP])
@pytest.mark.parametrize("thread", [False, True])
def test_far_particles_fade_instead_of_flickering(profile: Profile, thread: bool) -> None:
    """Energy times distance squared stays within 2 % while a radius shrinks from 1 to 1/16 pixel."""
    energies = []
    x, y = np.meshgrid(np.linspace(6, 58, 9) + 0.11 * np.arange(9), np.linspace(6, 42, 7) + 0.14 * np.arange(7))
    for radius in (1.0, 0.7, 0.5, 0.25, 0.125, 0.0625):
        options = {"half_length": np.full(x.size, 2 * radius / FOCAL)} if thread else {}
        tangent = np.tile([0.8, 0.6, 0.0], (x.size, 1))
        energies.append(coverage(at_pixels(x, y, radius, tangent=tangent, **options), profile).sum() / radius**2)
    assert np.array(energies) == pytest.approx(np.full(len(energies), np.mean(energies)), rel=0.02)


def test_one_pixel_and_very_wide_images() -> None:
    one = Splatter(1, 1).load(at_pixels(32.0, 24.0, 5.0))
    assert one.render(camera(1, 1)).shape == (1, 1, 3)
    wide = Camera(np.eye(3), np.zeros(3), FOCAL, 0.0, 0.0, 16384, 20)
    particles = Particles([(163.805, 0.105, 1.0)], 0.02, (0.5, 0.5, 0.5), (1, 0, 0), (0, 0, -1), opacity=1.0)
    splatter = Splatter(16384, 20).load(particles)
    splatter.render(wide)
    alpha = splatter.linear()[..., 3]
    assert alpha[10, 16380] > 0.9
    assert alpha[:, :16370].sum() == 0


def test_background_gradient_and_premultiplied_alpha() -> None:
    splatter = Splatter(70, 50).load(at_pixels(35.0, 24.0, 9.0, opacity=0.5))
    top, bottom = (0.9, 0.5, 0.1), (0.1, 0.5, 0.9)
    near = Camera(np.eye(3), np.zeros(3), FOCAL, 32.0, 24.0, 70, 50)
    image = splatter.render(near, background=Background(top=top, bottom=bottom))
    rgba = splatter.linear().astype(np.float64)
    down = ((np.arange(50) + 0.5) / 50)[:, None, None]
    behind = np.array(top) + (np.array(bottom) - np.array(top)) * down
    light = np.clip(rgba[..., :3] + (1 - rgba[..., 3:]) * behind, 0, 1)
    expected = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055) * 255
    assert np.abs(image - expected).max() < 1.0  # rounding, and the table's 4096 steps


def test_nothing_loaded_is_background_and_out_is_filled_in_place() -> None:
    splatter = Splatter(64, 48)
    plain = splatter.render(camera(), background=Background(top=(1.0, 0.0, 0.0)))
    assert (plain == (255, 0, 0)).all()
    assert splatter.linear().sum() == 0
    out = np.zeros((48, 64, 3), np.uint8)
    assert splatter.load(at_pixels(32.0, 24.0, 5.0)).render(camera(), out=out) is out
    assert (out == splatter.render(camera())).all()
    assert splatter.stats is not None
    assert splatter.stats.drawn == splatter.stats.particles == 1


def test_lists_grow_and_overflow_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    splatter = Splatter(64, 48).load(at_pixels(32.0, 24.0, np.full(50, 30.0)))
    splatter.render(camera())
    assert splatter.stats is not None
    assert splatter.stats.tile_entries == 50 * 12
    monkeypatch.setattr(lists_module, "MAX_TILE_ENTRIES", 599)
    with pytest.raises(InputError, match=r"600 entries; allowed: 599"):
        splatter.render(camera())


def test_bad_options_are_refused() -> None:
    with pytest.raises(InputError, match="height"):
        Splatter(64, 16385)
    with pytest.raises(InputError, match="chunks"):
        Splatter(64, 48, chunks=0)
    with pytest.raises(InputError, match="opaque"):
        Splatter(64, 48, opaque=1.0)
    with pytest.raises(InputError, match="edge"):
        Profile(edge=0.5)
    splatter = Splatter(64, 48)
    with pytest.raises(InputError, match="call render first"):
        splatter.linear()
    with pytest.raises(InputError, match="splatter's size"):
        splatter.render(camera(32, 32))
    with pytest.raises(InputError, match="out"):
        splatter.render(camera(), out=np.zeros((4, 4, 3), np.uint8))


def test_light_that_follows_the_camera_looks_the_same_from_behind() -> None:
    ball = Particles([(0, 0, 0)], 0.1, (0.5, 0.5, 0.5), (0, 1, 0), (0, 1, 0))
    lighting = Lighting(direction=(0.3, 0.9, 0.3))
    cameras = [look_at((0, 0, z), (0, 0, 0), width=64, height=48) for z in (1, -1)]
    splatter = Splatter(64, 48).load(ball)
    front, back = (splatter.render(c, lighting=lighting) for c in cameras)
    assert (front == back).all()
    fixed = Lighting(direction=(0.3, 0.1, 0.9), key_follows_camera=False)
    assert fixed.towards_key(cameras[0]) == pytest.approx(fixed.towards_key(cameras[1]))
