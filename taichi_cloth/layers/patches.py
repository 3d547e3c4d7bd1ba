"""Parts of one sheet that cannot meet each other, by the directions of their threads alone.

A patch of whole cells is a map x(s, t) of a rectangle. Let a and b be two vectors. If for every triangle the matrix
(a·x_s, a·x_t; b·x_s, b·x_t) has a positive definite symmetric part, then (a·x, b·x) is strictly monotone on the
rectangle, which is convex, so no two places of the patch are in one place: it does not meet itself, and no contour has
to be looked at, as with cones of normals (Volino and Magnenat-Thalmann 1994; Provot 1997). It is enough that a·x_s and
b·x_t are above |a·x_t + b·x_s|/2, which holds all along straight paths if it does at both ends, for then it bounds
linear functions by convex ones.

All x_s of a patch lie in a box, and all x_t. What they may turn by before the condition is lost is the patch's slack.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Template

__all__ = ["slack_of"]


@ti.func
def slack_of(s_low: Template, s_high: Template, t_low: Template, t_high: Template):
    """By how much each thread of a patch may differ, as a share of its length; at most 0 where it may meet itself.
    s_low to t_high: boxes of its threads along rows and columns, over their lengths at rest."""
    s, t = 0.5 * (s_low + s_high), 0.5 * (t_low + t_high)
    u, v = 0.5 * (s_high - s_low), 0.5 * (t_high - t_low)
    # a along s and b along t, each turned from the other by half of what they lean on each other.
    lean = 0.5 * s.dot(t)
    a, b = s - lean * t, t - lean * s
    a, b = a / (a.norm() + 1e-9), b / (b.norm() + 1e-9)
    size_a, size_b = ti.abs(a), ti.abs(b)
    least = ti.min(a.dot(s) - size_a.dot(u), b.dot(t) - size_b.dot(v))  # pyright: ignore[reportOptionalCall]
    leaning = size_a.dot(v) + size_b.dot(u)  # pyright: ignore[reportOptionalCall]
    across = 0.5 * (ti.abs(a.dot(t) + b.dot(s)) + leaning)
    slack = 0.5 * (least - across)
    return ti.select((u.min() < 0.0) | (v.min() < 0.0), -1.0, slack)
