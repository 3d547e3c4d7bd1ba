"""Where the surfaces of a body are, inside the frame's kernel: poses of its primitives, distances to them, their speed.

Rows of numbers a primitive come from the host once a frame. Poses follow within it; each part of the sheet has lanes of
its own to work out distances in, so that parts on several threads share nothing they write.
"""

from typing import Any

import taichi as ti

from taichi_cloth.body.primitives.shapes import cone, ellipse, local, prism
from taichi_cloth.ground.arrays import F32x2, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.motion.stencil import Lanes, load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["CONE", "ELLIPTIC", "GRID", "SETTINGS", "BodySurface", "Row"]

CONE, ELLIPTIC, GRID = 0, 1, 2


class Row:
    """Where in its row a number of a primitive stands, or the first of three; as `Contact.begin` writes them.

    KIND: CONE, ELLIPTIC or GRID.
    SIZES: six, what `shapes.cone` or `shapes.ellipse` and `shapes.prism` take; of a grid its first node, spacing and
    counts.
    SLIDE: how far a point may slide on one plane [m].
    ANCHOR, AXIS, ACROSS: at the start of the frame, in the world: a place [m] and two unit directions.
    SHIFT, TURN: of the anchor [m] and about it [rad], in a substep.
    RADIUS, LOW, HIGH: of the capsule around it: its radius, and its ends along the axis from the anchor [m].
    BOX: least and greatest corner of where it comes in the frame [m].
    BONE, LIMB: numbers of the bone that carries it and of the limb that it is of.
    COUNT: of numbers, with room to spare.
    """

    KIND, SIZES, SLIDE = 0, 1, 7
    ANCHOR, AXIS, ACROSS, SHIFT, TURN = 8, 11, 14, 17, 20
    RADIUS, LOW, HIGH = 23, 24, 25
    BOX, BONE, LIMB, COUNT = 26, 32, 33, 40


SETTINGS = (
    *("solids", "wait", "spare_step", "gap", "recovery", "thinnest", "every", "friction", "most_turn", "between"),
    "boxes",
)
"""What holds for all primitives in a frame, in the order in which `Contact.begin` writes it into the last row."""

BOX = 6
POSE = 12  # anchor, axis, across, other
SCRATCH = 10


@ti.data_oriented
class BodySurface:
    """Primitives of a body and the tree of their boxes. nodes: values of all distance grids together. parts: that work
    at once and need room of their own, `line` elements apart from each other."""

    def __init__(self, capacity: int, kinds: tuple[int, ...], nodes: int, parts: int = PARTS, line: int = LINE) -> None:
        self.nodes = ti.field(ti.f32, max(1, nodes))
        self.holder: object = None
        self.capacity, self.kinds, self.parts, self.line = capacity, kinds, parts, line
        self.stride = SCRATCH * LANES + (line if line > 1 else 0)
        self.row: Any = ti.field(ti.f32, capacity * Row.COUNT)
        self.settings: list[Any] = [ti.field(ti.f32, ()) for _ in SETTINGS]
        (
            self.solids,  # primitives and grids
            self.wait,  # substeps between two walks of the tree
            self.spare_step,  # what a key point may gain meanwhile [m a substep]
            self.gap,  # [m]
            self.recovery,  # of what was deep before, in a substep [m]
            self.thinnest,  # place of the body [m]
            self.every,  # substeps between two looks
            self.friction,  # Coulomb's µ
            self.most_turn,  # that a plane may turn from its look on [rad]
            self.between,  # see `Colliders`; below 0: nothing gives way [m]
            self.boxes,  # nodes of the tree
        ) = self.settings
        self.skip = ti.field(ti.i32, 2 * capacity)
        self.leaf = ti.field(ti.i32, 2 * capacity)
        self.box = ti.field(ti.f32, 2 * capacity * BOX)
        self.pose = ti.field(ti.f32, capacity * POSE)
        self.scratch = ti.field(ti.f32, (parts + 1) * self.stride)

    @ti.kernel
    def take(self, rows: F32x2):
        """A frame's rows of `Contact.begin`; boxes of the tree from its leaves up."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            # The last row: settings. The first rows: primitives.
            for k, setting in ti.static(enumerate(self.settings)):
                setting[None] = rows[3 * self.capacity, k]
            for i in range(self.capacity):
                for k in range(Row.COUNT):
                    self.row[i * Row.COUNT + k] = rows[i, k]
            # The tree, children after their parent: a leaf has its primitive's box, others that of both children.
            nodes = int(self.boxes[None])
            for back in range(nodes):
                node = nodes - 1 - back
                self.skip[node] = int(rows[self.capacity + node, 0])
                leaf = int(rows[self.capacity + node, 1])
                self.leaf[node] = leaf
                for k in range(BOX):
                    if leaf >= 0:
                        self.box[node * BOX + k] = rows[leaf, Row.BOX + k]
                    else:
                        one = self.box[(node + 1) * BOX + k]
                        two = self.box[self.skip[node + 1] * BOX + k]
                        self.box[node * BOX + k] = ti.min(one, two) if k < 3 else ti.max(one, two)

    @ti.func
    def scratch_of(self, part):
        """The first of a part's lanes of scratch. The bounds tell the compiler that nothing overflows."""
        return (ti.min(ti.max(part, 0), ti.static(self.parts - 1)) + 1) * ti.static(self.stride)

    @ti.func
    def vector(self, i, k: Template) -> Any:
        at = i * Row.COUNT + k
        return ti.Vector([self.row[at], self.row[at + 1], self.row[at + 2]])

    @ti.func
    def posed(self, i, k: Template) -> Any:
        return ti.Vector([self.pose[i * POSE + k], self.pose[i * POSE + k + 1], self.pose[i * POSE + k + 2]])

    # Of primitive i, in the frame: see `Row`.
    @ti.func
    def shift(self, i):
        return self.vector(i, Row.SHIFT)

    @ti.func
    def turn(self, i):
        return self.vector(i, Row.TURN)

    @ti.func
    def radius(self, i):
        return self.row[i * Row.COUNT + Row.RADIUS]

    @ti.func
    def low(self, i):
        return self.row[i * Row.COUNT + Row.LOW]

    @ti.func
    def high(self, i):
        return self.row[i * Row.COUNT + Row.HIGH]

    @ti.func
    def slide(self, i):
        return self.row[i * Row.COUNT + Row.SLIDE]

    @ti.func
    def bone(self, i):
        return int(self.row[i * Row.COUNT + Row.BONE])

    @ti.func
    def limb(self, i):
        return int(self.row[i * Row.COUNT + Row.LIMB])

    # Of primitive i, where it was when poses were last worked out.
    @ti.func
    def anchor(self, i):
        return self.posed(i, 0)

    @ti.func
    def axis(self, i):
        return self.posed(i, 3)

    @ti.func
    def across(self, i):
        return self.posed(i, 6)

    @ti.func
    def other(self, i):
        return self.posed(i, 9)

    @ti.func
    def turned(self, i, age):
        """Rotation of primitive i over some substeps, to second order."""
        t = age * self.turn(i)
        half = 0.5 * t
        x, y, z = t[0] * half[0], t[1] * half[1], t[2] * half[2]
        xy, yz, zx = t[0] * half[1], t[1] * half[2], t[2] * half[0]
        return ti.Matrix(
            [
                [1.0 - y - z, xy - t[2], zx + t[1]],
                [xy + t[2], 1.0 - z - x, yz - t[0]],
                [zx - t[1], yz + t[0], 1.0 - x - y],
            ]
        )

    @routine
    def follow(self, done: Int):
        """Poses at the end of substep `done`."""
        for i in range(int(self.solids[None])):
            self.follow_one(i, done)

    @ti.func
    def follow_one(self, i, done):
        """Of primitive i: its anchor on a line, its axes turned about one vector (Rodrigues)."""
        anchor = self.vector(i, Row.ANCHOR) + (done + 1.0) * self.shift(i)
        turn = (done + 1.0) * self.turn(i)
        angle = turn.norm()
        axis, across = self.vector(i, Row.AXIS), self.vector(i, Row.ACROSS)
        if angle > 0.0:
            about, cosine, sine = turn / angle, ti.cos(angle), ti.sin(angle)
            axis = cosine * axis + sine * about.cross(axis) + (1.0 - cosine) * about.dot(axis) * about
            across = cosine * across + sine * about.cross(across) + (1.0 - cosine) * about.dot(across) * about
        other = axis.cross(across)
        for k in ti.static(range(3)):
            self.pose[i * POSE + k] = anchor[k]
            self.pose[i * POSE + 3 + k] = axis[k]
            self.pose[i * POSE + 6 + k] = across[k]
            self.pose[i * POSE + 9 + k] = other[k]

    @routine
    def measure(self, i: Int, q: Int, x: Lanes, y: Lanes, z: Lanes):
        """Signed distance [m] and normal of primitive i at points relative to its anchor, into the scratch
        lanes q, q + 1, q + 2 and q + 3. Lanes are stored half-way: what ends in stores becomes vector code."""
        # The primitive's pose and sizes; what they mean hangs on its kind.
        row = i * Row.COUNT
        axis, across, other = self.axis(i), self.across(i), self.other(i)
        sizes = row + Row.SIZES
        one, two, three, four = self.row[sizes], self.row[sizes + 1], self.row[sizes + 2], self.row[sizes + 3]
        kind = int(self.row[row + Row.KIND])
        for k in ti.static(self.kinds):
            if kind == k:
                if ti.static(k == CONE):
                    d, nx, ny, nz = cone(x, y, z, axis, across, one, two, three, four)
                    self.keep(q, d, nx, ny, nz)
                else:
                    # Those that are not round are measured in their own axes: along, and (px, py) across.
                    along, px, py = local(x, y, z, axis), local(x, y, z, across), local(x, y, z, other)
                    self.keep(q + 4 * LANES, along, px, py, py)
                    if ti.static(k == GRID):
                        for lane in range(q + 4 * LANES, q + 5 * LANES):
                            along1, px1 = self.scratch[lane], self.scratch[lane + LANES]
                            d1, u1, v1, w1 = self.sample(i, px1, self.scratch[lane + 2 * LANES], along1)
                            for m, value in ti.static(enumerate((d1, u1, v1, w1))):
                                self.scratch[lane + (m - 4) * LANES] = value
                    else:
                        flank, nu, nv = ellipse(px, py, one, two, int(self.row[sizes + 4]))
                        self.keep(q + 4 * LANES, flank, nu, nv, along)
                        d, nu, nv, end = prism(flank, nu, nv, along, three, four)
                        self.keep(q, d, nu, nv, end)
        # And their normals turned back into the world's.
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
        sizes = i * Row.COUNT + Row.SIZES
        # The cell, and where in it (0 to 1 along each axis).
        begin, spacing = int(self.row[sizes]), self.row[sizes + 1]
        count = ti.Vector([int(self.row[sizes + 2]), int(self.row[sizes + 3]), int(self.row[sizes + 4])])
        top = ti.cast(count - 1, ti.f32)
        place = ti.Vector([x, y, z]) / spacing + 0.5 * top
        inside = ti.min(ti.max(place, 0.0), top)
        cell = ti.min(ti.cast(inside, ti.i32), count - 2)
        f = inside - ti.cast(cell, ti.f32)
        # Its eight corners by their shares u v w, and what each share changes by along each axis.
        value, slope = 0.0, ti.Vector([0.0, 0.0, 0.0])
        for a, b, c in ti.static(ti.ndrange(2, 2, 2)):
            here = self.nodes[begin + ((cell[0] + a) * count[1] + cell[1] + b) * count[2] + cell[2] + c]  # pyright: ignore[reportIndexIssue]
            u = f[0] if ti.static(a == 1) else 1.0 - f[0]  # pyright: ignore[reportIndexIssue]
            v = f[1] if ti.static(b == 1) else 1.0 - f[1]  # pyright: ignore[reportIndexIssue]
            w = f[2] if ti.static(c == 1) else 1.0 - f[2]  # pyright: ignore[reportIndexIssue]
            value += u * v * w * here
            slope += ti.Vector([(2.0 * a - 1.0) * v * w, (2.0 * b - 1.0) * u * w, (2.0 * c - 1.0) * u * v]) * here
        slope /= ti.max(slope.norm(), 1e-20)
        return value + spacing * (place - inside).norm(), slope[0], slope[1], slope[2]  # pyright: ignore[reportOptionalCall]

    @ti.func
    def slip(self, i, x, y, z, u, v, w):
        """Step (u, v, w) less that of the surface, at points relative to the anchor; its turn to second order."""
        shift, turn = self.shift(i), self.turn(i)
        # What the turn moves a place by that ends at x: turn × x − ½ turn × (turn × x).
        ax, ay, az = turn[1] * z - turn[2] * y, turn[2] * x - turn[0] * z, turn[0] * y - turn[1] * x
        ax, ay, az = (
            ax - 0.5 * (turn[1] * az - turn[2] * ay),
            ay - 0.5 * (turn[2] * ax - turn[0] * az),
            az - 0.5 * (turn[0] * ay - turn[1] * ax),
        )
        return u - shift[0] - ax, v - shift[1] - ay, w - shift[2] - az
