"""Copies between fields and NumPy arrays of any size, on any device.

Taichi's own `to_numpy` and `from_numpy` are parallel loops whose bounds are known when they are compiled. A device with
Vulkan runs such a loop as one thread an iteration, and is bound to take 65,535 groups of 128 threads only: of a longer
field they end in a traceback. A loop whose end comes when it runs has no such limit.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, I32x1, Int, Template

__all__ = ["copy_in", "copy_out"]


@ti.kernel
def _floats_in(values: F32x1, field: Template):
    for k in range(values.shape[0]):
        field[k] = values[k]


@ti.kernel
def _integers_in(values: I32x1, field: Template):
    for k in range(values.shape[0]):
        field[k] = values[k]


@ti.kernel
def _floats_out(field: Template, first: Int, out: F32x1):
    for k in range(out.shape[0]):
        out[k] = field[first + k]


def copy_in(values: Any, field: Any) -> None:
    """values: float32 or int32, (n,), contiguous; into the first n elements of a field of the same type."""
    if field.dtype == ti.i32:
        _integers_in(values, field)
    else:
        _floats_in(values, field)


def copy_out(field: Any, first: int, out: Any) -> None:
    """Elements of a float32 field from `first` on into `out`, float32 (n,), contiguous."""
    _floats_out(field, first, out)
