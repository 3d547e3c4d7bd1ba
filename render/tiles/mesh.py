"""Triangle meshes: what one is, and which of its triangles is seen in each pixel.

Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware 1997: with the
vertices v0, v1, v2 in camera axes, a point of the triangle seen through d = ((x - cx) / f, (y - cy) / f, 1) is
z d = b0 v0 + b1 v1 + b2 v2, so that with D = v0 . (v1 x v2)

    b0 / z = d . (v1 x v2) / D   and likewise b1, b2;   1 / z = their sum

are linear in x and y. The triangle covers the pixel where all three are not negative. Nothing is divided by a
vertex's depth, so triangles astride the camera need no clipping; only their bounding box does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x2, Float, I32x1, I32x2, Int
from taichi_cloth.ground.copies import DeviceArray, zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.vectors import CHUNK_STEPS, keep, lanes

from ..data.backdrop import OPEN, padded
from ..data.camera import Camera

__all__ = ["Mesh", "from_behind", "join", "normals_at", "visible"]

BAND = 16
"""Rows of the image [px] that one thread takes at a time."""

EDGE_ON = 1e-9
"""A triangle is not drawn when |D| is below this, relative to its longest edge and the distance of its vertices."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """v vertices and f triangles, seen from both sides. Raises InputError for wrong shapes or indices.

    Triangles with a vertex that is not finite, and those without an area, are not drawn.
    """

    vertices: NDArray[np.float32]
    """World [m], shape (v, 3)."""
    faces: NDArray[np.int32]
    """Vertex numbers of each triangle, shape (f, 3)."""
    colour: NDArray[np.float32]
    """Linear albedo, shape (v, 3); one colour (3,) is repeated."""
    normals: NDArray[np.float32] | None = None
    """Unit normals of the vertices, shape (v, 3); None takes the mean of the triangles round each, by area."""
    part: NDArray[np.int32] | int = 0
    """Which part each triangle belongs to, for the id pass, 0 and up, shape (f,); a number is repeated."""
    skin: NDArray[np.float32] | float = 0.0
    """How far each vertex is of skin (see `stage/skin.py`), 0 to 1, shape (v,); a number is repeated."""
    woven: NDArray[np.float32] | float = 0.0
    """How far it is of cloth (see `stage/woven.py`), likewise."""

    if TYPE_CHECKING:

        def __init__(
            self,
            vertices: ArrayLike,
            faces: ArrayLike,
            colour: ArrayLike,
            normals: ArrayLike | None = None,
            part: ArrayLike = 0,
            skin: ArrayLike = 0.0,
            woven: ArrayLike = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        vertices, faces = np.ascontiguousarray(self.vertices, np.float32), np.ascontiguousarray(self.faces, np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise InputError(f"mesh: vertices {vertices.shape}, faces {faces.shape}; allowed: (v, 3) and (f, 3)")
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise InputError(f"mesh.faces: {faces.min()} to {faces.max()}; allowed: 0 to {len(vertices) - 1}")
        normals = _vertex_normals(vertices, faces) if self.normals is None else self.normals
        for name, value, shape, dtype in (
            ("vertices", vertices, vertices.shape, np.float32),
            ("faces", faces, faces.shape, np.int32),
            ("colour", self.colour, vertices.shape, np.float32),
            ("normals", normals, vertices.shape, np.float32),
            ("part", self.part, faces.shape[:1], np.int32),
            ("skin", self.skin, vertices.shape[:1], np.float32),
            ("woven", self.woven, vertices.shape[:1], np.float32),
        ):
            try:
                array = np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype), shape))
            except ValueError:
                raise InputError(f"mesh.{name}: shape {np.shape(value)}; allowed: {shape}") from None
            object.__setattr__(self, name, array)


def join(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several, in their order. Raises InputError for none."""
    if not meshes:
        raise InputError("join: no meshes given; pass at least one")
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=False)]),
        np.concatenate([m.colour for m in meshes]),
        np.concatenate([np.asarray(m.normals) for m in meshes]),
        np.concatenate([np.asarray(m.part) for m in meshes]),
        np.concatenate([np.asarray(m.skin) for m in meshes]),
        np.concatenate([np.asarray(m.woven) for m in meshes]),
    )


def visible(mesh: Mesh, camera: Camera, *, chunks: int) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray]:
    """What is seen of a mesh: depth [m] (height, whole tiles), OPEN where nothing is; the triangle, -1 for none; and
    for every triangle the rows of b0, b1, b2 (each times |D| / z) and 1 / z as a x + b y + c, shape (f, 12). Depth and
    triangle lie where kernels read them."""
    edges, boxes = _set_up(mesh, camera)
    width = padded(camera.width)
    bands = -(-camera.height // BAND)
    seen = np.flatnonzero(boxes[:, 1] > boxes[:, 0])
    first, last = boxes[seen, 2] // BAND, (boxes[seen, 3] - 1) // BAND
    many = last - first + 1
    band = np.repeat(first, many) + np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    order = np.argsort(band, kind="stable")
    starts = np.searchsorted(band[order], np.arange(bands + 1)).astype(np.int32)
    lists = np.append(np.repeat(seen, many)[order], 0).astype(np.int32)
    depth, face = zeros((camera.height, width)), zeros((camera.height, width), np.int32)
    if not isinstance(depth, DeviceArray):
        depth[:], face[:] = OPEN, -1
    _raster(chunks, bands, camera.height, camera.near, starts, lists, edges, boxes, depth, face)
    return depth, face, edges


def normals_at(
    mesh: Mesh,
    face: NDArray,
    edges: NDArray | None,
    behind: NDArray[np.int32],
    row: NDArray,
    column: NDArray,
) -> NDArray[np.float64]:
    """Smooth normals (n, 3) of what `visible` found in these pixels (n,), of the side that is seen.

    behind: (f,), as of `from_behind`.
    """
    assert edges is not None
    seen = face[row, column]
    at = np.stack([column + 0.5, row + 0.5, np.ones(len(row))], -1)
    share = np.einsum("nkj,nj->nk", edges[seen, :9].reshape(-1, 3, 3), at)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-30)
    normal = np.einsum("nk,nkc->nc", share, np.asarray(mesh.normals)[mesh.faces[seen]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.where(behind[seen, None] > 0, -normal, normal)


def from_behind(mesh: Mesh, camera: Camera) -> NDArray[np.int32]:
    """1 for each triangle (f,) of which the camera sees the side that its vertices' normals point away from.

    By the triangle's plane: at an outline the smooth normal may look away where the side that it belongs to is seen.
    """
    corner = mesh.vertices[mesh.faces]
    normals = np.asarray(mesh.normals)[mesh.faces].sum(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        plane = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        toward = (plane * (camera.eye - corner[:, 0])).sum(axis=1)
        return (toward * (plane * normals).sum(axis=1) < 0).astype(np.int32)


def _vertex_normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    corner = vertices[faces].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        area = np.nan_to_num(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), posinf=0, neginf=0)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(a, 3), len(vertices)) for a in area.T], -1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), [0.0, 1.0, 0.0])


def _set_up(mesh: Mesh, camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The edge functions (f, 12) and the pixels each triangle may cover: first and last + 1, x then y, (f, 4)."""
    at = mesh.vertices.astype(np.float64) @ camera.rotation.T + camera.translation
    finite = np.isfinite(at).all(axis=1)[mesh.faces].all(axis=1)  # pyright: ignore[reportIndexIssue]
    v = np.nan_to_num(at[mesh.faces], posinf=0, neginf=0)  # (f, 3 corners, xyz)
    plane = np.stack([np.cross(v[:, i - 2], v[:, i - 1]) for i in range(3)], 1)
    volume = (plane[:, 0] * v[:, 0]).sum(-1)
    longest = np.linalg.norm(v - np.roll(v, 1, axis=1), axis=-1).max(axis=1, initial=0)
    extent = longest**2 * np.linalg.norm(v, axis=-1).max(axis=1, initial=0)
    drawn = finite & (np.abs(volume) > EDGE_ON * extent)
    plane *= np.sign(volume)[:, None, None]
    inverse = plane.sum(axis=1) / np.where(drawn, np.abs(volume), 1)[:, None]
    rows = np.concatenate([plane, inverse[:, None]], axis=1)  # of d
    per_pixel = rows / camera.focal
    rows[..., 2] -= per_pixel[..., 0] * camera.cx + per_pixel[..., 1] * camera.cy
    rows[..., :2] = per_pixel[..., :2]
    scale = np.abs(rows[:, :3]).max(axis=(1, 2), initial=0, keepdims=True)  # one for all three: they are compared
    rows[:, :3] /= np.where(scale > 0, scale, 1)

    # The part in front of the near plane: its corners, and where its edges cross the plane.
    ahead = v[..., 2] > camera.near
    to = np.roll(v, -1, axis=1)
    crosses = ahead != np.roll(ahead, -1, axis=1)
    share = (camera.near - v[..., 2]) / np.where(crosses, to[..., 2] - v[..., 2], 1)
    cut = v + share[..., None] * (to - v)
    corners, there = np.concatenate([v, cut], 1), np.concatenate([ahead, crosses], 1)
    z = np.where(there, np.maximum(corners[..., 2], camera.near), 1)
    boxes = np.zeros((len(v), 4), np.int32)
    for k, centre, size in ((0, camera.cx, camera.width), (1, camera.cy, camera.height)):
        pixel = camera.focal * corners[..., k] / z + centre
        low = np.where(there, pixel, np.inf).min(axis=1, initial=np.inf)
        high = np.where(there, pixel, -np.inf).max(axis=1, initial=-np.inf)
        boxes[:, 2 * k] = np.clip(np.floor(low - 0.5), 0, size)
        boxes[:, 2 * k + 1] = np.clip(np.ceil(high + 0.5), 0, size)
    drawn &= (boxes[:, 1] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 2])
    boxes[~drawn] = 0
    return rows.reshape(-1, 12).astype(np.float32), boxes


@ti.kernel
def _raster(
    chunks: Int,
    bands: Int,
    height: Int,
    near: Float,
    # triangles, listed band by band:
    starts: I32x1,
    lists: I32x1,
    edges: F32x2,
    boxes: I32x2,
    # out:
    depth_out: F32x2,
    face_out: I32x2,
):
    """Nearest triangle of each pixel; of two at the same depth the first. Bands are dealt to threads in turn; on a
    device a pixel has a thread."""
    keep(face_out, (0, 0), height)
    if ti.static(lanes() == 1):
        for p in range(height * depth_out.shape[1]):
            y, x = p // depth_out.shape[1], p % depth_out.shape[1]
            if ti.static(runtime.resident()):
                depth_out[y, x], face_out[y, x] = OPEN, -1
            for i in range(starts[y // BAND], starts[y // BAND + 1]):
                f = lists[i]
                if boxes[f, 0] <= x and x < boxes[f, 1] and boxes[f, 2] <= y and y < boxes[f, 3]:
                    v = y + 0.5
                    w0 = edges[f, 1] * v + edges[f, 2]
                    w1 = edges[f, 4] * v + edges[f, 5]
                    w2 = edges[f, 7] * v + edges[f, 8]
                    _cover(near, edges, f, x, y, w0, w1, w2, edges[f, 10] * v + edges[f, 11], depth_out, face_out)
    else:
        for step in range(chunks * CHUNK_STEPS):
            if step % CHUNK_STEPS == 0:
                band = step // CHUNK_STEPS
                while band < bands:
                    top = band * BAND
                    bottom = ti.min(top + BAND, height)
                    for i in range(starts[band], starts[band + 1]):
                        f = lists[i]
                        for y in range(ti.max(top, boxes[f, 2]), ti.min(bottom, boxes[f, 3])):
                            v = y + 0.5
                            w0 = edges[f, 1] * v + edges[f, 2]
                            w1 = edges[f, 4] * v + edges[f, 5]
                            w2 = edges[f, 7] * v + edges[f, 8]
                            w3 = edges[f, 10] * v + edges[f, 11]
                            for x in range(boxes[f, 0], boxes[f, 1]):
                                _cover(near, edges, f, x, y, w0, w1, w2, w3, depth_out, face_out)
                    band += chunks


@ti.func
def _cover(near, edges: F32x2, f, x, y, w0, w1, w2, w3, depth_out: F32x2, face_out: I32x2):
    """Pixel x of a row by triangle f, where that is nearer. w0 to w3: of its functions, what hangs on the row."""
    u = x + 0.5
    inside = ti.min(edges[f, 0] * u + w0, edges[f, 3] * u + w1, edges[f, 6] * u + w2)
    inverse = edges[f, 9] * u + w3
    if inside >= 0.0 and inverse > 0.0:
        z = 1.0 / inverse
        if z > near and z < depth_out[y, x]:
            depth_out[y, x] = z
            face_out[y, x] = f
