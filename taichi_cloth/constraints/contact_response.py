"""How key points answer a body, after every substep: by the planes that looking has left them (`contact_planes.py`).

Those that stand deeper than the gap are pushed out along the normal and held by friction. A plane moves with its
primitive.
"""

import taichi as ti

from taichi_cloth.constraints.contact_entries import ENTRY, GAP, OFFSET, RUBS
from taichi_cloth.constraints.contact_planes import SLOTS, Planes
from taichi_cloth.ground.arrays import Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.motion.stencil import load, load_xyz, rub_anew, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Response"]

SUMS = 5
"""Numbers of what an entry has done in a substep, for each key point: its push, what of it pressed, friction [m]."""


@ti.data_oriented
class Response(Planes):
    """What the kernel works on, for padded grids of up to `size` key points."""

    def __init__(
        self,
        size: int,
        capacity: int,
        kinds: tuple[int, ...],
        long_steps: bool,
        nodes: int,
        parts: int = PARTS,
        line: int = LINE,
    ) -> None:
        super().__init__(size, capacity, kinds, long_steps, nodes, parts, line)
        self.sum = ti.field(ti.f32, size * SLOTS * SUMS)

    @routine
    def touch(self, points: Template, part: Int, first: Int, last: Int, done: Int):
        """Response of a part, packets number `first` to `last`, to the body at the end of substep `done`."""
        since = done % int(self.every[None])
        if since == 0:
            self.look_all(points, part, first, last, done)
        self.respond_all(points, part, first, since, 0)

    @ti.func
    def touch_again(self, points: Template, part, first, done):
        """`touch` once more in a substep, after others have moved key points."""
        self.respond_all(points, part, first, done % int(self.every[None]), 1)

    @routine
    def respond_all(self, points: Template, part: Int, first: Int, since: Int, again: Int):
        """Of all entries of a part; arguments as of `respond`."""
        for e in range(first * SLOTS, self.entries[part * self.line]):
            self.respond(points, e, float(since), float(again))

    @ti.func
    def respond(self, points: Template, e, since, again):
        """Straight-line code that ends in stores: that is what makes it vector code. since: substeps since the poses
        were worked out; anchors go on straight, normals turn to first order."""
        # Where the surface is by now, c, and how far it has turned, t; places p and steps d of the lanes.
        a = points.lanes(self.entry_block[e] * LANES)
        o = self.lanes_of(e, ENTRY)
        i = self.entry_of[e]
        shift, turn = self.shift(i), self.turn(i)
        c, t = self.anchor(i) + since * shift, since * turn
        px, py, pz = load_xyz(points.position, a)
        dx, dy, dz = load_xyz(points.step, a)
        # The plane, turned: normal n, and how far the key points are from it.
        ax, ay, az = load(self.entry, o), load(self.entry, o + LANES), load(self.entry, o + 2 * LANES)
        nx, ny, nz = ax + t[1] * az - t[2] * ay, ay + t[2] * ax - t[0] * az, az + t[0] * ay - t[1] * ax
        x, y, z = px - c[0], py - c[1], pz - c[2]
        d, gap = nx * x + ny * y + nz * z - load(self.entry, o + OFFSET), load(self.entry, o + GAP)
        rubs = load(self.entry, o + RUBS)
        # The slip (u, v, w): the step less that of the surface there.
        u, v, w = dx - shift[0], dy - shift[1], dz - shift[2]
        x, y, z = x - 0.5 * u, y - 0.5 * v, z - 0.5 * w  # half-way along the step
        u, v, w = (
            u - turn[1] * z + turn[2] * y,
            v - turn[2] * x + turn[0] * z,
            w - turn[0] * y + turn[1] * x,
        )
        if ti.static(points.sums):
            self.respond_anew(points, a, self.lanes_of(e, SUMS), again, gap - d, rubs, nx, ny, nz, u, v, w)
        else:
            # The push takes the approach whole, and of what was deep before `recovery`.
            depth = ti.max(gap - d, 0.0)
            approach = ti.max(-(u * nx + v * ny + w * nz), 0.0)
            push = ti.min(depth, approach + self.recovery[None])
            pressed = ti.min(push, approach)
            out = push - pressed  # of what was deep before, and is no speed
            x, y, z = self.change(u, v, w, nx, ny, nz, push, pressed, rubs)
            store(points.position[0], a, px + x)
            store(points.position[1], a, py + y)
            store(points.position[2], a, pz + z)
            store(points.step[0], a, dx + x - out * nx)
            store(points.step[1], a, dy + y - out * ny)
            store(points.step[2], a, dz + z - out * nz)

    @ti.func
    def respond_anew(self, points: Template, a, o, again, depth, rubs, nx, ny, nz, u, v, w):
        """The same where it is asked several times in a substep: what the plane has pushed, pressed and rubbed in it so
        far, from o of `sum` on, may grow or be taken back. again: 0 the first time in a substep, then 1. depth: how far
        they are inside what the plane keeps free [m]. rubs: µ."""
        # What it has done so far: the push, what of it pressed, and friction [m].
        had, held = again * load(self.sum, o), again * load(self.sum, o + LANES)
        fx, fy, fz = load(self.sum, o + 2 * LANES), load(self.sum, o + 3 * LANES), load(self.sum, o + 4 * LANES)
        fx, fy, fz = again * fx, again * fy, again * fz
        # The push that keeps key points out, and of it what presses: what was deep before is let out slowly.
        along = u * nx + v * ny + w * nz
        approach = ti.max(held - along, 0.0)
        push = ti.min(ti.max(had + depth, 0.0), approach + self.recovery[None])
        pressed = ti.min(push, approach)
        gx, gy, gz = rub_anew(nx, ny, nz, pressed, rubs, u, v, w, fx, fy, fz)
        store(self.sum, o, push)
        store(self.sum, o + LANES, pressed)
        store(self.sum, o + 2 * LANES, gx)
        store(self.sum, o + 3 * LANES, gy)
        store(self.sum, o + 4 * LANES, gz)
        out, slow = push - had, pressed - held
        for axis, n, f in ti.static(((0, nx, gx - fx), (1, ny, gy - fy), (2, nz, gz - fz))):
            store(points.position[axis], a, load(points.position[axis], a) + out * n + f)
            store(points.step[axis], a, load(points.step[axis], a) + slow * n + f)
