"""Parts of long kernels that are compiled by themselves, so that a kernel of many parts is ready sooner."""

import ctypes
from collections.abc import Callable
from functools import wraps
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
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


MADE = 2048
"""Of Taichi's objects at once, in 10 ms and 4 MB: some 700 of them lie in a row, more than the kernels of a process
have."""


class _Places:
    """Taichi's objects for the routines of one program, handed out so that a kernel has the same hash in each process.

    It is kept under one of its code and that of its routines, which Taichi goes through as a table of their addresses
    has them (C++'s unordered_map): the last that was put in first, but for those that share a bucket, whose number is
    the address modulo a prime. Of objects that lie as they come some do, others in each process, and a garment's kernel
    was compiled anew in most. So of many that are made at once the longest row is taken whose members are equally far
    apart: no two of these share a bucket while there are no more than buckets. Their names are in no hash.
    """

    def __init__(self) -> None:
        self.made = 0
        self.free: list[Any] = []  # the next at the end

    def take(self, program: Any) -> Any:
        """The next one."""
        if not self.free:
            made: list[Any] = [None] * MADE  # a list that grows would lie between them
            for k in range(MADE):
                made[k] = _create_function(program, core.FunctionKey("routine", self.made + k, 0))
            self.made += MADE
            # pybind11 puts the address of what it wraps behind the head that all of Python's objects have.
            head = object.__basicsize__
            address = np.array([ctypes.c_void_p.from_address(id(one) + head).value or 0 for one in made])
            order = np.argsort(address)
            apart = np.diff(address[order])
            cuts = np.concatenate([[0], np.flatnonzero(np.diff(apart)) + 1, [len(apart)]])
            longest = int(np.argmax(np.diff(cuts)))
            self.free = [made[k] for k in order[cuts[longest] : cuts[longest + 1] + 1][::-1]]
        return self.free.pop()


def _function(program: Any, key: Any) -> Any:
    """What is compiled for a routine and its templates."""
    return _places.setdefault(program, _Places()).take(program)


_places: WeakKeyDictionary[Any, _Places] = WeakKeyDictionary()  # a new start of Taichi is a new program
_create_function = core.Program.create_function  # pyright: ignore[reportAttributeAccessIssue]
core.Program.create_function = _function  # pyright: ignore[reportAttributeAccessIssue]
