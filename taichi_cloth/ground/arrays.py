"""Names for the types of kernel arguments, so that type checkers and Taichi both read the same signature.

A suffix is the number of dimensions. NumPy arrays are passed without a copy on a CPU.
"""

import sys
from typing import TYPE_CHECKING, Any

import taichi as ti
from taichi.lang import kernel_impl

__all__ = [
    "F32x1",
    "F32x2",
    "F32x3",
    "Float",
    "I16x2",
    "I32x1",
    "I32x2",
    "I64x1",
    "Int",
    "Long",
    "Template",
    "U8x1",
    "U8x3",
]

if TYPE_CHECKING:
    F32x1 = Any
    F32x2 = Any
    F32x3 = Any
    I16x2 = Any
    I32x1 = Any
    I32x2 = Any
    I64x1 = Any
    U8x1 = Any
    U8x3 = Any
    Float = Any
    Int = Any
    Long = Any
    Template = Any
else:
    F32x1 = ti.types.ndarray(ti.f32, 1)
    F32x2 = ti.types.ndarray(ti.f32, 2)
    F32x3 = ti.types.ndarray(ti.f32, 3)
    I16x2 = ti.types.ndarray(ti.i16, 2)
    I32x1 = ti.types.ndarray(ti.i32, 1)
    I32x2 = ti.types.ndarray(ti.i32, 2)
    I64x1 = ti.types.ndarray(ti.i64, 1)
    U8x1 = ti.types.ndarray(ti.u8, 1)
    U8x3 = ti.types.ndarray(ti.u8, 3)
    Float = ti.f32
    Int = ti.i32
    Long = ti.i64
    Template = ti.template()


def _inside_class(level_of_class_stackframe: int) -> bool:
    """Whether what is decorated is a method. Taichi's own looks for the line of the file that says so, for each of some
    400 functions: a quarter of the time that all modules take to import. Here as all modules with kernels import this.
    """
    return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals


kernel_impl._inside_class = _inside_class
