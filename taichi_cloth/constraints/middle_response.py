"""How the middle of a spring answers a thin solid: both ends by shares of their inverse masses, whatever lists them."""

import taichi as ti

from taichi_cloth.ground.arrays import Template

__all__ = ["middle_of", "respond", "room_for"]

ROOM, LEAST = 8, 1 << 18
"""Springs that may be near a thin solid, for each key point, and in all; one that is near two of them counts twice. To
cells as wide as a hand most of a body is thin: 3,000 springs may be near 40 solids at once; a
sheet over a walker had 132,304 of them."""


def room_for(size: int) -> int:
    """For how many springs near thin solids a sheet of so many elements has room."""
    return max(ROOM * size, LEAST)


@ti.func
def middle_of(points: Template, p, q):
    """Place of the middle between key points p and q, and its step [m]."""
    x, u = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
    for axis in ti.static(range(3)):
        x[axis] = 0.5 * (points.position[axis][p] + points.position[axis][q])
        u[axis] = 0.5 * (points.step[axis][p] + points.step[axis][q])
    return x, u


@ti.func
def respond(surface: Template, points: Template, i, p, q, plane, offset, since):
    """As `Response.respond`, of the middle between p and q and solid i. plane, offset: its normal and how far it is
    from the anchor [m] when the poses were worked out, `since` substeps ago."""
    shift, turn = surface.shift(i), surface.turn(i)
    # The middle, its step and its plane, where the solid is by now.
    x, u = middle_of(points, p, q)
    normal = plane + since * turn.cross(plane)
    x -= surface.anchor(i) + since * shift
    depth = surface.gap[None] - (normal.dot(x) - offset)
    if depth > 0.0:
        # The slip past the surface, and the push: the approach whole, of what was deep before `recovery`.
        u -= shift
        u -= turn.cross(x - 0.5 * u)  # half-way along the step
        approach = ti.max(-u.dot(normal), 0.0)
        push = ti.min(depth, approach + surface.recovery[None])
        pressed = ti.min(push, approach)
        friction = surface.friction[None]
        move = surface.change(u[0], u[1], u[2], normal[0], normal[1], normal[2], push, pressed, friction)
        out = (push - pressed) * normal
        # Both ends by shares of their inverse masses; what was deep before is no speed.
        here = 2.0 * points.inverse_mass[p] / (points.inverse_mass[p] + points.inverse_mass[q])
        for axis in ti.static(range(3)):
            points.position[axis][p] = points.position[axis][p] + here * move[axis]
            points.position[axis][q] = points.position[axis][q] + (2.0 - here) * move[axis]
            points.step[axis][p] = points.step[axis][p] + here * (move[axis] - out[axis])
            points.step[axis][q] = points.step[axis][q] + (2.0 - here) * (move[axis] - out[axis])
