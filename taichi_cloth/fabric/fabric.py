"""Key points to particles (paper 3.3, Step 6): every fibre block's template laid between its two key points.

    x = s·P + (1 − s)·P' + t

with s the particle's ratio and t its offset. The paper keeps t in world axes; here it is carried in the cloth's own
frame (along the yarn, across it, normal), taken at both key points and blended, so that cloth that turns or folds
keeps its thickness and its relief.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fabric.frames import Frames, frames
from taichi_cloth.fabric.laying import FabricArrays, FabricPack, block_ends, block_widths, lay_particle, template_size
from taichi_cloth.fabric.layout import FabricLayout
from taichi_cloth.fabric.templates import COLUMN, TemplateBank, build_templates
from taichi_cloth.ground.arrays import F32x1, I64x1
from taichi_cloth.ground.particles import (
    COLOUR,
    HALF_LENGTH,
    NORMAL,
    OPENNESS,
    POSITION,
    RADIUS,
    ROWS,
    TANGENT,
    FibreCloud,
)

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
        numbers = np.empty(ROWS * self.particles, np.float32)
        _lay(self.arrays(points, frames(points)).pack(), self.particle_start, numbers)
        return FibreCloud.over(numbers)

    def arrays(self, points: NDArray, frame: Frames) -> FabricArrays:
        """The fabric on key points (picks, ends, 3) [m], where `frame` is that of the cloth, as kernels take it."""
        kinds, blocks, bank = self.layout.kinds, self.layout.blocks, self.bank
        return FabricArrays(
            point=np.ascontiguousarray(points, np.float32).reshape(-1, 3),
            weft=frame.weft.reshape(-1, 3),
            warp=frame.warp.reshape(-1, 3),
            normal=frame.normal.reshape(-1, 3),
            key0=blocks.key0,
            key1=blocks.key1,
            family=kinds.family[blocks.kind].astype(np.int32, copy=False),
            pitch=kinds.pitch[blocks.kind].astype(np.float32),
            wide=blocks.wide,
            thread=blocks.thread,
            template=bank.template,
            start=bank.start,
            particle=bank.packed(),
            colour=self.thread_colour,
        )


def build_fabric(layout: FabricLayout) -> Fabric:
    """Make the templates of a layout. Needs no Taichi; `Fabric.cloud` does."""
    bank = build_templates(layout)
    rng = np.random.Generator(np.random.Philox(key=[layout.detail.seed, 3]))
    colour = np.concatenate([layout.warp.colour, layout.weft.colour])
    shade = 1.0 + 0.03 * np.clip(rng.standard_normal((len(colour), 1)), -2.0, 2.0)  # no two dye lots are alike
    return Fabric(layout, bank, np.clip(colour * shade, 0.0, 1.0).astype(np.float32), bank.particle_start)


@ti.kernel
def _lay(fabric: FabricPack, first: I64x1, numbers_out: F32x1):
    """All particles of all blocks. first: (blocks + 1,) where each block's begin. numbers_out: of `FibreCloud.over`."""
    n = numbers_out.shape[0] // ROWS
    for b in range(fabric.key0.shape[0]):
        p0, p1, a0, a1, n0, n1 = block_ends(fabric, b)
        w0, w1 = block_widths(fabric, b)
        yarn, kind = fabric.thread[b], fabric.template[b]
        for m in range(template_size(fabric, kind)):  # pyright: ignore[reportArgumentType]
            t, q = fabric.start[kind] + m, first[b] + m
            x, d, outward, radius = lay_particle(fabric.particle, t, p0, p1, a0, a1, n0, n1, w0, w1)
            for c in ti.static(range(3)):
                numbers_out[POSITION * n + 3 * q + c] = x[c]
                numbers_out[TANGENT * n + 3 * q + c] = d[c]
                numbers_out[NORMAL * n + 3 * q + c] = outward[c]
                numbers_out[COLOUR * n + 3 * q + c] = fabric.colour[yarn, c] * fabric.particle[t, COLUMN.tone]
            numbers_out[RADIUS * n + q] = radius
            numbers_out[HALF_LENGTH * n + q] = fabric.particle[t, COLUMN.half_length]
            numbers_out[OPENNESS * n + q] = fabric.particle[t, COLUMN.openness]
