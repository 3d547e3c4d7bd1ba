"""What stands behind the particles of one picture: a colour for every pixel, and how far away it is.

The raster starts from it: a splat whose centre is farther than the backdrop has no effect on that pixel. Without
a backdrop there is only the background's gradient, and nothing of this runs or takes memory.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.particles import LANES, TILE

__all__ = ["OPEN", "Backdrop", "Behind", "padded", "tiled"]

OPEN = 1e30
"""Depth [m] where nothing stands behind."""

Behind = Literal["gradient", "picture", "mesh"]


@dataclass(frozen=True, eq=False)
class Backdrop:
    """A picture behind the particles. Made by `paint.paint`."""

    colour: NDArray[np.float32]
    """Linear colour, shape (height, width in whole tiles, 3)."""
    wall: NDArray[np.float32] | None = None
    """Depth along the viewing direction [m], shape (tiles, 16, 16), OPEN where there is none; None for all OPEN."""
    face: NDArray[np.int32] | None = None
    """Which triangle is seen, shape (height, width in whole tiles), -1 for none; None without a mesh."""
    edges: NDArray[np.float32] | None = None
    """The triangles' edge functions, shape (f, 12), see `mesh.visible`; None without a mesh."""

    @property
    def kind(self) -> Behind:
        return "picture" if self.wall is None else "mesh"

    @property
    def tiles(self) -> NDArray[np.float32] | None:
        """`wall` as rows and columns of tiles, (rows, columns, 16, 16)."""
        return None if self.wall is None else self.wall.reshape(-1, self.colour.shape[1] // TILE, TILE, TILE)


NO_WALL = np.zeros((1, 1, LANES), np.float32)


def padded(width: int) -> int:
    """An image's width [px] in whole tiles."""
    return -(-width // TILE) * TILE


def tiled(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """An image (height, width in whole tiles) as the raster's tiles (tiles, 16, 16), the last row of them filled
    up with OPEN."""
    height, width = image.shape
    rows = -(-height // TILE)
    whole = np.full((rows * TILE, width), OPEN, np.float32)
    whole[:height] = image
    tiles = whole.reshape(rows, TILE, width // TILE, TILE).transpose(0, 2, 1, 3)
    return np.ascontiguousarray(tiles).reshape(-1, TILE, TILE)
