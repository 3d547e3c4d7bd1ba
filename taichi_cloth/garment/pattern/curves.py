"""Edges of a panel as polylines: straight, quadratic and cubic Bézier, circular arc; what is measured on them."""

from math import acos, ceil, hypot, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["FLATNESS", "along", "arc", "bezier", "from_relative", "length"]

F64 = NDArray[np.float64]

FLATNESS = 1e-4
"""Largest distance between a curve and the polyline that stands for it [m]."""


def bezier(control: Any, flatness: float = FLATNESS) -> F64:
    """(k, 2) points along a Bézier curve with control points (2 to 4, 2) [m], ends included and exact.

    Pieces: a curve of second difference d keeps within d/(8 n²) of n chords, times 2 (quadratic) or 6 (cubic).
    """
    c = np.asarray(control, np.float64)
    degree = len(c) - 1
    if degree == 1:
        return c.copy()
    bend = float(np.linalg.norm(np.diff(c, n=2, axis=0), axis=1).max()) * degree * (degree - 1)
    n = min(max(1, ceil(sqrt(bend / (8 * flatness)))), 512)
    t = np.linspace(0.0, 1.0, n + 1)[:, None]
    steps = np.broadcast_to(c[:, None, :], (len(c), n + 1, 2))
    while len(steps) > 1:  # de Casteljau, all t at once
        steps = steps[:-1] * (1 - t) + steps[1:] * t
    out = steps[0].copy()
    out[0], out[-1] = control[0], control[-1]
    return out


def arc(start: Any, end: Any, radius: float, *, large: bool, right: bool, flatness: float = FLATNESS) -> F64:
    """(k, 2) points along a circular arc [m]. right: it bulges to the right of the way from start to end where it is
    the small one, as an SVG arc with its sweep flag set does when y points up. Raises InputError on a radius under
    half the chord."""
    p, q = np.asarray(start, np.float64), np.asarray(end, np.float64)
    chord = float(hypot(*(q - p)))
    if chord <= 0 or radius < chord / 2 * (1 - 1e-9):
        raise InputError(f"circle: radius {radius:g} m with ends {chord:g} m apart; allowed: half of that or more")
    half = min(chord / (2 * radius), 1.0)
    offset = radius * sqrt(max(1 - half * half, 0.0))
    left = np.array([-(q - p)[1], (q - p)[0]]) / chord
    centre = (p + q) / 2 + left * (offset if right != large else -offset)
    a0, a1 = (float(np.arctan2(*(x - centre)[::-1])) for x in (p, q))
    sweep = (a1 - a0) % (2 * pi) if right else -((a0 - a1) % (2 * pi))
    n = max(1, ceil(abs(sweep) / (2 * acos(max(1 - flatness / radius, -1.0)))))
    angle = a0 + sweep * np.linspace(0.0, 1.0, n + 1)
    out = centre + radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    out[0], out[-1] = p, q
    return out


def from_relative(start: Any, end: Any, point: Any) -> F64:
    """A control point (2,) given as shares along the edge and to its left, of the edge's length."""
    p, e = np.asarray(start, np.float64), np.asarray(end, np.float64) - np.asarray(start, np.float64)
    return p + point[0] * e + point[1] * np.array([-e[1], e[0]])


def length(points: F64) -> float:
    """Of a polyline (k, d) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def along(points: F64, share: F64) -> F64:
    """Points (n, d) at shares (n,) of the length of a polyline (k, d)."""
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.clip(share, 0.0, 1.0) * steps[-1]
    return np.stack([np.interp(at, steps, points[:, k]) for k in range(points.shape[1])], -1)
