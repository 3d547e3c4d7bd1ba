"""Light that goes from fibre to fibre: what a particle in a cloth or a yarn sends on, beside its own highlights.

A colour is all that a bulk, a thick mass of such fibres, sends back: what their surfaces do before light gets to their
dye, `SURFACE_SHARE` of any colour, and of the rest a share a (Chiang, Bitterli, Tappan, Burley, "A practical and
controllable hair and fur model for production path tracing", CGF 35(2), 2016, equation 9), see `dyed`. A thin cloth of
it sends on less on the side that is lit, and the rest shines through. With the transmittance T at a particle, N half a
yarn nearer to the light and U out of the cloth, the share of the sky S that it sees, F and G that a cloth there sees
before and behind it, the direction b that is open to it, its tangent t, phi the angle between light l and view v round
the fibre, and A how far it is in a yarn alone (`seen.look`),

    L = key T E (w0 C(phi) (1 + p) / 2 + BACK max(cos phi, 0)^4)
      + key T E C(pi - phi) (A w1 (1 + ROUND (U - T) (1 - S)) + w D)
      + key T S g G + key T^2 E f exp(-FORWARDS (1 + l.v))
      + key N w2 p (1 - FLATTER (1 - p)) (1 - ALONE A S)
      + key w3 max(-b.l, 0) ((1 - NEARER) U (1 - SHUT S) + NEARER N (1 - A))
      + sky(b) F (w4 + w5 S) + sky(-b) G (w6 + w7 (1 - S))
    p = max(b.l, 0)
    C(phi) = (sin phi + (pi - phi) cos phi) / pi                     a Lambertian cylinder
    D = (1 - BARED S) (1 + ROUND_ONCE (U - T) (1 - S)) exp(-1.5 (1 + cos phi) - (t.l + t.v)^2)
    G = `fibre.grazed`                                               light that grazes what both it and the eye see
    E = h exp(-k (t.l + t.v)^2)                                      about the cone of a fibre's highlights, see `cone`

Light that goes from fibre to fibre of a yarn, which lie nearly one way, stays near the cone round them on which each of
them sends it on (`fibre`), until it has been sent on often: E. What has been sent on often at a place has come there
over half a yarn, so it is what gets to the fibres that far towards the light, N: a light at a flat angle ends in the
crowns, and one from straight before the cloth goes down between them. What is turned by little, by few fibres, is of
the topmost ones: T S, T^2. What surfaces of fibres mirror, whatever their dye, comes back round them nearly whence it
came (BACK), and goes on nearly straight (w). What has gone through a cloth is the brighter the nearer to the side that
it comes from, as the diffuse flux in a slab is (Schuster's two streams): who sees little of the sky before the cloth is
near its other side, hence S with what is before it and 1 - S with what is behind it; and a part of it, too, is what
gets to the fibres half a yarn nearer. A yarn alone lets out at its sides what a cloth keeps, and light gets through it
every way: A. Each weight is w = b + r sqrt(a) + a (c0 + c1 a + c2 a^2), which never falls with a. b, which w5 and w
have, is of the fibres' surfaces, and r of what has gone once through a dark fibre, where the share that it lets through
grows as fast at first, as in w, g and f. All were found together, on a plain weave, satins, twills, a basket and a yarn
of all their fibres, of colours from black to 0.95, under lights from the front, the side, behind and at a flat angle
and under half skies, seen from two sides, and on flat pieces of plain and satin under lights all round, by a path
tracer (`docs/appearance.md`). With an even sky all round, w4 + w5 S + w6 + w7 (1 - S) is all of the light there is: at
most 1, which is what white sends on, at any depth. Of a cloth that maps of light do not look into, less
is seen of a sky from straight before it and more from aside than S says: by `view.FROM_ABOVE`.
"""

from functools import cache
from math import radians, sin
from typing import Any

import numpy as np
import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.mixing import SURFACE_SHARE

__all__ = [
    "AHEAD", "ALONE", "ALONG", "BACK", "BARED", "BODY", "FITTED_SPREAD", "FLATTER", "FORWARD", "FORWARDS", "GRAZED",
    "NEARER", "OF_KEY", "OF_SKY", "ONCE", "ROUND", "ROUND_ONCE", "SHUT", "THROUGH_ALONE", "cone", "dyed", "weight",
]  # fmt: skip

OF_KEY = (
    (0.0, 0.0, 1.071, -1.071, 0.357),
    (0.0, 0.0, 0.044, 1.304, -0.884),
    (0.0, 0.0, 0.0, 2.33, -1.333),
)
THROUGH_ALONE = (0.0, 0.0, 1.198, 0.949, -1.032)
ONCE, GRAZED, FORWARD = (0.11, 0.09, 0.0, 0.0, 0.0), (0.0, 1.285, 0.0, 0.0, 0.0), (0.0, 0.411, 0.0, 0.0, 0.0)
BACK = 0.022
OF_SKY = (
    (0.0, 0.002, 0.0, 0.389, -0.261),
    (0.049, 0.0, 1.658, -0.935, 0.071),
    (0.0, 0.0, 0.043, -0.022, 0.001),
    (0.0, 0.0, 0.334, 1.855, -1.348),
)
"""b, r, c0, c1, c2 of the weights w0, w2, w3 and w4 to w7; THROUGH_ALONE: w1; ONCE: w, of light that goes through but
one fibre before it is seen; GRAZED: g, of light that comes back forwards from the topmost fibres; FORWARD: f, of what
has gone on forwards through a few of them; BACK: of what surfaces mirror back round the fibre."""


ALONG = 1.5
"""How fast light that fibres of a yarn send to one another falls off from the cone of their highlights, where these are
as wide as the fibres' that were fitted."""

FITTED_SPREAD = 10.0
"""Half width of their highlights along them [degrees], see `Finish.spread`."""

ALONE = 0.6
"""Of the light that gets to a cloth and is sent on in it, what leaves a yarn alone at its sides."""

SHUT = 0.85
"""How much less of a light behind a cloth gets to its fibres that see all of the sky before it: to a flat cloth, too,
some of it."""

FLATTER = 0.15
"""How much less than by the cosine of a light that grazes a cloth is sent on often in it."""

NEARER = 0.35
"""Of light from behind a cloth that is sent on often in it, what is as gets to the fibres half a yarn nearer."""

AHEAD, ROUND_ONCE, BARED = (1.5, 1.0), 5.0, 0.6
"""Light that goes through but one fibre before it is seen, as most does that gets through dark ones: how fast it falls
off from straight on, round the fibre and from the cone of its highlights; as `ROUND`; and how much less
of it is seen of fibres that see all of the sky before the cloth."""

ROUND = 2.0
"""How much more of a light on the other side gets round the fibres that are in its way, from one to the next, to those
that see little of the sky: over what gets there straight, as a share of what does not."""

FORWARDS = 1.5
"""How fast light that has been turned by little a few times falls off from straight on."""

BODY = 0.81
"""What the highlights of the fibres that were fitted leave of the light: of others that have more it is less."""


@ti.func
def weight(c: Template, a, root):
    """b + r sqrt(a) + a (c0 + c1 a + c2 a^2), shape of a. root: sqrt(a)."""
    total = a * (c[2] + a * (c[3] + a * c[4]))
    if ti.static(c[1] > 0.0):
        total += c[1] * root
    if ti.static(c[0] > 0.0):
        total += c[0]
    return total


def dyed(colour: Any, surface: float = SURFACE_SHARE) -> Any:
    """The a at which surface + (1 - surface) a is a bulk's colour: what of it is left to the dye; 0 of a colour darker
    than the surface alone."""
    return np.maximum(np.subtract(colour, surface) / (1.0 - surface), 0.0)


@cache
def cone(spread: float) -> tuple[float, float]:
    """k and h of E = h exp(-k (t.l + t.v)^2) of fibres whose highlights are `spread` wide along them [degrees]: as much
    narrower than where it was fitted as they are, with as much light in all directions from all."""
    k = ALONG * (sin(radians(FITTED_SPREAD)) / sin(radians(spread))) ** 2
    return k, _sent_on(ALONG) / _sent_on(k)


def _sent_on(k: float) -> float:
    """Mean of exp(-k (x + y)^2) over all directions of light and view, but for a factor; x, y: sines of theirs to a
    fibre's normal plane, each by the cosine."""
    x, share = np.polynomial.legendre.leggauss(64)
    share = share * np.sqrt(1.0 - x * x)
    return float(share @ np.exp(-k * (x[:, None] + x) ** 2) @ share)
