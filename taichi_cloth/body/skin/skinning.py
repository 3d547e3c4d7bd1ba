"""A body: skin, skeleton, and the weights that bind them (linear blend skinning).

Weights by bone heat: Baran and Popović, "Automatic rigging and animation of 3D characters", SIGGRAPH 2007, eq. 1:
(A⁻¹L + H) w = H p, with L the cotangent Laplacian, p 1 where the bone is the nearest, and H = c / d². Departure:
a bone has a thickness, taken off the distance, so that the side of the chest does not hang on the arm.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from taichi_cloth.body.skin.laplacian import cotangent_laplacian
from taichi_cloth.body.skin.skeleton import Pose, Skeleton
from taichi_cloth.ground.errors import InputError

__all__ = ["Body", "bone_distances", "heat_weights"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """n vertices and m triangles with a skeleton. Constant once built. Raises InputError for wrong shapes."""

    name: str
    vertices: F64
    """World at rest [m], y up, facing +z, feet on y = 0, shape (n, 3)."""
    faces: I32
    """Vertex numbers, counter-clockwise seen from outside, shape (m, 3)."""
    skeleton: Skeleton
    weights: F64
    """Share of each bone in each vertex, rows summing to 1, shape (n, joints)."""
    measures: Mapping[str, float] = field(default_factory=dict)
    """Lengths and girths [m] by name."""
    notes: tuple[str, ...] = ()
    """What was done to the mesh to make it a body, one line each."""

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, np.float64)
        faces = np.ascontiguousarray(self.faces, np.int32)
        weights = np.ascontiguousarray(self.weights, np.float64)
        joints = len(self.skeleton.names)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise InputError(f"body: vertices {vertices.shape}, faces {faces.shape}; allowed: (n, 3) and (m, 3)")
        if weights.shape != (len(vertices), joints):
            raise InputError(f"body.weights: shape {weights.shape}; allowed: ({len(vertices)}, {joints})")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "weights", weights)

    @property
    def stature(self) -> float:
        """Height at rest [m]."""
        return float(np.ptp(self.vertices[:, 1]))

    def bone_transforms(self, pose: Pose) -> F64:
        """Rigid motion of each bone from rest to the pose, shape (joints, 4, 4)."""
        return self.skeleton.transforms(pose)

    def posed(self, pose: Pose) -> F64:
        """Skin in a pose [m], shape (n, 3): v' = Σ_j w_j (R_j v + t_j)."""
        moved = self.bone_transforms(pose)[:, :3].reshape(len(self.skeleton.names), 12)
        blend = (self.weights @ moved).reshape(-1, 3, 4)
        return np.einsum("nij,nj->ni", blend[:, :, :3], self.vertices) + blend[:, :, 3]


def bone_distances(points: F64, starts: F64, ends: F64, radii: F64) -> F64:
    """From each point to each round bone [m], (n, bones): to the segment less the radius, at least a tenth of it."""
    axis = ends - starts
    along = np.einsum("nbk,bk->nb", points[:, None] - starts, axis) / np.maximum((axis**2).sum(1), 1e-12)
    nearest = starts + np.clip(along, 0, 1)[..., None] * axis
    far = np.linalg.norm(points[:, None] - nearest, axis=-1)
    return np.maximum(far - radii, 0.1 * far)


def heat_weights(vertices: F64, faces: I32, skeleton: Skeleton, *, sharpness: float = 1.0) -> F64:
    """Skin weights (n, joints). sharpness: c above; more makes the bends narrower."""
    starts, ends, radii, owner = _thick_bones(skeleton, float(np.ptp(vertices[:, 1])))
    near = bone_distances(vertices, starts, ends, radii)
    closest = near.argmin(1)
    nearest = np.zeros((len(vertices), len(skeleton.names)))
    nearest[np.arange(len(vertices)), owner[closest]] = 1
    far = near[np.arange(len(vertices)), closest] + 0.02
    # Slivers and obtuse corners of foreign meshes would turn weights negative.
    laplacian, mass = cotangent_laplacian(vertices, faces, least=1e-4, most=1e3)
    heat = sharpness * np.maximum(mass, 1e-12) / far**2
    weights = splu(sparse.csc_matrix(laplacian + sparse.diags(heat))).solve(heat[:, None] * nearest)
    weights = np.maximum(weights, 0)
    return weights / weights.sum(1, keepdims=True)


def _thick_bones(skeleton: Skeleton, stature: float) -> tuple[F64, F64, F64, NDArray[np.int64]]:
    """Segments with a radius that stand for the bones: the trunk wide, the limbs from joint to joint."""
    at, tips, index = skeleton.joints, skeleton.tips, skeleton.index
    rows: list[tuple[F64, F64, float, int]] = []
    wide = {"pelvis": 0.050, "spine1": 0.040, "spine2": 0.045, "spine3": 0.048}
    for name in skeleton.names:
        j = index(name)
        if name in wide:
            reach = wide[name] * stature
            for side in (-1, 1):
                shift = np.array([side * reach, 0, 0])
                low = at[j] if name != "pelvis" else at[j] - [0, 0.01 * stature, 0]
                rows.append((low + shift, tips[j] + shift * (0.8 if name == "spine3" else 1), 0.045 * stature, j))
            if name == "pelvis":
                rows.append((at[j], at[j] - [0, 0.045 * stature, 0], 0.04 * stature, j))
        else:
            thick = {"thigh": 0.040, "shin": 0.026, "foot": 0.02, "upper_arm": 0.022, "head": 0.05}
            if name.startswith("foot"):
                heel = at[j] * [1, 0, 1] - 0.4 * (tips[j] - at[j]) * [1, 0, 1] + [0, 0.015 * stature, 0]
                rows.append((at[j] - [0, 0.012 * stature, 0], heel, 0.02 * stature, j))
            radius = next((r for k, r in thick.items() if name.startswith(k)), 0.018)
            rows.append((at[j], tips[j], radius * stature, j))
    starts, ends = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    return starts, ends, np.array([r[2] for r in rows]), np.array([r[3] for r in rows])
