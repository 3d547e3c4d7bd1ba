"""Random numbers that kernels find where they ask for them, the same in any order of work, and how thick a thread is in
a place, which follows from them (see `unevenness`)."""

from math import sqrt

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, Template
from taichi_cloth.yarn.unevenness import CV, LEAST, LONG, MOST_HASHED, ROWS, SHARES, SHORT

__all__ = ["hashed", "thick_at", "wider_at"]


@ti.func
def hashed(a, b):
    """A whole number from 0 to 2²⁴ − 1 from two."""
    x = ti.cast(a * 73856093 + b * 19349663 + 83492791, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    return ti.cast((x ^ (x >> 16)) & ti.cast(0xFFFFFF, ti.u32), ti.i32)


@ti.func
def _at(seed, x, number: Template):
    """Of a row of random numbers with mean 0 that is linear between them, times what gives it its share."""
    k = ti.cast(ti.floor(x), ti.i32)
    low, high = hashed(seed, 2 * k + number), hashed(seed, 2 * k + 2 + number)
    # An even number from −1 to 1 has a variance of 1/3, of which two thirds are left between.
    return ti.static(sqrt(4.5 * SHARES[number])) * ((low + (x - k) * (high - low)) * ti.static(2.0 / MOST_HASHED) - 1.0)


@ti.func
def thick_at(uneven: F32x1, family, seed, along):
    """By how much of its width a thread is wider than on average at a crossing, of its long places alone. seed: a whole
    number of its own. along: crossings from its beginning."""
    return uneven[ROWS * family + CV] * _at(seed, along * uneven[ROWS * family + LONG], 0)


@ti.func
def wider_at(uneven: F32x1, family, seed, along):
    """How wide a thread is at a crossing over its mean."""
    short = uneven[ROWS * family + CV] * _at(seed, along * uneven[ROWS * family + SHORT], 1)
    return ti.max(1.0 + thick_at(uneven, family, seed, along) + short, LEAST)
