"""Blocks that stream (paper 3.3 at real thread counts): only what a camera sees is made, and no more than it needs.

`FabricStream.survey` looks at every block record: where its bounding sphere falls on the image, how far away it is,
and how many of its template's particles are worth drawing there. `FabricStream.lay` makes the particles of chosen
blocks, in an array that is used again and again. Nothing is kept per particle but one batch.

Level of detail: see `thinning`. A template's particles stand in a ring of which every arc is an even sample of all, and
each block begins elsewhere on it, so that what one block leaves out another shows.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

from dataclasses import dataclass
from math import log, prod
from typing import Any, Protocol

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.detail.thinning import FADE, FULL, UNCHANGED, Gains, gain, thinned_to
from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.laying import block_ends, laid, row
from taichi_cloth.fabric.layout import frames
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I16x2, I32x1, I64x1, Int
from taichi_cloth.ground.particles import (
    COLOUR,
    HALF_LENGTH,
    LANES,
    NORMAL,
    OPENNESS,
    POSITION,
    RADIUS,
    ROWS,
    TANGENT,
    TILE,
    fill_up,
)

__all__ = ["FabricStream", "Pinhole", "Survey"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
GOLDEN = 0.6180339887498949
ROOT_2 = 1779033703
"""The fraction of √2 in 32 bits: a block's multiple of it is where it begins on its template's ring."""
LOG2 = log(2.0)
CHUNK_STEPS = 1024  # Taichi on a CPU gives a thread at least 512 iterations (see render/sort.py)


class Pinhole(Protocol):
    """A camera in OpenCV's convention: world to camera rotation (3, 3) and translation (3,), lens and size [px]."""

    rotation: Any
    translation: Any
    focal: float
    cx: float
    cy: float
    width: int
    height: int
    near: float


@dataclass(frozen=True)
class Survey:
    """What a camera sees of each block. boxes: (blocks, 4) int16 first and last tile column and row, last < first
    where it is out of view. counts: (blocks,) int32 particles worth drawing, 0 out of view. depth: (blocks,)
    float32 [m] of the middle. share: (blocks,) float32 λ, `FULL` for everything. tilt: mean cosine between the cloth's
    normal and the camera's axis, the same from both sides."""

    boxes: NDArray[np.int16]
    counts: I32
    depth: F32
    share: F32
    tilt: float


class FabricStream:
    """The blocks of a fabric on key points (picks, ends, 3) [m], to be made as they are needed.

    target: radius [px] that drawn particles are thinned to; 0 draws every particle whatever its size, None chooses
    (`thinned_to`).
    gains: what puts right the coverage and the brightness of thinned blocks; None changes nothing.
    """

    def __init__(
        self,
        fabric: Fabric,
        points: NDArray,
        *,
        target: float | None = None,
        gains: Gains | None = None,
        chunks: int = 2,
    ) -> None:
        layout, bank = fabric.layout, fabric.bank
        self.fabric, self.chunks = fabric, int(chunks)
        self.target = thinned_to(fabric.particles) if target is None else float(target)
        self.gains = gains or Gains(np.ones(1), np.tile(UNCHANGED, (1, 2, 1)))
        self.points = np.ascontiguousarray(points, np.float32).reshape(-1, 3)
        frame = frames(points)
        self.frames = frame.weft.reshape(-1, 3), frame.warp.reshape(-1, 3), frame.normal.reshape(-1, 3)
        self.family = layout.kinds.family[layout.blocks.kind].astype(np.int32)
        self.pitch = layout.kinds.pitch[layout.blocks.kind].astype(np.float32)
        size = np.diff(bank.start)
        template = np.repeat(np.arange(len(size)), size)
        place = np.arange(len(template)) - bank.start[template]
        order = np.lexsort(((place * GOLDEN + template * (1 - GOLDEN)) % 1.0, template))
        self.particles = bank.packed()[order]
        self.size = size.astype(np.int32)
        used = np.zeros(len(size))  # the longest pitch each template is laid on
        np.maximum.at(used, bank.template, self.pitch)
        beyond = np.maximum(np.abs(bank.u - 0.5) - 0.5, 0.0) * used[template]
        reach = beyond + np.linalg.norm(bank.offset, axis=1) + np.maximum(bank.radius, bank.half_length)
        starts = bank.start[:-1]
        filled = size > 0
        self.reach, self.radius = np.zeros(len(size), np.float32), np.zeros(len(size), np.float32)
        self.reach[filled] = np.maximum.reduceat(reach, starts[filled])
        self.radius[filled] = np.add.reduceat(bank.radius.astype(np.float64), starts[filled]) / size[filled]
        self._every = max(1, len(self.points) // 4096)  # key points that tell how the cloth is tilted
        self.turn = 0  # another number is another sample of the same thinned cloth
        self._batch = np.zeros(0, np.float32)

    @property
    def allocated(self) -> int:
        """Bytes of the batch's array, the only one that grows with what is drawn."""
        return self._batch.nbytes

    def survey(self, camera: Pinhole) -> Survey:
        """Where every block is for a camera, and how much of it is worth drawing."""
        blocks = self.fabric.layout.blocks
        n = len(blocks.kind)
        boxes, counts = np.empty((n, 4), np.int16), np.empty(n, np.int32)
        depth, share = np.empty(n, np.float32), np.empty(n, np.float32)
        view = np.zeros((6, 3), np.float32)
        view[:3], view[3] = camera.rotation, camera.translation
        view[4] = camera.focal, camera.cx, camera.cy
        view[5] = camera.width, camera.height, camera.near
        _survey(
            self.points,
            *self.frames[:2],
            blocks.key0,
            blocks.key1,
            self.family,
            self.pitch,
            self.fabric.bank.template,
            self.size,
            self.reach,
            self.radius,
            view,
            self.target,
            boxes,
            counts,
            depth,
            share,
        )
        # To the camera's axis, not to its place: then a cloth's tilt is the same from near and from far.
        cosine = self.frames[2][:: self._every] @ np.asarray(camera.rotation)[2]
        return Survey(boxes, counts, depth, share, float(np.abs(cosine).mean()))

    def lay(self, survey: Survey, blocks: I32) -> tuple[F32, int]:
        """The particles of these blocks, as many as the survey says: (ROWS, ceil(n / 16), 16) and n.

        The array is valid until the next call.
        """
        b = self.fabric.layout.blocks
        counts = survey.counts[blocks]
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        total = int(starts[-1])
        shape = ROWS, -(-total // LANES), LANES
        if self._batch.size < prod(shape):
            self._batch = np.zeros(prod(shape), np.float32)
        out = self._batch[: prod(shape)].reshape(shape)
        if not total:
            return out, 0
        _lay(
            self.chunks,
            self.turn,
            blocks.astype(np.int32, copy=False),
            starts.astype(np.int32),
            survey.share,
            self.points,
            *self.frames,
            b.key0,
            b.key1,
            self.family,
            self.pitch,
            b.thread,
            self.fabric.bank.template,
            self.fabric.bank.start,
            self.size,
            self.fabric.thread_colour,
            self.particles,
            self.gains.at(survey.tilt),
            out,
        )
        fill_up(out, total)
        return out, total

    def sample(self, most: int) -> F32:
        """An even sample of the whole fabric as `lay` gives it, a copy: about `most` particles, at least one a block,
        enlarged so that their areas add up to those of all."""
        template = self.fabric.bank.template
        size = self.size[template]
        n, share = len(size), np.float32(min(FULL, FULL * most / max(1, self.fabric.particles)))
        counts = np.minimum(size, np.maximum(1, np.ceil(share * size))).astype(np.int32)
        survey = Survey(np.zeros((n, 4), np.int16), counts, np.zeros(n, np.float32), np.full(n, share), 1.0)
        return self.lay(survey, np.arange(n, dtype=np.int32))[0].copy()

    def numbers(self, survey: Survey, blocks: I32) -> tuple[I32, I32]:
        """The thread of each particle that `lay` makes of these blocks, and its family: 0 warp, 1 weft."""
        counts = survey.counts[blocks]
        thread = self.fabric.layout.blocks.thread[blocks]
        return np.repeat(thread, counts).astype(np.int32), np.repeat(self.family[blocks], counts).astype(np.int32)


@ti.kernel
def _survey(
    # key points
    point: F32x2,
    along_weft: F32x2,
    along_warp: F32x2,
    # blocks
    key0: I32x1,
    key1: I32x1,
    family: I32x1,
    pitch: F32x1,
    template: I32x1,
    size: I32x1,
    reach: F32x1,
    radius: F32x1,
    # camera
    view: F32x2,
    target: Float,
    # out
    boxes_out: I16x2,
    counts_out: I32x1,
    depth_out: F32x1,
    share_out: F32x1,
):
    """The bounding sphere of centre (X, Y, Z) and radius r lies within f r √(1 + (X/Z)²)/(Z − r) of its centre's
    pixel, likewise down."""
    for b in range(key0.shape[0]):
        k0, k1, t = key0[b], key1[b], template[b]
        p0 = row(point, k0)
        p1 = row(point, k1)
        if k0 == k1:
            p1 = p0 + pitch[b] * (row(along_warp, k0) if family[b] == 0 else row(along_weft, k0))
        middle = 0.5 * (p0 + p1)
        r = 0.5 * (p1 - p0).norm() + reach[t]
        x = row(view, 0).dot(middle) + view[3, 0]
        y = row(view, 1).dot(middle) + view[3, 1]
        z = row(view, 2).dot(middle) + view[3, 2]
        near = view[5, 2]
        count, share = 0, 0.0
        left, right, top, bottom = 1, 0, 1, 0
        if z + r > near and size[t] > 0:
            share = FULL
            drawn = radius[t] * view[4, 0] / ti.max(z, near)
            if target > 0:
                share = ti.min((drawn / target) ** 2, FULL)
            # Outside a side of the frustum, whose plane has the normal (focal, edge) in (x, z): out of view.
            f, slack = view[4, 0], 4.0 + 3.0 * target
            for side in ti.static(range(4)):
                edge, across = view[4, 1], -x
                if ti.static(side == 1):
                    edge, across = view[5, 0] - view[4, 1], x
                if ti.static(side == 2):
                    edge, across = view[4, 2], -y
                if ti.static(side == 3):
                    edge, across = view[5, 1] - view[4, 2], y
                edge += slack
                if f * across - edge * z > r * ti.sqrt(f * f + edge * edge):
                    share = 0.0
            last_x = ti.cast(view[5, 0] - 1, ti.i32) // TILE
            last_y = ti.cast(view[5, 1] - 1, ti.i32) // TILE
            left, right, top, bottom = 0, last_x, 0, last_y
            if z - r > near:
                u, v = x / z, y / z
                grown = view[4, 0] * r / (z - r)
                margin = 2.0 + 3.0 * target
                wide = grown * ti.sqrt(1.0 + u * u) + margin
                high = grown * ti.sqrt(1.0 + v * v) + margin
                cx = u * view[4, 0] + view[4, 1]
                cy = v * view[4, 0] + view[4, 2]
                left = ti.cast(ti.floor(ti.max(cx - wide, 0.0) / TILE), ti.i32)
                top = ti.cast(ti.floor(ti.max(cy - high, 0.0) / TILE), ti.i32)
                right = ti.cast(ti.floor(ti.min(cx + wide, view[5, 0] - 1) / TILE), ti.i32)
                bottom = ti.cast(ti.floor(ti.min(cy + high, view[5, 1] - 1) / TILE), ti.i32)
            if share > 0.0 and left <= right and top <= bottom:
                count = ti.min(size[t], ti.max(1, ti.cast(ti.ceil(share * size[t]), ti.i32)))
            else:
                left, right, top, bottom = 1, 0, 1, 0
        boxes_out[b, 0] = ti.cast(left, ti.i16)
        boxes_out[b, 1] = ti.cast(right, ti.i16)
        boxes_out[b, 2] = ti.cast(top, ti.i16)
        boxes_out[b, 3] = ti.cast(bottom, ti.i16)
        counts_out[b] = count
        depth_out[b] = z
        share_out[b] = share


@ti.kernel
def _lay(
    chunks: Int,
    sample: Int,
    ids: I32x1,
    starts: I32x1,
    shares: F32x1,
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
    size: I32x1,
    thread_colour: F32x2,
    # templates, columns in the order of COLUMNS
    particle: F32x2,
    gains: F32x2,
    # out
    blocks_out: F32x3,
):
    """As `blocks.lay`, for some blocks, some particles of each, in rows of 16."""
    for step in range(chunks * CHUNK_STEPS):
        if step % CHUNK_STEPS != 0:
            continue
        chunk = step // CHUNK_STEPS
        total = ti.cast(ids.shape[0], ti.i64)
        for i in range(ti.cast(total * chunk // chunks, ti.i32), ti.cast(total * (chunk + 1) // chunks, ti.i32)):
            b = ids[i]
            k0, k1, yarn, kind = key0[b], key1[b], thread[b], template[b]
            p0, p1, a0, a1, n0, n1 = block_ends(point, along_weft, along_warp, upward, k0, k1, family[b], pitch[b])
            # How much larger the particles of a share are: as many times as their areas are fewer.
            share = shares[b]
            n = ti.cast(size[kind], ti.f32)
            drawn = share * n
            count = starts[i + 1] - starts[i]
            whole = ti.min(count, ti.cast((1.0 - FADE) * drawn, ti.i32) + 1)
            fading = ti.cast(count - whole, ti.f32)
            area = whole + fading * (drawn - 0.5 * (whole + count - 1)) / (FADE * drawn)
            level = ti.max(-ti.log(share) / LOG2, 0.0)
            larger = n / ti.max(area, 1e-6)
            wider = gain(gains, level, 0)
            brighter = gain(gains, level, 1 + family[b])
            opened = gain(gains, level, 3)
            most = 1.0 if opened > 0.0 else 0.0
            opened = ti.abs(opened)
            red = thread_colour[yarn, 0] * brighter
            green = thread_colour[yarn, 1] * brighter
            blue = thread_colour[yarn, 2] * brighter
            q0 = starts[i]
            t0 = ti.cast(template_start[kind], ti.i32)
            turn = ti.cast(b + 7919 * sample, ti.u32) * ti.cast(ROOT_2, ti.u32)
            first = ti.cast(ti.cast(turn >> 8, ti.f32) * (n / 16777216.0), ti.i32)
            for m in range(count):
                t, q = first + m, q0 + m
                t = t0 + (t if t < size[kind] else t - size[kind])
                x, d, normal = laid(particle, t, p0, p1, a0, a1, n0, n1)
                faded = ti.math.clamp((drawn - m) / (FADE * drawn), 0.0, 1.0)
                grown = ti.sqrt(larger * faded) * wider if share < FULL else 1.0
                block, lane = q // LANES, q % LANES
                for c in ti.static(range(3)):
                    blocks_out[POSITION + c, block, lane] = x[c]
                    blocks_out[TANGENT + c, block, lane] = d[c]
                    blocks_out[NORMAL + c, block, lane] = normal[c]
                tone = particle[t, COLUMN.tone]
                blocks_out[RADIUS, block, lane] = particle[t, COLUMN.radius] * grown
                blocks_out[COLOUR, block, lane] = red * tone
                blocks_out[COLOUR + 1, block, lane] = green * tone
                blocks_out[COLOUR + 2, block, lane] = blue * tone
                blocks_out[HALF_LENGTH, block, lane] = particle[t, COLUMN.half_length] * grown
                openness = particle[t, COLUMN.openness]
                blocks_out[OPENNESS, block, lane] = openness + opened * (most - openness)
