"""Explicit Störmer–Verlet (paper 3.2): x(t + h) = x(t) + (x(t) − x(t − h)) + a h², a frame in one kernel.

The step follows from the springs: h = safety × the longest that is stable (`stability.py`), so a person names a frame
rate only.

Threads: the rows are cut into strips, one a thread. A strip takes its rows and a halo of two more for each substep
until the strips meet again, and works on its own copy; the halo, which shrinks by two rows a substep, is computed
twice. Nobody waits inside a kernel, so nothing can hang, and as every key point goes through the same arithmetic
the bytes do not depend on the number of threads.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false
# pyright: reportArgumentType=false

from copy import copy
from functools import lru_cache
from math import ceil, exp, expm1

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.arrays import F32x3, Float, I32x2, Int, Template
from taichi_cloth.contact import Contact
from taichi_cloth.contact_middles import MiddleContact
from taichi_cloth.errors import InputError
from taichi_cloth.forces import Forces, FrameForces
from taichi_cloth.sheet import LANES, PAD, Sheet, SheetState
from taichi_cloth.solvers.base import Solver
from taichi_cloth.solvers.passes import MEETING, Pass, strips_allowed
from taichi_cloth.solvers.self_contact import ClothContact
from taichi_cloth.solvers.stability import highest_frequency, longest_step, rounding_speed
from taichi_cloth.solvers.stencil import Features, Numbers, Stencil
from taichi_cloth.solvers.strain_limit import ThreadLimit
from taichi_cloth.thin_limbs import let_through

__all__ = ["Verlet"]

WORTH_THREADS = 50_000
"""Key points from which a second thread pays: 158² gained nothing on two shared cores, 257² a factor of 1.4."""

_CHUNK = 1024  # iterations a strip: Taichi gives a thread 512 or more


class Verlet(Solver):
    """The paper's method for one sheet.

    frame_rate: frames a second [1/s]. step: asked for [s]; None takes the longest that is safe. safety: share of the
    stable limit. threads: strips; None takes 1, or all of the runtime's where the sheet is large enough. passes: what
    acts after the stencil of each substep, in that order.
    Raises InputError on a step that is not stable, with the one that is.
    """

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float = 60.0,
        step: float | None = None,
        safety: float = 0.9,
        threads: int | None = None,
        passes: tuple[Pass, ...] = (),
    ) -> None:
        if not (np.isfinite(frame_rate) and frame_rate > 0):
            raise InputError(f"solver.frame_rate: {frame_rate!r}; allowed: above 0")
        if not 0 < safety <= 1:
            raise InputError(f"solver.safety: {safety!r}; allowed: above 0, at most 1")
        m = sheet.material
        self.sheet, self.frame_rate = sheet, frame_rate
        self.frequency = highest_frequency(sheet)
        self.limit = longest_step(self.frequency, fibre_damping=m.fibre_damping, air_damping=m.air_damping)
        longest = safety * self.limit
        if step is not None and not 0 < step <= longest:
            raise InputError(
                f"solver.step: {step!r} s; the springs of this sheet allow at most {longest:.4g} s "
                f"({safety:g} of the stable limit); leave it out, or name one above 0 up to that"
            )
        # Two substeps at a time, for passes that are paired. 1e-9: a frame that is just so many steps is not one more.
        self.substeps = max(2, 2 * ceil(1 / frame_rate / (step or longest) / 2 - 1e-9))
        self.step = 1 / frame_rate / self.substeps
        rows = sheet.shape[0]
        count = threads or (runtime.threads() if sheet.present.sum() >= WORTH_THREADS else 1)
        self.passes = (*passes, ClothContact(sheet, forces.self_contact)) if forces.self_contact else passes
        if forces.strain_limit:
            self.passes = (ThreadLimit(sheet), *self.passes)
        self.strips = max(1, min(count, rows // (4 * MEETING))) if threads is None else max(1, min(count, rows))
        body = forces.body
        thin = let_through(body.solids, sheet.springs.diagonal_length, body.gap) if body is not None else ()
        if not strips_allowed(self.passes) or len(thin):
            self.strips = 1
        if body is not None:
            size = int(np.prod(sheet.padded_shape))
            one = Contact(body, size=size, substeps=self.substeps, step=self.step, strips=self.strips)
            self.passes = (*self.passes, one, *((MiddleContact(one, sheet, thin),) if len(thin) else ()))
        cuts = np.linspace(PAD, PAD + rows, self.strips + 1).round().astype(np.int32)
        self._rows = np.stack([cuts[:-1], cuts[1:]], axis=1)
        self._features = Features(
            hinges=sheet.springs.law == "hinge",
            wind=forces.wind is not None,
            sphere=forces.sphere is not None,
            plane=forces.plane is not None,
            leads=not self.passes,
            apart=bool(self.passes) or m.fibre_damping > 0,
        )
        self._forces = forces
        self._numbers = _numbers(sheet, forces, self.step)
        for one in self.passes:
            one.join(self.substeps, self.step)

    def rounding(self, ulp: float) -> float:
        m = self.sheet.material
        return rounding_speed(self.step, ulp, air_damping=m.air_damping, fibre_damping=m.fibre_damping)

    def unchecked(self, step: float, substeps: int) -> "Verlet":
        """The same with any step [s], stable or not, to find by experiment where the limit is. Without passes, which
        are made for a step of their own."""
        assert not self.passes
        other = copy(self)
        other.step, other.substeps = step, substeps
        other._numbers = _numbers(self.sheet, self._forces, step)
        return other

    def advance(self, state: SheetState, forces: FrameForces) -> None:
        work = _workspace(runtime.generation(), self.sheet.padded_shape, self.strips, self.passes)
        if work.holder is not self:
            sheet = self.sheet
            model = np.stack([sheet.padded(v) for v in (*sheet.weights, sheet.inverse_mass)])
            work.take_model(model, state.values)
            work.take_blocks(sheet.padded(sheet.present) > 0)
            work.numbers[None] = Numbers(**self._numbers)
            work.holder = self
        first, last = np.asarray(forces.wind_start), np.asarray(forces.wind_end)
        meeting = self.substeps if self.strips == 1 else MEETING
        for one in self.passes:
            one.begin(state, forces)
        source, target = state.values, np.empty_like(state.values)
        for done in range(0, self.substeps, meeting):
            count = min(meeting, self.substeps - done)
            wind = (first + (last - first) * (done / self.substeps)).tolist()
            change = ((last - first) / self.substeps).tolist()
            kernel = work.serial if self.strips == 1 else work.parallel
            with runtime.plain_code():  # half the time to compile, and as fast a frame
                kernel(source, self._rows, *wind, *change, done, count, self._features, target)
            source, target = target, source
            if self.strips > 1:
                for one in self.passes:
                    one.exchange(self._rows, 3 * MEETING, self.sheet.width)
        rows = slice(PAD, -PAD)
        state.values[:, rows] = source[:, rows]
        for one in self.passes:
            one.end(state)


def _acting(air_damping: float, step: float) -> float:
    """Share of a step for which a constant force acts, (1 − e^(−ch))/(ch): second order, and the right end speed."""
    return -expm1(-air_damping * step) / (air_damping * step) if air_damping > 0 else 1.0


def _numbers(sheet: Sheet, forces: Forces, step: float) -> dict[str, float]:
    """The values of `stencil.Numbers`."""
    s, m = sheet.springs, sheet.material
    h2 = step * step * _acting(m.air_damping, step)
    scaled = ("structural_x", "structural_y", "diagonal", "second_x", "second_y", "hinge_x", "hinge_y")
    out = {name: getattr(s, name) * h2 for name in scaled}
    out |= {name: getattr(s, name) for name in ("spacing_x", "spacing_y", "diagonal_length")}
    out |= {"kept": exp(-m.air_damping * step), "lag": m.fibre_damping / step, "rate": 1 / step}
    wind, ball, plane = forces.wind, forces.sphere, forces.plane
    out["wind_drag"] = 0.5 * wind.air_density * wind.drag * h2 if wind else 0.0
    out["wind_lift"] = 0.5 * wind.air_density * wind.lift * h2 if wind else 0.0
    out["sphere_radius"] = ball.radius + ball.gap if ball else 0.0
    out["sphere_friction"] = ball.friction if ball else 0.0
    out["plane_height"] = plane.height + plane.gap if plane else 0.0
    out["plane_friction"] = plane.friction if plane else 0.0
    longest = 1 + (forces.strain_limit.strain if forces.strain_limit else 0.0)
    out |= {"longest_x": s.spacing_x * longest, "longest_y": s.spacing_y * longest}
    out["sweeps"] = float(forces.strain_limit.passes) if forces.strain_limit else 1.0
    for k, axis in enumerate("xyz"):
        out[f"gravity_{axis}"] = forces.gravity[k] * h2
        out[f"sphere_{axis}"] = ball.centre[k] if ball else 0.0
        out[f"plane_{axis}"] = plane.normal[k] if plane else 0.0
    return out


@lru_cache(maxsize=16)
def _workspace(generation: int, padded_shape: tuple[int, int], strips: int, passes: tuple[Pass, ...]) -> "_Workspace":
    """Fields and kernels for grids of that shape: sheets of one shape share them, and compile once.

    generation: of the Taichi runtime; a new start throws all fields away.
    """
    return _Workspace(padded_shape, strips, passes)


@ti.data_oriented
class _Workspace(Stencil):
    """The kernels of a frame, for `strips` copies of a padded grid one after the other."""

    def __init__(self, padded_shape: tuple[int, int], strips: int, passes: tuple[Pass, ...]) -> None:
        rows, width = padded_shape
        super().__init__(strips * rows * width, width)
        self.rows, self.strips, self.passes = rows, strips, passes
        self.numbers = Numbers.field(shape=())
        self.run = ti.Vector.field(2, ti.i32, rows * width // LANES)
        self.row_start = ti.field(ti.i32, rows + 1)
        self.holder: Verlet | None = None

    @ti.kernel
    def take_model(self, model: F32x3, values: F32x3):
        """Weights into every strip, and the state, with what lies around the sheet."""
        ti.loop_config(serialize=True)
        for strip in range(self.strips):
            for i in range(self.rows):
                for j in range(self.width):
                    p = (strip * self.rows + i) * self.width + j
                    self.east[p] = model[0, i, j]
                    self.north[p] = model[1, i, j]
                    self.cell[p] = model[2, i, j]
                    self.inverse_mass[p] = model[3, i, j]
                    for c in ti.static(range(3)):
                        self.position[c][p] = values[c, i, j]
                        self.ahead[c][p] = values[c, i, j]
                        self.ahead[c][p + self.size] = values[c, i, j]
                        self.step[c][p] = values[3 + c, i, j]

    def take_blocks(self, present: NDArray[np.bool_]) -> None:
        """Runs of blocks of lanes that hold key points: first and one after the last of each, and where the runs of
        each row begin. present: (rows, width)."""
        used = present.reshape(self.rows, -1, LANES).any(axis=2)
        change = np.diff(np.pad(used, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        listed = np.zeros((*self.run.shape, 2), np.int32)
        for end, sign in enumerate((1, -1)):
            row, block = np.nonzero(change == sign)
            listed[: len(row), end] = row * used.shape[1] + block
        self.run.from_numpy(listed)
        self.row_start.from_numpy(np.concatenate([[0], np.cumsum((change == 1).sum(axis=1))]).astype(np.int32))

    @ti.func
    def inside(self, row):
        """A row, or the first or the one after the last of the sheet."""
        return ti.min(ti.max(row, PAD), self.rows - PAD)

    @ti.func
    def lead_rows(self, base, first, last, n: Template):
        """`lead` of rows of a strip, as far as the sheet has them, into the first buffer."""
        for e in range(self.row_start[self.inside(first)], self.row_start[self.inside(last)]):
            for b in range(base + self.run[e][0], base + self.run[e][1]):
                self.lead(self.lanes(b * LANES), n)

    @ti.func
    def frame(
        self,
        strip,
        source: Template,
        first,
        last,
        n: Template,
        wind,
        change,
        begun,
        count,
        features: Template,
        target: Template,
    ):
        """`count` substeps, from number `begun` of the frame, of the rows `first` to `last` of a strip.

        Rows around them are computed as long as they are needed, two less on each side each substep.
        """
        base = strip * self.rows
        blocks = self.width // LANES
        first_block = base * blocks
        for i in range(self.inside(first - 2 * count), self.inside(last + 2 * count)):
            for j in range(self.width):
                p = (base + i) * self.width + j
                for c in ti.static(range(3)):
                    self.position[c][p] = source[c, i, j]
                    self.step[c][p] = source[3 + c, i, j]
        if ti.static(features.leads):
            self.lead_rows(first_block, first - 2 * count, last + 2 * count, n)
        at = 0
        for done in range(count):
            halo = 2 * (count - done) - 2
            air = wind + done * change
            low, high = self.inside(first - halo), self.inside(last + halo)
            b0, b1 = (base + low) * blocks, (base + high) * blocks
            for one in ti.static(self.passes):
                if not one.paired or done % 2 == 0:
                    one.before(self, b0, b1, -base * self.width, begun + done, n)
            if ti.static(not features.leads):
                self.lead_rows(first_block, low - 2, high + 2, n)
            for e in range(self.row_start[low], self.row_start[high]):
                for b in range(first_block + self.run[e][0], first_block + self.run[e][1]):
                    self.substep(features, at, self.lanes(b * LANES), air, n)
            if ti.static(features.leads):
                at = self.size - at
            for _ in range(ti.cast(n.sweeps, ti.i32)):
                for one in ti.static([one for one in self.passes if one.repeated]):
                    one.after(self, b0, b1, -base * self.width, begun + done, n)
            for one in ti.static([one for one in self.passes if not one.repeated]):
                if not one.paired or done % 2 == 1:
                    one.after(self, b0, b1, -base * self.width, begun + done, n)
        if ti.static(not features.apart):
            for e in range(self.row_start[first], self.row_start[last]):
                for b in range(first_block + self.run[e][0], first_block + self.run[e][1]):
                    self.settle(self.lanes(b * LANES), at)
        for i in range(first, last):
            for j in range(self.width):
                p = (base + i) * self.width + j
                for c in ti.static(range(3)):
                    target[c, i, j] = self.position[c][p]
                    target[3 + c, i, j] = self.step[c][p]

    @ti.kernel
    def serial(
        self,
        # in
        source: F32x3,
        rows: I32x2,
        wind_x: Float,
        wind_y: Float,
        wind_z: Float,
        change_x: Float,
        change_y: Float,
        change_z: Float,
        begun: Int,
        count: Int,
        features: Template,
        # out
        target: F32x3,
    ):
        ti.loop_config(serialize=True)
        for strip in range(1):
            wind = ti.Vector([wind_x, wind_y, wind_z])
            change = ti.Vector([change_x, change_y, change_z])
            n = self.numbers[None]
            self.frame(strip, source, rows[0, 0], rows[0, 1], n, wind, change, begun, count, features, target)

    @ti.kernel
    def parallel(
        self,
        # in
        source: F32x3,
        rows: I32x2,
        wind_x: Float,
        wind_y: Float,
        wind_z: Float,
        change_x: Float,
        change_y: Float,
        change_z: Float,
        begun: Int,
        count: Int,
        features: Template,
        # out
        target: F32x3,
    ):
        for t in range(self.strips * _CHUNK):
            if t % _CHUNK == 0:
                strip = t // _CHUNK
                wind = ti.Vector([wind_x, wind_y, wind_z])
                change = ti.Vector([change_x, change_y, change_z])
                n = self.numbers[None]
                self.frame(
                    strip,
                    source,
                    rows[strip, 0],
                    rows[strip, 1],
                    n,
                    wind,
                    change,
                    begun,
                    count,
                    features,
                    target,
                )
