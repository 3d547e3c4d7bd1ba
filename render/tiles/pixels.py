"""From sorted splats to pixels on a graphics device: a thread each, which goes through its tile's list front to back.

The arithmetic is `raster`'s, pixel by pixel instead of row by row (see `blend`). Threads of a tile read the same splat
at the same time, and what a splat does not touch they leave after four numbers of it. A pixel is done when so little
light still passes that a tile would be, and not when the whole tile is.
"""

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, I32x2, Template
from taichi_cloth.ground.particles import TILE
from taichi_cloth.ground.vectors import Blocks

from .picture import Picture
from .rows import HALF, packed, texel

__all__ = ["raster_pixels"]

ALMOST = 0.1
"""Share of `Picture.opaque` below which a pixel takes nothing more: a tile that has become opaque has pixels far below
it."""


@ti.kernel
def raster_pixels(
    features: Template,
    picture: Picture,
    # splats, and the lists of the tiles that they touch:
    starts: I32x1,
    lists: I32x1,
    splats: F32x2,
    keys: I32x1,
    sheet: F32x1,
    # what stands behind, and the screen:
    backdrop: F32x3,
    wall: Blocks,
    srgb: I32x1,
    # out:
    planes: Template,
    image_out: I32x2,
):
    """As `raster`, whose arguments it takes."""
    ti.loop_config(block_dim=TILE * TILE)
    for p in range(picture.tiles * (TILE * TILE)):
        tile, y, x = p // (TILE * TILE), p // TILE % TILE, p % TILE
        column, row = tile % picture.across * TILE + x, tile // picture.across * TILE + y
        at, lane = 2 * y + x // HALF, x % HALF
        light, front = 1.0, ti.Vector([0.0, 0.0, 0.0])
        if ti.static(features.turn != "only"):
            light = planes.through[tile, at][lane]
            front = ti.Vector([plane[tile, at][lane] for plane in ti.static((planes.red, planes.green, planes.blue))])
        far = 0.0
        if ti.static(features.behind == "mesh"):
            far = wall[tile, y][x]
        # From the nearest on, until nothing behind would be seen.
        i, end = starts[tile], starts[tile + 1]
        if column >= picture.width or row >= picture.height:
            end = i
        while i < end:
            k = lists[i]
            i += 1
            dx, dy = column + 0.5 - splats[k, 0], row + 0.5 - splats[k, 1]
            covered, bright, there = 0.0, 1.0, ti.abs(dy) < splats[k, 6]
            if ti.static(features.behind == "mesh"):  # noqa: SIM102 (one is known when it is compiled)
                if picture.nearest + picture.key_depth * ti.cast(keys[k], ti.f32) >= far:
                    there, i = False, end
            if there:
                if ti.static(features.layout.elliptic):
                    covered, bright = _piece(features, picture, splats, sheet, k, dx, dy)
                else:
                    covered = _round(features, picture, splats, sheet, k, dx, dy)
            if covered > 0.0:
                weight = light * covered
                light -= weight
                weight *= bright
                for c in ti.static(range(3)):
                    front[c] += weight * splats[k, 3 + c]
                if light < ALMOST * picture.opaque:
                    i = end
        planes.through[tile, at][lane] = light
        for c, plane in ti.static(enumerate((planes.red, planes.green, planes.blue))):
            plane[tile, at][lane] = front[c]
        # In front of what stands behind it.
        if ti.static(features.turn != "more"):  # noqa: SIM102
            if row < picture.height:
                seen = ti.Vector([0.0, 0.0, 0.0])
                for c in ti.static(range(3)):
                    behind = backdrop[row, column if ti.static(features.behind != "gradient") else 0, c]
                    seen[c] = ti.min(ti.max((front[c] + light * behind) * picture.gain, 0.0), 1.0)
                image_out[row, column] = packed(srgb, seen[0], seen[1], seen[2])


@ti.func
def _piece(features: Template, picture: Template, splats: F32x2, sheet: F32x1, k, dx, dy):
    """Of an elliptic splat: how much of a pixel's light it takes, and how bright it is there."""
    covered, bright = 0.0, 1.0
    s = dx * splats[k, 7] + dy * splats[k, 8]
    if ti.abs(s) < 1.0:
        t = dx * splats[k, 9] + dy * splats[k, 10]
        if ti.static(features.layout.textured):
            wide = ti.rsqrt(splats[k, 7] * splats[k, 7] + splats[k, 8] * splats[k, 8])
            covered = splats[k, 2] * texel(picture, sheet, ti.cast(splats[k, 13], ti.i32), wide, s, t)
        elif ti.abs(t) < 1.0:
            t2 = t * t
            q = 0.0
            if ti.static(features.profile == "crisp"):
                q = ti.min(ti.max(1.0 - s * s - t2 * splats[k, 14], 0.0) * splats[k, 12], 1.0)
                q *= ti.min((1.0 - t2) * splats[k, 15], 1.0)
            else:
                q = ti.max(1.0 - s * s - t2, 0.0)
                if ti.static(features.profile == "sharp"):
                    q = ti.min(q * splats[k, 12], 1.0)
            covered = splats[k, 2] * (q * q)
        bright = 1.0 + 0.25 * picture.darkening + s * (splats[k, 11] - picture.darkening * s)
    return covered, bright


@ti.func
def _round(features: Template, picture: Template, splats: F32x2, sheet: F32x1, k, dx, dy):
    """Of a round splat: how much of a pixel's light it takes."""
    covered, reach = 0.0, splats[k, 6]
    if ti.static(features.layout.textured):
        one = 1.0 / reach
        covered = splats[k, 2] * texel(picture, sheet, ti.cast(splats[k, 7], ti.i32), reach, dy * one, dx * one)
    else:
        sharp = 1.0
        if ti.static(features.profile == "crisp"):
            sharp = ti.max(0.5 * reach, 1.0)
        if ti.static(features.profile == "sharp"):
            sharp = picture.edge
        q = ti.max(sharp - (dx * dx + dy * dy) * splats[k, 7] * sharp, 0.0)
        if ti.static(features.profile != "soft"):
            q = ti.min(q, 1.0)
        covered = splats[k, 2] * (q * q)
    return covered
