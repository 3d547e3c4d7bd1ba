"""Distance grids: the mesh itself in contact, a grid of signed distances a part, moving rigidly with its bone.

Made once, on the host: the distance from each node to the nearest triangle (Ericson 2005, 5.1.5), exact up to two
spacings, beyond to the size of a triangle. The sign, which needs a closed mesh, is that of the pseudo-normal of the
nearest face, edge or vertex (Baerentzen & Aanaes 2005) near the surface, and of the generalised winding number
(Jacobson et al. 2013) for the rest, once for all nodes that no surface parts. A part's grid knows the triangles
of the part and those within `overlap` of it; where another part is nearer the distance is kept positive, as that
part's grid answers there.
"""

# SciPy and NumPy say less about their types than they do.
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false, reportIndexIssue=false

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import label
from scipy.spatial import cKDTree

from taichi_cloth.body.triangles import triangle_distance
from taichi_cloth.errors import InputError

__all__ = ["DistanceGrid", "grid_of_mesh", "signed_mesh_distance"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """values: float32 (nx, ny, nz) [m] at origin + spacing × (i, j, k), at rest; trilinear between."""

    origin: F64
    spacing: float
    values: F32
    part: str = ""
    bone: int = 0

    def __post_init__(self) -> None:
        if self.values.ndim != 3 or min(self.values.shape) < 2 or not np.isfinite(self.values).all():
            raise InputError(f"body.grid: {self.values.shape}; allowed: 2 finite values or more each way")

    def at(self, points: ArrayLike) -> tuple[F64, F64]:
        """Distance (n,) [m] and its gradient (n, 3) at points (n, 3); outside the grid that of the nearest cell, and
        the way to it added."""
        p = (np.asarray(points, np.float64) - self.origin) / self.spacing
        top = np.array(self.values.shape) - 1
        inside = np.clip(p, 0, top)
        i = np.minimum(inside.astype(np.int64), top - 1)
        f = inside - i
        distance, gradient = np.zeros(len(p)), np.zeros((len(p), 3))
        for corner in np.ndindex(2, 2, 2):
            c = np.array(corner)
            value = self.values[tuple((i + c).T)].astype(np.float64)
            w = np.where(c == 1, f, 1 - f)
            distance += w.prod(axis=1) * value
            for k in range(3):
                gradient[:, k] += np.delete(w, k, axis=1).prod(axis=1) * value * (1 if c[k] else -1)
        beyond = np.linalg.norm(p - inside, axis=1) * self.spacing
        return distance + beyond, gradient / self.spacing


def grid_of_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    spacing: float,
    chosen: ArrayLike | None = None,
    margin: float = 0.03,
    overlap: float = 0.03,
    part: str = "",
    bone: int = 0,
) -> DistanceGrid:
    """The grid around the chosen faces of a closed mesh: vertices (v, 3) [m], faces (f, 3), chosen bool (f,) or None
    for all, margin [m] around them. Raises InputError on no face or a spacing that gives too many nodes."""
    v, f = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    mine = np.ones(len(f), bool) if chosen is None else np.asarray(chosen, bool)
    if not mine.any() or not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"body.grid: {int(mine.sum())} faces, spacing {spacing!r}; allowed: one or more, above 0")
    corners = v[f[mine]].reshape(-1, 3)
    origin = corners.min(axis=0) - margin
    count = np.ceil((corners.max(axis=0) + margin - origin) / spacing).astype(int) + 1
    if count.prod() > 4_000_000:
        raise InputError(
            f"body.grid: {count.tolist()} nodes; allowed: 4000000; use a larger spacing than {spacing:g} m"
        )
    nodes = origin + spacing * np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), -1).reshape(-1, 3)
    distance, nearest = _unsigned(v[f], nodes, 2 * spacing)
    distance *= _signs(v, f, nodes, distance, nearest, tuple(count), spacing)
    if not mine.all():
        grown = cKDTree(corners).query(v[f].mean(axis=1))[0] <= overlap
        foreign = ~(mine | grown)[nearest]
        distance[foreign] = np.maximum(np.abs(distance[foreign]), spacing)
    return DistanceGrid(origin, spacing, distance.reshape(tuple(count)).astype(np.float32), part, bone)


def signed_mesh_distance(vertices: F64, faces: NDArray[np.int64], points: F64) -> tuple[F64, NDArray[np.int64]]:
    """Exact signed distance (n,) [m] from points to a closed mesh, and the nearest triangle (n,)."""
    distance, nearest = _unsigned(vertices[faces], points, np.inf)
    return np.where(_inside(vertices[faces], points), -distance, distance), nearest


def _signs(
    vertices: F64,
    faces: NDArray[np.int64],
    nodes: F64,
    distance: F64,
    nearest: NDArray[np.int64],
    shape: tuple[int, ...],
    spacing: float,
) -> F64:
    """−1 inside, 1 outside. Neighbours that are both further from the surface than half a spacing are on one side."""
    groups, count = label((distance > 0.6 * spacing).reshape(shape))  # pyright: ignore[reportGeneralTypeIssues]
    groups = groups.ravel()
    found, asked = np.unique(groups, return_index=True)
    asked = asked[found > 0]
    sides = np.ones(count + 1)
    sides[groups[asked]] = np.where(_inside(vertices[faces], nodes[asked]), -1.0, 1.0)
    out = sides[groups]
    near = groups == 0
    out[near] = _sides(vertices, faces, nodes[near], nearest[near])
    return out


def _sides(vertices: F64, faces: NDArray[np.int64], points: F64, nearest: NDArray[np.int64]) -> F64:
    """−1 inside, 1 outside, by the angle-weighted normal at the nearest place of the triangle `nearest` (n,)."""
    t = vertices[faces]
    normal = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    at_vertex = np.zeros_like(vertices)
    for k in range(3):
        one, two = t[:, (k + 1) % 3] - t[:, k], t[:, (k + 2) % 3] - t[:, k]
        lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
        angle = np.arccos(np.clip((one * two).sum(1) / np.maximum(lengths, 1e-300), -1, 1))
        np.add.at(at_vertex, faces[:, k], angle[:, None] * normal)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    edge = edge.reshape(-1, 3)
    at_edge = np.zeros((int(edge.max()) + 1, 3))
    for k in range(3):
        np.add.at(at_edge, edge[:, k], normal)
    foot, share = _foot(points, t[nearest])
    on = share > 1e-9
    n = np.where(on.all(axis=1)[:, None], normal[nearest], 0.0)
    for k in range(3):
        two = on[:, k] & on[:, (k + 1) % 3] & ~on[:, (k + 2) % 3]
        n[two] = at_edge[edge[nearest[two], k]]
        alone = on[:, k] & ~on[:, (k + 1) % 3] & ~on[:, (k + 2) % 3]
        n[alone] = at_vertex[faces[nearest[alone], k]]
    return np.where(((points - foot) * n).sum(1) < 0, -1.0, 1.0)


def _foot(p: F64, t: F64) -> tuple[F64, F64]:
    """The nearest place (n, 3) of triangles t (n, 3, 3) to p (n, 3), and its barycentric shares (n, 3)."""
    a, b, c = t[:, 0], t[:, 1], t[:, 2]
    normal = np.cross(b - a, c - a)
    size = np.maximum((normal * normal).sum(1), 1e-300)
    share = np.stack([(np.cross(t[:, (k + 2) % 3] - t[:, (k + 1) % 3], p - t[:, (k + 1) % 3]) * normal).sum(1) / size
                      for k in range(3)], axis=1)  # fmt: skip
    best = np.full(len(p), np.inf)
    best[(share >= 0).all(axis=1)] = -1.0
    for k in range(3):
        one, along = t[:, k], t[:, (k + 1) % 3] - t[:, k]
        part = np.clip(((p - one) * along).sum(1) / np.maximum((along * along).sum(1), 1e-300), 0, 1)
        far = ((p - one - part[:, None] * along) ** 2).sum(1)
        nearer = far < best
        best[nearer] = far[nearer]
        share[nearer] = 0.0
        share[nearer, k], share[nearer, (k + 1) % 3] = 1 - part[nearer], part[nearer]
    return np.einsum("nk,nkc->nc", share, t), share


def _unsigned(triangles: F64, points: F64, band: float) -> tuple[F64, NDArray[np.int64]]:
    """Exact up to `band` [m]; beyond, the distance to the nearest middle of a triangle."""
    middle = triangles.mean(axis=1)
    reach = float(np.linalg.norm(triangles - middle[:, None], axis=2).max())
    tree = cKDTree(middle)
    near, first = tree.query(points)
    distance, nearest = np.empty(len(points)), np.asarray(first, np.int64).copy()
    distance[:] = near
    close = np.flatnonzero(near <= band + reach)
    for begin in range(0, len(close), 4096):
        part = close[begin : begin + 4096]
        least = triangle_distance(points[part], triangles[nearest[part]])
        lists = tree.query_ball_point(points[part], least + reach * (1 + 1e-9))
        sizes = np.array([len(one) for one in lists])
        whose = np.repeat(np.arange(len(sizes)), sizes)
        tried = np.concatenate([np.asarray(one, np.int64) for one in lists])
        d = triangle_distance(points[part][whose], triangles[tried])
        order = np.lexsort((tried, d, whose))
        best = order[np.concatenate([[0], np.cumsum(sizes)[:-1]])]
        distance[part], nearest[part] = d[best], tried[best]
    return distance, nearest


def _inside(triangles: F64, points: F64) -> NDArray[np.bool_]:
    """Whether the solid angles of all triangles (Van Oosterom & Strackee 1983) add up to more than half a turn."""
    out = np.empty(len(points), bool)
    step = max(1, 300_000 // max(1, len(triangles)))
    for begin in range(0, len(points), step):
        r = triangles[None] - points[begin : begin + step, None, None]
        length = np.linalg.norm(r, axis=3)
        a, b, c = r[:, :, 0], r[:, :, 1], r[:, :, 2]
        la, lb, lc = length[..., 0], length[..., 1], length[..., 2]
        above = (a * np.cross(b, c)).sum(-1)
        below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
        out[begin : begin + step] = np.arctan2(above, below).sum(axis=1) * 2 > 2 * np.pi
    return out
