"""How much wider and brighter the particles of a thinned block must be: measured on the fabric itself."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.blocks import Fabric
from taichi_cloth.fabric import Blocks, pose_points
from taichi_cloth.pieces import SURFACE
from taichi_cloth.refine import RefiningStream
from taichi_cloth.streaming import TILTS, UNCHANGED, FabricStream

from ..render.camera import Camera, frame
from ..render.finish import Finish
from ..render.light import Lighting
from ..render.splat import Splatter
from ..render.stream import Source, stream

__all__ = ["colours_at", "crossings", "fit_gains", "fit_surface", "seen_at"]

SIZE = 320, 192
LEVELS = 9
MEASURED = (1, 2, 4, 6, 8)
"""Levels at which gains are measured; between them they are interpolated."""
ROUNDS = 5
CLOSE = 0.003
CROSSINGS = 6
MOST_CROSSINGS = 26 * 26
"""Gains are measured on no more than this of a fabric, in its middle."""
PROBE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Colours of warp and weft by which what comes from either is told apart; blue is what has no colour."""


def fit_gains(
    fabric: Fabric,
    points: NDArray | None = None,
    *,
    target: float = 0.5,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> NDArray[np.float64]:
    """(tilts, levels, 4) gains (see `FabricStream`) at λ = 1, 1/2, …, by which the cloth, at the distance where that
    share is drawn, has the coverage and the brightness of all its particles, in any colours: warp is red, weft green,
    and both are black in blue, so that one picture tells their parts and the sheen.

    Measured on a patch that lies flat, from each of `TILTS`; a block takes what fits its own tilt. points: unused.
    """
    patch, flat = _patch(fabric)
    splatter = Splatter(*SIZE)
    whole, thin = FabricStream(patch, flat, target=0.0), FabricStream(patch, flat, target=target)
    gains = np.tile(UNCHANGED, (len(TILTS), LEVELS, 1))
    for a in range(len(TILTS) - 1, -1, -1):
        elevation = float(np.degrees(np.arcsin(TILTS[a])))
        for level in MEASURED:
            camera = seen_at(patch, flat, target * 0.5 ** (level / 2), elevation=elevation)
            want = _parts(splatter, camera, whole, lighting, finish)
            now = gains[a, max(level - 1, 0)].copy() if a == len(TILTS) - 1 else gains[a + 1, level].copy()
            for _ in range(ROUNDS):
                thin.set_gains(np.tile(now, (2, 1)))
                got = _parts(splatter, camera, thin, lighting, finish)
                if (np.abs(got - want) < CLOSE * want).all():
                    break
                cover, warp, weft = np.clip(want[:3] / np.maximum(got[:3], 1e-9), 0.8, 1.25)
                now[:3] *= cover**1.5, warp / cover, weft / cover
                sheen = float(np.clip(want[3] / max(got[3], 1e-9), 0.8, 1.25)) / cover
                now[3] = np.clip(now[3] + 1.2 * (sheen - 1), -0.5, 0.9)
            gains[a, level:] = now
        nodes = (0, *MEASURED)
        for c in range(4):
            gains[a, :, c] = np.interp(range(LEVELS), nodes, gains[a, nodes, c])
    return gains


def _patch(fabric: Fabric) -> tuple[Fabric, NDArray]:
    """The middle of a fabric, of which every thread has the colour of its family in `PROBE`; and flat key points."""
    layout = fabric.layout
    flat = pose_points(layout, "flat")
    picks, ends = flat.shape[:2]
    if picks * ends > MOST_CROSSINGS:
        side = int(MOST_CROSSINGS**0.5)
        row, column = np.divmod(layout.blocks.key0, ends)
        inside = (np.abs(row - picks // 2) <= side // 2) & (np.abs(column - ends // 2) <= side // 2)
        chosen = np.flatnonzero(inside)
        blocks = Blocks(*(getattr(layout.blocks, name)[chosen] for name in Blocks.__dataclass_fields__))
        layout = replace(layout, blocks=blocks)
        bank = replace(fabric.bank, template=fabric.bank.template[chosen])
        fabric = Fabric(layout, bank, fabric.thread_colour, bank.particle_start)
    family = (np.arange(len(fabric.thread_colour)) >= ends).astype(np.intp)
    return replace(fabric, thread_colour=PROBE[family].astype(np.float32)), flat


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
