"""Whole yarns: Verlet's substep with all threads of a yarn solved at once, and everything else explicit.

Shear and bending of cloth are soft, its threads are not. So its step is that of the soft springs, whatever the threads
are made of: it costs the same at 10³ and at 10⁹ N/m. `whole_yarns.py` has the systems, `yarn_frame.py` the order.

Where shear is stiff too (coated cloth, bias-bonded cloth), the diagonals are chains that are solved the same way,
and bending alone sets the step.

Beside the soft springs there is one more limit: a taut thread is a string, whose wave across is explicit. A frame in
which −λ/L = h² T/(m L) of a thread comes above ¼ is taken again with more substeps.
"""

from collections.abc import Callable
from dataclasses import replace
from math import ceil, exp, inf, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.constraints.beside_ties import longest_beside
from taichi_cloth.ground.errors import InputError
from taichi_cloth.loops.yarn_loops import YarnLoops
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.sheet import Band, Sheet, SheetState
from taichi_cloth.solvers.spring_solver import SpringSolver
from taichi_cloth.solvers.step_choice import StepChoice
from taichi_cloth.solvers.strained_start import settle
from taichi_cloth.solvers.yarn_fields import MOST_SUBSTEPS, NEVER, Family
from taichi_cloth.solvers.yarn_frame import MOST_SWEEPS, UNSOLVED, ChainFrame, YarnFrame

__all__ = ["Yarns", "left_explicit"]

SWEEPS = 2
LONGEST = 4e-4
"""Step [s] beyond which the direction threads are pushed in would show: cloth of 0.5 m that is let go is off by 0.4 mm
after 0.3 s at this one, and by 0.2 mm at half of it (`report --only solver`)."""

QUIET = 8e-4
"""The same of cloth that hardly moves, whose threads hardly turn [s], and hangs on no seams: these, and what holds it,
give by the square of the step. A skirt that hung still sank by 0.05 mm, and trembled for a second."""

RESTS, STIRS = 0.15, 0.3
"""Speed in the mean (rms) below which cloth takes such steps, and above which no more [m/s]: at the latter it moves as
after a fall of 5 mm."""

TIGHTEST = 0.25
"""−λ/L of a thread up to which the wave along it is stable, where yarns that cross it pull as much: of both it is the
mean that counts."""

CHAINED = 1.8
"""What a substep costs with chains of diagonals, in substeps without: 79 × 79 key points, two sweeps."""

WORTH = 0.9
"""Share of the substeps from which on fewer are taken again."""

WATCHED = 8
"""Substeps at the end of a frame in which sweeps go on as long as threads are UNSOLVED, of cloth that has no seams and
does not meet itself: the end is what is seen of it. With them a T-shirt that walks takes 0.72 of the time, but its
longest thread comes to 4.4 % for 3.7, and in a heap to 7.5 for 4.2; that of a sheet wrung by two turns to 3.7 for
2.3."""

LONG, SLACK = 0.0295, 1.01
"""Strain up to which it does not matter what a thread pulls, and that which a crimped one is left beside ties
(`longest_beside`) times a hair, if that is more: of crimp that gives 3 % by itself no sweep takes it back."""

LAYERED, KEEPS = 1.3, 0.2
"""What LONG may be more by, and time [s] in place of CALM, where cloth meets cloth: what two limbs pinch is pulled
about, and a frame that is taken again is searched again, which costs more than a sweep."""

GAIN = 0.95
"""Share of that which one sweep more has to come below, or it is not worth its time."""

CALM, FUTILE = 0.05, 0.1
"""Time in which no sweep more gained after which there is one less, and after which one that gained nothing is tried
again [s]; sooner only where more is left than when it was given up. Sweeps that gained before stay: a heap that lands
had five, a sixth gained nothing, and with two in the next frames a thread came to 8.8 %."""

STILL, STAYS = 0.1, 10.0
"""Speed in the mean (rms) up to which sweeps stay [m/s], and for how long [s]: each change is a jolt, and a skirt at
rest that went to and fro between two and three moved at 3 mm/s. Of what moves they do not: the paper's T-shirt would
walk with four in each frame where 2.1 do."""

HANGS, SWAYS, SLOWED = 0.005, 0.01, 6.0
"""Speed of a garment in the mean (rms) below which it hangs still, and above which no more [m/s]; its damping then, as
where it settled as it was sewn [1/s]. Fibres lose a seventh to a tenth of what they take up, which is such a rate for
folds that sway at 5 hertz; what rubs within the cloth sticks by then and takes nothing, and the corner of a seam whose
threads have two ways to lie went from one to the other every half second, 31 mm/s, and shook the folds below it."""

FINER, LASTS = 2.5, 0.5
"""How many times the substeps of the soft springs there are at least where layers were restless in each frame for so
long, and for how long after [s]. A T-shirt that lies as a heap has threads of 2 % then and not 4, trembles half as
much, and its frames take no longer: most of what they take are proofs. One that walks has such frames in rows of 8."""

TREMBLES, MORE = 0.03, 1.5
"""Layers are restless where proofs push them, or where they hardly move from frame to frame but tremble within one: at
such a speed at least (rms) [m/s], and so many times that from frame to frame."""

WILD = 0.02
"""Strain of a thread, beyond its crimp, that makes a substep wild (`whole_yarns.py`)."""


def left_explicit(
    sheet: Sheet, longest: Callable[[Sheet], float], chains: bool | None = None
) -> tuple[Sheet, float, float]:
    """The sheet with the springs that whole yarns leave to explicit steps, the longest such step [s], and what a
    substep costs, in substeps without chains; sheets of several cloths have none. longest: step of explicit springs
    that is safe [s]. chains: as of `Yarns`."""
    soft = sheet.with_springs(lambda springs: springs.without_threads)
    step = min(longest(soft), LONGEST)
    diagonal = sheet.most(lambda cloth: cloth.springs.diagonal) > 0 and not sheet.bands
    if diagonal and (chains or (chains is None and CHAINED * step < LONGEST)):
        bending = soft.with_springs(lambda springs: replace(springs, diagonal=0.0))
        other = min(longest(bending), LONGEST)
        if chains or CHAINED * step < other:
            return bending, other, CHAINED
    return soft, step, 1.0


class Yarns(SpringSolver):
    """sweeps: over all families, a substep. step, safety: as of `Verlet`, of the springs that are not solved whole.
    chains: whether the diagonals are, too; None: where that is cheaper. sewing: a garment until it hangs
    as it is worn, see HANGS."""

    answers = ("strain_limit",)
    springs_are_threads = False
    alone_where_repeated = False
    loops_win_from = 786_432
    most = MOST_SUBSTEPS  # of a frame

    def __init__(
        self,
        sheet: Sheet,
        forces: Forces,
        *,
        frame_rate: float = 60.0,
        step: float | None = None,
        safety: float = 0.9,
        sweeps: int = SWEEPS,
        chains: bool | None = None,
        sewing: bool = False,
        threads: int | None = None,
        constraints: tuple[Constraint, ...] = (),
    ) -> None:
        self.sewing, self._tied = sewing, any(one.repeated for one in constraints)
        self.sweeps, self._fewest, self._calm, self._futile = sweeps, sweeps, 0, 0
        self._finer, self._pushed, self._hangs, self._given_up = 0, 0, False, 0.0
        self.tight, self.unsolved, self._before = 0.0, 0.0, inf
        self._layered = any(one.stops for one in constraints)
        choices: dict[Sheet, StepChoice] = {}

        def longest_of(explicit: Sheet) -> float:
            choices[explicit] = StepChoice(explicit, frame_rate=frame_rate, safety=safety)
            return choices[explicit].longest

        explicit, longest, cost = left_explicit(sheet, longest_of, chains)
        self.choice, self.chains = choices[explicit], cost > 1
        self.frame_of = ChainFrame if self.chains else YarnFrame
        self.loops_of = YarnLoops
        if step is not None and not 0 < step <= longest:
            raise InputError(f"solver.step: {step!r} s; allowed: above 0, at most {longest:.4g} s")
        substeps = self.choice.substeps(step or longest)
        self._asked, self._least = step or longest, substeps
        self._rests = step is None and not self._tied and forces.strain_limit is None
        super().__init__(
            sheet, forces, frame_rate=frame_rate, substeps=substeps, threads=threads, constraints=constraints
        )

    def take_steps(self, substeps: int) -> None:
        super().take_steps(substeps)
        self.numbers |= {"sweeps": float(self.sweeps)} | ({"diagonal": 0.0} if self.chains else {})  # of one cloth
        for one in self.constraints:
            one.hangs = self._hangs
        if self._hangs:
            for numbers in (self.numbers, *self.others):
                numbers["kept"] = min(numbers["kept"], exp(-SLOWED * self.step))

    @property
    def explicit(self) -> Sheet:
        return self.choice.sheet

    @property
    def settings(self) -> tuple[object, ...]:
        return self.sweeps, self.chains

    def families(self) -> list[Family]:
        """Weft, along the rows, and warp, along the columns; and the diagonals, if they are chains."""
        east, north, cell = (self.sheet.padded(one) for one in self.sheet.weights)
        numbers = self.numbers, *self.others
        of_each = [self._threads(cloth, own) for cloth, own in zip(self.sheet.cloths, numbers, strict=True)]
        weft, warp, diagonal = (list(one) for one in zip(*of_each, strict=True))
        out = [Family((0, 1), east, weft), Family((1, 0), north, warp)]
        if self.chains:
            out += [Family((1, 1), cell, diagonal), Family((1, -1), np.roll(cell, 1, axis=1), diagonal)]
        return out

    def _threads(self, cloth: Band, shared: dict[str, float]) -> tuple[dict[str, float], ...]:
        """Numbers of the weft's threads, of the warp's, and of diagonals as chains, of one cloth. shared: `Numbers`."""
        s, m, limit = cloth.springs, cloth.material, self.forces.strain_limit
        mass = m.density * s.spacing_x * s.spacing_y
        squared = shared["structural_x"] / s.structural_x  # h², less what the air takes meanwhile
        watched = NEVER if self.sewing or self._tied or self._layered else float(max(self.substeps - WATCHED, 0))
        always = {"mass": mass, "damped": m.fibre_damping / self.step, "watched": watched}
        straight, left, out = s.drawn(m), longest_beside(m), []
        longest = LONG * (LAYERED if self._layered else 1.0)
        for constant, drawn, rest, stiff, crimp, most in (
            (s.structural_x, straight.structural_x, s.spacing_x, m.drawn_weft, m.crimp_weft, left[0]),
            (s.structural_y, straight.structural_y, s.spacing_y, m.drawn_warp, m.crimp_warp, left[1]),
        ):
            at = crimp * rest if stiff > 0 else NEVER
            numbers = {
                "rest": rest,
                "slimmer": 1 / rest,
                "soft": mass / (constant * squared),
                "stiff": mass / (drawn * squared),
                "crimp": at,
                "offset": at * (1 - constant / drawn),
                "bound": rest * limit.strain if limit else NEVER,
                "long": rest * max(longest, SLACK * most if stiff > 0 else 0.0),
                "calm": 1 / (rest * WILD + (at if stiff > 0 else 0.0)),
            }
            out.append(numbers | always)
        rest = s.diagonal_length
        compliance = mass / (s.diagonal * squared) if self.chains else NEVER
        numbers = {"rest": rest, "slimmer": 1 / rest, "soft": compliance, "stiff": compliance, "offset": 0.0}
        numbers |= {"crimp": NEVER, "bound": NEVER, "long": NEVER, "calm": 1 / NEVER}  # no shear of cloth is too much
        return (*out, numbers | always)

    def fill(self, frame: YarnFrame, state: SheetState) -> None:
        super().fill(frame, state)
        frame.yarns.take(self.sheet.padded(self.sheet.present), self.families())

    def look(self, frame: YarnFrame) -> None:
        super().look(frame)
        asked = frame if frame.loops is None else frame.loops
        self.tight, self.unsolved = asked.tightest(), asked.unsolved()

    def shorten(self, state: SheetState, reached: SheetState | None) -> bool:
        if reached is state:
            return False
        wanted = 2 * self.substeps if reached is None else self._for_tension()
        if wanted > self.substeps and self.substeps < self.most:
            self._go_over(state, wanted)
            return True
        if reached is None:
            return False
        wanted = max(wanted, self._fewest_substeps(self._rests and self._quiet(state, reached)))
        if self._tied and not self.sewing:
            self._hang(self._frame_speed(state, reached))
        still = self._still(state, reached)
        if self._sweep_more(self.sweeps > self._fewest and still):
            return True  # in the steps that it was taken in, which its start is told in
        if not WORTH * self.substeps <= wanted <= self.substeps:
            self._go_over(reached, wanted)
        if self._layered:
            self._follow(reached, still, still and self._trembles(state, reached))
        return False

    def _quiet(self, before: SheetState, state: SheetState) -> bool:
        """Whether cloth takes longer steps as it hardly moves."""
        return self._frame_speed(before, state) < (STIRS if self.substeps < self._least else RESTS)

    def _hang(self, speed: float) -> None:
        """speed: from frame to frame, of all key points (rms) [m/s]."""
        hangs = speed < (SWAYS if self._hangs else HANGS)
        if hangs != self._hangs:
            self._hangs = hangs
            self.take_steps(self.substeps)

    def _still(self, before: SheetState, state: SheetState) -> bool:
        """Whether a sheet hardly moves; layers may tremble within a frame."""
        return (self._frame_speed(before, state) if self._layered else self._inner_speed(state)) < STILL

    def _trembles(self, before: SheetState, state: SheetState) -> bool:
        return self._inner_speed(state) > max(TREMBLES, MORE * self._frame_speed(before, state))

    def _frame_speed(self, before: SheetState, state: SheetState) -> float:
        """From frame to frame, of all key points (rms) [m/s]."""
        return self._rms(state.values[:3] - before.values[:3]) / (self.step * self.substeps)

    def _inner_speed(self, state: SheetState) -> float:
        """In the last substep."""
        return self._rms(state.values[3:6]) / self.step

    def _rms(self, ways: NDArray[np.float32]) -> float:
        return sqrt(float(np.square(ways).sum()) / max(1, int(self.sheet.present.sum())))

    def _follow(self, state: SheetState, still: bool, trembles: bool) -> None:
        """To shorter steps where layers were restless in frame after frame."""
        restless = trembles or sum(one.pushed for one in self.constraints) > 1
        self._pushed = self._pushed + 1 if restless else 0
        if self._pushed >= LASTS * self.frame_rate:
            self._finer = ceil((STAYS if still else LASTS) * self.frame_rate)
        elif self._finer > 0:
            self._finer -= 1
        if self._finer and self._fewest_substeps() > self.substeps:
            self._go_over(state, self._fewest_substeps())

    def _fewest_substeps(self, quiet: bool = False) -> int:
        if self._finer:
            return 2 * ceil(0.5 * FINER * self._least)
        return self._stable() if quiet else self._least

    def _stable(self) -> int:
        """Substeps of the soft springs that are stable, and as many as cloth needs that hardly moves."""
        return min(self._least, self.choice.substeps(min(QUIET, self.choice.longest)))

    def _sweep_more(self, still: bool) -> bool:
        """Whether the last frame is to be taken again with a sweep more. still: see `_still`."""
        calm = KEEPS if self._layered else CALM
        patience = ceil((STAYS if still else calm) * self.frame_rate)
        tried, wanted = self._before < inf, self.unsolved > UNSOLVED
        given_up = wanted and self.unsolved >= GAIN * self._before
        hopes = self._futile == 0 or GAIN * self.unsolved > self._given_up
        if tried and not given_up:
            self._calm = 0
        if wanted and not given_up and hopes and self.sweeps < MOST_SWEEPS:
            self._before = self.unsolved
            self.take_sweeps(self.sweeps + 1)
            return True
        # Those that leave it unsolved are held against less, in time: a tight waistband asks for ever.
        self._before, self._calm, self._futile = inf, self._calm + 1, max(self._futile - 1, 0)
        if given_up:
            self._futile, self._given_up = ceil(FUTILE * self.frame_rate), self.unsolved
            self.take_sweeps(self.sweeps - 1)
        elif self.sweeps > self._fewest and self._calm >= patience:
            self._calm = 0
            self.take_sweeps(self.sweeps - 1)
        return False

    def take_sweeps(self, sweeps: int) -> None:
        """So many from the next frame on."""
        if sweeps != self.sweeps:
            self.sweeps = sweeps
            self.take_steps(self.substeps)

    @property
    def torn(self) -> str:
        if self.tight <= TIGHTEST:
            return ""
        return (
            f"threads are pulled by {self.pull:.2g} N/m, and more than {self.most} substeps a frame would follow them"
        )

    @property
    def pull(self) -> float:
        """By which the tightest thread of the last frame is pulled [N/m]."""
        spacing = max(self.sheet.springs.spacing_x, self.sheet.springs.spacing_y)
        return self.tight * self.sheet.most(lambda cloth: cloth.material.density) * spacing / self.step**2

    def _for_tension(self) -> int:
        """Substeps that the last frame asks for by its tension; at least those that soft springs are stable with, as
        locked as they were."""
        if self.choice.lock(self.locked):
            self._least = self.choice.substeps(min(self._asked, self.choice.longest))
        if self._stable() > self.substeps:
            return self._stable()
        if self.tight > TIGHTEST:
            return 2 * ceil(0.55 * self.substeps * sqrt(self.tight / TIGHTEST))
        calm = 2 * ceil(0.5 * self.substeps * max(sqrt(2 * self.tight / TIGHTEST), 0.5))
        return min(self.substeps, max(self._stable(), calm))

    def _go_over(self, state: SheetState, substeps: int) -> None:
        """To other steps, and the steps in the state with them."""
        before = self.step
        self.take_steps(min(substeps, self.most))
        self.rescale(state, before)

    def settle(self, state: SheetState) -> None:
        settle(self, state)

    def accelerations(self, sheet: Sheet, positions: NDArray, gravity: tuple[float, float, float]) -> NDArray:
        """Without what is solved whole: what that pulls follows from what pulls at it, not from where it is."""
        return super().accelerations(self.choice.sheet, positions, gravity)

    @property
    def found(self) -> tuple[float, ...]:
        steps = self.substeps, self.sweeps, self._calm, self._futile, self._finer, self._pushed
        return *steps, self._hangs, self._given_up

    def go_on(self, found: tuple[float, ...]) -> None:
        found = (*found, *self.found[len(found) :])  # runs that were saved before told of less
        *steps, hangs, self._given_up = found
        substeps, self.sweeps, self._calm, self._futile, self._finer, self._pushed = (int(one) for one in steps)
        self._hangs = bool(hangs)
        self.take_steps(substeps)
