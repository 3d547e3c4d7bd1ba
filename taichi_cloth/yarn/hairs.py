"""Fibres that leave the yarn (paper 2.2): how many a yarn usually has, and where flyaway ends and loops run."""

from math import ceil, pi, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.yarn.spin import GIRTH, OVERLAP, Strands, unit
from taichi_cloth.yarn.yarn import Hairiness, Yarn

__all__ = ["hairs", "usual_hairiness"]

F64 = NDArray[np.float64]

ROOT = 0.5  # of the yarn's radius, at which hairs begin: inside, between its fibres
ROOTED = 0.15  # share of a hair's length on which it comes out
TIP = 0.3  # share of a flyaway end's length on which it gets thinner
POINT = 0.25  # of a fibre's radius, at its tip

USUAL_TEX = 20.0
SPUN: dict[str, tuple[float, float, float]] = {"cotton": (2400.0, 2000.0, 0.11), "wool": (3200.0, 2200.0, 0.22)}
"""Ends and loops a metre, and their mean rise [mm], of spun yarns of `USUAL_TEX` in finished cloth, chosen by eye.
Weaving and finishing lay flat or singe off most of what a yarn has as it leaves the spindle."""
OTHERS = "cotton"
"""As which spun yarns of other fibres are."""
NAPPED: dict[str, tuple[float, float, float]] = {"cotton": (18000.0, 6000.0, 0.10), "wool": (15000.0, 6000.0, 0.15)}
"""The same of cloth that is milled or raised: fibres drawn out of the yarns lie over them in all directions."""
LIE, FLAT = 1.5, 5.0
"""How far hairs go along their yarn over how high they rise: those that stand off it, and those of a nap."""


def usual_hairiness(fibre: str, form: Literal["spun", "filament"], tex: float, *, raised: bool = False) -> Hairiness:
    """What the yarn of a fibre has in finished cloth, where nobody states it: of filaments none; spun ones more the
    thicker they are, as the root of their count [tex]. raised: in cloth with a nap."""
    if form == "filament":
        return Hairiness()
    known = NAPPED if raised else SPUN
    ends, loops, height = known.get(fibre, known[OTHERS])
    more = sqrt(tex / USUAL_TEX)
    return Hairiness(ends * more, loops * more, height, FLAT if raised else LIE)


def hairs(yarn: Yarn, *, length: float, step: float, seed: int, each: int = 1, part: int = 0) -> Strands:
    """Flyaway ends and loops on `length` [m] of yarn, each a row of points at most `step` [m] apart.

    A flyaway end comes out of the yarn at a slant, rises, curls and ends in a point; a loop rises and goes in again.
    Which and where is drawn from `seed`; their number is the stated number per metre, rounded at random so that the
    mean is right. All rows have as many points as the longest hair needs. A hair is as thick as a real fibre; or it
    stands for `each` of them and is as many times as wide: then it is every `each`-th, from number `part` on.
    """
    rng = np.random.Generator(np.random.Philox(key=seed))
    stated = yarn.hairiness
    counts = [int(n * length + rng.random()) for n in (stated.ends_per_m, stated.loops_per_m)]
    rows = sum(counts)
    height = stated.height_mm * 1e-3 * np.clip(rng.exponential(1.0, rows), 0.15, 3.0)
    reach = height * (stated.lie / LIE) * rng.uniform(0.8, 2.2, rows) * np.where(rng.random(rows) < 0.5, -1.0, 1.0)
    span = np.hypot(height * 1.3, reach)
    points = max(4, ceil(float(span.max()) / step)) if rows else 4
    tau = (np.arange(points) + 0.5) / points
    is_end = (np.arange(rows) < counts[0])[:, None]
    t = tau[None, :]
    bend, lean = rng.uniform(-1.2, 1.2, (2, rows, 1))
    around = rng.uniform(0.0, 2.0 * pi, (rows, 1))
    begin = rng.uniform(0.0, length, (rows, 1))
    curl = rng.uniform(0.04, 0.18, (rows, 1))  # of the hair's length
    waves, phase = rng.uniform(4.0, 12.0, (2, rows, 1))

    def path(t: F64) -> F64:
        rise = np.where(is_end, np.maximum(t, 0.0) ** 1.4, 4.0 * t * (1.0 - t)) * height[:, None]
        swing = curl * np.sin(pi * np.clip(t, 0.0, 1.0) * 0.5) * span[:, None]
        buried = np.clip(1.0 - np.where(is_end, t, np.minimum(t, 1.0 - t)) / ROOTED, 0.0, 1.0)
        r = (1.0 - (1.0 - ROOT) * buried**2) * yarn.diameter / 2 + rise
        turn = around + bend * t + lean * t * t + swing * np.sin(waves * t + phase) / r
        x = begin + reach[:, None] * t + swing * (np.cos(waves * 0.8 * t + phase) - np.cos(phase))
        return np.stack([x, r * np.cos(turn), r * np.sin(turn)], -1)

    middle = path(t)
    tangent = unit(path(t + 1e-3) - path(t - 1e-3))
    out = middle.copy()
    out[..., 0] = 0.0
    normal = out - tangent * np.sum(out * tangent, axis=-1, keepdims=True)
    segment = np.linalg.norm(path(t + 0.5 / points) - path(t - 0.5 / points), axis=-1)
    thin = np.where(is_end, np.maximum(1.0 - t, 0.0) / TIP, 1.0).clip(POINT, 1.0)
    girth = 1.0 + GIRTH * rng.uniform(-1.0, 1.0, (rows, 1))
    tone = 1.05 + 0.08 * rng.standard_normal(rows).clip(-2, 2)
    kept = slice(part, None, each)
    return Strands(
        position=middle[kept],
        tangent=tangent[kept],
        normal=unit(normal)[kept],
        ply=np.zeros(len(tone[kept]), np.int32),
        tone=tone[kept],
        depth=np.ones((rows, points))[kept],
        radius=(each * yarn.fibre_diameter / 2 * girth * thin)[kept],
        away=np.linalg.norm(out, axis=-1)[kept],
        half_length=(OVERLAP * 0.5 * segment)[kept],
    )
