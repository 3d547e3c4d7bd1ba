"""What the splatter tells of the frame it has just drawn: counts and times, and the lists that other passes follow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import Layout

__all__ = ["RenderStats", "SplatLists"]


@dataclass(frozen=True)
class RenderStats:
    """What the last frame took: particles loaded and drawn, entries in the tile lists, milliseconds a stage."""

    particles: int
    drawn: int
    tile_entries: int
    light_ms: float
    project_ms: float
    sort_ms: float
    bin_ms: float
    raster_ms: float


@dataclass(frozen=True, eq=False)
class SplatLists:
    """What `raster` read for the last frame, for `passes`; valid until the next one."""

    layout: Layout
    profile: str
    edge: float
    tiles_x: int
    tiles: int
    starts: NDArray[np.int32]
    entries: NDArray[np.int32]
    splats: NDArray[np.float32]
    blocks: NDArray[np.float32]
    keys: NDArray[np.int32]
    nearest: float
    key_depth: float
    sheet: NDArray[np.float32]
    levels: NDArray[np.int32]
    sprite_size: int
