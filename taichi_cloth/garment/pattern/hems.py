"""Turned hems: how far cloth is from them, and the second layer that they are."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import Atlas, CutPanel, inside, turned

__all__ = ["from_hems", "with_hems"]

F64 = NDArray[np.float64]

FINE = 1e-3
"""Of points along a hem [m]."""
PLACES = 8
"""Along a side of a cell, of which the share inside a hem is told."""


def from_hems(piece: CutPanel, points: F64, within: float = np.inf) -> F64:
    """How far points (n, 2) in grain coordinates are from the edges of a panel that are turned (n,) [m]; infinite where
    there are none, and beyond `within`."""
    edges = [turned(piece.panel.edges[k], piece.panel.grain) for k in piece.panel.hems]
    if not edges:
        return np.full(len(points), np.inf)
    fine = [along(edge, np.linspace(0.0, 1.0, max(2, round(length(edge) / FINE)))) for edge in edges]
    return KDTree(np.concatenate(fine)).query(points, distance_upper_bound=within)[0]


def with_hems(atlas: Atlas, width: float) -> F64:
    """Layers of cloth in each cell, (rows − 1, cols − 1): its share that is cloth, and what of a hem of this width [m]
    is turned in under it. A cell that is left out gives it to the neighbour that carries its cloth."""
    out = atlas.cells.copy()
    for piece in atlas.panels:
        rows, cols = piece.share.shape
        x, y = (
            piece.origin[axis] + piece.spacing[axis] * (np.arange(n * PLACES) + 0.5) / PLACES
            for axis, n in ((0, cols), (1, rows))
        )
        points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        turned_in = from_hems(piece, points, width) < width
        turned_in[turned_in] = inside(piece.outline(), points[turned_in])
        share = turned_in.reshape(rows, PLACES, cols, PLACES).mean(axis=(1, 3))
        there, cells = np.argwhere(share > 0), np.argwhere(piece.share > 0)
        carried = cells[KDTree(cells).query(there)[1]] + [piece.row, piece.col]
        np.add.at(out, tuple(carried.T), share[tuple(there.T)])
    return out
