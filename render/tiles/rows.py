"""Rows of a tile: which a splat touches, reading and writing them, sprites on them, and the pixels they become."""

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, Template
from taichi_cloth.ground.particles import LANES, TILE
from taichi_cloth.ground.vectors import Vec8, Vec16

__all__ = [
    "BOTH",
    "HALF",
    "LUT_STEPS",
    "add",
    "least",
    "most_of",
    "packed",
    "put",
    "row_from_sprite",
    "row_of",
    "shown",
    "span",
    "texel",
]

LUT_STEPS = 4096
"""Steps of linear light in the table that makes 8-bit sRGB."""

HALF = TILE // 2
BOTH = 2
"""The number of a splat that lies in both halves of a tile; one in the left or the right half has 0 or 1."""


@ti.func
def least(a, b):
    """min(a, b) in one instruction: unlike `ti.min` it need not care which of the two is no number."""
    return ti.select(a < b, a, b)


@ti.func
def most_of(a, b):
    return ti.select(a > b, a, b)


@ti.func
def row_of(plane: Template, lanes: Template, tile, y, half):
    """Row y of a tile's plane, or one half of it."""
    if ti.static(lanes == TILE):
        return Vec16([plane[tile, 2 * y + j // HALF][j % HALF] for j in range(TILE)])
    else:
        return plane[tile, 2 * y + half]


@ti.func
def put(plane: Template, lanes: Template, tile, y, half, value):
    if ti.static(lanes == TILE):
        for h in ti.static(range(2)):
            plane[tile, 2 * y + h] = Vec8([value[j + HALF * h] for j in range(HALF)])
    else:
        plane[tile, 2 * y + half] = value


@ti.func
def add(plane: Template, lanes: Template, tile, y, half, weight, colour):
    put(plane, lanes, tile, y, half, row_of(plane, lanes, tile, y, half) + weight * colour)


@ti.func
def span(layout: Template, splats: F32x2, k, corner):
    """First and last row of the tile at that corner [px] that splat k may touch, and in which half of it.

    An elliptic splat lies between the lines s = -1 and s = 1 along the fibre, within its box.
    """
    x = splats[k, 0] - corner[0]
    middle = splats[k, 1] - corner[1]
    reach = splats[k, 6]
    low = middle - reach
    high = middle + reach
    wide = reach
    if ti.static(layout.elliptic):
        wide = splats[k, 13]
        rise = 1.0 / splats[k, 8]
        drop = splats[k, 7] * rise
        begin = middle + (x - 0.5) * drop
        end = middle + (x - (TILE - 0.5)) * drop
        rise = 1.00001 * ti.abs(rise) + 0.01
        low = ti.max(low, ti.min(begin, end) - rise)
        high = ti.min(high, ti.max(begin, end) + rise)
    half = BOTH
    if x + wide < HALF + 0.5:
        half = 0
    if x - wide > HALF - 0.5:
        half = 1
    first = ti.max(0, ti.cast(ti.ceil(ti.max(low, -1.0) - 0.5), ti.i32))
    last = ti.min(TILE - 1, ti.cast(ti.floor(ti.min(high, TILE + 1.0) - 0.5), ti.i32))
    return ti.Vector([first, last, half])


@ti.func
def packed(srgb: I32x1, red, green, blue):
    """Three values of light, 0..1, as the bytes of one pixel."""
    pixel = srgb[ti.cast(red * LUT_STEPS + 0.5, ti.i32)]
    pixel |= srgb[ti.cast(green * LUT_STEPS + 0.5, ti.i32)] << 8
    return pixel | (srgb[ti.cast(blue * LUT_STEPS + 0.5, ti.i32)] << 16)


@ti.func
def level_of(picture: Template, sprite, reach):
    """First texel and width of the mip level of about four texels a pixel of a sprite."""
    base = sprite * picture.sprite_texels
    texels = picture.sprite_size
    while ti.cast(texels, ti.f32) > 8.0 * reach and texels > 4:
        base += texels * texels
        texels = texels // 2
    return base, texels


@ti.func
def bilinear(sheet: F32x1, base, texels, s, t):
    """Alpha of a level of a sprite at s, t."""
    half = 0.5 * ti.cast(texels, ti.f32)
    column = (t + 1.0) * half - 0.5
    row = (s + 1.0) * half - 0.5
    left = ti.cast(ti.floor(column), ti.i32)
    top = ti.cast(ti.floor(row), ti.i32)
    f = column - ti.floor(column)
    g = row - ti.floor(row)
    value = 0.0
    for j in ti.static(range(2)):
        for i in ti.static(range(2)):
            if 0 <= left + i < texels and 0 <= top + j < texels:  # outside the sprite nothing covers
                weight = (f if ti.static(i == 1) else 1.0 - f) * (g if ti.static(j == 1) else 1.0 - g)
                value += weight * sheet[base + (top + j) * texels + left + i]
    return value


@ti.func
def texel(picture: Template, sheet: F32x1, sprite, reach, s, t):
    """Alpha of one pixel from a sprite, as of `row_from_sprite`."""
    value = 0.0
    if ti.abs(s) < 1.0 and ti.abs(t) < 1.0:
        base, texels = level_of(picture, sprite, reach)
        value = bilinear(sheet, base, texels, s, t)
    return value


@ti.func
def row_from_sprite(picture: Template, sheet: F32x1, sprite, reach, s0, t0, s_y, t_y, dy):
    """Alpha of 16 pixels of a row from a sprite, bilinear, from the mip level of about four texels a pixel.

    sheet: all levels of all sprites (see `sprites.SpriteSheet.pyramid`). Across the fibre is down the sprite, along
    it is right.
    """
    base, texels = level_of(picture, sprite, reach)
    alpha = Vec16(0.0)
    # Only between the pixels where s and t are within -1..1.
    s_x = s0[1] - s0[0]
    t_x = t0[1] - t0[0]
    begin, end = 0.0, LANES - 1.0
    for at, by in ti.static(((s0[0] + s_y * dy, s_x), (t0[0] + t_y * dy, t_x))):
        if ti.abs(by) > 1e-6:
            begin = ti.max(begin, (-at - ti.select(by > 0, 1.0, -1.0)) / by)
            end = ti.min(end, (-at + ti.select(by > 0, 1.0, -1.0)) / by)
    for x in range(ti.cast(begin, ti.i32), ti.cast(ti.max(end, -1.0), ti.i32) + 1):  # pyright: ignore[reportArgumentType]
        s = s0[x] + s_y * dy
        t = t0[x] + t_y * dy
        if ti.abs(s) < 1.0 and ti.abs(t) < 1.0:
            alpha[x] = bilinear(sheet, base, texels, s, t)
    return alpha


@ti.func
def shown(features: Template, picture: Template, c: Template, front, light, backdrop: F32x3, corner, y):
    """Channel c of a row in front of what stands behind it, 0..1."""
    full = front + light * backdrop[corner[1] + y, 0, c]
    if ti.static(features.behind != "gradient"):
        for x in ti.static(range(TILE)):
            full[x] = front[x] + light[x] * backdrop[corner[1] + y, corner[0] + x, c]
    return least(most_of(full * picture.gain, 0.0), 1.0)
