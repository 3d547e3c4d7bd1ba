"""How a solid's surface moves with its numbers: the derivatives that least squares turns it by, in closed form.

A point of the surface with outward normal d is pushed by g: of the signed distance of a place beside it, g = −d, since
what the foot slides along the surface counts for nothing (the envelope theorem); of a field that is asked at the
surface's farthest point in direction d, g is the field's gradient there.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.distance import cross
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.solids import Solid

__all__ = ["distance_slopes", "farthest_slopes"]

F64 = NDArray[np.float64]


def distance_slopes(solid: Solid, points: F64, distance: F64, normal: F64) -> F64:
    """Change, by each number, of the signed distances (n,) [m] of points (n, 3), normals (n, 3): (n, numbers)."""
    return _slopes(solid, points - distance[:, None] * normal, normal, -normal)


def farthest_slopes(solid: Solid, far: F64, directions: F64, gradient: F64) -> F64:
    """The same of a field with this gradient (n, 3) at the farthest points (n, 3) in unit directions (n, 3)."""
    return _slopes(solid, far, directions, gradient)


def _slopes(solid: Solid, at: F64, normal: F64, push: F64) -> F64:
    made = solid.primitive
    assert made is not None
    slopes = _elliptic(solid, made, at, normal, push) if solid.kind == "elliptic" else _cone(made, at, normal, push)
    return slopes if solid.free is None else slopes @ solid.free


def _cone(made: Primitive, at: F64, normal: F64, push: F64) -> F64:
    """A ball of radius r₁ + u (r₂ − r₁) that moves from start to end, of which a normal n belongs to one u."""
    r1, r2 = made.radii
    grows = (push * normal).sum(axis=1)[:, None]
    if made.kind == "sphere":
        return np.concatenate([push, r1 * grows], axis=1)
    span = made.end - made.start
    square, lean = span @ span, r1 - r2
    if square <= lean**2:  # one ball holds the other
        u = np.full((len(at), 1), float(r2 > r1))
    else:
        u = np.clip(((at - made.start) @ span - r1 * lean) / (square - lean**2), 0, 1)[:, None]
    return np.concatenate([(1 - u) * push, u * push, (1 - u) * r1 * grows, u * r2 * grows], axis=1)


def _elliptic(solid: Solid, made: Primitive, at: F64, normal: F64, push: F64) -> F64:
    """The inner cylinder, semi-axes a and b and half length h, grown by r, in its frame (x, y, axis).

    On its flank a normal (m, n) belongs to (a² m, b² n)/s with s² = a² m² + b² n².
    """
    assert made.across is not None
    assert solid.across is not None
    span = made.end - made.start
    length = float(np.sqrt(span @ span))
    x, axis, r = made.across, span / length, made.rounding
    frame = np.stack([x, cross(axis, x), axis])
    (m, n, k), (gx, gy, gz) = frame @ normal.T, frame @ push.T
    fx, fy, fz = frame @ (at - r * normal - (made.start + made.end) / 2).T
    a, b = made.radii[0] - r, made.radii[1] - r
    flank = np.hypot(m, n) > 1e-9  # else on a cap, where the flank does not matter
    share = flank / np.maximum(np.hypot(a * m, b * n), 1e-12)
    p, q = a * m * share, b * n * share  # the foot in units of a and b
    by_a = p * (2 - p * p) * gx - b / a * q * p * p * gy
    by_b = q * (2 - q * q) * gy - a / b * p * q * q * gx
    by_half = np.sign(k) * gz
    by_round = m * gx + n * gy + k * gz - by_a - by_b - by_half
    slide = a * a * b * b * share**3 * (n * gx - m * gy)  # along (n, −m), as the normal turns the other way
    by_turn = np.stack(
        [
            fy * gz - fz * gy - k * slide * m,
            fz * gx - fx * gz - k * slide * n,
            fx * gy - fy * gx + slide * (m * m + n * n),
        ],
        axis=1,
    )
    least = int(np.argmin([*made.radii, length / 2]))
    whole = r / min(*made.radii, length / 2)  # the rounding follows the least of the three
    follows = whole * by_round[:, None] * (np.arange(3) == least)
    by_length = (by_half + follows[:, 2]) / 2
    before = solid.across @ axis  # the axis leans to where `across` is counted from: what lies across turns with it
    cosine, sine = np.cos(solid.numbers[8]), np.sin(solid.numbers[8])
    spin = -before / np.sqrt(1 - before**2) * np.array([sine, cosine, 0])
    leans = np.stack([by_turn[:, 1], -by_turn[:, 0], length * by_length], axis=1) + by_turn[:, 2:] * spin
    logit = 1 / (1 + np.exp(np.clip(solid.numbers[9], -30, 30)))
    return np.concatenate(
        [
            push,
            leans @ frame / length,
            (made.radii[0] * (by_a + follows[:, 0]))[:, None],
            (made.radii[1] * (by_b + follows[:, 1]))[:, None],
            by_turn[:, 2:],
            (r * logit * by_round)[:, None],
        ],
        axis=1,
    )
