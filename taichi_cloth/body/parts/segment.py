"""A body's mesh in parts (paper 4.1): a label for every face, and a name for every label."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.parts.clusters import grow, k_means, rand_index
from taichi_cloth.body.parts.curvature import curvedness
from taichi_cloth.body.parts.parts import PARTS, cut
from taichi_cloth.body.skin.laplacian import Surface
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["PARTS", "SegmentMethod", "Segmentation", "rand_index", "segment"]

SegmentMethod = Literal["named", "spectral", "curvedness"]
EIGENFUNCTIONS = 6


@dataclass(frozen=True, eq=False)
class Segmentation:
    """What `segment` found."""

    labels: NDArray[np.int32]
    """The part of each face, shape (f,), 0 and up."""
    names: tuple[str, ...]
    """Of the labels. Of "named" they are PARTS; of the others, the named part that most of a cluster is."""


def segment(
    vertices: NDArray, faces: NDArray, *, method: SegmentMethod = "named", parts: int = 12, seed: int = 0
) -> Segmentation:
    """Divide a person's mesh, vertices (v, 3) [m], faces (f, 3), in any pose and place, connected.

    method: "named": cut where limbs are narrowest and at joints, the seventeen PARTS, left and right told apart.
    "spectral": k-means of `parts` clusters on Laplacian eigenfunctions, which agrees best with how people divide.
    "curvedness": the paper's: regions grown on curvedness, then k-means on their middles.
    Raises InputError for an unknown method, a broken mesh, or, for names, what is no whole person.
    """
    known = get_args(SegmentMethod)
    if method not in known:
        raise InputError(f"method: {method!r}; known: {', '.join(known)}{did_you_mean(str(method), known)}")
    surface = Surface(vertices, faces)
    if method == "named":
        return Segmentation(cut(surface), PARTS)
    if not 2 <= parts <= len(surface.faces):
        raise InputError(f"parts: {parts}; allowed: 2 to the number of faces")
    cluster = _spectral(surface, parts, seed) if method == "spectral" else _curved(surface, parts, seed)
    cluster = np.unique(cluster, return_inverse=True)[1].astype(np.int32)
    return Segmentation(cluster, _names(surface, cluster))


def _spectral(surface: Surface, parts: int, seed: int) -> NDArray[np.int64]:
    cluster = k_means(surface.coordinates(EIGENFUNCTIONS), surface.vertex_areas, parts, seed=seed)
    return _most(surface, cluster)


def _curved(surface: Surface, parts: int, seed: int) -> NDArray[np.int64]:
    region = grow(surface, curvedness(surface))
    area = np.bincount(region, surface.vertex_areas)
    moment = [np.bincount(region, surface.vertex_areas * x) for x in surface.vertices.T]
    middle = np.stack(moment, axis=-1) / area[:, None]
    cluster = k_means(middle, area, min(parts, len(middle)), seed=seed)[region]  # pyright: ignore[reportArgumentType]
    return _most(surface, cluster)


def _most(surface: Surface, cluster: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of each face what two of its corners are, or its first."""
    a, b, c = cluster[surface.faces].T
    return np.where(b == c, b, a)


def _names(surface: Surface, cluster: NDArray[np.int32]) -> tuple[str, ...]:
    """The part that most of each cluster is; a number behind it where several are the same."""
    named = cut(surface)
    count = int(cluster.max()) + 1
    shared = np.bincount(cluster * len(PARTS) + named, surface.areas, count * len(PARTS)).reshape(count, len(PARTS))
    mine = [PARTS[k] for k in shared.argmax(axis=1)]
    return tuple(
        name if mine.count(name) == 1 else f"{name} {mine[: k + 1].count(name)}" for k, name in enumerate(mine)
    )
