"""Captured motion, mapped onto our skeleton by the turns of its joints.

A file's joint turns from its rest pose by B; ours turns by B C, both in our axes, where C is the least turn of our bone
at rest onto the file's: so that an A pose and a T pose mean the same. Where the pelvis goes is scaled by the length of
the legs, and the lower foot comes down to the floor.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.skin.skeleton import JOINTS, PARENTS, Pose, Skeleton
from taichi_cloth.ground.errors import InputError

__all__ = ["Captured", "child_of", "leg_length"]

F64 = NDArray[np.float64]

FARTHEST = 100.0
"""From where it begins a motion may take a body [m]."""

CHILD = {
    "pelvis": "spine1", "spine1": "spine2", "spine2": "spine3", "spine3": "neck", "neck": "head",
    "clavicle": "upper_arm", "upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot",
}  # fmt: skip
"""The joint at which a bone ends, by names without their side."""


@dataclass(frozen=True, eq=False)
class Captured:
    """What a file says of f frames, in our axes (x to the body's left, y up).

    kind: of file, for errors. turns: of our joints from the file's rest pose (f, 20, 3, 3), in the world; what is not
    in `bones` goes with its parent. bones: directions at rest of the file's bones by our joints' numbers, None where
    theirs lie otherwise in the body than ours, not turned. way: of the pelvis (f, 3), in lengths of the file's leg.
    frame_time [s].
    """

    kind: str
    turns: F64
    bones: dict[int, F64 | None]
    way: F64
    frame_time: float

    def motion(self, name: str, skeleton: Skeleton, *, loop: bool = False, blend_in: float = 1.0) -> Motion:
        """As a motion of our skeleton; at its end it stays, or begins again. Raises InputError."""
        ours = np.empty((len(self.turns), len(JOINTS), 3, 3))
        for j, parent in enumerate(PARENTS):
            if j in self.bones:
                ours[:, j] = self.turns[:, j] @ _least_turn(_bone(skeleton, j), self.bones[j])
            else:
                ours[:, j] = ours[:, parent] if parent >= 0 else np.eye(3)
        rotations = np.empty((len(ours), len(JOINTS), 3))
        for j, parent in enumerate(PARENTS):
            local = ours[:, j] if parent < 0 else np.swapaxes(ours[:, parent], 1, 2) @ ours[:, j]
            rotations[:, j] = Rotation.from_matrix(local).as_rotvec()
        way = (self.way - self.way[0]) * leg_length(skeleton.joints, self.kind)
        far = float(np.linalg.norm(way, axis=1).max())
        if not far <= FARTHEST:
            raise InputError(
                f"{self.kind}: the pelvis goes {far:.3g} m far; allowed: up to {FARTHEST:g} m; mend its positions"
            )
        poses = [Pose(r, w) for r, w in zip(rotations, way, strict=True)]
        feet = [JOINTS.index("foot_l"), JOINTS.index("foot_r")]
        seen = poses[:: max(1, len(poses) // 200)]
        low = min(float(_joint_heights(skeleton, p)[feet].min()) for p in seen)
        lift = np.array([0, skeleton.joints[feet, 1].min() - low, 0])
        poses = [Pose(p.rotations, p.translation + lift) for p in poses]
        last = len(poses) - 1

        def cycle(time: float) -> Pose:
            at = time / self.frame_time
            at = at % max(last, 1) if loop else min(at, last)
            k = min(int(at), max(last - 1, 0))
            return poses[k].blended(poses[min(k + 1, last)], at - k)

        return Motion(name, cycle, last * self.frame_time if loop else None, blend_in)


def leg_length(joints: F64, kind: str) -> float:
    """From hip to ankle [the unit of joints (20, 3)]. Raises InputError where there is none."""
    thigh, shin, foot = (joints[JOINTS.index(n)] for n in ("thigh_l", "shin_l", "foot_l"))
    length = float(np.linalg.norm(shin - thigh) + np.linalg.norm(foot - shin))
    if length <= 1e-6:
        raise InputError(f"{kind}: the legs have no length; give the joints of the file their offsets")
    return length


def _joint_heights(skeleton: Skeleton, pose: Pose) -> F64:
    moved = skeleton.transforms(pose)
    return np.einsum("jab,jb->ja", moved[:, :3, :3], skeleton.joints)[:, 1] + moved[:, 1, 3]


def child_of(j: int) -> int | None:
    """The joint at which a joint's bone ends; None of a head, a hand and a foot."""
    name = JOINTS[j]
    stem, side = (name[:-2], name[-2:]) if name[-2:] in ("_l", "_r") else (name, "")
    return JOINTS.index(CHILD[stem] + side) if stem in CHILD else None


def _bone(skeleton: Skeleton, j: int) -> F64:
    child = child_of(j)
    return (skeleton.tips[j] if child is None else skeleton.joints[child]) - skeleton.joints[j]


def _least_turn(ours: F64, theirs: F64 | None) -> F64:
    """The rotation by the least angle that takes our direction to theirs; none where there is no direction."""
    if theirs is None or np.linalg.norm(theirs) < 1e-9 or np.linalg.norm(ours) < 1e-9:
        return np.eye(3)
    a, b = ours / np.linalg.norm(ours), theirs / np.linalg.norm(theirs)
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return np.eye(3)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, float(a @ b))).as_matrix()
