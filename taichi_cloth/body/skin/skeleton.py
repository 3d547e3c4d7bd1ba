"""The skeleton every body carries: twenty joints, their rest places, and a pose of them.

Axes of a body: x to its left, y up, z forward; the feet stand on y = 0. At rest no joint is turned, so that a
joint's rotation is stated in the axes of the body, whatever way its bone points.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["JOINTS", "PARENTS", "Pose", "Skeleton"]

F64 = NDArray[np.float64]

PARENTS = (-1, 0, 1, 2, 3, 4, 3, 6, 7, 8, 3, 10, 11, 12, 0, 14, 15, 0, 17, 18)
"""Number of each joint's parent; −1 for the pelvis."""


@dataclass(frozen=True, eq=False)
class Pose:
    """How far each joint is turned from rest, and where the pelvis has gone."""

    rotations: F64
    """Rotation vector of each joint against its parent, in the body's rest axes [rad], shape (20, 3)."""
    translation: F64
    """Way of the pelvis from its rest place [m], shape (3,)."""

    @staticmethod
    def rest() -> "Pose":
        return Pose(np.zeros((len(JOINTS), 3)), np.zeros(3))

    @staticmethod
    def of(turns: Mapping[str, ArrayLike], translation: ArrayLike = (0.0, 0.0, 0.0)) -> "Pose":
        """From rotation vectors [rad] by joint name; joints not named stay at rest. Raises InputError."""
        rotations = np.zeros((len(JOINTS), 3))
        for name, turn in turns.items():
            if name not in JOINTS:
                raise InputError(
                    f"pose: unknown joint {name!r}; known: {', '.join(JOINTS)}{did_you_mean(name, JOINTS)}"
                )
            rotations[JOINTS.index(name)] = turn
        return Pose(rotations, np.asarray(translation, np.float64))

    def blended(self, other: "Pose", share: float) -> "Pose":
        """This pose with `share` of the other: each joint the short way round, translations in a straight line."""
        mine, his = Rotation.from_rotvec(self.rotations), Rotation.from_rotvec(other.rotations)
        way = (mine.inv() * his).as_rotvec() * share
        turned = (mine * Rotation.from_rotvec(way)).as_rotvec()
        return Pose(turned, (1 - share) * self.translation + share * other.translation)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Rest places of the twenty joints and of the ends of the bones. Raises InputError for wrong shapes."""

    joints: F64
    """World at rest [m], shape (20, 3)."""
    tips: F64
    """Far end of each bone at rest [m], shape (20, 3)."""
    names: tuple[str, ...] = JOINTS
    parents: tuple[int, ...] = PARENTS

    def __post_init__(self) -> None:
        for name in ("joints", "tips"):
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != (len(self.names), 3) or not np.isfinite(value).all():
                raise InputError(f"skeleton.{name}: shape {value.shape}; allowed: ({len(self.names)}, 3), finite")
            object.__setattr__(self, name, value)

    def index(self, joint: str) -> int:
        """Number of a joint. Raises InputError for an unknown name."""
        if joint not in self.names:
            raise InputError(
                f"joint: unknown {joint!r}; known: {', '.join(self.names)}{did_you_mean(joint, self.names)}"
            )
        return self.names.index(joint)

    def transforms(self, pose: Pose) -> F64:
        """Rigid motion of each bone from rest to the pose, shape (joints, 4, 4), in the world [m]."""
        local = Rotation.from_rotvec(pose.rotations).as_matrix()
        turned, place = np.empty((len(self.joints), 3, 3)), np.empty((len(self.joints), 3))
        for j, parent in enumerate(self.parents):
            if parent < 0:
                turned[j], place[j] = local[j], self.joints[j] + pose.translation
            else:
                turned[j] = turned[parent] @ local[j]
                place[j] = place[parent] + turned[parent] @ (self.joints[j] - self.joints[parent])
        moved = np.tile(np.eye(4), (len(self.joints), 1, 1))
        moved[:, :3, :3] = turned
        moved[:, :3, 3] = place - np.einsum("jab,jb->ja", turned, self.joints)
        return moved
