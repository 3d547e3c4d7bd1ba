"""The splatter against a slow one in NumPy, and the shape and shading of threads against closed forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from oracle_splat import splat as oracle

from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.finish import FINISHES, Finish
from taichi_cloth.render.data.light import Background, KeyLight, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.data.sprites import CRISP, SOFT, Profile, SpriteSheet, fibre_sprite, soft_sprite
from taichi_cloth.render.image.image import linear_to_srgb
from taichi_cloth.render.splat.splat import Splatter

SHARP = Profile(edge=3.0)
FRONT = look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), fov=30, width=72, height=56)
PIXELS_PER_METRE = FRONT.focal / 2


def directions(random: np.random.Generator, count: int) -> np.ndarray:
    vectors = random.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def scene(*, thread: bool, count: int = 250, largest: float = 0.06, **options: Any) -> Particles:
    random = np.random.default_rng(11)
    radius = random.uniform(0.004, largest, count)
    return Particles(
        random.normal(size=(count, 3)) * (0.25, 0.18, 0.2),
        radius,
        random.random((count, 3)),
        directions(random, count),
        directions(random, count),
        half_length=radius * random.uniform(0.6, 4, count) if thread else None,
        **{"openness": random.random(count), "opacity": random.random(count), **options},
    )


def decibels(particles: Particles, profile: Profile, sheet: SpriteSheet | None = None) -> float:
    """Signal to noise of the 8-bit image against the oracle's."""
    view = look_at((0.6, 0.5, 1.1), (0, 0, 0), fov=35, width=90, height=70)
    lighting, finish, top = Lighting(exposure=-0.4), FINISHES["viscose"], (0.6, 0.3, 0.1)
    splatter = Splatter(90, 70, profile=profile, sprites=sheet, opaque=0.0).load(particles)
    image = splatter.render(view, lighting=lighting, finish=finish, background=Background(top=top))
    rgba = oracle(particles, view, lighting, finish, profile, sheet)
    expected = linear_to_srgb(rgba[..., :3] + (1 - rgba[..., 3:]) * top)
    assert np.abs(splatter.linear() - rgba).max() < 2e-3
    error = image.astype(np.float64) - np.round(expected * 255)
    return float(10 * np.log10(255**2 / max((error**2).mean(), 1e-9)))


@pytest.mark.parametrize("profile", [SOFT, SHARP, CRISP], ids=["soft", "sharp", "crisp"])
@pytest.mark.parametrize("thread", [False, True], ids=["round", "elliptic"])
def test_image_is_the_oracles(thread: bool, profile: Profile) -> None:
    assert decibels(scene(thread=thread), profile) > 60


@pytest.mark.parametrize("thread", [False, True], ids=["round", "elliptic"])
def test_textured_image_is_the_oracles(thread: bool) -> None:
    sheet = SpriteSheet(np.stack([soft_sprite(8), fibre_sprite(8)]))  # so small that the finest level is used
    sprite = np.arange(120) % 2
    particles = scene(thread=thread, count=120, largest=0.1, sprite=sprite)
    large = particles.radius > 0.03
    particles = Particles(
        particles.position[large],
        particles.radius[large],
        particles.colour[large],
        particles.tangent[large],
        particles.normal[large],
        half_length=None if particles.half_length is None else particles.half_length[large],
        sprite=sprite[large],
    )
    assert decibels(particles, SOFT, sheet) > 60


def alpha_of(particles: Particles, *, profile: Profile, camera: Camera = FRONT) -> np.ndarray:
    splatter = Splatter(camera.width, camera.height, profile=profile).load(particles)
    splatter.render(camera)
    return splatter.linear()[..., 3].astype(np.float64)


@pytest.mark.parametrize("tilt", [0.0, 50.0])
def test_ellipse_has_its_area_and_axes(tilt: float) -> None:
    """Moments of (1 - rho^2)^2 over an ellipse: area pi a b / 3, variance a^2 / 8 along and b^2 / 8 across."""
    angle, tilt = np.radians(35), np.radians(tilt)
    tangent = (np.cos(angle) * np.cos(tilt), np.sin(angle) * np.cos(tilt), np.sin(tilt))
    radius, half = 6 / PIXELS_PER_METRE, 20 / PIXELS_PER_METRE
    particle = Particles([(0, 0, 0)], radius, (1, 1, 1), tangent, (0, 0, 1), half_length=half, opacity=1.0)
    alpha = alpha_of(particle, profile=SOFT)
    along = np.sqrt((20 * np.cos(tilt)) ** 2 + (6 * np.sin(tilt)) ** 2)
    assert alpha.sum() == pytest.approx(np.pi * along * 6 / 3, rel=0.01)
    y, x = np.mgrid[:56, :72] + 0.5
    offset = np.stack([x - 36, y - 28])
    spread = np.einsum("ihw,jhw,hw->ij", offset, offset, alpha) / alpha.sum()
    (across2, along2), axes = np.linalg.eigh(spread)
    assert along2 == pytest.approx((along**2 + 0.91) / 8, rel=0.02)
    assert across2 == pytest.approx((36 + 0.91) / 8, rel=0.03)
    seen = np.degrees(np.arctan2(-axes[1, 1], axes[0, 1])) % 180  # y is down in the image
    assert seen == pytest.approx(35, abs=0.5)


def test_fibre_seen_end_on_is_a_disc() -> None:
    radius = 10 / PIXELS_PER_METRE
    particle = Particles([(0, 0, 0)], radius, (1, 1, 1), (0, 0, 1), (0, 0, 1), half_length=3 * radius, opacity=1.0)
    alpha = alpha_of(particle, profile=CRISP)
    assert alpha.sum() == pytest.approx(np.pi * 100, rel=0.03)
    assert alpha == pytest.approx(alpha[::-1, ::-1], abs=1e-3)


def chain(radius: float, spacing: float, *, overlap: float = 1.6) -> Particles:
    """A level thread through the middle, in pixels of FRONT."""
    x = np.arange(-60, 60, spacing) / PIXELS_PER_METRE
    place = np.stack([x, 0 * x, 0 * x], 1)
    half = np.full(len(x), overlap * spacing / PIXELS_PER_METRE)
    return Particles(
        place,
        np.full(len(x), radius / PIXELS_PER_METRE),
        (0.5, 0.5, 0.5),
        (1, 0, 0),
        (0, 0, 1),
        half_length=half,
        opacity=1.0,
    )


def test_chain_is_a_smooth_thread_of_its_width() -> None:
    columns = alpha_of(chain(8.0, 6.0), profile=CRISP).sum(axis=0)
    assert columns.mean() == pytest.approx(16, rel=0.04)
    assert np.ptp(columns) < 0.03 * columns.mean()  # no beads


def test_thread_is_lit_as_a_round_one() -> None:
    light = Lighting(direction=(0, 1, 0.4), fill=0.1, key_colour=(1, 1, 1))
    splatter = Splatter(72, 56).load(chain(12.0, 6.0))
    rows = {}
    for roundness in (0.0, 1.0):
        finish = Finish(roundness=roundness, specular=0.0, sheen=0.0)
        splatter.render(FRONT, lighting=light, finish=finish)
        rgba = splatter.linear()[:, 36].astype(np.float64)
        rows[roundness] = rgba[19:37, 1] / rgba[19:37, 3]  # y is down: the first is the upper side
    assert np.ptp(rows[0.0]) < 1e-3
    assert (np.diff(rows[1.0]) < 0).sum() > 12
    assert rows[1.0][3] > 1.4 * rows[1.0][-4]


def test_a_thread_is_lit_as_a_round_one_by_any_light() -> None:
    """Another light from above shades it as a key does; one from above and one as strong from below, taken together, do
    not."""
    splatter, finish, bright = Splatter(72, 56).load(chain(12.0, 6.0)), Finish(specular=0.0, sheen=0.0), (1.0, 1.0, 1.0)
    above = KeyLight(direction=(0, 1, 0.4), intensity=1.0, colour=bright, follows_camera=False)
    base = Lighting(direction=(0, 1, 0.4), key_colour=bright, key_follows_camera=False, key=1.0, fill=0.1)
    rows = []
    for lighting in (
        base,
        replace(base, key=0.0, others=(above,)),
        replace(base, others=(replace(above, direction=(0, -1, 0.4)),)),
    ):
        splatter.render(FRONT, lighting=lighting, finish=finish)
        rgba = splatter.linear()[:, 36].astype(np.float64)
        rows.append(rgba[19:37, 1] / rgba[19:37, 3])
    assert rows[0][3] > 1.2 * rows[0][-4]
    assert rows[1] == pytest.approx(rows[0], rel=1e-4)
    assert rows[2] == pytest.approx(rows[2][::-1], rel=1e-3)


@pytest.mark.parametrize("radius", [0.2, 1.5, 4.0, 12.0])
def test_a_thread_is_no_brighter_for_its_shading_across(radius: float) -> None:
    level = chain(radius, 3.0)  # turned a little, so that it lies at every place between two rows of pixels
    turned = replace(level, position=level.position @ [[0.98, 0.2, 0], [0, 1, 0], [0, 0, 1]], tangent=(0.98, 0.2, 0))
    splatter, lights = Splatter(72, 56).load(turned), []
    for roundness in (0.0, 1.0):
        finish = Finish(roundness=roundness, specular=0.0, sheen=0.0)
        splatter.render(FRONT, lighting=Lighting(direction=(0, 0.1, 1)), finish=finish)
        lights.append(splatter.linear()[:, 16:56, 1].sum(dtype=np.float64))
    assert lights[1] == pytest.approx(lights[0], rel=0.015)


def test_a_yarn_of_faint_fibres_covers_as_much_from_far_as_from_near() -> None:
    """120 fibres in a yarn of 1 mm, 4 pixels wide and 32; without normals that tell where its axis is, it is wider the
    fewer pixels it has."""
    random = np.random.default_rng(3)
    around, out = random.uniform(0, 2 * np.pi, 120), 0.5e-3 * np.sqrt(random.uniform(0, 1, 120))
    x = np.arange(-3e-3, 3e-3, 0.1e-3)
    outward = np.stack([0 * around, np.cos(around), np.sin(around)], 1)
    place = (out[:, None] * outward)[:, None] + np.array([1.0, 0, 0]) * x[:, None]
    normal = np.repeat(outward, len(x), axis=0)

    def covered(pixels: int, normal: np.ndarray) -> float:
        yarn = Particles(
            place.reshape(-1, 3), 0.04e-3, (0.5, 0.5, 0.5), (1, 0, 0), normal, half_length=0.16e-3, opacity=1.0
        )
        camera = look_at((0, 0, 0.1), (0, 0, 0), width=pixels, height=pixels, fov=2.3)  # 4 mm high and wide
        splatter = Splatter(pixels, pixels).load(yarn)
        splatter.render(camera)
        return splatter.linear()[..., 3].sum(dtype=np.float64) / pixels**2

    near = covered(128, normal)
    assert near == pytest.approx(0.25, rel=0.08)
    assert covered(16, normal) == pytest.approx(near, rel=0.02)
    assert covered(16, np.array([1.0, 0, 0])) > 1.05 * near


def brightness(finish: Finish, *, tangent: tuple[float, float, float], openness: float = 1.0) -> float:
    """Green of a ball that faces the viewer, lit from above at 45 degrees."""
    particle = Particles(
        [(0, 0, 0)], 0.1, (0.2, 0.2, 0.2), tangent, (0, 0, 1), openness=np.full(1, openness), opacity=np.ones(1)
    )
    splatter = Splatter(72, 56).load(particle)
    splatter.render(FRONT, lighting=Lighting(direction=(0, 1, 1)), finish=finish)
    return float(splatter.linear()[28, 36, 1])


def test_highlight_is_kajiyas_cone() -> None:
    """Brightest where t.v = -t.l, that is for a fibre square to the half vector, and gone 45 degrees off."""
    half = np.radians(22.5)
    silk, matte = FINISHES["silk"], Finish(specular=0.0, fibre=FINISHES["silk"].fibre, sheen=FINISHES["silk"].sheen)
    gain = [
        brightness(silk, tangent=(0, np.cos(half + tip), -np.sin(half + tip)))
        - brightness(matte, tangent=(0, np.cos(half + tip), -np.sin(half + tip)))
        for tip in np.radians((0, -20, 20, 45))
    ]
    assert gain[0] > 4 * max(gain[1:3])
    assert gain[1] == pytest.approx(gain[2], rel=0.02)
    assert abs(gain[3]) < 1e-4


def test_materials_and_openness() -> None:
    square = (1.0, 0.0, 0.0)
    assert brightness(FINISHES["silk"], tangent=square) > 1.4 * brightness(FINISHES["cotton"], tangent=square)
    levels = [brightness(FINISHES["cotton"], tangent=square, openness=o) for o in (0.0, 0.5, 1.0)]
    assert levels[0] < levels[1] < levels[2]
