"""Cloth whose outline does not follow the lattice of its key points, and that is sewn: what of it can meet cloth.

Its triangles are those of `Sheet` where a cell is cloth as a whole, and pieces of them where the outline runs. The
corners of pieces are blends of key points. Points that are sewn together count as one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import csr_array

from taichi_cloth.crossings.crossings import Crossings, find_crossings
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.layers.tree import HOLE
from taichi_cloth.sheet.sheet import PAD, Sheet

__all__ = ["BEYOND", "MEETS", "PIECES", "RIM_EAST", "RIM_NORTH", "Outline", "Tables", "crossings_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

MEETS = 5
"""By how many places bits are shifted of what meets other cloth as a whole: both triangles of the cell and the thread
across them, the two threads, the key point."""
PIECES = 1 << 9
"""Bit of an element whose cell has pieces of triangles."""
RIM_EAST, RIM_NORTH = 1 << 10, 1 << 11
"""Bits of an element whose thread along the row, or the column, has cloth on one side only."""
BEYOND = 1 << 12
"""Bit of an element whose cell has pieces that are no part of its two triangles: corners that have become one with
others, as where they are sewn, may lie beyond it."""


@dataclass(frozen=True, eq=False)
class Outline:
    """points of the cloth (n), triangles (m), key points numbered row by row.

    blend: (n, key points) what each point consists of. corner: (n,) the key point that it is, simulated or not, or −1.
    faces: (m, 3). cell: (m,) of which cell, by its first key point. flat: (n, 2) where in the flat sheet, as far as
    points of one panel are concerned [m]. panel: (n,) from 0. same: (n,) points of one number are one, and in one
    place. seam: (n,) how far from a seam in the flat [m]. part: (m,) whether triangles are parts of the two that their
    cell is.
    ghosts: (g,) corners of cells that are not simulated. ghost_blend: (g, key points).
    """

    blend: csr_array
    corner: I64
    faces: I32
    cell: I64
    flat: F64
    panel: I32
    same: I64
    seam: F64
    part: NDArray[np.bool_]
    ghosts: I64
    ghost_blend: csr_array

    def places(self, positions: NDArray) -> F64:
        """(n, 3) of key points (rows, cols, 3) [m]."""
        return self.blend @ np.asarray(positions, np.float64).reshape(-1, 3)


def crossings_of(outline: Outline, positions: NDArray) -> Crossings:
    """Of cloth with key points at positions (rows, cols, 3) [m]."""
    return find_crossings(outline.places(positions), outline.faces, outline.same)


class Tables:
    """What kernels read of an outline, all by elements of the padded grid and, behind its `size`, corners of pieces.

    has: (elements,) bits. panel: (elements,) from 1, 0 of none. at: (blends,) the element that each blend is; starts,
    nodes, weights: of what.
    elements: (6, size + corners of pieces) of each: the element that stands for those that are one, where in the flat
    [m], how far from a seam [m], the least of that of a cell [m], and the panel, from 1.
    first: (3, elements + 1) where the points, faces and threads of the pieces of a cell begin in `points`, `faces` (3,
    …) and `edges` (2, …).
    """

    def __init__(self, sheet: Sheet, outline: Outline | None, size: int) -> None:
        if outline is None:
            self._of_whole_cells(sheet, size)
        else:
            self._of_outline(sheet, outline, size)

    def arrays(self) -> tuple[NDArray, ...]:
        """What `LayerFields.take_outline` takes; one number in place of none."""
        pieces = self.first, self.points, self.faces, self.edges
        arrays = self.at, self.starts, self.nodes, self.weights, *pieces, self.elements
        return tuple(a if a.size else np.zeros((*a.shape[:-1], 1), a.dtype) for a in arrays)

    def _of_whole_cells(self, sheet: Sheet, size: int) -> None:
        total = sheet.padded_shape[0] * sheet.width
        cells = sheet.cells > 0
        panels, count = ndimage.label(cells, np.ones((3, 3)))  # pyright: ignore[reportGeneralTypeIssues]
        corners = [np.pad(panels, ((i, 1 - i), (j, 1 - j))) for i in (0, 1) for j in (0, 1)]
        self.panel = sheet.padded(np.maximum.reduce(corners)).astype(np.int32).ravel()
        there = np.pad(cells, ((0, 1), (0, 1)))
        self.has = self._bits(there, there, sheet)
        rows, columns = np.nonzero(cells)
        if count == 1 and len(rows) == (np.ptp(rows) + 1) * (np.ptp(columns) + 1):
            self.has &= ~HOLE  # beside a rectangle is nothing, but what is no rectangle has holes
        self.has |= (self.has & POINT) << MEETS
        below, left = np.roll(there, 1, axis=0), np.roll(there, 1, axis=1)
        rim = RIM_EAST * (there != below) + RIM_NORTH * (there != left)
        self.has |= sheet.padded(rim).astype(np.int32).ravel()
        self.at, self.nodes = (np.zeros(0, np.int32) for _ in range(2))
        self.weights, self.starts = np.zeros(0, np.float32), np.zeros(1, np.int32)
        self.elements = np.zeros((6, size), np.float32)
        self.elements[0], self.elements[3:5] = np.arange(size), 1.0
        self.points, self.faces, self.edges = (np.zeros((k, 0), np.int32) for k in (1, 3, 2))
        self.first = np.zeros((3, total + 1), np.int32)

    def _of_outline(self, sheet: Sheet, outline: Outline, size: int) -> None:
        rows, cols = sheet.shape
        width, total = sheet.width, sheet.padded_shape[0] * sheet.width

        def padded(number: NDArray) -> I64:
            return (number // cols + PAD) * width + number % cols

        # Elements of all points: those that are no key point lie behind the grid.
        loose = np.flatnonzero(outline.corner < 0)
        element = np.where(outline.corner >= 0, padded(np.maximum(outline.corner, 0)), 0)
        element[loose] = size + np.arange(len(loose))
        # Which cells are there, and which are whole.
        count = np.bincount(outline.cell, minlength=rows * cols)
        corners = np.array([0, 1, cols, cols + 1])
        whole_face = (outline.corner[outline.faces] >= 0).all(axis=1)
        whole = np.bincount(outline.cell[whole_face], minlength=rows * cols) == 2
        whole &= count == 2
        there = count > 0
        self.has = self._bits(there.reshape(rows, cols), whole.reshape(rows, cols), sheet)
        met = np.zeros(total, bool)
        met[element[outline.corner >= 0]] = True
        self.has |= np.where(met, POINT << MEETS, 0)
        pieces = ~whole[outline.cell]
        self.has[padded(np.unique(outline.cell[pieces]))] |= PIECES
        self.has[padded(np.unique(outline.cell[~outline.part]))] |= BEYOND | HOLE
        self.panel = np.zeros(total, np.int32)
        for corner in corners:
            self.panel[padded(outline.cell + corner)] = outline.panel[outline.faces[:, 0]] + 1
        # Blends: corners of cells that are not simulated, then corners of pieces.
        blend = [outline.ghost_blend, outline.blend[loose]]
        self.at = np.concatenate([padded(outline.ghosts), element[loose]]).astype(np.int32)
        self.starts = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(b.indptr) for b in blend]))]).astype(
            np.int32
        )
        self.nodes = padded(np.concatenate([b.indices for b in blend])).astype(np.int32)
        self.weights = np.concatenate([b.data for b in blend]).astype(np.float32)
        # What points are one, and where.
        n = size + len(loose)
        first = np.full(int(outline.same.max()) + 1, n)
        np.minimum.at(first, outline.same, element)
        self.elements = np.zeros((6, n), np.float32)
        self.elements[0] = np.arange(n)
        self.elements[0, element] = first[outline.same]
        self.elements[1:3, element] = outline.flat.T
        self.elements[3:5] = 1.0
        self.elements[3, element] = np.minimum(outline.seam, 1.0)
        least = np.full(rows * cols, 1.0)
        np.minimum.at(least, np.repeat(outline.cell, 3), np.minimum(outline.seam, 1.0)[outline.faces.ravel()])
        self.elements[5, : len(self.panel)] = self.panel
        self.elements[5, element] = outline.panel + 1
        self.elements[4, padded(np.arange(rows * cols))] = least
        self._pieces(outline, element, padded(outline.cell), pieces, total)

    def _bits(self, there: NDArray[np.bool_], whole: NDArray[np.bool_], sheet: Sheet) -> I32:
        """(elements,) of cells (rows, cols) that are there, and whole; but which key points meet cloth."""
        out = np.zeros(sheet.padded_shape, np.int32)
        inside = out[PAD:-PAD, : sheet.shape[1]]
        for cells, shift in ((there, 0), (whole, MEETS)):
            below, left = np.roll(cells, 1, axis=0), np.roll(cells, 1, axis=1)
            inside |= (CELL * cells + EAST * (cells | below) + NORTH * (cells | left)) << shift
        corner = there | np.roll(there, 1, axis=0) | np.roll(there, 1, axis=1) | np.roll(there, (1, 1), axis=(0, 1))
        inside |= POINT * corner
        return np.where(out & CELL, out, out | HOLE).ravel()

    def _pieces(self, outline: Outline, element: I64, cells: I64, pieces: NDArray[np.bool_], total: int) -> None:
        """Points, faces and threads of pieces of cells, each of the first cell that has it. cells: (m,) elements of the
        triangles' cells."""
        faces, cell = element[outline.faces[pieces]], cells[pieces]
        # Threads of pieces: those that no whole cell has.
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        owner = np.tile(cell, 3)
        whole = element[outline.faces[~pieces]]
        known = np.sort(np.concatenate([whole[:, [0, 1]], whole[:, [1, 2]], whole[:, [2, 0]]]), axis=1)
        base = int(element.max()) + 1
        keys, first = np.unique(ends @ [base, 1], return_index=True)
        first = first[~np.isin(keys, known @ [base, 1])]
        ends, edge_owner = ends[first], owner[first]
        # Points of pieces: those that are no key point.
        loose = faces.ravel()
        points, at = np.unique(loose, return_index=True)
        point_owner = np.repeat(cell, 3)[at]
        point_owner, points = point_owner[points >= total], points[points >= total]
        lists, firsts = [], []
        for values, owners in ((points[:, None], point_owner), (faces, cell), (ends, edge_owner)):
            order = np.argsort(owners, kind="stable")
            lists.append(values[order].T.astype(np.int32))
            firsts.append(np.searchsorted(owners[order], np.arange(total + 1)))
        self.points, self.faces, self.edges = lists
        self.first = np.stack(firsts).astype(np.int32)
