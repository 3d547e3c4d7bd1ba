"""Cloth against a body (paper 4.1): key points are kept out of its primitives, with Coulomb friction, no restitution.

Once a frame the bounding boxes of the body's tree follow it (`body/hierarchy.py`), each swept over the whole frame. Every
few substeps each block of 8 neighbouring key points walks the tree and lists the primitives that it can reach before
the next walk; the substeps between meet only those. A list holds all primitives if need be: nothing is ever dropped.

Response of a key point that stands deeper than the gap: out along the normal, which takes the velocity towards the
surface and no more (what started inside is let out at `recovery`), and against its slip over the moving surface by at
most µ times that.

Where steps are so long that a limb could be crossed in one, the way of the step is searched in pieces shorter than half
the thinnest primitive.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false

from functools import lru_cache

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.arrays import F32x2, Template
from taichi_cloth.body.colliders import BoneFrame, Colliders
from taichi_cloth.body.hierarchy import build, corners
from taichi_cloth.body.primitives import Primitive
from taichi_cloth.body.shapes import EVERYWHERE, NEAR, cone, elliptic
from taichi_cloth.forces import FrameForces
from taichi_cloth.sheet import LANES, SheetState
from taichi_cloth.solvers.passes import Pass
from taichi_cloth.solvers.stencil import load, store

__all__ = ["Contact"]

F64 = NDArray[np.float64]

CONE, ELLIPTIC, SLENDER = 0, 1, 2
SLENDEREST = 0.4  # ratio of semi-axes down to which shapes.NEAR is enough

LONGEST_WAIT = 2.5e-3  # [s] between two walks of the tree
SPARE = 2.0  # [m/s] that a key point may gain meanwhile, beside doubling its speed
FASTEST = 20.0  # [m/s] past the body, for which a step is called short

SHAPE, MOTION, BOX, ROW = 8, 18, 6, 40
"""Numbers of a primitive: kind, 6 of its shape, friction; motion (see `_rows`); box; with room to spare."""

POSE = 12  # anchor, axis, across, other


class Contact(Pass):
    """The pass for one body and one sheet's solver.

    size: elements of the padded grid. substeps: a frame. step: of each [s]. strips: of the solver.
    even: the buffer in which the even substeps leave their result.
    """

    local = True

    def __init__(self, body: Colliders, *, size: int, substeps: int, step: float, strips: int = 1, even: int = 1) -> None:
        self.body, self.substeps = body, substeps
        primitives = body.primitives
        self._constant = _shapes(body)
        kinds = tuple(sorted({int(k) for k in self._constant[:, 0]}))
        thinnest = min(_thickness(row) for row in self._constant)
        capacity = -(-len(primitives) // 16) * 16
        long_steps = step * FASTEST > thinnest / 2
        self.memory = _memory(runtime.generation(), size * strips, strips, capacity, kinds, bool(long_steps), even)
        wait = 16
        while wait > 2 and wait * step > LONGEST_WAIT:
            wait //= 2
        self._settings = np.array([len(primitives), wait, SPARE * step * wait, body.gap, body.recovery * step, thinnest])
        self._points, self._radii = corners(primitives)
        self._tree = build(self._points.mean(axis=1))
        self._bones = np.array([p.bone for p in primitives])
        self._anchors = np.stack([_anchor(p) for p in primitives])
        self._axes = np.stack([np.stack(_axes(p)) for p in primitives])
        self._reach = np.linalg.norm(self._points - self._anchors[:, None], axis=2).max(axis=1) + self._radii.max(axis=1)

    # Two passes that share their memory are one to the solver: it needs no second kernel for them.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, Contact) and self.memory is other.memory

    def __hash__(self) -> int:
        return id(self.memory)

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        frame = forces.body or self.body.during(0.0, 0.0)
        rows = np.zeros((self.memory.capacity * 3 + 1, ROW), np.float32)
        rows[: len(self._constant)] = self._rows(frame)
        nodes = len(self._tree.skip)
        rows[self.memory.capacity : self.memory.capacity + nodes, 0] = self._tree.skip
        rows[self.memory.capacity : self.memory.capacity + nodes, 1] = self._tree.leaf
        rows[-1, : len(self._settings)] = self._settings
        rows[-1, 10] = nodes
        self.memory.buffer.from_numpy(rows)
        self.memory.take(self.memory.buffer)

    def _rows(self, frame: BoneFrame) -> F64:
        """(primitives, ROW): shape; then anchor, axis and across at the start of the frame, the anchor's shift [m] and
        the turn [rad] a substep, as vectors, and the furthest that a surface point moves [m]; the box of the frame."""
        out = self._constant.copy()
        start, end = frame.start[self._bones], frame.end[self._bones]
        first = _moved(start, self._anchors)
        shift = (_moved(end, self._anchors) - first) / self.substeps
        turn = _turns(start[:, :3, :3], end[:, :3, :3])
        axes = self._axes @ start[:, :3, :3].transpose(0, 2, 1)
        m = SHAPE
        out[:, m : m + 3], out[:, m + 3 : m + 6], out[:, m + 6 : m + 9] = first, axes[:, 0], axes[:, 1]
        out[:, m + 9 : m + 12], out[:, m + 12 : m + 15] = shift, turn / self.substeps
        angle = np.linalg.norm(turn, axis=1)
        out[:, m + 15] = np.linalg.norm(shift, axis=1) + angle / self.substeps * self._reach
        both = np.concatenate([_moved(t[:, None], self._points) for t in (start, end)], axis=1)
        bulge = self._reach * (1 - np.cos(np.minimum(angle, np.pi) / 2))  # of an arc over its chord
        radii = np.concatenate([self._radii] * 2, axis=1)[..., None] + (bulge + 1e-5)[:, None, None]
        b = SHAPE + MOTION
        out[:, b : b + 3], out[:, b + 3 : b + 6] = (both - radii).min(axis=1), (both + radii).max(axis=1)
        return out

    @ti.func
    def after(self, work: Template, at: Template, first, last, shift, done, n: Template):
        self.memory.touch(work, at, first, last, shift, done)


def _anchor(p: Primitive) -> F64:
    if p.kind == "elliptic":
        return (p.start + p.end) / 2
    swallowed = p.kind == "cylinder" and p.radii[1] - p.radii[0] >= np.linalg.norm(p.end - p.start)
    return p.end if swallowed else p.start


def _axes(p: Primitive) -> tuple[F64, F64]:
    """Axis and across, unit; across along the longer semi-axis."""
    span = p.end - p.start
    length = float(np.linalg.norm(span))
    axis = span / length if length > 0 else np.array([0.0, 1.0, 0.0])
    if p.kind == "elliptic":
        return axis, p.across if p.radii[0] >= p.radii[1] else np.cross(p.across, axis)
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return axis, across / np.linalg.norm(across)


def _shapes(body: Colliders) -> F64:
    """(primitives, ROW): kind and what `shapes.cone` or `shapes.elliptic` takes; friction."""
    out = np.zeros((len(body.primitives), ROW))
    for row, p in zip(out, body.primitives, strict=True):
        length = float(np.linalg.norm(p.end - p.start)) if p.kind != "sphere" else 0.0
        r1, r2 = p.radii
        if p.kind == "elliptic":
            long, short = max(r1, r2) - p.rounding, min(r1, r2) - p.rounding
            kind = ELLIPTIC if short >= SLENDEREST * long else SLENDER
            row[:5] = kind, long, short, length / 2 - p.rounding, p.rounding
        elif p.kind == "sphere" or length <= abs(r1 - r2):
            row[:5] = CONE, r1 if p.kind == "sphere" else max(r1, r2), 0.0, 0.0, 0.0
        else:
            sine = (r1 - r2) / length
            row[:5] = CONE, r1, sine, sine / np.sqrt(1 - sine**2), length
        row[7] = body.friction
    return out


def _thickness(row: F64) -> float:
    """Of the thinnest place of a primitive [m]."""
    if row[0] == CONE:
        return float(2 * (row[1] - max(row[2], 0.0) * row[4]))
    return float(2 * min(row[2], row[3]) + 2 * row[4])


def _moved(transform: F64, points: F64) -> F64:
    return np.einsum("...ij,...j->...i", transform[..., :3, :3], points) + transform[..., :3, 3]


def _turns(start: F64, end: F64) -> F64:
    """Rotation vectors (n, 3) [rad] in the world that lead from one set of axes to another; not half a turn."""
    r = end @ start.transpose(0, 2, 1)
    v = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1) / 2
    sine = np.linalg.norm(v, axis=1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    return v * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)[:, None]


@lru_cache(maxsize=16)
def _memory(generation: int, size: int, strips: int, capacity: int, kinds: tuple[int, ...], long_steps: bool, even: int):
    """Fields and functions for grids and bodies of that size. generation: of the Taichi runtime."""
    return _Memory(size, strips, capacity, kinds, long_steps, even)


@ti.data_oriented
class _Memory:
    """What the kernel works on. A strip has its own poses and its own lists."""

    def __init__(self, size: int, strips: int, capacity: int, kinds: tuple[int, ...], long_steps: bool, even: int) -> None:
        self.capacity, self.kinds, self.long_steps, self.even = capacity, kinds, long_steps, even
        self.strip_size = size // strips
        self.buffer = ti.ndarray(ti.f32, (3 * capacity + 1, ROW))
        self.row = ti.field(ti.f32, capacity * ROW)
        self.setting = ti.field(ti.f32, ROW)
        self.skip = ti.field(ti.i32, 2 * capacity)
        self.leaf = ti.field(ti.i32, 2 * capacity)
        self.box = ti.field(ti.f32, 2 * capacity * BOX)
        self.pose = ti.field(ti.f32, strips * capacity * POSE)
        self.scratch = ti.field(ti.f32, strips * 4 * LANES)
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
    def distance(self, kind: Template, i, p, x, y, z):
        """Signed distance [m] and normal of primitive i, at pose p, at points relative to its anchor."""
        row = i * ROW
        axis, across, other = self.posed(p, 3), self.posed(p, 6), self.posed(p, 9)
        one, two, three, four = self.row[row + 1], self.row[row + 2], self.row[row + 3], self.row[row + 4]
        d, nx, ny, nz = x, x, y, z
        if ti.static(kind == CONE):
            d, nx, ny, nz = cone(x, y, z, axis, across, one, two, three, four)
        elif ti.static(kind == ELLIPTIC):
            d, nx, ny, nz = elliptic(x, y, z, axis, across, other, one, two, three, four, NEAR)
        else:
            d, nx, ny, nz = elliptic(x, y, z, axis, across, other, one, two, three, four, EVERYWHERE)
        return d, nx, ny, nz

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
            margin = self.setting[3] + self.setting[2] + 2.0 * wait * ti.sqrt(fastest)
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
                    d, _x, _y, _z = self.distance(kind, i, p, here[0], here[1], here[2])
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
            d, ax, ay, az = self.distance(kind, i, p, x - left * u, y - left * v, z - left * w)
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
        if ti.static(at == self.even):
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
        d, nx, ny, nz = self.distance(kind, i, pose, x, y, z)
        q = ti.min(ti.max(strip, 0), 1 << 10) * 4 * LANES  # stores on the way keep it vector code
        store(self.scratch, q, d)
        store(self.scratch, q + LANES, nx)
        store(self.scratch, q + 2 * LANES, ny)
        store(self.scratch, q + 3 * LANES, nz)
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
