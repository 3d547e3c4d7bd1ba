"""What `contact.Contact` runs inside the frame's kernel: lists a block, and the response of 8 key points at once.

Rows of numbers a primitive come from the host once a frame; poses follow in each substep. A strip of the sheet has its
own poses and lists, so that strips on several threads share nothing they write.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false

from functools import lru_cache

import taichi as ti

from taichi_cloth.arrays import F32x2, Template
from taichi_cloth.body.shapes import EVERYWHERE, NEAR, cone, ellipse, local, prism
from taichi_cloth.sheet import LANES
from taichi_cloth.solvers.stencil import load, store

__all__ = ["BOX", "CONE", "ELLIPTIC", "GRID", "MOTION", "ROW", "SHAPE", "SLENDER", "Response", "response"]

CONE, ELLIPTIC, SLENDER, GRID = 0, 1, 2, 3

SHAPE, MOTION, BOX, ROW = 8, 18, 6, 40
"""Numbers of a primitive: kind, 6 of its shape, friction; motion (see `Contact.begin`); box; with room to spare."""

POSE = 12  # anchor, axis, across, other


@lru_cache(maxsize=16)
def response(
    generation: int,
    size: int,
    strips: int,
    capacity: int,
    kinds: tuple[int, ...],
    long_steps: bool,
    even: int,
    nodes: int,
):
    """Fields and functions for grids and bodies of that size. generation: of the Taichi runtime."""
    return Response(size, strips, capacity, kinds, long_steps, even, nodes)


@ti.data_oriented
class Response:
    """What the kernel works on. A strip has its own poses and its own lists."""

    def __init__(
        self, size: int, strips: int, capacity: int, kinds: tuple[int, ...], long_steps: bool, even: int, nodes: int
    ) -> None:
        self.nodes = ti.field(ti.f32, max(1, nodes))
        self.holder: object = None
        self.capacity, self.kinds, self.long_steps, self.even = capacity, kinds, long_steps, even
        self.strip_size = size // strips
        self.buffer = ti.ndarray(ti.f32, (3 * capacity + 1, ROW))
        self.row = ti.field(ti.f32, capacity * ROW)
        self.setting = ti.field(ti.f32, ROW)
        self.skip = ti.field(ti.i32, 2 * capacity)
        self.leaf = ti.field(ti.i32, 2 * capacity)
        self.box = ti.field(ti.f32, 2 * capacity * BOX)
        self.pose = ti.field(ti.f32, strips * capacity * POSE)
        self.scratch = ti.field(ti.f32, strips * 9 * LANES)
        self.count = ti.field(ti.i32, size // LANES)
        self.list = ti.field(ti.i32, size // LANES * capacity)

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
    def keep(self, lanes: Template, p, slot: Template, one, two, three):
        """Stores lanes half-way: what ends in stores becomes vector code, and long chains of it do not."""
        if ti.static(lanes):
            q = ti.min(ti.max(p // self.capacity, 0), 1 << 10) * 9 * LANES + slot * 3 * LANES
            store(self.scratch, q, one)
            store(self.scratch, q + LANES, two)
            store(self.scratch, q + 2 * LANES, three)

    @ti.func
    def distance(self, kind: Template, lanes: Template, i, p, x, y, z):
        """Signed distance [m] and normal of primitive i, at pose p, at points relative to its anchor."""
        row = i * ROW
        axis, across, other = self.posed(p, 3), self.posed(p, 6), self.posed(p, 9)
        one, two, three, four = self.row[row + 1], self.row[row + 2], self.row[row + 3], self.row[row + 4]
        d, nx, ny, nz = x, x, y, z
        if ti.static(kind == CONE):
            d, nx, ny, nz = cone(x, y, z, axis, across, one, two, three, four)
        elif ti.static(kind == GRID):
            px, py, along = local(x, y, z, across), local(x, y, z, other), local(x, y, z, axis)
            d, nu, nv, end = d, px, py, along
            if ti.static(lanes):
                self.keep(lanes, p, 0, along, px, py)
                q = p // self.capacity * 9 * LANES
                for k in range(q, q + LANES):
                    d1, u1, v1, w1 = self.sample(
                        i, self.scratch[k + LANES], self.scratch[k + 2 * LANES], self.scratch[k]
                    )
                    for slot, value in ti.static(enumerate((d1, u1, v1, w1))):
                        self.scratch[k + (3 + slot) * LANES] = value
                d, nu = load(self.scratch, q + 3 * LANES), load(self.scratch, q + 4 * LANES)
                nv, end = load(self.scratch, q + 5 * LANES), load(self.scratch, q + 6 * LANES)
            else:
                d, nu, nv, end = self.sample(i, px, py, along)
            nx = nu * across[0] + nv * other[0] + end * axis[0]
            ny = nu * across[1] + nv * other[1] + end * axis[1]
            nz = nu * across[2] + nv * other[2] + end * axis[2]
        else:
            along, px, py = local(x, y, z, axis), local(x, y, z, across), local(x, y, z, other)
            self.keep(lanes, p, 0, along, px, py)
            flank, nu, nv = ellipse(px, py, one, two, ti.static(NEAR if kind == ELLIPTIC else EVERYWHERE))
            self.keep(lanes, p, 1, flank, nu, nv)
            d, nu, nv, end = prism(flank, nu, nv, along, three, four)
            nx = nu * across[0] + nv * other[0] + end * axis[0]
            ny = nu * across[1] + nv * other[1] + end * axis[1]
            nz = nu * across[2] + nv * other[2] + end * axis[2]
        self.keep(lanes, p, 2, nx, ny, nz)
        return d, nx, ny, nz

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
    def walk(self, work: Template, at: Template, strip, b):
        """The list of block b: what it can reach until the next walk. Numbers, not lanes: it is rare and long."""
        low, high = ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        fastest = 0.0
        for k in range(b * LANES, (b + 1) * LANES):
            if work.inverse_mass[k] > 0.0:
                here = ti.Vector([work.position[at][0][k], work.position[at][1][k], work.position[at][2][k]])
                step = ti.Vector([work.step[at][0][k], work.step[at][1][k], work.step[at][2][k]])
                low, high = ti.min(low, here), ti.max(high, here)
                fastest = ti.max(fastest, step.norm_sqr())
        count = 0
        if low[0] < 1e29:
            wait = self.setting[1]
            margin = self.setting[3] + self.setting[2] + 1.25 * wait * ti.sqrt(fastest)
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
                    if i >= 0:
                        reach = margin + wait * self.row[i * ROW + SHAPE + 15]
                        if self.within(work, at, strip, b, i, reach, 0.5 * (low + high), 0.5 * (high - low).norm()):
                            self.list[b * self.capacity + count] = i
                            count += 1
                    node += 1
        self.count[b] = count

    @ti.func
    def within(self, work: Template, at: Template, strip, b, i, reach, middle, radius):
        """Whether a key point of block b, which lies in a ball, is no further than `reach` from primitive i."""
        p = strip * self.capacity + i
        out = 0
        k = -1
        while k < LANES and out == 0:
            here, allowed = middle, reach + radius
            if k >= 0:
                q = b * LANES + k
                here = ti.Vector([work.position[at][0][q], work.position[at][1][q], work.position[at][2][q]])
                allowed = reach
            here -= self.posed(p, 0)
            d = 0.0
            for kind in ti.static(self.kinds):
                if int(self.row[i * ROW]) == kind:
                    d, _x, _y, _z = self.distance(kind, False, i, p, here[0], here[1], here[2])
            if k < 0:
                k = LANES if d > allowed else 0
            else:
                out = int(d < allowed and work.inverse_mass[b * LANES + k] > 0.0)
                k += 1
        return out

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
    def change(self, i, u, v, w, nx, ny, nz, push):
        """What a push along the normal changes, friction with it, at a slip (u, v, w) [m]."""
        along = u * nx + v * ny + w * nz
        u, v, w = u - along * nx, v - along * ny, w - along * nz
        held = ti.min(self.row[i * ROW + 7] * push / ti.sqrt(u * u + v * v + w * w + 1e-30), 1.0)
        return push * nx - held * u, push * ny - held * v, push * nz - held * w

    @ti.func
    def crossed(self, kind: Template, i, p, x, y, z, u, v, w, free):
        """Where a long step meets the primitive on its way: the normal there, and the push that keeps it outside."""
        gap = self.setting[3]
        longest = ti.sqrt((free * (u * u + v * v + w * w)).max())
        pieces = ti.min(int(longest / (0.25 * self.setting[5])), 64)
        nx, ny, nz, push = 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x
        for j in range(1, pieces):
            left = 1.0 - j / float(pieces)
            d, ax, ay, az = self.distance(kind, True, i, p, x - left * u, y - left * v, z - left * w)
            depth = free * ti.max(gap - d, 0.0)
            hit = ti.select((depth > 0.0) & (push == 0.0), 1.0, 0.0)
            nx, ny, nz = nx + hit * (ax - nx), ny + hit * (ay - ny), nz + hit * (az - nz)
            push += hit * (depth + left * ti.max(-(u * ax + v * ay + w * az), 0.0))
        return nx, ny, nz, push

    @ti.func
    def touch(self, work: Template, at: Template, first, last, shift, done):
        """Response of the blocks `first` to `last` to the body at the end of substep `done`."""
        strip = -shift // self.strip_size
        self.follow(strip, done)
        if ti.static(at == self.even):  # noqa: SIM102 (this one is the compiler's)
            if done % int(self.setting[1]) == 0:
                for b in range(first, last):
                    self.walk(work, at, strip, b)
        for b in range(first, last):
            for c in range(self.count[b]):
                i = self.list[b * self.capacity + c]
                for kind in ti.static(self.kinds):
                    if int(self.row[i * ROW]) == kind:
                        self.respond(kind, work, at, strip, b, i)

    @ti.func
    def respond(self, kind: Template, work: Template, at: Template, strip, b, i):
        """Straight-line code that ends in stores: that is what makes it vector code."""
        p = ti.min(ti.max(b, 0), 1 << 24) * LANES  # bounds tell the compiler that nothing overflows
        pose = strip * self.capacity + i
        c = self.posed(pose, 0)
        free = ti.min(load(work.inverse_mass, p) * 1e30, 1.0)
        px, py, pz = load(work.position[at][0], p), load(work.position[at][1], p), load(work.position[at][2], p)
        dx, dy, dz = load(work.step[at][0], p), load(work.step[at][1], p), load(work.step[at][2], p)
        if ti.static(self.long_steps):
            x, y, z = px - c[0], py - c[1], pz - c[2]
            u, v, w = self.slip(i, x, y, z, dx, dy, dz)
            nx, ny, nz, push = self.crossed(kind, i, pose, x, y, z, u, v, w, free)
            x, y, z = self.change(i, u, v, w, nx, ny, nz, push)
            px, py, pz, dx, dy, dz = px + x, py + y, pz + z, dx + x, dy + y, dz + z
        x, y, z = px - c[0], py - c[1], pz - c[2]
        d, nx, ny, nz = self.distance(kind, True, i, pose, x, y, z)
        u, v, w = self.slip(i, x, y, z, dx, dy, dz)
        depth = free * ti.max(self.setting[3] - d, 0.0)
        push = ti.min(depth, ti.max(-(u * nx + v * ny + w * nz), 0.0) + self.setting[4])
        x, y, z = self.change(i, u, v, w, nx, ny, nz, push)
        store(work.position[at][0], p, px + x)
        store(work.position[at][1], p, py + y)
        store(work.position[at][2], p, pz + z)
        store(work.step[at][0], p, dx + x)
        store(work.step[at][1], p, dy + y)
        store(work.step[at][2], p, dz + z)
