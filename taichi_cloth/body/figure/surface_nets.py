"""A field on a grid into triangles: surface nets (Gibson, "Constrained elastic surface nets", MICCAI 1998).

A vertex for each sheet of the surface in a cell, at the mean of the crossings of its edges; one quad a grid edge it
crosses. Departure: a cell that two sheets pass, such as between two fingers, has two vertices, else it would pinch them
together (Schaefer, Ju and Warren, "Manifold dual contouring", TVCG 2007).
"""

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

__all__ = ["surface_nets"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

CORNERS = np.array(list(product((0, 1), repeat=3)))
"""Corner 4 i + 2 j + k of a cell lies at (i, j, k)."""
EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if (CORNERS[a] != CORNERS[b]).sum() == 1]


FACES = [[c for c in range(8) if CORNERS[c, axis] == side] for axis in range(3) for side in (0, 1)]


@lru_cache(maxsize=1)
def _sheets() -> I32:
    """For each set of corners inside, which sheet of the surface crosses each edge, shape (256, 12).

    Crossings on a face of the cell belong together; of four, those round the same inside corner: so neighbouring cells
    agree.
    """
    sheet = np.zeros((256, len(EDGES)), np.int32)
    for code in range(256):
        inside = [bool(code >> c & 1) for c in range(8)]
        label = list(range(len(EDGES)))
        links = []
        for face in FACES:
            crossed = [e for e, (a, b) in enumerate(EDGES) if a in face and b in face and inside[a] != inside[b]]
            if len(crossed) == 2:
                links.append(crossed)
            elif len(crossed) == 4:
                links += [[e for e in crossed if c in EDGES[e]] for c in face if inside[c]]
        for _ in range(len(EDGES)):
            for a, b in links:
                label[a] = label[b] = min(label[a], label[b])
        order = sorted({label[e] for e, (a, b) in enumerate(EDGES) if inside[a] != inside[b]})
        sheet[code] = [order.index(x) if x in order else 0 for x in label]
    return sheet


def surface_nets(values: F64, origin: F64, spacing: float) -> tuple[F64, I32]:
    """Vertices (n, 3) and triangles (m, 3), counter-clockwise seen from where the values are above 0.

    values: shape (x, y, z), at origin + spacing · index; above 0 all round the border.
    """
    inside = values < 0
    shape = np.array(values.shape) - 1
    code = np.zeros(tuple(shape), np.int32)
    for c, (i, j, k) in enumerate(CORNERS):
        code += inside[i : i + shape[0], j : j + shape[1], k : k + shape[2]].astype(np.int32) << c
    active = np.nonzero((code > 0) & (code < 255))
    cell, kind = np.stack(active, 1), code[active]
    row = np.full(tuple(shape), -1, np.int32)
    row[active] = np.arange(len(cell))

    sheet = _sheets()
    total, hits = np.zeros((len(cell), 4, 3)), np.zeros((len(cell), 4))
    at = [values[tuple((cell + corner).T)] for corner in CORNERS]
    every = np.arange(len(cell))
    for e, (a, b) in enumerate(EDGES):
        f, g = at[a], at[b]
        crosses = (f < 0) != (g < 0)
        of = sheet[kind, e]
        share = np.where(crosses, f / np.where(f == g, 1, f - g), 0)
        place = CORNERS[a] + share[:, None] * (CORNERS[b] - CORNERS[a])
        total[every, of] += crosses[:, None] * place
        hits[every, of] += crosses
    number = np.cumsum((hits > 0).ravel()).reshape(hits.shape) - 1
    used = hits > 0
    vertices = origin + spacing * (cell[:, None] + total / np.maximum(hits, 1)[..., None])[used]

    quads = []
    for axis in range(3):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        low, high = np.take(inside, range(shape[axis]), axis), np.take(inside, range(1, shape[axis] + 1), axis)
        edge = np.stack(np.nonzero(low != high), 1)
        low_in = low[tuple(edge.T)]
        ring = []
        for db, dc in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            near = edge.copy()
            near[:, b] += db
            near[:, c] += dc
            r = row[tuple(near.T)]
            corner = np.zeros(3, int)
            corner[b], corner[c] = -db, -dc
            first = int(corner @ [4, 2, 1])
            e = EDGES.index((first, first + (4, 2, 1)[axis]))
            ring.append(number[r, sheet[kind[r], e]])
        quad = np.stack(ring, 1)
        quads.append(np.where(low_in[:, None], quad, quad[:, ::-1]))
    quad = np.concatenate(quads)
    a, b, c, d = (vertices[quad[:, k]] for k in range(4))
    first = (((a - c) ** 2).sum(1) <= ((b - d) ** 2).sum(1))[:, None, None]
    split = np.where(first, quad[:, [[0, 1, 2], [0, 2, 3]]], quad[:, [[0, 1, 3], [1, 2, 3]]])
    return vertices, split.reshape(-1, 3).astype(np.int32)
