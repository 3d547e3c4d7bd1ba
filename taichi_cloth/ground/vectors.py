"""Types of the arguments of kernels that take 16 particles, or 16 pixels of a tile's row, at once."""

from typing import TYPE_CHECKING, Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.particles import LANES, OCTET

__all__ = ["Blocks", "Vec8", "Vec16", "keep"]

Vec8: Any = ti.types.vector(OCTET, ti.f32)
Vec16: Any = ti.types.vector(LANES, ti.f32)

if TYPE_CHECKING:
    Blocks = Any
else:
    Blocks = ti.types.ndarray(Vec16, 2)  # groups of particles (rows, groups): each element 16 neighbours


@ti.func
def keep(array: Template, at: Template, size):
    """What a kernel leaves of `array` stays what it was. at: any element; size: a number that is never below 0.

    A graphics device is sent only arrays that are read there, and sends back whole what is written. Needed where a
    kernel writes some elements and reads none.
    """
    if size < 0:
        array[at] += 1
