"""Colours side by side, mixed by the light that they send back: a thin cloth of a bulk's colour c sends back

    r(c) = c (DARK - LESS c^3), of a darker one than SURFACE_SHARE as of that,

of what falls on it, within 6 % of a plain weave of cotton at 0.06 to 0.95 under a path tracer (half a sky, and a light
from 45 degrees, their mean), see `docs/appearance.md`; the rest is swallowed or shines through. So a sheet of black and
white threads is darker than one whose threads all have the mean colour. Plain arithmetic, for numbers, arrays and in
kernels.

Threads of another colour send another light to a thread than its own kind does, of which it sends on a part: where
beside nothing but black a white one sends back a share `alone` of what it does among white ones, one that sends back r
among others that send back o sends back r (1 + (1 - alone) (o - r) / r(1)), as two surfaces do that see each other (the
radiosity of a groove).

Of a sky, of which much falls at flat angles, the darker a cloth is the more it sends back over what it does of lights,
and to the side more than straight ahead: `under_sky`. So threads of two colours send back less of a sky than a cloth of
their mean, which is as dark all over.
"""

from typing import Any

import numpy as np
import taichi as ti

__all__ = ["ASLANT", "SURFACE_SHARE", "colour_in_kernel", "lit_among", "sent_back", "sent_back_in_kernel", "under_sky"]

SURFACE_SHARE = 0.031
"""What a thick mass of cotton fibres sends back before light gets to their dye, of any colour: none is darker."""

DARK, LESS = 0.78, 0.155
WHITE = DARK - LESS
"""r(1)."""
EVEN, DARKER = 1.05, 0.43
"""Of a sky over of lights, of a white cloth, and how much more of a black one: path traced (`docs/appearance.md`)."""
ASLANT, LESS_ABOVE = 0.65, (0.29, 1.08)
"""That is of a cloth seen at this cosine to its normal; how much less for each unit that it is more, of a white cloth
and how much less yet of a black one: so the rms of `under_sky` beside a path tracer's pictures of two plain weaves, a
twill and a satin, of 0.9, 0.5 and 0.1, seen at cosines of 0.2 to 1, is 0.07, where it was 0.19."""
TURNS = 5
"""Of Newton's method, after which r's inverse is within 1e-6."""


def sent_back(colour: Any) -> Any:
    """r(c): share of the light that a thin cloth of a colour sends back."""
    seen = np.maximum(colour, SURFACE_SHARE)
    return seen * (DARK - LESS * seen * seen * seen)


@ti.func
def sent_back_in_kernel(colour):
    """As `sent_back`, in a kernel."""
    seen = ti.max(colour, SURFACE_SHARE)
    return seen * (DARK - LESS * seen * seen * seen)


@ti.func
def lit_among(sent, others, alone):
    """What a thread sends back among others, where it and they send back so much of light that comes from elsewhere."""
    return sent * (1.0 + (1.0 - alone) * ti.static(1.0 / WHITE) * (others - sent))


@ti.func
def under_sky(sent, eye):
    """What a cloth that sends back so much sends back of a sky, over what it does by Lambert's law. eye: cosine between
    its normal and the view."""
    dark, steeper = 1.0 - ti.min(sent * ti.static(1.0 / WHITE), 1.0), eye - ASLANT
    return EVEN - LESS_ABOVE[0] * steeper + dark * (DARKER - LESS_ABOVE[1] * steeper)


@ti.func
def colour_in_kernel(share):
    """The colour of a thin cloth that sends back a share: r's inverse, white where that is more than white does."""
    most = ti.min(share, WHITE)
    colour = most / DARK
    for _ in ti.static(range(TURNS)):
        less = LESS * colour * colour * colour
        colour -= (colour * (DARK - less) - most) / (DARK - 4.0 * less)
    return colour
