"""Where a plane cuts a skin."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["section_pieces"]

F64 = NDArray[np.float64]


def section_pieces(vertices: F64, faces: NDArray[np.integer], point: F64, normal: F64) -> list[F64]:
    """Points (n, 3) [m] of each piece of the section of a mesh through a point, square to a unit normal."""
    from scipy.sparse import csr_matrix  # half a second, of all that read a scene
    from scipy.sparse.csgraph import connected_components

    height = (vertices - point) @ normal
    above = height > 0
    cut = faces[(above[faces].sum(axis=1) % 3) != 0]
    edges = np.sort(np.concatenate([cut[:, [0, 1]], cut[:, [1, 2]], cut[:, [2, 0]]]), axis=1)
    triangle = np.tile(np.arange(len(cut)), 3)
    crossed = above[edges[:, 0]] != above[edges[:, 1]]
    edges, triangle = edges[crossed], triangle[crossed]
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    a, b = height[unique[:, 0]], height[unique[:, 1]]
    where = vertices[unique[:, 0]] + (a / (a - b))[:, None] * (vertices[unique[:, 1]] - vertices[unique[:, 0]])
    pairs = number.ravel()[np.argsort(triangle, kind="stable")].reshape(-1, 2)
    graph = csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(unique), len(unique)))
    label = connected_components(graph, directed=False)[1]
    return [where[label == k] for k in range(label.max(initial=-1) + 1)]
