"""Key points that are held: still, or led along a path."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.errors import InputError

__all__ = ["Pins"]

Path = Callable[[float], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Pins:
    """mask: bool (rows, cols), the key points held. path: time [s] → where they are, (points, 3) [m], in the order of
    `positions[mask]`; None holds them where the sheet starts. At time 0 it has to give where they start."""

    mask: NDArray[np.bool_]
    path: Path | None = None

    def at(self, time: float) -> NDArray[np.float64]:
        """Where the path is at a time [s]. Raises InputError where it gives something else than finite points."""
        if self.path is None:
            raise InputError("pins: no path; these key points stay where the sheet starts")
        out = np.asarray(self.path(time), np.float64)
        if out.shape != (int(self.mask.sum()), 3) or not np.isfinite(out).all():
            raise InputError(
                f"pins.path: {out.shape} at {time:g} s; allowed: {(int(self.mask.sum()), 3)}, finite, a row a pin"
            )
        return out
