"""A zoom into cloth on cells: where it goes, the skin of its fibres, finer light near by, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.detail.cell_stream import TARGET, CellStream
from taichi_cloth.detail.near_cells import NearCells
from taichi_cloth.detail.patches import FIRST_PICK, PATCH_ENDS, PATCH_PICKS
from taichi_cloth.detail.pieces import BEYOND, COVERED, FAMILY, MEETS, SKINNED, SURFACE
from taichi_cloth.fibre.contours import contour
from taichi_cloth.fibre.relief import skin_of
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES, OPENNESS, POSITION, RADIUS, ROWS
from taichi_cloth.render.data.blocks import ParticleBlocks
from taichi_cloth.render.data.camera import Camera, frame
from taichi_cloth.render.data.finish import finish_for
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.light.shade import Shading
from taichi_cloth.render.splat.mixed import mixed
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.picture.gains import colours_at
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.picture.zoom import require_threads, zoom
from taichi_cloth.scenes.picture.zoom_cells import _cell_at, _skin_gain
from taichi_cloth.scenes.picture.zoom_path import END_WIDTHS
from taichi_cloth.scenes.scene.load import load_scene

SMALL = ["cloth.width_m=0.08", "cloth.length_m=0.08", "cloth.columns=9", "cloth.rows=9", "forces.sphere.radius_m=0.02"]
SMALL += ["camera.box_m=[[-0.05,0.2,-0.05],[0.05,0.3,0.05]]", "output.frame=0", "fabric.steps=6", "fabric.variants=1"]


@pytest.fixture(scope="module")
def model() -> ClothModel:
    built = build(load_scene("drape", SMALL))
    assert isinstance(built, ClothModel)
    built.panels()  # lays the fibres
    return built


@pytest.fixture(scope="module")
def near(model: ClothModel) -> NearCells:
    assert isinstance(model.source, CellStream)
    model.source.target = TARGET
    return NearCells(model.source, skin_of(contour("cotton", length_m=100e-6)))


def above(near: NearCells, pixels: float, *, aside: float = 0.0) -> Camera:
    """From above, a fibre's mean radius as large as `pixels`."""
    points = near.cells.cloth.node[:, :3].astype(np.float64)
    camera = frame(points, width=160, height=96, elevation=90, fov=4)
    away = near.cells.cloth.bank.radius[0] * camera.focal / pixels
    place = points.mean(axis=0) + np.array([aside, 0.0, aside]) - camera.forward * away
    return replace(camera, translation=-camera.rotation @ place, near=1e-4)


def test_far_away_it_is_the_cloth_on_cells(near: NearCells) -> None:
    camera = above(near, 2.0)
    fine, plain = near.survey(camera), near.cells.survey(camera)
    assert not len(fine.pieces)
    assert (fine.counts == plain.counts).all()


def test_points_on_a_skin_grow_before_the_splats_that_they_cover(near: NearCells) -> None:
    """From nothing to all of their width; the splat goes when they cover it, so that none comes or goes at once."""
    widths = []
    for pixels in (0.9 * SURFACE[0], 1.2 * SURFACE[0], COVERED[0], 1.4 * COVERED[1]):
        camera = above(near, pixels)
        survey = near.survey(camera)
        mine = np.flatnonzero((survey.grid[:, 0] > 0) & (survey.pieces[:, RADIUS] > 0))
        assert len(mine) > 10
        number = len(survey.cells.counts) + mine
        particles, _ = near.lay(survey, number.astype(np.int32))
        last = np.cumsum(survey.counts[number]) - 1
        first = particles.shape[1] * particles.shape[2] - (-(-(last[-1] + 1) // LANES)) * LANES
        radius, pixels_each = particles[RADIUS].ravel()[first:], camera.focal / survey.depth[number]
        own = survey.pieces[mine, RADIUS]
        widths.append((own * pixels_each, radius[last - 1] * pixels_each, radius[last] / own))
    for size, of_point, of_splat in widths:
        grown = np.clip(np.log(size / SURFACE[0]) / np.log(COVERED[0] / SURFACE[0]), 0.0, 1.0)
        assert (of_point[grown < 0.1] < 0.3).all()
        assert not (grown >= 1.0).any() or of_point[grown >= 1.0].mean() > 1.0
        assert of_splat[size < COVERED[0]] == pytest.approx(1.0)
        assert of_splat[size > COVERED[1]] == pytest.approx(0.0)


def test_skins_of_neighbouring_blocks_meet(near: NearCells) -> None:
    """What a fibre's last piece in a block takes for the next one's first is where that is."""
    patch = near.cells.whole()
    two = np.stack([patch[len(patch) // 2]] * 2)
    two[:, [PATCH_PICKS, PATCH_ENDS]] = 1
    two[1, FIRST_PICK] += 1
    core = near._core[0]
    pieces = near._pieces(two).astype(np.float64)
    warp = pieces[(pieces[:, FAMILY] == 0) & (pieces[:, SKINNED] > 0)][: 2 * core]
    first, second = warp.reshape(2, -1, near.steps, pieces.shape[1])
    assert (first[:, -1, MEETS] > 0).all()
    assert (first[:, 1:-1, MEETS] == 0).all()
    place = slice(POSITION, POSITION + 3)
    assert first[:, -1, BEYOND : BEYOND + 3] == pytest.approx(second[:, 0, place], abs=1e-6)
    assert second[:, 0, BEYOND : BEYOND + 3] == pytest.approx(first[:, -1, place], abs=1e-6)
    straight = 2.0 * first[:, -1, place] - first[:, -2, place]
    assert np.abs(straight - second[:, 0, place]).max() > 2e-6  # which going straight on does not come to


@pytest.mark.slow
def test_skins_cover_as_much_and_are_as_bright_as_what_they_replace(
    near: NearCells, tmp_path_factory: pytest.TempPathFactory
) -> None:
    finish = replace(finish_for("cotton"), depth=0.5e-3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path_factory.mktemp("skin")))
        near.skins.gain = _skin_gain(near, finish)
    splatter, middle = Splatter(160, 96), near.cells.cloth.node[:, :3].mean(axis=0)
    splatter.load(ParticleBlocks(near.around(middle, 6e-3, 400_000)))
    lighting = Lighting(key_follows_camera=False, shadows=True, occlusion=True)
    splatter.light.hold(splatter.cast_light(above(near, 1.0), lighting), each=True)
    for pixels, within in ((1.4 * SURFACE[0], 0.08), (1.5 * SURFACE[1], 0.13)):  # round, then with all their relief
        looks = []
        for source in (near.cells, near):
            cameras = [above(near, pixels, aside=k * 0.3e-3) for k in range(4)]
            looks.append(sum(colours_at(splatter, source, c, lighting=lighting, finish=finish) for c in cameras))
        plain, fine = looks
        assert fine[3] == pytest.approx(plain[3], rel=0.02)
        assert fine[:3].sum() == pytest.approx(plain[:3].sum(), rel=within)
    assert (near.survey(above(near, 1.5 * SURFACE[1])).grid[:, 0] > 0).sum() > 20


def test_a_crown_is_the_outermost_of_what_lies_round_it(near: NearCells) -> None:
    """On either side; and the same cloth, cut out round it, lies within the cube that was asked for."""
    size, cell = 4e-3, int(near.cells.cloth.cells[27])
    for side in (1.0, -1.0):
        eye = np.array([0.0, side * 10.0, 0.0])
        place, normal = near.crown(cell, 0.5, 0.5, eye)
        assert normal[1] * side > 0.99
        everything = near.around(place, size, 10**7).reshape(ROWS, -1).T
        particles = everything[(everything[:, RADIUS] > 0) & (everything[:, OPENNESS] < 1.0)]
        away = particles[:, POSITION : POSITION + 3] - place
        assert len(particles) > 1000
        assert np.abs(away).max() < 0.5 * size + 1.5e-3
        close = np.linalg.norm(away, axis=1) < 0.25e-3
        assert (away[close] @ normal + particles[close, RADIUS]).max() < 10e-6
        hairs = everything[(everything[:, RADIUS] > 0) & (everything[:, OPENNESS] >= 1.0)]
        over = hairs[:, POSITION : POSITION + 3] - place
        over = over[over @ normal > 0.0]
        passing = np.linalg.norm(over - (over @ normal)[:, None] * normal, axis=1)
        assert len(over) > 100
        assert passing.min() > 4 * particles[:, RADIUS].mean()


def test_a_zoom_goes_where_it_is_told(model: ClothModel, near: NearCells) -> None:
    camera = frame(model.bounds, width=200, height=160, elevation=60)
    for aim in ((0.5, 0.5), (0.35, 0.6)):
        cell, u, v = _cell_at(near.cells.cloth, camera, aim, None)
        place, _ = near.crown(cell, u, v, camera.eye)
        assert camera.project([place])[0, :2] == pytest.approx((200 * aim[0], 160 * aim[1]), abs=3.0)


def test_light_told_from_near_by_has_the_mean_of_the_whole(near: NearCells) -> None:
    """Of maps of the whole and of 8 mm: none of these, half and half, and these alone, in the mean as before."""
    splatter, lighting, depth = Splatter(64, 64), Lighting(shadows=True, occlusion=True), 0.5e-3
    camera, maps = above(near, 0.5), []
    for sample in (near.cells.sample(50_000), near.around(near.cells.cloth.node[:, :3].mean(axis=0), 8e-3, 200_000)):
        splatter.light.hold(None)
        splatter.load(ParticleBlocks(sample))
        maps.append(splatter.cast_light(camera, lighting))
        blocks = sample
    at = mixed(maps[0], maps[1], blocks, depth)
    found = []
    for light in (maps[0].sky, at(1e-9).sky, at(0.5).sky, at(1.0).sky):
        assert light is not None
        out = np.ones((blocks.shape[1], Shading(bulk=True).of_sky, 16), np.float32)
        light.on_particles(blocks, out, 0, depth)
        found.append(out[:, :3].transpose(1, 0, 2)[:, blocks[RADIUS] > 0])
    whole, least, half, alone = found
    assert least == pytest.approx(whole, abs=1e-6)
    assert half == pytest.approx((whole + alone) / 2, abs=1e-5)
    assert alone.std() > 1.5 * whole.std()  # it tells fibres apart
    assert alone[1].mean() == pytest.approx(whole[1].mean(), rel=0.15)  # what the cloth sees; a fibre sees less of it
    assert alone[0].mean() < 0.8 * alone[1].mean()


@pytest.mark.slow
def test_a_sheet_is_zoomed_into_down_to_a_fibre(
    model: ClothModel, tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path))
    view, seen = View(model, (96, 64)), []
    draw = Splatter.render

    def watch(self: Splatter, camera: Camera, **options: object) -> np.ndarray:
        seen.append(camera)
        return draw(self, camera, **options)  # pyright: ignore[reportArgumentType]

    images = [image for _, image in zoom(view, 5, [0])]
    monkeypatch.setattr(Splatter, "render", watch)
    images += [image for _, image in zoom(view, 5, [4])]
    height = 64 / seen[-1].focal * np.linalg.norm(seen[-1].eye)
    diameter = model.fibres.prepared.layout.warp.yarn.fibre_diameter  # pyright: ignore[reportOptionalMemberAccess]
    assert height == pytest.approx(END_WIDTHS * diameter, rel=0.01)
    assert images[0].std() > 5
    assert images[1].std() > 1


@pytest.mark.parametrize(
    ("scene", "changes", "words"),
    [
        ("yarn", [], "no \\[weave\\]"),
        ("drape", ["cloth.representation=mesh"], "drawn as a mesh.*set cloth.representation"),
        ("scenes/paper/drape.toml", [], "no sett.*fabric.ends_per_cm"),
    ],
)
def test_what_has_no_threads_to_come_near_to_is_refused(scene: str, changes: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        require_threads(load_scene(scene, changes), scene)
