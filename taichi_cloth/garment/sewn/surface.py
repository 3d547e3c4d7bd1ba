"""A garment's panels as triangles, cut along their outlines: what the mesh garment draws, what covers the skin, and
what contact keeps apart.

Each cell is two triangles, along the diagonal from (i, j) to (i + 1, j + 1); those that an outline crosses are clipped
by it (`clip.py`), so that the cloth is a part of the same two triangles there. Where a cell is left out of the sheet,
as it has next to no cloth, its corners go on straight from the cells beside it, as the threads that are drawn there do.

Along a seam both panels have the same points (`joined.py`), which are where the mean of both is: the surface is closed.
"""

from itertools import pairwise

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from taichi_cloth.fabric.frames import frame_of_point
from taichi_cloth.garment.pattern.cut import Atlas
from taichi_cloth.garment.sewn.clip import clipped
from taichi_cloth.garment.sewn.joined import SeamLine, cut_outlines, joined, mean_of
from taichi_cloth.ground.arrays import F32x2, F32x3, I32x1

__all__ = ["Surface"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


class Surface:
    """Triangles of all panels. seams: that they are sewn by.

    faces: (m, 3). cell: (m,) of which cell each is, by the number of its first key point.
    panel: (n,) number of the panel each point is of. flat: (n, 2) where in it, in grain coordinates [m].
    lattice: (n, 2) where in the atlas, in cells, columns first. corner: (n,) number of the key point that a point is,
    simulated or not; −1 where it is none. same: (n,) points of one number are sewn together, and in one place. part:
    (m,) whether a triangle is a part of one of the two that its cell is, as corners that became one with others make it
    none. blend: (n, key points), of which simulated ones it consists.
    ghosts: (g,) numbers of the corners of cells that are not simulated. ghost_blend: (g, key points).
    """

    def __init__(self, atlas: Atlas, seams: list[SeamLine] | None = None) -> None:
        self.shape, cols = atlas.shape, atlas.shape[1]
        made, count = [], 0
        outlines, cuts = cut_outlines(atlas, seams or [])
        for number, (piece, outline) in enumerate(zip(atlas.panels, outlines, strict=True)):
            first = np.array([piece.col, piece.row])
            at, within, triangles, of = clipped(piece, outline)
            flat, owner = piece.origin + at * piece.spacing, np.full(len(at), number, np.int32)
            made.append((at + first, within + first, triangles + count, (of + first) @ [1, cols], owner, flat))
            count += len(at)
        lattice, cells, faces, cell, panel, flat = (np.concatenate(parts) for parts in zip(*made, strict=True))
        nodes, shares = _in_cell(lattice, cells, cols)
        corner = np.where(shares.max(axis=1) == 1.0, nodes[np.arange(count), shares.argmax(axis=1)], -1)
        present = atlas.present().ravel()
        self.ghosts, self.ghost_blend = _ghosts(atlas, cell, present)
        size, there = present.size, np.flatnonzero(present)
        on_grid = csr_array((shares.ravel(), (np.repeat(np.arange(count), 3), nodes.ravel())), shape=(count, size))
        own = csr_array((np.ones(len(there)), (np.arange(len(there)), there)), shape=(len(there), size))
        rows = np.zeros(size, np.int64)
        rows[there], rows[self.ghosts] = np.arange(len(there)), len(there) + np.arange(len(self.ghosts))
        blend = csr_array(on_grid @ csr_array(vstack([own, self.ghost_blend]))[rows])
        # What becomes one: where it is in its own panel, and where it is.
        one = joined(atlas, seams or [], cuts, panel, flat, faces, cell)
        used, index = np.unique(one.faces, return_inverse=True)
        self.faces: I32 = index.reshape(-1, 3).astype(np.int32)
        self.cell: I64 = one.cells
        some = np.zeros(int(one.own.max()) + 1, np.int64)
        some[one.own] = np.arange(count)
        some, mine = some[used], csr_array(mean_of(one.own, one.share)[used])
        self.lattice, self.flat, self.panel, self.same = mine @ lattice, mine @ flat, panel[some], one.same[some]
        alone = np.bincount(one.same)[self.same] == 1
        alone[self.faces[~_in_half(self.lattice[self.faces], self.cell, cols)]] = False
        self.corner: I64 = np.where(alone, corner[some], -1)
        self.part = alone[self.faces].all(axis=1)
        self.blend, self._own = csr_array((mean_of(one.same, one.share) @ blend)[self.same]), csr_array(mine @ blend)
        for each in (self.blend, self._own):
            each.data = each.data.round(9)
            each.eliminate_zeros()
        starts = self._own.indptr
        self._largest = np.array([self._own.indices[a + np.argmax(self._own.data[a:b])] for a, b in
                                  pairwise(starts)])  # fmt: skip
        self._present = np.ascontiguousarray(present, np.int32)

    def nearest(self, values: NDArray) -> NDArray:
        """(n,) of values at the key points (rows, cols): that with the largest part in each point."""
        return values.reshape(-1)[self._largest]

    def places(self, positions: NDArray) -> F64:
        """(n, 3) points [m] of key points (rows, cols, 3) [m]; without Taichi."""
        return self.blend @ np.asarray(positions, np.float64).reshape(-1, 3)

    def points(self, positions: NDArray) -> tuple[F32, F32]:
        """(n, 3) points [m] and smooth unit normals of key points (rows, cols, 3) [m]: both are blends of those at the
        key points, the normals as in `normals.vertex_normals`, and of the own panel at a seam. Taichi is running."""
        x = np.ascontiguousarray(positions, np.float32)
        at_key = np.empty((self._present.size, 3), np.float32)
        _normals(x, self._present, at_key)
        normals = self._own @ at_key
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
        return self.places(x).astype(np.float32), normals.astype(np.float32)


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


def _in_half(corners: F64, cells: I64, cols: int) -> NDArray[np.bool_]:
    """(m,) whether triangles (m, 3, 2), in cells of the atlas, columns first, lie in one half of cells (m,)."""
    at = corners - np.stack([cells % cols, cells // cols], -1)[:, None]
    ahead = at[..., 0] - at[..., 1]
    within = np.abs(at - 0.5).max(axis=(1, 2)) < 0.5 + 1e-6
    return within & ((ahead.max(axis=1) < 1e-6) | (ahead.min(axis=1) > -1e-6))


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
def _normals(key: F32x3, present: I32x1, at_key_out: F32x2):
    """Of key points."""
    for k in range(present.shape[0]):
        _here, _weft, _warp, normal = frame_of_point(key, present, k)
        for c in ti.static(range(3)):
            at_key_out[k, c] = normal[c]
