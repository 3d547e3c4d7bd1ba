"""Blocks that stream (paper 3.3 at real thread counts): only what a camera sees is made, and no more than it needs.

`FabricStream.survey` looks at every block record: where its bounding sphere falls on the image, how far away it is,
and how many of its template's particles are worth drawing there. `FabricStream.lay` makes the particles of chosen
blocks, in an array that is used again and again. Nothing is kept per particle but one batch.

Level of detail: see `thinning`. A template's particles stand in a ring of which every arc is an even sample of all, and
each block begins elsewhere on it, so that what one block leaves out another shows.
"""

from dataclasses import dataclass, replace
from math import log, prod

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.detail.thinning import FADE, FULL, NO_GAINS, Gains, gain, thinned_to
from taichi_cloth.detail.view import Pinhole, View, in_frustum, seen_at, tiles_of, view_of
from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.frames import frames
from taichi_cloth.fabric.laying import FabricPack, block_ends, block_widths, lay_particle, row, template_size
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I16x2, I32x1, Int
from taichi_cloth.ground.copies import fetched, filled_up, zeros
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
)
from taichi_cloth.ground.vectors import chunk_count, chunk_steps, leant

__all__ = ["FabricStream", "Survey"]

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
GOLDEN = 0.6180339887498949
ROOT_2 = 1779033703
"""The fraction of √2 in 32 bits: a block's multiple of it is where it begins on its template's ring."""
LOG2 = log(2.0)


@dataclass(frozen=True)
class Survey:
    """What a camera sees of each block. boxes: (blocks, 4) int16 first and last tile column and row, last < first
    where it is out of view. counts: (blocks,) int32 particles worth drawing, 0 out of view. depth: (blocks,)
    float32 [m] of the middle. reach: (blocks,) float32 how far it reaches from there [m]. share: (blocks,) float32 λ,
    `FULL` for everything. tilt: mean cosine between the cloth's normal and the camera's axis, the same
    from both sides. eye: (4,) float32 where the camera stands [m], and how far normals lean to it."""

    boxes: NDArray[np.int16]
    counts: I32
    depth: F32
    reach: F32
    share: F32
    tilt: float
    eye: F32


class FabricStream:
    """The blocks of a fabric on key points (picks, ends, 3) [m], to be made as they are needed.

    target: radius [px] that drawn particles are thinned to; 0 draws every particle whatever its size, None chooses
    (`thinned_to`).
    gains: what puts right the coverage and the brightness of thinned blocks; None changes nothing. to_eye: how far
    normals of its fibres, but of hairs, lean to the eye (`vectors.leant`).
    """

    def __init__(
        self,
        fabric: Fabric,
        points: NDArray,
        *,
        target: float | None = None,
        gains: Gains | None = None,
        chunks: int = 2,
        to_eye: float = 0.0,
    ) -> None:
        bank = fabric.bank
        self.to_eye = to_eye
        self.fabric, self.chunks = fabric, chunk_count(int(chunks))
        self.target = thinned_to(fabric.particles) if target is None else float(target)
        self.gains = gains or NO_GAINS
        self.frame = frames(points)
        self.arrays = fabric.arrays(points, self.frame)
        size = np.diff(bank.start)
        template = np.repeat(np.arange(len(size)), size)
        place = np.arange(len(template)) - bank.start[template]
        order = np.lexsort(((place * GOLDEN + template * (1 - GOLDEN)) % 1.0, template))
        self.arrays = replace(self.arrays, particle=self.arrays.particle[order])
        self.size = size.astype(np.int32)
        used = np.zeros(len(size))  # the longest pitch each template is laid on
        np.maximum.at(used, bank.template, self.arrays.pitch)
        beyond = np.maximum(np.abs(bank.u - 0.5) - 0.5, 0.0) * used[template]
        reach = beyond + np.linalg.norm(bank.offset, axis=1) + np.maximum(bank.radius, bank.half_length)
        starts = bank.start[:-1]
        filled = size > 0
        self.reach, self.radius = np.zeros(len(size), np.float32), np.zeros(len(size), np.float32)
        self.reach[filled] = np.maximum.reduceat(reach, starts[filled])
        self.radius[filled] = np.add.reduceat(bank.radius.astype(np.float64), starts[filled]) / size[filled]
        self._every = max(1, len(self.arrays.point) // 4096)  # key points that tell how the cloth is tilted
        self.turn = 0  # another number is another sample of the same thinned cloth
        self._batch = np.zeros(0, np.float32)

    @property
    def allocated(self) -> int:
        """Bytes of the batch's array, the only one that grows with what is drawn."""
        return self._batch.nbytes

    def survey(self, camera: Pinhole) -> Survey:
        """Where every block is for a camera, and how much of it is worth drawing."""
        n = len(self.arrays.key0)
        boxes, counts = np.empty((n, 4), np.int16), np.empty(n, np.int32)
        depth, reach, share = (np.empty(n, np.float32) for _ in range(3))
        pack, view = self.arrays.pack(), view_of(camera)
        _survey(pack, self.reach, self.radius, view, self.target, boxes, counts, depth, reach, share)
        # To the camera's axis, not to its place: then a cloth's tilt is the same from near and from far.
        cosine = self.arrays.normal[:: self._every] @ np.asarray(camera.rotation)[2]
        eye = np.array([*view.eye, self.to_eye], np.float32)
        return Survey(boxes, counts, depth, reach, share, float(np.abs(cosine).mean()), eye)

    def lay(self, survey: Survey, blocks: I32) -> tuple[F32, int]:
        """The particles of these blocks, as many as the survey says: (ROWS, ceil(n / 16), 16) and n.

        The array is valid until the next call.
        """
        counts = survey.counts[blocks]
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        total = int(starts[-1])
        shape = ROWS, -(-total // LANES), LANES
        if self._batch.size < prod(shape):
            self._batch = zeros(prod(shape))
        out = self._batch[: prod(shape)].reshape(shape)
        if not total:
            return out, 0
        _lay(
            self.chunks,
            self.turn,
            blocks.astype(np.int32, copy=False),
            starts.astype(np.int32),
            survey.share,
            self.arrays.pack(),
            self.gains.at(survey.tilt),
            survey.eye,
            out,
        )
        filled_up(out, total)
        return out, total

    def sample(self, most: int, place: NDArray | None = None, across: float = np.inf) -> F32:
        """An even sample of the whole fabric, or of a cube `across` [m] wide round a place (3,) [m], as `lay` gives it,
        a copy: about `most` particles, at least one a block, enlarged so that their areas add up to those of all."""
        blocks = np.arange(len(self.arrays.key0), dtype=np.int32)
        if place is not None:
            middle = (self.arrays.point[self.arrays.key0] + self.arrays.point[self.arrays.key1]) / 2
            blocks = blocks[np.abs(middle - place).max(axis=1) < 0.5 * across]
        size = self.size[self.fabric.bank.template]
        n, share = len(size), np.float32(min(FULL, FULL * most / max(1, size[blocks].sum(dtype=np.int64))))
        counts = np.minimum(size, np.maximum(1, np.ceil(share * size))).astype(np.int32)
        zero = np.zeros(n, np.float32)
        survey = Survey(np.zeros((n, 4), np.int16), counts, zero, zero, np.full(n, share), 1.0, np.zeros(4, np.float32))
        return fetched(self.lay(survey, blocks)[0]).copy()

    def numbers(self, survey: Survey, blocks: I32) -> tuple[I32, I32]:
        """The thread of each particle that `lay` makes of these blocks, and its family: 0 warp, 1 weft."""
        counts = survey.counts[blocks]
        thread = self.fabric.layout.blocks.thread[blocks]
        return np.repeat(thread, counts).astype(np.int32), np.repeat(self.arrays.family[blocks], counts)


@ti.kernel
def _survey(
    fabric: FabricPack,
    reach: F32x1,
    radius: F32x1,
    view: View,
    target: Float,
    # out
    boxes_out: I16x2,
    counts_out: I32x1,
    depth_out: F32x1,
    reach_out: F32x1,
    share_out: F32x1,
):
    """What `Survey` says of each block. reach, radius: of each template [m], round its middle and of its particles."""
    for b in range(fabric.key0.shape[0]):
        # The sphere round the block, in the camera's axes.
        k0, k1, t = fabric.key0[b], fabric.key1[b], fabric.template[b]
        p0 = row(fabric.point, k0)
        p1 = row(fabric.point, k1)
        if k0 == k1:
            p1 = p0 + fabric.pitch[b] * (row(fabric.warp, k0) if fabric.family[b] == 0 else row(fabric.weft, k0))
        r = 0.5 * (p1 - p0).norm() + reach[t]  # pyright: ignore[reportOptionalCall]
        at = seen_at(view, 0.5 * (p0 + p1))
        z = at[2]
        size = template_size(fabric, t)
        count, share = 0, 0.0
        left, right, top, bottom = 1, 0, 1, 0
        if z + r > view.near and size > 0:
            # As many particles as make them `target` pixels large.
            share = FULL
            drawn = radius[t] * view.focal / ti.max(z, view.near)
            if target > 0:
                share = ti.min((drawn / target) ** 2, FULL)
            slack = 4.0 + 3.0 * target
            if not in_frustum(view, at, r, slack):
                share = 0.0
            # The tiles that it may touch: all of them where the camera stands within the sphere.
            left, right = 0, ti.cast(view.width - 1, ti.i32) // TILE
            top, bottom = 0, ti.cast(view.height - 1, ti.i32) // TILE
            if z - r > view.near:
                left, right, top, bottom = tiles_of(view, at, r, 2.0 + 3.0 * target)
            if share > 0.0 and left <= right and top <= bottom:
                count = ti.min(size, ti.max(1, ti.cast(ti.ceil(share * size), ti.i32)))
            else:
                left, right, top, bottom = 1, 0, 1, 0
        boxes_out[b, 0] = ti.cast(left, ti.i16)
        boxes_out[b, 1] = ti.cast(right, ti.i16)
        boxes_out[b, 2] = ti.cast(top, ti.i16)
        boxes_out[b, 3] = ti.cast(bottom, ti.i16)
        counts_out[b] = count
        depth_out[b] = z
        reach_out[b] = r
        share_out[b] = share


@ti.kernel
def _lay(
    chunks: Int,
    sample: Int,
    chosen: I32x1,
    starts: I32x1,
    shares: F32x1,
    fabric: FabricPack,
    gains: F32x2,
    eye: F32x1,
    # out
    groups_out: F32x3,
):
    """Particles of chosen blocks, in groups. starts: (chosen + 1,) where each one's stand, and so how many they are.
    shares: λ of every block. sample: which of the templates' samples. gains: `Gains.at` of the view. eye: of `Survey`.
    """
    for step in range(chunks * ti.static(chunk_steps())):
        if step % ti.static(chunk_steps()) != 0:
            continue
        chunk = step // ti.static(chunk_steps())
        total = ti.cast(chosen.shape[0], ti.i64)
        for i in range(ti.cast(total * chunk // chunks, ti.i32), ti.cast(total * (chunk + 1) // chunks, ti.i32)):  # pyright: ignore[reportArgumentType]
            b = chosen[i]
            yarn, kind = fabric.thread[b], fabric.template[b]
            p0, p1, a0, a1, n0, n1 = block_ends(fabric, b)
            w0, w1 = block_widths(fabric, b)
            # How much larger the particles of a share are: as many times as their areas are fewer.
            share, size = shares[b], template_size(fabric, kind)
            n = ti.cast(size, ti.f32)
            drawn = share * n
            count = starts[i + 1] - starts[i]
            whole = ti.min(count, ti.cast((1.0 - FADE) * drawn, ti.i32) + 1)
            fading = ti.cast(count - whole, ti.f32)
            area = whole + fading * (drawn - 0.5 * (whole + count - 1)) / (FADE * drawn)
            larger = n / ti.max(area, 1e-6)
            # What puts right how a sample hides and answers light.
            level = ti.max(-ti.log(share) / LOG2, 0.0)
            wider = gain(gains, level, 0)
            brighter = gain(gains, level, 1 + fabric.family[b])
            opened = gain(gains, level, 3)
            most = 1.0 if opened > 0.0 else 0.0
            opened = ti.abs(opened)
            red = fabric.colour[yarn, 0] * brighter
            green = fabric.colour[yarn, 1] * brighter
            blue = fabric.colour[yarn, 2] * brighter
            # Where on its template's ring the block begins.
            q0 = starts[i]
            t0 = ti.cast(fabric.start[kind], ti.i32)
            turn = ti.cast(b + 7919 * sample, ti.u32) * ti.cast(ROOT_2, ti.u32)
            first = ti.cast(ti.cast(turn >> 8, ti.f32) * (n / 16777216.0), ti.i32)
            for m in range(count):
                t, q = first + m, q0 + m
                t = t0 + (t if t < size else t - size)
                x, d, outward, radius = lay_particle(fabric.particle, t, p0, p1, a0, a1, n0, n1, w0, w1)
                faded = ti.math.clamp((drawn - m) / (FADE * drawn), 0.0, 1.0)
                grown = ti.sqrt(larger * faded) * wider if share < FULL else 1.0
                tone, openness = fabric.particle[t, COLUMN.tone], fabric.particle[t, COLUMN.openness]
                if eye[3] > 0.0 and openness < 1.0:
                    outward = leant(outward, d, x, ti.Vector([eye[0], eye[1], eye[2]]), eye[3])
                group, lane = q // LANES, q % LANES
                for c in ti.static(range(3)):
                    groups_out[POSITION + c, group, lane] = x[c]
                    groups_out[TANGENT + c, group, lane] = d[c]
                    groups_out[NORMAL + c, group, lane] = outward[c]
                groups_out[RADIUS, group, lane] = radius * grown
                groups_out[COLOUR, group, lane] = red * tone
                groups_out[COLOUR + 1, group, lane] = green * tone
                groups_out[COLOUR + 2, group, lane] = blue * tone
                groups_out[HALF_LENGTH, group, lane] = fabric.particle[t, COLUMN.half_length] * grown
                groups_out[OPENNESS, group, lane] = openness + opened * (most - openness)
