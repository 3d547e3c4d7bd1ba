"""Legs that reach: hip and knee turned so that the feet stay where they stood at rest while the pelvis moves."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.skin.skeleton import JOINTS, Pose, Skeleton

__all__ = ["planted_legs", "sole_height"]

F64 = NDArray[np.float64]


def planted_legs(skeleton: Skeleton, turns: Mapping[str, ArrayLike], shift: ArrayLike) -> Pose:
    """The pose with pelvis, trunk and arms as given, and both feet flat at their rest places.

    Two bones in the plane of hip, ankle and the way forward (law of cosines); a leg too short is stretched straight.
    """
    pose = Pose.of(turns, shift)
    pelvis = Rotation.from_rotvec(pose.rotations[0])
    rotations = pose.rotations.copy()
    for side in ("l", "r"):
        thigh, shin, foot = (JOINTS.index(f"{part}_{side}") for part in ("thigh", "shin", "foot"))
        hip0, knee0, ankle0 = skeleton.joints[[thigh, shin, foot]]
        hip = skeleton.joints[0] + pose.translation + pelvis.apply(hip0 - skeleton.joints[0])
        upper, lower = float(np.linalg.norm(knee0 - hip0)), float(np.linalg.norm(ankle0 - knee0))
        way = ankle0 - hip
        reach = float(np.clip(np.linalg.norm(way), abs(upper - lower) + 1e-6, upper + lower - 1e-9))
        way = way / np.linalg.norm(way)
        ahead = np.array([0.0, 0, 1]) - way[2] * way
        ahead /= np.linalg.norm(ahead)
        cosine = np.clip((upper**2 + reach**2 - lower**2) / (2 * upper * reach), -1, 1)
        knee = hip + upper * (cosine * way + np.sqrt(1 - cosine**2) * ahead)
        world_thigh = _aligned(knee0 - hip0, knee - hip)
        world_shin = _aligned(ankle0 - knee0, hip + reach * way - knee)
        rotations[thigh] = (pelvis.inv() * world_thigh).as_rotvec()
        rotations[shin] = (world_thigh.inv() * world_shin).as_rotvec()
        rotations[foot] = world_shin.inv().as_rotvec()
    return Pose(rotations, pose.translation)


def _aligned(before: F64, after: F64) -> Rotation:
    """The turn that takes one bone onto the other and x, as far as it can, onto x: knees stay hinges."""

    def frame(bone: F64) -> F64:
        down = bone / np.linalg.norm(bone)
        side = np.array([1.0, 0, 0]) - down[0] * down
        side /= np.linalg.norm(side)
        return np.stack([side, down, np.cross(side, down)], 1).astype(np.float64)

    return Rotation.from_matrix(frame(after) @ frame(before).T)


def sole_height(skeleton: Skeleton, pose: Pose) -> float:
    """Height of the lowest of the heels and toes in a pose [m]."""
    moved = skeleton.transforms(pose)
    low = []
    for foot in ("foot_l", "foot_r"):
        j = JOINTS.index(foot)
        ankle, toes = skeleton.joints[j], skeleton.tips[j]
        ahead = (toes - ankle) * [1, 0, 1]
        for share in (-0.38, 0.85):
            sole = ankle * [1, 0, 1] + share * ahead
            low.append((moved[j, :3, :3] @ sole + moved[j, :3, 3])[1])
    return float(min(low))
