"""A garment's panels as triangles, cut along their outlines: what the mesh garment draws, and what covers the skin."""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fabric.frames import frame_of_point
from taichi_cloth.garment.pattern.cut import Atlas, CutPanel, intervals
from taichi_cloth.ground.arrays import F32x2, F32x3, I32x1, I32x2

__all__ = ["Surface"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


class Surface:
    """Triangles of all panels. faces: (m, 3). panel: (n,) number of the panel each point is of. flat: (n, 2) where in
    it, in grain coordinates [m]."""

    def __init__(self, atlas: Atlas) -> None:
        nodes, shares, faces, panel, flat = [], [], [], [], []
        count = 0
        for number, piece in enumerate(atlas.panels):
            points, triangles = _clipped(piece)
            blend = piece.embed(points)
            nodes.append(blend[0])
            shares.append(blend[1])
            faces.append(triangles + count)
            panel.append(np.full(len(points), number, np.int32))
            flat.append(points)
            count += len(points)
        place = np.concatenate(nodes)
        self._nodes = np.ascontiguousarray(place[..., 0] * atlas.shape[1] + place[..., 1], np.int32)
        self._shares = np.ascontiguousarray(np.concatenate(shares), np.float32)
        self._present = np.ascontiguousarray(atlas.present(), np.int32).reshape(-1)
        self.faces: I32 = np.concatenate(faces).astype(np.int32)
        self.panel: I32 = np.concatenate(panel)
        self.flat: F64 = np.concatenate(flat)

    def nearest(self, values: NDArray) -> NDArray:
        """(n,) of values at the key points (rows, cols): that with the largest part in each point."""
        return values.reshape(-1)[np.take_along_axis(self._nodes, self._shares.argmax(axis=1)[:, None], axis=1)[:, 0]]

    def points(self, positions: NDArray) -> tuple[F32, F32]:
        """(n, 3) points [m] and smooth unit normals of key points (rows, cols, 3) [m]: both are blends of those at the
        key points, the normals as in `normals.vertex_normals`. Taichi is running."""
        x = np.ascontiguousarray(positions, np.float32)
        at_key = np.empty((self._present.size, 3), np.float32)
        points, normals = np.empty((len(self._nodes), 3), np.float32), np.empty((len(self._nodes), 3), np.float32)
        _surface(x, self._present, self._nodes, self._shares, at_key, points, normals)
        return points, normals


@ti.kernel
def _surface(
    key: F32x3, present: I32x1, nodes: I32x2, shares: F32x2, at_key_out: F32x2, point_out: F32x2, normal_out: F32x2
):
    for k in range(present.shape[0]):
        _here, _weft, _warp, normal = frame_of_point(key, present, k)
        for c in ti.static(range(3)):
            at_key_out[k, c] = normal[c]
    for p in range(nodes.shape[0]):
        point, normal = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        for n in ti.static(range(4)):
            k, share = nodes[p, n], shares[p, n]
            i, j = k // key.shape[1], k % key.shape[1]
            for c in ti.static(range(3)):
                point[c] += share * key[i, j, c]
                normal[c] += share * at_key_out[k, c]
        normal /= ti.sqrt(ti.max(normal.dot(normal), 1e-30))
        for c in ti.static(range(3)):
            point_out[p, c] = point[c]
            normal_out[p, c] = normal[c]


def _clipped(piece: CutPanel) -> tuple[F64, NDArray[np.int64]]:
    """Points (n, 2) in grain coordinates and triangles (m, 3): cells inside whole, those on the outline clipped."""
    outline = piece.outline()
    rows, cols = piece.shape
    a, b = piece.spacing
    cut = _crossed(outline, piece)
    corner: dict[tuple[float, float], int] = {}
    points: list[tuple[float, float]] = []
    triangles: list[tuple[int, int, int]] = []

    def number(x: float, y: float) -> int:
        key = (round(x, 7), round(y, 7))
        if key not in corner:
            corner[key] = len(points)
            points.append((x, y))
        return corner[key]

    ring = [(float(x), float(y)) for x, y in outline]
    if _area(ring) < 0:
        ring = ring[::-1]
    inside = _inside(outline, piece)
    for i in range(rows - 1):
        for j in range(cols - 1):
            x, y = piece.origin[0] + j * a, piece.origin[1] + i * b
            if cut[i, j]:
                shape = ring
                for axis, limit, sign in ((0, x, 1), (0, x + a, -1), (1, y, 1), (1, y + b, -1)):
                    shape = _half(shape, axis, float(limit), sign)
                    if len(shape) < 3:
                        break
            elif inside[i, j]:
                shape = [(x, y), (x + a, y), (x + a, y + b), (x, y + b)]
            else:
                continue
            if len(shape) < 3 or abs(_area(shape)) < 1e-9 * a * b:
                continue
            index = [number(float(p), float(q)) for p, q in shape]
            for k in range(1, len(index) - 1):
                one = (index[0], index[k], index[k + 1])
                if len(set(one)) == 3:
                    triangles.append(one)
    return np.asarray(points), np.asarray(triangles, np.int64)


def _area(ring: list[tuple[float, float]]) -> float:
    return sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(ring, ring[1:] + ring[:1], strict=True)) / 2


def _half(ring: list[tuple[float, float]], axis: int, limit: float, sign: int) -> list[tuple[float, float]]:
    """A polygon clipped to sign · (coordinate − limit) ≥ 0 (Sutherland and Hodgman 1974)."""
    out = []
    for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
        s, t = sign * (p[axis] - limit), sign * (q[axis] - limit)
        if s >= 0:
            out.append(p)
        if (s >= 0) != (t >= 0):
            share = s / (s - t)
            out.append((p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])))
    return out


def _crossed(outline: F64, piece: CutPanel) -> NDArray[np.bool_]:
    """(rows − 1, cols − 1): cells that the outline runs through, by points a tenth of a cell apart along it."""
    out = np.zeros(piece.share.shape, bool)
    ends = np.roll(outline, -1, axis=0)
    for p, q in zip(outline, ends, strict=True):
        n = int(np.ceil(10 * np.abs((q - p) / piece.spacing).max())) + 1
        at = (p + np.linspace(0, 1, n)[:, None] * (q - p) - piece.origin) / piece.spacing
        for shift in (-1e-6, 1e-6):
            cell = np.clip(np.floor(at + shift).astype(int), 0, np.array(out.shape[::-1]) - 1)
            out[cell[:, 1], cell[:, 0]] = True
    return out


def _inside(outline: F64, piece: CutPanel) -> NDArray[np.bool_]:
    """(rows − 1, cols − 1): cells whose middle is inside the outline."""
    rows, cols = piece.share.shape
    out = np.zeros((rows, cols), bool)
    middle = piece.origin[0] + (np.arange(cols) + 0.5) * piece.spacing[0]
    for i in range(rows):
        for left, right in intervals(outline, float(piece.origin[1] + (i + 0.5) * piece.spacing[1]), 1):
            out[i] |= (middle > left) & (middle < right)
    return out
