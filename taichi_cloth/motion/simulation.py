"""The loop (paper 3.2): model, state, step.

A frame is, in this order: pins take their next place, the solver moves the state on (`solvers/`), and the state is
checked. A frame for which the solver's steps prove too long is taken again with shorter ones. A state that is not
finite or stretched beyond belief even then stops the run; the last good one is kept. A start that no cloth survives is
brought to rest before the first frame, or refused.

Units: SI. Time is counted in frames, so that a run that was resumed is the run that was left alone, byte for byte.
"""

import hashlib
import os
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.ground.files import in_one_step
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.solver import Solver
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import PAD, Sheet, SheetState

__all__ = ["Simulation"]

F32 = NDArray[np.float32]

LARGEST_STRETCH = 1.0
"""Strain of a thread beyond which a run is stopped: twice its length. No cloth comes near it and stays whole. One that
starts longer may stay as long."""

LARGEST_SLIP = 2.0
"""Share of their distance by which neighbours may move against each other in one step of Verlet: the spring between
them turns over unseen. Sheets in gales and blows come to 0.7, those that make energy to 10 and more."""

LARGEST_ROUNDING = (0.5, 0.1)
"""Speed of a solver's rounding up to which a run is allowed: [m/s], and as a share of √(g L) of the sheet's size L,
about how fast it swings."""
FARTHEST = 1e9
"""Coordinate [m] beyond which a state counts as not finite."""


class Simulation:
    """A sheet in motion.

    sheet: its pinned key points are those of all `pins` together. positions: (rows, cols, 3) [m] at the start.
    velocities: [m/s], any shape that spreads to that of positions. settled: the start is one that another simulation
    has come to, and stands whatever its threads are strained by. Raises InputError on pins that do not fit, and where
    the solver's steps are so short that rounding would move the sheet.
    """

    def __init__(
        self,
        sheet: Sheet,
        solver: Solver,
        *,
        forces: Forces,
        positions: ArrayLike,
        velocities: ArrayLike = 0.0,
        pins: tuple[Pins, ...] = (),
        settled: bool = False,
    ) -> None:
        held = np.zeros(sheet.shape, bool)
        for group in pins:
            if np.shape(group.mask) != sheet.shape or (held & group.mask).any():
                raise InputError(f"pins: masks of the sheet's shape {sheet.shape} that do not overlap are allowed")
            held |= group.mask
        if pins and (held != sheet.pinned).any():
            raise InputError("pins: their masks and the key points the sheet was made with as pinned differ")
        self.sheet, self.solver, self.forces, self.pins = sheet, solver, forces, pins
        self.frame = 0
        self.state = self._before = sheet.state(positions, solver.remembered)
        for group in pins:
            start = np.asarray(positions, np.float64)[group.mask]
            if group.path is not None and np.abs(group.at(0.0) - start).max(initial=0.0) > 1e-6:
                raise InputError("pins.path: at 0 s it is not where the sheet starts; allowed: 1e-6 m off")
        self._made_for = self._fingerprint()
        solver.shorten(self.state, self.state)
        self._velocities = velocities
        self._settled = settled
        self._strained, self._longest = not settled and solver.overstrained(self.state), LARGEST_STRETCH
        if not self._strained:
            self._longest = max(self._longest, *(1.01 * float(part.max()) for part in sheet.stretch(self.positions)))
            self._start(np.asarray(positions, np.float64))

    def _start(self, positions: NDArray[np.float64]) -> None:
        """From positions (rows, cols, 3) [m] that cloth can have."""
        self._first_steps(positions, self._velocities)
        self._check_rounding()

    @property
    def time(self) -> float:
        """[s]"""
        return self.frame * self.frame_time

    @property
    def frame_time(self) -> float:
        """Between two frames [s]."""
        return self.solver.step * self.solver.substeps

    @property
    def positions(self) -> F32:
        """(rows, cols, 3) float32 [m], a copy."""
        return self.sheet.positions(self.state)

    def _check_rounding(self) -> None:
        here = self.positions[self.sheet.present]
        rounding = self.solver.rounding(float(np.sqrt(np.mean(np.spacing(np.abs(here)).astype(np.float64) ** 2))))
        size = float(np.linalg.norm(np.ptp(self.sheet.flat(), axis=(0, 1))))
        absolute, share = LARGEST_ROUNDING
        allowed = min(absolute, share * sqrt(9.81 * size))
        if rounding > allowed:
            raise InputError(
                f"solver: steps of {self.solver.step:.2g} s are so short that rounding alone would shake key points at "
                f"{rounding:.2g} m/s (allowed: {allowed:.2g}); use {self.solver.instead}a softer or heavier material, "
                "or wider spacing"
            )

    def _first_steps(self, positions: NDArray[np.float64], velocities: ArrayLike) -> None:
        """x(0) − x(−h) = v h − a h²/2, which makes the start of second order, as the rest."""
        sheet, h = self.sheet, self.solver.step
        steps = h * np.where(sheet.inverse_mass[..., None] > 0, np.broadcast_to(velocities, positions.shape), 0.0)
        if not self._settled:
            steps -= self.solver.accelerations(sheet, positions, self.forces.gravity) * h**2 / 2
        sheet.set_steps(self.state, steps)

    def halt(self) -> None:
        """Takes away all speed. Done whenever cloth begins to slow down, as it does where its energy is least, this
        brings it to rest sooner than any damping that is the same all the time (kinetic damping, Cundall 1976; Barnes
        1999, "Form finding and analysis of tension structures by dynamic relaxation")."""
        self.slow(0.0)

    def slow(self, share: float) -> None:
        """Leaves key points this share of the speed that they had in the last frame. Of their last step it would be
        another: what ties and skin mend in each substep in positions alone is in steps, and with a tenth of that taken
        away a skirt came to rest elsewhere, and left it at 4 mm/s."""
        sheet = self.sheet
        moved = sheet.positions(self.state) - sheet.positions(self._before)
        sheet.set_steps(self.state, sheet.steps(self.state) - (1.0 - share) / self.solver.substeps * moved)

    def step(self) -> None:
        """One frame. Raises Unstable, with the state as it was before the frame; InputError where it is the first, and
        the start is one that no cloth survives, nor can be brought to rest."""
        if self._strained:
            self.solver.settle(self.state)
            self._strained = False
            self._start(self.positions.astype(np.float64))
        while True:
            moved = self._moved()
            try:
                self._check(moved)
            except Unstable:
                if not self.solver.shorten(self.state, None):
                    raise
            else:
                if not self.solver.shorten(self.state, moved):
                    self._check_solver()
                    break
        self._before, self.state = self.state, moved
        self.frame += 1

    def _check_solver(self) -> None:
        """Raises Unstable where threads are pulled more than their steps can be shortened for."""
        if torn := self.solver.torn:
            number = self.frame + 1
            raise Unstable(
                f"frame {number}: {torn}; no cloth carries that. The state of frame {self.frame} is kept. Use slower "
                "or nearer pins, weaker forces, or softer threads",
                number,
            )

    def _moved(self) -> SheetState:
        """The state a frame later, whatever it is."""
        start, end = self.time, (self.frame + 1) * self.frame_time
        moved = self.state.copy()
        for group in self.pins:
            if group.path is not None:
                self._lead(moved, group, end)
        self.solver.advance(moved, self.forces.during(start, end))
        for group in self.pins:
            if group.path is not None:  # float32 steps add up to almost where they lead
                inside = moved.values[:3, PAD:-PAD, : self.sheet.shape[1]]
                inside[:, group.mask] = group.at(end).T
        return moved

    def _lead(self, state: SheetState, group: Pins, end: float) -> None:
        here = self.sheet.positions(state)
        there = here.astype(np.float64)
        there[group.mask] = group.at(end)
        self.sheet.set_steps(state, (there - here) / self.solver.substeps, group.mask)

    def _check(self, state: SheetState) -> None:
        """Raises Unstable with the frame, the key point and what to change."""
        fault = self._fault(state)
        if fault is None:
            return
        where, what = fault
        i, j = (int(k) for k in np.argwhere(where)[0])
        number = self.frame + 1
        raise Unstable(
            f"frame {number}: key point ({i}, {j}) {what}; the state of frame {self.frame} is kept. "
            f"Use {self.solver.instead}a smaller solver.safety, a stiffer material, slower pins, or weaker forces",
            number,
        )

    def _fault(self, state: SheetState) -> tuple[NDArray[np.bool_], str] | None:
        """What no sheet can be, and where, (rows, cols)."""
        sheet = self.sheet
        if not (np.abs(state.values[:3]) < FARTHEST).all():
            far = sheet.present & ~(np.abs(sheet.positions(state)) < FARTHEST).all(axis=-1)
            if far.any():
                return far, "is not finite"
        if not sheet.largest_stretch(state) <= self._longest:
            weft, warp = sheet.stretch(sheet.positions(state))
            family = weft if weft.max() >= warp.max() else warp
            here = np.pad(family == family.max(), [(0, n - m) for n, m in zip(sheet.shape, family.shape, strict=True)])
            strain = f"{100 * family.max():.0f} % (allowed: {100 * self._longest:.0f} %)"
            return here, f"hangs on a thread stretched by {strain}"
        slip = sheet.largest_slip(state)
        if not slip <= LARGEST_SLIP:
            moved = np.where(sheet.present, np.linalg.norm(sheet.steps(state), axis=-1), 0.0)
            return moved == moved.max(), (
                f"is among those that pass their neighbours by {slip:.3g} times their distance in one step of "
                f"{1e6 * self.solver.step:.3g} µs (allowed: {LARGEST_SLIP:g})"
            )
        return None

    def save(self, path: Path | str, about: str = "") -> None:
        """The state to a file, replaced as a whole: whoever reads it finds this state or the one before. about: kept
        with it, for whoever makes the simulation."""
        with in_one_step(path) as part, part.open("wb") as file:
            found = np.array(self.solver.found)
            np.savez(
                file, values=self.state.values, frame=self.frame, found=found, made_for=self._made_for, about=about
            )
            file.flush()
            os.fsync(file.fileno())

    def restore(self, path: Path | str) -> None:
        """Goes on from a state that was saved. Raises InputError where there is none, or one of another simulation."""
        try:
            with np.load(path, allow_pickle=False) as saved:
                values, frame, made_for = saved["values"], int(saved["frame"]), str(saved["made_for"])
                found = tuple(saved["found"].tolist())
        except (OSError, ValueError, KeyError, EOFError) as error:
            raise InputError(f"{path}: no saved state ({error}); allowed: a file that `save` wrote") from None
        except Exception as error:  # zipfile and zlib raise their own for a file that was cut or changed
            raise InputError(f"{path}: a damaged state ({error}); allowed: a file that `save` wrote") from None
        if made_for != self._made_for or values.shape != self.state.values.shape or values.dtype != np.float32:
            raise InputError(f"{path}: saved by a simulation of another sheet, forces or step; start it anew")
        self.state = self._before = SheetState(values)
        self.frame, self._strained = frame, self._strained and frame == 0
        self.solver.go_on(found)

    def _fingerprint(self) -> str:
        """Of everything the motion follows from at the start, except the paths of pins and, where the body has a name
        for it, how that moves."""
        digest = hashlib.sha256()
        for array in (self.sheet.cells, self.sheet.pinned):
            digest.update(repr(array.shape).encode() + array.tobytes())
        sheet = self.sheet
        parts = (sheet.material, sheet.springs, *sheet.bands, self.forces, type(self.solver).__name__)
        digest.update(repr((*parts, self.solver.step, self.solver.substeps, *self.solver.settings)).encode())
        if self.forces.body is not None:
            digest.update(self.forces.body.made_of().encode())
        for one in self.solver.constraints:
            digest.update(one.made_of().encode())
        return digest.hexdigest()
