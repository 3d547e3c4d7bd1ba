"""What a kernel knows of the picture it draws: what is compiled into it, and its numbers."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import taichi as ti

from ..data.backdrop import Behind
from ..data.blocks import Layout

__all__ = ["Features", "Picture", "RimShape", "Turn", "new_picture"]

RimShape = Literal["crisp", "soft", "sharp"]
Turn = Literal["only", "more", "last"]


@dataclass(frozen=True)
class Features:
    """What the kernel contains. Taichi compiles one kernel for each combination that is used."""

    layout: Layout
    """As of `Layout.of_splat`."""
    profile: RimShape
    """How a splat's alpha falls to its rim: over one pixel, all the way, or by the edge of `Picture`."""
    turn: Turn = "only"
    """ "only" is a whole picture. "more" goes on with what the planes hold, takes nothing for a tile that is opaque
    already, and writes no image; "last" writes what the planes hold."""
    behind: Behind = "gradient"
    """What stands behind: rows of one colour, a picture, or a mesh, which hides the splats with a centre farther away.
    """


if TYPE_CHECKING:
    Picture = Any
else:
    Picture = ti.types.struct(
        across=ti.i32,  # tiles in a row
        tiles=ti.i32,  # tiles in all
        width=ti.i32,  # [px]
        height=ti.i32,  # [px]
        shares=ti.i32,  # tiles are dealt to so many in turn, so that no thread gets only the busy middle
        opaque=ti.f32,  # a tile is done when less than this share of light passes everywhere in it
        gain=ti.f32,  # light times this is 1 at the end of the table of tones
        focal=ti.f32,  # [px]
        nearest=ti.f32,  # depth of key 0 [m]
        key_depth=ti.f32,  # depth between two keys [m]
        edge=ti.f32,  # of a "sharp" splat
        darkening=ti.f32,  # of the sides of a round thread
        sprite_size=ti.i32,  # width of a sprite [texels]
        sprite_texels=ti.i32,  # of one sprite with all its levels
    )
"""Numbers of one picture: changing them compiles nothing."""


def new_picture(**numbers: float) -> Any:
    """A `Picture` with these numbers, the others 0. It is changed in place: making one takes longer than a call."""
    return Picture(**numbers)  # pyright: ignore[reportCallIssue]
