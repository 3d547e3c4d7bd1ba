"""Bounding boxes over the primitives of a body, in a tree whose shape is made once and whose boxes follow the body.

Nodes stand in preorder: a node's first child is the next node, and `skip` is where to go on when its box is missed, so
that a walk needs no stack.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.primitives.primitives import Primitive

__all__ = ["Hierarchy", "build", "corners"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """skip: (nodes,) the node after the whole branch. leaf: (nodes,) its primitive, −1 inside the tree."""

    skip: I32
    leaf: I32


def build(middles: F64) -> Hierarchy:
    """A balanced tree over places (n, 3) [m]: halves at the median of the longest side of their box."""
    skip: list[int] = []
    leaf: list[int] = []

    def grow(chosen: NDArray[np.int64]) -> None:
        node = len(skip)
        skip.append(0)
        leaf.append(int(chosen[0]) if len(chosen) == 1 else -1)
        if len(chosen) > 1:
            p = middles[chosen]
            order = np.argsort(p[:, np.argmax(np.ptp(p, axis=0))], kind="stable")
            half = len(chosen) // 2
            grow(chosen[order[:half]])
            grow(chosen[order[half:]])
        skip[node] = len(skip)

    grow(np.arange(len(middles)))
    return Hierarchy(np.array(skip, np.int32), np.array(leaf, np.int32))


def corners(primitives: Sequence[Primitive | DistanceGrid]) -> tuple[F64, F64]:
    """Points (n, 8, 3) and radii (n, 8) [m]: each primitive lies in the hull of its 8 balls, wherever it is turned."""
    points = np.zeros((len(primitives), 8, 3))
    radii = np.zeros((len(primitives), 8))
    for p, primitive in enumerate(primitives):
        if isinstance(primitive, DistanceGrid):
            side = primitive.spacing * (np.array(primitive.values.shape) - 1)
            points[p] = primitive.origin + side * np.array(list(np.ndindex(2, 2, 2)))
            continue
        points[p, :4], points[p, 4:] = primitive.start, primitive.end
        radii[p, :4], radii[p, 4:] = primitive.radii[0], primitive.radii[1]
        if primitive.kind == "sphere":
            radii[p] = primitive.radii[0]
        elif primitive.across is not None and primitive.kind == "elliptic":
            axis = (primitive.end - primitive.start) / np.linalg.norm(primitive.end - primitive.start)
            x, y = primitive.radii[0] * primitive.across, primitive.radii[1] * np.cross(axis, primitive.across)
            points[p] += np.array([x + y, x - y, y - x, -x - y] * 2)
            radii[p] = 0.0
    return points, radii
