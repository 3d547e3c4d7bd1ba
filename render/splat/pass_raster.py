"""What each pixel of the passes sees, tile by tile: the kernel of `passes`."""

from dataclasses import dataclass

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1, I32x2, Template
from taichi_cloth.ground.particles import LANES, NORMAL, RADIUS, TILE
from taichi_cloth.ground.vectors import Vec16, keep

from ..tiles.picture import Picture
from ..tiles.rows import row_from_sprite

__all__ = ["DEPTH", "FACING", "PASSING", "Wanted", "raster_passes", "shape_of"]

# Planes of what is seen: the share of light that still passes, the depth [m], the normal (3).
PASSING, DEPTH, FACING = 0, 1, 2


@dataclass(frozen=True)
class Wanted:
    """What the kernel finds beside the coverage: a compile-time switch."""

    hits: bool
    """Depth, and which particle it is of."""
    normals: bool

    @property
    def planes(self) -> int:
        """How many there are; those that are not wanted behind these are left out."""
        return FACING + 3 if self.normals else DEPTH + 1 if self.hits else PASSING + 1


@ti.kernel
def raster_passes(
    features: Template,
    wanted: Template,
    picture: Picture,
    # splats, and the lists of the tiles that they touch:
    starts: I32x1,
    lists: I32x1,
    splats: F32x2,
    particles: F32x3,
    keys: I32x1,
    sheet: F32x1,
    # what stands behind:
    wall: F32x2,
    # out, a tile's rows one below the other:
    seen_out: F32x3,
    hit_out: I32x2,
):
    """Alpha is `raster`'s, row by row; see there for the arguments and `project` for what a splat's numbers are."""
    keep(hit_out, (0, 0), picture.tiles)
    keep(seen_out, (0, 0, 0), picture.tiles)
    shares = picture.shares
    tiles = picture.tiles
    rounds = ti.max(512, (tiles + shares - 1) // shares)
    for step in range(rounds * shares):
        tile = (step % rounds) * shares + step // rounds
        if tile < tiles:
            x0 = (tile % picture.across) * TILE
            y0 = (tile // picture.across) * TILE
            iota = Vec16([0.5 + k for k in range(LANES)])
            for i in range(starts[tile], starts[tile + 1]):
                # Where the splat lies, on the image and in depth.
                k = lists[i]
                z = picture.nearest + picture.key_depth * ti.cast(keys[k], ti.f32)
                radius = particles[RADIUS, k // LANES, k % LANES]
                narrow = radius * picture.focal / z  # [px], as `reach` would be without a rim
                dx = iota - (splats[k, 0] - x0)
                middle = splats[k, 1] - y0
                reach = splats[k, 6]
                first = ti.max(0, ti.cast(ti.ceil(middle - reach - 0.5), ti.i32))
                last = ti.min(TILE - 1, ti.cast(ti.floor(middle + reach - 0.5), ti.i32))
                for y in range(first, last + 1):
                    alpha, height = shape_of(features, picture, splats, sheet, k, dx, y + 0.5 - middle, narrow)
                    # What the pixels that it covers see of it.
                    at = tile * TILE + y
                    for x in range(LANES):
                        light = seen_out[PASSING, at, x]
                        weight = light * alpha[x] * splats[k, 2]  # pyright: ignore[reportIndexIssue]
                        if ti.static(features.behind == "mesh"):
                            weight = ti.select(z < wall[at, x], weight, 0.0)
                        if weight > 0.0:
                            left = light - weight
                            seen_out[PASSING, at, x] = left
                            if ti.static(wanted.hits):
                                crosses = light > 0.5 and left <= 0.5
                                if crosses:
                                    hit_out[at, x] = k
                                    seen_out[DEPTH, at, x] = z - radius * ti.sqrt(ti.max(height[x], 0.0))
                            if ti.static(wanted.normals):
                                for c in ti.static(range(3)):
                                    part = weight * particles[NORMAL + c, k // LANES, k % LANES]
                                    seen_out[FACING + c, at, x] = seen_out[FACING + c, at, x] + part


@ti.func
def shape_of(features: Template, picture: Template, splats: F32x2, sheet: F32x1, k, dx, dy, narrow):
    """Alpha of 16 pixels of a row, and how far the particle rises there: 1 - (distance from its middle or axis, in
    radii)^2."""
    alpha = Vec16(0.0)
    height = Vec16(0.0)
    reach = splats[k, 6]
    if ti.static(features.layout.elliptic):
        s = dx * splats[k, 7] + dy * splats[k, 8]
        t = dx * splats[k, 9] + dy * splats[k, 10]
        wide = ti.rsqrt(splats[k, 7] * splats[k, 7] + splats[k, 8] * splats[k, 8])
        height = 1.0 - (s * wide / narrow) * (s * wide / narrow)
        if ti.static(features.layout.textured):
            sprite = ti.cast(splats[k, 13], ti.i32)
            s0 = dx * splats[k, 7]
            t0 = dx * splats[k, 9]
            alpha = row_from_sprite(picture, sheet, sprite, wide, s0, t0, splats[k, 8], splats[k, 10], dy)
        else:
            q = ti.max(1.0 - s * s - t * t, 0.0)
            if ti.static(features.profile == "crisp"):
                q = ti.max(1.0 - s * s - t * t * splats[k, 14], 0.0)
                q = ti.min(q * splats[k, 12], 1.0)
                q *= ti.min(ti.max(1.0 - t * t, 0.0) * splats[k, 15], 1.0)
            if ti.static(features.profile == "sharp"):
                q = ti.min(q * splats[k, 12], 1.0)
            alpha = q * q
    else:
        rho = (dx * dx + dy * dy) / (reach * reach)
        height = 1.0 - rho * (reach / narrow) * (reach / narrow)
        if ti.static(features.layout.textured):
            sprite = ti.cast(splats[k, 7], ti.i32)
            one = 1.0 / reach
            alpha = row_from_sprite(picture, sheet, sprite, reach, Vec16(0.0), dx * one, one, 0.0, dy)
        else:
            sharp = 1.0
            if ti.static(features.profile == "crisp"):
                sharp = ti.max(0.5 * reach, 1.0)
            if ti.static(features.profile == "sharp"):
                sharp = picture.edge
            q = ti.min(ti.max(1.0 - rho, 0.0) * sharp, 1.0)
            alpha = q * q
    return alpha, height
