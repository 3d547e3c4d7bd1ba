"""What a mesh's own Laplacian says of it: coordinates that do not know its pose, and distances along its skin.

Cotangent weights: Pinkall and Polthier, "Computing discrete minimal surfaces and their conjugates", 1993. Distances
by heat: Crane, Weischedel and Wardetzky, "Geodesics in heat", ACM TOG 32(5), 2013. Coordinates: Rustamov,
"Laplace-Beltrami eigenfunctions for deformation invariant shape representation", SGP 2007.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh, splu

from taichi_cloth.ground.errors import InputError

__all__ = ["Surface", "cotangent_laplacian"]

F64 = NDArray[np.float64]
LARGEST_COTANGENT = 1e4
"""A corner sharper than this counts as one of this cotangent: slivers must not drown their neighbours."""
HEAT_REACH = 0.04
"""How far heat spreads, of the root of the mesh's area: wide enough for far ends to feel it, and meshing not to."""


def cotangent_laplacian(
    vertices: F64, faces: NDArray[np.integer], *, least: float = -LARGEST_COTANGENT, most: float = LARGEST_COTANGENT
) -> tuple[csr_matrix, F64]:
    """Positive semi-definite L (n, n), and each vertex's third of the area round it [m²], (n,).

    least, most: half cotangents beyond these count as these.
    """
    n = len(vertices)
    corner = vertices[faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    rows, columns, values = [], [], []
    for k in range(3):
        a, b, c = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        to_b, to_c = vertices[b] - vertices[a], vertices[c] - vertices[a]
        half = np.clip((to_b * to_c).sum(1) / np.maximum(4 * area, 1e-300), least, most)
        rows += [b, c]
        columns += [c, b]
        values += [half, half]
    edges = csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    mass = np.bincount(faces.ravel(), np.repeat(area / 3, 3), minlength=n).astype(np.float64)
    return csr_matrix(diags(np.asarray(edges.sum(1)).ravel()) - edges), mass


class Surface:
    """A connected triangle mesh, vertices (v, 3) [m], faces (f, 3), with what can be asked of it, each worked out once.

    Raises InputError for wrong shapes or indices, numbers that are not finite, no area, or a mesh in several pieces.
    """

    def __init__(self, vertices: NDArray, faces: NDArray) -> None:
        self.vertices = np.ascontiguousarray(vertices, np.float64)
        self.faces = np.ascontiguousarray(faces, np.int64)
        v, f = self.vertices, self.faces
        if v.ndim != 2 or v.shape[1] != 3 or f.ndim != 2 or f.shape[1] != 3 or len(f) == 0:
            raise InputError(f"mesh: vertices {v.shape}, faces {f.shape}; allowed: (v, 3) and (f, 3), some of each")
        if f.min() < 0 or f.max() >= len(v):
            raise InputError(f"mesh.faces: {f.min()} to {f.max()}; allowed: 0 to {len(v) - 1}")
        if not np.isfinite(v).all():
            raise InputError("mesh.vertices: numbers that are not finite; allowed: finite numbers [m]")
        if len(np.unique(f)) < len(v):
            raise InputError("mesh.vertices: some belong to no face; drop them first")
        if not self.areas.sum() > 0:
            raise InputError("mesh: its faces have no area; check the file's scale")
        edges = np.concatenate([f[:, :2], f[:, 1:]])
        count, _ = connected_components(coo_matrix((np.ones(len(edges)), edges.T), (len(v), len(v))), directed=False)
        if count > 1:
            raise InputError(f"mesh: {count} pieces that do not touch; keep the largest, or join them, first")

    @cached_property
    def _cross(self) -> F64:
        a, b, c = self.vertices[self.faces].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> F64:
        """Of the faces [m²], shape (f,)."""
        return np.linalg.norm(self._cross, axis=1) / 2

    @cached_property
    def face_normals(self) -> F64:
        """Unit, shape (f, 3)."""
        return self._cross / np.maximum(2 * self.areas, 1e-300)[:, None]

    @cached_property
    def centres(self) -> F64:
        """Centroids of the faces, shape (f, 3)."""
        return self.vertices[self.faces].mean(axis=1)

    @cached_property
    def vertex_areas(self) -> F64:
        """A third of the faces round each vertex [m²], shape (v,)."""
        return self._laplace[1]

    @cached_property
    def vertex_normals(self) -> F64:
        """Unit, shape (v, 3): the faces' areas over the squares of the two edges at the corner, exact on a ball: Max,
        "Weights for computing vertex normals from facet normals", Journal of Graphics Tools 1999."""
        corner = self.vertices[self.faces]
        edge = np.maximum(
            ((np.roll(corner, -1, axis=1) - corner) ** 2).sum(axis=2), 1e-300
        )  # from corner k to the next
        both = edge * np.roll(edge, 1, axis=1)
        each = (self._cross[:, None] / both[..., None]).reshape(-1, 3)
        total = np.stack([np.bincount(self.faces.ravel(), a, len(self.vertices)) for a in each.T], axis=-1)
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)

    @cached_property
    def adjacency(self) -> Any:
        """Which vertices share an edge: sparse rows, shape (v, v), ones."""
        f, n = self.faces, len(self.vertices)
        i, j = f[:, [0, 1, 2]].ravel(), f[:, [1, 2, 0]].ravel()
        both = coo_matrix((np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), (n, n)).tocsr()
        both.data[:] = 1
        return both

    @cached_property
    def laplacian(self) -> Any:
        """Cotangent Laplacian, positive semi-definite: sparse columns, shape (v, v)."""
        return self._laplace[0].tocsc()

    @cached_property
    def _laplace(self) -> tuple[Any, F64]:
        return cotangent_laplacian(self.vertices, self.faces)

    def coordinates(self, count: int = 6) -> F64:
        """Global point signature: the first `count` eigenfunctions that are not constant, each over the root of its
        eigenvalue, shape (v, count); the same in any pose and, but for their signs, for any meshing and scale."""
        area = self.vertex_areas.sum()
        mass = diags(np.maximum(self.vertex_areas / area, 1e-12)).tocsc()
        start = np.cos(np.arange(len(self.vertices)))  # ARPACK starts from chance otherwise
        values, functions = eigsh(self.laplacian, count + 1, mass, sigma=-1e-3, which="LM", v0=start)
        order = np.argsort(values)[1:]
        functions = functions[:, order] / np.sqrt(values[order])
        sign = np.sign((functions**3 * self.vertex_areas[:, None]).sum(axis=0))
        return functions * np.where(sign == 0, 1, sign)

    @cached_property
    def _heat(self) -> tuple:
        edge = self.vertices[self.faces[:, [0, 1, 2]]] - self.vertices[self.faces[:, [1, 2, 0]]]
        step = max(np.linalg.norm(edge, axis=-1).mean(), HEAT_REACH * np.sqrt(self.areas.sum()))
        mass = diags(self.vertex_areas).tocsc()
        small = 1e-10 * self.laplacian.diagonal().mean()
        hold = diags(np.full(len(self.vertices), small)).tocsc()
        return splu((mass + step**2 * self.laplacian).tocsc()), splu((self.laplacian + hold).tocsc())

    @cached_property
    def _gradients(self) -> F64:
        """Gradient of each corner's hat function, shape (f, 3 corners, 3)."""
        v, f = self.vertices, self.faces
        opposite = v[f[:, [2, 0, 1]]] - v[f[:, [1, 2, 0]]]
        return np.cross(self.face_normals[:, None], opposite) / np.maximum(2 * self.areas, 1e-300)[:, None, None]

    def distance_from(self, source: int | NDArray) -> F64:
        """Distance along the skin from the nearest of the vertices `source` [m], shape (v,)."""
        diffuse, poisson = self._heat
        heat = np.zeros(len(self.vertices))
        heat[source] = 1
        heat = np.log(np.maximum(diffuse.solve(heat), 1e-300))  # the same direction, and no underflow far away
        slope = (self._gradients * heat[self.faces][..., None]).sum(axis=1)
        unit = -slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
        flow = (self._gradients * unit[:, None]).sum(axis=-1) * self.areas[:, None]
        distance = poisson.solve(np.bincount(self.faces.ravel(), flow.ravel(), len(self.vertices)))
        return distance - np.min(distance[source])
