"""Fibres that follow key points, frame by frame (paper 3.3, Steps 4–6): positions, tangents and normals in one pass.

What never changes (colour, radius, half length, openness) is written once. Every frame, a small pass finds the
cloth's frame at each key point and one pass over the fibre blocks moves all particles. Rules, with s the ratio of a
particle along its block, t its offset and F the cloth's frame (along the yarn, across it, normal):

    "paper"    x = s·P + (1 − s)·P' + t         t constant in the world's axes, those of the cloth at rest
    "linear"   x = s·P + (1 − s)·P' + F(s)·t    F blended between the key points
    "smooth"   x = H(s) + F(s)·t                H the cubic through both key points along the cloth's direction there

With the paper's rule a cloth that turns loses its thickness and its relief. With "smooth" a yarn has no corner at a
key point: H leaves P in the direction d of the yarn there, at the speed of the chord, H' = |P' − P| d, so that on a
straight yarn it is the straight line whatever the spacing. Tangents and normals follow F by every rule.

The particles lie as the splatter reads them: groups of 16, each property by itself. A fibre block fills octets, half
groups (see `octets`); places left over in them have a radius of 0. They are held in a field, because LLVM makes no
vector instructions of stores to an array argument (six times as slow); `groups` is a view of it.

Most of the time is spent waiting for memory, so where things lie matters more than how much is computed: properties
that move side by side with those that do not cost half as much again, and so did rows that straddle cache lines.
"""

import ctypes
from typing import Any, get_args

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.follow_rule import FollowRule
from taichi_cloth.fabric.frames import frame_of_point
from taichi_cloth.fabric.octets import octets_of
from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x3, I64x1, Int, Template
from taichi_cloth.ground.copies import DeviceArray, copy_in, copy_out, fetched, put
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.particles import (
    COLOUR,
    HALF_LENGTH,
    LANES,
    NORMAL,
    OCTET,
    OPENNESS,
    POSITION,
    RADIUS,
    ROWS,
    TANGENT,
    FibreCloud,
)

__all__ = ["FibreFollower"]

F32 = NDArray[np.float32]

MOVING = ("offset", "tangent", "normal")
"""What of a template turns with the cloth."""
MOVED = 9
"""Numbers a particle in `MOVING`."""
FRAME = 12
"""Numbers a key point: place [m], unit direction of the weft, of the warp, unit normal."""
BLOCK = 6
"""Numbers a fibre block: both key points, column of its direction in FRAME, first and last run of its template, and
how many octets its particles stand behind its template."""
SIZE = 3
"""And how long it is [m], and how wide its thread is over its mean at both ends."""
LINE = 16  # numbers in a cache line: whatever is read or written eight at a time begins at one


@ti.data_oriented
class FibreFollower:
    """The fibre particles of a fabric on a grid of key points, moved in place. Made after Taichi was started.

    present: bool (picks, ends), key points that exist; fibre blocks that need another are left out.
    spans: (blocks, 2) from and to, as shares of each block, where its fibres are drawn, from > to for none; None: all.
    rest: key points (picks, ends, 3) [m] in whose axes the paper's rule keeps the offsets; only "paper" needs it.
    shades: (blocks, 3) linear colours instead of the thread's, NaN where that stays; None: the threads'.
    others: particles that somebody else places, such as stitches: the last groups, in `others`, are theirs.
    Raises InputError on an unknown rule, arrays of the wrong shape, or a mask that leaves no block.
    """

    def __init__(
        self,
        fabric: Fabric,
        *,
        present: ArrayLike | None = None,
        spans: NDArray | None = None,
        rule: FollowRule = "smooth",
        rest: NDArray | None = None,
        shades: F32 | None = None,
        others: int = 0,
    ) -> None:
        rules = get_args(FollowRule)
        if rule not in rules:
            raise InputError(f"rule: unknown rule {rule!r}; known: {', '.join(rules)}{did_you_mean(rule, rules)}")
        self.fabric, self.rule = fabric, rule
        self.shape: tuple[int, int] = fabric.layout.cloth.warp_up.shape
        mask = np.ones(self.shape, bool) if present is None else np.asarray(present, bool)
        if mask.shape != self.shape:
            raise InputError(f"present: shape {mask.shape}; allowed: {self.shape}, one for each crossing")
        layout, bank, blocks = fabric.layout, fabric.bank, fabric.layout.blocks
        self.kept = _kept(fabric, mask, spans)
        """Numbers of the fibre blocks there are, of those of the layout."""
        if not len(self.kept):
            raise InputError("present: no two neighbouring key points; allowed: a mask with cloth in it")
        template, kind = bank.template[self.kept], blocks.kind[self.kept]
        octets = octets_of(bank)
        count = np.diff(octets.octet)[template]
        first = np.cumsum(count) - count
        record = (
            blocks.key0[self.kept],
            blocks.key1[self.kept],
            6 - 3 * layout.kinds.family[kind],
            octets.run[template],
            octets.run[template + 1],
            first - octets.octet[template],
        )
        slots = OCTET * int(count.sum())
        self._own = -(-slots // LANES)
        self.slots = (self._own - (-others // LANES)) * LANES
        self._spare = self._own * LANES - slots
        self._stays = runtime.resident() and not others
        self._allocate(mask.size, len(self.kept), octets.ratio.size, octets.source.size)
        self._fill(self._present, mask)
        self._fill(self._record, np.stack(record, axis=1))
        wide = blocks.wide[self.kept]
        self._fill(self._size, np.column_stack([layout.kinds.pitch[kind], wide]))
        self._fill(self._start, octets.start)
        self._fill(self._ratio, octets.ratio)
        columns = np.column_stack([getattr(bank, name) for name in MOVING])
        self._fill(self._bank, columns[octets.source].transpose(0, 2, 1))

        of_block, particle, drawn = _placed(fabric, self.kept, spans)
        of_block, particle = of_block[drawn], particle[drawn]
        self.particle_slots = OCTET * first[of_block] + octets.place[particle]
        """Where the particles are, in the order of the blocks, (particles,) of the slots."""
        self.threads = blocks.thread[self.kept][of_block].astype(np.int32)
        """Thread of each particle, warp ends first, (particles,)."""
        colour = fabric.thread_colour[blocks.thread[self.kept]]
        if shades is not None:
            colour = np.where(np.isnan(shades[self.kept]), colour, shades[self.kept])
        shade = colour[of_block] * bank.tone[particle][:, None]
        still = {RADIUS: bank.radius, HALF_LENGTH: bank.half_length, OPENNESS: bank.openness}
        rows = {row: values[particle] for row, values in still.items()}
        u = np.clip(bank.u[particle], 0.0, 1.0)
        thick = wide[of_block, 0] + u * (wide[of_block, 1] - wide[of_block, 0])
        rows[RADIUS] = (rows[RADIUS] * thick).astype(np.float32)
        rows |= {COLOUR + c: shade[:, c] for c in range(3)}
        still_groups = np.zeros(self.groups.shape, np.float32) if self._stays else self.groups
        for row, values in rows.items():
            still_groups[row].reshape(-1)[self.particle_slots] = values
        if self._stays:
            put(self.groups, still_groups)
        if rule == "paper":
            if rest is None:
                raise InputError('rest: missing; the rule "paper" keeps offsets in the axes of the cloth at rest')
            self._key_frames(self._checked(rest), self._rest)

    def _allocate(self, keys: int, blocks: int, ratios: int, places: int) -> None:
        """Fields, in one tree, and the view of the particles among them."""

        def field(dtype: Any, size: int) -> Any:
            return ti.field(dtype, -(-size // LINE) * LINE)

        self._frames = field(ti.f32, keys * FRAME)
        self._rest = field(ti.f32, keys * FRAME) if self.rule == "paper" else self._frames
        self._present = field(ti.i32, keys)
        self._record = field(ti.i32, blocks * BLOCK)
        self._size = field(ti.f32, blocks * SIZE)
        self._start = field(ti.i32, ratios // OCTET + 1)
        self._ratio = field(ti.f32, ratios)
        self._bank = field(ti.f32, places * MOVED)
        self._out = field(ti.f32, ROWS * self.slots)
        self._blocks = blocks
        self._filled = (self._present, self._record, self._size, self._start, self._ratio, self._bank, self._out)
        shape = (ROWS, self.slots // LANES, LANES)
        self._in_place = runtime.on_host()
        if self._in_place or self._stays:
            self._address = np.zeros(len(self._filled), np.int64)
            self._locate(self._address)
        if self._in_place:
            self.groups: F32 = self._seen(self._out)[: ROWS * self.slots].reshape(shape)
        elif self._stays:
            self.groups = DeviceArray.at(int(self._address[-1]), shape, np.float32, self._out)
        else:
            self.groups = np.zeros(shape, np.float32)
        """All particles as the splatter's blocks, (ROWS, slots / 16, 16), on CUDA's devices there; valid until Taichi
        starts again."""

    @ti.kernel
    def _locate(self, address_out: I64x1):
        for k in ti.static(range(len(self._filled))):
            address_out[k] = ti.cast(ti.get_addr(self._filled[k], [0]), ti.i64)

    def _seen(self, field: Any) -> NDArray[Any]:
        """A field's memory on the host: Taichi would compile a copy for each field that is filled."""
        number = next(k for k, own in enumerate(self._filled) if own is field)
        kind = ctypes.c_int32 if field.dtype == ti.i32 else ctypes.c_float
        return np.ctypeslib.as_array((kind * field.shape[0]).from_address(int(self._address[number])))

    def _fill(self, field: Any, values: NDArray) -> None:
        """Writes values to the beginning of a field."""
        if self._in_place:
            self._seen(field)[: values.size] = values.reshape(-1)
        else:
            copy_in(np.ascontiguousarray(values.reshape(-1), np.int32 if field.dtype == ti.i32 else np.float32), field)

    @property
    def particles(self) -> int:
        return len(self.particle_slots)

    @property
    def others(self) -> F32:
        """The groups that are not the fibres', (ROWS, n, 16)."""
        return self.groups[:, self._own :]

    @staticmethod
    def count(fabric: Fabric, *, present: ArrayLike | None = None, spans: NDArray | None = None) -> int:
        """How many `particles` there would be, without making them."""
        mask = np.ones(fabric.layout.cloth.warp_up.shape, bool) if present is None else np.asarray(present, bool)
        return int(_placed(fabric, _kept(fabric, mask, spans), spans)[2].sum())

    def follow(self, points: NDArray) -> F32:
        """Moves all particles to key points (picks, ends, 3) [m] and gives `groups`, the same array each time.

        Raises InputError when the grid is not the fabric's.
        """
        with runtime.plain_code():  # half the time to compile, and as fast a frame
            self._move(self._checked(points), self._blocks)
        if self._stays:
            if self._spare:
                self._gather_spare()
            return self.groups
        if not self._in_place:
            for row in (POSITION, TANGENT, NORMAL):
                copy_out(self._out, row * self.slots, self.groups[row : row + 3].reshape(-1))
        if self._spare:  # the octet that fills up the last group lies where something is
            last = self.groups[POSITION : POSITION + 3, self._own - 1]
            last[:, OCTET:] = last[:, OCTET - 1, None]
        return self.groups

    def cloud(self) -> FibreCloud:
        """The particles as they lie now, as separate arrays: a copy, in the order of the blocks."""
        rows = fetched(self.groups).reshape(ROWS, -1)[:, self.particle_slots]
        return FibreCloud.of_rows(rows)

    def _checked(self, points: NDArray) -> F32:
        if points.shape != (*self.shape, 3):
            raise InputError(f"points: shape {points.shape}; allowed: {(*self.shape, 3)}, the fabric's crossings")
        return np.ascontiguousarray(points, np.float32)

    @ti.kernel
    def _key_frames(self, point: F32x3, frames_out: Template):
        for k in range(point.shape[0] * point.shape[1]):
            self._key_frame(point, k, frames_out)

    @ti.kernel
    def _move(self, point: F32x3, blocks: Int):
        for k in range(point.shape[0] * point.shape[1]):
            self._key_frame(point, k, self._frames)
        for b in range(blocks):
            self._block(b)

    @ti.kernel
    def _gather_spare(self):
        """The octet that fills up the last group, to where something is."""
        for k in range(OCTET):
            for c in ti.static(range(3)):
                last = ti.static((POSITION + c) * self.slots + self._own * LANES - OCTET)
                self._out[last + k] = self._out[last - 1]

    @ti.func
    def _key_frame(self, point: F32x3, k, frames_out: Template):
        if self._present[k] != 0:
            here, weft, warp, normal = frame_of_point(point, self._present, k)
            for c in ti.static(range(3)):
                frames_out[k * FRAME + c] = here[c]
                frames_out[k * FRAME + 3 + c] = weft[c]
                frames_out[k * FRAME + 6 + c] = warp[c]
                frames_out[k * FRAME + 9 + c] = normal[c]

    @ti.func
    def _block(self, b):
        """One fibre block, 8 particles at a time, without a branch."""
        # Its ends: key points, the yarn's directions there, normals.
        k0, k1, along = self._record[b * BLOCK], self._record[b * BLOCK + 1], self._record[b * BLOCK + 2]
        p0, p1 = _triple(self._frames, k0 * FRAME), _triple(self._frames, k1 * FRAME)
        a0, a1 = _triple(self._frames, k0 * FRAME + along), _triple(self._frames, k1 * FRAME + along)
        n0, n1 = _triple(self._frames, k0 * FRAME + 9), _triple(self._frames, k1 * FRAME + 9)
        if k0 == k1:  # a free end runs on straight from its last crossing
            p1 = p0 + a0 * self._size[b * SIZE]
        chord = p1 - p0
        length = chord.norm()  # pyright: ignore[reportOptionalCall]
        m0, m1 = a0 * length - chord, a1 * length - chord
        behind = self._record[b * BLOCK + 5]
        wide, widens = self._size[b * SIZE + 1], self._size[b * SIZE + 2] - self._size[b * SIZE + 1]
        for run in range(self._record[b * BLOCK + 3], self._record[b * BLOCK + 4]):
            # The bounds tell the compiler that no index overflows, without which there are no vector instructions.
            u = _load(self._ratio, ti.min(ti.max(run, 0), 1 << 24) * OCTET)
            w = ti.min(ti.max(u, 0.0), 1.0)
            # The frame at the run's eight ratios, and the middle of the yarn there: along the straight line, …
            ax, ay, az, nx, ny, nz = _blended(a0, a1, n0, n1, w)
            cx, cy, cz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
            px, py, pz = p0[0] + chord[0] * u, p0[1] + chord[1] * u, p0[2] + chord[2] * u  # pyright: ignore[reportIndexIssue]
            if ti.static(self.rule == "smooth"):
                # … or H: less the straight line, w(1−w)² m0 − w²(1−w) m1; beyond its ends it runs on along the yarn.
                v = 1.0 - w
                h0, h1, beyond = w * v * v, w * w * v, u - w
                px += h0 * m0[0] - h1 * m1[0] + beyond * (length * ax - chord[0])  # pyright: ignore[reportIndexIssue]
                py += h0 * m0[1] - h1 * m1[1] + beyond * (length * ay - chord[1])  # pyright: ignore[reportIndexIssue]
                pz += h0 * m0[2] - h1 * m1[2] + beyond * (length * az - chord[2])  # pyright: ignore[reportIndexIssue]
            bx, by, bz, dx, dy, dz, rx, ry, rz = ax, ay, az, cx, cy, cz, nx, ny, nz  # the frame of the offsets
            if ti.static(self.rule == "paper"):
                b0, b1 = _triple(self._rest, k0 * FRAME + along), _triple(self._rest, k1 * FRAME + along)
                r0, r1 = _triple(self._rest, k0 * FRAME + 9), _triple(self._rest, k1 * FRAME + 9)
                bx, by, bz, rx, ry, rz = _blended(b0, b1, r0, r1, w)
                dx, dy, dz = ry * bz - rz * by, rz * bx - rx * bz, rx * by - ry * bx
            # All octets of the run: offsets, tangents and normals turned into that frame.
            for o in range(self._start[run], self._start[run + 1]):
                t = ti.min(ti.max(o, 0), 1 << 24) * (MOVED * OCTET)
                q = ti.min(ti.max(o + behind, 0), 1 << 24) * OCTET
                x, y, z = _load3(self._bank, t)
                y *= wide + widens * w
                self._store3(
                    POSITION,
                    q,
                    px + (x * bx + y * dx + z * rx),
                    py + (x * by + y * dy + z * ry),
                    pz + (x * bz + y * dz + z * rz),
                )
                for k in ti.static(range(2)):
                    x, y, z = _load3(self._bank, t + (3 + 3 * k) * OCTET)
                    self._store3(
                        TANGENT + 3 * k,
                        q,
                        x * ax + y * cx + z * nx,
                        x * ay + y * cy + z * ny,
                        x * az + y * cz + z * nz,
                    )

    @ti.func
    def _store3(self, row: Template, p, x, y, z):
        for k in ti.static(range(OCTET)):
            self._out[p + ti.static(row * self.slots) + k] = x[k]
        for k in ti.static(range(OCTET)):
            self._out[p + ti.static((row + 1) * self.slots) + k] = y[k]
        for k in ti.static(range(OCTET)):
            self._out[p + ti.static((row + 2) * self.slots) + k] = z[k]


def _kept(fabric: Fabric, present: NDArray[np.bool_], spans: NDArray | None) -> NDArray[np.int64]:
    """Numbers of the fibre blocks that have both key points and something to draw. Raises InputError."""
    bank, blocks = fabric.bank, fabric.layout.blocks
    size = np.diff(bank.start)
    kept = present.ravel()[blocks.key0] & present.ravel()[blocks.key1] & (size[bank.template] > 0)
    if spans is not None:
        if spans.shape != (len(kept), 2):
            raise InputError(f"spans: shape {spans.shape}; allowed: {(len(kept), 2)}, a row a block")
        kept &= spans[:, 1] > spans[:, 0]
    return np.flatnonzero(kept)


def _placed(
    fabric: Fabric, kept: NDArray[np.int64], spans: NDArray | None
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """For each particle of some blocks: number of the block among them, of the particle in the bank, and whether it is
    drawn."""
    bank = fabric.bank
    template = bank.template[kept]
    count = np.diff(bank.start)[template]
    of_block = np.repeat(np.arange(len(kept)), count)
    particle = np.arange(len(of_block)) - (np.cumsum(count) - count - bank.start[template])[of_block]
    drawn = np.ones(len(of_block), bool)
    if spans is not None:  # a whole block keeps the hairs that reach beyond its ends
        low, high = spans[kept].T
        low, high = np.where(low <= 0, -np.inf, low)[of_block], np.where(high >= 1, np.inf, high)[of_block]
        drawn = (bank.u[particle] >= low) & (bank.u[particle] <= high)
    return of_block, particle, drawn


@ti.func
def _load(field: Template, p):
    return ti.Vector([field[p + k] for k in ti.static(range(OCTET))])


@ti.func
def _load3(field: Template, p):
    return _load(field, p), _load(field, p + OCTET), _load(field, p + 2 * OCTET)


@ti.func
def _triple(field: Template, p):
    return ti.Vector([field[p], field[p + 1], field[p + 2]])


@ti.func
def _blended(a0, a1, n0, n1, w):
    """The cloth's frame at the shares w of a block, 8 lanes: along the yarn and normal, orthonormal."""
    d, n = a1 - a0, n1 - n0
    ax, ay, az = a0[0] + d[0] * w, a0[1] + d[1] * w, a0[2] + d[2] * w
    scale = 1.0 / ti.sqrt(ti.max(ax * ax + ay * ay + az * az, 1e-30))
    ax, ay, az = ax * scale, ay * scale, az * scale
    nx, ny, nz = n0[0] + n[0] * w, n0[1] + n[1] * w, n0[2] + n[2] * w
    lean = ax * nx + ay * ny + az * nz
    nx, ny, nz = nx - lean * ax, ny - lean * ay, nz - lean * az
    scale = 1.0 / ti.sqrt(ti.max(nx * nx + ny * ny + nz * nz, 1e-30))
    return ax, ay, az, nx * scale, ny * scale, nz * scale
