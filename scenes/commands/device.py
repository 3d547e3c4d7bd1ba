"""Which device a run takes: the one that was asked for, or the CPU where a scene has a motion that knows no other."""

import sys
from typing import Any, get_args

from taichi_cloth.ground import runtime

from ..plan.plan import Plan

__all__ = ["cpu_for", "device_of"]


def device_of(planned: Plan, arch: Any) -> Any:
    """Says so in one line where it is another than was asked for. Taichi runs on one device a process, so the pictures
    of such a scene are drawn on the CPU, too."""
    if arch == "cpu" or not planned.lacks or arch not in get_args(runtime.Arch):
        return arch
    line = f"taichi-cloth: --arch {arch}: {planned.lacks} has no parallel form yet; the whole run takes the CPU"
    print(line, file=sys.stderr)
    return "cpu"


def cpu_for(what: str, arch: Any) -> Any:
    """The CPU, said in one line where another device was asked for: for what moves cloth in ways that know no other, or
    times them."""
    if arch == "cpu" or arch not in get_args(runtime.Arch):
        return arch
    print(f"taichi-cloth: --arch {arch}: {what} takes the CPU", file=sys.stderr)
    return "cpu"
