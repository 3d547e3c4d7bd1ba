"""Words that a scene may say of a body, where nothing else need be loaded to check them."""

from typing import Literal

__all__ = ["JOINTS", "Facing", "Unit", "Up"]

Unit = Literal["m", "dm", "cm", "mm", "inch"]
Up = Literal["y", "z"]
Facing = Literal["forward", "back", "left", "right"]

JOINTS = (
    "pelvis", "spine1", "spine2", "spine3", "neck", "head",
    "clavicle_l", "upper_arm_l", "forearm_l", "hand_l",
    "clavicle_r", "upper_arm_r", "forearm_r", "hand_r",
    "thigh_l", "shin_l", "foot_l",
    "thigh_r", "shin_r", "foot_r",
)  # fmt: skip
"""Names of the joints, parents before children; a bone has the name of the joint it starts at."""
