"""Which device a run takes: the one that was asked for, or the CPU where a scene has a motion that knows no other."""

import sys
from typing import Any, get_args

from taichi_cloth.ground import runtime

from ..plan.plan import Plan

__all__ = ["cpu_for", "device_of"]


def device_of(planned: Plan, arch: Any) -> Any:
    """Says so in one line where it is another than was asked for. Taichi runs on one device a process, so the pictures
    of such a scene are drawn on the CPU, too."""
    if not planned.lacks:
        return arch
    return _cpu(arch, f"{planned.lacks} has no parallel form yet; the whole run takes the CPU")


def cpu_for(what: str, arch: Any) -> Any:
    """The CPU, said in one line where another device was asked for: for what moves cloth in ways that know no other, or
    times them."""
    return _cpu(arch, f"{what} takes the CPU")


def _cpu(arch: Any, why: str) -> Any:
    """The CPU, and why in one line, where another device that there is was asked for; else what was asked for."""
    if arch == "cpu" or arch not in get_args(runtime.Arch):
        return arch
    print(f"taichi-cloth: --arch {arch}: {why}", file=sys.stderr)
    return "cpu"
