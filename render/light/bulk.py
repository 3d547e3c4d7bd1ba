"""Light that goes from fibre to fibre: what a particle in a cloth or a yarn sends on, beside its own highlights.

A colour is all that a bulk, a thick mass of such fibres, sends back: what their surfaces do before light gets to their
dye, `SURFACE_SHARE` of any colour, and of the rest a share a (Chiang, Bitterli, Tappan, Burley, "A practical and
controllable hair and fur model for production path tracing", CGF 35(2), 2016, equation 9), see `dyed`. A thin cloth of
it sends on less on the side that is lit, and the rest shines through. With the transmittance T at a particle, U a
cloth's depth nearer to the light, the share of the sky S that it sees, F and G that a cloth there sees before and
behind it, the direction b that is open to it, its tangent t, and phi the angle between light l and view round the
fibre,

    L = key T sin(t, l) (w0 C(phi) (3 + 2 b.l) / 5 + w1 C(pi - phi))
      + key U (w2 max(b.l, 0) + w3 max(-b.l, 0) (1 - SHUT S))
      + sky(b) F (w4 + w5 S) + sky(-b) G (w6 + w7 (1 - S))
    C(phi) = (sin phi + (pi - phi) cos phi) / pi                     a Lambertian cylinder

What has gone through a cloth is the brighter the nearer to the side that it comes from, as the diffuse flux in a slab
is (Schuster's two streams): who sees little of the sky before the cloth is near its other side, hence S with what is
before it and 1 - S with what is behind it. Each weight is a polynomial w = b + a (c0 + c1 a + c2 a^2) that never falls
with a. b, which w0 and w5 have, is of the fibres' surfaces. All were found together at six colours on a plain weave, a
satin, a twill and a yarn of all their fibres, under lights from the front, the side, behind and at a flat angle and
under half skies, by a path tracer, b and what w5 has below 0.25 on a plain weave and a satin of three dark ones
(`docs/appearance.md`). With an even sky all round, w4 + w5 S + w6 + w7 (1 - S) is all of the light there is: at most
1, which is what white sends on, at any depth.
"""

from typing import Any

import numpy as np
import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.mixing import SURFACE_SHARE

__all__ = ["BODY", "OF_KEY", "OF_SKY", "SHUT", "dyed", "weight"]

OF_KEY = (
    (0.008, 0.963, -0.604, 0.082),
    (0.0, 2.633, -2.809, 0.999),
    (0.0, 0.0, 0.752, -0.494),
    (0.0, 0.0, 2.325, -1.550),
)
OF_SKY = (
    (0.0, 0.0, 0.630, -0.420),
    (0.040, 1.752, -1.515, 0.453),
    (0.0, 0.043, 0.091, -0.075),
    (0.0, 0.327, 1.537, -1.135),
)
"""b, c0, c1, c2 of the weights."""

SHUT = 0.85
"""How much less of a light behind a cloth gets to its fibres that see all of the sky before it: to a flat cloth, too,
some of it."""

BODY = 0.81
"""What the highlights of the fibres that were fitted leave of the light: of others that have more it is less."""


@ti.func
def weight(c: Template, a):
    """b + a (c0 + c1 a + c2 a^2), shape of a."""
    total = a * (c[1] + a * (c[2] + a * c[3]))
    if ti.static(c[0] > 0.0):
        total += c[0]
    return total


def dyed(colour: Any, surface: float = SURFACE_SHARE) -> Any:
    """The a at which surface + (1 - surface) a is a bulk's colour: what of it is left to the dye; 0 of a colour darker
    than the surface alone."""
    return np.maximum(np.subtract(colour, surface) / (1.0 - surface), 0.0)
