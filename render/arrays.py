"""Names for the types of kernel arguments, so that type checkers and Taichi both read the same signature.

A suffix is the number of dimensions. NumPy arrays are passed without a copy on a CPU.
"""

from typing import TYPE_CHECKING, Any

import taichi as ti

__all__ = [
    "LANES",
    "TILE",
    "Blocks",
    "Bytes1",
    "Bytes3",
    "Float",
    "Floats1",
    "Floats2",
    "Floats3",
    "Int",
    "Ints1",
    "Ints2",
    "Long",
    "Longs1",
    "Planes",
    "Switch",
    "Vec8",
    "Vec16",
    "keep",
]

LANES = 16
"""Particles in a block of the input and pixels in a row of a tile: what one vector instruction takes at once."""

TILE = 16
"""Width and height of a tile of the image [px]."""

Vec8: Any = ti.types.vector(LANES // 2, ti.f32)
Vec16: Any = ti.types.vector(LANES, ti.f32)

if TYPE_CHECKING:
    Float = float
    Int = int
    Long = int
    Switch = Any
    Floats1 = Any
    Floats2 = Any
    Floats3 = Any
    Ints1 = Any
    Ints2 = Any
    Longs1 = Any
    Bytes1 = Any
    Bytes3 = Any
    Blocks = Any
    Planes = Any
else:
    Float = ti.f32
    Int = ti.i32
    Long = ti.i64
    Switch = ti.template()
    Floats1 = ti.types.ndarray(ti.f32, 1)
    Floats2 = ti.types.ndarray(ti.f32, 2)
    Floats3 = ti.types.ndarray(ti.f32, 3)
    Ints1 = ti.types.ndarray(ti.i32, 1)
    Ints2 = ti.types.ndarray(ti.i32, 2)
    Longs1 = ti.types.ndarray(ti.i64, 1)
    Bytes1 = ti.types.ndarray(ti.u8, 1)
    Bytes3 = ti.types.ndarray(ti.u8, 3)
    Blocks = ti.types.ndarray(Vec16, 2)  # two dimensions: each element 16 neighbours
    Planes = ti.template()  # a field of Vec8, (tiles, half rows of a tile): see `planes`


@ti.func
def keep(array: Switch, at: Switch, size):
    """What a kernel leaves of `array` stays what it was. at: any element; size: a number that is never below 0.

    A graphics device is sent only arrays that are read there, and sends back whole what is written. Needed where a
    kernel writes some elements and reads none.
    """
    if size < 0:
        array[at] += 1
