"""The section of a scene's body."""

from typing import Literal

from pydantic import Field

from taichi_cloth.body.build import built_in_body
from taichi_cloth.body.skinning import Body

from .section import Section


class BodySection(Section):
    source: str = Field(default="built-in")
    gender: Literal["female", "male"] = "female"
    motion: str = "rest"


def body_of(section: BodySection | None) -> Body:
    return built_in_body(gender=(section or BodySection()).gender)
