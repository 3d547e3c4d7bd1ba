"""Light that goes from fibre to fibre: no more of it than there is, more of it in lighter cloth, some through cloth."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.mixing import SURFACE_SHARE, WHITE, sent_back
from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.finish import FINISHES, Finish
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.light.bulk import (
    ALONG,
    FITTED_SPREAD,
    FORWARD,
    GRAZED,
    OF_KEY,
    OF_SKY,
    ONCE,
    THROUGH_ALONE,
    cone,
)
from taichi_cloth.render.splat.splat import Splatter

APART, THREADS, LAYERS = 1e-3, 60, 8
EVEN = (1.0, 1.0, 1.0)
DULL = Finish(
    model="marschner", depth=LAYERS * APART, sheen=0.0, roundness=0.0, reflect=0.0, transmit=0.1, internal=0.09
)
ALBEDOS = np.linspace(0.0, 1.0, 51)


def of(weights: tuple[tuple[float, ...], ...]) -> np.ndarray:
    """Weights at `ALBEDOS`, (weights, albedos)."""
    powers = np.stack([ALBEDOS**power for power in (0.0, 0.5, 1.0, 2.0, 3.0)])
    return np.array(weights) @ powers


def sheet(height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Places and albedos of a layer of threads side by side, in three strips: dark, middle and white."""
    at = (np.arange(THREADS) - (THREADS - 1) / 2) * APART
    x, z = np.meshgrid(at, at)
    albedo = np.repeat([0.05, 0.4, 1.0], THREADS // 3)
    place = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], 1)
    return place, np.repeat(np.tile(albedo, THREADS)[:, None], 3, axis=1)


def seen(lighting: Lighting, finish: Finish = DULL, *, under: bool = False) -> np.ndarray:
    """Mean light of the three strips of a sheet, from above; under: another one 60 mm below it."""
    layers = [sheet(h - k * APART) for h in ((0.0, -0.06) if under else (0.0,)) for k in range(LAYERS)]
    place, colour = (np.concatenate(parts) for parts in zip(*layers, strict=True))
    threads = Particles(place, 0.9 * APART, colour, (1, 0, 0), (0, 1, 0), half_length=1.6 * APART, openness=1.0)
    camera = look_at((0, 0.4, 0), (0, 0, 0), up=(0, 0, -1), width=48, height=48, fov=8)
    splatter = Splatter(48, 48).load(threads)
    splatter.render(camera, lighting=lighting, finish=finish)
    rgba = splatter.linear()[8:-8]
    assert rgba[..., 3].min() > 0.95
    return np.array([(part[..., 0] / part[..., 3]).mean() for part in (rgba[:, 2:13], rgba[:, 18:30], rgba[:, 35:46])])


def lights(*, key: float = 0.0, fill: float = 0.0, towards: tuple[float, float, float] = (0.2, 1.0, 0.1)) -> Lighting:
    return Lighting(
        direction=towards, key=key, fill=fill, key_colour=EVEN, sky=EVEN, ground=EVEN, key_follows_camera=False,
        shadows=True, occlusion=True, size=0.0,
    )  # fmt: skip


def test_no_light_is_made_and_lighter_cloth_sends_more_on() -> None:
    before, before_open, behind, behind_shut = of(OF_SKY)
    for seen in np.linspace(0, 1, 5):  # in a cloth of any depth
        whole = before + seen * before_open + behind + (1 - seen) * behind_shut
        assert (np.diff(whole) > 0).all()
        assert 0.95 < whole[-1] <= 1.0
    for weights in (of(OF_SKY), of(OF_KEY), of((ONCE, GRAZED, FORWARD, THROUGH_ALONE))):
        assert (weights >= 0).all()
        assert (np.diff(weights, axis=1) >= -1e-12).all()
    (ahead,) = of((ONCE,))  # straight on, where nothing is in the way
    assert (np.diff(ahead) > 0).all()


def test_white_cloth_under_an_even_sky_is_nearly_as_bright_as_the_sky() -> None:
    """A furnace: all light that falls on white goes on, and no more."""
    dark, middle, white = seen(lights(fill=1.0))
    assert 0.93 < white <= 1.0
    assert dark < middle < white


def test_threads_among_black_ones_lack_what_those_of_their_colour_would_send_them() -> None:
    """Less so the darker they are, and nothing of what falls on them straight."""
    for lighting in (lights(fill=1.0), lights(key=1.0)):
        among = seen(lighting, replace(DULL, alone=1.0)) / seen(lighting)
        assert 0.2 < among[2] < among[1] < among[0] <= 1.0


def test_shine_makes_no_light_of_the_sky() -> None:
    white = seen(
        lights(fill=1.0),
        Finish(**{**vars(FINISHES["silk"]), "model": "marschner", "depth": LAYERS * APART, "roundness": 0.0}),
    )[2]
    assert 0.9 < white <= 1.0


def test_a_light_in_front_is_sent_back_and_one_behind_shines_through() -> None:
    front, back = seen(lights(key=1.0)), seen(lights(key=1.0, towards=(0.2, -1.0, 0.1)))
    assert (np.diff(front) > 0).all()
    assert (np.diff(back) > 0).all()
    assert (back < front).all()
    # From near the cone of the threads' highlights white may be brighter than paper; from all sides, each light as
    # bright on the sheet, it is not.
    tilts = [(np.tan(angle) * x, np.tan(angle) * z) for angle in np.radians((30, 60)) for x, z in ((1, 0), (0, 1))]
    sent = [seen(lights(key=1.0, towards=(x, 1.0, z)))[2] * np.sqrt(1 + x * x + z * z) for x, z in tilts]
    assert np.mean(sent) < 1.0
    assert front[2] < 1.1
    assert back[2] > 0.09  # of a flat cloth; a woven one sends more on, most of it from between its threads
    hidden = seen(lights(key=1.0, towards=(0.2, -1.0, 0.1)), under=True)
    assert hidden[1] < 0.1 * back[1]


def test_threads_side_by_side_are_mixed_by_the_light_they_send_back() -> None:
    assert sent_back(0.0) == sent_back(SURFACE_SHARE)  # no cloth is darker
    traced = {0.06: 0.0444, 0.109: 0.0846, 0.6: 0.464, 0.95: 0.595}  # a sky, and a key at 45°, their mean
    for colour, share in traced.items():
        assert sent_back(colour) == pytest.approx(share, rel=0.06)
    assert sent_back(1.0) == pytest.approx(WHITE)
    assert (sent_back(0.0) + sent_back(1.0)) / 2 < sent_back(0.5)


def test_fibres_with_narrow_highlights_send_on_as_much_light_nearer_to_their_cone() -> None:
    assert cone(FITTED_SPREAD) == pytest.approx((ALONG, 1.0))
    x = (np.arange(800) + 0.5) / 400 - 1  # sines of directions to the normal plane, which are even over the sphere
    flux = np.sqrt(1 - x * x)

    def sent_on(spread: float) -> float:
        sharpness, height = cone(spread)
        return float(height * flux @ np.exp(-sharpness * (x[:, None] + x) ** 2) @ flux)

    for spread in (3.0, 5.0, 20.0):
        assert sent_on(spread) == pytest.approx(sent_on(FITTED_SPREAD), rel=1e-3)
    assert cone(3.0)[1] > 2.0 > cone(6.0)[1] > 1.0 > cone(20.0)[1]
