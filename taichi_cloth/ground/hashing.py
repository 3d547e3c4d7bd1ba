"""Random numbers that are found where they are asked for, from whole numbers, the same in any order of work."""

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

__all__ = ["MOST_HASHED", "hashed", "hashed_array"]

MOST_HASHED = 1 << 24
"""What is below every hashed number, all of which float32 tells apart."""


@ti.func
def hashed(a, b):
    """A whole number from 0 to 2²⁴ − 1 from two."""
    x = ti.cast(a * 73856093 + b * 19349663 + 83492791, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    return ti.cast((x ^ (x >> 16)) & ti.cast(0xFFFFFF, ti.u32), ti.i32)


def hashed_array(a: ArrayLike, b: ArrayLike) -> NDArray[np.int64]:
    """The same of arrays, on the host."""
    x = (np.asarray(a, np.int64) * 73856093 + np.asarray(b, np.int64) * 19349663 + 83492791) & 0xFFFFFFFF
    x = ((x ^ (x >> 16)) * 73244475) & 0xFFFFFFFF
    x = ((x ^ (x >> 16)) * 73244475) & 0xFFFFFFFF
    return (x ^ (x >> 16)) & 0xFFFFFF
