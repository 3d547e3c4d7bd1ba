"""From sorted splats to pixels: tiles of 16 x 16 pixels, each blended front to back, a row of 16 at a time.

`over` front to back in linear light, premultiplied (Porter & Duff 1984): with T the light that still passes,
    colour += T alpha c,   T -= T alpha
Rows are vectors of 16 numbers and every plane (T, red, green, blue) is its own array of half rows of 8, which LLVM
turns into packed instructions; a scalar inner loop takes four times as long. A splat that lies in one half of the tile
is blended there alone. The rows of the next splat are found before those of this one are blended: a mispredicted end
of a loop then costs little, as what comes after it waits for nothing.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import taichi as ti

from .arrays import (
    LANES,
    TILE,
    Blocks,
    Float,
    Floats1,
    Floats2,
    Floats3,
    Int,
    Ints1,
    Ints2,
    Planes,
    Switch,
    Vec8,
    Vec16,
)

__all__ = ["CHECK_EVERY", "LUT_STEPS", "clear", "count_opaque", "raster", "resolve_linear", "row_from_sprite"]

CHECK_EVERY = 32
"""Splats between two looks at whether a tile is already opaque."""

LUT_STEPS = 4096
"""Steps of linear light in the table that makes 8-bit sRGB."""

HALF = TILE // 2
BOTH = 2
"""The number of a splat that lies in both halves of a tile; one in the left or the right half has 0 or 1."""


@ti.func
def _least(a, b):
    """min(a, b) in one instruction: unlike `ti.min` it need not care which of the two is no number."""
    return ti.select(a < b, a, b)


@ti.func
def _most(a, b):
    return ti.select(a > b, a, b)


@ti.func
def _row(plane: Switch, lanes: Switch, tile, y, half):
    """Row y of a tile's plane, or one half of it."""
    if ti.static(lanes == TILE):
        return Vec16([plane[tile, 2 * y + j // HALF][j % HALF] for j in range(TILE)])
    else:
        return plane[tile, 2 * y + half]


@ti.func
def _put(plane: Switch, lanes: Switch, tile, y, half, value):
    if ti.static(lanes == TILE):
        for h in ti.static(range(2)):
            plane[tile, 2 * y + h] = Vec8([value[j + HALF * h] for j in range(HALF)])
    else:
        plane[tile, 2 * y + half] = value


@ti.func
def _add(plane: Switch, lanes: Switch, tile, y, half, weight, colour):
    _put(plane, lanes, tile, y, half, _row(plane, lanes, tile, y, half) + weight * colour)


@ti.func
def _largest(plane: Switch, tile):
    most = plane[tile, 0]
    for y in range(1, 2 * TILE):
        most = _most(most, plane[tile, y])
    return most.max()


@ti.func
def _span(layout: Switch, splats: Floats2, k, x0, y0):
    """First and last row of the tile at (x0, y0) that splat k may touch, and in which half of it.

    An elliptic splat lies between the lines s = -1 and s = 1 along the fibre, within its box.
    """
    x = splats[k, 0] - x0
    middle = splats[k, 1] - y0
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
    return first, ti.min(TILE - 1, ti.cast(ti.floor(ti.min(high, TILE + 1.0) - 0.5), ti.i32)), half


@ti.func
def _packed(srgb: Ints1, red, green, blue):
    """Three values of light, 0..1, as the bytes of one pixel."""
    pixel = srgb[ti.cast(red * LUT_STEPS + 0.5, ti.i32)]
    pixel |= srgb[ti.cast(green * LUT_STEPS + 0.5, ti.i32)] << 8
    return pixel | (srgb[ti.cast(blue * LUT_STEPS + 0.5, ti.i32)] << 16)


@ti.func
def row_from_sprite(sheet: Floats1, levels: Ints1, size, sprite, reach, s0, t0, s_y, t_y, dy):
    """Alpha of 16 pixels of a row from a sprite, bilinear, from the mip level of about four texels a pixel.

    sheet: all levels of all sprites (see `sprites.SpriteSheet.pyramid`); levels[k]: where level k begins in a
    sprite. Across the fibre is down the sprite, along it is right.
    """
    level = 0
    texels = size
    while ti.cast(texels, ti.f32) > 8.0 * reach and texels > 4:
        texels = texels // 2
        level += 1
    base = sprite * levels[levels.shape[0] - 1] + levels[level]
    half = 0.5 * ti.cast(texels, ti.f32)
    alpha = Vec16(0.0)
    # Only between the pixels where s and t are within -1..1.
    s_x = s0[1] - s0[0]
    t_x = t0[1] - t0[0]
    begin, end = 0.0, LANES - 1.0
    for at, by in ti.static(((s0[0] + s_y * dy, s_x), (t0[0] + t_y * dy, t_x))):
        if ti.abs(by) > 1e-6:
            begin = ti.max(begin, (-at - ti.select(by > 0, 1.0, -1.0)) / by)
            end = ti.min(end, (-at + ti.select(by > 0, 1.0, -1.0)) / by)
    for x in range(ti.cast(begin, ti.i32), ti.cast(ti.max(end, -1.0), ti.i32) + 1):
        s = s0[x] + s_y * dy
        t = t0[x] + t_y * dy
        if ti.abs(s) < 1.0 and ti.abs(t) < 1.0:
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
            alpha[x] = value
    return alpha


@ti.func
def _shown(c: Switch, front, light, background: Floats1, backdrop: Floats3, behind: Switch, gain, down, x0, y):
    """Channel c of a row in front of what stands behind it, 0..1."""
    full = front + light * (background[c] + (background[c + 3] - background[c]) * down)
    if ti.static(behind != "gradient"):
        for x in ti.static(range(TILE)):
            full[x] = front[x] + light[x] * backdrop[y, x0 + x, c]
    return _least(_most(full * gain, 0.0), 1.0)


@ti.kernel
def raster(
    layout: Switch,
    profile: Switch,
    batch: Switch,
    blocks: Int,
    tiles_x: Int,
    tiles: Int,
    height: Int,
    # splats:
    starts: Ints1,
    lists: Ints1,
    splats: Floats2,
    # sprite: the fixed edge, the darkening of a round thread's sides, the textures
    edge: Float,
    curve: Float,
    sheet: Floats1,
    levels: Ints1,
    sprite_size: Int,
    # picture:
    background: Floats1,
    srgb: Ints1,
    gain: Float,
    opaque: Float,
    # what stands behind: its switch, linear colour (height, whole tiles, 3), depth [m] a tile's row, and how to
    # read a splat's own depth from its key
    behind: Switch,
    backdrop: Floats3,
    wall: Blocks,
    keys: Ints1,
    nearest: Float,
    key_depth: Float,
    # out:
    through: Planes,
    red: Planes,
    green: Planes,
    blue: Planes,
    image_out: Ints2,
):
    """Blend every tile and write it as 8-bit sRGB. `image_out` has whole tiles of columns, `height` rows.

    profile: "soft", "sharp" or "crisp". blocks: tiles are dealt to threads in turn, so that none gets only the
    busy middle. opaque: a tile is done when less than this passes everywhere. behind: "gradient" is the
    background alone, "picture" takes the backdrop's colours instead, and "mesh" also its depth: a splat whose
    centre is farther than that has no effect on the pixel.
    batch: "only" is a whole picture. "more" goes on with what the planes hold, takes nothing for a tile that is
    opaque already, and writes no image; "last" writes what the planes hold.
    """
    rounds = ti.max(512, (tiles + blocks - 1) // blocks)
    for step in range(rounds * blocks):
        tile = (step % rounds) * blocks + step // rounds
        if tile < tiles:
            x0 = (tile % tiles_x) * TILE
            y0 = (tile // tiles_x) * TILE
            rows = ti.min(TILE, height - y0)
            i = starts[tile]
            end = starts[tile + 1]
            empty = i == end
            if ti.static(batch == "more"):
                empty = empty or _largest(through, tile) < opaque
            if ti.static(batch == "last"):
                empty = False
            if empty:
                for y in range(rows if ti.static(batch == "only") else 0):
                    down = (y0 + y + 0.5) / height
                    light = ti.Vector([background[c] + (background[c + 3] - background[c]) * down for c in range(3)])
                    light = ti.min(light * gain, 1.0)
                    pixel = _packed(srgb, light[0], light[1], light[2])
                    for x in ti.static(range(TILE)):
                        if ti.static(behind != "gradient"):
                            light = ti.Vector([backdrop[y0 + y, x0 + x, c] for c in range(3)])
                            light = ti.min(ti.min(light, 1.0) * gain, 1.0)
                            pixel = _packed(srgb, light[0], light[1], light[2])
                        image_out[y0 + y, x0 + x] = pixel
            else:
                for y in range(2 * TILE if ti.static(batch == "only") else 0):
                    through[tile, y] = Vec8(1.0)
                    red[tile, y] = Vec8(0.0)
                    green[tile, y] = Vec8(0.0)
                    blue[tile, y] = Vec8(0.0)
                farthest = 0.0
                if ti.static(behind == "mesh"):
                    far = wall[tile, 0]
                    for y in range(1, TILE):
                        far = ti.max(far, wall[tile, y])
                    farthest = far.max()
                check = i + CHECK_EVERY
                next_k, next_first, next_last, next_half = 0, 0, 0, 0
                if i < end:
                    next_k = lists[i]
                    next_first, next_last, next_half = _span(layout, splats, next_k, x0, y0)
                while i < end:
                    k, first, last, half = next_k, next_first, next_last, next_half
                    next_k = lists[ti.min(i + 1, end - 1)]
                    next_first, next_last, next_half = _span(layout, splats, next_k, x0, y0)
                    z = 0.0
                    if ti.static(behind == "mesh"):
                        z = nearest + key_depth * ti.cast(keys[k], ti.f32)
                    x = splats[k, 0] - x0
                    middle = splats[k, 1] - y0
                    alpha = splats[k, 2]
                    r = splats[k, 3]
                    g = splats[k, 4]
                    b = splats[k, 5]
                    for lanes in ti.static((TILE,) if layout.textured or behind == "mesh" else (TILE, HALF)):
                        chosen = half == BOTH
                        begin = 0.5
                        if ti.static(layout.textured or behind == "mesh"):
                            chosen = True
                        if ti.static(lanes == HALF):
                            chosen = half != BOTH
                            begin = HALF * half + 0.5
                        if chosen:
                            dx = ti.Vector([begin + j - x for j in range(lanes)])
                            if ti.static(layout.elliptic):
                                s_x = splats[k, 7]
                                s_y = splats[k, 8]
                                t_x = splats[k, 9]
                                t_y = splats[k, 10]
                                slope = splats[k, 11]
                                sharp = splats[k, 12]
                                endwise = splats[k, 14]
                                edge_along = splats[k, 15]
                                s0 = dx * s_x
                                t0 = dx * t_x
                                bright = 1.0 + 0.25 * curve
                                for y in range(first, last + 1):
                                    dy = y + 0.5 - middle
                                    s = s0 + dy * s_y
                                    light = _row(through, lanes, tile, y, half)
                                    weight = light * alpha
                                    if ti.static(behind == "mesh"):
                                        weight *= ti.min(ti.max((wall[tile, y] - z) * 1e12, 0.0), 1.0)
                                    if ti.static(layout.textured):
                                        weight *= row_from_sprite(
                                            sheet,
                                            levels,
                                            sprite_size,
                                            ti.cast(splats[k, 13], ti.i32),
                                            ti.rsqrt(s_x * s_x + s_y * s_y),
                                            s0,
                                            t0,
                                            s_y,
                                            t_y,
                                            dy,
                                        )
                                    else:
                                        t = t0 + dy * t_y
                                        t2 = t * t
                                        q = s
                                        if ti.static(profile == "crisp"):
                                            q = _least(_most(1.0 - s * s - t2 * endwise, 0.0) * sharp, 1.0)
                                            q *= _least(_most(1.0 - t2, 0.0) * edge_along, 1.0)
                                        else:
                                            q = _most(1.0 - s * s - t2, 0.0)
                                            if ti.static(profile == "sharp"):
                                                q = _least(q * sharp, 1.0)
                                        weight *= q * q
                                    _put(through, lanes, tile, y, half, light - weight)
                                    weight *= bright + s * (slope - curve * s)
                                    _add(red, lanes, tile, y, half, weight, r)
                                    _add(green, lanes, tile, y, half, weight, g)
                                    _add(blue, lanes, tile, y, half, weight, b)
                            else:
                                reach = splats[k, 6]
                                inverse = splats[k, 7]
                                sharp = 1.0
                                if ti.static(profile == "crisp"):
                                    sharp = ti.max(0.5 * reach, 1.0)
                                if ti.static(profile == "sharp"):
                                    sharp = edge
                                inverse *= sharp
                                across = sharp - dx * dx * inverse
                                for y in range(first, last + 1):
                                    dy = y + 0.5 - middle
                                    light = _row(through, lanes, tile, y, half)
                                    weight = light
                                    if ti.static(layout.textured):
                                        one = 1.0 / reach
                                        weight = light * alpha
                                        weight *= row_from_sprite(
                                            sheet,
                                            levels,
                                            sprite_size,
                                            ti.cast(splats[k, 7], ti.i32),
                                            reach,
                                            Vec16(0.0),
                                            dx * one,
                                            one,
                                            0.0,
                                            dy,
                                        )
                                    else:
                                        q = _most(across - dy * dy * inverse, 0.0)
                                        if ti.static(profile != "soft"):
                                            q = _least(q, 1.0)
                                        weight = light * (q * q) * alpha
                                    if ti.static(behind == "mesh"):
                                        weight *= ti.min(ti.max((wall[tile, y] - z) * 1e12, 0.0), 1.0)
                                    _add(red, lanes, tile, y, half, weight, r)
                                    _add(green, lanes, tile, y, half, weight, g)
                                    _add(blue, lanes, tile, y, half, weight, b)
                                    _put(through, lanes, tile, y, half, light - weight)
                    i += 1
                    if i == check:
                        check += CHECK_EVERY
                        if _largest(through, tile) < opaque:
                            i = end
                        if ti.static(behind == "mesh"):
                            i = ti.select(z > farthest, end, i)
                for y in range(0 if ti.static(batch == "more") else rows):
                    light = _row(through, TILE, tile, y, 0)
                    down = (y0 + y + 0.5) / height
                    shown_r = _shown(
                        0, _row(red, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    shown_g = _shown(
                        1, _row(green, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    shown_b = _shown(
                        2, _row(blue, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    for x in ti.static(range(TILE)):
                        image_out[y0 + y, x0 + x] = _packed(srgb, shown_r[x], shown_g[x], shown_b[x])


@ti.kernel
def clear(tiles: Int, through: Planes, red: Planes, green: Planes, blue: Planes):
    """An empty picture, for batches."""
    for tile in range(tiles):
        for y in range(2 * TILE):
            through[tile, y] = Vec8(1.0)
            red[tile, y] = Vec8(0.0)
            green[tile, y] = Vec8(0.0)
            blue[tile, y] = Vec8(0.0)


@ti.kernel
def count_opaque(tiles: Int, opaque: Float, through: Planes) -> Int:
    """How many tiles let less than `opaque` pass everywhere."""
    count = 0
    ti.loop_config(serialize=True)
    for tile in range(tiles):
        count += ti.cast(_largest(through, tile) < opaque, ti.i32)
    return count


@ti.kernel
def resolve_linear(
    tiles_x: Int,
    tiles: Int,
    starts: Ints1,
    through: Planes,
    red: Planes,
    green: Planes,
    blue: Planes,
    width: Int,
    height: Int,
    rgba_out: Floats3,
):
    """The blended tiles as linear premultiplied red, green, blue and alpha; tiles without splats are empty."""
    for tile in range(tiles):
        x0 = (tile % tiles_x) * TILE
        y0 = (tile // tiles_x) * TILE
        empty = starts[tile] == starts[tile + 1]
        for y in range(ti.min(TILE, height - y0)):
            for x in range(ti.min(TILE, width - x0)):
                if empty:
                    for c in ti.static(range(4)):
                        rgba_out[y0 + y, x0 + x, c] = 0.0
                else:
                    rgba_out[y0 + y, x0 + x, 0] = red[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 1] = green[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 2] = blue[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 3] = 1.0 - through[tile, 2 * y + x // HALF][x % HALF]
