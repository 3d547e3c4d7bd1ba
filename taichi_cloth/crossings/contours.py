"""Which way cloth that passes through cloth comes apart: the way that makes the lines shorter along which it does.

Two layers that pass through each other have no sides any more: what is beyond and what is on this side cannot be told
from where they are now. But where they do is a line, from one edge of the cloth to another or closed, and layers that
come apart let it shrink to nothing (Volino and Magnenat-Thalmann 2006, "Resolving surface collisions through
intersection contour minimization"). It has a corner wherever an edge e of one layer meets a triangle with normal n of
the other. If the edge goes by d, this goes by d − (d·n)/(e·n) e: with r the unit vectors from there along the line, one
on each side, the line gets shorter the fastest by

    d = Σ r − (Σ r·e)/(e·n) n.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.crossings.crossings import Crossings

__all__ = ["ways_apart"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

STEEP = 0.2
"""Cosine of edge and normal from which on a triangle that an edge meets aslant counts as met so."""
STRAIGHT = 0.5
"""Length of d below which it leads nowhere: in the middle of a straight line both r cancel."""


def ways_apart(found: Crossings, points: F64, faces: NDArray, same: NDArray | None = None) -> tuple[I64, F64, F64]:
    """What of a mesh is to go where: points (m, 5), an edge and the triangle that it meets, their shares (m, 5) in the
    way between the two, and that way d of the edge (m, 3), at most 1. Arguments as of `find_crossings`."""
    corners = points[faces[found.faces]]
    edge = _unit(points[found.edges[:, 1]] - points[found.edges[:, 0]])
    normal = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    # Corners of the line that stand with both triangles of their edge are one.
    ends = np.sort(found.edges, axis=1)
    keys, first, corner = np.unique(
        np.column_stack([ends, found.faces]), axis=0, return_index=True, return_inverse=True
    )
    along = np.zeros((len(keys), 3))
    label = np.arange(len(points)) if same is None else np.asarray(same)
    np.add.at(along, corner.ravel(), _along(found, points, faces, label))
    edge, normal = edge[first], normal[first]
    steep = np.einsum("nk,nk->n", edge, normal)
    lean = np.einsum("nk,nk->n", edge, along) * steep / np.maximum(steep**2, STEEP**2)
    way = along - lean[:, None] * normal
    way /= np.sqrt((way**2).sum(axis=1) + STRAIGHT**2)[:, None]
    return *_shares(found, points, faces, first), way


def _along(found: Crossings, points: F64, faces: NDArray, label: NDArray) -> F64:
    """Unit vectors (k, 3) from each place where an edge meets a triangle along the line within the pair that it is of;
    0 where that ends there. Where two triangles have a point in common the line goes to that."""
    total, count = np.zeros((len(found.pairs), 3)), np.zeros(len(found.pairs))
    np.add.at(total, found.of, found.at)
    np.add.at(count, found.of, 1.0)
    out = np.zeros_like(found.at)
    two = count[found.of] == 2
    out[two] = total[found.of[two]] - 2.0 * found.at[two]
    one = np.flatnonzero(count[found.of] == 1)
    both = faces[found.pairs[found.of[one]]]
    alike = label[both[:, 0, :, None]] == label[both[:, 1, None, :]]
    shared = both[np.arange(len(one)), 0, alike.any(axis=2).argmax(axis=1)]
    out[one] = np.where(alike.any(axis=(1, 2))[:, None], points[shared] - found.at[one], 0.0)
    return _unit(out)


def _shares(found: Crossings, points: F64, faces: NDArray, chosen: I64) -> tuple[I64, F64]:
    """Points (m, 5) of edges and triangles, and what part each has in the place where they meet: an edge's add up to 1,
    a triangle's to −1."""
    nodes = np.concatenate([found.edges[chosen], faces[found.faces[chosen]]], axis=1)
    x, at = points[nodes], found.at[chosen]
    edge = x[:, 1] - x[:, 0]
    share = np.einsum("nk,nk->n", at - x[:, 0], edge) / np.maximum(np.einsum("nk,nk->n", edge, edge), 1e-300)
    areas = np.stack(
        [np.linalg.norm(np.cross(x[:, i] - at, x[:, j] - at), axis=1) for i, j in ((3, 4), (4, 2), (2, 3))]
    )
    areas = areas.T / np.maximum(areas.sum(axis=0), 1e-300)[:, None]
    share = np.clip(share, 0.0, 1.0)
    return nodes, np.column_stack([1.0 - share, share, -areas])


def _unit(v: F64) -> F64:
    return v / np.maximum(np.linalg.norm(v, axis=1), 1e-300)[:, None]
