"""What the kernels of a map of light share: the names of its rows, the numbers of a deep opacity map, and how it is
written, by one thread a texel or, on a device, by many."""

from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.copies import zeros
from taichi_cloth.ground.particles import NORMAL, POSITION
from taichi_cloth.ground.vectors import Octets, Vec16, of_group

from ..data.light_sizes import LAYERS

__all__ = [
    "AWAY", "EMPTY", "ORIGIN", "RIGHT", "SCALE", "UP", "DeepMap", "counts_for", "deepen", "laid", "lift", "lower",
    "moved_out", "new_deep_map",
]  # fmt: skip

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
        around=ti.f32,  # and for what is near it in the cloth [m]
    )
"""Numbers of a map: changing them compiles nothing."""


def new_deep_map(**numbers: float) -> Any:
    """A `DeepMap` with these numbers, the others 0."""
    return DeepMap(**numbers)  # pyright: ignore[reportCallIssue]


FIXED = float(1 << 18)
"""Steps of an optical depth where threads of a device add to one texel: whole numbers have one sum in any order."""


@ti.func
def lower(array: Template, at: Template, value):
    """The least of what stands there and a value."""
    if ti.static(runtime.resident()):
        ti.atomic_min(array[at], value)
    else:
        array[at] = ti.min(array[at], value)


@ti.func
def lift(array: Template, at: Template, value):
    """The greatest."""
    if ti.static(runtime.resident()):
        ti.atomic_max(array[at], value)
    else:
        array[at] = ti.max(array[at], value)


@ti.func
def deepen(layers: Template, counts: Template, cell, layer, optical):
    """Adds an optical depth to a layer of a texel: of `layers` (texels, 1), vectors of 16; on a device of `counts`
    (texels, 16), in steps."""
    if ti.static(runtime.resident()):
        ti.atomic_add(counts[cell, layer], ti.cast(optical * FIXED + 0.5, ti.i32))
    else:
        layers[cell, 0][layer] = layers[cell, 0][layer] + optical  # of one thread: `+=` would be atomic


@ti.func
def moved_out(particles: Octets, b, by):
    """Places [m] of the particles at once from b on, moved so far along their normals, and these."""
    nx = of_group(particles, NORMAL, b)
    ny = of_group(particles, NORMAL + 1, b)
    nz = of_group(particles, NORMAL + 2, b)
    px = of_group(particles, POSITION, b) + by * nx
    py = of_group(particles, POSITION + 1, b) + by * ny
    pz = of_group(particles, POSITION + 2, b) + by * nz
    return px, py, pz, nx, ny, nz


@ti.func
def laid(layers: Template, counts: Template, cell):
    """What has been added to the layers of a texel."""
    if ti.static(runtime.resident()):
        return Vec16([counts[cell, k] * (1.0 / FIXED) for k in range(LAYERS)])
    else:
        return layers[cell, 0]


def counts_for(texels: int) -> Any:
    """The `counts` of so many texels, where they are needed."""
    return zeros((texels, LAYERS) if runtime.resident() else (1, 1), np.int32)
