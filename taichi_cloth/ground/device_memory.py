"""How much memory fields take on a device, and the refusal of what no device would take."""

import re
from collections.abc import Iterable
from typing import Any

import taichi as ti
from taichi.lang.matrix import MatrixField

from taichi_cloth.ground.errors import InputError

__all__ = ["MOST_BYTES", "field_bytes", "is_out_of_memory", "require_device_memory", "said_of_memory"]

MOST_BYTES = 2_000_000_000
"""Of all fields together that are made before a kernel runs: they are one buffer, and a device with Vulkan may refuse
one of more than 2 GB."""

_FAILED = re.compile(r"out.of.memory|failed to allocate", re.IGNORECASE)


_taken: dict[str, tuple[int, int]] = {}
"""Of this process: key points and bytes of what was found small enough, by what it is."""


def field_bytes(*holders: Any, known: Iterable[Any] = ()) -> int:
    """Bytes of all fields that these objects hold, however deep; each field is counted once. known: objects whose
    fields are not counted."""
    seen: set[int] = set()
    for one in known:
        _bytes(one, seen)
    return sum(_bytes(one, seen) for one in holders)


def _bytes(one: Any, seen: set[int]) -> int:
    if id(one) in seen:
        return 0
    seen.add(id(one))
    if isinstance(one, ti.Field | MatrixField):
        count = 1
        for length in one.shape:
            count *= length
        width = one.n * one.m if isinstance(one, MatrixField) else 1
        return count * width * (8 if one.dtype in (ti.f64, ti.i64, ti.u64) else 4)
    if isinstance(one, list | tuple):
        return sum(_bytes(part, seen) for part in one)
    inside = getattr(one, "__dict__", None)
    if isinstance(inside, dict) and type(one).__module__.startswith("taichi_cloth"):
        return sum(_bytes(part, seen) for part in inside.values())
    return 0


def require_device_memory(what: str, points: int, holders: Iterable[Any], known: Iterable[Any] = ()) -> None:
    """Raises InputError, with how much would fit, where the fields of `points` key points are more than one buffer may
    have. known: as of `field_bytes`, in buffers of their own."""
    needed = field_bytes(*holders, known=known)
    if needed > MOST_BYTES:
        raise InputError(
            f"{what}: {points:,} key points take {needed / 1e9:.1f} GB on the device, of {MOST_BYTES / 1e9:.0f} GB "
            f"in one piece; about {int(0.95 * points * MOST_BYTES / needed):,} would fit, or use --arch cpu"
        )
    _taken[what] = points, needed


def said_of_memory() -> str:
    """For the line of a device that is out of memory, which does not say how much it has: what the motion takes."""
    most = max((points for points, _ in _taken.values()), default=0)
    total = sum(needed for _, needed in _taken.values())
    return f"; {most:,} key points take {total / 1e9:.2g} GB of it" if total else ""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether a device refused memory. Taichi raises RuntimeError then, as for all else."""
    return isinstance(error, RuntimeError) and _FAILED.search(str(error)) is not None
