"""At which height cloth is worn once its darts are closed: flat panels do not show it.

A dart at the side draws what lies over it down along the seam by as much as it is wide, and not at its tip. So the
height h of each point of panels that are sewn side by side rises along them as near as it can to as they were drawn,
where both sides of each seam and of each dart lie at one height: the least of ∫ |∇h − ∇y|² over all panels, y the
height in the plane of each. It is a Poisson problem, solved on triangles.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay
from scipy.spatial.distance import cdist

from taichi_cloth.garment.fit.piece import Piece, Work
from taichi_cloth.garment.pattern.cut import inside

__all__ = ["worn_levels"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FINE = 0.02
"""Between points within a panel [m]."""
CLOSED = 1e3
"""Weight of a seam's two sides being level, of each point along it; triangles have weights of about 1."""
TOP = 0.03
"""Of what stays at its height as drawn, from the highest point down: what carries the rest [m]."""
CARRIED, LEFT = 1e-3, 1e-8
"""Weights of points there and of all others, which only settle what seams leave open: how high it all is."""


class _Net(NamedTuple):
    """Triangles of a panel. points: (n, 2), of the outline first. faces: (m, 3). ends: number of each edge's first."""

    points: F64
    faces: I64
    ends: I64


def worn_levels(work: Work, pieces: list[Piece]) -> dict[str, list[F64]]:
    """Heights of the points of each graded edge of pieces that are sewn side by side [m], by the pieces' names. Where
    none of them has a dart they are those of their planes."""
    flat = {piece.name: [piece.level(k, worn=True) for k in range(len(piece.graded))] for piece in pieces}
    own = [s for s in work.seams if s.first.panel in flat and s.second.panel in flat]
    if not any(s.first.panel == s.second.panel for s in own) or any(piece.ring is not None for piece in pieces):
        return flat
    nets = {piece.name: _net(piece) for piece in pieces}
    first, count = dict[str, int](), 0
    for name, net in nets.items():
        first[name], count = count, count + len(net.points)
    level, rows, cols, stiff = np.zeros(count), list[I64](), list[I64](), list[F64]()
    for piece in pieces:
        net, at = nets[piece.name], first[piece.name]
        rise = piece.rotation[1, :2]
        level[at : at + len(net.points)] = net.points @ rise + piece.shift[1]
        a, b, c = (net.points[net.faces[:, k]] for k in range(3))
        area = np.abs(_cross(b - a, c - a)) / 2
        side = np.stack([c - b, a - c, b - a], axis=1)  # (m, 3, 2), opposite to each corner
        stiff.append((np.einsum("mic,mjc->mij", side, side) / (4 * area[:, None, None])).ravel())
        rows.append(np.repeat(net.faces + at, 3, axis=1).ravel())
        cols.append(np.tile(net.faces + at, 3).ravel())
    where = np.concatenate(rows), np.concatenate(cols)
    matrix = csc_array(coo_array((np.concatenate(stiff), where), shape=(count, count)))
    right = matrix @ level
    for seam in own:
        one, other = (_along(nets[side.panel], side.edge) for side in (seam.first, seam.second))
        s, t = one[1], other[1] if seam.alike else 1 - other[1]
        to = np.argsort(t, kind="stable")
        nodes, sorted_t = other[0][to], t[to]
        k = np.clip(np.searchsorted(sorted_t, s) - 1, 0, len(sorted_t) - 2)
        share = np.clip((s - sorted_t[k]) / np.maximum(sorted_t[k + 1] - sorted_t[k], 1e-12), 0.0, 1.0)
        tie = np.tile(np.arange(len(s)), 3)
        a, b = first[seam.first.panel], first[seam.second.panel]
        at = np.concatenate([one[0] + a, nodes[k] + b, nodes[k + 1] + b])
        shares = np.concatenate([np.ones(len(s)), share - 1, -share])
        apart = csc_array(coo_array((shares, (tie, at)), shape=(len(s), count)))
        matrix = matrix + CLOSED * csc_array(apart.T @ apart)
    stays = np.where(level > level.max() - TOP, CARRIED, LEFT)
    found = np.asarray(spsolve(csc_array(matrix + diags_array(stays)), right + stays * level))
    out = {}
    for name, net in nets.items():
        edges = range(len(net.ends) - 1)
        out[name] = [found[_along(net, k)[0] + first[name]] for k in edges]
    return out


def _net(piece: Piece) -> _Net:
    outline = np.concatenate([edge[:-1] for edge in piece.graded])
    ends = np.cumsum([0, *(len(edge) - 1 for edge in piece.graded)])
    low, high = outline.min(axis=0), outline.max(axis=0)
    across = [np.arange(a + FINE / 2, b, FINE) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*across), -1).reshape(-1, 2)
    grid = grid[inside(outline, grid)]
    if len(grid):
        grid = grid[cdist(grid, outline).min(axis=1) > 0.4 * FINE]
    points = np.concatenate([outline, grid])
    faces = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    whole = np.abs(_cross(b - a, c - a)) > 1e-9
    return _Net(points, faces[whole & inside(outline, (a + b + c) / 3)], ends)


def _along(net: _Net, edge: int) -> tuple[I64, F64]:
    """Numbers of the points of an edge, from its start to its end, and their shares of its length."""
    numbers = np.arange(net.ends[edge], net.ends[edge + 1] + 1) % net.ends[-1]
    long = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(net.points[numbers], axis=0), axis=1))])
    return numbers, long / max(float(long[-1]), 1e-12)


def _cross(u: F64, v: F64) -> F64:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
