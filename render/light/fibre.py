"""One fibre in the light: reflection, light passing through, and light reflected inside (R, TT, TRT).

S. R. Marschner, H. W. Jensen, M. Cammarano, S. Worley, P. Hanrahan, "Light scattering from human hair fibers",
SIGGRAPH 2003: each lobe is a longitudinal part M times an azimuthal part N, over the squared cosine of half the
difference of the inclinations. With s_i = t.l and s_r = t.v, the sines of the inclinations to the fibre's normal
plane, phi the angle between l and v around the fibre, and cos^2 th_d = (1 + cos th_i cos th_r + s_i s_r) / 2:

    f = sum over R, TT, TRT of  w A M(s_i + s_r) N(phi) / cos th_d
    M(y)     = sqrt(q / pi) exp(-q y^2),  q = 1 / (2 (2 beta)^2)        widths beta, beta / 2, 2 beta
    N_R      = cos(phi / 2) / 4                                         (Marschner's own, integrates to 1)
    N_TT     = exp(-k (1 + cos phi)) / (2 pi e^-k I0(k)),  k = 3.65     (k as in B. Karis, "Physically based
    N_TRT    = exp(-k (1 - cos phi)) / (2 pi e^-k I0(k)),  k = 2         hair shading in Unreal", SIGGRAPH 2016)

Departures: M is a Gaussian in the sum of the sines, which integrates to 1 over th_r exactly with its cosine, and
needs no arcsine (Karis does the same); scales are left out, since the fibres of a yarn lie either way round; TRT
is broad, because textile fibres are not round; A is the fibre's colour (TRT), its root (TT: half the way through
the fibre) or 1 (R, whose weight grows towards grazing light as Schlick's (1 - x)^5).

Of light that grazes a cloth, seen against it, most has been turned by little: mirrored at flat angles, as by Fresnel,
and through one fibre or few. Of it, with x = cos(phi / 2) cos th_d, on the cone of the fibre's highlights the cosine of
half the angle between l and v,

    G = cos(phi / 2) (1 - x)^(3/2) M_TT(s_i + s_r) cos th_i / cos th_d
"""

from math import pi

import numpy as np
import taichi as ti

from ..maps.decay import decay

__all__ = ["grazed", "lobes"]

K_TT, K_TRT = 3.65, 2.0
N_TT = float(1 / (2 * pi * np.exp(-K_TT) * np.i0(K_TT)))
N_TRT = float(1 / (2 * pi * np.exp(-K_TRT) * np.i0(K_TRT)))


@ti.func
def _along(y, q):
    return ti.sqrt(q * (1.0 / pi)) * decay(q * y * y)


@ti.func
def _between(s_i, s_r, cos_i, cos_r, l_v):
    """cos phi, cos (phi / 2), cos th_d."""
    cos_phi = (l_v - s_i * s_r) / ti.max(cos_i * cos_r, 1e-4)
    cos_phi = ti.min(ti.max(cos_phi, -1.0), 1.0)
    return cos_phi, ti.sqrt(0.5 + 0.5 * cos_phi), ti.sqrt(ti.max(0.5 + 0.5 * (cos_i * cos_r + s_i * s_r), 1e-4))


@ti.func
def grazed(s_i, s_r, cos_i, cos_r, l_v, sharpness):
    """G, shape of the arguments. l_v, sharpness: see `lobes`."""
    _, half, cos_d = _between(s_i, s_r, cos_i, cos_r, l_v)
    turned = 1.0 - half * cos_d
    return turned * ti.sqrt(turned) * half * _along(s_i + s_r, 4.0 * sharpness) * cos_i / cos_d


@ti.func
def lobes(s_i, s_r, cos_i, cos_r, l_v, sharpness, weights):
    """R, TT, TRT without their colours, shape of the arguments. l_v: sharpness: q of R; weights: w of each."""
    reflect, transmit, internal = weights[0], weights[1], weights[2]
    cos_phi, half, cos_d = _between(s_i, s_r, cos_i, cos_r, l_v)
    y = s_i + s_r
    graze = 1.0 - half * cos_d
    fresnel = graze * graze
    fresnel = fresnel * fresnel * graze
    mirrored = reflect + (1.0 - reflect) * fresnel * ti.min(4.0 * reflect, 1.0)
    over = 1.0 / cos_d
    r = mirrored * 0.25 * half * _along(y, sharpness) * over
    tt = transmit * ti.static(N_TT) * decay(ti.static(K_TT) * (1.0 + cos_phi)) * _along(y, 4.0 * sharpness) * over
    trt = internal * ti.static(N_TRT) * decay(ti.static(K_TRT) * (1.0 - cos_phi)) * _along(y, 0.25 * sharpness) * over
    return r, tt, trt
