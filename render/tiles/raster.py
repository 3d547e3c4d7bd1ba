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

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x1, I32x2, Int, Template
from taichi_cloth.ground.particles import TILE
from taichi_cloth.ground.vectors import Blocks, Planes, Vec8, Vec16

from .compiling import left_to_llvm
from .rows import BOTH, HALF, LUT_STEPS, add, largest, least, most_of, packed, put, row_from_sprite, row_of, shown, span

__all__ = ["CHECK_EVERY", "LUT_STEPS", "clear", "count_opaque", "raster", "resolve_linear", "row_from_sprite"]

CHECK_EVERY = 32
"""Splats between two looks at whether a tile is already opaque."""


@left_to_llvm
@ti.kernel
def raster(
    layout: Template,
    profile: Template,
    batch: Template,
    blocks: Int,
    tiles_x: Int,
    tiles: Int,
    height: Int,
    # splats:
    starts: I32x1,
    lists: I32x1,
    splats: F32x2,
    # sprite: the fixed edge, the darkening of a round thread's sides, the textures
    edge: Float,
    curve: Float,
    sheet: F32x1,
    levels: I32x1,
    sprite_size: Int,
    # picture:
    background: F32x1,
    srgb: I32x1,
    gain: Float,
    opaque: Float,
    # what stands behind: its switch, linear colour (height, whole tiles, 3), depth [m] a tile's row, and how to
    # read a splat's own depth from its key
    behind: Template,
    backdrop: F32x3,
    wall: Blocks,
    keys: I32x1,
    nearest: Float,
    key_depth: Float,
    # out:
    through: Planes,
    red: Planes,
    green: Planes,
    blue: Planes,
    image_out: I32x2,
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
                empty = empty or largest(through, tile) < opaque
            if ti.static(batch == "last"):
                empty = False
            if empty:
                for y in range(rows if ti.static(batch == "only") else 0):
                    down = (y0 + y + 0.5) / height
                    light = ti.Vector([background[c] + (background[c + 3] - background[c]) * down for c in range(3)])
                    light = ti.min(light * gain, 1.0)
                    pixel = packed(srgb, light[0], light[1], light[2])
                    for x in ti.static(range(TILE)):
                        if ti.static(behind != "gradient"):
                            light = ti.Vector([backdrop[y0 + y, x0 + x, c] for c in range(3)])
                            light = ti.min(ti.min(light, 1.0) * gain, 1.0)
                            pixel = packed(srgb, light[0], light[1], light[2])
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
                    next_first, next_last, next_half = span(layout, splats, next_k, x0, y0)
                while i < end:
                    k, first, last, half = next_k, next_first, next_last, next_half
                    next_k = lists[ti.min(i + 1, end - 1)]
                    next_first, next_last, next_half = span(layout, splats, next_k, x0, y0)
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
                                    light = row_of(through, lanes, tile, y, half)
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
                                            q = least(most_of(1.0 - s * s - t2 * endwise, 0.0) * sharp, 1.0)
                                            q *= least(most_of(1.0 - t2, 0.0) * edge_along, 1.0)
                                        else:
                                            q = most_of(1.0 - s * s - t2, 0.0)
                                            if ti.static(profile == "sharp"):
                                                q = least(q * sharp, 1.0)
                                        weight *= q * q
                                    put(through, lanes, tile, y, half, light - weight)
                                    weight *= bright + s * (slope - curve * s)
                                    add(red, lanes, tile, y, half, weight, r)
                                    add(green, lanes, tile, y, half, weight, g)
                                    add(blue, lanes, tile, y, half, weight, b)
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
                                    light = row_of(through, lanes, tile, y, half)
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
                                        q = most_of(across - dy * dy * inverse, 0.0)
                                        if ti.static(profile != "soft"):
                                            q = least(q, 1.0)
                                        weight = light * (q * q) * alpha
                                    if ti.static(behind == "mesh"):
                                        weight *= ti.min(ti.max((wall[tile, y] - z) * 1e12, 0.0), 1.0)
                                    add(red, lanes, tile, y, half, weight, r)
                                    add(green, lanes, tile, y, half, weight, g)
                                    add(blue, lanes, tile, y, half, weight, b)
                                    put(through, lanes, tile, y, half, light - weight)
                    i += 1
                    if i == check:
                        check += CHECK_EVERY
                        if largest(through, tile) < opaque:
                            i = end
                        if ti.static(behind == "mesh"):
                            i = ti.select(z > farthest, end, i)
                for y in range(0 if ti.static(batch == "more") else rows):
                    light = row_of(through, TILE, tile, y, 0)
                    down = (y0 + y + 0.5) / height
                    shown_r = shown(
                        0, row_of(red, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    shown_g = shown(
                        1, row_of(green, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    shown_b = shown(
                        2, row_of(blue, TILE, tile, y, 0), light, background, backdrop, behind, gain, down, x0, y0 + y
                    )
                    for x in ti.static(range(TILE)):
                        image_out[y0 + y, x0 + x] = packed(srgb, shown_r[x], shown_g[x], shown_b[x])


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
        count += ti.cast(largest(through, tile) < opaque, ti.i32)
    return count


@ti.kernel
def resolve_linear(
    tiles_x: Int,
    tiles: Int,
    starts: I32x1,
    through: Planes,
    red: Planes,
    green: Planes,
    blue: Planes,
    width: Int,
    height: Int,
    rgba_out: F32x3,
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
