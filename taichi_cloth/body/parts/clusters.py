"""Regions and clusters of a mesh, and how alike two segmentations are.

Region growing on curvedness: Jagannathan and Miller, "Three-dimensional surface mesh segmentation using curvedness-
based region growing approach", IEEE TPAMI 29(12), 2007 (the paper's reference 24). Rand index: Chen, Golovinskiy and
Funkhouser, "A benchmark for 3D mesh segmentation", ACM TOG 28(3), 2009.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from taichi_cloth.body.skin.laplacian import Surface
from taichi_cloth.ground.errors import InputError

__all__ = ["grow", "k_means", "majority", "rand_index"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
RESTARTS = 3
ROUNDS = 60
EVEN = 0.05
"""A region's standard deviation is at least this share of its mean: a ring of equal values would not grow."""


def k_means(points: F64, weights: F64, count: int, *, seed: int = 0) -> I64:
    """The cluster, 0 to count − 1, of each point (n, d), shape (n,): of several starts, the least weighted squares.

    One start takes the farthest points in turn, which does not depend on the points' order; the others are drawn as
    k-means++ does (Arthur and Vassilvitskii 2007), by Philox. Raises InputError for fewer points than clusters.
    """
    if not 1 <= count <= len(points):
        raise InputError(f"clusters: {count} of {len(points)} points; allowed: 1 to the number of points")
    best, least = np.zeros(len(points), np.int64), np.inf
    for start in range(1 + RESTARTS):
        chance = np.random.Generator(np.random.Philox(key=[seed, start]))
        centres = points[[_first(points, weights)]]
        near = ((points - centres[0]) ** 2).sum(axis=1)
        while len(centres) < count:
            if start == 0:
                pick = int(near.argmax())
            else:
                total = np.cumsum(near * weights)
                pick = min(int(np.searchsorted(total, chance.random() * total[-1])), len(points) - 1)
            centres = np.concatenate([centres, points[[pick]]])
            near = np.minimum(near, ((points - points[pick]) ** 2).sum(axis=1))
        label, cost = _lloyd(points, weights, centres)
        if cost < least * (1 - 1e-9):
            best, least = label, cost
    return best


def _first(points: F64, weights: F64) -> int:
    """The point farthest from the mean."""
    return int(((points - np.average(points, axis=0, weights=weights)) ** 2).sum(axis=1).argmax())


def _lloyd(points: F64, weights: F64, centres: F64) -> tuple[I64, float]:
    label = np.full(len(points), -1)
    square = (points**2).sum(axis=1)
    for _ in range(ROUNDS):
        distance = square[:, None] - 2 * points @ centres.T + (centres**2).sum(axis=1)
        new = distance.argmin(axis=1)
        if (new == label).all():
            break
        label = new
        mass = np.bincount(label, weights, len(centres))
        mean = np.stack([np.bincount(label, weights * p, len(centres)) for p in points.T], axis=-1)
        centres = np.where(mass[:, None] > 0, mean / np.maximum(mass, 1e-300)[:, None], centres)
    return label, float((weights * ((points - centres[label]) ** 2).sum(axis=1)).sum())


def grow(surface: Surface, value: F64, *, reach: float = 1.5, smallest: float = 0.005) -> I64:
    """The region of each vertex, shape (v,), 0 and up: from the vertex whose neighbourhood varies least, region after
    region takes in neighbours whose value lies within its mean ± `reach` standard deviations.

    Then every vertex takes what most of its neighbours are, and regions under `smallest` of the area are dissolved.
    """
    graph = surface.adjacency
    degree = np.asarray(graph.sum(axis=1)).ravel() + 1
    mean = (graph @ value + value) / degree
    variance = np.maximum((graph @ value**2 + value**2) / degree - mean**2, 0)
    start, to = graph.indptr.tolist(), graph.indices.tolist()
    at = value.tolist()
    region = [-1] * len(at)
    count = 0
    for seed in np.argsort(variance, kind="stable").tolist():
        if region[seed] >= 0:
            continue
        ring = [seed, *to[start[seed] : start[seed + 1]]]
        n, total, square = len(ring), sum(at[k] for k in ring), sum(at[k] ** 2 for k in ring)
        region[seed], edge = count, [seed]
        while edge:
            following = []
            for i in edge:
                for j in to[start[i] : start[i + 1]]:
                    if region[j] < 0:
                        middle = total / n
                        if (at[j] - middle) ** 2 <= reach**2 * max(square / n - middle**2, (EVEN * middle) ** 2):
                            region[j] = count
                            following.append(j)
                            n, total, square = n + 1, total + at[j], square + at[j] ** 2
            edge = following
        count += 1
    label = np.array(region)
    for _ in range(3):
        label = majority(surface, label)
    return _dissolve(surface, label, smallest)


def majority(surface: Surface, label: I64) -> I64:
    """What most of each vertex and its neighbours are, shape (v,); its own where none is more frequent."""
    count = int(label.max()) + 1
    one = coo_matrix((np.ones(len(label)), (np.arange(len(label)), label)), (len(label), count)).tocsr()
    votes = (surface.adjacency @ one + 1.5 * one).tocsr()
    return np.asarray(votes.argmax(axis=1)).ravel()


def _dissolve(surface: Surface, label: I64, smallest: float) -> I64:
    """Connected regions below a share of the area join the neighbour they share most edges with, smallest first."""
    graph = surface.adjacency.tocoo()
    alike = label[graph.row] == label[graph.col]
    pieces = coo_matrix((np.ones(alike.sum()), (graph.row[alike], graph.col[alike])), graph.shape)
    label = connected_components(pieces, directed=False)[1].astype(np.int64)
    area = np.bincount(label, surface.vertex_areas)
    border = coo_matrix((np.ones(len(graph.row)), (label[graph.row], label[graph.col])), (len(area), len(area))).tocsr()
    border.setdiag(0)
    border.eliminate_zeros()
    shared = [dict(zip(row.indices.tolist(), row.data.tolist(), strict=True)) for row in border]  # pyright: ignore[reportAttributeAccessIssue]
    parent = list(range(len(area)))
    alive = {k: float(a) for k, a in enumerate(area)}
    limit = smallest * float(area.sum())
    while True:
        small = [k for k, a in alive.items() if a < limit and shared[k]]
        if not small or len(alive) == 1:
            break
        k = min(small, key=lambda m: (alive[m], m))
        into = max(shared[k], key=lambda m: (shared[k][m], -m))
        parent[k] = into
        alive[into] += alive.pop(k)
        for m, edges in shared[k].items():
            shared[m].pop(k)
            if m != into:
                shared[m][into] = shared[into][m] = shared[into].get(m, 0.0) + edges
    for k in range(len(parent)):
        root = k
        while parent[root] != root:
            root = parent[root]
        parent[k] = root
    return np.unique(np.array(parent)[label], return_inverse=True)[1]


def rand_index(labels: NDArray, other: NDArray, areas: F64 | None = None) -> float:
    """Share of the pairs of faces that two segmentations, (f,) each, agree on: together in both, or apart in both.

    areas: weights of the faces (f,), a pair counting as their product; None counts every pair once, as the benchmark
    does. 1 is the same up to names; the benchmark prints 1 less this. Raises InputError for unequal lengths.
    """
    labels, other = np.asarray(labels).ravel(), np.asarray(other).ravel()
    weight = np.ones(len(labels)) if areas is None else np.asarray(areas, np.float64).ravel()
    if not len(labels) == len(other) == len(weight) or len(labels) < 2:
        raise InputError(
            f"rand_index: {len(labels)}, {len(other)}, {len(weight)} faces; allowed: the same, two or more"
        )
    a = np.unique(labels, return_inverse=True)[1]
    b = np.unique(other, return_inverse=True)[1]

    def pairs(group: NDArray) -> float:
        """Twice the weight of the pairs within groups."""
        return float((np.bincount(group, weight) ** 2).sum() - (weight**2).sum())

    everything = float(weight.sum() ** 2 - (weight**2).sum())
    both = pairs(a * (int(b.max()) + 1) + b)
    return (everything - pairs(a) - pairs(b) + 2 * both) / everything
