"""Pictures printed on panels: every piece of yarn takes the colour that the picture has where it lies (paper 4)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Print"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Print:
    """A picture on a panel, in the panel's own coordinates, seen from its right side.

    image: (h, w, 4) linear colour and coverage, 0 to 1, first row at the top. middle: (2,) of the picture [m].
    width: [m]; its height follows from its shape.
    """

    image: F32
    middle: tuple[float, float]
    width: float

    def at(self, points: F64) -> F32:
        """Linear colours (n, 3) at points (n, 2) [m]; NaN beside the picture and where it covers less than half."""
        high, wide = self.image.shape[:2]
        pixel = self.width / wide
        x = np.floor((points[:, 0] - self.middle[0]) / pixel + wide / 2).astype(np.int64)
        y = np.floor((self.middle[1] - points[:, 1]) / pixel + high / 2).astype(np.int64)
        there = (x >= 0) & (x < wide) & (y >= 0) & (y < high)
        found = self.image[np.clip(y, 0, high - 1), np.clip(x, 0, wide - 1)]
        return np.where((there & (found[:, 3] >= 0.5))[:, None], found[:, :3], np.float32(np.nan))
