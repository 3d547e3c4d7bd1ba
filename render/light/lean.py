"""Normals that lean to the eye: of the fibres that a thick drawn one stands for, those on the eye's side are seen.

What a yarn of many fibres shows is its surface, which faces whoever looks at it. The middle of a thick fibre lies
deeper, and on any side of the yarn's axis; so do normals that point from there.
"""

import taichi as ti

from taichi_cloth.ground.arrays import F32x3, Float, Template
from taichi_cloth.ground.particles import LANES, NORMAL, POSITION, TANGENT
from taichi_cloth.ground.vectors import leant

__all__ = ["lean"]


@ti.kernel
def lean(layout: Template, by: Float, x: Float, y: Float, z: Float, upright: F32x3, blocks_out: F32x3):
    """Packed particles' normals as they are `upright` (3, blocks, 16), moved by so much of the way to an eye at x, y, z
    [m] that is square to the fibre. Hairs, which see all of the sky, stay: each stands for itself."""
    for b in range(upright.shape[1]):
        for lane in range(LANES):
            far = by
            if ti.static(layout.openness):
                far = ti.select(blocks_out[ti.static(layout.openness_row), b, lane] < 1.0, by, 0.0)
            own = ti.Vector([upright[k, b, lane] for k in ti.static(range(3))])
            along = ti.Vector([blocks_out[TANGENT + k, b, lane] for k in ti.static(range(3))])
            place = ti.Vector([blocks_out[POSITION + k, b, lane] for k in ti.static(range(3))])
            moved = leant(own, along, place, ti.Vector([x, y, z]), far)
            for k in ti.static(range(3)):
                blocks_out[NORMAL + k, b, lane] = moved[k]
