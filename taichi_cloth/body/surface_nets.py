"""A field on a grid into triangles: surface nets (Gibson, "Constrained elastic surface nets", MICCAI 1998).

One vertex a cell that the surface crosses, at the mean of the crossings of its edges; one quad a grid edge it crosses.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["surface_nets"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


def surface_nets(values: F64, origin: F64, spacing: float) -> tuple[F64, I32]:
    """Vertices (n, 3) and triangles (m, 3), counter-clockwise seen from where the values are above 0.

    values: shape (x, y, z), at origin + spacing · index; above 0 all round the border.
    """
    inside = values < 0
    shape = np.array(values.shape) - 1
    corner = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]

    def at(grid: NDArray, c: tuple[int, int, int]) -> NDArray:
        return grid[c[0] : c[0] + shape[0], c[1] : c[1] + shape[1], c[2] : c[2] + shape[2]]

    count = sum(at(inside, c).astype(np.int8) for c in corner)
    active = np.nonzero((np.asarray(count) > 0) & (np.asarray(count) < 8))
    number = np.full(tuple(shape), -1, np.int32)
    number[active] = np.arange(len(active[0]))
    cell = np.stack(active, 1)
    value = {c: values[tuple((cell + c).T)] for c in corner}
    total, hits = np.zeros((len(cell), 3)), np.zeros(len(cell))
    for c in corner:
        for axis in range(3):
            if c[axis]:
                continue
            d = tuple(1 if a == axis else c[a] for a in range(3))
            f, g = value[c], value[d]
            crosses = (f < 0) != (g < 0)
            share = np.where(crosses, f / np.where(f == g, 1, f - g), 0)
            place = np.tile(np.array(c, np.float64), (len(cell), 1))
            place[:, axis] = share
            total += crosses[:, None] * place
            hits += crosses
    vertices = origin + spacing * (cell + total / hits[:, None])

    quads = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        low = np.take(inside, range(shape[axis]), axis)
        high = np.take(inside, range(1, shape[axis] + 1), axis)
        edge = np.stack(np.nonzero(low != high), 1)
        turn = low[tuple(edge.T)]
        ring = []
        for db, dc in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            near = edge.copy()
            near[:, b] += db
            near[:, c] += dc
            ring.append(number[tuple(near.T)])
        quad = np.stack(ring, 1)
        quads.append(np.where(turn[:, None], quad, quad[:, ::-1]))
    quad = np.concatenate(quads)
    a, b, c, d = (vertices[quad[:, k]] for k in range(4))
    first = (((a - c) ** 2).sum(1) <= ((b - d) ** 2).sum(1))[:, None, None]
    split = np.where(first, quad[:, [[0, 1, 2], [0, 2, 3]]], quad[:, [[0, 1, 3], [1, 2, 3]]])
    return vertices, split.reshape(-1, 3).astype(np.int32)
