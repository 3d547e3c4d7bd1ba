"""How fibres follow key points, as a scene says it."""

from typing import Literal

__all__ = ["FollowRule"]

FollowRule = Literal["smooth", "linear", "paper"]
