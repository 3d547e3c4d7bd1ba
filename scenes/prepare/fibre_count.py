"""How many fibres of a yarn are drawn: as many as it has where a picture tells them apart, else fewer and thicker ones;
and of how many pieces each is between two crossings.

A ply of n drawn fibres instead of its N real ones, of radius r, has fibres of the radius r · √(N/n), so that their area
is the same. Where `yarn.fibres` is not stated, n is what makes that radius `LEAST_RADIUS` of a pixel.
"""

from dataclasses import replace
from math import ceil

from taichi_cloth.fabric.layout import Detail
from taichi_cloth.yarn.yarn import Yarn

from ..scene.schema import FabricSection, Scene

__all__ = ["EVERY", "few_of", "fibres_drawn", "fibres_told_apart", "stated_fibres", "steps_drawn"]

LEAST_RADIUS = 0.45
"""Radius [px] of the smallest fibres worth drawing where nothing thins them out."""
FEWEST = 4
"""Fibres a ply, at least: of fewer the twist is not seen. Poplin of threads 4 pixels apart has 1.00 of the light of all
87 where it is drawn of 4, and 1.04 where of 6."""
LEAST_STEP, FEWEST_STEPS = 1.5, 4
"""Pixels from particle to particle along a fibre that are worth drawing, and steps over a crossing, at least. They are
even: light is looked up for every second particle, and a satin of 5 steps a crossing, or of 3, had 0.92 of the light of
6 or 8, one of 4 had 1.02."""
EVERY = 2000
"""More fibres than a single of any yarn here is drawn of."""


def stated_fibres(scene: Scene) -> int | None:
    """Fibres a ply that a scene states, of warp or weft; None where it leaves them to the picture."""
    stated = [one.fibres for one in (scene.yarn, scene.weft_yarn or scene.yarn) if one is not None]
    return max((count for count in stated if count is not None), default=None)


def fibres_drawn(scene: Scene, yarns: tuple[Yarn, ...], extent: tuple[float, float]) -> int:
    """Fibres a ply of a fabric of so many metres across and along, as a scene states them or its picture shows them."""
    stated = stated_fibres(scene)
    return fibres_told_apart(yarns, extent, scene.output.size, scene.camera.zoom) if stated is None else stated


def steps_drawn(scene: Scene, pitch: float, extent: tuple[float, float]) -> int:
    """Particles along a fibre between two crossings `pitch` [m] apart, of a fabric of so many metres across and along:
    as a scene states them, else no more than its picture shows where it does not move."""
    section = scene.fabric or FabricSection()
    if scene.subject != "fabric" or "steps" in section.model_fields_set:
        return section.steps
    seen = pitch / (LEAST_STEP * _pixel(extent, scene.output.size, scene.camera.zoom))
    return min(max(2 * ceil(seen / 2), FEWEST_STEPS), section.steps)


def few_of(detail: Detail, blocks: int, particles: int, most: int) -> Detail:
    """The same with as many fibres, in few steps, as make so many blocks, now of so many particles, of up to `most`, or
    with the fewest that are ever drawn: what stands for all where light is cast."""
    if particles <= most:
        return detail
    steps = min(detail.steps, FEWEST_STEPS)
    return replace(detail, fibres=min(detail.fibres, max(FEWEST, most // (blocks * steps))), steps=steps)


def fibres_told_apart(
    yarns: tuple[Yarn, ...], extent: tuple[float, float], size: tuple[int, int], zoom: float = 1.0
) -> int:
    """Fibres a ply that a picture of (width, height) [px] tells apart, which frames so many metres, or goes so many
    times as near."""
    return max(_told_apart(yarn, _pixel(extent, size, zoom)) for yarn in yarns)


def _pixel(extent: tuple[float, float], size: tuple[int, int], zoom: float) -> float:
    """Its width [m]."""
    return max(extent[0] / size[0], extent[1] / size[1]) / zoom


def _told_apart(yarn: Yarn, pixel: float) -> int:
    """Where a pixel is so wide [m]."""
    share = (yarn.fibre_diameter / 2 / (LEAST_RADIUS * pixel)) ** 2
    return max(min(FEWEST, yarn.fibres_in_section), min(yarn.fibres_in_section, round(share * yarn.fibres_in_section)))
