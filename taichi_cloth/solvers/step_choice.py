"""How many substeps a frame of Verlet takes, from the shape that the sheet is in.

The step follows the highest frequency of the springs (`stability.py`), at rest where a run begins. Where springs are
stiffer together than at rest a bound of that frequency tells, which is looked at after each frame (`stiffest.py`).
Where the step is within 3 % of what the bound allows, the frequency itself is worked out; where it is within 3 % of
what this allows, shorter steps are wanted.
"""

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.stability import FrequencyBound, highest_frequency, longest_in

__all__ = ["ROUGH", "StepChoice", "substeps_of"]

NEAR = 0.97
"""Share of the stable limit up to which a step is left as it is where the limit shrinks as the shape changes."""

GROWTH = 1.02
"""By how much the bound of the frequency has to grow before the frequency itself is worked out again."""

QUARTERS = 4
"""Shares of locking that steps are chosen for: not each frame asks for others."""

ROUGH = 1e-2
"""Tolerance with which the square of that frequency is worked out on the way: a frame waits for it."""


def substeps_of(frame_rate: float, step: float) -> int:
    """Of a frame of 1/frame_rate [s], each of at most `step` [s]: two at a time, for paired constraints. 1e-9: a frame
    that is just so many steps is not one more."""
    return max(2, 2 * ceil(1 / frame_rate / step / 2 - 1e-9))


class StepChoice:
    """Of one sheet, for frames of 1/frame_rate [s]. safety: share of the stable limit.

    Raises InputError on either where it can be none.

    frequency: ω_max [rad/s] that steps were last chosen for. seen: the bound then [rad/s], 0 at rest. locked: the share
    of the stiffness of locking that they are for; what it adds to ω² is at most that share of ω² of the locked cells
    alone.
    """

    def __init__(self, sheet: Sheet, *, frame_rate: float, safety: float) -> None:
        if not (np.isfinite(frame_rate) and frame_rate > 0):
            raise InputError(f"solver.frame_rate: {frame_rate!r}; allowed: above 0")
        if not 0 < safety <= 1:
            raise InputError(f"solver.safety: {safety!r}; allowed: above 0, at most 1")
        self.sheet, self.frame_rate, self.safety = sheet, frame_rate, safety
        self._held = sheet.with_springs(lambda springs: springs.held)
        self.frequency, self.seen = highest_frequency(self._held), 0.0
        self.bound = FrequencyBound(self._held)
        locks, self.locked = sheet.most(lambda cloth: cloth.springs.lock) > 0, 0.0
        alone = sheet.with_springs(lambda springs: springs.alone(2 * springs.lock)) if locks else None
        self._of_locked = highest_frequency(alone, tolerance=ROUGH) ** 2 if alone else 0.0

    @property
    def limit(self) -> float:
        """The longest stable step [s]."""
        return self._allowed(self.frequency)

    @property
    def longest(self) -> float:
        """The longest that is safe [s]."""
        return self.safety * self.limit

    def substeps(self, step: float) -> int:
        """Of a frame, each of at most `step` [s]."""
        return substeps_of(self.frame_rate, step)

    def lock(self, share: float) -> bool:
        """Takes steps for that much of locking, in quarters; whether that is another share than before."""
        before, self.locked = self.locked, ceil(QUARTERS * share - 1e-6) / QUARTERS
        return self.locked != before

    def crossed(self, step: float, bound: float) -> bool:
        """Whether a shape of that bound [rad/s] has to be looked at by `look`."""
        return bound >= GROWTH * self.seen and step >= NEAR * self._allowed(bound)

    def look(self, step: float, shape: NDArray[np.float64], bound: float) -> bool:
        """Works out the frequency of a shape (rows, cols, 3) [m]: whether the step is too near its limit."""
        self.frequency, self.seen = highest_frequency(self._held, shape, tolerance=ROUGH), bound
        return step >= NEAR * self.limit

    def any_shape(self) -> None:
        """From now on steps are for any shape."""
        self.locked = 1.0
        self.frequency, self.seen = self.bound.anywhere(), np.inf

    def _allowed(self, frequency: float) -> float:
        if self.locked > 0:
            frequency = sqrt(frequency**2 + self.locked * self._of_locked)
        return longest_in(self.sheet, frequency)
