"""The last step of a picture in the tone `neutral` (see `tone`), which mixes the three channels of a pixel.

`raster` maps channel by channel while it blends; this goes over the blended tiles once more, only when asked for.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x3, I32x1, I32x2, Int, Template
from taichi_cloth.ground.particles import TILE
from taichi_cloth.ground.vectors import Planes

from ..image.tone import NEUTRAL_FADE, NEUTRAL_FOOT, NEUTRAL_START, NEUTRAL_TOE
from ..tiles.rows import HALF, packed

__all__ = ["resolve_neutral"]

REST = 1.0 - NEUTRAL_START


@ti.kernel
def resolve_neutral(
    tiles_x: Int,
    tiles: Int,
    height: Int,
    blended: Int,
    starts: I32x1,
    through: Planes,
    red: Planes,
    green: Planes,
    blue: Planes,
    background: F32x1,
    srgb: I32x1,
    picture: Template,
    backdrop: F32x3,
    image_out: I32x2,
):
    """Write every tile over what stands behind it as 8-bit sRGB.

    blended: 0 where a tile without splats was not touched and shows what stands behind it. picture: whether that is
    the backdrop (height, whole tiles, 3) rather than the gradient. srgb: `tone_table`, `image_out`: as of `raster`.
    """
    for tile in range(tiles):
        x0 = (tile % tiles_x) * TILE
        y0 = (tile // tiles_x) * TILE
        touched = blended > 0 or starts[tile] < starts[tile + 1]
        for y in range(ti.min(TILE, height - y0)):
            down = (y0 + y + 0.5) / height
            for x in ti.static(range(TILE)):
                light = ti.Vector([background[c] + (background[c + 3] - background[c]) * down for c in range(3)])
                if ti.static(picture):
                    light = ti.Vector([backdrop[y0 + y, x0 + x, c] for c in range(3)])
                if touched:
                    row, lane = ti.static(x // HALF, x % HALF)
                    light *= through[tile, 2 * y + row][lane]
                    light += ti.Vector([plane[tile, 2 * y + row][lane] for plane in ti.static((red, green, blue))])
                light = ti.max(light, 0.0)
                least = light.min()
                light -= least - NEUTRAL_TOE * least * least if least < 2.0 * NEUTRAL_FOOT else NEUTRAL_FOOT
                peak = light.max()
                if peak >= NEUTRAL_START:
                    lower = 1.0 - REST * REST / (peak + REST - NEUTRAL_START)
                    keep = 1.0 / (NEUTRAL_FADE * (peak - lower) + 1.0)
                    light = lower + keep * (light * (lower / peak) - lower)
                light = ti.min(ti.max(light, 0.0), 1.0)
                image_out[y0 + y, x0 + x] = packed(srgb, light[0], light[1], light[2])
