"""From sorted splats to pixels: tiles of 16 x 16 pixels, each blended front to back, a row of 16 at a time.

`over` front to back in linear light, premultiplied (Porter & Duff 1984): with T the light that still passes,
    colour += T alpha c,   T -= T alpha
Rows are vectors of 16 numbers and every plane (T, red, green, blue) is its own array of rows, which LLVM turns
into packed instructions; a scalar inner loop takes four times as long.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import taichi as ti

from .arrays import (
    LANES,
    TILE,
    Blocks,
    Bytes1,
    Bytes3,
    Float,
    Floats1,
    Floats2,
    Floats3,
    Int,
    Ints1,
    Planes,
    Switch,
    Vec16,
)

__all__ = ["CHECK_EVERY", "LUT_STEPS", "clear", "count_opaque", "raster", "resolve_linear", "row_from_sprite"]

CHECK_EVERY = 32
"""Splats between two looks at whether a tile is already opaque."""

LUT_STEPS = 4096
"""Steps of linear light in the table that makes 8-bit sRGB."""


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
    for x in range(LANES):
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
    srgb: Bytes1,
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
    image_out: Bytes3,
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
                most = through[tile, 0]
                for y in range(1, TILE):
                    most = ti.max(most, through[tile, y])
                empty = empty or most.max() < opaque
            if ti.static(batch == "last"):
                empty = False
            if empty:
                for y in range(rows if ti.static(batch == "only") else 0):
                    down = (y0 + y + 0.5) / height
                    for c in ti.static(range(3)):
                        light = background[c] + (background[c + 3] - background[c]) * down
                        level = srgb[ti.cast(ti.min(light * gain, 1.0) * LUT_STEPS + 0.5, ti.i32)]
                        for x in range(TILE):
                            if ti.static(behind != "gradient"):
                                light = ti.min(backdrop[y0 + y, x0 + x, c], 1.0)
                                level = srgb[ti.cast(ti.min(light * gain, 1.0) * LUT_STEPS + 0.5, ti.i32)]
                            image_out[y0 + y, x0 + x, c] = level
            else:
                iota = Vec16([0.5 + k for k in range(TILE)])
                for y in range(TILE if ti.static(batch == "only") else 0):
                    through[tile, y] = Vec16(1.0)
                    red[tile, y] = Vec16(0.0)
                    green[tile, y] = Vec16(0.0)
                    blue[tile, y] = Vec16(0.0)
                farthest = 0.0
                if ti.static(behind == "mesh"):
                    far = wall[tile, 0]
                    for y in range(1, TILE):
                        far = ti.max(far, wall[tile, y])
                    farthest = far.max()
                check = i + CHECK_EVERY
                while i < end:
                    k = lists[i]
                    z = 0.0
                    if ti.static(behind == "mesh"):
                        z = nearest + key_depth * ti.cast(keys[k], ti.f32)
                    x = splats[k, 0] - x0
                    middle = splats[k, 1] - y0
                    alpha = splats[k, 2]
                    r = splats[k, 3]
                    g = splats[k, 4]
                    b = splats[k, 5]
                    reach = splats[k, 6]
                    first = ti.max(0, ti.cast(ti.ceil(middle - reach - 0.5), ti.i32))
                    last = ti.min(TILE - 1, ti.cast(ti.floor(middle + reach - 0.5), ti.i32))
                    dx = iota - x
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
                            light = through[tile, y]
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
                                q = s
                                if ti.static(profile == "crisp"):
                                    t2 = t * t
                                    q = ti.min(ti.max(1.0 - s * s - t2 * endwise, 0.0) * sharp, 1.0)
                                    q *= ti.min(ti.max(1.0 - t2, 0.0) * edge_along, 1.0)
                                else:
                                    q = ti.max(1.0 - s * s - t * t, 0.0)
                                    if ti.static(profile == "sharp"):
                                        q = ti.min(q * sharp, 1.0)
                                weight *= q * q
                            through[tile, y] = light - weight
                            weight *= bright + s * (slope - curve * s)
                            red[tile, y] = red[tile, y] + weight * r
                            green[tile, y] = green[tile, y] + weight * g
                            blue[tile, y] = blue[tile, y] + weight * b
                    else:
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
                            light = through[tile, y]
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
                                q = ti.max(across - dy * dy * inverse, 0.0)
                                if ti.static(profile != "soft"):
                                    q = ti.min(q, 1.0)
                                weight = light * (q * q) * alpha
                            if ti.static(behind == "mesh"):
                                weight *= ti.min(ti.max((wall[tile, y] - z) * 1e12, 0.0), 1.0)
                            red[tile, y] = red[tile, y] + weight * r
                            green[tile, y] = green[tile, y] + weight * g
                            blue[tile, y] = blue[tile, y] + weight * b
                            through[tile, y] = light - weight
                    i += 1
                    if i == check:
                        check += CHECK_EVERY
                        most = through[tile, 0]
                        for y in range(1, TILE):
                            most = ti.max(most, through[tile, y])
                        if most.max() < opaque:
                            i = end
                        if ti.static(behind == "mesh"):
                            i = ti.select(z > farthest, end, i)
                for y in range(0 if ti.static(batch == "more") else rows):
                    light = through[tile, y]
                    down = (y0 + y + 0.5) / height
                    for c in ti.static(range(3)):
                        gradient = background[c] + (background[c + 3] - background[c]) * down
                        front = (
                            red[tile, y]
                            if ti.static(c == 0)
                            else green[tile, y]
                            if ti.static(c == 1)
                            else blue[tile, y]
                        )
                        full = front + light * gradient
                        if ti.static(behind != "gradient"):
                            for x in ti.static(range(TILE)):
                                full[x] = front[x] + light[x] * backdrop[y0 + y, x0 + x, c]
                        value = ti.min(ti.max(full * gain, 0.0), 1.0) * float(LUT_STEPS) + 0.5
                        for x in ti.static(range(TILE)):
                            image_out[y0 + y, x0 + x, c] = srgb[ti.cast(value[x], ti.i32)]


@ti.kernel
def clear(tiles: Int, through: Planes, red: Planes, green: Planes, blue: Planes):
    """An empty picture, for batches."""
    for tile in range(tiles):
        for y in range(TILE):
            through[tile, y] = Vec16(1.0)
            red[tile, y] = Vec16(0.0)
            green[tile, y] = Vec16(0.0)
            blue[tile, y] = Vec16(0.0)


@ti.kernel
def count_opaque(tiles: Int, opaque: Float, through: Planes) -> Int:
    """How many tiles let less than `opaque` pass everywhere."""
    count = 0
    ti.loop_config(serialize=True)
    for tile in range(tiles):
        most = through[tile, 0]
        for y in range(1, TILE):
            most = ti.max(most, through[tile, y])
        count += ti.cast(most.max() < opaque, ti.i32)
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
                    rgba_out[y0 + y, x0 + x, 0] = red[tile, y][x]
                    rgba_out[y0 + y, x0 + x, 1] = green[tile, y][x]
                    rgba_out[y0 + y, x0 + x, 2] = blue[tile, y][x]
                    rgba_out[y0 + y, x0 + x, 3] = 1.0 - through[tile, y][x]
