"""Points on, outside and inside a skin, that a fit is judged by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from taichi_cloth.body.skin.triangles import triangle_distance

__all__ = ["SkinSpace", "mesh_distance", "mirror_plane", "skin_samples", "skin_space"]

F64 = NDArray[np.float64]
OFFSETS = (0.008, 0.25)
"""How far from the skin points outside are put along its normal [m], evenly in the logarithm."""
DEPTHS = (0.008, 0.06)
"""And inside."""
ROOM = 0.2
"""Points outside also fill the box round the body, and this much more on every side [m]."""
CLEAR = 0.004
"""Points nearer to the skin than this [m] say nothing that the skin's own do not."""
POCKET = 0.02
"""Skin that faces other skin nearer than about this [m] is not fitted: inside a mouth, between fingers."""
VOTES = 8
"""Nearest samples whose normals say which side of the skin a point is on; all of them must agree."""


def skin_samples(vertices: NDArray, faces: NDArray, count: int, *, seed: int = 0) -> tuple[F64, NDArray[np.int64]]:
    """Points spread over a mesh by area (count, 3), stratified, by Philox, and the face of each (count,)."""
    corner = np.asarray(vertices, np.float64)[np.asarray(faces)]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    chance = np.random.Generator(np.random.Philox(key=seed)).random((count, 3))
    total = np.cumsum(area)
    face = np.searchsorted(total, (np.arange(count) + chance[:, 0]) / count * total[-1]).clip(0, len(area) - 1)
    u, v = np.sqrt(chance[:, 1]), chance[:, 2]
    share = np.stack([1 - u, u * (1 - v), u * v], axis=-1)
    return (corner[face] * share[..., None]).sum(axis=1), face


@dataclass(frozen=True, eq=False)
class SkinSpace:
    """Points, and what the signed distance of a good union is there. The skin's own come first."""

    at: F64
    """World [m], shape (n, 3)."""
    target: F64
    """Signed distance wanted [m], shape (n,): 0 on the skin and inside, that of the skin outside."""
    side: NDArray[np.int64]
    """0: the distance is to be the target; −1: no less; +1: no more. Shape (n,)."""
    owner: NDArray[np.int64]
    """The skin's point nearest to each, shape (n,)."""
    face: NDArray[np.int64]
    """The face that each of the skin's points is on, shape (skin points,)."""

    def error(self, distance: F64) -> F64:
        """How far distances (n,) are from what is wanted [m], with sign."""
        error = distance - self.target
        return np.where(self.side < 0, np.minimum(error, 0), np.where(self.side > 0, np.maximum(error, 0), error))

    def part(self, mine: NDArray[np.int64]) -> "SkinSpace":
        """Only the skin's points `mine`, and what is nearest to them."""
        kept = np.flatnonzero(np.isin(self.owner, mine))
        number = np.full(len(self.face), -1)
        number[mine] = np.arange(len(mine))
        owner = number[self.owner[kept]]
        return SkinSpace(self.at[kept], self.target[kept], self.side[kept], owner, self.face[mine])


def mirror_plane(
    vertices: NDArray, faces: NDArray, labels: NDArray, names: Sequence[str], *, closely: float = 0.006
) -> tuple[F64, float] | None:
    """The plane, (unit normal, level), that a body is its own image in; None where 95 % of the skin is not within
    `closely` [m] of its image, or where no parts are left and right."""
    points, _ = skin_samples(vertices, faces, 6000, seed=7)
    corner, labels = np.asarray(vertices, np.float64)[np.asarray(faces)], np.asarray(labels)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)

    def middle(name: str) -> F64:
        mine = labels == list(names).index(name)
        return np.average(corner[mine].mean(axis=1), axis=0, weights=area[mine])

    present = {names[k] for k in np.unique(labels[area > 0])}
    middles = []
    for name in sorted(present):  # pyright: ignore[reportArgumentType]
        twin = "right" + name.removeprefix("left")
        if name.startswith("left ") and twin in present:
            middles.append((middle(name), middle(twin)))
    if not middles:
        return None
    across = np.sum([a - b for a, b in middles], axis=0)
    across /= max(float(np.linalg.norm(across)), 1e-300)
    level = float(np.mean([(a + b) @ across / 2 for a, b in middles]))
    image = points - 2 * (points @ across - level)[:, None] * across
    away = mesh_distance(image, vertices, faces)
    return (across, level) if np.quantile(away, 0.95) < closely else None


def _one_side_and_image(points: F64, mirror: tuple[F64, float]) -> F64:
    across, level = mirror
    half = points[points @ across > level]
    return np.concatenate([half, half - 2 * (half @ across - level)[:, None] * across])


def skin_space(
    vertices: NDArray,
    faces: NDArray,
    skin: int,
    outside: int,
    inside: int,
    *,
    mirror: tuple[F64, float] | None = None,
    seed: int = 0,
) -> SkinSpace:
    """About so many points on the skin, outside and inside it, by Philox.

    mirror: the unit normal n and level c of a plane n·x = c that the skin is its own image in: so are the points.
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    on, face = skin_samples(vertices, faces, skin, seed=seed)
    dense, dense_face = skin_samples(vertices, faces, 40_000, seed=seed + 2)
    tree = KDTree(dense)
    if mirror is not None:
        across, level = mirror
        on, face = on[on @ across > level][: skin // 2], face[on @ across > level][: skin // 2]
        other = on - 2 * (on @ across - level)[:, None] * across
        on, face = np.concatenate([on, other]), np.concatenate([face, dense_face[tree.query(other)[1]]])
        skin = len(on)
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    chance = np.random.Generator(np.random.Philox(key=[seed, 1]))
    open_ = mesh_distance(on + POCKET * normal[face], vertices, faces) > 0.4 * POCKET
    on, face, skin = on[open_], face[open_], int(open_.sum())

    def along(count: int, ends: tuple[float, float], sign: float) -> F64:
        spread, where = skin_samples(vertices, faces, count, seed=seed + 1)
        far = np.exp(np.log(ends[0]) + chance.random((count, 1)) * np.log(ends[1] / ends[0]))
        return spread + sign * far * normal[where]

    low, high = vertices.min(axis=0) - ROOM, vertices.max(axis=0) + ROOM
    box = low + chance.random((outside - outside // 2, 3)) * (high - low)
    out = np.concatenate([along(outside // 2, OFFSETS, 1.0), box])
    deep = along(inside, DEPTHS, -1.0)
    if mirror is not None:
        out, deep = _one_side_and_image(out, mirror), _one_side_and_image(deep, mirror)
    out_size, deep_size = mesh_distance(out, vertices, faces), mesh_distance(deep, vertices, faces)

    def sure(points: F64, size: F64, sign: float) -> NDArray[np.bool_]:
        _, near = tree.query(points, k=VOTES)
        facing = ((points[:, None] - dense[near]) * normal[dense_face[near]]).sum(axis=-1) * sign
        return (facing > 0).all(axis=1) & (size > CLEAR)

    out_kept, deep_kept = sure(out, out_size, 1.0), sure(deep, deep_size, -1.0)
    at = np.concatenate([on, out[out_kept], deep[deep_kept]])
    target = np.concatenate([np.zeros(skin), out_size[out_kept], np.zeros(int(deep_kept.sum()))])
    side = np.repeat([0, -1, 1], [skin, int(out_kept.sum()), int(deep_kept.sum())])
    owner = np.asarray(KDTree(on).query(at)[1])
    owner[:skin] = np.arange(skin)
    return SkinSpace(at, target, side, owner, face)


def mesh_distance(points: F64, vertices: NDArray, faces: NDArray) -> F64:
    """Distance (n,) [m] from points (n, 3) to a mesh: exact to the triangles that hold the nearest of many samples."""
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    corner = vertices[faces]
    spread, face = skin_samples(vertices, faces, max(40_000, 2 * len(faces)), seed=3)
    tree = KDTree(np.concatenate([spread, corner.mean(axis=1)]))
    owner = np.concatenate([face, np.arange(len(faces))])
    near = np.asarray(tree.query(points, k=8)[1])
    best = np.full(len(points), np.inf)
    for k in range(near.shape[1]):
        best = np.minimum(best, triangle_distance(points, corner[owner[near[:, k]]]))
    return best
