"""The splatter's own knobs: the picture against a converged one."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ...render.data.particles import Particles
from ...render.splat.splat import Splatter
from ..measure.picture import Swatch, difference, shown
from ..measure.study import Axis, Row, Study, cpu_seconds

__all__ = ["STUDY", "rows"]

SIZE = (360, 240)
PER_PARTICLE = ("radius", "colour", "tangent", "normal", "half_length", "openness")
FINEST = 8  # samples a pixel each way
USUAL_OPAQUE = 1 / 255
OPAQUE = (1 / 8, 1 / 32, 1 / 64, USUAL_OPAQUE, 1 / 1024, 1 / 4096)
MAPS = (32, 64, 128, 256, 512)  # texels
FINEST_MAP = 2048
LAYERS, APART, NEAR = 4, 2e-3, 6.0
"""Swatches behind one another, their distance [m], and how much nearer than all of it: no tile sees past them all."""


def rows(quick: bool) -> Iterator[Row]:
    swatch = Swatch(*(["yarn.fibres=6"] if quick else []))
    runs = 1 if quick else 3
    yield from _samples(swatch, 4 if quick else FINEST, runs)
    yield from _opaque(swatch, (*OPAQUE[::2], USUAL_OPAQUE) if quick else OPAQUE, runs)
    yield from _maps(swatch, MAPS[::2] if quick else MAPS, runs)


def _samples(swatch: Swatch, finest: int, runs: int) -> Iterator[Row]:
    """Samples a pixel; `still` takes 2 each way."""

    def drawn(by: int, runs: int = 0) -> tuple[NDArray[np.float64], float]:
        size = by * SIZE[0], by * SIZE[1]
        splatter = Splatter(*size)
        draw = swatch.drawing(splatter, swatch.camera(size))
        draw()
        return shown(splatter, by), cpu_seconds(draw, runs) if runs else 0.0

    truth, _ = drawn(finest)
    for by in (n for n in (1, 2, 4) if n < finest):
        found, cost = drawn(by, runs)
        yield Row(
            panel="samples a pixel",
            method="supersampling",
            knob=f"{by} × {by}",
            value=1 / by,
            error=difference(found, truth),
            seconds=cost,
            default=by == 2,
        )


def _opaque(swatch: Swatch, shares: tuple[float, ...], runs: int) -> Iterator[Row]:
    """Light that may still pass through a tile that is finished; 0 draws everything. In a pile of layers."""
    camera = swatch.camera(SIZE, NEAR)
    one = swatch.particles
    deeper = [one.position + k * APART * camera.forward.astype(np.float32) for k in range(LAYERS)]
    parts = {f: np.concatenate([getattr(one, f)] * LAYERS) for f in PER_PARTICLE}
    pile = Particles(position=np.concatenate(deeper), **parts)
    light = swatch.lighting.without_maps()  # the same for all, and would hide what this saves

    def drawn(share: float) -> tuple[NDArray[np.float64], Callable[[], object]]:
        splatter = Splatter(*SIZE, opaque=share).load(pile)
        splatter.render(camera, lighting=light, finish=swatch.finish)
        return shown(splatter), lambda: splatter.render(camera, lighting=light, finish=swatch.finish)

    truth, _ = drawn(0.0)
    for share in shares:
        found, draw = drawn(share)
        yield Row(
            panel="when a tile is finished",
            method=f"light left, {LAYERS} layers, unshadowed",
            knob=f"1/{round(1 / share)}",
            value=share,
            error=difference(found, truth),
            seconds=cpu_seconds(draw, runs),
            default=share == USUAL_OPAQUE,
        )


def _maps(swatch: Swatch, resolutions: tuple[int, ...], runs: int) -> Iterator[Row]:
    """Texels along a shadow map. Its texels are no smaller than particles."""
    camera, splatter = swatch.camera(SIZE), Splatter(*SIZE)

    def lit(resolution: int) -> None:
        splatter.load(swatch.particles)
        splatter.light.hold(None)
        splatter.light.hold(splatter.cast_light(camera, swatch.lighting, resolution=resolution))
        splatter.render(camera, lighting=swatch.lighting, finish=swatch.finish)

    lit(FINEST_MAP)
    truth = shown(splatter)
    for resolution in resolutions:
        cost = cpu_seconds(lambda resolution=resolution: lit(resolution), runs)
        yield Row(
            panel="shadow map",
            method="texels along a side",
            knob=f"{resolution}",
            value=1 / resolution,
            error=difference(shown(splatter), truth),
            seconds=cost,
            default=resolution == 512,
        )


STUDY = Study(
    name="splat",
    title="Splatter: its own knobs",
    about=f"The swatch with 24 ends and 18 picks at {SIZE[0]} × {SIZE[1]}, one knob at a time. References: {FINEST} × "
    f"{FINEST} samples a pixel (quick: 4 × 4); tiles drawn to the last particle, in a pile of {LAYERS} swatches; "
    f"shadow maps of {FINEST_MAP} texels.",
    error=Axis("picture error, rms", "of 255", 1.0),
    time=Axis("CPU time of a picture", "ms", 1e3),
    rows=rows,
    why={
        "supersampling": "nobody sees what is left, a still may be up to 8192 pixels wide, and `--supersample 4` is "
        "there for what is to be enlarged",
        f"light left, {LAYERS} layers, unshadowed": "less than a step of 8 bits is no error in a picture",
    },
)
