"""The rule that lays a template's particle between two key points (paper 3.3), in one place for every kernel that does.

    x = s·P + (1 − s)·P' + t

with the offset t, and directions, in the cloth's frame there: along the yarn, across it, up (see `blocks`).
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false

import taichi as ti

from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x2

__all__ = ["block_ends", "laid", "row"]


@ti.func
def row(a: F32x2, i):
    """Row i of an array (n, 3) as a vector."""
    return ti.Vector([a[i, 0], a[i, 1], a[i, 2]])


@ti.func
def block_ends(point: F32x2, along_weft: F32x2, along_warp: F32x2, upward: F32x2, k0, k1, family, pitch):
    """Both ends of a block: key points p0, p1, directions of the yarn a0, a1 (family 0 is warp), normals n0, n1."""
    p0 = row(point, k0)
    p1 = row(point, k1)
    a0 = row(along_warp, k0) if family == 0 else row(along_weft, k0)
    a1 = row(along_warp, k1) if family == 0 else row(along_weft, k1)
    if k0 == k1:  # a free end runs on straight from its last crossing
        p1 = p0 + a0 * pitch
    return p0, p1, a0, a1, row(upward, k0), row(upward, k1)


@ti.func
def frame_at(a0, a1, n0, n1, u):
    """The frame at the ratio u along a block, blended between its ends and held beyond them: along, across, up."""
    w = ti.math.clamp(u, 0.0, 1.0)
    along = (a0 + w * (a1 - a0)).normalized()
    up = n0 + w * (n1 - n0)
    up = (up - along * up.dot(along)).normalized()
    return along, up.cross(along), up


@ti.func
def laid(particle: F32x2, t, p0, p1, a0, a1, n0, n1):
    """Where particle t of the templates (`TemplateBank.packed`) is in a block, its tangent and its normal."""
    u = particle[t, COLUMN.u]
    along, across, up = frame_at(a0, a1, n0, n1, u)
    x, y, z = particle[t, COLUMN.offset], particle[t, COLUMN.offset + 1], particle[t, COLUMN.offset + 2]
    position = p0 + u * (p1 - p0) + x * along + y * across + z * up
    x, y, z = particle[t, COLUMN.tangent], particle[t, COLUMN.tangent + 1], particle[t, COLUMN.tangent + 2]
    tangent = x * along + y * across + z * up
    x, y, z = particle[t, COLUMN.normal], particle[t, COLUMN.normal + 1], particle[t, COLUMN.normal + 2]
    return position, tangent, x * along + y * across + z * up
