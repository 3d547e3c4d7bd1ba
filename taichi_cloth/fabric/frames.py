"""The cloth's frame at its key points: along the weft, along the warp, and the smooth normal that a mesh is lit by."""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.arrays import F32x2, F32x3, I32x1, Template

__all__ = ["Frames", "frame_of_point", "frames", "grid_faces", "vertex_normals"]

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Frames:
    """Unit vectors at each key point, each (picks, ends, 3) float32: along the weft, along the warp, the normal."""

    weft: F32
    warp: F32
    normal: F32


def frames(points: NDArray) -> Frames:
    """Local frames of a grid of key points (picks, ends, 3) [m] by central differences.

    The normal is weft × warp, so that a warp that lies on top is on its side. Where a direction has one thread
    only, it is taken square to the other.
    """
    p = np.asarray(points, np.float64)
    picks, ends = p.shape[:2]
    weft = np.gradient(p, axis=1) if ends > 1 else None
    warp = np.gradient(p, axis=0) if picks > 1 else None
    if weft is None:
        weft = np.cross(warp, [0.0, 1.0, 0.0]) if warp is not None else np.broadcast_to([1.0, 0.0, 0.0], p.shape)
    if warp is None:
        warp = np.cross([0.0, 1.0, 0.0], weft)
    normal = np.cross(weft, warp)
    out = [v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30) for v in (weft, warp, normal)]
    return Frames(*(np.ascontiguousarray(v, np.float32) for v in out))


def vertex_normals(points: NDArray, present: ArrayLike | None = None) -> F32:
    """Unit normals (rows·cols, 3) of a grid of key points (rows, cols, 3) [m], weft × warp by central differences."""
    x = np.ascontiguousarray(points, np.float32)
    mask = np.ones(x.shape[:2], np.int32) if present is None else np.ascontiguousarray(present, np.int32)
    out = np.empty((mask.size, 3), np.float32)
    _normals(x, mask.reshape(-1), out)
    return out


def grid_faces(present: ArrayLike) -> NDArray[np.int32]:
    """Two triangles for every cell of a grid whose four key points are present, (faces, 3)."""
    mask = np.asarray(present, bool)
    number = np.arange(mask.size, dtype=np.int32).reshape(mask.shape)
    whole = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:] & mask[1:, 1:]
    a, b, c, d = (n[whole] for n in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    return np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 1).reshape(-1, 3)


@ti.func
def _unit(v):
    return v * (1.0 / ti.sqrt(ti.max(v.dot(v), 1e-30)))


@ti.func
def frame_of_point(point: F32x3, present: Template, k):
    """Key point k, directions of weft and warp, normal. One-sided differences where a neighbour is not present.

    present: field or array of one dimension, row by row.
    """
    picks, ends = point.shape[0], point.shape[1]
    i, j = k // ends, k % ends
    weft, warp = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
    here = ti.Vector([point[i, j, 0], point[i, j, 1], point[i, j, 2]])
    if present[k] != 0:
        ahead, behind = ti.min(j + 1, ends - 1), ti.max(j - 1, 0)
        ahead = ahead if present[k + ahead - j] != 0 else j
        behind = behind if present[k + behind - j] != 0 else j
        above, below = ti.min(i + 1, picks - 1), ti.max(i - 1, 0)
        above = above if present[k + (above - i) * ends] != 0 else i
        below = below if present[k + (below - i) * ends] != 0 else i
        for c in ti.static(range(3)):
            weft[c] = point[i, ahead, c] - point[i, behind, c]
            warp[c] = point[above, j, c] - point[below, j, c]
    upright = ti.Vector([0.0, 1.0, 0.0])  # where a direction has one thread only, it is taken square to the other
    if weft.dot(weft) == 0.0:
        weft = warp.cross(upright) if warp.dot(warp) > 0.0 else ti.Vector([1.0, 0.0, 0.0])
    if warp.dot(warp) == 0.0:
        warp = upright.cross(weft)
    weft, warp = _unit(weft), _unit(warp)
    return here, weft, warp, _unit(weft.cross(warp))


@ti.kernel
def _normals(point: F32x3, present: I32x1, normal_out: F32x2):
    for k in range(point.shape[0] * point.shape[1]):
        _here, _weft, _warp, normal = frame_of_point(point, present, k)
        for c in ti.static(range(3)):
            normal_out[k, c] = normal[c]
