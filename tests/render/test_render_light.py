"""Shadows, the sky between yarns, the lobes of a fibre and tone: against closed forms."""

from dataclasses import replace
from math import pi, radians, sin

import numpy as np
import pytest
import taichi as ti

from taichi_cloth.ground.arrays import F32x2
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES
from taichi_cloth.render.data.blocks import pack
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.finish import FINISHES, Finish
from taichi_cloth.render.data.light import Background, KeyLight, Lighting
from taichi_cloth.render.data.light_sizes import light_bytes
from taichi_cloth.render.data.particles import Particles, concatenate
from taichi_cloth.render.image.image import linear_to_srgb
from taichi_cloth.render.image.tone import TONES, WHITE, tone_curve, tone_inverse, tone_table
from taichi_cloth.render.light.fibre import grazed, lobes
from taichi_cloth.render.light.occlusion import half_sphere, occlude
from taichi_cloth.render.light.particle_light import NO_LIGHT, shading_of
from taichi_cloth.render.light.shade import PLAIN, Shading
from taichi_cloth.render.light.shadow import AROUND, ShadowMap, cast
from taichi_cloth.render.light.thin import chain_step, thin
from taichi_cloth.render.maps.decay import decay
from taichi_cloth.render.maps.map_place import LEANT
from taichi_cloth.render.splat.splat import Splatter

UP = (0.0, 1.0, 0.0)


def discs(position, radius, *, opacity=1.0, normal=UP, **more) -> Particles:
    return Particles(position, radius, (0.5, 0.5, 0.5), (1, 0, 0), normal, opacity=opacity, **more)


def sheet(height: float, *, half: float = 0.1, step: float = 0.002, opacity: float = 1.0) -> Particles:
    """A closed horizontal sheet of overlapping discs."""
    x = np.arange(-half, half + step / 2, step)
    grid = np.stack(np.meshgrid(x, [height], x, indexing="ij"), -1).reshape(-1, 3)
    return discs(grid, step, opacity=opacity)


def shadow(particles: Particles, direction=UP, **options) -> tuple[ShadowMap, np.ndarray]:
    """The map, and the light on each particle."""
    layout, blocks, box = pack(particles, textured=False)
    opacity = 1.0 if layout.opacity else float(particles.opacity)
    shadow_map = cast(layout, blocks, box, direction, opacity=opacity, **options)
    light = np.full((blocks.shape[1], 1, LANES), np.nan, np.float32)
    shadow_map.on_particles(blocks, light, 0)
    return shadow_map, light[:, 0].reshape(-1)[: len(particles)]


def sky(particles: Particles) -> np.ndarray:
    layout, blocks, box = pack(particles, textured=False)
    light = np.ones((blocks.shape[1], 1, LANES), np.float32)
    maps = occlude(layout, blocks, box, opacity=float(particles.opacity), chunks=2, directions=32)
    maps.on_particles(blocks, light, 0)
    return light[:, 0].reshape(-1)[: len(particles)]


def camera(size: int = 96) -> Camera:
    return look_at((0, 0.25, 0.25), (0, 0, 0), width=size, height=size, fov=45)


def test_one_disc_shadows_another_at_the_analytic_place() -> None:
    """Light at 45 degrees: the shadow of a disc 0.05 m up lies 0.05 m aside, and is as wide as the disc."""
    disc = discs([[0, 0.05, 0], [0, 0, 0]], [0.02, 1e-4])
    shadow_map, _ = shadow(disc, (-1, 1, 0), texel_radii=0.05)
    x = np.linspace(0, 0.1, 2001)
    light = shadow_map.shadow_at(np.stack([x, 0 * x, 0 * x], 1), lag=0.0)
    dark = x[light < 0.5]
    # A disc of the map faces the light: seen from there it is round, on the ground stretched by sqrt(2).
    assert (dark.min() + dark.max()) / 2 == pytest.approx(0.05, abs=5e-4)
    assert dark.max() - dark.min() == pytest.approx(2 * 0.02 * 2**0.5, rel=0.05)
    assert light[np.abs(x - 0.05) < 0.02].max() < 0.05
    assert light[np.abs(x - 0.05) > 0.04].min() == 1.0


@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_the_edge_of_a_shadow_on_a_surface_has_no_steps(tilt: float) -> None:
    """Under the rim of a disc, whatever way it runs, a surface, flat or aslant, has half of the light; as single texels
    tell it, it varies twice as much and more."""
    disc = discs([[0, 0.05, 0], [0, -0.05, 0]], [0.02, 0.1])
    shadow_map, _ = shadow(disc, (0, 1, 0), texel_radii=0.05)
    assert 0.002 < shadow_map.texel < 0.004
    turn = np.linspace(0, 2 * np.pi, 721)
    rim = np.stack([0.02 * np.cos(turn), 0.02 * tilt * np.cos(turn), 0.02 * np.sin(turn)], 1)
    normal = np.array([-tilt, 1.0, 0.0]) / np.hypot(tilt, 1.0)
    out = shadow_map.texel * normal * [1.0, 0.0, 1.0]  # a texel out of such a place lies under the rim
    light = shadow_map.shadow_on(rim - out, np.broadcast_to(normal, rim.shape))
    assert light.mean() == pytest.approx(0.5, abs=0.05)
    assert light.std() < 0.05
    assert shadow_map.shadow_at(rim, lag=shadow_map.texel).std() > 2 * light.std()


def test_penumbra_is_as_wide_as_the_light_seen_from_the_blocker() -> None:
    """Under an edge at height h a light of angle w gives a penumbra 2 h tan(w / 2) wide, within a third: texels of
    2/3 of it are read bilinearly, which spreads an edge over one to two of them, by where it falls."""
    edge = sheet(0.06, half=0.08)
    edge = replace(edge, radius=np.where(edge.position[:, 0] > 0, 0, edge.radius))
    ground = discs([[0, 0, 0]], [1e-5])
    x = np.linspace(-0.06, 0.06, 2401)
    widths = []
    for size in (0.0, 12.0, 24.0):
        shadow_map, _ = shadow(concatenate([edge, ground]), size_deg=size)
        light = shadow_map.shadow_at(np.stack([x, 0 * x, 0 * x], 1), lag=0.0)
        assert np.all(np.diff(light) > -0.02)
        slope = np.maximum(np.diff(light), 0)
        slope /= slope.sum()
        middle = (x[1:] * slope).sum()
        widths.append((12 * ((x[1:] - middle) ** 2 * slope).sum()) ** 0.5)  # of the even penumbra that varies as much
        assert np.interp(0.5, light, x) == pytest.approx(0.0, abs=0.004)
    assert widths[0] < 2 * shadow_map.texel
    for width, size in zip(widths[1:], (12.0, 24.0), strict=True):
        assert width == pytest.approx(2 * 0.06 * np.tan(radians(size) / 2), rel=0.34)


@pytest.mark.parametrize("alpha", [0.2, 0.5])
def test_layers_dim_the_light_by_one_minus_alpha_each(alpha: float) -> None:
    """Big discs behind one another, farther apart than the layers of the map: (1 - a)^k on disc k and below."""
    depths = np.array([0.0, 0.03, 0.06, 0.09, 0.12])
    stack = discs([[0, -d, 0] for d in depths], 0.004, opacity=alpha)
    shadow_map, light = shadow(stack, texel_radii=0.05)
    np.testing.assert_allclose(light, (1 - alpha) ** np.arange(5), atol=1e-5)
    assert shadow_map.shadow_at([[0, -0.2, 0]])[0] == pytest.approx((1 - alpha) ** 5, abs=1e-5)
    assert shadow_map.shadow_at([[0.05, -0.2, 0], [0, 0.1, 0]]) == pytest.approx([1, 1])


@pytest.mark.parametrize("angle", [0, 30, 60, 70, 80, 85])
def test_a_sheet_does_not_shadow_itself(angle: float) -> None:
    """What it loses of the light that falls on it, times the cosine it would be lit with: nothing up to 70 degrees.

    Beyond, a texel's depth varies by more than the four texels that are allowed for, since more would let light leak
    under what lies on the sheet; a 30th of the full light is lost at the most.
    """
    plane = sheet(0.0, half=0.05)
    _, light = shadow(plane, (sin(radians(angle)), sin(radians(90 - angle)), 0))
    inner = np.abs(plane.position[:, [0, 2]]).max(axis=1) < 0.045
    lost = (1 - light[inner]) * sin(radians(90 - angle))
    assert lost.mean() < (0.001 if angle <= 70 else 0.033)
    assert np.percentile(lost, 99) < (0.005 if angle <= 70 else 0.08)


def test_a_thread_does_not_shadow_itself_and_shadows_what_lies_under_it() -> None:
    x = np.arange(-0.05, 0.05, 0.001)
    thread = discs(np.stack([x, 0 * x + 0.02, 0 * x], 1), 0.001, half_length=0.0015)
    below = discs(np.stack([x, 0 * x, 0 * x], 1), 0.001, half_length=0.0015)
    _, light = shadow(concatenate([thread, below]))
    assert light[: len(x)].min() > 0.99
    assert light[len(x) + 5 : -5].max() < 0.25


@pytest.mark.parametrize("texel_radii", [0.25, 1.0, 1.3, 3.0])
def test_a_faint_thread_takes_its_area_of_light_at_any_resolution(texel_radii: float) -> None:
    """Summed over the map, what light is stopped is opacity times area: of ellipses, and of points along a fibre."""
    along = np.array([0.8, 0.0, 0.6])
    one = discs([[0, 0, 0], [0.02, 0, 0]], [0.001, 0.0], half_length=0.008, opacity=0.02)
    one = replace(one, tangent=np.tile(along, (2, 1)))
    shadow_map, _ = shadow(one, texel_radii=texel_radii)
    _, width, height = shadow_map.levels[0]
    there = fetched(shadow_map.nearest)[: width * height] < 1e20
    through = fetched(shadow_map.through)[: width * height][there, -1]
    stopped = -np.log(through.astype(float)).sum() * shadow_map.texel**2
    assert stopped == pytest.approx(0.02 * pi * 0.001 * 0.004, rel=0.05)


def test_a_thinned_thread_throws_the_shadow_of_the_whole() -> None:
    """Round beads and elongated pieces in a row: half of them, twice as dense or twice as long, dim light as all do."""
    x = np.arange(0, 0.1, 0.0005)
    place = np.stack([x, 0 * x, 0.01 * np.cos(60 * x)], 1)
    ground = np.stack([x[20:-20], 0 * x[20:-20] - 0.02, 0.01 * np.cos(60 * x[20:-20])], 1)
    for more in ({}, {"half_length": 0.0012}):
        thread = discs(place, 0.001, opacity=0.2, **more)
        layout, blocks, box = pack(thread, textured=False)
        assert chain_step(layout, blocks) == pytest.approx(0.00058, rel=0.1)
        few = np.zeros((layout.rows, -(-blocks.shape[1] // 2), LANES), np.float32)
        thin(2, blocks, few)
        whole, half = (
            cast(layout, some, box, UP, opacity=0.2, stretch=stretch).shadow_at(ground)
            for some, stretch in ((blocks, 1.0), (few, 2.0))
        )
        assert whole.mean() < 0.7
        assert half.mean() == pytest.approx(whole.mean(), abs=0.03)
        np.testing.assert_allclose(half, whole, atol=0.1)


def test_pieces_of_a_sheet_are_no_chain() -> None:
    """They lie as near to one another as those of a thread, but each leans to a side of its own."""
    x = np.arange(0, 0.1, 0.0005)
    place = np.stack([x, 0 * x, 0 * x], 1)
    for half_length, want in ((0.0012, True), (0.001, False)):
        layout, blocks, _ = pack(discs(place, 0.001, half_length=half_length), textured=False)
        assert (chain_step(layout, blocks) is not None) is want


def test_sky_over_a_plane_and_in_a_slot() -> None:
    """A plane sees all of it; the middle of a slot's floor, w wide and h deep, sin(atan(w / 2h))."""
    floor = sheet(0.0, half=0.06)
    inner = np.abs(floor.position[:, [0, 2]]).max(axis=1) < 0.05
    assert sky(floor)[inner].mean() > 0.975
    width, depth, step = 0.04, 0.03, 0.002
    z, y = np.meshgrid(np.arange(-0.2, 0.2, step), np.arange(0, depth, step))
    walls = []
    for side in (-1, 1):
        at = np.stack([np.full(z.size, side * width / 2), y.ravel(), z.ravel()], 1)
        walls.append(discs(at, step, normal=(-side, 0, 0)))
    z = np.arange(-0.2, 0.2, step)
    middle = discs(np.stack([0 * z, 0 * z, z], 1), step)
    seen = sky(concatenate([middle, *walls]))[: len(z)]
    centre = seen[np.abs(z) < 0.05].mean()
    assert centre == pytest.approx(sin(np.arctan2(width / 2, depth)), abs=0.08)


@pytest.mark.parametrize(("normal", "bend"), [((0, 1, 0), 0.0), ((1, 1, 0.5), 0.0), ((0, 1, 0), 10.0)])
def test_where_no_thread_is_told_apart_a_cloth_is_open_along_its_own_normal(normal, bend: float) -> None:
    """Of a sheet that lies any way, or over a barrel, in maps whose texels are 15 times as wide as it is thick."""
    rng, depth = np.random.default_rng(1), 3e-4
    up = np.array(normal) / np.linalg.norm(normal)
    one = np.linalg.svd(up[None])[2][1]
    u, w = np.meshgrid(np.arange(-0.1, 0.1, 0.002), np.arange(-0.1, 0.1, 0.002))
    angle = np.maximum(bend, 1e-6) * u.ravel()
    straight = np.outer(np.sin(angle), one) + np.outer(np.cos(angle), up)
    along = np.outer(np.sin(angle), one) + np.outer(np.cos(angle) - 1, up)
    at = along / np.maximum(bend, 1e-6) + np.outer(w.ravel(), np.cross(up, one))
    at += rng.uniform(-depth / 2, depth / 2, (len(at), 1)) * straight
    tilted = straight + 0.7 * rng.normal(size=at.shape) / 3**0.5
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    layout, blocks, box = pack(discs(at, 0.002, normal=tilted), textured=False)
    maps, light = occlude(layout, blocks, box, opacity=1.0, chunks=1), np.ones((blocks.shape[1], 7, LANES), np.float32)
    maps.on_particles(blocks, light, 0, depth)
    rows = light.swapaxes(0, 1).reshape(7, -1)[:, : len(at)]
    inner = (np.abs(u) < 0.08).ravel() & (np.abs(w) < 0.08).ravel() & ((tilted * straight).sum(axis=1) > 0.3)
    wanted = LEANT * tilted + (1 - LEANT) * straight
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    apart = np.linalg.norm((rows[3:6].T - wanted)[inner], axis=1)
    assert apart.max() < 0.15
    assert apart.mean() < 0.04
    assert rows[0, inner].mean() > 0.97


@pytest.mark.parametrize("degrees", [90, 25])
def test_fibres_around_are_those_nearer_to_the_light_by_a_part_of_the_cloth(degrees: float) -> None:
    """Of a cloth of faint discs: the light at a height is that of the fibres around so much farther from the light."""
    rng, depth, count, wide = np.random.default_rng(5), 0.02, 40_000, 0.3
    at = rng.uniform(-0.5, 0.5, (count, 3)) * (wide, depth, wide)
    towards = (np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0)
    layout, blocks, box = pack(discs(at, 0.002, normal=towards, opacity=0.1), textured=False)
    shadows = cast(layout, blocks, box, towards, opacity=0.1)
    rows = Shading(bulk=True).of_light
    light = np.ones((blocks.shape[1], rows, LANES), np.float32)
    shadows.on_particles(blocks, light, 0, depth)
    here, cloth, around = light.swapaxes(0, 1).reshape(rows, -1)[:, :count]
    lower = (AROUND * depth + shadows.texel) * towards[1]
    inner = (np.abs(at[:, [0, 2]]) < 0.2 * wide).all(axis=1)
    for height in (0.0, 0.004):
        layer, under = (inner & (np.abs(at[:, 1] - y) < 0.001) for y in (height, height - lower))
        assert around[under].mean() == pytest.approx(here[layer].mean(), rel=0.03)
        assert here[under].mean() < 0.95 * here[layer].mean()
    assert cloth[inner].mean() > 0.99


def test_directions_are_even() -> None:
    """Unit, and with their opposites alike in all directions: the mean of d d^T is a third of the identity."""
    directions = half_sphere(10)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    np.testing.assert_allclose(directions.T @ directions / 10, np.eye(3) / 3, atol=1e-12)


def test_sky_gradient_is_its_integral() -> None:
    """A white Lambert surface turned any way under a sky from horizon to zenith, against the sum over the sphere."""
    dome = Lighting(key=0, fill=0.8, sky=(0.2, 0.5, 1.0), horizon=(1.0, 0.7, 0.3), ground=(0.1, 0.2, 0.1), exposure=1)
    k = np.arange(20_000)
    y = 1 - (2 * k + 1) / len(k)
    ring, around = np.sqrt(1 - y * y), pi * (3 - 5**0.5) * k
    way = np.stack([ring * np.cos(around), y, ring * np.sin(around)], 1)
    horizon, sky, ground = (np.array(c) for c in (dome.horizon, dome.sky, dome.ground))
    radiance = np.where(y[:, None] > 0, horizon + (sky - horizon) * y[:, None], ground) * dome.fill * 2
    splatter = Splatter(16, 16)
    for b in np.radians([0, 35, 90, 140, 180]):
        cosine = np.maximum(way @ (np.sin(b), np.cos(b), 0), 0)
        expected = (radiance * cosine[:, None]).sum(axis=0) * 4 / len(k)  # 4 pi / n, over pi
        np.testing.assert_allclose(dome.ambient(np.cos(b)), expected, rtol=2e-3)
        # And as it is drawn: one opaque disc of that normal, which faces the camera.
        normal = np.array([np.sin(b), np.cos(b), 0.0])
        disc = Particles([[0, 0, 0]], 0.1, (1, 1, 1), (0, 0, 1), normal, opacity=1.0)
        side = (0, 0, 1) if abs(normal[1]) > 0.9 else UP
        splatter.load(disc)
        plain = Finish(fibre=0, specular=0, sheen=0, roundness=0)
        splatter.render(look_at(0.2 * normal, (0, 0, 0), up=side, width=16, height=16), lighting=dome, finish=plain)
        np.testing.assert_allclose(splatter.linear()[8, 8, :3], expected, atol=0.002 * 1.6)


def cloth(seed: int = 3, count: int = 3000) -> Particles:
    rng = np.random.default_rng(seed)
    along = rng.standard_normal((count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return Particles(
        rng.uniform(-0.08, 0.08, (count, 3)), rng.uniform(0.001, 0.004, count), rng.uniform(0.2, 0.8, (count, 3)),
        along, UP, half_length=rng.uniform(0.002, 0.008, count), openness=rng.uniform(0.3, 1, count), opacity=0.7,
    )  # fmt: skip


FULL = Lighting(
    direction=(0.4, 0.8, 0.3), key_follows_camera=False, shadows=True, occlusion=True, tone="shoulder",
    others=(KeyLight(direction=(-0.4, 0.3, -0.8), casts_shadow=True, follows_camera=False),),
)  # fmt: skip


LOBES = Finish(model="marschner")
FAINT = KeyLight(direction=UP, intensity=1e-6, casts_shadow=True, follows_camera=False)
"""Beside a key light that casts shadows: the kernels are those of `FULL`, and the light is that of the key alone."""


def test_same_bytes_for_any_number_of_chunks() -> None:
    images = [Splatter(96, 96, chunks=n).load(cloth()).render(camera(), lighting=FULL, finish=LOBES) for n in (1, 2, 5)]
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_no_light_pass_without_shadows() -> None:
    """One plain light compiles the plain kernel, and nothing is made for it."""
    splatter = Splatter(64, 64).load(cloth())
    splatter.render(camera(64))
    assert shading_of(Lighting(), Finish()) == PLAIN
    assert splatter.light.lookups == 0
    assert splatter.light._light is None
    assert splatter.light.key_map() is None
    assert NO_LIGHT.size == LANES


def test_a_pass_is_made_once_a_pose_and_light() -> None:
    splatter = Splatter(64, 64).load(cloth())
    cameras = [look_at((x, 0.2, 0.25), (0, 0, 0), width=64, height=64) for x in (0.0, 0.1, 0.2)]
    for view in cameras:
        splatter.render(view, lighting=FULL, finish=LOBES)
    assert splatter.light.lookups == 3  # two lights and the sky, in the first view
    for view in cameras:
        splatter.render(view, lighting=replace(FULL, key_follows_camera=True), finish=LOBES)
    assert splatter.light.lookups == 6
    splatter.load(cloth(4)).render(cameras[0], lighting=FULL, finish=LOBES)
    assert splatter.light.lookups == 9
    key_map = splatter.light.key_map()
    assert key_map is not None
    assert key_map.shadow_at([[0, 1, 0]])[0] == 1


def test_light_maps_are_counted() -> None:
    """What `light_bytes` says is not less than what the maps take, and nothing without shadows and occlusion."""
    assert light_bytes(10**6, shadows=0, occlusion=False) == 0
    splatter = Splatter(64, 64).load(cloth())
    maps = splatter.cast_light(camera(64), FULL)
    assert maps.nbytes <= light_bytes(len(cloth()), shadows=2, occlusion=True) < 12 * maps.nbytes


def test_batches_make_no_light_pass() -> None:
    splatter = Splatter(64, 64)
    splatter.begin(camera(64), lighting=FULL, finish=LOBES).add(cloth()).add(cloth(4)).finish()
    assert splatter.light.lookups == 0


def test_batches_are_lit_by_maps_of_the_whole() -> None:
    """Two halves drawn one behind the other, in the light maps of both, give the picture of both."""
    near, far = cloth(), cloth(4)
    near = replace(near, position=near.position + np.array([0, 0.15, 0.15], np.float32))
    splatter = Splatter(96, 96, opaque=0.0).load(concatenate([near, far]))
    whole = splatter.render(camera(), lighting=FULL, finish=LOBES).astype(int)
    bare = splatter.render(camera(), lighting=FULL.without_maps(), finish=LOBES).astype(int)
    splatter.light.hold(splatter.cast_light(camera(), FULL))
    drawn = splatter.begin(camera(), lighting=FULL, finish=LOBES).add(near).add(far).finish().astype(int)
    # Depth keys have 22 bits of each batch's own depth: a pair of particles may change places.
    assert np.percentile(np.abs(drawn - whole), 99) <= 2
    assert np.abs(whole - bare).mean() > 4
    splatter.light.hold(None)
    assert splatter.load(near).cast_light(camera(), FULL).nbytes > 0


@pytest.mark.parametrize("moved", [0.3, -0.4])
def test_texels_stay_where_they_are_while_things_move(moved: float) -> None:
    """A particle at the rim moves by less than a texel, and with it the box of all: the others' light stays."""
    still = concatenate([cloth(), discs([[0.2, 0.0, 0.0]], 0.002)])
    layout, blocks, box = pack(still, textured=False)
    before = cast(layout, blocks, box, (0.3, 1, 0.2), size_deg=8)
    place = still.position.copy()
    place[-1] += np.array([moved, 0.2 * moved, moved], np.float32) * before.texel
    layout, blocks, box = pack(replace(still, position=place), textured=False)
    after = cast(layout, blocks, box, (0.3, 1, 0.2), size_deg=8)
    assert after.texel == before.texel
    shift = (after.axes[3, :2] - before.axes[3, :2]) / before.texel
    np.testing.assert_allclose(shift, np.round(shift), atol=1e-3)
    points = still.position[:-1]
    np.testing.assert_allclose(after.shadow_at(points), before.shadow_at(points), atol=2e-4)


def test_shadow_falls_on_the_image() -> None:
    """In the light and of the layout of the tests above, which have compiled their kernels."""
    lid = sheet(0.04, half=0.02)
    lighting = replace(FULL, direction=(0, 1, 0), fill=0.05, others=(FAINT,))
    view = look_at((0, 0.05, 0.3), (0, 0.0, 0), width=96, height=96, fov=40)
    both = concatenate([sheet(0.0, half=0.06), lid])
    both = replace(both, half_length=both.radius, openness=np.ones(len(both), np.float32))
    splatter = Splatter(96, 96).load(both)
    lit = splatter.render(view, lighting=lighting.without_maps(), finish=LOBES).astype(int)
    dark = splatter.render(view, lighting=lighting, finish=LOBES).astype(int)
    x, y, _ = view.project([[0, 0, -0.003]])[0].astype(int)
    assert dark[y, x].max() < 0.5 * lit[y, x].max()
    x, y, _ = view.project([[0.045, 0, 0.0]])[0].astype(int)
    assert abs(dark[y, x] - lit[y, x]).max() < 8


@ti.kernel
def _scatter(angles: F32x2, sharpness: float, weights: F32x2, out: F32x2):
    for i in range(angles.shape[0]):
        th_i = angles[i, 0]
        th_r = angles[i, 1]
        cos_i = ti.cos(th_i)
        cos_r = ti.cos(th_r)
        s_i = ti.sin(th_i)
        s_r = ti.sin(th_r)
        l_v = s_i * s_r + cos_i * cos_r * ti.cos(angles[i, 2])
        weight = ti.Vector([weights[0, k] for k in ti.static(range(3))])
        r, tt, trt = lobes(s_i, s_r, cos_i, cos_r, l_v, sharpness, weight)
        out[i, 0] = r
        out[i, 1] = tt
        out[i, 2] = trt


def scattered(finish: Finish, th_i: float) -> np.ndarray:
    """Share of the light from inclination th_i that R, TT and TRT send out: the integral of f cos^2 over the sphere.

    Power out over power in, both a length of fibre: cos th is the width seen, one more the solid angle's.
    """
    th = (np.arange(400) + 0.5) / 400 * pi - pi / 2
    phi = (np.arange(90) + 0.5) / 90 * 2 * pi - pi
    grid = np.stack(np.meshgrid([th_i], th, phi, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)
    out = np.zeros((len(grid), 3), np.float32)
    weights = np.array([[finish.reflect, finish.transmit, finish.internal]], np.float32)
    _scatter(grid, 1 / (8 * np.sin(np.radians(finish.spread)) ** 2), weights, out)
    cell = (pi / 400) * (2 * pi / 90)
    return (out * np.cos(grid[:, 1:2]) ** 2).sum(axis=0) * cell


@pytest.mark.parametrize("name", FINISHES)
def test_a_fibre_sends_out_no_more_than_comes_in(name: str) -> None:
    finish = FINISHES[name]
    for degrees in (0, 20, 40, 60, 80):
        r, tt, trt = scattered(finish, radians(degrees))
        diffuse = 1 - finish.reflect - finish.transmit - finish.internal
        # R grows towards grazing light, and the diffuse share does not give that up: 1 % for the brightest R.
        assert r + tt + trt + diffuse <= 1.011
    # At normal incidence M is a Gaussian in the sine of th_r, whose width is known, over cos th_d.
    th = np.linspace(-pi / 2, pi / 2, 20_001)
    normal = scattered(replace(finish, spread=6), 0.0)
    for got, weight, width in ((normal[1], finish.transmit, 1), (normal[2], finish.internal, 4)):
        sigma = width * sin(radians(6))
        m = np.exp(-0.5 * (np.sin(th) / sigma) ** 2) / (sigma * (2 * pi) ** 0.5)
        share = (m * np.cos(th) ** 2 / np.sqrt(0.5 + 0.5 * np.cos(th))).sum() * (th[1] - th[0])
        assert got == pytest.approx(weight * share, rel=0.01)
    assert normal[0] >= 0.95 * finish.reflect


def test_what_grazes_comes_back_forwards() -> None:
    """By the angle between light and view, whose half's cosine is x: nothing straight back, most ahead, and nothing off
    the cone of the fibre's highlights."""

    @ti.kernel
    def run(light: F32x2, view: F32x2, sharpness: float, out: F32x2):
        for i in range(out.shape[0]):
            to, v = ti.Vector([light[i, k] for k in range(3)]), ti.Vector([view[i, k] for k in range(3)])
            cos_i, cos_r = ti.sqrt(1.0 - to[0] * to[0]), ti.sqrt(1.0 - v[0] * v[0])
            out[i, 0] = grazed(to[0], v[0], cos_i, cos_r, to.dot(v), sharpness)

    rng, sharpness = np.random.default_rng(3), 5.0
    light, view = (rng.normal(size=(500, 3)) for _ in range(2))
    view[:, 0] = 0.1 * view[:, 0] - light[:, 0]
    light, view = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (light, view))
    out = np.zeros((500, 1), np.float32)
    run(light.astype(np.float32), view.astype(np.float32), sharpness, out)
    along = light[:, 0] + view[:, 0]
    cos_i, cos_r = (np.sqrt(1 - x[:, 0] ** 2) for x in (light, view))
    half = np.sqrt((1 + np.clip((light * view)[:, 1:].sum(axis=1) / (cos_i * cos_r), -1, 1)) / 2)
    cos_d = np.cos((np.arcsin(light[:, 0]) - np.arcsin(view[:, 0])) / 2)
    x = np.linalg.norm(light + view, axis=1) / 2
    m = np.sqrt(4 * sharpness / pi) * np.exp(-4 * sharpness * along**2)
    assert half * cos_d == pytest.approx(x, abs=0.02 + np.abs(along).max() ** 2)
    np.testing.assert_allclose(out[:, 0], half * (1 - half * cos_d) ** 1.5 * m * cos_i / cos_d, rtol=0.03, atol=2e-3)
    assert out[x > 0.94].max() < 0.02 * out.max()


def test_decay_is_the_exponential() -> None:
    @ti.kernel
    def run(x: F32x2):
        for i in range(x.shape[0]):
            x[i, 1] = decay(x[i, 0])

    values = np.zeros((200, 2), np.float32)
    values[:, 0] = np.linspace(0, 15, 200)
    run(values)
    np.testing.assert_allclose(values[:, 1], np.exp(-values[:, 0]), rtol=0.02, atol=1e-6)


def brightness(finish: Finish, light: tuple[float, float, float]) -> float:
    """Mean linear light of a thread across the image, lit from a direction of the viewer's."""
    x = np.arange(-0.05, 0.05, 0.002)
    thread = Particles(
        np.stack([x, 0 * x, 0 * x], 1),
        0.004,
        (0.7, 0.5, 0.3),
        (1, 0, 0),
        (0, 0, 1),
        half_length=0.003,
        openness=np.ones(len(x)),
    )
    view = look_at((0, 0, 0.2), (0, 0, 0), width=64, height=64)
    alone = replace(FULL, others=(FAINT,), fill=1e-6)
    lighting = replace(alone, direction=light, key_follows_camera=True, key=1.0, key_colour=(1, 1, 1))
    splatter = Splatter(64, 64).load(thread)
    splatter.render(view, lighting=lighting, finish=finish, background=Background(top=(0, 0, 0)))
    return float(splatter.linear()[..., :3].mean())


def test_light_passes_through_a_fibre() -> None:
    """Against the light a fibre with transmission glows; without it is dark; and it beats its front-lit lobes."""
    clear = Finish(model="marschner", transmit=0.5, internal=0.0, reflect=0.0, sheen=0.0, fibre=0.0)
    closed = replace(clear, transmit=0.0)
    back = (0.0, 0.05, -1.0)
    assert brightness(clear, back) > 10 * brightness(closed, back)
    lobes_only = replace(clear, transmit=1.0)
    front = (0.0, 0.05, 1.0)
    assert brightness(lobes_only, back) > 3 * brightness(lobes_only, front)


def test_materials_differ() -> None:
    """Along a sweep of the light, each pair of presets differs by more than a tenth somewhere."""
    lights = [(0.0, 0.3, 1.0), (0.3, 0.2, 1.0), (0.7, 0.2, 0.7), (0.0, 0.3, -1.0)]
    names = ("cotton", "silk", "wool", "polyester", "viscose")
    curves = {n: np.array([brightness(replace(FINISHES[n], model="marschner"), at) for at in lights]) for n in names}
    for i, one in enumerate(names):
        for two in names[i + 1 :]:
            assert np.abs(np.log(curves[one] / curves[two])).max() > 0.1, (one, two)


@pytest.mark.parametrize("tone", TONES)
def test_tone_curves(tone) -> None:
    x = np.repeat(np.linspace(0, WHITE[tone], 1000)[:, None], 3, axis=1)
    shown = tone_curve(tone, x)
    assert shown[0] == pytest.approx(0)
    assert shown[-1].max() <= 1
    assert np.all(np.diff(shown, axis=0) >= 0)
    colours = np.array([0.05, 0.4, 0.9])
    np.testing.assert_allclose(tone_curve(tone, tone_inverse(tone, colours)), colours, atol=1e-4)
    assert len(tone_table(tone, 4096)) == 4097
    if tone == "shoulder":
        np.testing.assert_allclose(tone_curve(tone, colours[:2]), colours[:2])


def test_neutral_is_the_published_mapper() -> None:
    """Worked by hand from its published formula: the toe, the straight part, compression and loss of hue."""
    assert tone_curve("neutral", [0.04, 0.05, 0.06]) == pytest.approx([0.01, 0.02, 0.03])  # f = 0.04 - 6.25 0.04^2
    assert tone_curve("neutral", [0.1, 0.5, 0.79]) == pytest.approx([0.06, 0.46, 0.75])
    assert tone_curve("neutral", [1.0, 1.0, 1.0]) == pytest.approx(1 - 0.0576 / 0.44)  # p = 0.96, grey stays grey
    keep = 1 / (0.15 * (1.48 - 0.94) + 1)  # p = 1.48, p' = 1 - 0.24^2 / 0.96 = 0.94
    expected = [0.94, 0.94 + keep * (0.94 / 2 - 0.94), 0.94 - keep * 0.94]
    assert tone_curve("neutral", [1.48, 0.74, 0.0]) == pytest.approx(expected)
    light = 4 * np.random.default_rng(1).random((200, 3)) ** 3
    assert tone_inverse("neutral", tone_curve("neutral", light)) == pytest.approx(light, abs=1e-7)
    assert tone_curve("neutral", tone_inverse("neutral", [1.0, 1.0, 1.0])) == pytest.approx(0.999)


def test_a_picture_in_neutral_is_its_linear_light_mapped() -> None:
    """The kernel against the curve: particles, an open background and a picture that comes in batches."""
    camera = look_at((0, 0, 1.0), (0, 0, 0), width=40, height=24, fov=40)
    rng = np.random.default_rng(2)
    near = Particles(rng.uniform(-0.1, 0.1, (40, 3)), 0.03, rng.random((40, 3)), (1, 0, 0), (0, 0, 1), opacity=0.7)
    lighting = Lighting(tone="neutral", key=3.0)
    background = Background(top=(2.0, 0.3, 0.1), bottom=(0.02, 0.3, 0.5))
    splatter = Splatter(40, 24).load(near)
    image = splatter.render(camera, lighting=lighting, background=background)
    rgba, ends = splatter.linear(), background.ends()
    behind = ends[:3] + (ends[3:] - ends[:3]) * ((np.arange(24) + 0.5) / 24)[:, None, None]
    expected = 255 * linear_to_srgb(tone_curve("neutral", rgba[..., :3] + (1 - rgba[..., 3:]) * behind))
    assert rgba[..., :3].max() > 1.2
    assert (rgba[..., 3] == 0).any()
    assert np.abs(image - expected).max() < 1.6  # the table has 4096 steps: up to one of 255 in the dark
    splatter.begin(camera, lighting=lighting, background=background).add(near)
    assert np.abs(splatter.finish().astype(int) - image).max() <= 1


def test_errors() -> None:
    with pytest.raises(InputError, match=r"lighting.tone"):
        Lighting(tone="pink")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"lighting.size"):
        Lighting(size=100)
    with pytest.raises(InputError, match=r"light.direction"):
        KeyLight(direction=(0, 0, 0))
    with pytest.raises(InputError, match=r"up to 8"):
        shading_of(Lighting(others=(KeyLight(direction=UP),) * 9), Finish())
    with pytest.raises(InputError, match=r"makes no light"):
        Finish(reflect=0.5, transmit=0.5, internal=0.1)
    with pytest.raises(InputError, match=r"finish.model"):
        Finish(model="phong")  # pyright: ignore[reportArgumentType]
    shadow_map, _ = shadow(cloth())
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        shadow_map.shadow_at([1, 2, 3])
