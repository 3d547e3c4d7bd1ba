"""An exponential in packed instructions."""

import taichi as ti

__all__ = ["decay"]


@ti.func
def decay(x):
    """exp(-x) for x of 0 to 16, as (Pade of x / 16)^16: packed instructions, no call. Error below 1e-6, 2 % at 15."""
    y = ti.min(x, 16.0) * 0.0625
    even = 1.0 + y * y * (1.0 / 12.0)
    value = (even - 0.5 * y) / (even + 0.5 * y)
    value = value * value
    value = value * value
    value = value * value
    return value * value
