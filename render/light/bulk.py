"""Light that goes from fibre to fibre: what a particle in a cloth or a yarn sends on, beside its own highlights.

A colour a is that of the bulk, of a thick mass of such fibres (Chiang, Bitterli, Tappan, Burley, "A practical and
controllable hair and fur model for production path tracing", CGF 35(2), 2016, equation 9). A thin cloth of it sends on
less on the side that is lit, and the rest shines through. With the transmittance T at a particle, U a cloth's depth
nearer to the light, the share of the sky S that it sees, F and G that a cloth there sees before and behind it, the
direction b that is open to it, its tangent t, and phi the angle between light l and view round the fibre,

    L = key (T sin(t, l) (w0 C(phi) max(1 + 4 b.l, 0) / 5 + w1 C(pi - phi)) + U (w2 max(b.l, 0) + w3 max(-b.l, 0)))
      + sky(b) F (w4 + w5 S) + sky(-b) G w6
    C(phi) = (sin phi + (pi - phi) cos phi) / pi                     a Lambertian cylinder

each weight a polynomial w = a (c0 + c1 a + c2 a^2), all of them found at three colours on a plain weave, a satin, a
twill and a yarn of all their fibres, under lights from the front, the side, behind and at a flat angle and under half
skies, by a path tracer (`docs/appearance.md`). With an even sky all round, w4 + w5 + w6 is all of the light there is:
at most 1, which is what white sends on.
"""

import taichi as ti

__all__ = ["BODY", "OF_KEY", "OF_SKY", "weight"]

OF_KEY = (
    (1.16, -0.58, 0.0),
    (2.5, -1.25, 0.0),
    (0.0, 0.39, -0.234),
    (0.0, 0.88, -0.586),
)
OF_SKY = (
    (0.6998, 0.0689, -0.1823),
    (0.9037, -1.3095, 0.4758),
    (0.1465, 0.7301, -0.5336),
)
"""c0, c1, c2 of the weights."""

BODY = 0.81
"""What the highlights of the fibres that were fitted leave of the light: of others that have more it is less."""


@ti.func
def weight(c, a):
    """a (c0 + c1 a + c2 a^2), shape of a."""
    return a * (c[0] + a * (c[1] + a * c[2]))
