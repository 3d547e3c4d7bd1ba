"""Kernels that LLVM alone makes fast: the two largest of a picture, compiled in a quarter of the time."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import taichi as ti
from taichi.lang.impl import current_cfg

__all__ = ["left_to_llvm"]

P = ParamSpec("P")
R = TypeVar("R")


def left_to_llvm(kernel: Callable[P, R]) -> Callable[P, R]:
    """The kernel, compiled on a CPU without Taichi's own search for what repeats, in values, in loads and from turn to
    turn of a loop.

    They take most of the time where vectors of 16 become 16 statements each. The arithmetic is the same, and so
    are the bytes. Not for every kernel: those of the cloth (`solvers`, `follow`) ran three to five times as long.
    """

    @wraps(kernel)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        config = current_cfg()
        if config.arch not in (ti.x64, ti.arm64):
            return kernel(*args, **kwargs)
        before = config.opt_level, config.cfg_optimization, config.advanced_optimization
        config.opt_level, config.cfg_optimization, config.advanced_optimization = 0, False, False
        try:
            return kernel(*args, **kwargs)
        finally:
            config.opt_level, config.cfg_optimization, config.advanced_optimization = before

    return call
