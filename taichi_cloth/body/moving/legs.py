"""Legs that reach: hip and knee turned so that the feet stay where they stood at rest while the pelvis moves."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.skin.skeleton import JOINTS, Pose, Skeleton

__all__ = ["TOES", "planted_legs", "sole_height", "toes_lifted"]

F64 = NDArray[np.float64]

TOES = ((0.93, 0.0), (1.13, 0.012), (1.16, 0.025), (1.18, 0.032))
"""Of the foot's lower outline before its ball: way ahead of the ankle, and height, in lengths of the foot's bone seen
from above. Bones have no toes, which reach beyond their ends; those of the built-in body."""
SUPPORT = ((-0.38, 0.0), (0.85, 0.0))
"""Likewise, of heel and ball."""
MOST_LIFT = np.radians(45)
"""By which a foot is turned at most."""


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


def toes_lifted(skeleton: Skeleton, pose: Pose, foot: str) -> float:
    """By how much a foot has to be turned toes up, about its ankle, so that none of it before its ball is under the
    floor [rad]. A shoe that bends would leave the toes where they are; a foot of one bone tips over them."""
    j = JOINTS.index(foot)
    moved = skeleton.transforms(pose)
    shin = moved[skeleton.parents[j], :3, :3]
    ankle = skeleton.joints[j]
    ahead = (skeleton.tips[j] - ankle) * [1, 0, 1]
    long = float(np.linalg.norm(ahead))
    points = np.array([ahead * s + [0.0, y * long - ankle[1], 0.0] for s, y in TOES])
    height = float((moved[j, :3, :3] @ ankle + moved[j, :3, 3])[1])
    lift = np.linspace(0.0, MOST_LIFT, 91)
    own = Rotation.from_rotvec(pose.rotations[j]) * Rotation.from_rotvec(np.outer(-lift, [1.0, 0, 0]))
    low = height + np.einsum("b,nbc,pc->np", shin[1], own.as_matrix(), points).min(axis=1)
    if low[0] >= 0:
        return 0.0
    above = np.nonzero(low >= 0)[0]
    return float(lift[above[0]] if len(above) else lift[int(low.argmax())])


def sole_height(skeleton: Skeleton, pose: Pose, *, toes: bool = True) -> float:
    """Height of the lowest of the heels, balls and toes in a pose [m]. toes: whether those count."""
    moved = skeleton.transforms(pose)
    low = []
    for foot in ("foot_l", "foot_r"):
        j = JOINTS.index(foot)
        ankle, end = skeleton.joints[j], skeleton.tips[j]
        ahead = (end - ankle) * [1, 0, 1]
        long = float(np.linalg.norm(ahead))
        for share, over in (*SUPPORT, *(TOES if toes else ())):
            sole = ankle * [1, 0, 1] + share * ahead + [0.0, over * long, 0.0]
            low.append((moved[j, :3, :3] @ sole + moved[j, :3, 3])[1])
    return float(min(low))
