"""One substep of 8 neighbouring key points: springs, hinges, air, contact. Straight-line code without a branch.

LLVM turns it into vector instructions because the 8 lanes are loaded from consecutive elements of separate fields,
what is added to their number is bounded (`near`), and fast_math is off. All of that is needed: each one missing costs a
factor of two to four, silently. How long rows are is read when it runs: sheets of any shape share the code.

Everything is scaled so that inverse mass × sum is a displacement: constants come multiplied by h².

Damping of Kelvin and Voigt, a stress σ(ε + τ dε/dt), is to first order the stress at x + τ v, where the cloth would be
a time τ later. So springs and hinges are measured there, at `ahead`, and cost no more than without damping; and as they
read nothing else, positions change in place. What is ahead has two buffers that take turns: a substep reads one and
fills the other, unless something moves key points after it: then `lead` fills it anew. Without damping and without
that, positions are what is ahead, and are not kept beside it within a frame.

The same functions serve a graphics device, which takes one key point a thread: then `load` gives a number and not
lanes (`taking`).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Features", "Lanes", "Stencil", "taken", "taking"]

if TYPE_CHECKING:
    Lanes = Any
else:
    Lanes = ti.types.vector(LANES, ti.f32)
"""Of 8 neighbouring key points a number each, as the argument of a routine."""


@dataclass(frozen=True)
class Features:
    """What the kernel contains. Taichi compiles one kernel for each combination that is used."""

    threads: bool  # structural springs; without them whole yarns are solved instead
    hinges: bool
    diagonals: bool  # springs; without them cells shear, if anything does
    wind: bool
    sphere: bool
    plane: bool
    grips: bool  # ball and plane hold the place of what does not slide, and not only its speed (`grip.py`)
    twists: bool  # cells resist to be twisted
    slips: bool  # something rubs or locks within the sheet (`slipping.py`)
    leads: bool  # a substep says what is ahead of it: nothing moves key points after it
    apart: bool  # positions are not what is ahead: by damping, or because constraints change them


_at_once = [LANES]


def taken() -> int:
    """Neighbours that `load` and `store` take at once, in what is being compiled: LANES, or 1."""
    return _at_once[-1]


@contextmanager
def taking(count: int) -> Iterator[None]:
    """Kernels first called within take so many neighbours at once: LANES on a CPU, 1 a thread on a device."""
    _at_once.append(count)
    try:
        yield
    finally:
        _at_once.pop()


BALL, FLOOR = 0, 1
"""Fixed shapes."""


@ti.func
def load(field: Template, p):
    if ti.static(taken() == 1):
        return field[p]
    else:
        return ti.Vector([field[p + k] for k in ti.static(range(LANES))])


@ti.func
def store(field: Template, p, values):
    if ti.static(taken() == 1):
        field[p] = values
    else:
        for k in ti.static(range(LANES)):
            field[p + k] = values[k]


@ti.func
def nothing():
    """0, for each of what is taken at once."""
    if ti.static(taken() == 1):
        return 0.0
    else:
        return ti.Vector([0.0] * LANES)


@ti.func
def load_xyz(place: Template, p):
    """The lanes at p of a vector's three fields."""
    return load(place[0], p), load(place[1], p), load(place[2], p)


@ti.func
def relative(place: Template, p, origin):
    """The same less one vector."""
    return load(place[0], p) - origin[0], load(place[1], p) - origin[1], load(place[2], p) - origin[2]


@ti.func
def largest(values):
    """Of the lanes; in halves, as vector instructions have it."""
    if ti.static(taken() == 1):
        return values
    else:
        four = ti.Vector([ti.max(values[k], values[k + 4]) for k in ti.static(range(4))])
        two = ti.Vector([ti.max(four[k], four[k + 2]) for k in ti.static(range(2))])
        return ti.max(two[0], two[1])


@ti.func
def scaled(vector: Template, factor):
    """A vector of lanes times a number a lane."""
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


@ti.func
def area_around(work: Template, around: Template, p):
    """The area vector of the lanes at p times 4, of the cells around, so it is right at edges too. work: the `Stencil`.
    around: see there."""
    row = work.row[None]
    e, w = ti.min(2.0 * load(work.east, p), 1.0), ti.min(2.0 * load(work.east, near(p - 1)), 1.0)
    s, t = ti.min(2.0 * load(work.north, p), 1.0), ti.min(2.0 * load(work.north, near(p - row)), 1.0)
    x1, y1, z1 = around[1]
    x2, y2, z2 = around[2]
    ax, ay, az = e * x1 - w * x2, e * y1 - w * y2, e * z1 - w * z2
    x1, y1, z1 = around[3]
    x2, y2, z2 = around[4]
    bx, by, bz = s * x1 - t * x2, s * y1 - t * y2, s * z1 - t * z2
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@ti.func
def push_out(nx, ny, nz, depth, friction, dx, dy, dz):
    """The step (dx, dy, dz) [m] after a push out by `depth` along n, and Coulomb friction of at most µ × push."""
    along = dx * nx + dy * ny + dz * nz
    tx, ty, tz = dx - along * nx, dy - along * ny, dz - along * nz
    held = ti.min(friction * depth / ti.sqrt(tx * tx + ty * ty + tz * tz + 1e-30), 1.0)
    return dx + depth * nx - held * tx, dy + depth * ny - held * ty, dz + depth * nz - held * tz


@ti.func
def rub_anew(nx, ny, nz, pressed, friction, dx, dy, dz, fx, fy, fz):
    """Friction [m] so far (fx, fy, fz), brought to what stops the slip that is left in the step (dx, dy, dz): at most
    µ × what presses along n (Coulomb)."""
    along = dx * nx + dy * ny + dz * nz
    gx, gy, gz = fx - dx + along * nx, fy - dy + along * ny, fz - dz + along * nz
    share = ti.min(friction * pressed / ti.sqrt(gx * gx + gy * gy + gz * gz + 1e-30), 1.0)
    return share * gx, share * gy, share * gz


@ti.func
def near(p):
    """Element p of a padded grid. The bounds tell the compiler that nothing overflows."""
    return ti.min(ti.max(p, 0), 1 << 24)


@ti.func
def listed(p):
    """The same of a list, which may be longer than any grid."""
    return ti.min(ti.max(p, 0), 1 << 30)


@ti.data_oriented
class Stencil:
    """Work memory for substeps, and the weights. `size` elements, of which a sheet has its padded grid in the first.

    row: width of the grid.

    position, step: [axis] fields [m]. ahead: [axis], position and what is moved within the lag of the stress [m], both
    buffers one after the other: element p of the second is size + p, so that one copy of the code serves both. east,
    north, cell: weights of `Sheet`. inverse_mass: [1/kg]. cloths: how many there may be in the sheet, and cloth: which
    one lanes are of, where that is more than one. slipping: of sheets that have friction within, grip: of those that
    meet themselves, else None.
    """

    slipping: Any = None
    grip: Any = None

    def __init__(self, size: int, cloths: int = 1) -> None:
        def fields(count: int, buffers: int = 1) -> list[ti.Field]:
            return [ti.field(ti.f32, buffers * size) for _ in range(count)]

        self.size, self.row, self.cloths = size, ti.field(ti.i32, ()), cloths
        self.cloth: Any = ti.field(ti.i32, size // LANES) if cloths > 1 else None
        self.position, self.step, self.ahead = fields(3), fields(3), fields(3, 2)
        self.east, self.north, self.cell, self.inverse_mass = fields(4)

    @ti.func
    def kind(self, p):
        """Which cloth the lanes at p are of."""
        return ti.min(ti.max(self.cloth[p // LANES], 0), self.cloths - 1)

    @ti.func
    def lanes(self, p):
        """Element p, a whole number of what is taken at once. The bounds tell the compiler that nothing overflows."""
        return ti.min(ti.max(p // ti.static(taken()), 0), 1 << 24) * ti.static(taken())

    @ti.func
    def away(self, place: Template, here: Template, p, offset):
        """Vectors from the lanes that are `here` to those at p + offset. place: position or ahead."""
        x, y, z = load_xyz(place, near(p + offset))
        return x - here[0], y - here[1], z - here[2]

    @ti.func
    def around(self, p):
        """The lanes ahead at p, and vectors from there to the next and the last in the row, and in the column.

        What is needed often is loaded once: a kernel takes as long to compile as the square of what it loads.
        """
        row = self.row[None]
        here = load_xyz(self.ahead, p)
        return (
            here,
            self.away(self.ahead, here, p, 1),
            self.away(self.ahead, here, p, -1),
            self.away(self.ahead, here, p, row),
            self.away(self.ahead, here, p, -row),
        )

    @ti.func
    def lead(self, p, n: Template):
        """Where the lanes at p would be a lag later, into the first buffer."""
        for axis in ti.static(range(3)):
            store(self.ahead[axis], p, load(self.position[axis], p) + n.lag * load(self.step[axis], p))

    @ti.func
    def settle(self, p, at):
        """The positions of the lanes at p from a buffer of what is ahead."""
        for axis in ti.static(range(3)):
            store(self.position[axis], p, load(self.ahead[axis], self.lanes(p + at)))

    @ti.func
    def spring(self, to: Template, constant, rest):
        """Pull of the spring along the vector `to`."""
        factor = constant * (1.0 - rest / ti.sqrt(ti.max(to[0] * to[0] + to[1] * to[1] + to[2] * to[2], 1e-20)))
        return factor * to[0], factor * to[1], factor * to[2]

    @ti.func
    def bend(self, around: Template, to: Template, back: Template, a, p, offset, weight: Template, beta):
        """Pull of the three hinges that p is part of, in the direction of neighbours at ±offset. to, back: the vectors
        to these."""
        before, here = load(weight, near(p - offset)), load(weight, p)
        c_minus = ti.min(load(weight, near(p - 2 * offset)), before)
        c_here = ti.min(before, here)
        c_plus = ti.min(here, load(weight, near(p + offset)))
        far = self.away(self.ahead, around[0], a, 2 * offset)
        far_back = self.away(self.ahead, around[0], a, -2 * offset)
        return (
            beta
            * (
                2.0 * c_here * (to[0] + back[0])
                - c_plus * (far[0] - 2.0 * to[0])
                - c_minus * (far_back[0] - 2.0 * back[0])
            ),
            beta
            * (
                2.0 * c_here * (to[1] + back[1])
                - c_plus * (far[1] - 2.0 * to[1])
                - c_minus * (far_back[1] - 2.0 * back[1])
            ),
            beta
            * (
                2.0 * c_here * (to[2] + back[2])
                - c_plus * (far[2] - 2.0 * to[2])
                - c_minus * (far_back[2] - 2.0 * back[2])
            ),
        )

    @ti.func
    def second(self, around: Template, a, p, offset, weight: Template, k, rest):
        """Pull of the paper's two springs to the second neighbours at ±2 offset."""
        ahead = ti.min(load(weight, p), load(weight, near(p + offset)))
        behind = ti.min(load(weight, near(p - offset)), load(weight, near(p - 2 * offset)))
        to, back = self.away(self.ahead, around[0], a, 2 * offset), self.away(self.ahead, around[0], a, -2 * offset)
        x, y, z = self.spring(to, k * ahead, rest)
        u, v, w = self.spring(back, k * behind, rest)
        return x + u, y + v, z + w

    @ti.func
    def elastic(self, features: Template, around: Template, a, p, n: Template):
        """Pull of all springs and hinges on the lanes at p, at a of `ahead`. around: what is there, see there."""
        row = self.row[None]
        x, y, z = nothing(), nothing(), nothing()
        if ti.static(features.threads):
            e, w = load(self.east, p), load(self.east, near(p - 1))
            x, y, z = self.spring(around[1], n.structural_x * e, n.spacing_x)
            u, v, t = self.spring(around[2], n.structural_x * w, n.spacing_x)
            x, y, z = x + u, y + v, z + t
            e, w = load(self.north, p), load(self.north, near(p - row))
            u, v, t = self.spring(around[3], n.structural_y * e, n.spacing_y)
            x, y, z = x + u, y + v, z + t
            u, v, t = self.spring(around[4], n.structural_y * w, n.spacing_y)
            x, y, z = x + u, y + v, z + t
        for number, corner, cell in ti.static(
            ((0, row + 1, 0), (1, -row - 1, -row - 1), (2, row - 1, -1), (3, 1 - row, -row))
        ):
            share = load(self.cell, near(p + cell))
            to = self.away(self.ahead, around[0], a, corner)
            if ti.static(features.diagonals):
                u, v, t = self.spring(to, n.diagonal * share, n.diagonal_length)
                x, y, z = x + u, y + v, z + t
            if ti.static(features.slips):
                u, v, t = scaled(to, load(self.slipping.sheared[number // 2], near(p + cell)))
                x, y, z = x + u, y + v, z + t
            if ti.static(features.twists):
                k = n.twist * share
                one, two = ti.static(around[1 if number % 3 == 0 else 2], around[3 if number % 2 == 0 else 4])
                x, y, z = (
                    x + k * (one[0] + two[0] - to[0]),
                    y + k * (one[1] + two[1] - to[1]),
                    z + k * (one[2] + two[2] - to[2]),
                )
        if ti.static(features.slips):
            x, y, z = (
                x + self.slipping.bending(0, p, row),
                y + self.slipping.bending(1, p, row),
                z + self.slipping.bending(2, p, row),
            )
        elif ti.static(features.hinges):
            u, v, t = self.bend(around, around[1], around[2], a, p, 1, self.east, n.hinge_x)
            x, y, z = x + u, y + v, z + t
            u, v, t = self.bend(around, around[3], around[4], a, p, row, self.north, n.hinge_y)
            x, y, z = x + u, y + v, z + t
        if ti.static(not features.hinges):
            u, v, t = self.second(around, a, p, 1, self.east, n.second_x, 2.0 * n.spacing_x)
            x, y, z = x + u, y + v, z + t
            u, v, t = self.second(around, a, p, row, self.north, n.second_y, 2.0 * n.spacing_y)
            x, y, z = x + u, y + v, z + t
        return x, y, z

    @ti.func
    def air(self, around: Template, p, dx, dy, dz, wind, n: Template):
        """Drag and lift of the wind × h²."""
        nx, ny, nz = scaled(area_around(self, around, p), 0.25)
        ux, uy, uz = wind[0] - n.rate * dx, wind[1] - n.rate * dy, wind[2] - n.rate * dz
        speed = ti.sqrt(ux * ux + uy * uy + uz * uz + 1e-30)
        area = ti.sqrt(nx * nx + ny * ny + nz * nz + 1e-30)
        through = nx * ux + ny * uy + nz * uz
        along = n.wind_drag * ti.abs(through) - n.wind_lift * through * through / (area * speed)
        across = n.wind_lift * through * speed / area
        return along * ux + across * nx, along * uy + across * ny, along * uz + across * nz

    @ti.func
    def accelerate(self, features: Template, a, p, wind, n: Template):
        """dx ← D dx + a h² of the lanes at p, by springs, hinges, wind and gravity, at a of `ahead`: 1, or 0 for pinned
        and absent key points, which keep their step; and the step [m]."""
        sx, sy, sz = load(self.step[0], p), load(self.step[1], p), load(self.step[2], p)
        # Forces × h².
        around = self.around(a)
        fx, fy, fz = self.elastic(features, around, a, p, n)
        if ti.static(features.wind):
            x, y, z = self.air(around, p, sx, sy, sz, wind, n)
            fx, fy, fz = fx + x, fy + y, fz + z
        inverse = load(self.inverse_mass, p)
        free = ti.min(inverse * 1e30, 1.0)  # 1, or 0 for pinned and absent key points, which keep their step
        dx = sx + free * ((n.kept - 1.0) * sx + inverse * fx + n.gravity_x)
        dy = sy + free * ((n.kept - 1.0) * sy + inverse * fy + n.gravity_y)
        dz = sz + free * ((n.kept - 1.0) * sz + inverse * fz + n.gravity_z)
        return free, dx, dy, dz

    @ti.func
    def collide(self, features: Template, p, free, px, py, pz, dx, dy, dz, n: Template):
        """The step (dx, dy, dz) [m] of the lanes at p from (px, py, pz) after the fixed ball and half space, and how
        far these hold them back beside it. free: 0 for pinned ones."""
        bx, by, bz = nothing(), nothing(), nothing()
        if ti.static(features.sphere):
            x, y, z = px + dx - n.sphere_x, py + dy - n.sphere_y, pz + dz - n.sphere_z
            distance = ti.sqrt(ti.max(x * x + y * y + z * z, 1e-12))
            depth = free * ti.max(n.sphere_radius - distance, 0.0)
            away, at = scaled((x, y, z), 1.0 / distance), (px, py, pz)
            dx, dy, dz, bx, by, bz = self.keep_out(features, BALL, p, away, depth, n.sphere_friction, at, (dx, dy, dz))
        if ti.static(features.plane):
            x, y, z = px + dx, py + dy, pz + dz
            depth = free * ti.max(n.plane_height - (x * n.plane_x + y * n.plane_y + z * n.plane_z), 0.0)
            away, at = (n.plane_x, n.plane_y, n.plane_z), (px, py, pz)
            dx, dy, dz, u, v, w = self.keep_out(features, FLOOR, p, away, depth, n.plane_friction, at, (dx, dy, dz))
            bx, by, bz = bx + u, by + v, bz + w
        return dx, dy, dz, bx, by, bz

    @ti.func
    def keep_out(
        self, features: Template, shape: Template, p, n: Template, depth, friction, at: Template, step: Template
    ):
        """The step [m] of the lanes at p from `at` after a fixed shape has pushed them out by `depth` along n, and how
        far it holds them back beside it."""
        x, y, z = push_out(n[0], n[1], n[2], depth, friction, step[0], step[1], step[2])
        bx, by, bz = nothing(), nothing(), nothing()
        if ti.static(features.grips):
            taken = x - step[0] - depth * n[0], y - step[1] - depth * n[1], z - step[2] - depth * n[2]
            bx, by, bz = self.grip.back(shape, p, n, friction * depth, taken, (at[0] + x, at[1] + y, at[2] + z))
        return x, y, z, bx, by, bz
