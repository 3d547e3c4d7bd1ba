"""Which pieces of a stream lie wholly behind a mesh: the far side of a garment that is worn. They are never made."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.particles import TILE

from ..data.backdrop import Backdrop
from ..data.camera import Camera

__all__ = ["not_hidden"]

WIDEST = 4
"""Tiles each way; of a piece that may touch more it is not asked."""


def not_hidden(seen: Any, ids: NDArray[np.int32], camera: Camera, backdrop: Backdrop | None) -> NDArray[np.int32]:
    """Those of the pieces number `ids` of a survey of which something may lie before what stands behind the picture.

    A splat has no effect where its centre lies behind that, so nothing of the picture hangs on the others. How far a
    piece reaches is known from its box of tiles, but for one at the picture's edge, where the box is cut off.
    """
    tiles = None if backdrop is None else backdrop.tiles
    if tiles is None or not len(ids):
        return ids
    far = tiles.max(axis=(2, 3))
    left, right, top, bottom = seen.boxes[ids].astype(np.intp).T
    size = np.maximum(right - left, bottom - top) + 1
    inner = (left > 0) & (top > 0) & (right < far.shape[1] - 1) & (bottom < far.shape[0] - 1) & (size <= WIDEST)
    depth = seen.depth[ids]
    nearest = depth * (1.0 - 0.5 * TILE * size / camera.focal)
    behind = np.zeros(len(ids), np.float32)
    for down in range(WIDEST):
        for across in range(WIDEST):
            row, col = np.minimum(top + down, bottom), np.minimum(left + across, right)
            behind = np.maximum(behind, far[np.minimum(row, far.shape[0] - 1), np.minimum(col, far.shape[1] - 1)])
    return ids[~(inner & (nearest > behind))]
