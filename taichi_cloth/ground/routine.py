"""Parts of long kernels that are compiled by themselves, so that a kernel of many parts is ready sooner."""

import ctypes
from collections.abc import Callable
from functools import wraps
from typing import Any
from weakref import WeakKeyDictionary

import taichi as ti
from taichi._lib import core
from taichi.lang.impl import current_cfg, get_runtime
from taichi.lang.kernel_impl import Func, Kernel

__all__ = ["routine"]


def routine(method: Callable[..., Any]) -> Callable[..., Any]:
    """A method of a data-oriented class for kernels, as `ti.func`; but on a CPU it is called, not copied to each place
    that it is called from.

    Taichi searches what it compiles for what repeats, which takes as long as the square of its length: in routines,
    half of the time of a garment's frame. A call takes some nanoseconds, and nothing of one side is kept in registers
    for the other: so for loops over packets of lanes, not for what is done with one.
    Arguments are numbers, vectors of a type that is said, and templates: fields and objects, no values of the caller.
    Its kernel is first called within `runtime.plain_code(routines=True)`.
    """
    copied, called = (Func(method, _classfunc=True, is_real_function=real) for real in (False, True))

    @wraps(method)
    def call(*args: Any) -> Any:
        config = current_cfg()
        if config.arch not in (ti.x64, ti.arm64):
            return copied(*args)
        assert not config.cache_loop_invariant_global_vars, f"{method.__qualname__}: what it changes would not be seen"
        return called(*args)

    for name, value in (("_is_taichi_function", True), ("func", copied)):  # what Taichi looks for
        setattr(call, name, value)
    return call


def _builder(kernel: Kernel) -> Any:
    """What statements are added to. Taichi takes the kernel's, and loops of a `ti.func` that a routine calls would land
    there."""
    return get_runtime().compiling_callable.ast_builder()  # pyright: ignore[reportAttributeAccessIssue]


Kernel.ast_builder = _builder  # pyright: ignore[reportAttributeAccessIssue]


class _Places:
    """Taichi's objects for the routines of one program, handed out in the order of their addresses.

    A kernel is kept under a hash of its code and that of its routines, which Taichi lines up by address: another order
    in each process, and of n routines up to n! hashes. So many objects are made at once, and the lowest is taken first.
    Their names are in no hash.
    """

    def __init__(self) -> None:
        self.made = self.last = 0
        self.free: list[tuple[int, Any]] = []  # the lowest at the end

    def take(self, program: Any) -> Any:
        """The next one, above all that were taken; if there is none above, as where another thread asks, any."""
        if not self.free:
            some = sorted((self._make(program) for _ in range(256)), key=lambda one: -one[0])  # 1 ms
            self.free = [one for one in some if one[0] > self.last] or some
        self.last, function = self.free.pop()
        return function

    def _make(self, program: Any) -> tuple[int, Any]:
        self.made += 1
        function = _create_function(program, core.FunctionKey("routine", self.made, 0))
        # pybind11 puts the address of what it wraps behind the head that all of Python's objects have.
        return ctypes.c_void_p.from_address(id(function) + object.__basicsize__).value or 0, function


def _function(program: Any, key: Any) -> Any:
    """What is compiled for a routine and its templates."""
    return _places.setdefault(program, _Places()).take(program)


_places: WeakKeyDictionary[Any, _Places] = WeakKeyDictionary()  # a new start of Taichi is a new program
_create_function = core.Program.create_function  # pyright: ignore[reportAttributeAccessIssue]
core.Program.create_function = _function  # pyright: ignore[reportAttributeAccessIssue]
