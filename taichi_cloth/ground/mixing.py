"""Colours side by side, mixed by the light that they send back: a thin cloth of a bulk's colour a sends back

    r(a) = a (WHITE - LESS a)

of what falls on it, within 4 % of a plain weave of cotton at 0.15, 0.6 and 0.95 under a path tracer, see
`docs/appearance.md`; the rest is swallowed or shines through. So a sheet of black and white threads is darker than one
whose threads all have the mean colour. Plain arithmetic, for numbers, arrays and in kernels.
"""

from typing import Any

import taichi as ti

__all__ = ["colour_in_kernel", "sent_back", "sent_back_in_kernel"]

WHITE, LESS = 0.934, 0.3175


def sent_back(colour: Any) -> Any:
    """r(a): share of the light that a thin cloth of a colour sends back."""
    return colour * (WHITE - LESS * colour)


@ti.func
def sent_back_in_kernel(colour):
    """As `sent_back`, in a kernel."""
    return colour * (WHITE - LESS * colour)


@ti.func
def colour_in_kernel(share):
    """The colour of a thin cloth that sends back a share: r's inverse, the largest of r from there on."""
    return (WHITE - ti.sqrt(ti.max(WHITE * WHITE - 4.0 * LESS * share, 0.0))) * (0.5 / LESS)
