"""How a particle answers the lights: colour, highlight and sheen of 16 particles at once (see `finish`, `fibre`).

What a picture does not need is compiled out: more lights, shadows, occlusion, the lobes of a fibre (`Shading`).
"""

from dataclasses import dataclass
from math import pi

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, Template
from taichi_cloth.ground.mixing import ASLANT
from taichi_cloth.ground.particles import COLOUR, NORMAL, POSITION, TANGENT
from taichi_cloth.ground.vectors import Octets, each, of_group, of_row

from ..maps.decay import decay
from .bulk import (
    AHEAD,
    ALONE,
    BACK,
    BARED,
    FLATTER,
    FORWARD,
    FORWARDS,
    GRAZED,
    NEARER,
    OF_KEY,
    OF_SKY,
    ONCE,
    ROUND,
    ROUND_ONCE,
    SHUT,
    THROUGH_ALONE,
    weight,
)
from .fibre import grazed, lobes
from .view import (
    ABOVE,
    BULK,
    COAT,
    CONE,
    DOME,
    DYE,
    EDGE,
    EYE,
    FIBRE,
    GROUND,
    KEY_DIRECTION,
    LOBES,
    OTHERS,
    SKY,
    SURFACE,
)

__all__ = ["PLAIN", "Shading", "rise", "shade"]

WRAP = 0.25
"""How far the light reaches round the terminator: fibre assemblies scatter light sideways."""


@dataclass(frozen=True)
class Shading:
    """Which parts of the shading there are: a compile-time switch.

    shadows: the row of `light` that holds the transmittance of each light, the key first, or -1.
    sky: the row of the share of the sky that is seen, or -1.
    lobes: the model of `fibre` instead of Kajiya's and Kay's.
    dome: the sky has a horizon of another colour than its zenith.
    bulk: light goes from fibre to fibre (see `bulk`). After the row of a light come one of what reaches the cloth
    there and one of what reaches the fibres around, and after that of the sky the six of `seen.look`.
    """

    shadows: tuple[int, ...] = (-1,)
    sky: int = -1
    lobes: bool = False
    dome: bool = False
    bulk: bool = False

    @property
    def of_light(self) -> int:
        """Rows of a light that casts shadows."""
        return 3 if self.bulk else 1

    @property
    def of_sky(self) -> int:
        """Rows of the sky."""
        return 7 if self.bulk else 1

    @property
    def others(self) -> int:
        return len(self.shadows) - 1

    @property
    def rows(self) -> int:
        """Rows of `light`."""
        last = max(self.shadows)
        return max(last + self.of_light if last >= 0 else 0, self.sky + self.of_sky if self.sky >= 0 else 0)


PLAIN = Shading()
"""One light, no shadows, no occlusion: no maps of light."""


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
def _sky(shading: Template, view: F32x2, up):
    """What comes from all round on a surface whose normal has the height `up`: between ground and sky, with a brighter
    horizon or zenith. Red, green, blue."""
    upward = 0.5 + 0.5 * up
    red = view[GROUND, 0] + (view[SKY, 0] - view[GROUND, 0]) * upward
    green = view[GROUND, 1] + (view[SKY, 1] - view[GROUND, 1]) * upward
    blue = view[GROUND, 2] + (view[SKY, 2] - view[GROUND, 2]) * upward
    if ti.static(shading.dome):
        above = rise(up)
        red += view[DOME, 0] * above
        green += view[DOME, 1] * above
        blue += view[DOME, 2] * above
    return red, green, blue


@ti.func
def _dyed(view: F32x2, colour):
    """The a of a bulk's colour (see `bulk.dyed`)."""
    return ti.max(colour * view[DYE, 0] - view[DYE, 1], 0.0)


@ti.func
def _alike(view: F32x2, seen):
    """Of what a particle sees that is not the sky, what is of its colour and not black."""
    return 1.0 - view[DYE, 2] * (1.0 - seen)


@ti.func
def _root(albedo):
    """What half the way through a fibre, or once through a dark one, leaves of light."""
    return ti.sqrt(ti.max(albedo, 0.0))


@ti.func
def _sent(albedo, root, seen, alike, front, back, inner, mirror):
    """Of the sky's light before a cloth and behind it, what a particle in it sends on that sees a share of the sky.
    inner, mirror: by what and by how much less than always what it sends on and what it mirrors (`FROM_ABOVE`)."""
    before = alike * weight(OF_SKY[0], albedo, root) + seen * (inner * weight(OF_SKY[1], albedo, root) - mirror)
    behind = weight(OF_SKY[2], albedo, root) + (1.0 - seen) * weight(OF_SKY[3], albedo, root)
    return front * before + back * behind


@ti.func
def _from_sky(shading: Template, view: F32x2, b, v, along, albedo, root, shares):
    """What a particle in a bulk sends on of light from all round: of the sky before the cloth, of that behind it, and
    as its fibres' highlights. b: the direction open to it; v: to the eye; along: t.v times the height of t; shares:
    of the sky that it sees, and the cloth before and behind it."""
    seen, before, behind = shares
    front, back, gleam = _sky(shading, view, b[1]), _sky(shading, view, -b[1]), _sky(shading, view, v[1] - 2.0 * along)
    alike = _alike(view, seen)
    steeper = ti.abs(b[0] * v[0] + b[1] * v[1] + b[2] * v[2]) - ASLANT
    inner, mirror = 1.0 - view[ABOVE, 0] * steeper, view[ABOVE, 1] * steeper
    shine = view[BULK, 2] * seen * before
    before *= view[BULK, 0]
    behind *= view[BULK, 0]
    red = _sent(albedo[0], root[0], seen, alike, before * front[0], behind * back[0], inner, mirror)
    green = _sent(albedo[1], root[1], seen, alike, before * front[1], behind * back[1], inner, mirror)
    blue = _sent(albedo[2], root[2], seen, alike, before * front[2], behind * back[2], inner, mirror)
    red += shine * gleam[0] * (1.0 + view[COAT, 0] * (albedo[0] - 1.0))
    green += shine * gleam[1] * (1.0 + view[COAT, 0] * (albedo[1] - 1.0))
    blue += shine * gleam[2] * (1.0 + view[COAT, 0] * (albedo[2] - 1.0))
    return red, green, blue


@ti.func
def _parts(shadowed: Template, view: F32x2, b_l, facing_eye, around, along, forward, light, seen, closed):
    """The eight parts of a light on a particle in a bulk (see `bulk`). facing_eye: l.v; around: cosine of the angle
    between light and view round the fibre; along: t.l + t.v; forward: G; light: what is there of it at the particle, at
    the fibres around and of what reaches the cloth; seen: of the sky; closed: how far the cloth is no yarn alone."""
    arriving, near, outside = light
    around = ti.min(ti.max(around, -1.0), 1.0)
    whole = 1.5 * view[BULK, 0] * view[COAT, 1]
    gain = (whole * view[CONE, 1]) * decay(view[CONE, 0] * along * along)
    here, behind = gain * arriving, outside - arriving
    # Where no map does it, the direction that is open keeps light from passing through the cloth.
    unseen = view[BULK, 1] if ti.static(shadowed) else 1.0
    faced = ti.max(b_l, 0.0)
    turned, shown = ti.max(0.2 + 0.8 * b_l, 0.0), 0.5 + 0.5 * faced
    facing = here * rise(around) * (shown + unseen * (turned - shown))
    hidden = 1.0 + unseen * (turned - 1.0)
    grazing = whole * arriving * seen * forward * hidden
    onwards = here * arriving * decay(FORWARDS * (1.0 + facing_eye)) * hidden
    round_it = here * rise(-around) * hidden
    beyond = round_it * (1.0 + ROUND * behind * (1.0 - seen)) * (1.0 - closed)
    ahead = round_it * (1.0 - BARED * seen) * (1.0 + ROUND_ONCE * behind * (1.0 - seen))
    ahead *= decay(AHEAD[0] * (1.0 + around) + AHEAD[1] * along * along)
    alike = view[BULK, 0] * _alike(view, seen)
    mirrored = ti.max(around, 0.0) * ti.max(around, 0.0)
    back = BACK * here * mirrored * mirrored * hidden
    before = (
        alike * near * view[CONE, 2] * faced * (1.0 - FLATTER * (1.0 - faced)) * (1.0 - ALONE * seen * (1.0 - closed))
    )
    through = (1.0 - NEARER) * outside * (1.0 - SHUT * seen) + NEARER * near * closed
    after = alike * ti.max(-b_l, 0.0) * through
    return facing, before, after, ahead, grazing, onwards, beyond, back


@ti.func
def _lit(parts, albedo, root):
    """Of a light, what a particle sends on: its parts as of `bulk`, each with its weight."""
    total = weight(OF_KEY[0], albedo, root) * parts[0]
    for j in ti.static(range(1, 3)):
        total += weight(OF_KEY[j], albedo, root) * parts[j]
    total += weight(ONCE, albedo, root) * parts[3] + weight(GRAZED, albedo, root) * parts[4]
    total += weight(FORWARD, albedo, root) * parts[5] + weight(THROUGH_ALONE, albedo, root) * parts[6]
    return total + parts[7]


@ti.func
def _to_eye(particles: Octets, view: F32x2, b):
    """The unit direction to the eye."""
    vx = view[EYE, 0] - of_group(particles, POSITION, b)
    vy = view[EYE, 1] - of_group(particles, POSITION + 1, b)
    vz = view[EYE, 2] - of_group(particles, POSITION + 2, b)
    unit = 1.0 / ti.sqrt(vx * vx + vy * vy + vz * vz + 1e-20)
    vx *= unit
    vy *= unit
    vz *= unit
    return vx, vy, vz


@ti.func
def _albedo(shading: Template, particles: Octets, view: F32x2, b):
    """Red, green, blue; in a bulk what is left to the dye."""
    red = of_group(particles, COLOUR, b)
    green = of_group(particles, COLOUR + 1, b)
    blue = of_group(particles, COLOUR + 2, b)
    if ti.static(shading.bulk):
        red, green, blue = _dyed(view, red), _dyed(view, green), _dyed(view, blue)
    return red, green, blue


@ti.func
def shade(layout: Template, shading: Template, particles: Octets, light: Octets, view: F32x2, b):
    """Red, green, blue; and for the slope across the fibre: v (3), sin(t, v), where light comes from (3)."""
    # Tangent t and normal n of the fibre, direction v to the eye, and how they stand to each other.
    tx = of_group(particles, TANGENT, b)
    ty = of_group(particles, TANGENT + 1, b)
    tz = of_group(particles, TANGENT + 2, b)
    nx = of_group(particles, NORMAL, b)
    ny = of_group(particles, NORMAL + 1, b)
    nz = of_group(particles, NORMAL + 2, b)
    vx, vy, vz = _to_eye(particles, view, b)
    t_v = tx * vx + ty * vy + tz * vz
    n_v = nx * vx + ny * vy + nz * vz
    sin_v = ti.sqrt(ti.max(1.0 - t_v * t_v, 0.0))
    # What does not hang on a light: sheen seen at a flat angle, (1 - |n . v|)^4, openness, and the albedo.
    grazing = ti.max(1.0 - ti.abs(n_v), 0.0)
    grazing *= grazing
    sheen = grazing * grazing * view[SURFACE, 1]
    opening = each(1.0)
    if ti.static(layout.openness):
        opening = ti.min(ti.max(of_group(particles, layout.openness_row, b), 0.0), 1.0)
    albedo_r, albedo_g, albedo_b = _albedo(shading, particles, view, b)
    root_r, root_g, root_b = _root(albedo_r), _root(albedo_g), _root(albedo_b)
    red, green, blue = each(0.0), each(0.0), each(0.0)
    seen, bx, by, bz = each(1.0), nx, ny, nz  # its share of the sky, and the direction that is open to it
    closed = each(1.0)
    if ti.static(shading.bulk):
        # Light from all round: on the cloth there, through it, and as its fibres' highlights.
        before, behind = each(1.0), each(1.0)
        if ti.static(shading.sky >= 0):
            sky = ti.static(shading.sky)
            seen, before, behind = of_row(light, b, sky), of_row(light, b, sky + 1), of_row(light, b, sky + 2)
            bx, by, bz = of_row(light, b, sky + 3), of_row(light, b, sky + 4), of_row(light, b, sky + 5)
            closed = of_row(light, b, sky + 6)
        seen *= 1.0 - view[BULK, 1] * (1.0 - opening)
        albedo, root, shares = (albedo_r, albedo_g, albedo_b), (root_r, root_g, root_b), (seen, before, behind)
        red, green, blue = _from_sky(shading, view, (bx, by, bz), (vx, vy, vz), t_v * ty, albedo, root, shares)
    else:
        # Light from all around, less what neighbours hide of it.
        red, green, blue = _sky(shading, view, ny)
        if ti.static(shading.sky >= 0):
            seen = of_row(light, b, shading.sky) * opening
            red *= bounced(seen, albedo_r)
            green *= bounced(seen, albedo_g)
            blue *= bounced(seen, albedo_b)
        else:
            red *= opening
            green *= opening
            blue *= opening
        red *= albedo_r
        green *= albedo_g
        blue *= albedo_b
    from_x, from_y, from_z = each(0.0), each(0.0), each(0.0)  # directions to lights, each by how much of it gets here
    # Each light, the key first.
    for k in ti.static(range(1 + shading.others)):
        at = ti.static(KEY_DIRECTION if k == 0 else OTHERS + 2 * (k - 1))
        # Diffuse light: of a surface (Lambert) or of a fibre, which also faces what comes from beside it.
        t_l = tx * view[at, 0] + ty * view[at, 1] + tz * view[at, 2]
        n_l = nx * view[at, 0] + ny * view[at, 1] + nz * view[at, 2]
        sin_l = ti.sqrt(ti.max(1.0 - t_l * t_l, 0.0))
        facing = ti.min(ti.max((n_l + WRAP) * (1.0 / (1.0 + WRAP)), 0.0), 1.0)
        lambert = ti.max(n_l, 0.0)
        lit = lambert + view[FIBRE, 0] * (sin_l * facing - lambert)
        # How much of the light gets here, past what casts shadows and past the particle's own neighbours.
        rim, passed = sheen, each(1.0)
        if ti.static(layout.openness):
            rim *= opening
        if ti.static(shading.shadows[k] >= 0):
            passed = of_row(light, b, shading.shadows[k])
            rim *= passed
        if ti.static(layout.openness):
            passed *= 1.0 - view[EDGE, 1] * (1.0 - opening)
        lit *= passed
        rim *= 0.35 + 0.65 * facing
        # The highlight: one lobe around the fibre, or the three of a fibre that light also passes through.
        gleam = each(0.0)
        if ti.static(not shading.lobes):
            gleam = lobe(sin_l * sin_v - t_l * t_v, view[FIBRE, 2]) * facing * view[FIBRE, 1]
            gleam *= passed
        if ti.static(shading.lobes):
            l_v = view[at, 0] * vx + view[at, 1] * vy + view[at, 2] * vz
            weights = ti.Vector([view[LOBES, j] for j in ti.static(range(3))])
            r, tt, trt = lobes(t_l, t_v, sin_l, sin_v, l_v, view[EDGE, 2], weights)
            # A white surface facing the light has the radiance `key`: the light's irradiance is pi times that.
            incoming = pi * sin_l * passed
            gleam = r * incoming * facing
            inside = trt * incoming * facing
            beyond = tt * incoming
            if ti.static(shading.shadows[k] < 0):  # nothing else keeps the light from passing through the cloth
                beyond *= opening * opening * facing
            if ti.static(not shading.bulk):
                lit *= 1.0 - view[LOBES, 0] - view[LOBES, 1] - view[LOBES, 2]
            red += view[at + 1, 0] * (albedo_r * inside + root_r * beyond)
            green += view[at + 1, 1] * (albedo_g * inside + root_g * beyond)
            blue += view[at + 1, 2] * (albedo_b * inside + root_b * beyond)
        lit_r, lit_g, lit_b = albedo_r * lit, albedo_g * lit, albedo_b * lit
        if ti.static(shading.bulk):
            outside, near = each(1.0), each(1.0)
            if ti.static(shading.shadows[k] >= 0):
                outside, near = of_row(light, b, shading.shadows[k] + 1), of_row(light, b, shading.shadows[k] + 2)
            b_l = bx * view[at, 0] + by * view[at, 1] + bz * view[at, 2]
            to_eye = view[at, 0] * vx + view[at, 1] * vy + view[at, 2] * vz
            around = (to_eye - t_l * t_v) / ti.max(sin_l * sin_v, 1e-4)
            forward = grazed(t_l, t_v, sin_l, sin_v, to_eye, view[EDGE, 2])
            there = (passed, near, outside)
            parts = _parts(
                ti.static(shading.shadows[k] >= 0), view, b_l, to_eye, around, t_l + t_v, forward, there, seen, closed
            )
            lit_r, lit_g = _lit(parts, albedo_r, root_r), _lit(parts, albedo_g, root_g)
            lit_b = _lit(parts, albedo_b, root_b)
        # Highlights have the light's colour, and as much of the fibre's as the finish's tint says.
        gleam += rim
        red += view[at + 1, 0] * (lit_r + gleam * (1.0 + view[SURFACE, 0] * (albedo_r - 1.0)))
        green += view[at + 1, 1] * (lit_g + gleam * (1.0 + view[SURFACE, 0] * (albedo_g - 1.0)))
        blue += view[at + 1, 2] * (lit_b + gleam * (1.0 + view[SURFACE, 0] * (albedo_b - 1.0)))
        towards = ti.min(2.0 * facing, 1.0) * (view[at + 1, 0] + view[at + 1, 1] + view[at + 1, 2])
        if ti.static(shading.shadows[k] >= 0):
            towards *= passed
        x, y, z = towards * view[at, 0], towards * view[at, 1], towards * view[at, 2]
        from_x, from_y, from_z = from_x + x, from_y + y, from_z + z
    return red, green, blue, vx, vy, vz, sin_v, from_x, from_y, from_z
