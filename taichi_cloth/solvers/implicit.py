"""Implicit steps for stiff cloth, by whole threads: finite for any stiffness and any step.

Order 1, the default: implicit Euler, V⁺ = V + h² a, u = V⁺, with V = h v and u = x(t + h) − x(t); gravity moves x by
g h²/2, so that free fall is exact. It settles from every start that was tried (tests/test_stiff.py).

Order 2: BDF2, with s the u and V₋ the V before,

    V⁺ = (4 V − V₋ + 2 h² a) / 3,      u = s/3 + 2 V⁺/3

(Euler in the first step of a frame, where pins change course, and for key points that touch a body). It holds back
what moves slowly less, but a violent start (a sheet collapsed to a point) can keep it flying for ever: for sheets that
start whole.

Springs: one Gauss–Seidel sweep over whole threads (`lines.py`) a step; more sweeps solve the step more exactly. Air
drag is linearised, F(v) − D (v⁺ − v), with D = 1.5 |F|/|v|; what it adds to the mass also weakens the springs' hold in
the step, so that a steady wind gets its steady answer.

A step runs on one thread, and the bytes cannot depend on their number.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false

from functools import lru_cache
from math import ceil

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.arrays import F32x2, F32x3, Float, Int, Template
from taichi_cloth.errors import InputError
from taichi_cloth.forces import Forces, FrameForces
from taichi_cloth.sheet import LANES, PAD, Sheet, SheetState
from taichi_cloth.solvers.base import Solver
from taichi_cloth.solvers.lines import KINDS, Lines
from taichi_cloth.solvers.stencil import Features, Numbers, contact, load, store
from taichi_cloth.solvers.verlet import spring_numbers

__all__ = ["Implicit"]

STEP = 1.0e-3
"""Longest step [s] that is taken where none is asked for."""

DRAG = 1.5
"""D |v| / |F| of the air; stable from ½ of dF/dv on, which is 2 for drag."""

TOUCHING = 1.0e-5
"""Distance [m] from a body at which a key point counts as lying on it."""


class Implicit(Solver):
    """Whole threads solved implicitly, for one sheet.

    frame_rate: frames a second [1/s]. step: the longest allowed [s]. sweeps: over all threads, a step.
    order: 1, implicit Euler; 2, BDF2 with weft and warp taking turns at being solved last.
    Raises InputError on numbers that are not above 0, or another order.
    """

    staggered = False

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float = 60.0,
        step: float | None = None,
        sweeps: int = 1,
        order: int = 1,
    ) -> None:
        for name, value in (("frame_rate", frame_rate), ("step", STEP if step is None else step), ("sweeps", sweeps)):
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"solver.{name}: {value!r}; allowed: above 0")
        if order not in (1, 2):
            raise InputError(f"solver.order: {order!r}; allowed: 1 (settles from any start) or 2 (BDF2)")
        for name in ("body", "strain_limit", "self_contact"):
            if getattr(forces, name) is not None:
                what = name.replace("_", " ")
                raise InputError(f'solver.name: "implicit" has no {what}; use "verlet", or leave it out')
        self.sheet, self.frame_rate, self.sweeps, self.order = sheet, frame_rate, sweeps, order
        self.substeps = max(1, ceil(1 / frame_rate / (step or STEP) - 1e-9))
        self.step = 1 / frame_rate / self.substeps
        self._features = Features(
            hinges=sheet.springs.law == "hinge",
            fibre_damping=False,
            wind=forces.wind is not None,
            sphere=forces.sphere is not None,
            plane=forces.plane is not None,
            limit=False,
        )
        self._numbers = Numbers(**spring_numbers(sheet, forces, self.step))

    def advance(self, state: SheetState, forces: FrameForces) -> None:
        sheet, work = self.sheet, _workspace(runtime.generation(), self.sheet.padded_shape)
        if work.holder is not self:
            weights = np.stack([sheet.padded(v) for v in sheet.weights])
            work.take_model(
                _shares(sheet), sheet.padded(sheet.inverse_mass), weights, _table(sheet, self.step, sheet.width)
            )
            work.holder = self
        wind, last = np.asarray(forces.wind_start), np.asarray(forces.wind_end)
        change = (last - wind) / self.substeps
        damping = sheet.material.air_damping * self.step
        several = self.sweeps > 1
        with runtime.plain_code():
            work.frame(
                *(self._numbers, damping, *wind.tolist(), *change.tolist(), self.substeps, self.sweeps, self.order),
                *(self._features, several, state.values),
            )


def _shares(sheet: Sheet) -> NDArray[np.float32]:
    """(KINDS, rows, cols): share of a kind's constant at the key point where a spring starts, or a hinge's middle."""
    east, north, cell = sheet.weights
    falling = np.zeros_like(cell)
    falling[:, 1:] = cell[:, :-1]
    next_east, next_north = np.roll(east, -1, 1), np.roll(north, -1, 0)  # what comes round is 0
    last_east, last_north = np.roll(east, 1, 1), np.roll(north, 1, 0)
    bend_x, bend_y = np.minimum(last_east, east), np.minimum(last_north, north)
    second_x, second_y = np.minimum(east, next_east), np.minimum(north, next_north)
    return np.stack([bend_x, east, second_x, bend_y, second_y, cell, falling, north]).astype(np.float32)


def _table(sheet: Sheet, step: float, width: int) -> NDArray[np.float32]:
    """(KINDS, 5): offset, constant × h² [N s²/m], length [m] and direction (2) at rest."""
    s, row = sheet.springs, width
    a, b, l = s.spacing_x, s.spacing_y, s.diagonal_length  # noqa: E741
    rows = [
        (1, s.hinge_x, a, 1.0, 0.0),
        (1, s.structural_x, a, 1.0, 0.0),
        (2, s.second_x, 2 * a, 1.0, 0.0),
        (row, s.hinge_y, b, 0.0, 1.0),
        (2 * row, s.second_y, 2 * b, 0.0, 1.0),
        (row + 1, s.diagonal, l, a / l, b / l),
        (row - 1, s.diagonal, l, -a / l, b / l),
        (row, s.structural_y, b, 0.0, 1.0),
    ]
    return np.array([(o, k * step**2, r, x, y) for o, k, r, x, y in rows], np.float32)


@lru_cache(maxsize=16)
def _workspace(generation: int, shape: tuple[int, int]) -> "_Workspace":
    """Fields and kernels for grids of that shape. generation: of the Taichi runtime; a new start throws them away."""
    rows, width = shape
    return _Workspace(rows, width)


@ti.data_oriented
class _Workspace(Lines):
    """The kernels of a frame. rows, width: of the sheet's padded grid."""

    def __init__(self, rows: int, width: int) -> None:
        self.own = rows
        super().__init__(2 * PAD + -(-(rows - 2 * PAD) // LANES) * LANES, width)
        self.last = [ti.field(ti.f32, self.size) for _ in range(3)]
        self.former = [ti.field(ti.f32, self.size) for _ in range(3)]
        self.held = ti.field(ti.f32, self.size)
        self.holder: Implicit | None = None

    @ti.kernel
    def take_model(self, shares: F32x3, inverse_mass: F32x2, weights: F32x3, table: F32x2):
        ti.loop_config(serialize=True)
        for k in range(KINDS):
            self.offset[k] = ti.cast(table[k, 0], ti.i32)
            self.constant[k] = table[k, 1]
            self.rest[k] = table[k, 2]
            self.rest_x[k] = table[k, 3]
            self.rest_y[k] = table[k, 4]
            for i in range(shares.shape[1]):
                for j in range(shares.shape[2]):
                    self.share[k * self.size + (i + PAD) * self.width + j] = shares[k, i, j]
        for i in range(self.own):
            for j in range(self.width):
                p = i * self.width + j
                self.east[p] = weights[0, i, j]
                self.north[p] = weights[1, i, j]
                self.inverse_mass[p] = inverse_mass[i, j]

    @ti.func
    def distance(self, features: Template, p, n: Template):
        """From the nearest body [m]; large where there is none."""
        x, y, z = load(self.position[0], p), load(self.position[1], p), load(self.position[2], p)
        out = 0.0 * x + 1e30
        if ti.static(features.sphere):
            u, v, w = x - n.sphere_x, y - n.sphere_y, z - n.sphere_z
            out = ti.min(out, ti.sqrt(u * u + v * v + w * w) - n.sphere_radius)
        if ti.static(features.plane):
            out = ti.min(out, x * n.plane_x + y * n.plane_y + z * n.plane_z - n.plane_height)
        return out

    @ti.func
    def predict(self, features: Template, p, first, damping, wind, n: Template):
        """u of the lanes at p without springs, and the weight w that the step gives them."""
        inverse = load(self.inverse_mass, p)
        free = ti.min(inverse * 1e30, 1.0)
        if first > 0.5:
            near = self.distance(features, p, n)
            store(self.held, p, ti.select(near < TOUCHING, 1.0, 0.0))
        held = load(self.held, p)
        euler = ti.max(held, first)
        half = 0.5 * first * (1.0 - held)
        share = (2.0 + euler) / 3.0
        v0, v1, v2 = load(self.step[0], p), load(self.step[1], p), load(self.step[2], p)
        fx, fy, fz = 0.0 * v0, 0.0 * v1, 0.0 * v2
        drag = 0.0 * v0
        if ti.static(features.wind):
            fx, fy, fz = self.air(p, p, v0, v1, v2, wind, n)
            ux, uy, uz = wind[0] - n.rate * v0, wind[1] - n.rate * v1, wind[2] - n.rate * v2
            drag = DRAG * n.rate * inverse
            drag *= ti.sqrt((fx * fx + fy * fy + fz * fz) / (ux * ux + uy * uy + uz * uz + 1e-30))
            fx, fy, fz = inverse * fx, inverse * fy, inverse * fz
        scale = 1.0 / (1.0 + share * (drag + damping))
        for axis, v, f, g in ti.static(((0, v0, fx, n.gravity_x), (1, v1, fy, n.gravity_y), (2, v2, fz, n.gravity_z))):
            before, s = load(self.former[axis], p), load(self.last[axis], p)
            base = ti.select(euler > 0.5, v, (4.0 * v - before) / 3.0)
            after = scale * (base + share * (f + drag * v + g))
            u = ti.select(euler > 0.5, after - half * g, (s + 2.0 * after) / 3.0)
            store(self.iterate[axis], p, ti.select(free > 0.5, u, v))
        store(self.weight, p, inverse * share * share * scale)

    @ti.func
    def touch(self, features: Template, p, n: Template):
        """Bodies: what lies inside is pushed out, and friction holds it. From the iterate to buffer 1."""
        free = ti.min(load(self.inverse_mass, p) * 1e30, 1.0)
        px, py, pz = load(self.position[0], p), load(self.position[1], p), load(self.position[2], p)
        dx, dy, dz = load(self.iterate[0], p), load(self.iterate[1], p), load(self.iterate[2], p)
        if ti.static(features.sphere):
            x, y, z = px + dx - n.sphere_x, py + dy - n.sphere_y, pz + dz - n.sphere_z
            distance = ti.sqrt(ti.max(x * x + y * y + z * z, 1e-12))
            depth = free * ti.max(n.sphere_radius - distance, 0.0)
            scale = 1.0 / distance
            dx, dy, dz = contact(features, x * scale, y * scale, z * scale, depth, n.sphere_friction, dx, dy, dz)
        if ti.static(features.plane):
            x, y, z = px + dx, py + dy, pz + dz
            depth = free * ti.max(n.plane_height - (x * n.plane_x + y * n.plane_y + z * n.plane_z), 0.0)
            dx, dy, dz = contact(features, n.plane_x, n.plane_y, n.plane_z, depth, n.plane_friction, dx, dy, dz)
        for axis, x, d in ti.static(((0, px, dx), (1, py, dy), (2, pz, dz))):
            store(self.step[axis], self.size + p, d)
            store(self.position[axis], self.size + p, x + d)

    @ti.func
    def finish(self, p, first, n: Template):
        """Velocities of the lanes at p, and the step's end becomes the next one's start."""
        free = ti.min(load(self.inverse_mass, p) * 1e30, 1.0)
        held = load(self.held, p)
        half = 0.5 * first * (1.0 - held)
        pushed = 0.0 * free
        for axis in ti.static(range(3)):
            pushed += ti.abs(load(self.step[axis], self.size + p) - load(self.iterate[axis], p))
        touched = ti.min(pushed * 1e30, 1.0)
        simple = ti.max(touched, held)
        for axis, g in ti.static(((0, n.gravity_x), (1, n.gravity_y), (2, n.gravity_z))):
            u, s, v = load(self.step[axis], self.size + p), load(self.last[axis], p), load(self.step[axis], p)
            after = ti.select(ti.max(simple, first) > 0.5, u + (1.0 - simple) * half * g, 1.5 * u - 0.5 * s)
            store(self.former[axis], p, v)
            store(self.last[axis], p, u)
            store(self.step[axis], p, ti.select(free > 0.5, after, v))
            store(self.position[axis], p, load(self.position[axis], self.size + p))
        store(self.held, p, touched)

    @ti.kernel
    def frame(
        self,
        # in
        n: Numbers,
        damping: Float,
        wind_x: Float,
        wind_y: Float,
        wind_z: Float,
        change_x: Float,
        change_y: Float,
        change_z: Float,
        steps: Int,
        sweeps: Int,
        order: Int,
        features: Template,
        several: Template,
        # in and out
        values: F32x3,
    ):
        ti.loop_config(serialize=True)
        for _once in range(1):
            for i in range(self.own):
                for j in range(self.width):
                    for c in ti.static(range(3)):
                        self.position[c][i * self.width + j] = values[c, i, j]
                        self.step[c][i * self.width + j] = values[3 + c, i, j]
            low = PAD * self.width // LANES
            high = (self.rows - PAD) * self.width // LANES
            for done in range(steps):
                first = ti.select(done == 0 or order == 1, 1.0, 0.0)
                wind = ti.Vector([wind_x + done * change_x, wind_y + done * change_y, wind_z + done * change_z])
                for b in range(low, high):
                    self.predict(features, b * LANES, first, damping, wind, n)
                if ti.static(several):
                    for q in range(3 * KINDS * self.size):
                        self.total[q] = 0.0
                for turn in range(sweeps):
                    self.sweep(ti.select(order == 1, turn, done + turn) % 2, features.hinges, several, n.lag)
                for b in range(low, high):
                    self.touch(features, b * LANES, n)
                for b in range(low, high):
                    self.finish(b * LANES, first, n)
            for i in range(PAD, self.own - PAD):
                for j in range(self.width):
                    for c in ti.static(range(3)):
                        values[c, i, j] = self.position[c][i * self.width + j]
                        values[3 + c, i, j] = self.step[c][i * self.width + j]
