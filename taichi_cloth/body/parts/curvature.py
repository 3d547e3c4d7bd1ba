"""How curved a mesh is at its vertices.

The shape operator of each face from the normals of its corners, averaged by area at the vertices: Rusinkiewicz,
"Estimating curvatures and their derivatives on triangle meshes", 3DPVT 2004.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.skin.laplacian import Surface

__all__ = ["curvedness", "principal_curvatures"]

F64 = NDArray[np.float64]


def principal_curvatures(surface: Surface, *, smoothing: int = 2) -> tuple[F64, F64]:
    """The larger and the smaller principal curvature at each vertex [1/m], shape (v,); positive on a ball.

    smoothing: times the operator is averaged over the neighbours.
    """
    v, f, normal = surface.vertices, surface.faces, surface.vertex_normals
    e1 = v[f[:, 1]] - v[f[:, 0]]
    e1 /= np.maximum(np.linalg.norm(e1, axis=1, keepdims=True), 1e-300)
    e2 = np.cross(surface.face_normals, e1)
    rows, right = [], []
    for k in range(
        3
    ):  # S edge = change of the normal along it, two equations an edge for (a, b, c) of [[a, b], [b, c]]
        edge, turn = v[f[:, (k + 1) % 3]] - v[f[:, k]], normal[f[:, (k + 1) % 3]] - normal[f[:, k]]
        x, y = (edge * e1).sum(axis=1), (edge * e2).sum(axis=1)
        zero = np.zeros_like(x)
        rows += [np.stack([x, y, zero], -1), np.stack([zero, x, y], -1)]
        right += [(turn * e1).sum(axis=1), (turn * e2).sum(axis=1)]
    matrix, rhs = np.stack(rows, 1), np.stack(right, 1)
    square = matrix.transpose(0, 2, 1) @ matrix
    square += 1e-12 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-300 * np.eye(3)
    a, b, c = np.linalg.solve(square, (matrix.transpose(0, 2, 1) @ rhs[..., None]))[..., 0].T
    operator = (
        a[:, None, None] * e1[:, :, None] * e1[:, None]
        + b[:, None, None] * (e1[:, :, None] * e2[:, None] + e2[:, :, None] * e1[:, None])
        + c[:, None, None] * e2[:, :, None] * e2[:, None]
    ) * surface.areas[:, None, None]
    flat = np.repeat(operator.reshape(-1, 9), 3, axis=0)
    total = np.stack([np.bincount(f.ravel(), t, len(v)) for t in flat.T], axis=-1)
    area = 3 * surface.vertex_areas
    for _ in range(smoothing):
        total, area = total + surface.adjacency @ total, area + surface.adjacency @ area
    operator = (total / np.maximum(area, 1e-300)[:, None]).reshape(-1, 3, 3)
    t1 = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    t1 /= np.maximum(np.linalg.norm(t1, axis=1, keepdims=True), 1e-300)
    t2 = np.cross(normal, t1)
    a, b, c = (np.einsum("vi,vij,vj->v", p, operator, q) for p, q in ((t1, t1), (t1, t2), (t2, t2)))
    mean, spread = (a + c) / 2, np.hypot((a - c) / 2, b)
    return mean + spread, mean - spread


def curvedness(surface: Surface, *, smoothing: int = 2) -> F64:
    """C = √((κ1² + κ2²) / 2) at each vertex [1/m], shape (v,): Koenderink and van Doorn 1992; paper, reference 24."""
    k1, k2 = principal_curvatures(surface, smoothing=smoothing)
    return np.sqrt((k1**2 + k2**2) / 2)
