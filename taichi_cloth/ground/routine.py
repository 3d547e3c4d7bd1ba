"""Parts of long kernels that are compiled by themselves, so that a kernel of many parts is ready sooner."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import taichi as ti
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
