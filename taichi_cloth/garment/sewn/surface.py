"""A garment's panels as triangles, cut along their outlines: what the mesh garment draws, what covers the skin, and
what contact keeps apart.

Each cell is two triangles, along the diagonal from (i, j) to (i + 1, j + 1); those that an outline crosses are clipped
by it (`clip.py`), so that the cloth is a part of the same two triangles there. Where a cell is left out of the sheet,
as it has next to no cloth, its corners go on straight from the cells beside it, as the threads that are drawn there do.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from taichi_cloth.fabric.frames import frame_of_point
from taichi_cloth.garment.pattern.cut import Atlas
from taichi_cloth.garment.sewn.clip import clipped
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x1

__all__ = ["Surface"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


class Surface:
    """Triangles of all panels.

    faces: (m, 3). cell: (m,) of which cell each is, by the number of its first key point.
    panel: (n,) number of the panel each point is of. flat: (n, 2) where in it, in grain coordinates [m].
    lattice: (n, 2) where in the atlas, in cells, columns first. corner: (n,) number of the key point that a point is,
    simulated or not; −1 where it is none. blend: (n, key points), of which simulated ones it consists.
    ghosts: (g,) numbers of the corners of cells that are not simulated. ghost_blend: (g, key points).
    """

    def __init__(self, atlas: Atlas) -> None:
        self.shape, cols = atlas.shape, atlas.shape[1]
        made, count = [], 0
        for number, piece in enumerate(atlas.panels):
            first = np.array([piece.col, piece.row])
            at, within, triangles, of = clipped(piece)
            flat, owner = piece.origin + at * piece.spacing, np.full(len(at), number, np.int32)
            made.append((at + first, within + first, triangles + count, (of + first) @ [1, cols], owner, flat))
            count += len(at)
        self.lattice, cells, faces, self.cell, self.panel, self.flat = (
            np.concatenate(parts) for parts in zip(*made, strict=True)
        )
        self.faces: I32 = faces.astype(np.int32)
        nodes, shares = _in_cell(self.lattice, cells, cols)
        most = shares.argmax(axis=1)
        self.corner: I64 = np.where(shares.max(axis=1) == 1.0, nodes[np.arange(count), most], -1)
        present = atlas.present().ravel()
        self.ghosts, self.ghost_blend = _ghosts(atlas, self.cell, present)
        size, there = present.size, np.flatnonzero(present)
        on_grid = csr_array((shares.ravel(), (np.repeat(np.arange(count), 3), nodes.ravel())), shape=(count, size))
        own = csr_array((np.ones(len(there)), (np.arange(len(there)), there)), shape=(len(there), size))
        rows = np.zeros(size, np.int64)
        rows[there], rows[self.ghosts] = np.arange(len(there)), len(there) + np.arange(len(self.ghosts))
        self.blend = csr_array(on_grid @ csr_array(vstack([own, self.ghost_blend]))[rows])
        self.blend.eliminate_zeros()
        self._largest = np.array([self.blend.indices[a + np.argmax(self.blend.data[a:b])] for a, b in
                                  zip(self.blend.indptr[:-1], self.blend.indptr[1:], strict=True)])  # fmt: skip
        self._present = np.ascontiguousarray(present, np.int32)
        self._starts, self._nodes = (np.ascontiguousarray(a, np.int32) for a in (self.blend.indptr, self.blend.indices))
        self._shares = self.blend.data.astype(np.float32)

    def nearest(self, values: NDArray) -> NDArray:
        """(n,) of values at the key points (rows, cols): that with the largest part in each point."""
        return values.reshape(-1)[self._largest]

    def places(self, positions: NDArray) -> F64:
        """(n, 3) points [m] of key points (rows, cols, 3) [m]; without Taichi."""
        return self.blend @ np.asarray(positions, np.float64).reshape(-1, 3)

    def points(self, positions: NDArray) -> tuple[F32, F32]:
        """(n, 3) points [m] and smooth unit normals of key points (rows, cols, 3) [m]: both are blends of those at the
        key points, the normals as in `normals.vertex_normals`. Taichi is running."""
        x, n = np.ascontiguousarray(positions, np.float32), len(self.lattice)
        at_key = np.empty((self._present.size, 3), np.float32)
        points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
        _surface(x, self._present, self._starts, self._nodes, self._shares, at_key, points, normals)
        return points, normals


def _in_cell(at: F64, cells: I64, cols: int) -> tuple[I64, F64]:
    """Of places (n, 2) in cells (n, 2), both in cells of the atlas, columns first: the corners (n, 3) of the triangle
    each is in, and their shares (n, 3)."""
    u, v = (at - cells).T
    below = u >= v
    low, high = np.minimum(u, v), np.maximum(u, v)
    first = cells @ [1, cols]
    nodes = np.stack([first, first + np.where(below, 1, cols), first + 1 + cols], -1)
    shares = np.stack([1 - high, high - low, low], -1).round(9)
    return nodes, shares


def _ghosts(atlas: Atlas, cells: I64, present: NDArray[np.bool_]) -> tuple[I64, csr_array]:
    """Corners of cells (m,) that are not simulated, (g,), and what each goes on from, (g, key points)."""
    cols = atlas.shape[1]
    corners = np.unique(cells[:, None] + np.array([0, 1, cols, cols + 1]))
    ghosts, rows, nodes, shares = corners[~present[corners]], [], [], []
    owner = atlas.owner().ravel()[ghosts]
    for number in np.unique(owner):
        piece, mine = atlas.panels[number], np.flatnonzero(owner == number)
        at = np.stack([ghosts[mine] % cols - piece.col, ghosts[mine] // cols - piece.row], -1)
        node, share = piece.embed(piece.origin + at * np.asarray(piece.spacing))
        rows.append(np.repeat(mine, 4))
        nodes.append((node @ [cols, 1]).ravel())
        shares.append(share.ravel())
    if not rows:
        return ghosts, csr_array((0, present.size))
    at = np.concatenate(rows), np.concatenate(nodes)
    return ghosts, csr_array((np.concatenate(shares).round(9), at), shape=(len(ghosts), present.size))


@ti.kernel
def _surface(
    key: F32x3,
    present: I32x1,
    starts: I32x1,
    nodes: I32x1,
    shares: F32x1,
    at_key_out: F32x2,
    point_out: F32x2,
    normal_out: F32x2,
):
    """starts, nodes, shares: of each point, the key points it consists of."""
    for k in range(present.shape[0]):
        _here, _weft, _warp, normal = frame_of_point(key, present, k)
        for c in ti.static(range(3)):
            at_key_out[k, c] = normal[c]
    for p in range(point_out.shape[0]):
        point, normal = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
        for m in range(starts[p], starts[p + 1]):
            k, share = nodes[m], shares[m]
            i, j = k // key.shape[1], k % key.shape[1]
            for c in ti.static(range(3)):
                point[c] += share * key[i, j, c]
                normal[c] += share * at_key_out[k, c]
        normal /= ti.sqrt(ti.max(normal.dot(normal), 1e-30))
        for c in ti.static(range(3)):
            point_out[p, c] = point[c]
            normal_out[p, c] = normal[c]
