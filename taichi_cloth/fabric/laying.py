"""The rule that lays a template's particle between two key points (paper 3.3), in one place for every kernel that does.

    x = s·P + (1 − s)·P' + t

with the offset t, and directions, in the cloth's frame there: along the yarn, across it, up (see `fabric`).

Key points, fibre blocks and templates travel to these kernels as one argument, a named pack of NumPy arrays. Taichi
fields, in which `follow` keeps what it moves in place frame by frame, would cost here: a kernel is compiled for the
fields it was first given. A swatch of other size then took 0.95 to 1.25 s to compile and fill its fields (0.3 to 0.5 s
from the cache) where the pack takes 0.02 to 0.1 s, and laid its million particles no faster (83 ms, pack 86, 2 cores).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, I64x1, Template
from taichi_cloth.ground.copies import sent

__all__ = ["FabricArrays", "FabricPack", "block_ends", "block_widths", "lay_particle", "row", "template_size"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

_TYPES = {
    "point": F32x2,
    "weft": F32x2,
    "warp": F32x2,
    "normal": F32x2,
    "key0": I32x1,
    "key1": I32x1,
    "family": I32x1,
    "pitch": F32x1,
    "wide": F32x2,
    "thread": I32x1,
    "template": I32x1,
    "start": I64x1,
    "particle": F32x2,
    "colour": F32x2,
}

_PACK: Any = ti.types.argpack(**_TYPES)

if TYPE_CHECKING:
    FabricPack = Any
else:
    FabricPack = _PACK


@dataclass(frozen=True, eq=False)
class FabricArrays:
    """A fabric on key points, as kernels take it."""

    point: F32
    """Key points [m], row by row, (keys, 3)."""
    weft: F32
    """Unit direction of the weft at each, (keys, 3)."""
    warp: F32
    """Unit direction of the warp, (keys, 3)."""
    normal: F32
    """Unit normal, (keys, 3)."""
    key0: I32
    """Number of the key point at the beginning of each fibre block, (blocks,)."""
    key1: I32
    """And at its end; the same for the free end of a yarn."""
    family: I32
    """0 warp, 1 weft, (blocks,)."""
    pitch: F32
    """Length between the crossings at rest [m], (blocks,)."""
    wide: F32
    """How wide its thread is over its mean at each of its ends, (blocks, 2)."""
    thread: I32
    """Warp ends first, then weft picks, (blocks,)."""
    template: I32
    """Whose fibres it has, (blocks,)."""
    start: NDArray[np.int64]
    """Where each template's particles begin, (templates + 1,)."""
    particle: F32
    """What the templates say of each particle, (n, 14): see `COLUMN`."""
    colour: F32
    """Of each thread, linear, (threads, 3)."""

    def pack(self) -> Any:
        """The argument of a kernel, where no variable may have a member's name. To be made for each call: it must not
        outlive a start of Taichi."""
        return _PACK(**self._there)

    @cached_property
    def _there(self) -> dict[str, Any]:
        """The arrays where kernels read them."""
        return {name: sent(getattr(self, name)) for name in _TYPES}


@ti.func
def row(a: F32x2, i):
    """Row i of an array (n, 3) as a vector."""
    return ti.Vector([a[i, 0], a[i, 1], a[i, 2]])


@ti.func
def template_size(fabric: Template, t):
    """Particles of template t."""
    return ti.cast(fabric.start[t + 1] - fabric.start[t], ti.i32)


@ti.func
def block_ends(fabric: Template, b):
    """Both ends of fibre block b: key points p0, p1, directions of the yarn a0, a1, normals n0, n1."""
    k0, k1 = fabric.key0[b], fabric.key1[b]
    p0 = row(fabric.point, k0)
    p1 = row(fabric.point, k1)
    a0 = row(fabric.warp, k0) if fabric.family[b] == 0 else row(fabric.weft, k0)
    a1 = row(fabric.warp, k1) if fabric.family[b] == 0 else row(fabric.weft, k1)
    if k0 == k1:  # a free end runs on straight from its last crossing
        p1 = p0 + a0 * fabric.pitch[b]
    return p0, p1, a0, a1, row(fabric.normal, k0), row(fabric.normal, k1)


@ti.func
def block_widths(fabric: Template, b):
    """How wide the thread of fibre block b is over its mean, at its beginning and at its end."""
    return fabric.wide[b, 0], fabric.wide[b, 1]


@ti.func
def frame_at(a0, a1, n0, n1, u):
    """The frame at the ratio u along a block, blended between its ends and held beyond them: along, across, up."""
    w = ti.math.clamp(u, 0.0, 1.0)
    along = (a0 + w * (a1 - a0)).normalized()
    up = n0 + w * (n1 - n0)
    up = (up - along * up.dot(along)).normalized()
    return along, up.cross(along), up


@ti.func
def lay_particle(particle: F32x2, t, p0, p1, a0, a1, n0, n1, w0, w1):
    """Where particle t of the templates is in a block with those ends and widths, its tangent, normal and radius: in a
    wide place fibres lie farther apart, and are thicker where few stand for all."""
    u = particle[t, COLUMN.u]
    wide = w0 + ti.math.clamp(u, 0.0, 1.0) * (w1 - w0)
    along, across, up = frame_at(a0, a1, n0, n1, u)
    x, y, z = particle[t, COLUMN.offset], particle[t, COLUMN.offset + 1], particle[t, COLUMN.offset + 2]
    position = p0 + u * (p1 - p0) + x * along + wide * y * across + z * up
    x, y, z = particle[t, COLUMN.tangent], particle[t, COLUMN.tangent + 1], particle[t, COLUMN.tangent + 2]
    tangent = x * along + y * across + z * up
    x, y, z = particle[t, COLUMN.normal], particle[t, COLUMN.normal + 1], particle[t, COLUMN.normal + 2]
    return position, tangent, x * along + y * across + z * up, wide * particle[t, COLUMN.radius]
