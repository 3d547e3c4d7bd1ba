"""The last step of a picture in the tone `neutral` (see `tone`), which mixes the three channels of a pixel.

`raster` maps channel by channel while it blends; this goes over the blended tiles once more, only when asked for.
"""

import taichi as ti

from taichi_cloth.ground.arrays import F32x3, I32x1, I32x2, Template
from taichi_cloth.ground.particles import TILE

from ..image.tone import NEUTRAL_FADE, NEUTRAL_FOOT, NEUTRAL_START, NEUTRAL_TOE
from ..tiles.picture import Picture
from ..tiles.rows import HALF, packed

__all__ = ["resolve_neutral"]

REST = 1.0 - NEUTRAL_START


@ti.kernel
def resolve_neutral(
    features: Template,
    picture: Picture,
    starts: I32x1,
    planes: Template,
    backdrop: F32x3,
    srgb: I32x1,
    # out:
    image_out: I32x2,
):
    """Write every tile over what stands behind it as 8-bit sRGB. Arguments: as of `raster`."""
    for tile in range(picture.tiles):
        x0 = (tile % picture.across) * TILE
        y0 = (tile // picture.across) * TILE
        touched = starts[tile] < starts[tile + 1]
        if ti.static(features.turn == "last"):
            touched = True
        for y in range(ti.min(TILE, picture.height - y0)):
            for x in range(TILE):
                # Linear light of the pixel, in front of what stands behind it.
                column = x0 + x if ti.static(features.behind != "gradient") else 0
                light = ti.Vector([backdrop[y0 + y, column, c] for c in range(3)])
                if touched:
                    row, lane = x // HALF, x % HALF
                    light *= planes.through[tile, 2 * y + row][lane]
                    light += ti.Vector(
                        [plane[tile, 2 * y + row][lane] for plane in ti.static((planes.red, planes.green, planes.blue))]
                    )
                light = ti.max(light, 0.0)
                # Off what a dielectric reflects, then compression and fading of what is bright.
                least = light.min()  # pyright: ignore[reportOptionalCall]
                light -= least - NEUTRAL_TOE * least * least if least < 2.0 * NEUTRAL_FOOT else NEUTRAL_FOOT
                peak = light.max()  # pyright: ignore[reportOptionalCall]
                if peak >= NEUTRAL_START:
                    lower = 1.0 - REST * REST / (peak + REST - NEUTRAL_START)
                    keep = 1.0 / (NEUTRAL_FADE * (peak - lower) + 1.0)
                    light = lower + keep * (light * (lower / peak) - lower)
                light = ti.min(ti.max(light, 0.0), 1.0)
                image_out[y0 + y, x0 + x] = packed(srgb, light[0], light[1], light[2])  # pyright: ignore[reportIndexIssue]
