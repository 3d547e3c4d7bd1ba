"""Explicit Störmer–Verlet (paper 3.2): x(t + h) = x(t) + (x(t) − x(t − h)) + a h², a frame in one kernel.

The step follows from the springs: h = safety × the longest that is stable (`stability.py`), so a person names a frame
rate only. Where springs become stiffer together than at rest it follows them (`step_choice.py`): the frame is taken
again with shorter steps, and so are those after it.

All substeps are one kernel, and its threads share the work of each stage of each (`crew.py`). As every key point goes
through the same arithmetic the bytes do not depend on the number of threads.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false, reportCallIssue=false
# pyright: reportArgumentType=false

from copy import copy
from functools import lru_cache
from math import exp, expm1
from time import perf_counter

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_middles import MiddleContact
from taichi_cloth.constraints.self_contact import ClothContact
from taichi_cloth.constraints.strain_limit import ThreadLimit
from taichi_cloth.constraints.thin_limbs import let_through
from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x3, Float, Int, Template
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.crew import PARTS, Crew, Pace, parts_of
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.motion.passes import Pass
from taichi_cloth.motion.solver import Solver
from taichi_cloth.motion.stencil import Features, Numbers, Stencil
from taichi_cloth.sheet.energy import accelerations
from taichi_cloth.sheet.sheet import LANES, Sheet, SheetState
from taichi_cloth.solvers.stability import rounding_speed
from taichi_cloth.solvers.step_choice import StepChoice
from taichi_cloth.solvers.stiffest import Stiffest

__all__ = ["Verlet"]

WORTH_THREADS = 1_000
"""Key points from which a second thread pays: a factor of 1.4 at 33², 1.9 at 46², 1.6 to 1.8 at 79², 1.8 at 257²."""

MOST_THREADS = PARTS // 2

_CHUNK = 1024  # iterations a thread: Taichi gives it 512 or more


class Verlet(Solver):
    """The paper's method for one sheet.

    frame_rate: frames a second [1/s]. step: asked for [s]; None takes the longest that is safe. safety: share of the
    stable limit. threads: at most; None takes 1, or those of the runtime where the sheet is large enough. passes: what
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
        self.choice = StepChoice(sheet, frame_rate=frame_rate, safety=safety)
        self._now = 0.0  # the bound of the frequency at the end of the last frame [rad/s]
        longest = self.choice.longest
        if step is not None and not 0 < step <= longest:
            raise InputError(
                f"solver.step: {step!r} s; the springs of this sheet allow at most {longest:.4g} s "
                f"({safety:g} of the stable limit); leave it out, or name one above 0 up to that"
            )
        self.substeps = self.choice.substeps(step or longest)
        self.step = 1 / frame_rate / self.substeps
        self.passes = (*passes, ClothContact(sheet, forces.self_contact)) if forces.self_contact else passes
        if forces.strain_limit:
            self.passes = (*self.passes, ThreadLimit(sheet))
        most = threads or (runtime.threads() if sheet.present.sum() >= WORTH_THREADS else 1)
        self.threads = 1 if any(one.repeated for one in self.passes) else min(most, MOST_THREADS)
        if forces.body is not None:
            size, body = int(np.prod(sheet.padded_shape)), forces.body
            one = Contact(body, size=size, substeps=self.substeps, step=self.step)
            thin = let_through(body.solids, sheet.springs.diagonal_length, body.gap)
            self.passes = (*self.passes, one, *((MiddleContact(one, sheet, thin),) if len(thin) else ()))
        self._features = Features(
            hinges=sheet.springs.law == "hinge",
            wind=forces.wind is not None,
            sphere=forces.sphere is not None,
            plane=forces.plane is not None,
            leads=not self.passes,
            apart=bool(self.passes) or m.fibre_damping > 0,
        )
        self._forces = forces
        self._take(self.substeps)
        self._pace = Pace(self.threads)

    def _take(self, substeps: int) -> None:
        self.substeps, self.step = substeps, 1 / self.frame_rate / substeps
        self._numbers = _numbers(self.sheet, self._forces, self.step)
        for one in self.passes:
            one.join(substeps, self.step)

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

    def shorten(self, state: SheetState, reached: SheetState | None) -> bool:
        choice = self.choice
        if reached is None:
            choice.any_shape()
        else:
            bound = choice.bound.at(self._shape(state)) if reached is state else self._now
            if not (choice.crossed(self.step, bound) and choice.look(self.step, self._shape(reached), bound)):
                return False
        substeps = choice.substeps(choice.longest)
        if substeps <= self.substeps:
            return False
        before = self.step
        self._take(substeps)
        self._rescale(state, before)
        return True

    def _shape(self, state: SheetState) -> NDArray[np.float64]:
        return self.sheet.positions(state).astype(np.float64)

    def _rescale(self, state: SheetState, before: float) -> None:
        """Steps of `before` [s] in the state to those of the same motion now: x(t) − x(t − h) = v h − a h²/2."""
        sheet, share = self.sheet, self.step / before
        a = accelerations(sheet, sheet.positions(state), self._forces.gravity)
        steps = share * (sheet.steps(state) + a * (before * (before - self.step) / 2))
        sheet.set_steps(state, steps)
        for one in self.passes:
            one.rescale(state, share)

    @property
    def found(self) -> tuple[float, ...]:
        return self.substeps, self.choice.frequency, self.choice.seen

    def go_on(self, found: tuple[float, ...]) -> None:
        substeps, self.choice.frequency, self.choice.seen = found
        if substeps != self.substeps:
            self._take(int(substeps))

    def advance(self, state: SheetState, forces: FrameForces) -> None:
        work = _workspace(runtime.generation(), self.sheet.padded_shape, self.threads, self.passes)
        if work.holder != (self, self.substeps):
            sheet = self.sheet
            model = np.stack([sheet.padded(v) for v in (*sheet.weights, sheet.inverse_mass)])
            work.take_model(model, state.values)
            work.take_parts(sheet.padded(sheet.present) > 0)
            work.numbers[None] = Numbers(**self._numbers)
            work.stiff.take(self.choice.bound, self.step)
            work.holder = self, self.substeps
        first, last = np.asarray(forces.wind_start), np.asarray(forces.wind_end)
        wind, change = first.tolist(), ((last - first) / self.substeps).tolist()
        for one in self.passes:
            one.begin(state, forces)
        threads, begin = self._pace.threads(), perf_counter()
        with runtime.plain_code():  # half the time to compile, and as fast a frame
            work.frame(state.values, *wind, *change, self.substeps, threads, self._features)
            self._pace.took(perf_counter() - begin)
            self._now = work.stiffest() ** 0.5 / self.step
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
def _workspace(generation: int, padded_shape: tuple[int, int], threads: int, passes: tuple[Pass, ...]) -> "_Workspace":
    """Fields and kernels for grids of that shape: sheets of one shape share them, and compile once.

    generation: of the Taichi runtime; a new start throws all fields away.
    """
    return _Workspace(padded_shape, threads, passes)


@ti.data_oriented
class _Workspace(Stencil):
    """The kernel of a frame."""

    def __init__(self, padded_shape: tuple[int, int], threads: int, passes: tuple[Pass, ...]) -> None:
        rows, width = padded_shape
        super().__init__(rows * width, width)
        self.rows, self.passes, self.crew = rows, passes, Crew(threads)
        self.numbers = Numbers.field(shape=())
        self.block, self.cut = ti.field(ti.i32, rows * width // LANES), ti.field(ti.i32, PARTS + 1)
        self.stiff = Stiffest(rows * width)
        self.holder: tuple[Verlet, int] | None = None

    @ti.kernel
    def take_model(self, model: F32x3, values: F32x3):
        """Weights, and the state, with what lies around the sheet."""
        ti.loop_config(serialize=True)
        for i in range(self.rows):
            for j in range(self.width):
                p = i * self.width + j
                self.east[p] = model[0, i, j]
                self.north[p] = model[1, i, j]
                self.cell[p] = model[2, i, j]
                self.inverse_mass[p] = model[3, i, j]
                for c in ti.static(range(3)):
                    self.position[c][p] = values[c, i, j]
                    self.ahead[c][p] = values[c, i, j]
                    self.ahead[c][p + self.size] = values[c, i, j]
                    self.step[c][p] = values[3 + c, i, j]

    def take_parts(self, present: NDArray[np.bool_]) -> None:
        """present: (rows, width)."""
        blocks, cuts = parts_of(present)
        self.block.from_numpy(np.pad(blocks, (0, self.block.shape[0] - len(blocks))))
        self.cut.from_numpy(cuts)

    @ti.func
    def open(self, values: Template, part):
        """The state of a part's key points from what the host holds."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.block[e] * LANES)
            i, j = p // self.width, p % self.width
            for c in ti.static(range(3)):
                for k in range(LANES):
                    self.position[c][p + k] = values[c, i, j + k]
                    self.step[c][p + k] = values[3 + c, i, j + k]
            for one in ti.static([one for one in self.passes if one.remembers]):
                one.open(values, p, i, j)

    @ti.func
    def close(self, values: Template, part, at, features: Template):
        """And back."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.block[e] * LANES)
            if ti.static(not features.apart):
                self.settle(p, at)
            i, j = p // self.width, p % self.width
            for c in ti.static(range(3)):
                for k in range(LANES):
                    values[c, i, j + k] = self.position[c][p + k]
                    values[3 + c, i, j + k] = self.step[c][p + k]
            for one in ti.static([one for one in self.passes if one.remembers]):
                one.close(values, p, i, j)

    @ti.func
    def lead_part(self, part, n: Template):
        """`lead` of a part into the first buffer."""
        for e in range(self.cut[part], self.cut[part + 1]):
            self.lead(self.lanes(self.block[e] * LANES), n)

    @ti.func
    def substep_part(self, part, at, features: Template, air, n: Template):
        for e in range(self.cut[part], self.cut[part + 1]):
            self.substep(features, at, self.lanes(self.block[e] * LANES), air, n)

    @ti.func
    def before(self, done, n: Template):
        """What passes do before the stencil."""
        for one in ti.static(self.passes):
            if not one.paired or done % 2 == 0:
                one.before(self, done, n)

    @ti.func
    def after(self, one: Template, thread, stage, finished, done, n: Template):
        """One stage or two: a pass after the stencil, for each part and then for all. Returns the last stage, and the
        parts finished when it ends."""
        last, goal = stage, finished
        if ti.static(one.parts):
            last, goal = last + 1, goal + PARTS
            for turn in range(PARTS):
                part = self.crew.take(thread, turn, last, PARTS, goal)
                if part >= 0:
                    one.after(self, part, self.cut[part], self.cut[part + 1], done, n)
                    self.crew.finish()
            self.crew.meet(goal)
        if ti.static(one.whole):
            last, goal = last + 1, goal + 1
            if self.crew.take(thread, 0, last, 1, goal) == 0:
                one.after_all(self, done, n)
                self.crew.finish()
            self.crew.meet(goal)
        return last, goal

    @ti.func
    def work(self, thread, values: Template, n: Template, wind, change, substeps, features: Template):
        """A thread's share of a frame."""
        stage, finished = 1, PARTS
        for turn in range(PARTS):
            part = self.crew.take(thread, turn, stage, PARTS, finished)
            if part >= 0:
                self.open(values, part)
                if ti.static(features.leads):
                    self.lead_part(part, n)
                self.crew.finish()
        self.crew.meet(finished)
        at = 0
        for done in range(substeps):
            if ti.static(not features.leads):
                stage, finished = stage + 1, finished + PARTS
                for turn in range(PARTS):
                    part = self.crew.take(thread, turn, stage, PARTS, finished)
                    if part >= 0:
                        if part == 0:
                            self.before(done, n)
                        self.lead_part(part, n)
                        self.crew.finish()
                self.crew.meet(finished)
            stage, finished = stage + 1, finished + PARTS
            for turn in range(PARTS):
                part = self.crew.take(thread, turn, stage, PARTS, finished)
                if part >= 0:
                    self.substep_part(part, at, features, wind + done * change, n)
                    self.crew.finish()
            self.crew.meet(finished)
            if ti.static(features.leads):
                at = self.size - at
            for one in ti.static([one for one in self.passes if one.remembers]):
                stage, finished = stage + 1, finished + 1
                if self.crew.take(thread, 0, stage, 1, finished) == 0:
                    one.ready(self, done, n)
                    self.crew.finish()
                self.crew.meet(finished)
            for one in ti.static([one for one in self.passes if not one.repeated]):
                if not one.paired or done % 2 == 1:
                    stage, finished = self.after(one, thread, stage, finished, done, n)
            for _ in range(ti.cast(n.sweeps, ti.i32)):
                for one in ti.static([one for one in self.passes if one.repeated]):
                    stage, finished = self.after(one, thread, stage, finished, done, n)
        stage, finished = stage + 1, finished + PARTS
        for turn in range(PARTS):
            part = self.crew.take(thread, turn, stage, PARTS, finished)
            if part >= 0:
                self.close(values, part, at, features)
                self.crew.finish()

    @ti.kernel
    def frame(
        self,
        # in and out
        values: F32x3,
        # in
        wind_x: Float,
        wind_y: Float,
        wind_z: Float,
        change_x: Float,
        change_y: Float,
        change_z: Float,
        substeps: Int,
        threads: Int,
        features: Template,
    ):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.crew.assemble(threads)
        ti.loop_config(serialize=ti.static(self.crew.threads == 1))
        for k in range(self.crew.threads * _CHUNK):  # of a range that is not constant all would be one thread's
            if k % _CHUNK == 0 and k // _CHUNK < threads:
                wind, change = ti.Vector([wind_x, wind_y, wind_z]), ti.Vector([change_x, change_y, change_z])
                self.work(k // _CHUNK, values, self.numbers[None], wind, change, substeps, features)

    @ti.kernel
    def stiffest(self) -> Float:
        """The largest bound of (ω h)² at the end of the last frame."""
        most = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            most = self.stiff.find(self)
        return most
