"""Streaming: batches and windows against one picture, culling, level of detail against full detail, refinement."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from taichi_cloth.detail.refine import RefiningStream
from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.detail.thinning import FULL, LEAST, Gains, thinned_to
from taichi_cloth.fibre.contours import contour
from taichi_cloth.fibre.relief import skin_of
from taichi_cloth.ground.particles import LANES, ROWS
from taichi_cloth.render.data.camera import Camera, frame
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.passes import render_passes
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.splat.stream import stream, stream_passes
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.tiles.mesh import Mesh
from taichi_cloth.scenes.commands.output_folder import OutputFolder
from taichi_cloth.scenes.commands.sequence import Sequence
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.models.fabric_model import FabricModel
from taichi_cloth.scenes.picture import gains as scene_gains
from taichi_cloth.scenes.picture.gains import colours_at, crossings, fit_gains, fit_near, seen_at, views_of
from taichi_cloth.scenes.picture.samples import samples_of
from taichi_cloth.scenes.picture.view import View, first_of
from taichi_cloth.scenes.picture.zoom import path, source_of, target_of, zoom
from taichi_cloth.scenes.scene.load import load_scene

SIZE = 320, 192
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (Rec. 709)


@pytest.fixture(scope="module")
def model() -> FabricModel:
    small = ["weave.ends=24", "weave.picks=20", "yarn.fibres=8", "fabric.steps=8"]
    built = build(load_scene("swatch", small))
    assert isinstance(built, FabricModel)
    return built


@pytest.fixture(scope="module")
def particles(model: FabricModel) -> Particles:
    found = model.panels()[0].particles
    assert isinstance(found, Particles)
    return found


@pytest.fixture(scope="module")
def camera(particles: Particles) -> Camera:
    return frame(particles.position, width=SIZE[0], height=SIZE[1], elevation=50)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / max(np.mean((a.astype(float) - b) ** 2), 1e-9)))


def some(p: Particles, chosen: np.ndarray) -> Particles:
    optional = [None if a is None else a[chosen] for a in (p.half_length, p.openness)]
    fields = (p.position, p.radius, p.colour, p.tangent, p.normal)
    return Particles(*(a[chosen] for a in fields), *optional, opacity=p.opacity)  # pyright: ignore[reportArgumentType]


def test_batches_in_depth_order_are_one_picture(particles: Particles, camera: Camera) -> None:
    order = np.argsort(camera.project(particles.position)[:, 2], kind="stable")
    splatter = Splatter(*SIZE).load(some(particles, order))
    whole, alpha = splatter.render(camera), splatter.linear()
    for count in (1, 5):
        splatter.begin(camera)
        for part in np.array_split(order, count):
            splatter.add(some(particles, part))
        assert psnr(whole, splatter.finish()) > 60
        assert np.abs(splatter.linear() - alpha).max() < 0.02


def test_windows_are_one_picture(model: FabricModel, particles: Particles, camera: Camera) -> None:
    splatter = Splatter(*SIZE).load(particles)
    whole = splatter.render(camera)
    source = FabricStream(model.fabric, model.points, target=0)
    sizes = []
    for most in (10**9, 40_000, 20_000):
        image, stats = stream(splatter, camera, source, most=most)
        assert psnr(whole, image) > 43
        assert stats.largest <= most * 2  # with what reaches into a slab from others
        sizes.append(stats.batches)
    assert sizes[0] == 1 < sizes[1] < sizes[2]


def test_a_larger_canvas_shows_the_same_view(model: FabricModel) -> None:
    (_, one), (_, two) = (next(View(model, (72, 56), scale=scale).turntable(1, [0])) for scale in (1, 2))
    assert two.shape == (112, 144, 3)
    assert psnr(one, cv2.resize(two, (72, 56), interpolation=cv2.INTER_AREA)) > 24


def test_passes_of_windows_and_batches_are_those_of_one_picture(model: FabricModel, camera: Camera) -> None:
    particles = model.panels()[0].particles
    numbers = model.numbers()
    particles = replace(particles, yarn=numbers.yarn, part=numbers.part)
    splatter = Splatter(*SIZE).load(particles)
    splatter.render(camera)
    whole = render_passes(splatter, camera, particles)
    source = FabricStream(model.fabric, model.points, target=0)
    for most in (20_000, 300):  # windows; and so little that tiles take several batches
        _, passes = stream_passes(splatter, camera, source, most=most)
        assert whole.depth is not None
        assert passes.depth is not None
        assert passes.mask is not None
        assert whole.mask is not None
        seen = whole.depth > 0
        assert (seen == (passes.depth > 0)).mean() > 0.995
        np.testing.assert_allclose(passes.mask, whole.mask, atol=0.1)
        both = seen & (passes.depth > 0)
        near = np.abs(passes.depth - whole.depth)[both] < 2 * particles.radius.max()
        assert near.mean() > 0.99
        for name in ("yarn", "part"):
            same = (getattr(passes, name) == getattr(whole, name))[both]
            assert same.mean() > 0.985, name


@pytest.mark.slow
def test_a_mesh_lies_in_the_passes_of_windows(model: FabricModel, camera: Camera) -> None:
    """A square that stands in the cloth: where it is nearer its depth, normal and part are those of one picture."""
    particles = model.panels()[0].particles
    low, high = particles.position.min(axis=0), particles.position.max(axis=0)
    middle, x = (low + high) / 2, (high - low)[0] / 3
    corners = middle + x * np.array([[-1, -1, 0.2], [1, -1, -0.2], [1, 1, -0.2], [-1, 1, 0.2]])
    square = Mesh(corners, [[0, 1, 2], [0, 2, 3]], (0.5, 0.5, 0.5), part=7)
    splatter = Splatter(*SIZE).load(particles, square)
    backdrop = paint(camera, mesh=square)
    splatter.render(camera, backdrop=backdrop)
    whole = render_passes(splatter, camera, particles, backdrop=backdrop, mesh=square)
    source = FabricStream(model.fabric, model.points, target=0)
    _, passes = stream_passes(splatter, camera, source, most=20_000, backdrop=backdrop, mesh=square)
    assert whole.part is not None
    assert passes.part is not None
    there = whole.part == 7
    assert 0.02 < there.mean() < 0.5
    assert ((passes.part == 7) == there).mean() > 0.999
    for name in ("depth", "normal", "mask"):
        near = np.isclose(getattr(passes, name)[there], getattr(whole, name)[there], atol=2e-3)
        assert near.mean() > 0.999, name  # depths are rounded otherwise in a window, so fibres may change places


def test_memory_is_bounded_by_the_batch(model: FabricModel, camera: Camera) -> None:
    source = FabricStream(model.fabric, model.points, target=0)
    _, stats = stream(Splatter(*SIZE), camera, source, most=20_000)
    assert stats.particles > 80_000
    assert source.allocated <= 2 * 20_000 * ROWS * 4 + ROWS * LANES * 4


def test_same_bytes_for_any_number_of_chunks(model: FabricModel, camera: Camera) -> None:
    images = set()
    for chunks in (1, 2, 3):
        source = FabricStream(model.fabric, model.points, chunks=chunks)
        images.add(stream(Splatter(*SIZE, chunks=chunks), camera, source, most=30_000)[0].tobytes())
    assert len(images) == 1


def test_out_of_view_is_never_made_and_nothing_is_missed(model: FabricModel, particles: Particles) -> None:
    camera = frame(model.points[8:12, 10:14].reshape(-1, 3), width=SIZE[0], height=SIZE[1], elevation=35, margin=0)
    splatter = Splatter(*SIZE).load(particles)
    whole = splatter.render(camera)
    source = FabricStream(model.fabric, model.points, target=0)
    image, stats = stream(splatter, camera, source)
    assert stats.pieces < 0.75 * len(model.fabric.layout.blocks.kind)
    assert psnr(whole, image) > 55
    behind = replace(camera, rotation=np.diag([1.0, -1, -1]) @ camera.rotation, translation=-camera.translation)
    assert stream(splatter, behind, source)[1].particles < 0.05 * len(particles)


SMALL = ["weave.ends=24", "weave.picks=20", "yarn.fibres=8", "fabric.steps=8"]
HALF_SETT = ["weave.ends=56", "weave.picks=56", "yarn.fibres=4"]
FEW = 0.5
"""A target for small fabrics that thins them as far as `thinned_to` thins one of five million particles."""
SLOW = [
    pytest.param((name, overrides, target), marks=pytest.mark.slow)
    for name, overrides, target in (
        ("plain", SMALL, FEW),
        ("satin", SMALL, FEW),
        ("twill", SMALL, FEW),
        ("herringbone", SMALL, FEW),
        ("swatch", [], None),
        ("tartan", [], None),
    )
]


@pytest.fixture(
    scope="module",
    params=[("swatch", SMALL, FEW), ("tartan", HALF_SETT, None), *SLOW],
    ids=lambda p: f"{p[0]}{'' if p[1] else '-whole'}",
)
def fitted(request: pytest.FixtureRequest) -> tuple[FabricModel, float, Gains]:
    name, overrides, target = request.param
    built = build(load_scene(name, overrides))
    assert isinstance(built, FabricModel)
    target = thinned_to(built.fabric.particles) if target is None else target
    return built, target, fit_gains(built.fabric, built.points, target=target)


@pytest.mark.parametrize("elevation", [20, 40, 60, 90])
def test_brightness_and_coverage_stay_from_a_pixel_down(
    fitted: tuple[FabricModel, float, Gains], elevation: float
) -> None:
    """Thinned against full detail: total coverage and each colour channel of the cloth within 2 %."""
    model, target, gains = fitted
    splatter = Splatter(*SIZE)
    full = FabricStream(model.fabric, model.points, target=0)
    thin = FabricStream(model.fabric, model.points, target=target, gains=gains)
    for pixels in (1.0, 0.5, 0.35, 0.25, 0.125, 0.0625):
        camera = seen_at(model.fabric, model.points, pixels, elevation=elevation)
        sums, made = [], []
        for source in (full, thin):
            _, stats = stream(splatter, camera, source, most=10**9)
            sums.append(splatter.linear().sum((0, 1), dtype=np.float64))
            made.append(stats.particles)
        assert sums[1] == pytest.approx(sums[0], rel=0.02)
        if pixels < 0.6 * target:
            assert made[1] < 1.5 * (pixels / target) ** 2 * FULL * made[0]


@pytest.mark.slow
def test_a_large_folded_cloth_stays_as_bright_and_covers_as_much() -> None:
    """Five million particles, gains measured on patches: coverage and luminance within 2 % wherever it is seen from."""
    built = build(load_scene("satin", ["weave.ends=128", "weave.picks=80"]))
    assert isinstance(built, FabricModel)
    fabric, points, splatter = built.fabric, built.points, Splatter(*SIZE)
    assert fabric.particles > scene_gains.MOST
    gains, target = fit_gains(fabric, points), thinned_to(fabric.particles)
    full, thin = FabricStream(fabric, points, target=0), FabricStream(fabric, points, target=target, gains=gains)
    for elevation in (20, 55, 90):
        for pixels in (0.25, 0.125, 0.0625):
            camera = seen_at(fabric, points, pixels, elevation=elevation)
            before, after = (colours_at(splatter, source, camera) for source in (full, thin))
            assert after[3] == pytest.approx(before[3], rel=0.02)
            assert after[:3] @ LUMINANCE == pytest.approx(before[:3] @ LUMINANCE, rel=0.02)


def test_small_cloths_are_thinned_less() -> None:
    """At 1/16 px no fewer than `LEAST` of a cloth's particles are drawn, and no more than 1/64 of a large cloth's."""
    assert thinned_to(LEAST) == pytest.approx(1 / 16)
    for particles in (2 * LEAST, 10 * LEAST, 64 * LEAST):
        assert particles * (1 / 16 / thinned_to(particles)) ** 2 == pytest.approx(LEAST)
    assert thinned_to(640 * LEAST) == 0.5


def test_gains_are_led_from_one_tilt_to_the_next() -> None:
    factor = np.arange(2 * 3 * 4, dtype=float).reshape(2, 3, 4)
    gains = Gains(np.array([0.4, 0.8]), factor)
    assert gains.at(0.1) == pytest.approx(factor[0])
    assert gains.at(0.5) == pytest.approx(0.75 * factor[0] + 0.25 * factor[1])
    assert gains.at(1.0) == pytest.approx(factor[1])
    assert Gains(np.ones(1), factor[:1]).at(0.3) == pytest.approx(factor[0])


def test_gains_are_measured_where_a_zoom_goes(model: FabricModel) -> None:
    """Up to the first level and elevation beyond its farthest view; a cloth's tilt is the same from near and far."""
    target = thinned_to(model.fabric.particles)
    stream_ = FabricStream(model.fabric, model.points, target=target)
    for elevation, elevations in ((80, 2), (50, 4), (5, len(scene_gains.ELEVATIONS))):
        for level, levels in ((0.5, 1), (2.5, 3)):
            camera = seen_at(model.fabric, model.points, target * 0.5 ** (level / 2), elevation=elevation)
            views = views_of(model.fabric, model.points, camera)
            assert views.elevations == scene_gains.ELEVATIONS[:elevations]
            assert views.levels == scene_gains.MEASURED[:levels]
        tilts = [
            stream_.survey(seen_at(model.fabric, model.points, pixels, elevation=elevation)).tilt  # pyright: ignore[reportArgumentType]
            for pixels in (1.0, 1 / 16)
        ]
        assert tilts[0] == pytest.approx(tilts[1], rel=1e-6)


def test_zoom_writes_its_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(scene_gains, "ELEVATIONS", (60.0,))
    monkeypatch.setattr(scene_gains, "MEASURED", (1, 4))
    monkeypatch.setattr(scene_gains, "CROSSINGS", 2)
    small = ["weave.ends=8", "weave.picks=8", "yarn.fibres=4", "fabric.steps=4", "output.frames=4"]
    view = View(build(load_scene("swatch", small)), (96, 64))
    folder = OutputFolder(tmp_path)
    sequence = Sequence.open(folder, "mark", 4, resume=False)
    sequence.begin()
    assert list(sequence.write(zoom(view, 4, sequence.missing()))) == [0, 1, 2, 3]
    assert Sequence.open(folder, "mark", 4, resume=True).missing() == []
    for frame_path in sequence.paths:
        image = cv2.imread(str(frame_path))
        assert image is not None
        assert image.std() > 1


@pytest.mark.parametrize(("ends", "samples"), [(8, 1), (16, 2)])
def test_a_zoom_begins_with_the_picture_that_a_still_shows(
    ends: int, samples: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(scene_gains, "CROSSINGS", 1)
    size = (240, 160) if samples == 1 else (60, 40)
    scene = load_scene("swatch", [f"weave.ends={ends}", "weave.picks=8", "yarn.fibres=5", "fabric.steps=4"])
    panel = build(scene).panels()[0]
    assert samples_of(panel, first_of(scene, size, panel.bounds)) == samples
    _, still = next(View(build(scene), size).turntable(1, [0]))
    _, first = next(zoom(View(build(scene), size), 4, [0]))
    assert np.abs(first.astype(int) - still).mean() < 0.2  # 0.9 and 1.3 where no normals lean


@pytest.mark.parametrize("pixels", [5.0, 40.0])
def test_numbers_of_parted_fibres_lie_on_the_colour_picture(model: FabricModel, pixels: float) -> None:
    """Warp red and weft green: what the numbers say of a pixel is what it looks like; at 40 px of a surface."""
    ends = model.points.shape[1]
    warp = np.arange(len(model.fabric.thread_colour)) < ends
    fabric = replace(model.fabric, thread_colour=np.stack([warp, ~warp, 0 * warp], axis=1).astype(np.float32))
    source = RefiningStream(fabric, model.points, np.ones((8, 8), np.float32))
    camera = replace(seen_at(fabric, model.points, pixels, fov=4), width=160, height=96, cx=80, cy=48)
    image, passes = stream_passes(Splatter(160, 96), camera, source, ("mask", "id"), most=200_000)
    assert passes.mask is not None
    assert passes.yarn is not None
    assert passes.part is not None
    there = passes.mask > 0.95
    assert there.mean() > 0.5
    assert (passes.part[there] == (passes.yarn[there] >= ends)).all()
    red = image[..., 0].astype(int) > image[..., 1]
    assert 0.2 < red[there].mean() < 0.8
    assert (red == (passes.part == 0))[there].mean() > 0.97
    assert ((passes.yarn >= 0) == (passes.part >= 0)).all()


@pytest.mark.slow
def test_the_camera_comes_nearer_by_the_same_factor(model: FabricModel) -> None:
    source = source_of(model)
    first = first_of(model.scene, SIZE, model.points)
    target = target_of(source)
    cameras, end = path(model.scene, first, source, target, 9), target[0]
    left = np.array([np.linalg.norm(c.eye - end) for c in cameras])
    assert (np.diff(left) < 0).all()
    near = np.array([c.near for c in cameras])
    assert near[1:] / near[:-1] == pytest.approx(near[1] / near[0])
    assert cameras[-1].project([end])[0, :2] == pytest.approx([SIZE[0] / 2, SIZE[1] / 2], abs=1e-3)


def test_a_cloth_that_begins_to_refine_looks_as_before(model: FabricModel) -> None:
    """Fibres in 8 pieces from crossing to crossing, and in 32 that have just begun to part: the cloth's own colours."""
    smooth = np.ones((8, 8), np.float32)
    plain, fine = FabricStream(model.fabric, model.points), RefiningStream(model.fabric, model.points, smooth)
    camera, splatter = seen_at(model.fabric, model.points, 3.55, fov=4), Splatter(*SIZE)
    before, after = (colours_at(splatter, source, camera) for source in (plain, fine))
    assert fine.survey(camera).pieces.shape[0] > 10_000  # pyright: ignore[reportArgumentType]
    assert after[3] == pytest.approx(before[3], rel=0.007)
    assert after[:3] == pytest.approx(before[:3], rel=0.013)


@pytest.mark.slow
def test_refining_keeps_coverage_and_brightness(model: FabricModel) -> None:
    skin = skin_of(contour("cotton", length_m=350e-6))
    assert np.sqrt(np.mean(skin**2)) == pytest.approx(1.0, abs=0.01)
    parted, surface = fit_near(model.fabric, model.points, skin)
    fine = RefiningStream(model.fabric, model.points, skin, parted_gain=parted, surface_gain=surface)
    plain, splatter = FabricStream(model.fabric, model.points), Splatter(*SIZE)
    for pixels in (3.0, 3.6, 3.8, 4.0, 4.7, 6.0, 9.0, 12.0, 20.0, 26.0, 34.0):
        cameras = list(crossings(model.fabric, model.points, pixels))
        before, after = (
            np.sum([colours_at(splatter, source, camera) for camera in cameras], axis=0) for source in (plain, fine)
        )
        assert after[3] == pytest.approx(before[3], rel=0.02)
        assert after[:3].sum() == pytest.approx(before[:3].sum(), rel=0.02)
        assert after[:3] == pytest.approx(before[:3], rel=0.025)
