"""Which points of a garment's surface are sewn together: what lies along a seam is one cloth there.

The points that two outlines have along a seam do not lie side by side: each has them where it crosses the lattice of
its own panel. So they are taken together in groups no longer than the distance of two ties, each with points of both
sides. Where one group ends and the next begins is chosen so that points of different groups lie as far apart as can be:
they are kept from passing through each other, and a seam shifts a little.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from taichi_cloth.garment.pattern.cut import turned
from taichi_cloth.garment.sewn.surface import Surface

if TYPE_CHECKING:
    from taichi_cloth.garment.sewn.garment import Garment

__all__ = ["joined_points", "seam_distance"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FINER = 64
"""Places along a seam to each tie, by which those of an outline are known to lie on it."""
LONGEST = 1.0
"""Of a group, in distances of two ties."""
BESIDE = 0.1
"""Of a point to a seam, in cells, up to which it is one with those of the seam next to it: no more is known of where a
seam is than by how much the cells beside it are warped."""
NARROW = 0.02
"""Distance between groups, in the same, below which it hardly matters how much narrower it is."""


def joined_points(garment: "Garment", surface: Surface) -> I64:
    """(n,) a number of each point of the surface: those of one number are sewn together, or BESIDE those that are."""
    edge = _outline(surface.faces)
    names = [piece.panel.name for piece in garment.atlas.panels]
    of_panel = {name: edge[surface.panel[edge] == number] for number, name in enumerate(names)}
    points, groups, made = [], [], 0
    for sides in _seams(garment):
        found = [(panel, *_on(places, surface.flat[of_panel[panel]], 0.6)) for panel, places in sides]
        at = np.concatenate([along for _, _, along in found]) / FINER
        side = np.repeat([0, 1], [len(along) for _, _, along in found])
        points.append(np.concatenate([of_panel[panel][near] for panel, near, _ in found]))
        group = _grouped(at, side)
        groups.append(made + group)
        made += int(group.max(initial=-1)) + 1
    n = len(surface.flat)
    if not points:
        return np.arange(n)
    on, group = np.concatenate(points), np.concatenate(groups)
    near, next_to = _beside(garment, surface, on)
    i, j = np.concatenate([on, near]), np.concatenate([n + group, next_to])
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(n + made, n + made))
    return np.asarray(connected_components(graph, directed=False)[1])[:n].astype(np.int64)


def _beside(garment: "Garment", surface: Surface, on: I64) -> tuple[I64, I64]:
    """Points that are not `on` a seam but next to one, and which of those on it is nearest."""
    near, next_to = [], []
    off, apart = np.setdiff1d(np.arange(len(surface.flat)), on), seam_distance(garment, surface)
    for number in range(len(garment.atlas.panels)):
        mine, edge = off[surface.panel[off] == number], np.unique(on[surface.panel[on] == number])
        if len(edge):
            nearest = np.asarray(KDTree(surface.flat[edge]).query(surface.flat[mine])[1])
            chosen = apart[mine] < BESIDE * min(garment.atlas.spacing)
            near.append(mine[chosen])
            next_to.append(edge[nearest[chosen]])
    return np.concatenate(near), np.concatenate(next_to)


def seam_distance(garment: "Garment", surface: Surface) -> F64:
    """(n,) how far points of the surface are from the nearest seam of their panel, in the flat pattern [m]; ∞ in one
    without."""
    out = np.full(len(surface.flat), np.inf)
    names = [piece.panel.name for piece in garment.atlas.panels]
    for sides in _seams(garment):
        for panel, places in sides:
            mine = np.flatnonzero(surface.panel == names.index(panel))
            out[mine] = np.minimum(out[mine], KDTree(places).query(surface.flat[mine])[0])
    return out


def _seams(garment: "Garment") -> list[list[tuple[str, F64]]]:
    """Of each seam: panel and places (m, 2) in grain coordinates of both sides, FINER to each of its ties."""
    out = []
    for seam, count in zip(garment.pattern.seams, garment.tie_counts(), strict=True):
        fine = garment.pattern.pairs(seam, FINER * (count - 1) + 1)
        sides = zip((seam.first, seam.second), fine, strict=True)
        out.append([(one.panel, turned(at, garment.atlas.panel(one.panel).panel.grain)) for one, at in sides])
    return out


def _on(places: F64, points: F64, off: float) -> tuple[I64, F64]:
    """Which points lie on a line of places, no more than `off` of their distance beside it; and number of the place."""
    apart = np.linalg.norm(np.diff(places, axis=0), axis=1).max()
    distance, nearest = KDTree(places).query(points)
    near = np.flatnonzero(distance <= max(off * apart, 1e-5))
    return near, np.asarray(nearest)[near].astype(np.float64)


def _grouped(at: F64, side: I64) -> I64:
    """Number of the group of each place (n,) along a seam, in ties, of points of sides 0 and 1 (n,): those groups that
    are farthest apart, all in all (by dynamic programming)."""
    order = np.argsort(at, kind="stable")
    x, s, n = at[order], side[order], len(at)
    best, last = np.full(n + 1, np.inf), np.zeros(n + 1, np.int64)
    best[0] = 0.0
    for end in range(1, n + 1):
        there = set()
        for begin in range(end - 1, -1, -1):
            there.add(int(s[begin]))
            long = x[end - 1] - x[begin]
            cost = best[begin] + (0.0 if begin == 0 else 1.0 / (x[begin] - x[begin - 1] + NARROW))
            cost += 1e3 * max(long - LONGEST, 0.0) + 1e6 * (len(there) < 2)
            if cost < best[end]:
                best[end], last[end] = cost, begin
            if long > 3 * LONGEST:
                break
    out, end, number = np.zeros(n, np.int64), n, 0
    while end > 0:
        begin = int(last[end])
        out[order[begin:end]] = number
        number, end = number + 1, begin
    return out


def _outline(faces: NDArray[np.int32]) -> I64:
    """Numbers of the points on edges that only one triangle has."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(found[count == 1]).astype(np.int64)
