"""How much wider and brighter the particles of a thinned block must be: measured on the fabric itself."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.blocks import Fabric
from taichi_cloth.pieces import SURFACE
from taichi_cloth.refine import RefiningStream
from taichi_cloth.streaming import UNCHANGED, FabricStream

from ..render.camera import Camera, frame
from ..render.finish import Finish
from ..render.light import Lighting
from ..render.splat import Splatter
from ..render.stream import Source, stream

__all__ = ["colours_at", "crossings", "fit_gains", "fit_surface", "seen_at"]

SIZE = 320, 192
LEVELS = 9
ROUNDS = 7
CLOSE = 0.002
CROSSINGS = 6
MOST_PARTICLES = 4e6
"""A larger fabric keeps its particles as they are: measuring it would take longer than the picture."""
PROBE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Colours of warp and weft by which what comes from either is told apart; blue is what has no colour."""


def fit_gains(
    fabric: Fabric,
    points: NDArray,
    *,
    target: float = 0.5,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> NDArray[np.float64]:
    """(LEVELS, 4) gains (see `FabricStream`) at λ = 1, 1/2, …, by which the cloth, seen from above at the distance
    where that share is drawn, has the coverage and the brightness of all its particles, in any colours: warp is
    red, weft green, and both are black in blue, so that one picture tells their parts and the sheen."""
    gains = np.tile(UNCHANGED, (LEVELS, 1))
    if fabric.particles > MOST_PARTICLES:
        return gains
    ends = len(fabric.layout.warp.colour)
    family = (np.arange(len(fabric.thread_colour)) >= ends).astype(np.intp)
    probe = replace(fabric, thread_colour=PROBE[family].astype(np.float32))
    splatter = Splatter(*SIZE)
    whole = FabricStream(probe, points, target=0.0)
    for level in range(1, LEVELS):
        camera = seen_at(fabric, points, target * 0.5 ** (level / 2))
        want = _parts(splatter, camera, whole, lighting, finish)
        gains[level] = gains[level - 1]
        for _ in range(ROUNDS):
            ladder = np.concatenate([gains[:level], np.tile(gains[level], (2, 1))])
            thin = FabricStream(probe, points, target=target, gains=ladder)
            got = _parts(splatter, camera, thin, lighting, finish)
            if (np.abs(got - want) < CLOSE * want).all():
                break
            cover, warp, weft = np.clip(want[:3] / np.maximum(got[:3], 1e-9), 0.8, 1.25)
            gains[level, :3] *= cover**1.5, warp / cover, weft / cover
            sheen = float(np.clip(want[3] / max(got[3], 1e-9), 0.8, 1.25)) / cover
            gains[level, 3] = np.clip(gains[level, 3] + 1.2 * (sheen - 1), -0.5, 0.9)
        gains[level + 1 :] = gains[level]
    return gains


def fit_surface(
    fabric: Fabric,
    points: NDArray,
    skin: NDArray[np.float32],
    *,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> float:
    """The `surface_gain` by which fibres with a surface are together as bright as the splats they replace."""
    yarn, fibres = fabric.layout.warp.yarn, fabric.layout.detail.fibres
    drawn = float(np.median(fabric.bank.radius[fabric.bank.openness < 1.0]))
    real = drawn / max(1.0, yarn.fibres_in_section / fibres) ** 0.5
    pixels = 1.3 * SURFACE[0] * float(fabric.bank.radius.mean()) / real
    splatter = Splatter(*SIZE)
    light = [
        sum(
            colours_at(splatter, source, camera, lighting=lighting, finish=finish)[:3].sum()
            for camera in crossings(fabric, points, pixels)
        )
        for source in (FabricStream(fabric, points), RefiningStream(fabric, points, skin))
    ]
    return float(np.clip(light[0] / max(light[1], 1e-9), 0.5, 1.5))


def colours_at(
    splatter: Splatter,
    source: Source,
    camera: Camera,
    *,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> NDArray[np.float64]:
    """Red, green, blue and coverage of the whole picture."""
    stream(splatter, camera, source, most=10**9, lighting=lighting, finish=finish)
    return splatter.linear().sum(axis=(0, 1), dtype=np.float64)


def crossings(fabric: Fabric, points: NDArray, pixels: float) -> Iterator[Camera]:
    """Narrow views from above of a few crossings near the middle, of which some show warp and some weft."""
    grid = np.asarray(points)
    picks, ends = (n // 2 for n in grid.shape[:2])
    for k in range(CROSSINGS):
        yield seen_at(fabric, points, pixels, fov=4, about=grid[picks + k // 3, ends + k % 3])


def seen_at(
    fabric: Fabric,
    points: NDArray,
    pixels: float,
    *,
    elevation: float = 60,
    fov: float = 30,
    about: NDArray | None = None,
) -> Camera:
    """From above, where the mean radius of a particle is `pixels`."""
    flat = np.asarray(points).reshape(-1, 3)
    camera = frame(flat, width=SIZE[0], height=SIZE[1], elevation=elevation, fov=fov)
    distance = float(fabric.bank.radius.mean()) * camera.focal / pixels
    place = (flat.mean(axis=0) if about is None else about) - camera.forward * distance
    return replace(camera, translation=-camera.rotation @ place, near=1e-4)


def _parts(
    splatter: Splatter, camera: Camera, source: FabricStream, lighting: Lighting | None, finish: Finish | None
) -> NDArray[np.float64]:
    """Coverage, light by the colour of warp and of weft, and light without colour, of the whole picture."""
    red, green, blue, cover = colours_at(splatter, source, camera, lighting=lighting, finish=finish)
    return np.array([cover, red - blue, green - blue, blue])
