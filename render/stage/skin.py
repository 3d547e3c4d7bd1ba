"""How skin answers light, beside Lambert's law: light that goes on under it, and a soft shine.

Light that enters skin comes out some way off, red the farthest: 3.67, 1.37 and 0.68 mm in red, green and blue, which is
1 / sqrt(3 sa (sa + ss)) of "skin 1" of H. W. Jensen, S. R. Marschner, M. Levoy, P. Hanrahan, "A practical model for
subsurface light transport", SIGGRAPH 2001. On a body rounded as a limb is, that blurs max(n.l, 0) by so much of an
angle:

    (n.l + sqrt((n.l)^2 + w^2)) / 2,   w = 0.8 x path / radius

is 0.4 sigma at the terminator, as a Gaussian of sigma = path / radius makes it. The shine is that of a rough surface of
index 1.4 (T. Weyrich et al., "Analysis of human faces using a measurement-based skin reflectance model", SIGGRAPH 2006,
whose slopes are about 0.3): Blinn's lobe under a light; of the sky what Fresnel sends back, less at the rim, as it is
rough (S. Lagarde, "Adopting a physically based shading model", 2011).
"""

import taichi as ti

__all__ = ["BLEED", "REFLECTED", "blurred", "shine", "sky_shine"]

LIMB = 0.03
"""Radius [m] of what is lit: between that of an arm and that of a face's features."""
BLEED = tuple(0.8 * path / LIMB for path in (3.67e-3, 1.37e-3, 0.68e-3))
"""Sine by which the edge of what is lit is blurred, of red, green and blue."""
REFLECTED = ((1.4 - 1.0) / (1.4 + 1.0)) ** 2
"""Of light that falls on it straight."""
EXPONENT = 20.0
"""Of Blinn's lobe: 2 / slope^2 - 2 at a slope of 0.3."""
RIM = 0.45
"""What Fresnel sends back at the rim of so rough a surface."""


@ti.func
def blurred(cosine, width):
    """max(cosine, 0), its edge blurred."""
    return 0.5 * (cosine + ti.sqrt(cosine * cosine + width * width))


@ti.func
def shine(normal, light, view):
    """What a light sends off the surface, over what a white one that faces it sends back. light, view: towards both."""
    half = (light + view).normalized()
    facing = ti.max(normal.dot(light), 0.0)
    aside = 1.0 - ti.max(half.dot(view), 0.0)
    fresnel = REFLECTED + (1.0 - REFLECTED) * aside * aside * aside * aside * aside
    return facing * fresnel * ti.static((EXPONENT + 2.0) / 8.0) * ti.max(normal.dot(half), 0.0) ** EXPONENT


@ti.func
def sky_shine(normal, view):
    """Share of the sky in the mirrored direction that it sends on."""
    aside = 1.0 - ti.min(ti.abs(normal.dot(view)), 1.0)
    return REFLECTED + (RIM - REFLECTED) * aside * aside * aside * aside * aside
