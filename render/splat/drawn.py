"""What the splatter tells of the picture it has just drawn: counts and times, and the lists that passes follow."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tiles.picture import Features

__all__ = ["RenderStats", "SplatLists"]


@dataclass(frozen=True)
class RenderStats:
    """What the last picture took."""

    particles: int
    """Loaded."""
    drawn: int
    """Of them, those in the image."""
    tile_entries: int
    """Splats in the lists of all tiles together."""
    light_ms: float
    """Milliseconds of each step, this one and those below."""
    project_ms: float
    sort_ms: float
    bin_ms: float
    raster_ms: float


@dataclass(frozen=True, eq=False)
class SplatLists:
    """What `raster` read for the last picture, for `passes`; valid until the next one."""

    features: Features
    picture: Any
    """See `tiles.picture.Picture`."""
    starts: NDArray[np.int32]
    """Where each tile's list begins, shape (tiles + 1 or more,)."""
    entries: NDArray[np.int32]
    """The lists one after another: numbers of splats, nearest first."""
    splats: NDArray[np.float32]
    """(n, `Layout.splat_size`), see `project`."""
    blocks: NDArray[np.float32]
    """The particles, (rows, blocks, 16)."""
    keys: NDArray[np.int32]
    """Depth of each in steps of `Picture.key_depth`, -1 where it is not in the image."""
    sheet: NDArray[np.float32]
    """All levels of all sprites, flat."""
