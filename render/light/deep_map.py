"""What the kernels of a map of light share: the names of its rows, and the numbers of a deep opacity map."""

from typing import TYPE_CHECKING, Any

import taichi as ti

__all__ = ["AWAY", "EMPTY", "ORIGIN", "RIGHT", "SCALE", "UP", "DeepMap", "new_deep_map"]

EMPTY = 1e30
"""First depth [m] of a texel that no light is stopped in."""

# Rows of the argument `axes`, three numbers each.
RIGHT, UP, AWAY = 0, 1, 2  # unit axes of the map; away from the light
ORIGIN = 3  # u, v, depth [m] where the map begins
SCALE = 4  # texels per metre, opacity of all, unused

if TYPE_CHECKING:
    DeepMap = Any
else:
    DeepMap = ti.types.struct(
        width=ti.i32,  # texels in a row of the finest level
        span=ti.f32,  # ((15 + a)^4 - a^4) / D of the layers [1/m], see `transmittance`
        root=ti.f32,  # a
        softness=ti.f32,  # width of the penumbra [texels] per metre behind the blocker
        offset=ti.f32,  # how far out along the normal a particle is looked up [m]
        lag=ti.f32,  # how far towards the light a place is looked up [m]
        beyond=ti.f32,  # and how much farther, to be out of the cloth that it is in [m]
    )
"""Numbers of a map: changing them compiles nothing."""


def new_deep_map(**numbers: float) -> Any:
    """A `DeepMap` with these numbers, the others 0."""
    return DeepMap(**numbers)  # pyright: ignore[reportCallIssue]
