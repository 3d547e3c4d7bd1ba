"""How much wider and brighter the particles of a thinned block must be: measured on the fabric itself."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.blocks import Fabric
from taichi_cloth.fabric import Blocks, pose_points
from taichi_cloth.pieces import SURFACE
from taichi_cloth.refine import RefiningStream
from taichi_cloth.streaming import UNCHANGED, FabricStream, Gains

from ..render.camera import Camera, frame
from ..render.finish import Finish
from ..render.light import Lighting
from ..render.splat import Splatter
from ..render.stream import Source, stream

__all__ = ["colours_at", "crossings", "fit_gains", "fit_surface", "seen_at"]

SIZE = 320, 192
ELEVATIONS = (90.0, 75.0, 60.0, 45.0, 30.0, 18.0)
LEVELS = 9
MEASURED = (1, 2, 3, 4, 5, 6, 8)
"""Levels at which gains are measured; between them they are interpolated."""
ROUNDS = 4
CLOSE = 0.004
CROSSINGS = 6
MOST_CROSSINGS = 22 * 22
"""Gains are measured on no more than this of a fabric, in its middle."""
PROBE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Colours of warp and weft by which what comes from either is told apart; blue is what has no colour."""


def fit_gains(
    fabric: Fabric,
    points: NDArray,
    *,
    target: float = 0.5,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> Gains:
    """Gains by which the cloth, at the distance where a share is drawn, has the coverage and the brightness of all its
    particles, in any colours: warp is red, weft green, and both are black in blue, so that one picture tells their
    parts and the sheen. Measured from `ELEVATIONS`, on key points (picks, ends, 3) [m] or, where the fabric is large,
    on a patch of it that lies flat.
    """
    patch, points = _patch(fabric, points)
    splatter = Splatter(*SIZE)
    whole, thin = FabricStream(patch, points, target=0.0), FabricStream(patch, points, target=target)
    factor = np.tile(UNCHANGED, (len(ELEVATIONS), LEVELS, 1))
    tilt = np.zeros(len(ELEVATIONS))
    for a, elevation in enumerate(ELEVATIONS):
        for level in MEASURED:
            camera = seen_at(patch, points, target * 0.5 ** (level / 2), elevation=elevation)
            tilt[a] = whole.survey(camera).tilt
            want = _parts(splatter, camera, whole, lighting, finish)
            now = factor[max(a - 1, 0), level if a else level - 1].copy()
            for _ in range(ROUNDS):
                thin.gains = Gains(np.ones(1), np.tile(now, (1, 2, 1)))
                got = _parts(splatter, camera, thin, lighting, finish)
                if (np.abs(got - want) < CLOSE * want).all():
                    break
                cover, warp, weft = np.clip(want[:3] / np.maximum(got[:3], 1e-9), 0.8, 1.25)
                now[:3] *= cover**1.5, warp / cover, weft / cover
                sheen = float(np.clip(want[3] / max(got[3], 1e-9), 0.8, 1.25)) / cover
                now[3] = np.clip(now[3] + 1.2 * (sheen - 1), -0.5, 0.9)
            factor[a, level:] = now
        nodes = (0, *MEASURED)
        for c in range(4):
            factor[a, :, c] = np.interp(range(LEVELS), nodes, factor[a, nodes, c])
    order = np.argsort(tilt, kind="stable")
    return Gains(tilt[order], factor[order])


def _patch(fabric: Fabric, points: NDArray) -> tuple[Fabric, NDArray]:
    """A fabric, or the middle of a large one, laid flat; every thread has the colour of its family in `PROBE`."""
    layout = fabric.layout
    picks, ends = points.shape[:2]
    if picks * ends > MOST_CROSSINGS:
        side = int(MOST_CROSSINGS**0.5)
        row, column = np.divmod(layout.blocks.key0, ends)
        inside = (np.abs(row - picks // 2) <= side // 2) & (np.abs(column - ends // 2) <= side // 2)
        chosen = np.flatnonzero(inside)
        blocks = Blocks(*(getattr(layout.blocks, name)[chosen] for name in Blocks.__dataclass_fields__))
        layout = replace(layout, blocks=blocks)
        bank = replace(fabric.bank, template=fabric.bank.template[chosen])
        points = pose_points(layout, "flat")
        fabric = Fabric(layout, bank, fabric.thread_colour, bank.particle_start)
    family = (np.arange(len(fabric.thread_colour)) >= ends).astype(np.intp)
    return replace(fabric, thread_colour=PROBE[family].astype(np.float32)), points


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
