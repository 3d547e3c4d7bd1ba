"""From the body that a pattern was drafted for to the one that wears it: heights by landmarks, widths by girths."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.landmarks import HEIGHTS, Landmarks

__all__ = ["Map", "across", "along_limb", "heights"]

F64 = NDArray[np.float64]
Map = Callable[[F64 | float], F64]


def heights(drafted: Landmarks, worn: Landmarks) -> Map:
    """Height on the one body to height on the other, linear between HEIGHTS and on beyond them."""
    x = np.array([drafted.height[k] for k in HEIGHTS])
    y = np.array([worn.height[k] for k in HEIGHTS])
    first, last = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])

    def go(q: F64 | float) -> F64:
        q = np.asarray(q, np.float64)
        return np.interp(q, x, y) + np.minimum(q - x[0], 0) * first + np.maximum(q - x[-1], 0) * last

    return go


def across(drafted: Landmarks, worn: Landmarks, part: str) -> Map:
    """Height on the drafting body to the ratio of widths of a part there."""
    h, r = drafted.height, {k: worn.girth[k] / drafted.girth[k] for k in drafted.girth}
    if part == "head":
        at, by = [h["neck"], h["neck"] + 0.08], [r["neck"], r["head"]]
    elif part.startswith("leg"):
        at = [0.08, h["knee"], h["crotch"] - 0.03, h["hip"], h["waist"]]
        by = [r["ankle"], r["knee"], r["thigh"], r["hip"], r["waist"]]
    elif part == "skirt":
        at, by = [h["hip"], h["waist"]], [r["hip"], r["waist"]]
    else:
        at = [h[k] for k in ("hip", "waist", "underbust", "bust", "underarm", "shoulder", "neck")]
        by = [r[k] for k in ("hip", "waist", "underbust", "bust", "bust")]
        by += [worn.shoulder / drafted.shoulder, r["neck"]]
    return lambda y: np.asarray(np.interp(y, at, by), np.float64)


def along_limb(bones: F64) -> F64:
    """Distances (3,) of three joints from the first, along the limb [m]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(bones, axis=0), axis=1))])
