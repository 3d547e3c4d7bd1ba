"""One splat over one tile, row by row: the shapes that a splat may have.

Both shapes write the alpha of a row's pixels as straight-line code on 16 lanes, or on 8 where the splat lies in one
half of the tile. See `project` for what a splat's numbers are.
"""

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, Template
from taichi_cloth.ground.vectors import Blocks, Vec16

from .rows import HALF, add, least, most_of, put, row_from_sprite, row_of

__all__ = ["blend_piece", "blend_round"]

# Arguments of both. features, picture: see `picture`. planes: what is blended. lanes: 16, or 8 for one half of a row.
# tile: its number. corner: its first column and row [px]. k: the splat. touched: as of `span`. z: the splat's depth
# [m], for a wall (tiles, 16) of depths a row. sheet: the sprites.


@ti.func
def _columns(splats: F32x2, k, corner, half, lanes: Template):
    """How far each pixel of a row, or of one half of it, is right of the splat's centre [px]."""
    begin = 0.5
    if ti.static(lanes == HALF):
        begin = HALF * half + 0.5
    x = splats[k, 0] - corner[0]
    return ti.Vector([begin + j - x for j in range(lanes)])


@ti.func
def _in_front(wall: Blocks, tile, y, z):
    """1 in the pixels where what stands behind is farther than z, else 0."""
    return ti.min(ti.max((wall[tile, y] - z) * 1e12, 0.0), 1.0)


@ti.func
def _add_light(planes: Template, lanes: Template, tile, y, half, weight, red, green, blue):
    """The splat's colour, as much of it as each pixel takes."""
    add(planes.red, lanes, tile, y, half, weight, red)
    add(planes.green, lanes, tile, y, half, weight, green)
    add(planes.blue, lanes, tile, y, half, weight, blue)


@ti.func
def blend_piece(
    features: Template,
    picture: Template,
    planes: Template,
    lanes: Template,
    tile,
    corner,
    k,
    touched,
    z,
    splats: F32x2,
    sheet: F32x1,
    wall: Blocks,
):
    """An elliptic splat, a piece of a round thread: alpha by s across and t along it, brighter towards the light."""
    half = touched[2]
    dx = _columns(splats, k, corner, half, lanes)
    middle = splats[k, 1] - corner[1]
    alpha = splats[k, 2]
    red = splats[k, 3]
    green = splats[k, 4]
    blue = splats[k, 5]
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
    curve = picture.darkening
    bright = 1.0 + 0.25 * curve
    for y in range(touched[0], touched[1] + 1):
        # What the pixels still let pass, and what the splat takes of it.
        dy = y + 0.5 - middle
        s = s0 + dy * s_y
        light = row_of(planes.through, lanes, tile, y, half)
        weight = light * alpha
        if ti.static(features.behind == "mesh"):
            weight *= _in_front(wall, tile, y, z)
        if ti.static(features.layout.textured):
            sprite = ti.cast(splats[k, 13], ti.i32)
            wide = ti.rsqrt(s_x * s_x + s_y * s_y)
            weight *= row_from_sprite(picture, sheet, sprite, wide, s0, t0, s_y, t_y, dy)
        else:
            t = t0 + dy * t_y
            t2 = t * t
            q = s
            if ti.static(features.profile == "crisp"):
                q = least(most_of(1.0 - s * s - t2 * endwise, 0.0) * sharp, 1.0)
                q *= least(most_of(1.0 - t2, 0.0) * edge_along, 1.0)
            else:
                q = most_of(1.0 - s * s - t2, 0.0)
                if ti.static(features.profile == "sharp"):
                    q = least(q * sharp, 1.0)
            weight *= q * q
        put(planes.through, lanes, tile, y, half, light - weight)
        # Its light: the thread is brighter on the side that faces the key light, darker at its sides.
        weight *= bright + s * (slope - curve * s)
        _add_light(planes, lanes, tile, y, half, weight, red, green, blue)


@ti.func
def blend_round(
    features: Template,
    picture: Template,
    planes: Template,
    lanes: Template,
    tile,
    corner,
    k,
    touched,
    z,
    splats: F32x2,
    sheet: F32x1,
    wall: Blocks,
):
    """A round splat: alpha by the distance from its centre."""
    half = touched[2]
    dx = _columns(splats, k, corner, half, lanes)
    middle = splats[k, 1] - corner[1]
    alpha = splats[k, 2]
    red = splats[k, 3]
    green = splats[k, 4]
    blue = splats[k, 5]
    reach = splats[k, 6]
    inverse = splats[k, 7]
    sharp = 1.0
    if ti.static(features.profile == "crisp"):
        sharp = ti.max(0.5 * reach, 1.0)
    if ti.static(features.profile == "sharp"):
        sharp = picture.edge
    inverse *= sharp
    across = sharp - dx * dx * inverse
    for y in range(touched[0], touched[1] + 1):
        dy = y + 0.5 - middle
        light = row_of(planes.through, lanes, tile, y, half)
        weight = light
        if ti.static(features.layout.textured):
            one = 1.0 / reach
            weight = light * alpha
            sprite = ti.cast(splats[k, 7], ti.i32)
            weight *= row_from_sprite(picture, sheet, sprite, reach, Vec16(0.0), dx * one, one, 0.0, dy)
        else:
            q = most_of(across - dy * dy * inverse, 0.0)
            if ti.static(features.profile != "soft"):
                q = least(q, 1.0)
            weight = light * (q * q) * alpha
        if ti.static(features.behind == "mesh"):
            weight *= _in_front(wall, tile, y, z)
        _add_light(planes, lanes, tile, y, half, weight, red, green, blue)
        put(planes.through, lanes, tile, y, half, light - weight)
