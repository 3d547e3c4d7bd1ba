"""Which points of a garment's surface are sewn together: what lies along a seam is one cloth there."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from taichi_cloth.garment.pattern.cut import turned
from taichi_cloth.garment.sewn.sew import Garment
from taichi_cloth.garment.sewn.surface import Surface

__all__ = ["joined_points"]

FINER = 8
"""Points along a seam to each tie, by which those of an outline are known to lie on it."""


def joined_points(garment: Garment, surface: Surface) -> NDArray[np.int64]:
    """(n,) a number of each point of the surface: those of one number are sewn together. On an outline each point
    belongs to the nearest tie of each seam that runs there."""
    edge = _outline(surface.faces)
    names = [piece.panel.name for piece in garment.atlas.panels]
    of_panel = {name: edge[surface.panel[edge] == number] for number, name in enumerate(names)}
    points, ties, made = [], [], 0
    for seam, count in zip(garment.pattern.seams, garment.tie_counts(), strict=True):
        fine = garment.pattern.pairs(seam, FINER * (count - 1) + 1)
        for side, at in zip((seam.first, seam.second), fine, strict=True):
            places, own = turned(at, garment.atlas.panel(side.panel).panel.grain), of_panel[side.panel]
            apart = np.linalg.norm(np.diff(places, axis=0), axis=1).max()
            distance, nearest = KDTree(places).query(surface.flat[own])
            near = np.flatnonzero(distance <= 0.6 * apart)
            points.append(own[near])
            ties.append(made + (np.asarray(nearest)[near] + FINER // 2) // FINER)
        made += count
    n = len(surface.flat)
    if not points:
        return np.arange(n)
    i, j = np.concatenate(points), n + np.concatenate(ties)
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(n + made, n + made))
    return np.asarray(connected_components(graph, directed=False)[1])[:n]


def _outline(faces: NDArray[np.int32]) -> NDArray[np.int64]:
    """Numbers of the points on edges that only one triangle has."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(found[count == 1]).astype(np.int64)
