"""Kernels that solve whole threads at once: chains of springs and of hinges along the lines of a sheet's grid.

Every spring belongs to a chain: a warp, a weft, or a diagonal of the grid. With the positions x of an implicit step
and the multipliers λ of its springs (Macklin, Müller & Chentanez 2016, "XPBD"; h² in the weights w),

    x = y + w Aᵀ λ,      λ = −k C(x),      C = |d| − L  for springs,  x₋ − 2x + x₊  for hinges,

linearised at the present x and restricted to one chain, is a tridiagonal system in λ for springs and a pentadiagonal
one for hinges, (1 + k A w Aᵀ) Δλ = −k C − λ. It is solved exactly, by elimination along the chain: a thread passes on
its pull from end to end in one go, however stiff it is. Eight chains go side by side, one a lane.

Chains share no key point within a kind, so a kind is one block of a Gauss–Seidel sweep; warp and weft, nearly square
to each other, hardly disturb each other.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false

import taichi as ti

from taichi_cloth.arrays import Template
from taichi_cloth.sheet import LANES, PAD
from taichi_cloth.solvers.stencil import Stencil

__all__ = ["KINDS", "Lines"]

KINDS = 8
"""Kinds of chains: 0 hinges along the weft, 1 weft, 2 second neighbours along it, 3 hinges along the warp, 4 second
neighbours along it, 5 and 6 diagonals rising and falling, 7 warp."""

RESOLVED = 1.0e6
"""Largest k w of a hinge: float32 cannot solve the pentadiagonal system of stiffer ones."""

SMALLEST_PIVOT = 1.0e-6
"""Share of its row below which a pivot is rounding, not a number: mass ratios of a million and more get there."""

SHORTEST = 1.0e-6
"""Share of its rest length below which a spring has no direction of its own and takes that of the resting sheet."""


@ti.func
def at(field: Template, p, apart: Template):
    """Lanes `apart` elements from each other, the first at p."""
    return ti.Vector([field[p + k * apart] for k in ti.static(range(LANES))])


@ti.func
def put(field: Template, p, apart: Template, values):
    for k in ti.static(range(LANES)):
        field[p + k * apart] = values[k]


@ti.data_oriented
class Lines(Stencil):
    """Work memory of the solves, in the layout of the sheet, with rows added below up to whole lanes.

    position: x at the start of the step [m]. moved: u, from there to the iterate [m]. weight: w [1/kg], what the
    step makes of the inverse mass. share: of a kind's constant that a spring or hinge at p has.
    """

    def __init__(self, rows: int, width: int) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, rows * width) for _ in range(count)]

        super().__init__(rows * width, width)
        self.rows = rows
        self.iterate = fields(3)
        self.weight, self.gain, self.gain2 = fields(3)
        self.normal, self.pull = fields(3), fields(3)
        self.share = ti.field(ti.f32, KINDS * rows * width)
        self.offset = ti.field(ti.i32, KINDS)
        self.constant, self.rest, self.rest_x, self.rest_y = (ti.field(ti.f32, KINDS) for _ in range(4))
        self.total = ti.field(ti.f32, 3 * KINDS * rows * width)

    @ti.func
    def gap(self, p, offset, apart: Template):
        """Vectors from the lanes at p to those at p + offset: of x, and of u."""
        x, y, z = ti.static(*self.position)
        u, v, w = ti.static(*self.iterate)
        return (
            at(x, p + offset, apart) - at(x, p, apart),
            at(y, p + offset, apart) - at(y, p, apart),
            at(z, p + offset, apart) - at(z, p, apart),
            at(u, p + offset, apart) - at(u, p, apart),
            at(v, p + offset, apart) - at(v, p, apart),
            at(w, p + offset, apart) - at(w, p, apart),
        )

    @ti.func
    def there(self, kind, p, apart: Template):
        """1 where a spring or hinge starts at the lanes, or 0: what other kinds left there is not to be read."""
        return ti.min(at(self.share, kind * self.size + p, apart) * 1e30, 1.0)

    @ti.func
    def eliminate(self, p, offset, kind, k0, rest, rest_x, rest_y, lag, several: Template, apart: Template):
        """Springs from p to p + offset, given those from p − offset: their rows of the tridiagonal system.

        k0: the kind's constant × h². rest: length, rest_x, rest_y: direction at rest. lag: τ/h of damping.
        """
        size = ti.static(self.size)
        dx, dy, dz, ux, uy, uz = self.gap(p, offset, apart)
        ex, ey, ez = dx + ux, dy + uy, dz + uz
        least = (SHORTEST * rest) ** 2
        squared = ex * ex + ey * ey + ez * ez
        inverse = 1.0 / ti.sqrt(ti.max(squared, least))
        nx = ti.select(squared < least, rest_x, ex * inverse)
        ny = ti.select(squared < least, rest_y, ey * inverse)
        nz = ti.select(squared < least, 0.0, ez * inverse)
        k = k0 * at(self.share, kind * size + p, apart)
        stiff = k * (1.0 + lag)
        w0, w1 = at(self.weight, p, apart), at(self.weight, p + offset, apart)
        c = (
            nx * at(self.normal[0], p - offset, apart)
            + ny * at(self.normal[1], p - offset, apart)
            + nz * at(self.normal[2], p - offset, apart)
        )
        below = stiff * w0 * c * self.there(kind, p - offset, apart)
        whole = 1.0 + stiff * (w0 + w1)
        pivot = 1.0 / ti.max(whole - below * c * at(self.gain, p - offset, apart), SMALLEST_PIVOT * whole)
        right = below * at(self.pull[0], p - offset, apart)
        right -= k * (squared * inverse - rest + lag * (ux * nx + uy * ny + uz * nz))
        if ti.static(several):
            right -= at(self.total, kind * size + p, apart)
        put(self.normal[0], p, apart, nx)
        put(self.normal[1], p, apart, ny)
        put(self.normal[2], p, apart, nz)
        put(self.gain, p, apart, stiff * w1 * pivot)
        put(self.pull[0], p, apart, right * pivot)

    @ti.func
    def substitute(self, p, offset, kind, several: Template, apart: Template):
        """λ of the springs from p, given those from p + offset; moves the key points at p + offset."""
        q = p + offset
        n0, n1, n2 = ti.static(*self.normal)
        ax, ay, az = at(n0, p, apart), at(n1, p, apart), at(n2, p, apart)
        bx, by, bz = at(n0, q, apart), at(n1, q, apart), at(n2, q, apart)
        ahead = at(self.pull[0], q, apart)
        pull = at(self.pull[0], p, apart) + at(self.gain, p, apart) * (ax * bx + ay * by + az * bz) * ahead
        put(self.pull[0], p, apart, pull)
        ahead = at(self.pull[0], q, apart)  # anew: a falling diagonal of 8 columns has p and p + offset in one block
        w = at(self.weight, q, apart)
        x = at(self.iterate[0], q, apart) + w * (ax * pull - bx * ahead)
        y = at(self.iterate[1], q, apart) + w * (ay * pull - by * ahead)
        z = at(self.iterate[2], q, apart) + w * (az * pull - bz * ahead)
        if ti.static(several):
            put(self.total, kind * self.size + p, apart, at(self.total, kind * self.size + p, apart) + pull)
        put(self.iterate[0], q, apart, x)
        put(self.iterate[1], q, apart, y)
        put(self.iterate[2], q, apart, z)

    @ti.func
    def eliminate_hinges(self, p, offset, kind, k0, lag, several: Template, apart: Template):
        """Hinges at p between p − offset and p + offset: their rows of the pentadiagonal system."""
        size = ti.static(self.size)
        x0, y0, z0, u0, v0, t0 = self.gap(p, -offset, apart)
        x1, y1, z1, u1, v1, t1 = self.gap(p, offset, apart)
        w0, w, w1 = at(self.weight, p - offset, apart), at(self.weight, p, apart), at(self.weight, p + offset, apart)
        k = k0 * at(self.share, kind * size + p, apart)
        k = k / (1.0 + k * (w0 + 4.0 * w + w1) / RESOLVED)
        stiff = k * (1.0 + lag)
        e, f = stiff * w0 * self.there(kind, p - 2 * offset, apart), stiff * w1
        a, c = -2.0 * stiff * (w0 + w) * self.there(kind, p - offset, apart), -2.0 * stiff * (w + w1)
        a -= e * at(self.gain, p - 2 * offset, apart)
        whole = 1.0 + stiff * (w0 + 4.0 * w + w1)
        pivot = whole - e * at(self.gain2, p - 2 * offset, apart) - a * at(self.gain, p - offset, apart)
        pivot = 1.0 / ti.max(pivot, SMALLEST_PIVOT * whole)
        u, v, t = (1.0 + lag) * (u0 + u1), (1.0 + lag) * (v0 + v1), (1.0 + lag) * (t0 + t1)
        r0, r1, r2 = -k * (x0 + x1 + u), -k * (y0 + y1 + v), -k * (z0 + z1 + t)
        if ti.static(several):
            base = kind * size + p
            r0 -= at(self.total, base, apart)
            r1 -= at(self.total, base + KINDS * size, apart)
            r2 -= at(self.total, base + 2 * KINDS * size, apart)
        for axis, r in ti.static(((0, r0), (1, r1), (2, r2))):
            far, near = at(self.pull[axis], p - 2 * offset, apart), at(self.pull[axis], p - offset, apart)
            put(self.pull[axis], p, apart, (r - e * far - a * near) * pivot)
        put(self.gain2, p, apart, f * pivot)
        put(self.gain, p, apart, (c - a * at(self.gain2, p - offset, apart)) * pivot)

    @ti.func
    def substitute_hinges(self, p, offset, kind, several: Template, apart: Template):
        """λ of the hinges at p, given the two ahead; moves the key points at p + offset."""
        q = p + offset
        near, far, w = at(self.gain, p, apart), at(self.gain2, p, apart), at(self.weight, q, apart)
        there = self.there(kind, q + offset, apart)
        for axis in ti.static(range(3)):
            l1, l2 = at(self.pull[axis], q, apart), there * at(self.pull[axis], q + offset, apart)
            pull = at(self.pull[axis], p, apart) - near * l1 - far * l2
            u = at(self.iterate[axis], q, apart) + w * (pull - 2.0 * l1 + l2)
            if ti.static(several):
                base = (axis * KINDS + kind) * self.size + p
                put(self.total, base, apart, at(self.total, base, apart) + pull)
            put(self.pull[axis], p, apart, pull)
            put(self.iterate[axis], q, apart, u)

    @ti.func
    def sweep(self, turn, hinges: Template, several: Template, lag):
        """One sweep over all kinds, the stiffest last: the warp in sweeps of turn 0, the weft in those of turn 1.

        The last is right and disturbs the others where the threads are not square to each other: they take turns.
        """
        if ti.static(hinges):
            self.rowwise(0, True, several, lag)
            self.columnwise(3, 4, True, several, lag)
        else:
            self.rowwise(2, False, several, lag)
            self.columnwise(4, 5, False, several, lag)
        for stage in range(3):  # diagonals, then weft and warp
            if stage == 1 + turn:
                self.rowwise(1, False, several, lag)
            else:
                self.columnwise(5 if stage == 0 else 7, 7 if stage == 0 else 8, False, several, lag)

    @ti.func
    def rowwise(self, kind, hinges: Template, several: Template, lag):
        """Chains along the rows: a lane is a row."""
        width, row = ti.static(self.width, self.width)
        o = self.offset[kind]
        k0, rest, rest_x, rest_y = self.constant[kind], self.rest[kind], self.rest_x[kind], self.rest_y[kind]
        for block in range((self.rows - 2 * PAD) // LANES):
            start = (PAD + block * LANES) * width
            for j in range(width):
                if ti.static(hinges):
                    self.eliminate_hinges(start + j, o, kind, k0, lag, several, row)
                else:
                    self.eliminate(start + j, o, kind, k0, rest, rest_x, rest_y, lag, several, row)
            for back in range(width):
                p = start + width - 1 - back - o
                if ti.static(hinges):
                    self.substitute_hinges(p, o, kind, several, row)
                else:
                    self.substitute(p, o, kind, several, row)

    @ti.func
    def columnwise(self, first, last, hinges: Template, several: Template, lag):
        """Chains across the rows: a lane is a column, or a diagonal."""
        blocks = ti.static(self.width // LANES)
        for kind in range(first, last):
            o = self.offset[kind]
            k0, rest, rest_x, rest_y = self.constant[kind], self.rest[kind], self.rest_x[kind], self.rest_y[kind]
            for b in range(PAD * blocks, (self.rows - PAD) * blocks):
                if ti.static(hinges):
                    self.eliminate_hinges(b * LANES, o, kind, k0, lag, several, 1)
                else:
                    self.eliminate(b * LANES, o, kind, k0, rest, rest_x, rest_y, lag, several, 1)
            for back in range(self.rows * blocks - PAD * blocks):
                p = ((self.rows - PAD) * blocks - 1 - back) * LANES
                if ti.static(hinges):
                    self.substitute_hinges(p, o, kind, several, 1)
                else:
                    self.substitute(p, o, kind, several, 1)
