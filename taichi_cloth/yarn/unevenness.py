"""Thick and thin places: how the mass of a yarn varies along it, and how wide it lies in cloth there.

Fibres that are laid at random give a yarn of n of them a coefficient of variation of 1/√n and a little more, for they
are not all alike (J. G. Martindale, "A new method of measuring the irregularity of yarns", J. Text. Inst. 36, 1945);
drawing them out adds waves. Where a yarn is thick it takes less twist and is pressed flatter, so that it is its width
that varies. Thick and thin places are as long as a fibre, about, with shorter ones among them, neps and slubs.

A place's width follows from the number of its thread and how far it lies along it, by two rows of random numbers
between which it is linear: kernels find it where they ask for it (`places`), and the host finds the same. Needs no
Taichi.
"""

from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "COVER", "CV", "LEAST", "LONG", "MOST_COVERED", "MOST_HASHED", "ROWS", "SHARES", "SHIFT", "SHORT", "hashed_array",
    "thick_places", "uneven_row", "usual_unevenness",
]  # fmt: skip

F32 = NDArray[np.float32]

MOST_HASHED = 1 << 24
"""What is below every hashed number, all of which float32 tells apart."""
UNLIKE = 1.06
"""How much more fibres of unlike fineness give than those that are all alike."""
DRAWN = {"cotton": 0.10, "wool": 0.10, "flax": 0.20}
"""What drawing out adds, in squares, about as good mills spin: with it a combed cotton of Ne 40 has 15 %, a carded
one of Ne 7 11 %, a wet-spun linen of NeL 40 22 %."""
OTHERS = "cotton"
"""As which spun yarns of other fibres are."""
FILAMENT = 0.02
"""Of yarns of filaments, which are all as long as the yarn."""
MOST_UNEVEN = 0.4
"""Of a yarn that can be spun."""
WIDENS = 0.65
"""Power of its mass by which a thread's width goes: between a round one's, ½, and that of one as thick all along."""
LENGTHS, SHARES = (20e-3, 3e-3), (0.65, 0.35)
"""From number to number of each row [m], and its share of the variance."""
PUSHED = 0.25
"""How far a thread is pushed by one beside it that is thick there, of what that is wider: half of what it takes on that
side, as it gives way itself."""
MOST_COVERED = 0.97
"""Share of a cloth that one family of threads covers at most: some light comes between them."""
LEAST = 0.4
"""Of its width, which a thread has at least."""

CV, LONG, SHORT, SHIFT, COVER = range(5)
"""Of a family of threads in the arrays that kernels read: standard deviation of its width over the mean; steps of each
row from crossing to crossing; how far its threads push each other aside [threads]; share of the cloth they cover."""
ROWS = 5
"""Numbers a family."""


def usual_unevenness(fibre: str, form: Literal["spun", "filament"], fibres: float) -> float:
    """Coefficient of variation of the mass along a yarn of a fibre with so many in its section, where nobody states
    it."""
    if form == "filament":
        return FILAMENT
    return min(float(np.hypot(UNLIKE / sqrt(max(fibres, 1.0)), DRAWN.get(fibre, DRAWN[OTHERS]))), MOST_UNEVEN)


def uneven_row(unevenness: float, pitch: float, cover: float = 0.0) -> F32:
    """What kernels keep of a family: threads of that unevenness that cover a share of the cloth, a crossing every
    `pitch` [m]."""
    rates = [pitch / length for length in LENGTHS]
    return np.array([WIDENS * unevenness, *rates, PUSHED * cover, min(cover, MOST_COVERED)], np.float32)


def hashed_array(a: ArrayLike, b: ArrayLike) -> NDArray[np.int64]:
    """A whole number from 0 to 2²⁴ − 1 from two, as of `places.hashed`, of arrays."""
    x = (np.asarray(a, np.int64) * 73856093 + np.asarray(b, np.int64) * 19349663 + 83492791) & 0xFFFFFFFF
    x = ((x ^ (x >> 16)) * 73244475) & 0xFFFFFFFF
    x = ((x ^ (x >> 16)) * 73244475) & 0xFFFFFFFF
    return (x ^ (x >> 16)) & (MOST_HASHED - 1)


def thick_places(uneven: F32, seed: ArrayLike, along: ArrayLike) -> F32:
    """How wide threads are over their mean, as of `places.wider_at`, of arrays. uneven: of their family."""
    out = np.ones(np.broadcast(seed, along).shape)
    for number, rate in enumerate((uneven[LONG], uneven[SHORT])):
        x = (np.asarray(along, np.float32) * rate).astype(np.float64)
        k = np.floor(x).astype(np.int64)
        low, high = (hashed_array(seed, 2 * (k + end) + number) for end in (0, 1))
        value = (low + (x - k) * (high - low)) * (2.0 / MOST_HASHED) - 1.0
        out += float(uneven[CV]) * sqrt(4.5 * SHARES[number]) * value
    return np.maximum(out, LEAST).astype(np.float32)
