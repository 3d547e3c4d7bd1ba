"""How much memory fields take on a device, and the refusal of what no device would take."""

import re
from collections.abc import Iterable
from typing import Any

import taichi as ti
from taichi.lang.matrix import MatrixField

from taichi_cloth.ground.errors import InputError

__all__ = ["MOST_BYTES", "field_bytes", "is_out_of_memory", "require_device_memory"]

MOST_BYTES = 2_000_000_000
"""Of all fields together that are made before a kernel runs: they are one buffer, and a device with Vulkan may refuse
one of more than 2 GB."""

_FAILED = re.compile(r"out.of.memory|failed to allocate", re.IGNORECASE)


def field_bytes(*holders: Any) -> int:
    """Bytes of all fields that these objects hold, however deep; each field is counted once."""
    seen: set[int] = set()
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


def require_device_memory(what: str, points: int, holders: Iterable[Any]) -> None:
    """Raises InputError, with how much would fit, where the fields of `points` key points are more than one buffer may
    have."""
    needed = field_bytes(*holders)
    if needed > MOST_BYTES:
        raise InputError(
            f"{what}: {points:,} key points take {needed / 1e9:.1f} GB on the device, of {MOST_BYTES / 1e9:.0f} GB "
            f"in one piece; about {int(0.95 * points * MOST_BYTES / needed):,} would fit, or use --arch cpu"
        )


def is_out_of_memory(error: BaseException) -> bool:
    """Whether a device refused memory. Taichi raises RuntimeError then, as for all else."""
    return isinstance(error, RuntimeError) and _FAILED.search(str(error)) is not None
