"""How much of a picture each particle is: what of the light it takes, in the pixels that are asked about."""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, Template
from taichi_cloth.ground.copies import fetched, sent, zeros
from taichi_cloth.ground.particles import LANES, TILE
from taichi_cloth.ground.vectors import Vec16

from ..tiles.picture import Picture
from .pass_raster import shape_of
from .splat import Splatter

__all__ = ["shares_seen"]

LOOK_EVERY = 32
"""Splats between two looks at whether a tile is already opaque."""


def shares_seen(splatter: Splatter, where: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Of what `splatter` has just drawn: how much each particle covers of the pixels `where` (h, w), in the order in
    which they are loaded (n,) [px]. Their sum is what all of them cover."""
    lists, picture = splatter.lists(), splatter.lists().picture
    tiles = int(picture.tiles)
    starts = fetched(lists.starts[: tiles + 1])
    asked = np.zeros((tiles * TILE // picture.across, picture.across * TILE), np.float32)
    asked[: where.shape[0], : where.shape[1]] = where
    asked = np.ascontiguousarray(asked.reshape(-1, TILE, picture.across, TILE).swapaxes(1, 2).reshape(-1, TILE))
    entries = int(starts[-1])
    passing, share = sent(np.ones((tiles * TILE, TILE), np.float32)), zeros(max(entries, 1))
    _share(
        lists.features, picture, lists.starts, lists.entries, lists.splats, lists.sheet, sent(asked), passing, share
    )  # fmt: skip
    of_entry = fetched(lists.entries[:entries])
    return np.bincount(of_entry, fetched(share)[:entries], lists.blocks.shape[1] * LANES).astype(np.float64)


@ti.kernel
def _share(
    features: Template,
    picture: Picture,
    starts: I32x1,
    lists: I32x1,
    splats: F32x2,
    sheet: F32x1,
    asked: F32x2,
    # out:
    passing_out: F32x2,
    share_out: F32x1,
):
    """Of each entry of the tiles' lists, the sum over pixels of T alpha and how far they are asked about.

    asked: a tile's rows one below the other, (tiles * 16, 16). passing_out: light that passes, likewise, 1 at first.
    """
    for tile in range(picture.tiles):
        x0, y0 = (tile % picture.across) * TILE, (tile // picture.across) * TILE
        iota = Vec16([0.5 + k for k in range(LANES)])
        i, end, look = starts[tile], starts[tile + 1], starts[tile] + LOOK_EVERY
        while i < end:
            k = lists[i]
            dx = iota - (splats[k, 0] - x0)
            middle, reach, total = splats[k, 1] - y0, splats[k, 6], 0.0
            first = ti.max(0, ti.cast(ti.ceil(middle - reach - 0.5), ti.i32))
            last = ti.min(TILE - 1, ti.cast(ti.floor(middle + reach - 0.5), ti.i32))
            for y in range(first, last + 1):
                alpha, _height = shape_of(features, picture, splats, sheet, k, dx, y + 0.5 - middle, 1.0)
                at = tile * TILE + y
                for x in range(LANES):
                    weight = passing_out[at, x] * alpha[x] * splats[k, 2]  # pyright: ignore[reportIndexIssue]
                    passing_out[at, x] = passing_out[at, x] - weight
                    total += weight * asked[at, x]
            share_out[i] = total
            i += 1
            if i == look:
                look += LOOK_EVERY
                most = 0.0
                for y in range(TILE):
                    for x in range(TILE):
                        most = ti.max(most, passing_out[tile * TILE + y, x])
                if most < picture.opaque:
                    i = end
