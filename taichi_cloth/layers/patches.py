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
from taichi_cloth.layers.nearest import dot

__all__ = ["slack_of"]


@ti.func
def slack_of(s_low: Template, s_high: Template, t_low: Template, t_high: Template):
    """By how much each thread of a patch may differ, as a share of its length; at most 0 where it may meet itself.
    s_low to t_high: boxes of its threads along rows and columns, over their lengths at rest, by axis; of one patch, or
    of lanes of them."""
    s, u = halves(s_low, s_high)
    t, v = halves(t_low, t_high)
    # a along s and b along t, each turned from the other by half of what they lean on each other.
    lean = 0.5 * dot(s, t)
    a, b = turned(s, t, lean), turned(t, s, lean)
    size_a, size_b = sizes(a), sizes(b)
    least = ti.min(dot(a, s) - dot(size_a, u), dot(b, t) - dot(size_b, v))
    across = dot(a, t) + dot(b, s)
    slack = 0.5 * (least - 0.5 * (ti.max(across, -across) + dot(size_a, v) + dot(size_b, u)))
    thin = ti.min(ti.min(ti.min(u[0], u[1]), u[2]), ti.min(ti.min(v[0], v[1]), v[2]))
    return ti.select(thin < 0.0, -1.0, slack)


@ti.func
def halves(low: Template, high: Template):
    """Middle and half width of boxes."""
    middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    return middle, (0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), 0.5 * (high[2] - low[2]))


@ti.func
def turned(one: Template, other: Template, lean):
    """Unit vector along the first, less so much of the other."""
    x, y, z = one[0] - lean * other[0], one[1] - lean * other[1], one[2] - lean * other[2]
    scale = 1.0 / (ti.sqrt(x * x + y * y + z * z) + 1e-9)
    return x * scale, y * scale, z * scale


@ti.func
def sizes(v: Template):
    """Of the parts of a vector."""
    return ti.max(v[0], -v[0]), ti.max(v[1], -v[1]), ti.max(v[2], -v[2])
