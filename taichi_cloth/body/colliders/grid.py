"""Distance grids: the mesh itself in contact, a grid of signed distances a part, moving rigidly with its bone.

Made once, on the host, for all parts on one lattice. Up to one spacing from the skin a node's distance is exact: every
triangle tells the nodes in the box around it. Beyond, it is the least to the triangles that the nearest such node and
those of its neighbours found. The sign, which needs a closed mesh, is that of the pseudo-normal of the nearest face,
edge or vertex (Baerentzen & Aanaes 2005) near the surface, and of the generalised winding number (Jacobson et al. 2013)
for the rest, once for all nodes that no surface parts. A part's grid knows the triangles of the part and those within
`overlap` of it; where another part is nearer the distance is kept positive, as that part's grid answers there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt, label
from scipy.spatial import KDTree

from taichi_cloth.body.skin.triangles import triangle_distance
from taichi_cloth.ground.errors import InputError

__all__ = ["DistanceGrid", "part_grids"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
LARGEST = 8_000_000  # nodes of the lattice; the built-in body at 5 mm has 6.8 million, which take 0.6 GB to make


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

    def wider(self, by: float) -> "DistanceGrid":
        """All points within `by` [m] of it."""
        return replace(self, values=(self.values - np.float32(by)))

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


def part_grids(
    vertices: ArrayLike,
    faces: ArrayLike,
    labels: ArrayLike,
    parts: Sequence[tuple[str, int]],
    *,
    spacing: float,
    margin: float = 0.03,
    overlap: float = 0.03,
) -> tuple[DistanceGrid, ...]:
    """A grid around the faces of each part of a closed mesh: vertices (v, 3) [m], faces (f, 3), labels (f,) into parts,
    which are names and bones; margin [m] around them. Raises InputError on a part without faces, or a spacing that
    gives too many nodes."""
    v, f, part = np.asarray(vertices, np.float64), np.asarray(faces, np.int64), np.asarray(labels)
    present = np.bincount(part, minlength=len(parts))
    if len(present) > len(parts) or not present.all() or not (np.isfinite(spacing) and spacing > 0):
        raise InputError(
            f"body.grid: {present.tolist()} faces in {len(parts)} parts, spacing {spacing!r}; "
            "allowed: one or more in each, above 0"
        )
    origin = v[f].min(axis=(0, 1)) - margin
    shape = np.ceil((v[f].max(axis=(0, 1)) + margin - origin) / spacing).astype(int) + 1
    if shape.prod() > LARGEST:
        raise InputError(
            f"body.grid: {shape.tolist()} nodes; allowed: {LARGEST}; use a larger spacing than {spacing:g} m"
        )
    corners = [v[f[part == number]].reshape(-1, 3) for number in range(len(parts))]
    boxes = []
    wanted = np.zeros(tuple(shape), bool)
    for mine in corners:
        low = np.floor((mine.min(axis=0) - margin - origin) / spacing).astype(int).clip(0)
        high = np.ceil((mine.max(axis=0) + margin - origin) / spacing).astype(int) + 1
        boxes.append(tuple(slice(i, j) for i, j in zip(low.tolist(), high.tolist(), strict=True)))
        wanted[boxes[-1]] = True
    distance, nearest = _unsigned(v[f], origin, spacing, wanted)
    distance *= _signs(v, f, origin, spacing, distance, nearest)
    middles = v[f].mean(axis=1)
    out = []
    for number, ((name, bone), mine, box) in enumerate(zip(parts, corners, boxes, strict=True)):
        grown = np.isfinite(KDTree(mine).query(middles, distance_upper_bound=overlap)[0]) | (part == number)
        foreign = ~grown[nearest[box]]
        values = np.where(foreign, np.maximum(np.abs(distance[box]), spacing), distance[box])
        corner = origin + spacing * np.array([side.start for side in box])
        out.append(DistanceGrid(corner, spacing, values.astype(np.float32), name, bone))
    return tuple(out)


def _unsigned(triangles: F64, origin: F64, spacing: float, wanted: NDArray[np.bool_]) -> tuple[F64, NDArray[np.int64]]:
    """Distance [m] from the wanted nodes of a lattice, and those beside the skin, to triangles (f, 3, 3), infinite at
    others, and the nearest triangle, both of the lattice's shape."""
    shape = np.array(wanted.shape)
    distance, nearest = np.full(wanted.size, np.inf), np.zeros(wanted.size, np.int64)
    low = np.floor((triangles.min(axis=1) - origin) / spacing - 1).astype(np.int64).clip(0)
    high = (np.ceil((triangles.max(axis=1) - origin) / spacing + 1).astype(np.int64) + 1).clip(max=shape)
    size = high - low
    step = np.array([shape[1] * shape[2], shape[2], 1])
    for begin in range(0, len(triangles), 2048):
        mine = slice(begin, begin + 2048)
        count = size[mine].prod(axis=1)
        whose = np.repeat(np.arange(begin, begin + len(count)), count)
        k = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        side = size[whose]
        place = low[whose] + np.stack([k // (side[:, 1] * side[:, 2]), k // side[:, 2] % side[:, 1], k % side[:, 2]], 1)
        node = place @ step
        far = triangle_distance(origin + spacing * place, triangles[whose])
        np.minimum.at(distance, node, far)
        best = np.flatnonzero(far == distance[node])[::-1]
        nearest[node[best]] = whose[best]
    exact = (distance <= spacing).reshape(wanted.shape)
    found = np.stack(distance_transform_edt(~exact, return_distances=False, return_indices=True), axis=-1) @ step  # pyright: ignore[reportCallIssue, reportArgumentType]
    distance[~exact.ravel()] = np.inf
    rest = np.flatnonzero(wanted & ~exact)
    told = nearest[found.ravel()]
    for offset in (0, *step, *-step):  # what the node beside it was told may be nearer
        for some in np.array_split(rest, 1 + len(rest) // 100_000):
            if offset:
                some = some[distance[some] < 3 * spacing]
            asked = told[(some + offset) % wanted.size]
            places = origin + spacing * np.stack(np.unravel_index(some, wanted.shape), axis=1)
            far = triangle_distance(places, triangles[asked])
            nearer = far < distance[some]
            distance[some[nearer]], nearest[some[nearer]] = far[nearer], asked[nearer]
    return distance.reshape(wanted.shape), nearest.reshape(wanted.shape)


def _signs(
    vertices: F64, faces: NDArray[np.int64], origin: F64, spacing: float, distance: F64, nearest: NDArray[np.int64]
) -> F64:
    """−1 inside, 1 outside. Neighbours that are both further from the surface than half a spacing are on one side."""
    groups: NDArray[np.int32]
    groups, count = label(distance > 0.6 * spacing)  # pyright: ignore[reportGeneralTypeIssues, reportAssignmentType]
    found, asked = np.unique(groups, return_index=True)
    asked = asked[found > 0]
    sides = np.ones(count + 1)
    places = origin + spacing * np.stack(np.unravel_index(asked, distance.shape), axis=1)
    sides[groups.ravel()[asked]] = np.where(_inside(vertices[faces], places), -1.0, 1.0)
    out = sides[groups]
    near = groups == 0
    out[near] = _sides(vertices, faces, origin + spacing * np.argwhere(near), nearest[near])
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
    n = np.where(on.all(axis=1, keepdims=True), normal[nearest], 0.0)
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
