"""Key points to particles (paper 3.3, Step 6): every fibre block's template laid between its two key points.

    x = s·P + (1 − s)·P' + t

with s the particle's ratio and t its offset. The paper keeps t in world axes; here it is carried in the cloth's own
frame (along the yarn, across it, normal), taken at both key points and blended, so that cloth that turns or folds
keeps its thickness and its relief.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fabric.laying import block_ends, frame_at, placed, turned
from taichi_cloth.fabric.layout import FabricLayout, frames
from taichi_cloth.fabric.templates import TemplateBank, build_templates
from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, I64x1
from taichi_cloth.ground.particles import FibreCloud

__all__ = ["Fabric", "build_fabric"]

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Fabric:
    """A fabric ready to be laid on key points: its layout and the templates of its blocks."""

    layout: FabricLayout
    bank: TemplateBank
    thread_colour: F32
    particle_start: NDArray[np.int64]

    @property
    def particles(self) -> int:
        return int(self.particle_start[-1])

    def threads(self) -> NDArray[np.int32]:
        """Number of the thread each particle is of, warp ends first, then weft picks, shape (n,)."""
        return np.repeat(self.layout.blocks.thread, np.diff(self.particle_start)).astype(np.int32)

    def cloud(self, points: NDArray) -> FibreCloud:
        """All particles of the fabric on key points (picks, ends, 3) [m].

        Raises ValueError when the grid is not the fabric's.
        """
        picks, ends = self.layout.cloth.warp_up.shape
        if points.shape != (picks, ends, 3):
            raise ValueError(f"points: shape {points.shape}; this fabric needs {(picks, ends, 3)}")
        n, kinds, blocks, bank = self.particles, self.layout.kinds, self.layout.blocks, self.bank
        frame = frames(points)
        out = FibreCloud(
            *(np.empty((n, 3), np.float32) for _ in range(4)), *(np.empty(n, np.float32) for _ in range(3))
        )
        _lay(
            np.ascontiguousarray(points, np.float32).reshape(-1, 3),
            frame.weft.reshape(-1, 3),
            frame.warp.reshape(-1, 3),
            frame.normal.reshape(-1, 3),
            blocks.key0,
            blocks.key1,
            kinds.family[blocks.kind],
            kinds.pitch[blocks.kind].astype(np.float32),
            blocks.thread,
            bank.template,
            bank.start,
            self.particle_start,
            self.thread_colour,
            bank.u,
            bank.offset,
            bank.tangent,
            bank.normal,
            bank.radius,
            bank.half_length,
            bank.openness,
            bank.tone,
            out.position,
            out.tangent,
            out.normal,
            out.colour,
            out.radius,
            out.half_length,
            out.openness,
        )
        return out


def build_fabric(layout: FabricLayout) -> Fabric:
    """Make the templates of a layout. Needs no Taichi; `Fabric.cloud` does."""
    bank = build_templates(layout)
    rng = np.random.Generator(np.random.Philox(key=[layout.detail.seed, 3]))
    colour = np.concatenate([layout.warp.colour, layout.weft.colour])
    shade = 1.0 + 0.03 * np.clip(rng.standard_normal((len(colour), 1)), -2.0, 2.0)  # no two dye lots are alike
    return Fabric(layout, bank, np.clip(colour * shade, 0.0, 1.0).astype(np.float32), bank.particle_start)


@ti.kernel
def _lay(
    # key points
    point: F32x2,
    along_weft: F32x2,
    along_warp: F32x2,
    upward: F32x2,
    # blocks
    key0: I32x1,
    key1: I32x1,
    family: I32x1,
    pitch: F32x1,
    thread: I32x1,
    template: I32x1,
    template_start: I64x1,
    particle_start: I64x1,
    thread_colour: F32x2,
    # templates
    u: F32x1,
    offset: F32x2,
    tangent: F32x2,
    normal: F32x2,
    radius: F32x1,
    half_length: F32x1,
    openness: F32x1,
    tone: F32x1,
    # out
    position_out: F32x2,
    tangent_out: F32x2,
    normal_out: F32x2,
    colour_out: F32x2,
    radius_out: F32x1,
    half_length_out: F32x1,
    openness_out: F32x1,
):
    for b in range(key0.shape[0]):
        k0, k1, yarn = key0[b], key1[b], thread[b]
        p0, p1, a0, a1, n0, n1 = block_ends(point, along_weft, along_warp, upward, k0, k1, family[b], pitch[b])
        q0, t0 = particle_start[b], template_start[template[b]]
        for m in range(ti.i32(particle_start[b + 1] - q0)):
            t, q = t0 + m, q0 + m
            along, across, up = frame_at(a0, a1, n0, n1, u[t])
            x = placed(p0, p1, u[t], along, across, up, offset[t, 0], offset[t, 1], offset[t, 2])
            d = turned(along, across, up, tangent[t, 0], tangent[t, 1], tangent[t, 2])
            n = turned(along, across, up, normal[t, 0], normal[t, 1], normal[t, 2])
            for c in ti.static(range(3)):
                position_out[q, c] = x[c]
                tangent_out[q, c] = d[c]
                normal_out[q, c] = n[c]
                colour_out[q, c] = thread_colour[yarn, c] * tone[t]
            radius_out[q] = radius[t]
            half_length_out[q] = half_length[t]
            openness_out[q] = openness[t]
