"""What a mesh does to the light of others: the depths at which parallel light meets it first and leaves it last.

Seen from a distant light a triangle's depth, and the shares b1, b2 of its corners, are linear in the texel's place; it
covers the texels in whose middle no share is negative.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x2, Int
from taichi_cloth.ground.copies import zeros
from taichi_cloth.ground.vectors import CHUNK_STEPS

from ..tiles.mesh import Mesh
from ..tiles.sort import share
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP

__all__ = ["walls"]


def walls(mesh: Mesh, axes: NDArray[np.float32], maps: NDArray[np.int32], *, chunks: int) -> NDArray[np.float32]:
    """First and last depth [m] of a mesh in the texels of all maps, EMPTY and -EMPTY where it is not, (2, texels).

    axes: (maps, 5, 3), see `transmittance`. maps: (maps, 3), first texel, width and height of each.
    """
    finite = np.isfinite(mesh.vertices).all(axis=1)
    vertices = np.ascontiguousarray(np.where(finite[:, None], mesh.vertices, 0.0), np.float32)  # pyright: ignore[reportIndexIssue]
    faces = np.ascontiguousarray(mesh.faces[finite[mesh.faces].all(axis=1)], np.int32)  # pyright: ignore[reportIndexIssue]
    texels = int((maps[:, 1] * maps[:, 2]).sum())
    if runtime.resident() and len(faces):
        ends = zeros((2, texels))
    else:
        ends = np.empty((2, texels), np.float32)
        ends[0], ends[1] = EMPTY, -EMPTY
    if len(faces):
        _walls(chunks, vertices, faces, axes, maps, *ends)
    return ends


@ti.func
def _place(vertices: F32x2, p, axes: F32x3, m):
    """Column, row [texels, whole in their middles] and depth [m] of a vertex."""
    at = ti.Vector([0.0, 0.0, 0.0])
    for k in ti.static((RIGHT, UP, AWAY)):
        for c in ti.static(range(3)):
            at[k] += vertices[p, c] * axes[m, k, c]
        at[k] -= axes[m, ORIGIN, k]
    return ti.Vector([at[0] * axes[m, SCALE, 0] - 0.5, at[1] * axes[m, SCALE, 0] - 0.5, at[2]])


@ti.func
def _face(vertices: F32x2, faces: I32x2, i, axes: F32x3, maps: I32x2, m, first_out: F32x1, last_out: F32x1):
    """Face i on map m."""
    width = maps[m, 1]
    high = maps[m, 2]
    a = _place(vertices, faces[i, 0], axes, m)
    b = _place(vertices, faces[i, 1], axes, m) - a
    c = _place(vertices, faces[i, 2], axes, m) - a
    area = b[0] * c[1] - b[1] * c[0]  # pyright: ignore[reportIndexIssue]
    left = ti.max(ti.ceil(a[0] + ti.min(b[0], c[0], 0.0), ti.i32), 0)  # pyright: ignore[reportIndexIssue]
    right = ti.min(ti.floor(a[0] + ti.max(b[0], c[0], 0.0), ti.i32), width - 1)  # pyright: ignore[reportIndexIssue]
    top = ti.max(ti.ceil(a[1] + ti.min(b[1], c[1], 0.0), ti.i32), 0)  # pyright: ignore[reportIndexIssue]
    bottom = ti.min(ti.floor(a[1] + ti.max(b[1], c[1], 0.0), ti.i32), high - 1)  # pyright: ignore[reportIndexIssue]
    if ti.abs(area) > 1e-12:
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                u = x - a[0]
                v = y - a[1]
                b1 = (u * c[1] - v * c[0]) / area  # pyright: ignore[reportIndexIssue]
                b2 = (v * b[0] - u * b[1]) / area  # pyright: ignore[reportIndexIssue]
                if b1 >= -1e-4 and b2 >= -1e-4 and b1 + b2 <= 1.0001:
                    depth = a[2] + b1 * b[2] + b2 * c[2]  # pyright: ignore[reportIndexIssue]
                    cell = maps[m, 0] + y * width + x
                    if ti.static(runtime.on_host()):
                        first_out[cell] = ti.min(first_out[cell], depth)
                        last_out[cell] = ti.max(last_out[cell], depth)
                    else:
                        ti.atomic_min(first_out[cell], depth)
                        ti.atomic_max(last_out[cell], depth)


@ti.kernel
def _walls(
    chunks: Int,
    vertices: F32x2,
    faces: I32x2,
    axes: F32x3,
    maps: I32x2,
    # out:
    first_out: F32x1,
    last_out: F32x1,
):
    if ti.static(not runtime.on_host()):
        for cell in range(first_out.shape[0]):
            first_out[cell], last_out[cell] = EMPTY, -EMPTY
        for t in range(maps.shape[0] * faces.shape[0]):
            _face(vertices, faces, t % faces.shape[0], axes, maps, t // faces.shape[0], first_out, last_out)
    else:
        for step in range(chunks * CHUNK_STEPS):
            if step % CHUNK_STEPS != 0:
                continue
            chunk = step // CHUNK_STEPS
            for m in range(share(maps.shape[0], chunk, chunks), share(maps.shape[0], chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
                for i in range(faces.shape[0]):
                    _face(vertices, faces, i, axes, maps, m, first_out, last_out)
