"""Signed distance and outward normal of primitives in kernels, for a number or for several lanes at once.

The formulas and their sources are in `distance.py`. No branch, so that lanes become vector instructions. Points come
relative to the primitive's anchor; vectors of the primitive are unit.
"""

import taichi as ti

__all__ = ["EVERYWHERE", "cone", "ellipse", "local", "prism"]

EVERYWHERE = 12
"""Steps of Newton that give 1e-6 m everywhere, for semi-axes down to a twelfth of each other."""

_ASIDE = 1e-8  # [m]: a point on an axis is taken as one beside it, so that it has a normal


@ti.func
def cone(x, y, z, axis, across, radius, sine, slope, length):
    """Round-capped, tapered cylinder; a sphere where `length` is 0. Anchor: the first centre.

    It is all balls of radius `radius` − sine·t around axis·t, t from 0 to `length` [m]; sine: (r₁ − r₂)/length of the
    flank; slope: its tangent. Returns the distance [m] and the normal.
    """
    # Along the axis, and beside it: what is put aside would be lost in the rounding of x far from the anchor.
    along = x * axis[0] + y * axis[1] + z * axis[2]
    qx = x - along * axis[0] + _ASIDE * across[0]
    qy = y - along * axis[1] + _ASIDE * across[1]
    qz = z - along * axis[2] + _ASIDE * across[2]
    radial = ti.sqrt(qx * qx + qy * qy + qz * qz)
    # From the nearest centre.
    t = ti.min(ti.max(along - slope * radial, 0.0), length)
    x, y, z = qx + (along - t) * axis[0], qy + (along - t) * axis[1], qz + (along - t) * axis[2]
    far = ti.sqrt(ti.max(x * x + y * y + z * z, 1e-24))
    scale = 1.0 / far
    return far - (radius - sine * t), x * scale, y * scale, z * scale


@ti.func
def _newton(u, rp, q, less):
    a, b = 1.0 / (u + less), 1.0 / u
    y0, y1 = rp * a, q * b
    square = y0 * y0 + y1 * y1
    return (ti.sqrt(square) - 1.0) * square / (y0 * y0 * a + y1 * y1 * b)


@ti.func
def ellipse(px, py, long, short, steps):
    """Signed distance [m] to the ellipse with semi-axes long ≥ short, and the normal. steps: of Newton.

    Outside, where |(p, q)| > 1, that is a lower bound of u too: r h ≥ h + r − 1 for h ≥ 1.
    """
    ratio = (long / short) * (long / short)
    less = ratio - 1.0
    p, q = ti.abs(px) / long, ti.max(ti.abs(py) / short, 1e-6)
    rp = ratio * p
    least = ti.max(q, rp - less)
    far = ti.sqrt(p * p + q * q)
    u = ti.max(least, far * ti.min(ti.max((far - 1.0) * 1e30, 0.0), 1.0))
    for _ in range(steps):
        u = ti.max(u + _newton(u, rp, q, less), least)
    y0, y1 = rp / (u + less), q / u
    scale = 1.0 / ti.sqrt(y0 * y0 + y1 * y1)
    y0, y1 = y0 * scale, y1 * scale
    nx, ny = y0 / long, y1 / short
    scale = 1.0 / ti.sqrt(nx * nx + ny * ny)
    nx, ny = nx * scale, ny * scale
    flank = (ti.abs(px) - long * y0) * nx + (ti.abs(py) - short * y1) * ny
    return flank, nx * px / ti.max(ti.abs(px), 1e-30), ny * py / ti.max(ti.abs(py), 1e-30)


@ti.func
def prism(flank, nx, ny, along, half, rounding):
    """From the distance and normal of a cross-section and the place along the axis [m]: those of the prism of half
    length `half` grown by `rounding`: the distance, and shares of the normal across, other and along."""
    cap = ti.abs(along) - half
    side, end = ti.max(flank, 0.0), ti.max(cap, 0.0)
    far = ti.sqrt(side * side + end * end)
    deep = ti.min(ti.max(flank, cap), 0.0)
    scale = 1.0 / ti.max(far, 1e-20)
    inside = 1.0 - ti.min(far * 1e30, 1.0)
    flat = ti.min(ti.max((cap - flank) * 1e30, 0.0), 1.0)  # whether the cap is nearer than the flank
    side = side * scale + inside * (1.0 - flat)
    end = (end * scale + inside * flat) * along / ti.max(ti.abs(along), 1e-30)
    return far + deep - rounding, side * nx, side * ny, end


@ti.func
def local(x, y, z, axis):
    """Share of a vector along a unit vector [m]; never 0, so that it has a sign."""
    return x * axis[0] + y * axis[1] + z * axis[2] + _ASIDE
