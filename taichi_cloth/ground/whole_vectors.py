"""Vectors that stay vectors until LLVM has them, for kernels that work on lanes.

Taichi 1.7 makes of each operation on a vector of eight as many statements, searches those for what repeats, which takes
as long as the square of their number, and LLVM then has to find the vectors again. It can pass vectors on
(`real_matrix_scalarize`), but not all of its operations can do with that: what cannot is written out here, element by
element, and only that. What comes out is the same numbers.
"""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import taichi as ti
from taichi._lib import core
from taichi.lang import common_ops, impl, ops
from taichi.lang.expr import Expr
from taichi.lang.matrix import make_matrix

__all__ = ["kept_as_vectors"]

WHOLE = (core.expr_logic_not, core.expr_bit_not)  # pyright: ignore[reportAttributeAccessIssue]
"""Operations on one vector that LLVM gets as they are; it would stop at roots, signs and floors."""


@contextlib.contextmanager
def kept_as_vectors() -> Iterator[None]:
    """Kernels first called within keep vectors and matrices whole. On a CPU, and of kernels whose vectors live within
    one outermost loop each: what is kept from one to the next has an address that LLVM's vectors cannot be at.

    Vectors to the power of vectors, and two of different types in one operation, end the process: say `ti.cast`.
    """
    config = impl.current_cfg()
    replaced = [
        (ops, "_unary_operation", _unary),
        (ops, "cast", _cast),
        (ti, "cast", _cast),
        (ops, "select", _select),
        (ti, "select", _select),
        (impl, "subscript", _subscript),
        (common_ops.TaichiOperations, "_augassign", _augmented),
    ]
    before = [getattr(place, name) for place, name, _ in replaced]
    scalarize = config.real_matrix_scalarize
    try:
        config.real_matrix_scalarize = False
        for place, name, ours in replaced:
            setattr(place, name, ours)
        yield
    finally:
        config.real_matrix_scalarize = scalarize
        for (place, name, _), theirs in zip(replaced, before, strict=True):
            setattr(place, name, theirs)


def _is_vector(value: Any) -> bool:
    return isinstance(value, Expr) and value.is_tensor()


def _of_truths(value: Any) -> bool:
    """Whether it is a vector of bits, which LLVM packs, while Taichi looks for one in a byte."""
    return _is_vector(value) and value.element_type() == ti.u1


def _each(function: Callable[[Any], Any], vector: Expr) -> Any:
    """A function of each element."""
    builder = impl.get_runtime().compiling_callable.ast_builder()  # pyright: ignore[reportAttributeAccessIssue]
    kept, shape = impl.expr_init(vector), vector.get_shape()

    def at(*index: int) -> Any:
        return function(_theirs_subscript(builder, kept, *index))

    if len(shape) == 1:
        return make_matrix([at(i) for i in range(shape[0])])
    return make_matrix([[at(i, j) for j in range(shape[1])] for i in range(shape[0])])


def _unary(operation: Any, of_python: Any, value: Any) -> Any:
    if _is_vector(value) and operation not in WHOLE:
        return _each(lambda one: _theirs_unary(operation, of_python, one), value)
    return _theirs_unary(operation, of_python, value)


def _cast(value: Any, dtype: Any) -> Any:
    if _is_vector(value) and not _of_truths(value):
        return _each(lambda one: _theirs_cast(one, dtype), value)
    return _theirs_cast(value, dtype)


def _select(condition: Any, one: Any, other: Any) -> Any:
    if _is_vector(condition) and not _of_truths(condition):
        condition = ops.cmp_ne(condition, 0)
    return _theirs_select(condition, one, other)


def _subscript(builder: Any, value: Any, *index: Any, **more: Any) -> Any:
    if _of_truths(value):
        return ops.cmp_ne(_theirs_subscript(builder, impl.expr_init(_theirs_cast(value, ti.i32)), *index, **more), 0)
    return _theirs_subscript(builder, value, *index, **more)


def _augmented(self: Any, value: Any, operation: str) -> Any:
    if operation == "Sub" and _is_vector(self):  # Taichi takes integers for what it takes away
        self._assign(ops.sub(self, value))
        return self
    return _theirs_augmented(self, value, operation)


_theirs_unary, _theirs_cast, _theirs_select = ops._unary_operation, ops.cast, ops.select
_theirs_subscript, _theirs_augmented = impl.subscript, common_ops.TaichiOperations._augassign
for _ours in (_cast, _select):
    _ours.__module__ = ops.__name__  # Taichi warns of functions that are not its own
