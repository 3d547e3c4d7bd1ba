"""Names for Taichi's array and number arguments that both Taichi and a type checker understand."""

from typing import TYPE_CHECKING, Any

import taichi as ti

__all__ = ["F32x1", "F32x2", "Float", "I32x1", "I64x1"]

if TYPE_CHECKING:
    F32x1 = Any
    F32x2 = Any
    I32x1 = Any
    I64x1 = Any
    Float = Any
else:
    F32x1 = ti.types.ndarray(ti.f32, 1)
    F32x2 = ti.types.ndarray(ti.f32, 2)
    I32x1 = ti.types.ndarray(ti.i32, 1)
    I64x1 = ti.types.ndarray(ti.i64, 1)
    Float = ti.f32
