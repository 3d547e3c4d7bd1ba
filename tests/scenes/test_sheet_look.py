"""A cloth far away, drawn as a sheet: it covers as much and is as bright as its fibres, at any samples a pixel, and
each stripe has its colour from far and near."""

from dataclasses import replace
from math import asin, degrees

import numpy as np
import pytest

from taichi_cloth.detail.cell_stream import TARGET, CellStream
from taichi_cloth.detail.surfels import OPEN_WARP, OPEN_WEFT, WARP, WEFT
from taichi_cloth.fabric.cell_blocks import OPENED
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.mixing import ASLANT, DARKER, EVEN, LESS_ABOVE, WHITE, sent_back
from taichi_cloth.ground.particles import COLOUR, NORMAL, OPENNESS, RADIUS, ROWS, TANGENT
from taichi_cloth.render.data.camera import frame
from taichi_cloth.render.data.finish import Finish, finish_for
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.splat.stream import stream
from taichi_cloth.scenes.models.cell_fibres import sheet_fibres
from taichi_cloth.scenes.picture import sheet_look
from taichi_cloth.scenes.picture.few_fibres import sight_of
from taichi_cloth.scenes.picture.flat_light import FlatLight
from taichi_cloth.scenes.picture.flat_piece import SIZE, Sight, flat_camera, flat_piece, tilted_camera
from taichi_cloth.scenes.picture.sheet_look import FIBRES, SHEETS, SKY, fit_look, seen_light
from taichi_cloth.scenes.prepare.cell_layout import prepare_sheet
from taichi_cloth.scenes.prepare.sett import on_cells
from taichi_cloth.scenes.scene.load import load_scene

WITHIN = 0.02


@pytest.fixture(scope="module")
def finish() -> Finish:
    return replace(finish_for("cotton"), depth=0.5e-3)


@pytest.fixture(scope="module")
def source(finish: Finish, tmp_path_factory: pytest.TempPathFactory) -> CellStream:
    white = ["weave.warp_colours=white", "weave.weft_colours=white"]
    scene = on_cells(load_scene("drape", ["cloth.width_m=0.1", "cloth.length_m=0.1", "weave.draft=twill-2/1", *white]))
    prepared = prepare_sheet(scene)
    assert prepared is not None
    made = sheet_fibres(scene, prepared).source
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("look")
        patch.setenv("TAICHI_CLOTH_CACHE", str(folder))
        made.look = fit_look(made, finish)
        kept = made.look
        assert len(list(folder.glob("sheet-*.npz"))) == 1
        patch.setattr(sheet_look, "Splatter", None)  # found on disk: nothing is drawn
        assert (fit_look(made, finish).factor == kept.factor).all()
    return made


def looks(source: CellStream, finish: Finish, tilt: float, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coverage, and light of lights and of a sky, of fibres, of a sheet, and of a sheet at 4 × 4 samples a pixel."""
    elevation, out = degrees(asin(tilt)) * (1 - 2 * side), []
    fibres, sheet = (flat_piece(source.cloth, 0, n, source.pitch) for n in (FIBRES, SHEETS[0]))
    fibres.sheets, fibres.look, sheet.look = False, source.look, source.look
    fibres.level = source.cloth.bank.levels - 1
    sight = sight_of(source.cloth, fibres.level, source.pitch)
    near = sight._replace(pixels=sight.pixels * tilt**-0.33)
    for one, seen, samples in ((fibres, near, 1), (sheet, SHEETS[1], 1), (sheet, SHEETS[1], 4)):
        one.target = TARGET * samples
        camera, where = flat_camera(one, elevation, seen)
        finer = {name: samples * getattr(camera, name) for name in ("focal", "cx", "cy", "width", "height")}
        splatter = Splatter(samples * seen.size[0], samples * seen.size[1])
        light = seen_light(splatter, one, replace(camera, **finer), np.kron(where, np.ones((samples,) * 2)) > 0, finish)
        out.append(np.array([light[0], light[1:3].sum() + SKY * light[3:].sum(), light[3:].sum()]))
    return out[0], out[1], out[2]


@pytest.mark.parametrize(("tilt", "side"), [(0.9, 0), (0.4, 0), (0.9, 1)])
def test_few_thick_fibres_cover_as_much_and_are_as_bright_as_all(
    source: CellStream, finish: Finish, tilt: float, side: int
) -> None:
    """Of every level, from where it is drawn, beside all from near: the mean over lights, by warp and by weft; without
    `few` they cover 0.02 less and are up to 1.05 times as bright."""
    piece, found = flat_piece(source.cloth, 0, 20, source.pitch), []
    piece.sheets, piece.look = False, source.look
    for piece.level in range(source.cloth.bank.levels):
        sight = sight_of(source.cloth, piece.level, source.pitch)
        light = seen_light(Splatter(*sight.size), piece, *tilted_camera(piece, tilt, side, sight), finish)
        found.append((light[0], (light[1:3].sum() + SKY * light[3:].sum()) / light[0], light[1] / light[1:3].sum()))
    for covered, bright, by_warp in found[1:]:
        assert covered == pytest.approx(found[0][0], abs=0.01)
        assert bright == pytest.approx(found[0][1], rel=0.035)
        assert by_warp == pytest.approx(found[0][2], abs=0.015)


@pytest.mark.parametrize("tilt", [0.9, 0.5])
def test_cloth_is_as_bright_from_any_distance(source: CellStream, finish: Finish, tilt: float) -> None:
    """From where it is a sheet to where all fibres are drawn, as wide as a pixel: matched to all of them as they look
    from afar, where open fibres are too thin to hide those that they shade, it was a tenth darker."""
    found = []
    for pixels in (0.8, 1.6, 2.5, 5.0, 12.0, 25.0):
        piece = flat_piece(source.cloth, 0, min(max(20, round(120 / pixels)), 150), source.pitch)
        piece.look, sight = source.look, Sight(pixels, (128, 96) if pixels < 5 else SIZE)
        light = seen_light(Splatter(*sight.size), piece, *tilted_camera(piece, tilt, 0, sight), finish)
        found.append((light[0], (light[1:3].sum() + SKY * light[3:].sum()) / light[0]))
    covered, bright = np.array(found).T
    assert covered == pytest.approx(covered[-1], abs=0.025)
    assert bright == pytest.approx(bright[-1], rel=0.03)


def test_few_fibres_are_made_wider_and_their_hairs_are_not(source: CellStream) -> None:
    piece, radii = flat_piece(source.cloth, 0, 4, source.pitch), []
    for wide in (1.0, 1.3):
        few = source.look.few.copy()
        few[..., 0] = wide
        piece.look = replace(source.look, few=few)
        rows = piece.sample(np.inf, level=1).reshape(ROWS, -1)
        radii.append(rows[RADIUS])
    hair = rows[OPENNESS] >= 1.0
    assert hair.any()
    assert radii[1] == pytest.approx(np.where(hair, 1.0, 1.3) * radii[0], rel=1e-5)


@pytest.mark.parametrize(("tilt", "side"), [(1.0, 0), (0.8, 1), (0.5, 0), (0.3, 0)])
def test_a_sheet_covers_as_much_and_is_as_bright_as_its_fibres(
    source: CellStream, finish: Finish, tilt: float, side: int
) -> None:
    fibres, sheet, finer = looks(source, finish, tilt, side)
    assert sheet[:2] == pytest.approx(fibres[:2], rel=WITHIN)
    assert finer[:2] == pytest.approx(sheet[:2], rel=WITHIN)
    assert sheet[2] == pytest.approx(fibres[2], rel=2 * WITHIN)


@pytest.mark.parametrize("tilt", [1.0, 0.65])
def test_a_sheet_sends_back_what_a_mesh_of_the_same_cloth_does(source: CellStream, finish: Finish, tilt: float) -> None:
    """Of lights at 90 and 37 degrees, 0.3 and 5 x 0.2, and of the sky before it: r(1) of a white one, by Lambert's law
    and by `under_sky`, as the path tracer's pictures have."""
    sheet = flat_piece(source.cloth, 0, SHEETS[0], source.pitch, probe=((1.0, 0.0, 1.0), (0.0, 1.0, 1.0)))
    sheet.look = source.look
    camera, where = flat_camera(sheet, degrees(asin(tilt)), SHEETS[1])
    cover, *of_lights, warp, weft = seen_light(Splatter(*SIZE), sheet, camera, where, finish)
    assert sum(of_lights) / cover == pytest.approx(sent_back(1.0) * (0.3 + 5 * 0.2 * 0.6), rel=0.1)
    of_sky = EVEN - LESS_ABOVE[0] * (tilt - ASLANT)
    assert (warp + weft) / cover == pytest.approx(sent_back(1.0) * of_sky, rel=0.1)


def test_between_the_angles_at_which_it_is_measured_it_is_not_far_off(source: CellStream, finish: Finish) -> None:
    fibres, sheet, _ = looks(source, finish, 0.73, 0)
    assert sheet[0] == pytest.approx(fibres[0], rel=WITHIN)
    assert sheet[1] == pytest.approx(fibres[1], rel=2 * WITHIN)


def test_the_warp_shows_where_it_floats(source: CellStream) -> None:
    """2/1 twill: on its right side two thirds of what is seen are warp, on the wrong side a third."""
    right, wrong = source.look.factor[0, :, -1]
    assert 1.5 < right[WARP] / right[WEFT] < 3.5
    assert 1.5 < wrong[WEFT] / wrong[WARP] < 3.5


STRIPE = 20
ALONE = np.array([[0.76, 0.69, 0.73, 0.79]], np.float32)
"""What warp and weft send back among black threads, over what they do among their like, about as of denim."""
DYED = np.array([[0.62, 0.05, 0.04], [0.85, 0.83, 0.78], [0.03, 0.07, 0.40]])


def test_each_stripe_has_its_colour_from_far_and_near(source: CellStream, finish: Finish) -> None:
    """Stripes of red, white and blue ends, white picks: seen as a sheet, as thick fibres and as all of them, each has
    the same colour, in one light for all of them."""
    dyed = np.repeat(DYED, STRIPE, axis=0)
    colours = np.concatenate([dyed, DYED[-1:], np.repeat(DYED[1:2], 3 * STRIPE + 1, axis=0)])
    piece = flat_piece(source.cloth, 0, 3 * STRIPE, source.pitch, colours)
    piece.look = replace(source.look, alone=ALONE)
    points = piece.cloth.node[:, :3].astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    base = frame(points, width=160, height=96, elevation=90.0, fov=4)
    splatter, seen = Splatter(160, 96), []
    splatter.light.hold(FlatLight(1.0, 1), each=True)
    lighting = Lighting(key_follows_camera=False, shadows=True, occlusion=True)
    for pixels in (0.7, 4.0, 12.0):
        away = float(np.sqrt(source.pitch[0] * source.pitch[1])) * base.focal / pixels
        wide, high_up = (round(min(pixels * 0.3 * STRIPE, half)) for half in (80, 48))
        window = np.s_[48 - high_up : 48 + high_up, 80 - wide : 80 + wide]
        stripes = []
        for k in range(3):
            at = (low + high) / 2
            at[0] = low[0] + (k + 0.5) * STRIPE * source.pitch[0]
            camera = replace(base, translation=-base.rotation @ (at - base.forward * away), near=1e-4)
            stream(splatter, camera, piece, most=10**9, lighting=lighting, finish=finish)
            picture = splatter.linear()[window].sum(axis=(0, 1), dtype=np.float64)
            stripes.append(picture[:3] / picture[3])
        seen.append(np.array(stripes))
    for one in seen[1:]:
        assert one / one[1].mean() == pytest.approx(seen[0] / seen[0][1].mean(), rel=0.065, abs=0.004)


def test_threads_have_less_light_beside_darker_ones_and_more_beside_paler(source: CellStream) -> None:
    """Indigo ends over white picks: of white among black as much is left as it sends back alone; like among like is as
    it was, and so is a look of which nothing was measured."""
    count, pale, dark = 21, 1.0, 0.05

    def laid(warp: float, weft: float, alone: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean colour of warp and of weft on the right side."""
        colours = np.repeat([[warp] * 3, [weft] * 3], count, axis=0)
        piece = flat_piece(source.cloth, 0, 20, source.pitch, colours)
        piece.look = replace(source.look, alone=alone)
        rows = piece.sample(1e9, level=0).reshape(ROWS, -1)  # of all fibres each goes as its thread does
        rows = rows[:, (rows[RADIUS] > 0) & (rows[NORMAL + 1] > 0.05)]
        thread = rows[TANGENT] ** 2 > rows[TANGENT + 2] ** 2
        return sent_back(rows[COLOUR, ~thread]).mean(), sent_back(rows[COLOUR, thread]).mean()

    assert laid(pale, dark, np.ones((1, 4), np.float32)) != laid(pale, dark, ALONE)
    for one in (pale, dark):
        unlike_by_chance = 1e-3
        alike = laid(one, one, np.ones((1, 4), np.float32))
        assert laid(one, one, ALONE) == pytest.approx(alike, rel=unlike_by_chance)
    alike, mixed = laid(pale, pale, ALONE), laid(dark, pale, ALONE)
    lost = (1 - ALONE[0, 1]) * (1 - sent_back(dark) / sent_back(1.0))
    assert mixed[1] / alike[1] == pytest.approx(1 - lost, rel=0.02)
    assert mixed[0] > laid(dark, dark, ALONE)[0]


def test_a_sheet_of_black_and_white_is_less_open_than_one_of_their_mean(source: CellStream) -> None:
    """Dark cloth sends back more of a sky than of lights; of a mixture each family does so as its own colour does."""

    def opened(warp: float, weft: float) -> np.ndarray:
        sheet = flat_piece(source.cloth, 0, SHEETS[0], source.pitch, probe=((warp,) * 3, (weft,) * 3))
        factor = source.look.factor.copy()
        factor[..., [WARP, WEFT]], factor[..., [OPEN_WARP, OPEN_WEFT]] = 0.5, 0.8
        sheet.look = replace(source.look, factor=factor)
        camera, _ = flat_camera(sheet, 90.0, SHEETS[1])
        seen = sheet.survey(camera)
        blocks, *_ = sheet.lay(seen, np.flatnonzero(seen.counts).astype(np.int32))
        rows = np.asarray(fetched(blocks)).reshape(len(blocks), -1)
        return rows[OPENNESS, rows[RADIUS] > 0]

    assert opened(0.9, 0.9) == pytest.approx(0.8, rel=1e-3)
    each = sent_back(np.array([0.05, 0.9]))
    of_sky, of_mean = (EVEN + DARKER * (1 - r / WHITE) for r in (each, each.mean()))
    under = (each * of_sky).mean() / (each.mean() * of_mean)
    assert under < 0.95
    assert np.median(opened(0.05, 0.9)) == pytest.approx(0.8 * under**OPENED, rel=0.01)


@pytest.mark.slow
def test_of_denim_the_weft_is_the_darker_for_the_warp(finish: Finish) -> None:
    """Of a twill's right side the weft lies under the warp's floats, so that more of it owes its light to them: see
    docs/appearance.md for the path tracer's picture of it."""
    of = ["yarn.count='Ne 7'", "weft_yarn.count='Ne 6'", "weave.draft=twill-3/1", "fabric.flattening=1.1"]
    of += ["yarn.twist_multiplier=4.2", "weft_yarn.twist_multiplier=4.2"]
    of += ["fabric.ends_per_cm=25.2", "fabric.picks_per_cm=15.75", "cloth.width_m=0.1", "cloth.length_m=0.1"]
    scene = on_cells(load_scene("drape", of))
    prepared = prepare_sheet(scene)
    assert prepared is not None
    cloth = sheet_fibres(scene, prepared).source
    warp, weft, *_ = sheet_look._alone(cloth.cloth, 0, cloth.pitch, finish)
    assert 0.5 < weft < warp < 0.9
    look = replace(cloth.look, alone=np.array([[warp, weft, 1.0, 1.0]], np.float32))
    opened = sheet_look._opened(cloth.cloth, 0, cloth.pitch, look, finish)[0, 2:]
    before = look.factor[0, 0, 2:]
    assert (opened[:, OPEN_WEFT] < 0.8 * opened[:, OPEN_WARP]).all()  # it sees less of the sky
    share = before[:, WEFT] / (before[:, WARP] + before[:, WEFT])
    of_one_colour = (1 - share) * opened[:, OPEN_WARP] + share * opened[:, OPEN_WEFT]
    assert of_one_colour == pytest.approx(before[:, OPEN_WARP], rel=0.02)


def test_a_family_that_is_hardly_seen_from_one_side_has_a_look_from_the_next_angle_on() -> None:
    """Of what a mixture has of one as much is lost as its dark is: where nothing of it is seen, no factor follows."""

    def seen(now: np.ndarray) -> np.ndarray:
        lights = np.maximum(now[1:3] - [0.1, 0.02], 0.0)
        return np.array([1 - np.exp(-now[0]), *lights, *(now[3] * lights)])

    now = np.array([1.0, 0.7, 0.25, 0.8, 0.8])
    for weft in (0.0, 0.03, 0.05, 0.15):
        want = seen(np.array([2.0, 0.8, weft, 0.6, 0.6]))
        now = sheet_look._solved(seen, want, now)
        assert seen(now) == pytest.approx(want, abs=0.01)
