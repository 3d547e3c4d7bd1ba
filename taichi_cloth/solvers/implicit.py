"""Implicit steps for stiff cloth: stable for any stiffness and any step, of second order where the motion is smooth.

The method is SDIRK2 (Alexander 1977): two stages with γ = 1 − 1/√2, L-stable, of order 2, and it needs no step but the
last. A stage with base position X and base velocity V looks for

    v = V + τ a(x, v),      x = X + τ v,      τ = γ h,
    stage 1: X = x₀, V = v₀;      stage 2: X = x₀ + (1 − γ) h v₁, V = v₀ + (1 − γ) h a₁,

the lowest point of  Φ(x) = Σ m |x − X − τ V|² / 2τ² + energy of springs, hinges, gravity and bodies  (springs and
hinges damp with x − X). It is found by Newton's method: a sparse direct solve (`assembly.py`), so that no momentum is
lost in solves that were broken off, and a line search that never goes uphill.

A step that lands key points on a body, or would make energy, is taken anew by implicit Euler (γ = 1, one stage): of
order 1, but its Φ cannot end above where it starts, so that energy only falls, from any start and at any stiffness.

Bodies push with a stiff one-sided spring in the step; what is left of the depth is taken away after it. Friction is
Coulomb's with the push of the iteration before. Air drag is F(v) − D (v⁺ − v) with D = 1.5 |F|/|v|.

It runs on the host in float64, beside Taichi; the bytes do not depend on Taichi's threads. Linear algebra takes one
thread: the bands are so narrow that a second one only waits, 10 to 50 times as long where the cores have other work.
"""

from math import ceil, sqrt

import numpy as np
from numpy.linalg import LinAlgError
from numpy.typing import NDArray

from taichi_cloth.ground.blas import one_thread
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.motion.solver import Solver
from taichi_cloth.sheet.sheet import PAD, Sheet, SheetState
from taichi_cloth.solvers.air import air_forces
from taichi_cloth.solvers.assembly import Assembly

__all__ = ["Implicit"]

F64 = NDArray[np.float64]

STEP = 1 / 240
"""Longest step [s] that is taken where none is asked for."""

GAMMA = 1 - sqrt(0.5)
ITERATIONS = 40
DRAG = 1.5
"""D |v| / |F| of the air; stable from ½ of dF/dv on, which is 2 for drag."""

TOUCHING = 1.0e-5
"""Distance [m] from a body at which a key point counts as lying on it."""

PUSH = 1.0e4
"""Stiffness of a body in units of m/τ²: its own weight pushes a key point g τ² / 10⁴ deep."""

SHARE, STIFFEST = 1.0e-2, 1.5e3
"""A body is at least as stiff as this share of a key point's own springs, up to so many times the least: the depth that
is taken away after a step stretches them, which made 370 J at 10⁸ × cotton. Stiffer yet, and Newton stood still."""

GAIN = 1.0e-3
"""Share of its energy that a step of second order may make before it is taken by Euler: it is as large in smooth
motion, by the method's error."""


class Implicit(Solver):
    """SDIRK2 by Newton's method, for one sheet.

    frame_rate: frames a second [1/s]. step: the longest allowed [s]. order: 2; 1 takes every step by implicit Euler.
    tolerance: Newton stops where it moves key points by less than this share of the step's own movement.
    Raises InputError on numbers that are not above 0, another order, or forces it has not.
    """

    staggered = False

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float = 60.0,
        step: float | None = None,
        order: int = 2,
        tolerance: float = 1e-3,
    ) -> None:
        given = {"frame_rate": frame_rate, "step": STEP if step is None else step, "tolerance": tolerance}
        for name, value in given.items():
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"solver.{name}: {value!r}; allowed: above 0")
        if order not in (1, 2):
            raise InputError(f"solver.order: {order!r}; allowed: 1 (implicit Euler) or 2 (SDIRK2)")
        for name in ("body", "strain_limit", "self_contact"):
            if getattr(forces, name) is not None:
                what = name.replace("_", " ")
                raise InputError(f'solver.name: "implicit" has no {what}; use "verlet", or leave it out')
        self.sheet, self.forces, self.frame_rate = sheet, forces, frame_rate
        self.order, self.tolerance = order, tolerance
        self.substeps = max(1, ceil(1 / frame_rate / given["step"] - 1e-9))
        self.step = 1 / frame_rate / self.substeps
        self.solves = 0
        """Linear systems factorised so far."""
        self.euler_steps = 0
        """Steps that Euler had to take in place of SDIRK2."""
        self._assembly: Assembly | None = None
        self._mass = sheet.mass.ravel()
        self._free = sheet.inverse_mass.ravel() > 0
        self._gravity = np.asarray(forces.gravity, np.float64)

    @property
    def settings(self) -> tuple[object, ...]:
        return (self.order, self.tolerance)

    def advance(self, state: SheetState, forces: FrameForces) -> None:
        if self._assembly is None:
            self._assembly = Assembly(self.sheet)
        inside = state.values[:, PAD:-PAD, : self.sheet.shape[1]]
        x, u = (np.moveaxis(part, 0, -1).reshape(-1, 3).astype(np.float64) for part in (inside[:3], inside[3:]))
        gone = ~self.sheet.present.ravel()
        x[gone], u[gone] = 0.0, 0.0
        v = u / self.step
        first, last = np.asarray(forces.wind_start), np.asarray(forces.wind_end)
        with one_thread():
            for k in range(self.substeps):
                x, v = self._advanced(x, v, first + (last - first) * ((k + 0.5) / self.substeps))
        here = self._free.reshape(self.sheet.shape)
        inside[3:, here] = (v * self.step)[self._free].T
        moves = self.sheet.present
        inside[:3, moves] = x[moves.ravel()].T

    def _advanced(self, x0: F64, v0: F64, wind: F64) -> tuple[F64, F64]:
        """Positions and velocities a step later, (P, 3)."""
        h = self.step
        if not self._free.any():
            return x0 + h * v0, v0
        touching = self._gaps(x0)[0] <= TOUCHING
        if self.order == 2:
            tau = GAMMA * h
            one, settled = self._stage(x0, v0, tau, x0, x0 + tau * v0, v0, wind)
            v1 = (one - x0) / tau
            a1 = (v1 - v0) / tau
            base, speed = x0 + (1 - GAMMA) * h * v1, v0 + (1 - GAMMA) * h * a1
            if settled:
                two, settled = self._stage(base, speed, tau, x0, one + (h - tau) * v1, v1, wind)
                v2 = np.where(self._free[:, None], (two - base) / tau, v0)
                if settled and not self._must_fall_back(x0, v0, two, v2, touching):
                    return self._lifted(two), v2
            self.euler_steps += 1
        out, _ = self._stage(x0, v0, h, x0, np.where(self._free[:, None], x0, x0 + h * v0), v0, wind)
        return self._lifted(out), np.where(self._free[:, None], (out - x0) / h, v0)

    def _must_fall_back(self, x0: F64, v0: F64, x: F64, v: F64, touching: NDArray[np.bool_]) -> bool:
        assert self._assembly is not None
        gaps = self._gaps(x)[0]
        if ((gaps < 0) & ~touching).any():
            return True
        springs = self._assembly
        m, held = self._mass[:, None], ~self._free
        before = 0.5 * float((m * v0**2).sum()) + springs.energy(x0)
        after = 0.5 * float((m * v**2).sum()) + springs.energy(x)
        moved = x - x0
        work = float((m * moved).sum(0) @ self._gravity)
        if held.any() and v0[held].any():
            pull = 0.5 * (springs.gradient(x0) + springs.gradient(x))
            work += float((pull[held] * moved[held]).sum())
        if self.forces.wind is not None:
            work += abs(float((self._air_now * moved).sum()))
        return not after - before - work <= GAIN * max(before, after)

    def _gaps(self, x: F64) -> tuple[F64, F64]:
        """Distance (P,) [m] from the nearest body, large where there is none, and its normal there (P, 3)."""
        gap, normal = np.full(len(x), 1e30), np.zeros_like(x)
        ball, plane = self.forces.sphere, self.forces.plane
        if ball is not None:
            d = x - np.asarray(ball.centre)
            length = np.maximum(np.sqrt(np.einsum("pi,pi->p", d, d)), 1e-12)
            gap, normal = length - ball.radius - ball.gap, d / length[:, None]
        if plane is not None:
            n = np.asarray(plane.normal)
            over = x @ n - plane.height - plane.gap
            nearer = over < gap
            gap = np.where(nearer, over, gap)
            normal = np.where(nearer[:, None], n, normal)
        return gap, normal

    def _friction(self, x: F64) -> F64:
        """µ of the nearest body (P,)."""
        ball, plane = self.forces.sphere, self.forces.plane
        if ball is None or plane is None:
            return np.full(len(x), (ball or plane).friction if ball or plane else 0.0)  # pyright: ignore
        n = np.asarray(plane.normal)
        to_ball = np.linalg.norm(x - np.asarray(ball.centre), axis=-1) - ball.radius - ball.gap
        return np.where(x @ n - plane.height - plane.gap < to_ball, plane.friction, ball.friction)

    def _lifted(self, x: F64) -> F64:
        """What lies inside a body, put on its surface."""
        if self.forces.sphere is None and self.forces.plane is None:
            return x
        gap, normal = self._gaps(x)
        return x - np.where(self._free, np.minimum(gap, 0.0), 0.0)[:, None] * normal

    def _stage(
        self, base: F64, speed: F64, tau: float, start: F64, guess: F64, flow: F64, wind: F64
    ) -> tuple[F64, bool]:
        """The lowest point of Φ near a guess (P, 3), and whether Newton got there."""
        springs, free = self._assembly, self._free
        assert springs is not None
        m, damping, lag = self._mass, self.sheet.material.air_damping, self.sheet.material.fibre_damping / tau
        air, drag = np.zeros_like(base), np.zeros(len(m))
        if self.forces.wind is not None:
            shape = (*self.sheet.shape, 3)
            at = (float(wind[0]), float(wind[1]), float(wind[2]))
            force, drag = air_forces(self.sheet, self.forces.wind, at, guess.reshape(shape), flow.reshape(shape))
            air, drag = force.reshape(-1, 3), DRAG * drag.ravel()
            self._air_now = air
            air = air + drag[:, None] * flow
        inertia = m * (1 + tau * damping) / tau**2 + drag / tau
        least = (PUSH / tau**2) * m
        push = np.clip(SHARE * springs.stiffness, least, STIFFEST * least) * free
        steady = m[:, None] * (speed / tau + self._gravity) + air
        bodies = self.forces.sphere is not None or self.forces.plane is not None
        course = springs.spans(guess)[1] if lag else None
        x = guess
        nearest = 1e-5 * float(np.linalg.norm(self._gravity)) * tau**2 + 1e-10
        for _ in range(ITERATIONS):
            gap, normal = self._gaps(x) if bodies else (np.zeros(0), np.zeros(0))
            grip, depth, slid = np.zeros(len(m)), np.zeros(len(m)), np.zeros_like(x)
            if bodies:
                depth = np.maximum(-gap, 0.0)
                slid = x - start
                slid = slid - (slid * normal).sum(-1, keepdims=True) * normal
                far = np.sqrt(np.einsum("pi,pi->p", slid, slid))
                grip = self._friction(x) * push * depth / np.maximum(far, 1e-9)

            def value(
                at: F64, grip: F64 = grip, normal: F64 = normal, course: F64 | None = course, inertia: F64 = inertia
            ) -> float:
                d = at - base
                out = 0.5 * float((inertia[:, None] * d**2)[free].sum()) - float((steady * d)[free].sum())
                out += springs.energy(at)
                if course is not None:
                    u = d[springs.second] - d[springs.first]
                    out += 0.5 * lag * float(springs.constant @ (u * course).sum(-1) ** 2)
                    out += 0.5 * lag * float(np.vdot(d, springs.bending @ d))
                if bodies:
                    out += 0.5 * float(push @ np.minimum(self._gaps(at)[0], 0.0) ** 2)
                    t = at - start
                    t = t - (t * normal).sum(-1, keepdims=True) * normal
                    out += 0.5 * float(grip @ (t**2).sum(-1))
                return out

            d = x - base
            slope = inertia[:, None] * d - steady + springs.gradient(x)
            blocks = inertia[:, None, None] * np.eye(3)
            if course is not None:
                u = ((d[springs.second] - d[springs.first]) * course).sum(-1)
                slope += lag * (springs.gather @ ((springs.constant * u)[:, None] * course) + springs.bending @ d)
            if bodies:
                slope -= (push * depth)[:, None] * normal
                slope += grip[:, None] * slid
                outer = normal[:, :, None] * normal[:, None, :]
                blocks = blocks + (push * (depth > 0))[:, None, None] * outer
                blocks += grip[:, None, None] * (np.eye(3) - outer)
            self.solves += 1
            try:
                factor = springs.factorise(springs.matrix(x, blocks[springs.free], lag))
            except LinAlgError:
                return x, False
            move = -springs.solve(factor, slope)
            downhill = float((move * slope)[free].sum())
            here, share = value(x), 1.0
            while not value(x + share * move) <= here + 1e-4 * share * downhill + 1e-13 * abs(here):
                share *= 0.5
                if share < 1e-6:
                    return x, False
            x = x + share * move
            went = float(np.abs(move).max())  # whole: a move that a body cut short has not arrived
            if depth.any():  # the push is told from the depth: to a hundredth of a key point's own weight
                near = 1e3 * nearest / PUSH
            else:
                near = self.tolerance * float(np.abs(x - start)[free].max(initial=0.0)) + nearest
            if went <= near:
                return x, True
        return x, False
