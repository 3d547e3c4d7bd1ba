"""Which triangles of a mesh pass through others, exactly: what contact of cloth is judged by.

Two triangles meet where an edge of one meets the other. An edge and a triangle that share a point of the mesh are let
off, nothing else: triangles that share one point are told apart by the edges across from it, and two that share an edge
meet beyond it only where they lie flat on each other. Whether an edge meets a triangle follows from signs of volumes,
and of areas where they lie in one plane, all of which are exact (`signs.py`). To touch is to meet.
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.crossings.boxes import CHUNK, overlapping
from taichi_cloth.crossings.signs import ROUNDING, area_signs, volume_signs
from taichi_cloth.ground.errors import InputError

__all__ = ["Crossings", "find_crossings"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

EDGES = ((0, 1), (1, 2), (2, 0))
AXES = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (0, 1, 1), (0, 1, -1), (1, 0, 1), (1, 0, -1)], float
)
"""Along which edges and triangles are told apart first: x, y, z and the diagonals between them."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """pairs: (n, 2) numbers of triangles that meet, first < second, in order. places: (n, 3) [m] where: a point that is
    both, to rounding; of two in one plane, one that is in the boxes of both.

    edges: (k, 2) points of each edge that meets a triangle, faces: (k,) that triangle, at: (k, 3) where [m], of: (k,)
    the number of the pair that it is of; an edge of two triangles stands with each of them.
    """

    pairs: I64
    places: F64
    edges: I64
    faces: I64
    at: F64
    of: I64

    @property
    def triangles(self) -> I64:
        """Numbers of all triangles that meet another, in order."""
        return np.unique(self.pairs)

    @property
    def count(self) -> int:
        """How many triangles meet another."""
        return len(self.triangles)


def find_crossings(
    points: ArrayLike,
    triangles: ArrayLike,
    same: ArrayLike | None = None,
    among: NDArray[np.bool_] | None = None,
) -> Crossings:
    """Of a mesh. points: (n, 3) [m]. triangles: (m, 3) numbers of points. same: (n,), a number of each point: points of
    the same number are one, as where cloth is sewn. among: (m,), triangles of which one at least is in each pair that
    is looked for; None: all.

    Raises InputError on numbers that are not finite, or triangles of points that are not there.
    """
    x, faces = np.asarray(points, np.float64), np.asarray(triangles, np.int64)
    if x.ndim != 2 or x.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,):
        raise InputError(f"crossings: points {x.shape} and triangles {faces.shape}; allowed: (n, 3) and (m, 3)")
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(x)):
        raise InputError(f"crossings: a triangle of point {faces.max()}; allowed: 0 to {len(x) - 1}")
    if not np.isfinite(x[faces]).all():
        raise InputError("crossings: points that are not finite; allowed: finite numbers [m]")
    if len(faces) < 2:
        none = np.zeros((0, 2), np.int64), np.zeros((0, 3))
        return Crossings(*none, none[0], none[0][:, 0], none[1], none[0][:, 0])
    label = np.arange(len(x)) if same is None else np.asarray(same)
    corners, along = x[faces], x @ AXES.T
    low, high = _reach(along, faces)
    slack = 8 * ROUNDING * np.abs(AXES) @ np.maximum(high, -low)[:, :3].max(axis=0)
    slack[:3] = 0.0  # these are not rounded
    low, high = low - slack, high + slack
    pairs = overlapping(low, high, among)
    ends, face, pair = _candidates(pairs, faces, label[faces], along, low, high)
    meet, place = _meet(x[ends[:, 0]], x[ends[:, 1]], corners[face])
    ends, face, place = ends[meet], face[meet], place[meet]
    found, first, of = np.unique(pair[meet], return_index=True, return_inverse=True)
    out, where = pairs[found], place[first]
    where = np.clip(where, low[out, :3].max(axis=1), high[out, :3].min(axis=1))
    order = np.lexsort((out[:, 1], out[:, 0]))
    return Crossings(out[order], where[order], ends, face, place, np.argsort(order)[of.ravel()])


def _reach(along: F64, points: I64) -> tuple[F64, F64]:
    """Of points (n, k) of edges or triangles, the least and the most (n, axes) along each axis."""
    least = most = along[points[:, 0]]
    for one in points.T[1:]:
        here = along[one]
        least, most = np.minimum(least, here), np.maximum(most, here)
    return least, most


def _candidates(pairs: I64, faces: I64, labels: NDArray, along: F64, low: F64, high: F64) -> tuple[I64, I64, I64]:
    """Edges of one triangle of each pair against the other one, where they share no point and neither lies beyond the
    other along an axis: ends of the edge (n, 2), the other triangle, and the number of the pair. along: of points.
    low, high: of triangles."""
    found: list[list[tuple[I64, I64, I64]]] = [[] for _ in range(2 * len(EDGES))]
    for begin in range(0, max(len(pairs), 1), CHUNK):
        one, other = pairs[begin : begin + CHUNK].T
        alike = labels[one][:, :, None] == labels[other][:, None, :]
        sides = (one, other, alike.any(axis=2)), (other, one, alike.any(axis=1))
        kinds = ((*side, ends) for side in sides for ends in EDGES)
        for own, (first, second, shared, ends) in zip(found, kinds, strict=True):
            some = np.flatnonzero(~(shared[:, ends[0]] | shared[:, ends[1]]))
            edge, face = faces[first[some]][:, ends], second[some]
            least, most = _reach(along, edge)
            near = ((least <= high[face]) & (low[face] <= most)).all(axis=1)
            own.append((edge[near], face[near], begin + some[near]))
    ends, face, pair = (np.concatenate(parts) for parts in zip(*chain.from_iterable(found), strict=True))
    return ends, face, pair


def _meet(p: F64, q: F64, corners: F64) -> tuple[NDArray[np.bool_], F64]:
    """Whether segments p to q, (n, 3), and triangles (n, 3, 3) have a point in common, and where, (n, 3)."""
    a, b, c = corners.transpose(1, 0, 2)
    out, place = np.zeros(len(p), bool), 0.5 * (p + q)
    above, below = volume_signs(a, b, c, p), volume_signs(a, b, c, q)
    todo = np.flatnonzero(above * below <= 0)
    around = np.stack([volume_signs(p[todo], q[todo], *(corners[todo, k] for k in ends)) for ends in EDGES])
    flat = (above[todo] == 0) & (below[todo] == 0)
    through = ~flat & ((around >= 0).all(axis=0) | (around <= 0).all(axis=0))
    out[todo[through]] = True
    place[out] = _pierced(p[out], q[out], corners[out])
    beside = todo[flat & (around == 0).all(axis=0)]
    out[beside] = _overlap(p[beside], q[beside], corners[beside])
    return out, place


def _pierced(p: F64, q: F64, corners: F64) -> F64:
    """Where segments (n, 3) go through the planes of triangles (n, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    above, below = (np.abs(np.einsum("nk,nk->n", x - corners[:, 0], normal)) for x in (p, q))
    share = above / np.maximum(above + below, 1e-300)
    return p + share[:, None] * (q - p)


def _overlap(p: F64, q: F64, corners: F64) -> NDArray[np.bool_]:
    """The same as `_meet` where all lies in one plane: they meet if they do seen along each axis, of which at least one
    is not in that plane. Triangles that are a line or a point are no exception."""
    out = np.ones(len(p), bool)
    for axes in ((0, 1), (1, 2), (2, 0)):
        some = np.flatnonzero(out)
        out[some] = _overlap_flat(p[some][:, axes], q[some][:, axes], corners[some][:, :, axes])
    return out


def _overlap_flat(p: F64, q: F64, corners: F64) -> NDArray[np.bool_]:
    """Segments (n, 2) and triangles (n, 3, 2): an edge meets the segment, or the segment begins inside."""
    side = np.stack([area_signs(corners[:, i], corners[:, j], p) for i, j in EDGES])
    across = np.stack([area_signs(p, q, corners[:, k]) for k in range(3)])
    some_area = area_signs(*corners.transpose(1, 0, 2)) != 0
    out = some_area & ((side >= 0).all(axis=0) | (side <= 0).all(axis=0))
    low, high = np.minimum(p, q), np.maximum(p, q)
    for number, (i, j) in enumerate(EDGES):
        one, other = corners[:, i], corners[:, j]
        boxes = (np.minimum(one, other) <= high) & (low <= np.maximum(one, other))
        ends = side[number] * area_signs(one, other, q) <= 0
        out |= boxes.all(axis=1) & ends & (across[i] * across[j] <= 0)
    return out
