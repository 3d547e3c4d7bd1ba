"""The skin under cloth, for pictures: let in where it would show through what it wears."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

__all__ = ["beneath"]

F32 = NDArray[np.float32]

ROOM = 0.004  # between skin and cloth [m]
REACH = 0.03  # as far as skin is looked for cloth, and let in at most [m]
NEAREST = 4


def beneath(
    skin: NDArray, faces: NDArray, cloth: NDArray, *, bone: NDArray | None = None, spared: NDArray | None = None
) -> F32:
    """Skin (n, 3) [m], let in along its own normal so that it stays ROOM below the cloth points (m, 3) near it.

    Contact knows the body by its primitives, which are some millimetres off the skin; what it lets the cloth rest on
    may lie under the skin that is drawn. Up is, for a cloth point, along the normal of the skin nearest to it: what is
    lower than ROOM below it, as the other side of a finger, stays where it is. faces: of the skin. bone: (n,) that
    carries each skin point most. spared: (m,) for each cloth point bits 1 << bone of the bones that it does not meet:
    an arm that swings through the side of a dress stays whole, and hides it. None: cloth meets all.
    """
    corner = skin[faces]
    square = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(skin)
    for axis in range(3):
        for k in range(3):
            normal[:, axis] += np.bincount(faces[:, k], square[:, axis], len(skin))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    low, high = cloth.min(axis=0) - REACH, cloth.max(axis=0) + REACH
    near = np.flatnonzero(((skin > low) & (skin < high)).all(axis=1))
    distance, index = KDTree(cloth).query(skin[near], NEAREST, distance_upper_bound=REACH)
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    way = cloth[index] - skin[near][:, None]
    above = np.einsum("nkc,nc->nk", way, normal[near])
    off = np.linalg.norm(way - above[..., None] * normal[near][:, None], axis=2)
    used, again = np.unique(index, return_inverse=True)
    up = normal[KDTree(skin).query(cloth[used])[1]][again.reshape(index.shape)]
    lower = np.einsum("nkc,nkc->nk", way, up)
    counts = found & (off < 0.6 * REACH) & (lower < ROOM) & (np.einsum("nkc,nc->nk", up, normal[near]) > 0)
    if bone is not None and spared is not None:
        counts &= (spared[index] >> bone[near][:, None]) & 1 == 0
    need = np.where(counts, ROOM - above, 0.0).max(axis=1, initial=0.0)
    out = np.asarray(skin, np.float64).copy()
    out[near] -= np.clip(need, 0.0, REACH)[:, None] * normal[near]
    return out.astype(np.float32)
