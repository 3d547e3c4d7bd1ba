"""How a particle answers the lights: colour, highlight and sheen of 16 particles at once (see `finish`, `fibre`).

What a picture does not need is compiled out: more lights, shadows, occlusion, the lobes of a fibre (`Shading`).
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

from dataclasses import dataclass
from math import pi

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, Template
from taichi_cloth.ground.particles import COLOUR, NORMAL, POSITION, TANGENT
from taichi_cloth.ground.vectors import Blocks, Vec16

from .fibre import lobes

__all__ = ["CONSTANT_ROWS", "PLAIN", "Shading", "rise", "shade"]

# Rows of the argument `c` of `project`, three numbers each.
ROTATION, TRANSLATION, EYE = 0, 3, 4
LENS = 5  # focal [px], cx, cy [px]
KEY_DIRECTION, KEY, SKY, GROUND = 6, 7, 8, 9
FIBRE = 10  # share of the fibre's diffuse term, specular strength, exponent / 16
SURFACE = 11  # tint of the highlight, sheen, gain of the slope across the fibre
IMAGE = 12  # width, height [px], near [m]
DEPTH = 13  # nearest depth [m], keys per metre, opacity of all
EDGE = 14  # edge of the sprite, 0 for crisp; share of the key light that openness takes; sharpness of lobe R
LOBES = 15  # weights of R, TT, TRT
OTHERS = 16  # further lights: direction and radiance, two rows a light
MOST_OTHERS = 8
DOME = OTHERS + 2 * MOST_OTHERS  # how much the zenith differs from the horizon
CONSTANT_ROWS = DOME + 1

WRAP = 0.25
"""How far the light reaches round the terminator: fibre assemblies scatter light sideways."""


@dataclass(frozen=True)
class Shading:
    """Which parts of the shading there are: a compile-time switch.

    shadows: the row of `light` that holds the transmittance of each light, the key first, or -1. sky: the row of
    the share of the sky that is seen, or -1. lobes: the model of `fibre` instead of Kajiya's and Kay's. dome: the
    sky has a horizon of another colour than its zenith.
    """

    shadows: tuple[int, ...] = (-1,)
    sky: int = -1
    lobes: bool = False
    dome: bool = False

    @property
    def others(self) -> int:
        return len(self.shadows) - 1

    @property
    def rows(self) -> int:
        """Rows of `light`."""
        return max(*self.shadows, self.sky, -1) + 1


PLAIN = Shading()
"""One light, no shadows, no occlusion: no light pass."""


@ti.func
def lobe(cosine, sixteenth):
    """max(0, 1 - p (1 - x) / 16) ^ 16 with sixteenth = p / 16 (see `finish`)."""
    power = ti.max(1.0 - sixteenth * (1.0 - cosine), 0.0)
    power = power * power
    power = power * power
    power = power * power
    return power * power


@ti.func
def bounced(opening, albedo):
    """Occlusion with the light that neighbours of the same colour send on.

    The fit of J. Jimenez, X.-C. Wu, A. Pesce, A. Jarabo, "Practical real-time strategies for accurate indirect
    occlusion", technical memo ATVI-TR-19-01 (SIGGRAPH 2016 course).
    """
    a = 2.0404 * albedo - 0.3324
    b = -4.7951 * albedo + 0.6417
    d = 2.7552 * albedo + 0.6903
    return ti.max(opening, ((opening * a + b) * opening + d) * opening)


@ti.func
def rise(c):
    """2 / (3 pi) (sin b + (pi - b) cos b) of c = cos b (see `Lighting.ambient`), within 0.002."""
    square = c * c
    return c * (1.0 / 3.0) + (2.0 / (3.0 * pi)) * (1.0 + square * (0.5 + square * (0.5 * pi - 1.5)))


@ti.func
def shade(layout: Template, shading: Template, particles: Blocks, light: Blocks, c: F32x2, b):
    """Red, green, blue; and for the slope across the fibre: v (3), sin(t, v), how far it faces the key light."""
    tx = particles[TANGENT, b]
    ty = particles[TANGENT + 1, b]
    tz = particles[TANGENT + 2, b]
    nx = particles[NORMAL, b]
    ny = particles[NORMAL + 1, b]
    nz = particles[NORMAL + 2, b]
    vx = c[EYE, 0] - particles[POSITION, b]
    vy = c[EYE, 1] - particles[POSITION + 1, b]
    vz = c[EYE, 2] - particles[POSITION + 2, b]
    unit = 1.0 / ti.sqrt(vx * vx + vy * vy + vz * vz + 1e-20)
    vx *= unit
    vy *= unit
    vz *= unit
    t_v = tx * vx + ty * vy + tz * vz
    n_v = nx * vx + ny * vy + nz * vz
    sin_v = ti.sqrt(ti.max(1.0 - t_v * t_v, 0.0))
    grazing = ti.max(1.0 - ti.abs(n_v), 0.0)
    grazing *= grazing
    sheen = grazing * grazing * c[SURFACE, 1]
    upward = 0.5 + 0.5 * ny
    opening = Vec16(1.0)
    if ti.static(layout.openness):
        opening = ti.min(ti.max(particles[layout.openness_row, b], 0.0), 1.0)
    tint = c[SURFACE, 0]
    albedo_r = particles[COLOUR, b]
    albedo_g = particles[COLOUR + 1, b]
    albedo_b = particles[COLOUR + 2, b]
    fill_r = c[GROUND, 0] + (c[SKY, 0] - c[GROUND, 0]) * upward
    fill_g = c[GROUND, 1] + (c[SKY, 1] - c[GROUND, 1]) * upward
    fill_b = c[GROUND, 2] + (c[SKY, 2] - c[GROUND, 2]) * upward
    if ti.static(shading.dome):
        above = rise(ny)
        fill_r += c[DOME, 0] * above
        fill_g += c[DOME, 1] * above
        fill_b += c[DOME, 2] * above
    if ti.static(shading.sky >= 0):
        seen = light[b, shading.sky] * opening
        fill_r *= bounced(seen, albedo_r)
        fill_g *= bounced(seen, albedo_g)
        fill_b *= bounced(seen, albedo_b)
    else:
        fill_r *= opening
        fill_g *= opening
        fill_b *= opening
    red = albedo_r * fill_r
    green = albedo_g * fill_g
    blue = albedo_b * fill_b
    key_facing = Vec16(0.0)
    for k in ti.static(range(1 + shading.others)):
        at = ti.static(KEY_DIRECTION if k == 0 else OTHERS + 2 * (k - 1))
        t_l = tx * c[at, 0] + ty * c[at, 1] + tz * c[at, 2]
        n_l = nx * c[at, 0] + ny * c[at, 1] + nz * c[at, 2]
        sin_l = ti.sqrt(ti.max(1.0 - t_l * t_l, 0.0))
        facing = ti.min(ti.max((n_l + WRAP) * (1.0 / (1.0 + WRAP)), 0.0), 1.0)
        lambert = ti.max(n_l, 0.0)
        lit = lambert + c[FIBRE, 0] * (sin_l * facing - lambert)
        rim = sheen
        passed = Vec16(1.0)
        if ti.static(layout.openness):
            rim *= opening
        if ti.static(shading.shadows[k] >= 0):
            passed = light[b, shading.shadows[k]]
            rim *= passed
        if ti.static(layout.openness):
            passed *= 1.0 - c[EDGE, 1] * (1.0 - opening)
        lit *= passed
        rim *= 0.35 + 0.65 * facing
        gleam = Vec16(0.0)
        if ti.static(not shading.lobes):
            gleam = lobe(sin_l * sin_v - t_l * t_v, c[FIBRE, 2]) * facing * c[FIBRE, 1]
            gleam *= passed
        if ti.static(shading.lobes):
            l_v = c[at, 0] * vx + c[at, 1] * vy + c[at, 2] * vz
            r, tt, trt = lobes(t_l, t_v, sin_l, sin_v, l_v, c[EDGE, 2], c[LOBES, 0], c[LOBES, 1], c[LOBES, 2])
            # A white surface facing the light has the radiance `key`: the light's irradiance is pi times that.
            incoming = pi * sin_l * passed
            gleam = r * incoming * facing
            inside = trt * incoming * facing
            beyond = tt * incoming
            if ti.static(shading.shadows[k] < 0):  # nothing else keeps the light from passing through the cloth
                beyond *= opening * opening * facing
            lit *= 1.0 - c[LOBES, 0] - c[LOBES, 1] - c[LOBES, 2]
            red += c[at + 1, 0] * (albedo_r * inside + ti.sqrt(ti.max(albedo_r, 0.0)) * beyond)
            green += c[at + 1, 1] * (albedo_g * inside + ti.sqrt(ti.max(albedo_g, 0.0)) * beyond)
            blue += c[at + 1, 2] * (albedo_b * inside + ti.sqrt(ti.max(albedo_b, 0.0)) * beyond)
        gleam += rim
        red += c[at + 1, 0] * (albedo_r * lit + gleam * (1.0 + tint * (albedo_r - 1.0)))
        green += c[at + 1, 1] * (albedo_g * lit + gleam * (1.0 + tint * (albedo_g - 1.0)))
        blue += c[at + 1, 2] * (albedo_b * lit + gleam * (1.0 + tint * (albedo_b - 1.0)))
        if ti.static(k == 0):
            key_facing = ti.min(2.0 * facing, 1.0)
            if ti.static(shading.shadows[0] >= 0):
                key_facing *= passed
    return red, green, blue, vx, vy, vz, sin_v, key_facing
