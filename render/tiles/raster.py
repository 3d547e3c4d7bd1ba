"""From sorted splats to pixels: tiles of 16 x 16 pixels, each blended front to back, a row of 16 at a time.

`over` front to back in linear light, premultiplied (Porter & Duff 1984): with T the light that still passes,
    colour += T alpha c,   T -= T alpha
Rows are vectors of 16 numbers and every plane (T, red, green, blue) is its own array of half rows of 8, which LLVM
turns into packed instructions; a scalar inner loop takes four times as long. A splat that lies in one half of the tile
is blended there alone. The rows of the next splat are found before those of this one are blended: a mispredicted end
of a loop then costs little, as what comes after it waits for nothing.
"""

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, I32x2, Int, Template
from taichi_cloth.ground.particles import TILE
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.ground.vectors import Blocks

from .blend import blend_piece, blend_round
from .compiling import left_to_llvm
from .picture import Picture
from .rows import BOTH, HALF, packed, row_of, shown, span

__all__ = ["CHECK_EVERY", "clear", "count_opaque", "raster", "resolve_linear"]

CHECK_EVERY = 32
"""Splats between two looks at whether a tile is already opaque."""


@left_to_llvm
@ti.kernel
def raster(
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
    """Blend every tile and write it as 8-bit sRGB. `image_out` has whole tiles of columns, `height` rows.

    starts: (tiles + 1,) where each tile's list begins. backdrop: linear colours, (height, 1, 3), or one a pixel
    (height, whole tiles, 3). wall: its depths [m] a tile's row, (tiles, 16, 16). srgb: see `tone.tone_table`.
    """
    shares = picture.shares
    tiles = picture.tiles
    rounds = ti.max(512, (tiles + shares - 1) // shares)
    for step in range(rounds * shares):
        tile = (step % rounds) * shares + step // rounds
        if tile < tiles:
            corner = ti.Vector([(tile % picture.across) * TILE, (tile // picture.across) * TILE])
            rows = ti.min(TILE, picture.height - corner[1])
            begin = starts[tile]
            end = starts[tile + 1]
            # A tile that takes no splats shows what stands behind it, or stays as it is.
            empty = begin == end
            if ti.static(features.turn == "more"):
                empty = empty or planes.most_passing(tile) < picture.opaque
            if ti.static(features.turn == "last"):
                empty = False
            if empty:
                if ti.static(features.turn == "only"):
                    _write_empty(features, picture, corner, rows, backdrop, srgb, image_out)
            else:
                if ti.static(features.turn == "only"):
                    planes.clear(tile)
                _blend(features, picture, planes, tile, corner, begin, end, lists, splats, keys, sheet, wall)
                if ti.static(features.turn != "more"):
                    _write(features, picture, planes, tile, corner, rows, backdrop, srgb, image_out)


@ti.func
def _blend(
    features: Template,
    picture: Template,
    planes: Template,
    tile,
    corner,
    begin,
    end,
    lists: I32x1,
    splats: F32x2,
    keys: I32x1,
    sheet: F32x1,
    wall: Blocks,
):
    """The splats lists[begin:end], from the nearest on, until nothing behind them would be seen."""
    farthest = 0.0
    if ti.static(features.behind == "mesh"):
        far = wall[tile, 0]
        for y in range(1, TILE):
            far = ti.max(far, wall[tile, y])
        farthest = far.max()  # pyright: ignore[reportOptionalCall]
    i = begin
    check = i + CHECK_EVERY
    coming = 0
    touched_next = ti.Vector([0, 0, 0])
    if i < end:
        coming = lists[i]
        touched_next = span(features.layout, splats, coming, corner)
    while i < end:
        k = coming
        touched = touched_next
        coming = lists[ti.min(i + 1, end - 1)]
        touched_next = span(features.layout, splats, coming, corner)
        z = 0.0
        if ti.static(features.behind == "mesh"):
            z = picture.nearest + picture.key_depth * ti.cast(keys[k], ti.f32)
        # Sprites and walls come in whole rows only.
        for lanes in ti.static((TILE,) if features.layout.textured or features.behind == "mesh" else (TILE, HALF)):
            chosen = touched[2] == BOTH
            if ti.static(features.layout.textured or features.behind == "mesh"):
                chosen = True
            if ti.static(lanes == HALF):
                chosen = touched[2] != BOTH
            if chosen:
                if ti.static(features.layout.elliptic):
                    blend_piece(features, picture, planes, lanes, tile, corner, k, touched, z, splats, sheet, wall)
                else:
                    blend_round(features, picture, planes, lanes, tile, corner, k, touched, z, splats, sheet, wall)
        # Now and then: does anything still pass, and is anything still in front of the wall?
        i += 1
        if i == check:
            check += CHECK_EVERY
            if planes.most_passing(tile) < picture.opaque:
                i = end
            if ti.static(features.behind == "mesh"):
                i = ti.select(z > farthest, end, i)


@ti.func
def _write_empty(features: Template, picture: Template, corner, rows, backdrop: F32x3, srgb: I32x1, image_out: I32x2):
    """What stands behind a tile, as pixels."""
    gain = picture.gain
    for y in range(rows):
        light = ti.Vector([backdrop[corner[1] + y, 0, c] for c in range(3)])
        light = ti.min(light * gain, 1.0)
        pixel = packed(srgb, light[0], light[1], light[2])  # pyright: ignore[reportIndexIssue]
        for x in range(TILE):
            if ti.static(features.behind != "gradient"):
                light = ti.Vector([backdrop[corner[1] + y, corner[0] + x, c] for c in range(3)])
                light = ti.min(ti.min(light, 1.0) * gain, 1.0)
                pixel = packed(srgb, light[0], light[1], light[2])  # pyright: ignore[reportIndexIssue]
            image_out[corner[1] + y, corner[0] + x] = pixel


@ti.func
def _write(
    features: Template,
    picture: Template,
    planes: Template,
    tile,
    corner,
    rows,
    backdrop: F32x3,
    srgb: I32x1,
    image_out: I32x2,
):
    """What was blended, in front of what stands behind it, as pixels."""
    for y in range(rows):
        light = row_of(planes.through, TILE, tile, y, 0)
        red = shown(features, picture, 0, row_of(planes.red, TILE, tile, y, 0), light, backdrop, corner, y)
        green = shown(features, picture, 1, row_of(planes.green, TILE, tile, y, 0), light, backdrop, corner, y)
        blue = shown(features, picture, 2, row_of(planes.blue, TILE, tile, y, 0), light, backdrop, corner, y)
        for x in range(TILE):
            image_out[corner[1] + y, corner[0] + x] = packed(srgb, red[x], green[x], blue[x])  # pyright: ignore[reportIndexIssue]


@ti.kernel
def clear(tiles: Int, planes: Template):
    """An empty picture, for batches."""
    for tile in range(tiles):
        planes.clear(tile)


@ti.kernel
def count_opaque(picture: Picture, planes: Template) -> Int:
    """How many tiles let less than `opaque` pass everywhere."""
    count = 0
    ti.loop_config(serialize=ti.static(on_host()))
    for tile in range(picture.tiles):
        count += ti.cast(planes.most_passing(tile) < picture.opaque, ti.i32)
    return count


@ti.kernel
def resolve_linear(picture: Picture, starts: I32x1, planes: Template, rgba_out: F32x3):
    """The blended tiles as linear premultiplied red, green, blue and alpha; tiles without splats are empty."""
    for tile in range(picture.tiles):
        x0 = (tile % picture.across) * TILE
        y0 = (tile // picture.across) * TILE
        empty = starts[tile] == starts[tile + 1]
        for y in range(ti.min(TILE, picture.height - y0)):
            for x in range(ti.min(TILE, picture.width - x0)):
                if empty:
                    for c in ti.static(range(4)):
                        rgba_out[y0 + y, x0 + x, c] = 0.0
                else:
                    rgba_out[y0 + y, x0 + x, 0] = planes.red[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 1] = planes.green[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 2] = planes.blue[tile, 2 * y + x // HALF][x % HALF]
                    rgba_out[y0 + y, x0 + x, 3] = 1.0 - planes.through[tile, 2 * y + x // HALF][x % HALF]
