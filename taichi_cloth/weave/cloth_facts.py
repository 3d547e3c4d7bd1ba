"""What a mill would print on the ticket: threads per cm, g/m², crimp, cover, thickness.

Human units stand in the names; the sizes come in metres from the interlacing, the counts in tex (g per 1000
m).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.crimp import Interlacing, crimp, crossing_heights
from taichi_cloth.yarn.count import in_tex

__all__ = [
    "ClothFacts",
    "areal_mass_gsm",
    "cloth_cover",
    "cloth_facts",
    "cotton_diameter_m",
    "cover_factor",
    "thickness_m",
]

_TEX_OF_NE_1 = in_tex(1.0, "Ne")  # tex · Ne of cotton
_INCH_M = 0.0254


def cotton_diameter_m(tex: ArrayLike) -> NDArray[np.float64]:
    """Diameter of a cotton yarn [m]: d = 1 / (28 sqrt(Ne)) inch (Peirce 1937)."""
    return _INCH_M / (28 * np.sqrt(_TEX_OF_NE_1 / np.asarray(tex, dtype=np.float64)))


def areal_mass_gsm(threads_per_cm: ArrayLike, tex: ArrayLike, crimp_fraction: ArrayLike) -> float:
    """Mass of cloth [g/m²]: the sum over families of threads/cm · tex · (1 + c) / 10.

    >>> round(areal_mass_gsm([24, 22], [20, 20], [0.08, 0.06]), 2)  # a shirting
    98.48
    """
    n, t, c = (np.asarray(v, dtype=np.float64) for v in (threads_per_cm, tex, crimp_fraction))
    return float(np.sum(n * t * (1 + c)) / 10)


def cover_factor(threads_per_cm: float, tex: float) -> float:
    """Peirce's cover factor of one family, k = threads per inch / sqrt(Ne); 28 is a closed row of cotton
    yarns.
    """
    return threads_per_cm * 2.54 / float(np.sqrt(_TEX_OF_NE_1 / tex))


def cloth_cover(k1: float, k2: float) -> float:
    """Cover factor of the cloth, Kc = k1 + k2 - k1 k2 / 28; 28 is a cloth without holes, whoever closes them."""
    k1, k2 = min(k1, 28.0), min(k2, 28.0)
    return k1 + k2 - k1 * k2 / 28


def thickness_m(cloth: Interlacing) -> float:
    """Thickness [m]: the highest top less the lowest underside of any yarn. Peirce's max(h1 + d1, h2 +
    d2).
    """
    z_warp, z_weft = crossing_heights(cloth.warp_up, cloth.warp_diameter_m, cloth.weft_diameter_m, cloth.balance)
    r_warp, r_weft = 0.5 * cloth.warp_diameter_m, 0.5 * cloth.weft_diameter_m[:, None]
    top = max((z_warp + r_warp).max(), (z_weft + r_weft).max())
    return float(top - min((z_warp - r_warp).min(), (z_weft - r_weft).min()))


@dataclass(frozen=True)
class ClothFacts:
    """The facts of one cloth. Crimps are fractions, means over the yarns of the family, weighed by their
    mass.
    """

    ends_per_cm: float
    picks_per_cm: float
    mass_gsm: float
    warp_crimp: float
    weft_crimp: float
    warp_cover: float
    weft_cover: float
    cover: float
    thickness_mm: float


def cloth_facts(cloth: Interlacing, *, warp_tex: ArrayLike, weft_tex: ArrayLike) -> ClothFacts:
    """The facts of a cloth. warp_tex: (ends,) or one number; weft_tex: (picks,) or one number.

    Raises InputError when a count is not above 0, or the threads jam.
    """
    crimps = crimp(cloth)
    rows = []
    for family, tex, c, spacing in (
        ("warp", warp_tex, crimps[0], cloth.warp_spacing_m),
        ("weft", weft_tex, crimps[1], cloth.weft_spacing_m),
    ):
        count = np.asarray(tex, dtype=np.float64)
        if count.shape not in ((), c.shape) or not (np.all(count > 0) and np.all(np.isfinite(count))):
            raise InputError(f"cloth.{family}_tex: {tex!r}; allowed: tex above 0, one number or one for each thread")
        count = np.broadcast_to(count, c.shape)
        per_cm = 0.01 * c.size / float(spacing.sum())
        mean = float(count.mean())
        rows.append((per_cm, mean, float((c * count).sum() / count.sum()), cover_factor(per_cm, mean)))
    (n1, tex1, c1, k1), (n2, tex2, c2, k2) = rows
    return ClothFacts(
        ends_per_cm=n1,
        picks_per_cm=n2,
        mass_gsm=areal_mass_gsm([n1, n2], [tex1, tex2], [c1, c2]),
        warp_crimp=c1,
        weft_crimp=c2,
        warp_cover=k1,
        weft_cover=k2,
        cover=cloth_cover(k1, k2),
        thickness_mm=1e3 * thickness_m(cloth),
    )
