"""The particle record: what every fibre particle is, and how kernels take 16 of them at once.

Whoever makes particles (`fabric`, `detail`, `yarn`) writes this record, and whoever draws them (`render`) reads it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import Template

__all__ = ["LANES", "TILE", "Blocks", "FibreCloud", "Planes", "Vec8", "Vec16", "keep"]

F32 = NDArray[np.float32]

LANES = 16
"""Particles in a block of the input and pixels in a row of a tile: what one vector instruction takes at once."""

TILE = 16
"""Width and height of a tile of the image [px]."""

Vec8: Any = ti.types.vector(LANES // 2, ti.f32)
Vec16: Any = ti.types.vector(LANES, ti.f32)

if TYPE_CHECKING:
    Blocks = Any
    Planes = Any
else:
    Blocks = ti.types.ndarray(Vec16, 2)  # two dimensions: each element 16 neighbours
    Planes = ti.template()  # a field of Vec8, (tiles, half rows of a tile): see `planes`


@dataclass(frozen=True)
class FibreCloud:
    """Fibre particles, float32. position, tangent, normal, colour: (n, 3) ([m], unit, unit, linear albedo).
    radius, half_length: (n,) [m]. openness: (n,) share of the sky a particle sees."""

    position: F32
    tangent: F32
    normal: F32
    colour: F32
    radius: F32
    half_length: F32
    openness: F32

    def __len__(self) -> int:
        return len(self.radius)


@ti.func
def keep(array: Template, at: Template, size):
    """What a kernel leaves of `array` stays what it was. at: any element; size: a number that is never below 0.

    A graphics device is sent only arrays that are read there, and sends back whole what is written. Needed where a
    kernel writes some elements and reads none.
    """
    if size < 0:
        array[at] += 1
