"""Cloth that passes through itself where contact is taken up: untangled, and meanwhile not held as it is.

What has passed through other cloth has no side any more that it could be kept on: a direction that parts two edges
there would hold them as they are. So cells that meet, and those round them, are a tangle: pairs of its cells are no
near pairs, which all others are. At the start of each frame what still meets is looked for anew, and moved a little the
way that makes the lines shorter along which it does (`crossings/contours.py`), until there are none; from then on
contact keeps it so. All follows from where key points are.

Cloth that contact has proven for a frame meets nothing at its end but where it was let off, or was moved so before:
that alone is asked then what it meets, and not all of it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from taichi_cloth.crossings.contours import ways_apart
from taichi_cloth.crossings.crossings import Crossings, find_crossings
from taichi_cloth.layers.near_pairs import BESIDE
from taichi_cloth.layers.outline import Outline
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["Tangles"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

PACE = 0.012
"""At which what is tangled comes apart [m/s]."""


class Tangles:
    """Of a sheet; outline: as of `LayerContact`. none: what is `open` of cloth without any, (m,)."""

    def __init__(self, sheet: Sheet, outline: Outline | None) -> None:
        self._sheet = sheet
        if outline is None:
            faces = sheet.triangles
            points = sheet.shape[0] * sheet.shape[1]
            self._blend, self._faces, self._same = csr_array(eye_array(points)), faces, None
            self._cell, self._panel = faces[:, 0], np.zeros(points, np.int64)
        else:
            self._blend, self._faces, self._same = outline.blend, outline.faces, outline.same
            self._cell, self._panel = outline.cell, outline.panel
        self.none = np.zeros(len(self._faces), bool)
        self._label = np.arange(len(self._panel)) if self._same is None else self._same

    def places(self, positions: NDArray) -> F64:
        """Of all points (n, 3) [m], of key points (rows, cols, 3) [m]."""
        return self._blend @ np.asarray(positions, np.float64).reshape(-1, 3)

    def find(self, positions: NDArray, among: NDArray[np.bool_] | None = None) -> Crossings:
        """What meets, of key points (rows, cols, 3) [m]. among: see `find_crossings`."""
        return find_crossings(self.places(positions), self._faces, self._same, among)

    def open(self, tangles: NDArray, moves: NDArray) -> NDArray[np.bool_]:
        """(m,) of each triangle, whether it may meet others at the end of a frame that contact has proven: it is of a
        cell (rows, cols) in a tangle, or was moved by hand (rows, cols, 3), or has a point in common with such."""
        moved = abs(self._blend.copy()) @ (moves != 0).any(axis=-1).ravel() > 0  # a copy: abs sorts what it is given
        points = np.zeros(int(self._label.max()) + 1, bool)
        points[self._label[moved]] = True
        points[self._label[self._faces[tangles.ravel()[self._cell] > 0]]] = True
        return np.any(points[self._label[self._faces]], axis=1)

    def labels(self, found: Crossings) -> NDArray[np.int32]:
        """(rows, cols) of each cell, by its first key point: 0 of those that are in no tangle; else its number times
        BESIDE, from 1, plus how many cells parts of one panel are away from each other that are not let off."""
        rows, cols = self._sheet.shape
        one, other = self._cell[found.pairs].T
        meet = np.unique(np.concatenate([one, other]))
        i, j = np.divmod(meet, cols)
        ring = np.stack(np.meshgrid((-1, 0, 1), (-1, 0, 1)), -1).reshape(-1, 2)
        near_row = np.clip(i[:, None] + ring[:, 0], 0, rows - 1)
        near_col = np.clip(j[:, None] + ring[:, 1], 0, cols - 1)
        beside = (near_row * cols + near_col).ravel()
        first = np.concatenate([one, np.repeat(meet, len(ring))])
        second = np.concatenate([other, beside])
        graph = coo_array((np.ones(len(first)), (first, second)), shape=(rows * cols, rows * cols))
        number = connected_components(graph, directed=False)[1]
        away = np.maximum(abs(one // cols - other // cols), abs(one % cols - other % cols))
        away[self._panel[self._faces[found.pairs[:, 0], 0]] != self._panel[self._faces[found.pairs[:, 1], 0]]] = BESIDE
        least = np.full(int(number.max()) + 1, BESIDE)
        np.minimum.at(least, number[one], away)
        tangles, within = np.unique(number[beside], return_inverse=True)
        out = np.zeros(rows * cols, np.int32)
        # Both of two that meet have a ring round them.
        out[beside] = (within.ravel() + 1) * BESIDE + np.clip(least[tangles[within.ravel()]] - 3, 0, BESIDE - 1)
        return out.reshape(rows, cols)

    def moves(self, found: Crossings, positions: NDArray, time: float) -> F64:
        """(rows, cols, 3) by which key points go in a time [s] so that lines get shorter along which cloth meets [m]:
        edges and the triangles that they meet, by their masses; none by more than at PACE."""
        nodes, shares, way = ways_apart(found, self.places(positions), self._faces, self._same)
        count, most = len(way), PACE * time
        rows = np.repeat(np.arange(count), nodes.shape[1])
        corner = csr_array((shares.ravel(), (rows, nodes.ravel())), shape=(count, len(self._panel)))
        blend = csr_array(corner @ self._blend)
        inverse = self._sheet.inverse_mass.ravel()
        yields = np.asarray(blend.power(2) @ inverse).reshape(-1, 1)
        push = np.where(yields > 0, most * way / np.maximum(yields, 1e-30), 0.0)
        out = inverse.reshape(-1, 1) * (blend.T @ push)
        far = np.linalg.norm(out, axis=1, keepdims=True)
        out *= np.minimum(1.0, most / np.maximum(far, 1e-30))
        return out.reshape(*self._sheet.shape, 3)
