"""Drawn fibres that are fewer than a yarn's, and so thicker: how thick, how far apart, and how far each stands out.

A yarn of a few thick fibres hides what is behind it as all of its own do, is as wide, and sees as much of the sky.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.yarn.spin import drawn_radius
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["covered", "further_apart", "leaning", "standing_out", "thicker_by", "twist_of"]

F64 = NDArray[np.float64]
LAYERS = 1.5
"""Fibres that lie before one another across a drawn yarn, at least."""
MOST_OF_THICKNESS = 1.3
"""Of the yarn, that a drawn fibre takes: one stands for many side by side."""
MOST_APART = 1.6
"""How much further apart drawn fibres are laid than those that they stand for, at most."""
SEEN = 1.5
"""How much farther out those lie that are seen of the fibres that a drawn one stands for, over how much thicker than
they it is at equal area: between thick fibres one sees deeper into a yarn, in proportion to their radius. Found on
poplin of 36, 12 and 4 of 87 fibres, so that openness and normals of what is seen are those of all of them."""
STATIONS = 192
"""Along a yarn's period, at which its width is taken."""


def thicker_by(radius: F64, fibres: int, size: F64) -> F64:
    """How much thicker drawn fibres of a radius (t, 1) [m] must be for a yarn of a size (t, 2) [m], width and
    thickness, to let no light through, (t, 1): 1 where they are many enough. A real yarn has dozens before one another.
    """
    wanted = LAYERS * size[:, :1] / (2 * fibres)
    return np.maximum(1.0, np.minimum(wanted, MOST_OF_THICKNESS * size[:, 1:] / 2) / radius)


def further_apart(across: F64, scale: F64, radius: F64, width: F64) -> F64:
    """How much further apart than spun the drawn fibres are laid, (t,), so that they cover their yarn's width: on
    average along it, or as far as MOST_APART goes. Hundreds of real fibres reach its sides all along; a few that
    wander through its section mostly do not.

    across: (f, k) of the spun fibres. scale: (t,) of it. radius: (t, f) [m]. width: (t,) [m].
    """
    across = across[:, :: -(-across.shape[1] // STATIONS)]
    out = np.ones(len(width))
    alike = np.unique(np.column_stack([scale, radius[:, 0], width]), axis=0, return_index=True, return_inverse=True)
    for number, t in enumerate(alike[1].tolist()):
        low, high = 1.0, MOST_APART
        if covered(across * scale[t], radius[t]) < width[t]:
            for _ in range(10):
                middle = (low + high) / 2
                short = covered(across * (scale[t] * middle), radius[t]) < width[t]
                low, high = (middle, high) if short else (low, middle)
        out[alike[2].ravel() == number] = low
    return out


def covered(across: F64, radius: F64) -> float:
    """Width that fibres of some radii (f,) [m] hide, their middles across (f, k) [m] at k places: the mean [m]."""
    order = np.argsort(across - radius[:, None], axis=0)
    left = np.take_along_axis(across - radius[:, None], order, axis=0)
    right = np.maximum.accumulate(np.take_along_axis(across + radius[:, None], order, axis=0), axis=0)
    gaps = np.maximum(left[1:] - right[:-1], 0.0).sum(axis=0)
    return float((right[-1] - left[0] - gaps).mean())


def standing_out(radius: F64, grown: F64, share: float) -> F64:
    """How far beyond the middle of a drawn fibre of a radius (t, f) [m], made thicker by `grown` (t, 1), those lie that
    are seen of the ones that it stands for, (t, f) [m]. share: of a yarn's fibres that is drawn."""
    return SEEN * (1.0 - sqrt(share)) * radius / grown


def leaning(yarn: Yarn, fibres: int) -> float:
    """How far normals of `fibres` drawn ones a ply lean to the eye: how far beyond their middles those lie that are
    seen, on the eye's side, over how far these lie from the axis of a ply that they fill evenly, 2/3 of its radius."""
    drawn = min(fibres, yarn.fibres_in_section)
    radius = np.asarray(drawn_radius(yarn, drawn))
    out = standing_out(radius, np.ones_like(radius), drawn / yarn.fibres_in_section)
    return float(out) / (2 / 3 * sum(yarn.ply_axes) / 2)


def twist_of(section: F64, tangent: F64, ply: NDArray[np.integer]) -> float:
    """How fast the fibres of a yarn go round the middle of their ply [rad/m], the mean: where one lies d from there,
    its course leans across the yarn by this times d. section: (f, k, 2) [m]. tangent: (f, k, 3), x along. ply: (f,)."""
    turned = square = 0.0
    for number in np.unique(ply):
        mine = ply == number
        d, lean = section[mine], tangent[mine, :, 1:] / np.maximum(tangent[mine, :, :1], 1e-6)
        d, lean = d - d.mean(axis=0), lean - lean.mean(axis=0)
        turned += float((d[..., 0] * lean[..., 1] - d[..., 1] * lean[..., 0]).sum())
        square += float((d * d).sum())
    return turned / max(square, 1e-30)
