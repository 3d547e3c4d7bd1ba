"""Level of detail: how many of a block's particles are worth drawing, and what those that are drawn are changed by.

After R. L. Cook, J. Halstead, M. Planck, D. Ryu, "Stochastic simplification of aggregate detail", SIGGRAPH 2007. A
block whose particles are smaller than `target` pixels draws a share λ of them, each enlarged so that the areas add up
to the same; the last of them fade in with λ, so nothing pops. Particles keep their own normal and tangent, so the mean
answer to any light stays. What a sample cannot keep, how particles hide each other and stand out beyond the yarn's
edge, is put right by measured `Gains`. A thread sends to the eye a share of its colour and a sheen without colour,
which a sample changes differently, so the colour is multiplied and openness, on which both hang, is led towards 1.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x2

__all__ = ["FADE", "FULL", "LEAST", "NO_GAINS", "UNCHANGED", "Gains", "gain", "thinned_to"]

FULL = 1.3
"""The share λ from which on all particles are drawn whole: the last 23 % of a share are fading."""
FADE = 1.0 - 1.0 / FULL
UNCHANGED = (1.0, 1.0, 1.0, 0.0)
"""What `Gains` that change nothing have at every share: factors for the radius and for the colour of warp and weft,
and how far openness is led towards 1 (towards 0 where negative)."""
TARGET = 0.5
"""Radius [px] that the particles of a large cloth are thinned to."""
FINEST, LEAST = 1 / 16, 80_000
"""At this radius of its particles [px] no fewer of a cloth are drawn. Few show chance: of a swatch of 1.4 million, as
large as 1/16 px makes it, 22,000 had a brightness that differed by 1.5 % from one sample to the next (standard
deviation; a colour's alone by 3.7 % in a tartan), 86,000 by 0.5 %."""


@dataclass(frozen=True)
class Gains:
    """What a thinned cloth's particles are changed by. tilt: (n,) rising, the mean cosine between the cloth's normal
    and the view. factor: (n, levels, 4), at λ = 1, 1/2, 1/4, …, of what `UNCHANGED` names."""

    tilt: NDArray[np.float64]
    factor: NDArray[np.float64]

    def at(self, tilt: float) -> NDArray[np.float32]:
        """(levels, 4) for one view: linear between tilts."""
        place = float(np.interp(tilt, self.tilt, np.arange(len(self.tilt))))
        left = min(int(place), len(self.tilt) - 1)
        right = min(left + 1, len(self.tilt) - 1)
        return np.asarray(self.factor[left] + (place - left) * (self.factor[right] - self.factor[left]), np.float32)


NO_GAINS = Gains(np.ones(1), np.tile(UNCHANGED, (1, 2, 1)))


def thinned_to(particles: int) -> float:
    """The radius [px] to thin a cloth of so many particles to: a share (FINEST / radius)² of them is `LEAST`."""
    return min(TARGET, FINEST * (particles / LEAST) ** 0.5)


@ti.func
def gain(gains: F32x2, level, c):
    """The factor c of `Gains.at` at −log₂ λ = level."""
    low = ti.min(ti.cast(level, ti.i32), gains.shape[0] - 2)
    return gains[low, c] + ti.min(level - low, 1.0) * (gains[low + 1, c] - gains[low, c])
