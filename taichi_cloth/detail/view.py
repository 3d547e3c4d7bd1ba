"""A camera as the kernels of this room take it, and the tiles of its image that a sphere may touch."""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import taichi as ti

from taichi_cloth.ground.particles import TILE

__all__ = ["Pinhole", "View", "in_frustum", "seen_at", "tiles_of", "view_of"]


class Pinhole(Protocol):
    """A camera in OpenCV's convention: world to camera rotation (3, 3) and translation (3,), lens and size [px]."""

    @property
    def rotation(self) -> Any: ...
    @property
    def translation(self) -> Any: ...
    @property
    def focal(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def near(self) -> float: ...


_VIEW: Any = ti.types.struct(
    rotation=ti.types.matrix(3, 3, ti.f32),
    translation=ti.types.vector(3, ti.f32),
    eye=ti.types.vector(3, ti.f32),  # where it stands [m]
    focal=ti.f32,
    cx=ti.f32,
    cy=ti.f32,
    width=ti.f32,
    height=ti.f32,
    near=ti.f32,
)

if TYPE_CHECKING:
    View = Any
else:
    View = _VIEW


def view_of(camera: Pinhole) -> Any:
    """The argument of a kernel."""
    rotation, translation = np.asarray(camera.rotation), np.asarray(camera.translation)
    numbers = {name: float(getattr(camera, name)) for name in ("focal", "cx", "cy", "width", "height", "near")}
    return _VIEW(
        rotation=ti.Matrix(rotation.tolist()),
        translation=ti.Vector(translation.tolist()),
        eye=ti.Vector((-rotation.T @ translation).tolist()),
        **numbers,
    )


@ti.func
def seen_at(view: View, x):
    """A place of the world, in the camera's axes [m]: to the right, down, ahead."""
    return view.rotation @ x + view.translation


@ti.func
def in_frustum(view: View, at, r, slack):
    """Whether a sphere may touch what is seen, or what lies up to `slack` [px] beside it. at: its middle in the
    camera's axes. A side of the frustum has a plane with the normal (focal, edge) in (x, z)."""
    x, y, z = at[0], at[1], at[2]
    f, inside = view.focal, z + r > view.near
    for side in ti.static(range(4)):
        edge, across = view.cx, -x
        if ti.static(side == 1):
            edge, across = view.width - view.cx, x
        if ti.static(side == 2):
            edge, across = view.cy, -y
        if ti.static(side == 3):
            edge, across = view.height - view.cy, y
        edge += slack
        if f * across - edge * z > r * ti.sqrt(f * f + edge * edge):
            inside = False
    return inside


@ti.func
def tiles_of(view: View, at, r, margin):
    """First and last column and row of the tiles that a sphere wholly before the camera may touch, first > last for
    none. at: its middle in the camera's axes. margin: beside it [px].

    A sphere of centre (X, Y, Z) and radius r lies within f r √(1 + (X/Z)²)/(Z − r) of its centre's pixel, likewise
    down.
    """
    u, v = at[0] / at[2], at[1] / at[2]
    grown = view.focal * r / (at[2] - r)
    wide = grown * ti.sqrt(1.0 + u * u) + margin
    high = grown * ti.sqrt(1.0 + v * v) + margin
    cx = u * view.focal + view.cx
    cy = v * view.focal + view.cy
    left = ti.cast(ti.floor(ti.max(cx - wide, 0.0) / TILE), ti.i32)
    top = ti.cast(ti.floor(ti.max(cy - high, 0.0) / TILE), ti.i32)
    right = ti.cast(ti.floor(ti.min(cx + wide, view.width - 1) / TILE), ti.i32)
    bottom = ti.cast(ti.floor(ti.min(cy + high, view.height - 1) / TILE), ti.i32)
    return left, right, top, bottom
