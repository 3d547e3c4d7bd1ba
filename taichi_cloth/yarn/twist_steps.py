"""A twisting machine's drive, and the time steps the twist equations take through it."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import ceil, inf, isfinite, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["BACKWARDS", "GAMMA", "Array", "Drive", "drive_at", "finite", "line", "speed_at", "time_steps"]

Array = NDArray[np.float64]
Drive = float | Callable[[float], float]
"""A number, or a function of the time [s] that returns one."""

GAMMA = 1.0 - 1.0 / sqrt(2.0)
"""Alexander's SDIRK2: order 2, L-stable, the second stage is the new state. No step is too long for it."""

LARGEST_STEP_COUNT = 2_000_000
DEFAULT_STEPS_PER_OUTPUT = 8
DEFAULT_ZONE_FRACTION = 0.02  # of the shorter zone, that the yarn may move in one step


def finite(name: str, value: ArrayLike, *, lowest: float = -inf, above: bool = False) -> Array:
    array = np.asarray(value, dtype=np.float64)
    wrong = ~np.isfinite(array) | ((array <= lowest) if above else (array < lowest))
    if np.any(wrong):
        rule = "finite" if lowest == -inf else f"finite and {'above' if above else 'at least'} {lowest:g}"
        raise InputError(f"{name}: {array[wrong].flat[0]:g} is not allowed; it must be {rule}")
    return array


BACKWARDS = "the yarn cannot run backwards, bringing in unknown twist from behind C; use 0 or more, or swap the zones"


def line(times_s: ArrayLike, a_m: float, b_m: float) -> tuple[float, float, Array]:
    a = float(finite("twist.a_m", a_m, lowest=0, above=True))
    b = float(finite("twist.b_m", b_m, lowest=0, above=True))
    times = finite("twist.times_s", times_s)
    if times.ndim != 1 or len(times) < 1 or np.any(np.diff(times) <= 0):
        raise InputError("twist.times_s: give a list of one or more times, each later than the one before")
    return a, b, times


def time_steps(
    times: Array, shorter_zone: float, speed: Drive, max_step: float | None
) -> Iterator[tuple[float, float, bool]]:
    """(start, length, ends at an entry of times) of every step."""
    if max_step is not None and not (isfinite(max_step) and max_step > 0):
        raise InputError(f"twist.max_step_s: {max_step:g} is not allowed; it must be finite and above 0")
    counts: list[int] = []
    for begin, end in pairwise(times):
        if max_step is not None:
            count = ceil((end - begin) / max_step * (1 - 1e-12))
        else:
            fastest = max(speed_at(speed, t) for t in np.linspace(begin, end, 5))
            moved = fastest * (end - begin) / shorter_zone
            count = max(DEFAULT_STEPS_PER_OUTPUT, ceil(moved / DEFAULT_ZONE_FRACTION))
        counts.append(max(count, 1))
    if sum(counts) > LARGEST_STEP_COUNT:
        raise InputError(
            f"twist.max_step_s: {sum(counts)} steps are needed, the limit is {LARGEST_STEP_COUNT};"
            " ask for a shorter time or a longer step"
        )
    return _walk(times, counts)


def _walk(times: Array, counts: Sequence[int]) -> Iterator[tuple[float, float, bool]]:
    for begin, end, count in zip(times[:-1], times[1:], counts, strict=True):
        h = float(end - begin) / count
        for i in range(count):
            yield float(begin) + i * h, h, i == count - 1


def drive_at(name: str, drive: Drive, t: float) -> float:
    value = float(drive(t) if callable(drive) else drive)
    if not isfinite(value):
        raise InputError(f"{name}: {value} at {t:g} s; it must be finite")
    return value


def speed_at(drive: Drive, t: float) -> float:
    value = drive_at("twist.speed_m_s", drive, t)
    if value < 0:
        raise InputError(f"twist.speed_m_s: {value:g} at {t:g} s; {BACKWARDS}")
    return value
