"""Nearer than the template: drawn fibres part into the real ones, and these get their own surface.

A drawn fibre stands for several real ones of the same area together. Close by it is replaced by that many, in its
own section, on its own course, so the yarn keeps its outline, its colour and its fibres' places; closer still, a
piece of fibre is replaced by points on its surface (`skin`). Both changes are continuous: the real fibres part from
the drawn one's axis and its surface rises from a round one as the camera comes nearer, so nothing pops.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

from dataclasses import dataclass, replace
from math import pi

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.arrays import F32x1, F32x2, F32x3, Float, I32x1, I64x1, Int
from taichi_cloth.blocks import Fabric
from taichi_cloth.fabric import BODY, Blocks
from taichi_cloth.streaming import COLUMNS, LANES, ROWS, TILE, FabricStream, Pinhole, Survey
from taichi_cloth.templates import build_templates

__all__ = ["RefiningStream"]

F32 = NDArray[np.float32]
PART = (3.5, 9.0)
"""Radius of a drawn fibre [px] at which it begins to part into real ones, and at which they have their places."""
SURFACE = (7.0, 16.0)
"""Radius of a real fibre [px] at which its surface begins to show, and at which it is all there."""
SPACING = 2.0
"""Distance between points on a fibre's surface [px]."""
MOST_BLOCKS = 700
"""Blocks parted at a time; the nearest go first."""
STEPS = 32
"""Pieces of a real fibre in a block."""
WIDTH = 22
"""Numbers of a piece: position, radius, colour, tangent, normal, half length, openness (as `streaming.ROWS`), its
place along the skin's period, the period [m], its turn [rad], whether it has a skin, how far it has parted, and how
far before and after it its neighbours on the fibre stand in the list, 0 at a block's end."""
ARC = 220.0 / 180.0 * pi
"""How much of a fibre's circumference gets points: the side towards the camera, and a little more."""


@dataclass(frozen=True)
class Refined:
    """A survey of blocks and, after them, pieces of fibre: as `Survey`, with the pieces (n, WIDTH) themselves."""

    boxes: NDArray[np.int16]
    counts: NDArray[np.int32]
    depth: F32
    blocks: Survey
    pieces: F32
    grid: NDArray[np.int32]
    view: F32


class RefiningStream:
    """A fabric that streams as `FabricStream` does and is refined where the camera is near.

    skin: the fibre's height map (see `skin.skin_of`). steps: pieces of a real fibre in a block.
    """

    def __init__(
        self, fabric: Fabric, points: NDArray, skin: F32, *, steps: int = STEPS, chunks: int = 2, **options: object
    ) -> None:
        self.base = FabricStream(fabric, points, chunks=chunks, **options)  # pyright: ignore[reportArgumentType]
        self.skin, self.steps, self.chunks = np.ascontiguousarray(skin, np.float32), steps, chunks
        self._known = np.zeros(0, np.int64)
        self._near: FabricStream | None = None
        self._batch = np.zeros((0, ROWS, LANES), np.float32)
        bank, base = fabric.bank, self.base
        beyond = np.maximum(np.abs(bank.u - 0.5) - 0.5, 0.0) * float(base.pitch.max())
        reach = beyond + np.linalg.norm(bank.offset, axis=1) + bank.half_length
        filled = base.size > 0
        self._reach = np.zeros(len(base.size))  # of each template without its hairs, which stand open on all sides
        self._reach[filled] = np.maximum.reduceat(np.where(bank.openness < 1.0, reach, 0.0), bank.start[:-1][filled])

    def survey(self, camera: Pinhole) -> Refined:
        """Where every block is, and every piece of the fibres near the camera."""
        seen = self.base.survey(camera)
        radius = self.base.radius[self.base.fabric.bank.template]
        with np.errstate(divide="ignore"):
            pixels = radius * camera.focal / np.maximum(seen.depth, camera.near)
        near = np.flatnonzero((seen.counts > 0) & (pixels > PART[0]))
        near = near[self._in_view(near, camera)]
        if len(near) > MOST_BLOCKS:
            near = np.sort(near[np.argsort(seen.depth[near], kind="stable")[:MOST_BLOCKS]])
        view = np.zeros((7, 3), np.float32)
        view[:3], view[3] = camera.rotation, camera.translation
        view[4] = camera.focal, camera.cx, camera.cy
        view[5] = camera.width, camera.height, camera.near
        view[6] = -np.asarray(camera.rotation).T @ np.asarray(camera.translation)
        pieces = self._part(near, pixels[near]) if len(near) else np.zeros((0, WIDTH), np.float32)
        n = len(pieces)
        boxes, counts = np.empty((n, 4), np.int16), np.zeros(n, np.int32)
        depth, grid = np.empty(n, np.float32), np.empty((n, 2), np.int32)
        if n:
            _place(pieces, view, boxes, counts, depth, grid)
        counts_of_blocks = seen.counts.copy()
        counts_of_blocks[near] = 0
        return Refined(
            boxes=np.concatenate([seen.boxes, boxes]),
            counts=np.concatenate([counts_of_blocks, counts]),
            depth=np.concatenate([seen.depth, depth]),
            blocks=seen,
            pieces=pieces,
            grid=grid,
            view=view,
        )

    def lay(self, survey: Refined, chosen: NDArray[np.int32]) -> tuple[F32, int]:
        """The particles of these blocks and pieces; places between the two kinds that stay empty have radius 0."""
        first = len(survey.blocks.counts)
        out, total = self.base.lay(survey.blocks, chosen[chosen < first])
        mine = chosen[chosen >= first] - first
        if not len(mine):
            return out, total
        starts = np.concatenate([[0], np.cumsum(survey.counts[first:][mine], dtype=np.int64)])
        rows, more = len(out), -(-int(starts[-1]) // LANES)
        if len(self._batch) < rows + more:
            self._batch = np.zeros((rows + more, ROWS, LANES), np.float32)
        batch = self._batch[: rows + more]
        batch[:rows] = out
        _surface(
            self.chunks,
            mine.astype(np.int32),
            (starts + rows * LANES).astype(np.int32),
            survey.pieces,
            survey.grid,
            survey.view,
            self.skin,
            batch,
        )
        filled = int(starts[-1]) % LANES
        if filled:
            batch[-1, :, filled:] = batch[-1, :, filled - 1, None]
            batch[-1, 3, filled:] = 0.0
        return batch, (rows + more) * LANES

    @property
    def allocated(self) -> int:
        """Bytes of the batches' arrays."""
        return self.base.allocated + self._batch.nbytes

    def _in_view(self, blocks: NDArray[np.int64], camera: Pinhole) -> NDArray[np.bool_]:
        """Whether the spheres round the blocks' own fibres, without hairs, touch the frustum."""
        records, points = self.base.fabric.layout.blocks, self.base.points
        p0, p1 = points[records.key0[blocks]], points[records.key1[blocks]]
        r = np.linalg.norm(p1 - p0, axis=1) / 2 + self._reach[self.base.fabric.bank.template[blocks]]
        x, y, z = ((p0 + p1) / 2 @ np.asarray(camera.rotation).T + np.asarray(camera.translation)).T
        inside = z + r > camera.near
        for across, edge in (
            (-x, camera.cx),
            (x, camera.width - camera.cx),
            (-y, camera.cy),
            (y, camera.height - camera.cy),
        ):
            inside &= camera.focal * across - edge * z <= r * np.hypot(camera.focal, edge)
        return inside

    def _part(self, near: NDArray[np.int64], pixels: F32) -> F32:
        """The pieces of all real fibres of these blocks, (n, WIDTH)."""
        if not np.isin(near, self._known).all():
            self._known = near
            layout = self.base.fabric.layout
            b = layout.blocks
            fewer = Blocks(*(getattr(b, name)[near] for name in Blocks.__dataclass_fields__))
            finer = replace(layout, blocks=fewer, detail=replace(layout.detail, steps=self.steps))
            bank = build_templates(finer)
            fabric = Fabric(finer, bank, self.base.fabric.thread_colour, bank.particle_start)
            self._fine = (fabric, np.column_stack([getattr(bank, c) for c in COLUMNS]).astype(np.float32))
        fabric, particles = self._fine
        layout, bank = fabric.layout, fabric.bank
        where = np.searchsorted(self._known, near).astype(np.int32)
        family = layout.kinds.family[layout.blocks.kind]
        yarns = (layout.warp.yarn, layout.weft.yarn)
        drawn = np.array([min(layout.detail.fibres, y.fibres_in_section) for y in yarns])
        each = np.maximum(1, np.rint(np.array([y.fibres_in_section for y in yarns]) / drawn)).astype(np.int32)
        rows = np.array([y.plies for y in yarns]) * drawn
        free = max(1, round(layout.detail.fringe * self.steps))
        length = np.where(layout.kinds.section[layout.blocks.kind] == BODY, self.steps, free)
        core = (rows[family] * length).astype(np.int32)  # hairs, which are real already, come after these
        size = np.diff(bank.start)[bank.template]
        counts = (core * each[family] + (size - core))[where]
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        out = np.empty((int(starts[-1]), WIDTH), np.float32)
        usual = float(np.mean([y.fibre_diameter for y in yarns])) * 20.0  # a skin's period is near this [m]
        base = self.base
        parted = np.clip((pixels - PART[0]) / (PART[1] - PART[0]), 0, 1)
        parted = (parted * parted * (3 - 2 * parted)).astype(np.float32)
        _split(
            self.chunks,
            where,
            starts.astype(np.int32),
            parted,
            base.points,
            *base.frames,
            layout.blocks.key0,
            layout.blocks.key1,
            family.astype(np.int32),
            layout.kinds.pitch[layout.blocks.kind].astype(np.float32),
            layout.blocks.thread,
            bank.template,
            bank.start,
            core,
            length.astype(np.int32),
            each[family].astype(np.int32),
            fabric.thread_colour,
            particles,
            usual,
            out,
        )
        return out


@ti.func
def _row(a: F32x2, i):
    return ti.Vector([a[i, 0], a[i, 1], a[i, 2]])


@ti.func
def _hash(a, b):
    """Even in 0..1 from two whole numbers, the same in any order of work."""
    x = ti.cast(a * 73856093 + b * 19349663 + 83492791, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    x = (x ^ (x >> 16)) * ti.cast(73244475, ti.u32)
    return ti.cast((x ^ (x >> 16)) & ti.cast(0xFFFFFF, ti.u32), ti.f32) / 16777216.0


@ti.kernel
def _split(
    chunks: Int,
    ids: I32x1,
    starts: I32x1,
    parted: F32x1,
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
    core: I32x1,
    steps: I32x1,
    each: I32x1,
    thread_colour: F32x2,
    # templates
    particle: F32x2,
    usual: Float,
    # out
    pieces_out: F32x2,
):
    """Lay blocks as `blocks` does, each drawn fibre as `each` real ones: an even spiral in its section (Vogel)."""
    for step in range(chunks * 1024):
        if step % 1024 != 0:
            continue
        chunk = step // 1024
        for i in range(ids.shape[0] * chunk // chunks, ids.shape[0] * (chunk + 1) // chunks):
            b = ids[i]
            k0, k1, yarn = key0[b], key1[b], thread[b]
            p0 = _row(point, k0)
            p1 = _row(point, k1)
            a0 = _row(along_warp, k0) if family[b] == 0 else _row(along_weft, k0)
            a1 = _row(along_warp, k1) if family[b] == 0 else _row(along_weft, k1)
            n0 = _row(upward, k0)
            n1 = _row(upward, k1)
            if k0 == k1:
                p1 = p0 + a0 * pitch[b]
            periods = ti.max(1.0, ti.round(pitch[b] / usual))
            t0 = ti.cast(template_start[template[b]], ti.i32)
            q = starts[i]
            m = 0
            while q < starts[i + 1]:
                t = t0 + m
                u = particle[t, 0]
                w = ti.math.clamp(u, 0.0, 1.0)
                along = (a0 + w * (a1 - a0)).normalized()
                up = n0 + w * (n1 - n0)
                up = (up - along * up.dot(along)).normalized()
                across = up.cross(along)
                x = p0 + u * (p1 - p0) + particle[t, 1] * along + particle[t, 2] * across + particle[t, 3] * up
                d = particle[t, 4] * along + particle[t, 5] * across + particle[t, 6] * up
                normal = particle[t, 7] * along + particle[t, 8] * across + particle[t, 9] * up
                side = d.cross(normal)
                is_core = m < core[b]
                row = m // steps[b] if is_core else 100000 + m
                count = each[b] if is_core else 1
                many = ti.cast(count, ti.f32)
                radius = particle[t, 10]
                for j in range(count):
                    here, r, outward, tone = x, radius, normal, particle[t, 13]
                    far = 0.0
                    if count > 1:
                        rho = ti.sqrt((j + 0.5) / many)
                        fine = radius / ti.sqrt(many)
                        angle = 2.399963 * j + 6.2831853 * _hash(row, yarn)
                        bulge = ti.sin(3.14159265 * w) ** 2 * radius
                        y = ti.cos(angle) * rho * (radius - fine) + (_hash(row * 64 + j, b) - 0.5) * 0.7 * bulge
                        z = ti.sin(angle) * rho * (radius - fine) + (_hash(row * 64 + j, b + 7919) - 0.5) * 0.7 * bulge
                        here += parted[i] * (y * normal + z * side)
                        r = radius + parted[i] * (fine - radius)
                        outward = (normal + parted[i] * 0.6 * (y * normal + z * side) / radius).normalized()
                        tone *= 1.0 + parted[i] * 0.12 * (_hash(row * 64 + j, yarn + 31) - 0.5)
                        far = parted[i]
                    for c in ti.static(range(3)):
                        pieces_out[q, c] = here[c]
                        pieces_out[q, 4 + c] = thread_colour[yarn, c] * tone
                        pieces_out[q, 7 + c] = d[c]
                        pieces_out[q, 10 + c] = outward[c]
                    pieces_out[q, 3] = r
                    pieces_out[q, 13] = particle[t, 11]
                    pieces_out[q, 14] = particle[t, 12]
                    pieces_out[q, 15] = u * periods + _hash(row * 64 + j, yarn + 101)
                    pieces_out[q, 16] = pitch[b] / periods
                    pieces_out[q, 17] = 6.2831853 * _hash(row * 64 + j, yarn + 57)
                    pieces_out[q, 18] = 1.0 if is_core else 0.0
                    pieces_out[q, 19] = far
                    pieces_out[q, 20] = count if is_core and m % steps[b] > 0 else 0
                    pieces_out[q, 21] = count if is_core and m % steps[b] < steps[b] - 1 else 0
                    q += 1
                m += 1


@ti.kernel
def _place(
    pieces: F32x2,
    view: F32x2,
    # out
    boxes_out: ti.types.ndarray(ti.i16, 2),  # pyright: ignore
    counts_out: I32x1,
    depth_out: F32x1,
    grid_out: ti.types.ndarray(ti.i32, 2),  # pyright: ignore
):
    """As `streaming.survey`, for pieces; grid_out: points along a piece and around it, 0 for one splat."""
    for q in range(pieces.shape[0]):
        at = _row(pieces, q)
        x = _row(view, 0).dot(at) + view[3, 0]
        y = _row(view, 1).dot(at) + view[3, 1]
        z = _row(view, 2).dot(at) + view[3, 2]
        r = ti.max(pieces[q, 13], 2.2 * pieces[q, 3])
        left, right, top, bottom = 1, 0, 1, 0
        along, around, count = 0, 0, 0
        if z > view[5, 2] + r:
            scale = view[4, 0] / z
            u, v = x / z, y / z
            grown = view[4, 0] * r / (z - r)
            wide = grown * ti.sqrt(1.0 + u * u) + 2.0
            high = grown * ti.sqrt(1.0 + v * v) + 2.0
            cx = u * view[4, 0] + view[4, 1]
            cy = v * view[4, 0] + view[4, 2]
            left = ti.cast(ti.floor(ti.max(cx - wide, 0.0) / TILE), ti.i32)
            top = ti.cast(ti.floor(ti.max(cy - high, 0.0) / TILE), ti.i32)
            right = ti.cast(ti.floor(ti.min(cx + wide, view[5, 0] - 1) / TILE), ti.i32)
            bottom = ti.cast(ti.floor(ti.min(cy + high, view[5, 1] - 1) / TILE), ti.i32)
            if left <= right and top <= bottom:
                count = 1
                radius = pieces[q, 3] * scale
                if pieces[q, 18] > 0 and radius > SURFACE[0] and pieces[q, 19] > 0.5:
                    # What is much nearer than the rest gets fewer points, not a multitude.
                    scale = ti.min(scale, view[4, 0] / (2.0 * view[5, 2]))
                    radius = pieces[q, 3] * scale
                    along = ti.cast(ti.ceil(pieces[q, 13] * scale * 2.0 / 3.0 / SPACING), ti.i32) + 1
                    around = ti.cast(ti.ceil(ARC * radius / SPACING), ti.i32) + 1
                    along, around = ti.min(along, 256), ti.min(around, 1024)
                    count = along * around
        if count == 0:
            left, right, top, bottom = 1, 0, 1, 0
        boxes_out[q, 0] = ti.cast(left, ti.i16)
        boxes_out[q, 1] = ti.cast(right, ti.i16)
        boxes_out[q, 2] = ti.cast(top, ti.i16)
        boxes_out[q, 3] = ti.cast(bottom, ti.i16)
        counts_out[q] = count
        depth_out[q] = z
        grid_out[q, 0] = along
        grid_out[q, 1] = around


@ti.func
def _side(pieces: F32x2, i):
    return ti.Vector([pieces[i, 10], pieces[i, 11], pieces[i, 12]])


@ti.func
def _height(skin: F32x2, s, angle):
    """The skin at s periods along and an angle [rad], bilinear, both ways round."""
    rows, columns = skin.shape[0], skin.shape[1]
    a = (s - ti.floor(s)) * rows
    turn = angle / 6.283185307179586
    c = (turn - ti.floor(turn)) * columns
    i, j = ti.cast(a, ti.i32), ti.cast(c, ti.i32)
    f, g = a - i, c - j
    i0, j0 = i % rows, j % columns
    i1, j1 = (i + 1) % rows, (j + 1) % columns
    return (skin[i0, j0] * (1 - g) + skin[i0, j1] * g) * (1 - f) + (skin[i1, j0] * (1 - g) + skin[i1, j1] * g) * f


@ti.kernel
def _surface(
    chunks: Int,
    ids: I32x1,
    starts: I32x1,
    pieces: F32x2,
    grid: ti.types.ndarray(ti.i32, 2),  # pyright: ignore
    view: F32x2,
    skin: F32x2,
    # out
    blocks_out: F32x3,
):
    """A piece as one splat, or as points on its skin: with ρ(s, θ) the height map over the mean radius r and e the
    unit vector from the axis, points a + r ρ e with normals e − ρ_θ/ρ e_θ − r ρ_s t."""
    for step in range(chunks * 1024):
        if step % 1024 != 0:
            continue
        chunk = step // 1024
        total = ti.cast(ids.shape[0], ti.i64)
        for i in range(ti.cast(total * chunk // chunks, ti.i32), ti.cast(total * (chunk + 1) // chunks, ti.i32)):
            p = ids[i]
            q = starts[i]
            if grid[p, 0] == 0:
                for c in ti.static(range(ROWS)):
                    blocks_out[q // LANES, c, q % LANES] = pieces[p, c]
            else:
                at = _row(pieces, p)
                before = p - ti.cast(pieces[p, 20], ti.i32)
                after = p + ti.cast(pieces[p, 21], ti.i32)
                x0, x2 = _row(pieces, before), _row(pieces, after)
                n0, n1, n2 = _side(pieces, before), _side(pieces, p), _side(pieces, after)
                s0, s1, s2 = pieces[before, 15], pieces[p, 15], pieces[after, 15]
                if before == p:  # the fibre goes straight on into the next block
                    x0, s0 = 2.0 * at - x2, 2.0 * s1 - s2
                if after == p:
                    x2, s2 = 2.0 * at - x0, 2.0 * s1 - s0
                radius = pieces[p, 3]
                toward = _row(view, 6) - at
                z = _row(view, 2).dot(at) + view[3, 2]
                scale = view[4, 0] / z
                shown = ti.math.clamp((radius * scale - SURFACE[0]) / (SURFACE[1] - SURFACE[0]), 0.0, 1.0)
                shown = shown * shown * (3.0 - 2.0 * shown)
                along, around = grid[p, 0], grid[p, 1]
                period = pieces[p, 16]
                gap = 0.5 * (x2 - x0).norm() / along
                for a in range(along):
                    # The course between the middles of neighbours: the uniform quadratic B-spline.
                    t = (a + 0.5) / along - 0.5
                    w0, w1, w2 = 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2
                    middle = w0 * x0 + w1 * at + w2 * x2
                    d = ((t - 0.5) * x0 - 2.0 * t * at + (t + 0.5) * x2).normalized()
                    outward = w0 * n0 + w1 * n1 + w2 * n2
                    outward = (outward - d * outward.dot(d)).normalized()
                    side = d.cross(outward)
                    front = ti.atan2(toward.dot(side), toward.dot(outward))
                    s = w0 * s0 + w1 * s1 + w2 * s2
                    for k in range(around):
                        angle = front + ((k + 0.5) / around - 0.5) * ARC
                        e = ti.cos(angle) * outward + ti.sin(angle) * side
                        f = ti.cos(angle) * side - ti.sin(angle) * outward
                        turn = angle + pieces[p, 17]
                        rho = 1.0 + shown * (_height(skin, s, turn) - 1.0)
                        by_angle = shown * (_height(skin, s, turn + 0.06) - _height(skin, s, turn - 0.06)) / 0.12
                        step_s = 0.008
                        by_length = shown * (_height(skin, s + step_s, turn) - _height(skin, s - step_s, turn))
                        by_length *= radius / (2.0 * step_s * period)
                        n = (e - by_angle / rho * f - by_length * d).normalized()
                        n = (n * (0.6 + 0.9 * shown) + outward * (1.0 - 0.55 * shown)).normalized()
                        x = middle + radius * rho * e
                        block, lane = q // LANES, q % LANES
                        for c in ti.static(range(3)):
                            blocks_out[block, c, lane] = x[c]
                            blocks_out[block, 4 + c, lane] = pieces[p, 4 + c]
                            blocks_out[block, 7 + c, lane] = d[c]
                            blocks_out[block, 10 + c, lane] = n[c]
                        width = ti.sqrt(rho * rho + by_angle * by_angle) * radius * ARC / around
                        blocks_out[block, 3, lane] = 0.8 * width
                        blocks_out[block, 13, lane] = ti.max(1.5 * gap, 0.8 * width)
                        blocks_out[block, 14, lane] = pieces[p, 14]
                        q += 1
