"""What `contact.Contact` runs inside the frame's kernel, for 8 neighbouring key points at once, a block.

Four stages, ever more often and ever cheaper: a block's list of primitives from the tree (`walk`); exact distances to
those of the list that could be met before the next time (`measure`), which leave a plane for each key point, moving as
the surface under it does; and after every substep the response to the planes (`respond`). A plane is off by s²/2R where
a key point slides by s over a surface of radius R before the next: 3 µm at 1 m/s on a limb of 40 mm.

Rows of numbers a primitive come from the host once a frame. A strip of the sheet has its own poses, lists and planes,
so that strips on several threads share nothing they write.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportArgumentType=false, reportOptionalSubscript=false, reportIndexIssue=false
# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false

from functools import lru_cache

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.arrays import F32x2, Template
from taichi_cloth.body.shapes import EVERYWHERE, NEAR, cone, ellipse, local, prism
from taichi_cloth.sheet import LANES, PAD
from taichi_cloth.solvers.passes import MEETING
from taichi_cloth.solvers.stencil import load, store

__all__ = ["BONE", "BOX", "CONE", "ELLIPTIC", "GRID", "MOTION", "ROW", "SHAPE", "SLENDER", "Response", "response"]

CONE, ELLIPTIC, SLENDER, GRID = 0, 1, 2, 3

SHAPE, MOTION, BOX, BONE, ROW = 8, 18, 6, 32, 40
"""Numbers of a primitive: kind, 6 of its shape; motion and the capsule around it (see `Contact.begin`); box; bone; with
room to spare."""

POSE = 12  # anchor, axis, across, other
SLOTS = 4  # planes a block may have for each key point; of more than that the nearest stay
PLANE = 7  # normal, offset, step of the surface [m]
SCRATCH = 10
GROWTH = 1.25  # of the approach to a surface until the next look at it
TURNING = 0.25  # share of the slip that may become approach meanwhile


@lru_cache(maxsize=16)
def response(
    generation: int,
    size: int,
    strips: int,
    capacity: int,
    kinds: tuple[int, ...],
    long_steps: bool,
    nodes: int,
    sparing: bool,
):
    """Fields and functions for grids and bodies of that size. generation: of the Taichi runtime."""
    return Response(size, strips, capacity, kinds, long_steps, nodes, sparing)


@ti.data_oriented
class Response:
    """What the kernel works on. sparing: whether some key points do not meet all bones."""

    def __init__(
        self,
        size: int,
        strips: int,
        capacity: int,
        kinds: tuple[int, ...],
        long_steps: bool,
        nodes: int,
        sparing: bool,
    ) -> None:
        self.nodes = ti.field(ti.f32, max(1, nodes))
        self.sparing = sparing
        self.spared = ti.field(ti.i32, size if sparing else 1)
        self.holder: object = None
        self.capacity, self.kinds, self.long_steps = capacity, kinds, long_steps
        self.strip_size, blocks = size // strips, size // LANES
        self.buffer = ti.ndarray(ti.f32, (3 * capacity + 1, ROW))
        self.row = ti.field(ti.f32, capacity * ROW)
        self.setting = ti.field(ti.f32, ROW)
        self.skip = ti.field(ti.i32, 2 * capacity)
        self.leaf = ti.field(ti.i32, 2 * capacity)
        self.box = ti.field(ti.f32, 2 * capacity * BOX)
        self.pose = ti.field(ti.f32, strips * capacity * POSE)
        self.scratch = ti.field(ti.f32, strips * SCRATCH * LANES)
        self.count = ti.field(ti.i32, blocks)
        self.list, self.due = ti.field(ti.i32, blocks * capacity), ti.field(ti.i32, blocks * capacity)
        self.planes = ti.field(ti.i32, strips)
        self.plane_block, self.plane_of = ti.field(ti.i32, blocks * SLOTS + 1), ti.field(ti.i32, blocks * SLOTS + 1)
        self.plane = ti.field(ti.f32, (blocks * SLOTS + 1) * PLANE * LANES)

    def spare(self, bits: NDArray[np.int32], padded_shape: tuple[int, ...]) -> None:
        """Takes the bits of `Colliders.spared` (rows, cols), into every strip of the padded grid."""
        padded = np.full(padded_shape, -1, np.int32)
        padded[PAD : PAD + bits.shape[0], : bits.shape[1]] = bits
        self.spared.from_numpy(np.tile(padded.ravel(), self.spared.shape[0] // padded.size))

    @ti.kernel
    def take(self, rows: F32x2):
        """A frame's rows of `Contact.begin`; boxes of the tree from its leaves up."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            for k in range(ROW):
                self.setting[k] = rows[3 * self.capacity, k]
            for i in range(self.capacity):
                for k in range(ROW):
                    self.row[i * ROW + k] = rows[i, k]
            nodes = int(self.setting[10])
            for back in range(nodes):
                node = nodes - 1 - back
                self.skip[node] = int(rows[self.capacity + node, 0])
                leaf = int(rows[self.capacity + node, 1])
                self.leaf[node] = leaf
                for k in range(BOX):
                    if leaf >= 0:
                        self.box[node * BOX + k] = rows[leaf, SHAPE + MOTION + k]
                    else:
                        one = self.box[(node + 1) * BOX + k]
                        two = self.box[self.skip[node + 1] * BOX + k]
                        self.box[node * BOX + k] = ti.min(one, two) if k < 3 else ti.max(one, two)

    @ti.func
    def vector(self, i, k: Template):
        return ti.Vector([self.row[i * ROW + k], self.row[i * ROW + k + 1], self.row[i * ROW + k + 2]])

    @ti.func
    def posed(self, p, k: Template):
        return ti.Vector([self.pose[p * POSE + k], self.pose[p * POSE + k + 1], self.pose[p * POSE + k + 2]])

    @ti.func
    def follow(self, strip, done):
        """Poses at the end of substep `done`: anchors on a line, axes turned about one vector (Rodrigues)."""
        for i in range(int(self.setting[0])):
            anchor = self.vector(i, SHAPE) + (done + 1.0) * self.vector(i, SHAPE + 9)
            turn = (done + 1.0) * self.vector(i, SHAPE + 12)
            angle = turn.norm()
            axis, across = self.vector(i, SHAPE + 3), self.vector(i, SHAPE + 6)
            if angle > 0.0:
                about, cosine, sine = turn / angle, ti.cos(angle), ti.sin(angle)
                axis = cosine * axis + sine * about.cross(axis) + (1.0 - cosine) * about.dot(axis) * about
                across = cosine * across + sine * about.cross(across) + (1.0 - cosine) * about.dot(across) * about
            other = axis.cross(across)
            p = strip * self.capacity + i
            for k in ti.static(range(3)):
                self.pose[p * POSE + k] = anchor[k]
                self.pose[p * POSE + 3 + k] = axis[k]
                self.pose[p * POSE + 6 + k] = across[k]
                self.pose[p * POSE + 9 + k] = other[k]

    @ti.func
    def measure(self, i, p, q, x, y, z):
        """Signed distance [m] and normal of primitive i, at pose p, at points relative to its anchor, into the scratch
        lanes q, q + 1, q + 2 and q + 3. Lanes are stored half-way: what ends in stores becomes vector code."""
        row = i * ROW
        axis, across, other = self.posed(p, 3), self.posed(p, 6), self.posed(p, 9)
        one, two, three, four = self.row[row + 1], self.row[row + 2], self.row[row + 3], self.row[row + 4]
        kind = int(self.row[row])
        for k in ti.static(self.kinds):
            if kind == k:
                if ti.static(k == CONE):
                    d, nx, ny, nz = cone(x, y, z, axis, across, one, two, three, four)
                    self.keep(q, d, nx, ny, nz)
                else:
                    along, px, py = local(x, y, z, axis), local(x, y, z, across), local(x, y, z, other)
                    self.keep(q + 4 * LANES, along, px, py, py)
                    if ti.static(k == GRID):
                        for lane in range(q + 4 * LANES, q + 5 * LANES):
                            along1, px1 = self.scratch[lane], self.scratch[lane + LANES]
                            d1, u1, v1, w1 = self.sample(i, px1, self.scratch[lane + 2 * LANES], along1)
                            for m, value in ti.static(enumerate((d1, u1, v1, w1))):
                                self.scratch[lane + (m - 4) * LANES] = value
                    else:
                        flank, nu, nv = ellipse(px, py, one, two, ti.static(NEAR if k == ELLIPTIC else EVERYWHERE))
                        self.keep(q + 4 * LANES, flank, nu, nv, along)
                        d, nu, nv, end = prism(flank, nu, nv, along, three, four)
                        self.keep(q, d, nu, nv, end)
        if kind != CONE:
            nu, nv, end = (
                load(self.scratch, q + LANES),
                load(self.scratch, q + 2 * LANES),
                load(self.scratch, q + 3 * LANES),
            )
            store(self.scratch, q + LANES, nu * across[0] + nv * other[0] + end * axis[0])
            store(self.scratch, q + 2 * LANES, nu * across[1] + nv * other[1] + end * axis[1])
            store(self.scratch, q + 3 * LANES, nu * across[2] + nv * other[2] + end * axis[2])

    @ti.func
    def keep(self, q, one, two, three, four):
        store(self.scratch, q, one)
        store(self.scratch, q + LANES, two)
        store(self.scratch, q + 2 * LANES, three)
        store(self.scratch, q + 3 * LANES, four)

    @ti.func
    def sample(self, i, x, y, z):
        """Trilinear distance [m] and unit gradient at a point relative to the middle of grid i; beyond it, the way to
        it is added."""
        row = i * ROW
        begin, spacing = int(self.row[row + 1]), self.row[row + 2]
        count = ti.Vector([int(self.row[row + 3]), int(self.row[row + 4]), int(self.row[row + 5])])
        top = ti.cast(count - 1, ti.f32)
        place = ti.Vector([x, y, z]) / spacing + 0.5 * top
        inside = ti.min(ti.max(place, 0.0), top)
        cell = ti.min(ti.cast(inside, ti.i32), count - 2)
        f = inside - ti.cast(cell, ti.f32)
        value, slope = 0.0, ti.Vector([0.0, 0.0, 0.0])
        for a, b, c in ti.static(ti.ndrange(2, 2, 2)):
            here = self.nodes[begin + ((cell[0] + a) * count[1] + cell[1] + b) * count[2] + cell[2] + c]
            u = f[0] if ti.static(a == 1) else 1.0 - f[0]
            v = f[1] if ti.static(b == 1) else 1.0 - f[1]
            w = f[2] if ti.static(c == 1) else 1.0 - f[2]
            value += u * v * w * here
            slope += ti.Vector([(2.0 * a - 1.0) * v * w, (2.0 * b - 1.0) * u * w, (2.0 * c - 1.0) * u * v]) * here
        slope /= ti.max(slope.norm(), 1e-20)
        return value + spacing * (place - inside).norm(), slope[0], slope[1], slope[2]

    @ti.func
    def walk(self, work: Template, at, strip, b, done):
        """The list of block b: what it can reach until the next walk, by boxes and then by capsules."""
        low, high = ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        fastest, slow, fast = 0.0, ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        spared = -1  # by every key point of the block
        for k in range(b * LANES, (b + 1) * LANES):
            if work.inverse_mass[k] > 0.0:
                here, step = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
                for c in ti.static(range(3)):
                    here[c], step[c] = work.position[c][at + k], work.step[c][at + k]
                low, high = ti.min(low, here), ti.max(high, here)
                slow, fast = ti.min(slow, step), ti.max(fast, step)
                fastest = ti.max(fastest, step.norm_sqr())
                if ti.static(self.sparing):
                    spared &= self.spared[k]
        count = 0
        if low[0] < 1e29:
            wait = self.setting[1]
            least = self.setting[3] + wait * self.setting[2]
            margin = least + GROWTH * wait * ti.sqrt(fastest)
            middle, radius = 0.5 * (low + high), 0.5 * (high - low).norm()
            step, spread = 0.5 * (slow + fast), 0.5 * (fast - slow).norm()
            node, nodes = 0, int(self.setting[10])
            while node < nodes:
                q = node * BOX
                apart = 0.0
                for k in ti.static(range(3)):
                    apart = ti.max(apart, self.box[q + k] - high[k], low[k] - self.box[q + 3 + k])
                if apart > margin:
                    node = self.skip[node]
                else:
                    i = self.leaf[node]
                    if ti.static(self.sparing):  # i stays -1 where it is
                        i |= -((spared >> int(self.row[ti.max(i, 0) * ROW + BONE])) & 1)
                    if i >= 0:
                        p = strip * self.capacity + i
                        here, row = middle - self.posed(p, 0), i * ROW + SHAPE
                        u, v, w = self.slip(i, here[0], here[1], here[2], step[0], step[1], step[2])
                        slip = ti.sqrt(u * u + v * v + w * w) + spread + radius * self.vector(i, SHAPE + 12).norm()
                        axis = self.posed(p, 3)
                        along = ti.min(ti.max(here.dot(axis), self.row[row + 16]), self.row[row + 17])
                        away = (here - along * axis).norm() - self.row[row + 15]
                        if away < least + GROWTH * wait * slip + radius:
                            self.list[b * self.capacity + count] = i
                            self.due[b * self.capacity + count] = done
                            count += 1
                    node += 1
        self.count[b] = count

    @ti.func
    def slip(self, i, x, y, z, u, v, w):
        """Step (u, v, w) less that of the surface, at points relative to the anchor; its turn to second order."""
        shift, turn = self.vector(i, SHAPE + 9), self.vector(i, SHAPE + 12)
        ax, ay, az = turn[1] * z - turn[2] * y, turn[2] * x - turn[0] * z, turn[0] * y - turn[1] * x
        ax, ay, az = (
            ax - 0.5 * (turn[1] * az - turn[2] * ay),
            ay - 0.5 * (turn[2] * ax - turn[0] * az),
            az - 0.5 * (turn[0] * ay - turn[1] * ax),
        )
        return u - shift[0] - ax, v - shift[1] - ay, w - shift[2] - az

    @ti.func
    def change(self, u, v, w, nx, ny, nz, push):
        """What a push along the normal changes, friction with it, at a slip (u, v, w) [m]."""
        along = u * nx + v * ny + w * nz
        u, v, w = u - along * nx, v - along * ny, w - along * nz
        held = ti.min(self.setting[7] * push / ti.sqrt(u * u + v * v + w * w + 1e-30), 1.0)
        return push * nx - held * u, push * ny - held * v, push * nz - held * w

    @ti.func
    def cross(self, work: Template, a, i, p, q, free):
        """Where a long step of the lanes at a meets the primitive on its way it is pushed back to the first such place:
        so far that it stays outside."""
        gap, c = self.setting[3], self.posed(p, 0)
        x, y, z = load(work.position[0], a) - c[0], load(work.position[1], a) - c[1], load(work.position[2], a) - c[2]
        dx, dy, dz = load(work.step[0], a), load(work.step[1], a), load(work.step[2], a)
        u, v, w = self.slip(i, x, y, z, dx, dy, dz)
        longest = ti.sqrt((free * (u * u + v * v + w * w)).max())
        pieces = ti.min(int(longest / (0.25 * self.setting[5])), 64)
        nx, ny, nz, push = 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x
        for j in range(1, pieces):
            left = 1.0 - j / float(pieces)
            self.measure(i, p, q, x - left * u, y - left * v, z - left * w)
            d, ax = load(self.scratch, q), load(self.scratch, q + LANES)
            ay, az = load(self.scratch, q + 2 * LANES), load(self.scratch, q + 3 * LANES)
            depth = free * ti.max(gap - d, 0.0)
            hit = ti.select((depth > 0.0) & (push == 0.0), 1.0, 0.0)
            nx, ny, nz = nx + hit * (ax - nx), ny + hit * (ay - ny), nz + hit * (az - nz)
            push += hit * (depth + left * ti.max(-(u * ax + v * ay + w * az), 0.0))
        u, v, w = self.change(u, v, w, nx, ny, nz, push)
        for axis, more in ti.static(((0, u), (1, v), (2, w))):
            store(work.position[axis], a, load(work.position[axis], a) + more)
            store(work.step[axis], a, load(work.step[axis], a) + more)

    @ti.func
    def look(self, work: Template, at, strip, b, i, e):
        """Planes of block b on primitive i, into entry e; the substeps until one of them could be touched."""
        a, m = work.lanes(b * LANES, at), work.lanes(b * LANES, 0)
        q = ti.min(ti.max(strip, 0), 1 << 10) * SCRATCH * LANES
        o = ti.min(ti.max(e, 0), 1 << 20) * PLANE * LANES
        p = strip * self.capacity + i
        c = self.posed(p, 0)
        free = ti.min(load(work.inverse_mass, m) * 1e30, 1.0)
        if ti.static(self.sparing):
            met = 1 - ((load(self.spared, m) >> int(self.row[i * ROW + BONE])) & 1)
            free *= ti.cast(met, ti.f32)
        if ti.static(self.long_steps):
            self.cross(work, a, i, p, q, free)
        x, y, z = load(work.position[0], a) - c[0], load(work.position[1], a) - c[1], load(work.position[2], a) - c[2]
        self.measure(i, p, q, x, y, z)
        d, nx = load(self.scratch, q), load(self.scratch, q + LANES)
        ny, nz = load(self.scratch, q + 2 * LANES), load(self.scratch, q + 3 * LANES)
        dx, dy, dz = load(work.step[0], a), load(work.step[1], a), load(work.step[2], a)
        u, v, w = self.slip(i, x, y, z, dx, dy, dz)
        store(self.plane, o, nx)
        store(self.plane, o + LANES, ny)
        store(self.plane, o + 2 * LANES, nz)
        store(self.plane, o + 3 * LANES, x * nx + y * ny + z * nz - d - (1.0 - free) * 1e6)
        store(self.plane, o + 4 * LANES, dx - u)
        store(self.plane, o + 5 * LANES, dy - v)
        store(self.plane, o + 6 * LANES, dz - w)
        along = u * nx + v * ny + w * nz
        share = ti.static(GROWTH if self.long_steps else TURNING)
        rate = self.setting[2] + GROWTH * ti.max(-along, 0.0) + share * ti.sqrt(u * u + v * v + w * w)
        store(self.scratch, q, ti.max(d - self.setting[3], 0.0) / rate + (1.0 - free) * 1e6)
        wait = float(MEETING)
        for k in range(q, q + LANES):
            wait = ti.min(wait, self.scratch[k])
        return wait

    @ti.func
    def merge(self, work: Template, at, strip, b, e, i):
        """Entry e − 1 takes, for each key point of the block, the plane of entry e, of primitive i, where nearer."""
        other = self.posed(strip * self.capacity + self.plane_of[e - 1], 0)
        mine = self.posed(strip * self.capacity + i, 0)
        for lane in range(LANES):
            kept, new = (e - 1) * PLANE * LANES + lane, e * PLANE * LANES + lane
            one, two, shift = -self.plane[kept + 3 * LANES], -self.plane[new + 3 * LANES], 0.0
            for c in ti.static(range(3)):
                x = work.position[c][at + b * LANES + lane]
                one += self.plane[kept + c * LANES] * (x - other[c])
                two += self.plane[new + c * LANES] * (x - mine[c])
                shift += self.plane[new + c * LANES] * (mine[c] - other[c])
            if two < one:
                self.plane[new + 3 * LANES] += shift
                for c in range(PLANE):
                    self.plane[kept + c * LANES] = self.plane[new + c * LANES]

    @ti.func
    def touch(self, work: Template, at, first, last, shift, done):
        """Response of the blocks `first` to `last` to the body at the end of substep `done`."""
        strip = -shift // self.strip_size
        base = strip * (self.strip_size // LANES * SLOTS)
        every = int(self.setting[6])
        since = done % every
        if since == 0:
            self.follow(strip, done)
            if done % int(self.setting[1]) == 0:
                for b in range(first, last):
                    self.walk(work, at, strip, b, done)
            e = base
            for b in range(first, last):
                begin = e
                for c in range(b * self.capacity, b * self.capacity + self.count[b]):
                    if self.due[c] <= done:
                        i = self.list[c]
                        wait = int(self.look(work, at, strip, b, i, e))
                        # Everything is looked at when strips meet, so that what a strip skips is what all skip.
                        self.due[c] = ti.min(done + ti.max(wait // every, 1) * every, (done // MEETING + 1) * MEETING)
                        if wait < every:
                            if e < begin + SLOTS:
                                self.plane_block[e], self.plane_of[e] = b, i
                                e += 1
                            else:
                                self.merge(work, at, strip, b, e, i)
            self.planes[strip] = e
        for e in range(base, self.planes[strip]):
            self.respond(work, at, strip, e, float(since))

    @ti.func
    def respond(self, work: Template, at, strip, e, since):
        """Straight-line code that ends in stores: that is what makes it vector code."""
        a = work.lanes(self.plane_block[e] * LANES, at)
        o = ti.min(ti.max(e, 0), 1 << 20) * PLANE * LANES
        c = self.posed(strip * self.capacity + self.plane_of[e], 0)
        px, py, pz = load(work.position[0], a), load(work.position[1], a), load(work.position[2], a)
        dx, dy, dz = load(work.step[0], a), load(work.step[1], a), load(work.step[2], a)
        nx, ny, nz = load(self.plane, o), load(self.plane, o + LANES), load(self.plane, o + 2 * LANES)
        sx, sy, sz = load(self.plane, o + 4 * LANES), load(self.plane, o + 5 * LANES), load(self.plane, o + 6 * LANES)
        x, y, z = px - c[0] - since * sx, py - c[1] - since * sy, pz - c[2] - since * sz
        d = nx * x + ny * y + nz * z - load(self.plane, o + 3 * LANES)
        u, v, w = dx - sx, dy - sy, dz - sz
        depth = ti.max(self.setting[3] - d, 0.0)
        push = ti.min(depth, ti.max(-(u * nx + v * ny + w * nz), 0.0) + self.setting[4])
        x, y, z = self.change(u, v, w, nx, ny, nz, push)
        store(work.position[0], a, px + x)
        store(work.position[1], a, py + y)
        store(work.position[2], a, pz + z)
        store(work.step[0], a, dx + x)
        store(work.step[1], a, dy + y)
        store(work.step[2], a, dz + z)
