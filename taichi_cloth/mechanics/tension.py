"""Tension: soft while crimp is drawn out, then stiff. Three numbers for each family, and Poisson's effect of crimp.

- At first straight legs bend (Leaf & Kandil 1980), for small strains and set crimp:
      E_i = 12·B_i·p_i / (s_i·l_i³·sin²θ_i) · (1 + B_j/B_i · l_i³cos²θ_i / (l_j³cos²θ_j)),
      ν_ij = l_i cos²θ_i sinθ_j / (l_j cos²θ_j sinθ_i),  i pulled, j contracts,
  with B of fibres that slide. Floats do not bend: E is divided by the changes of face a crossing. The yarns' own
  stretch lies in series.
- At last threads are straight and pull: E = n·Y·T/(1 + c), Y of the yarn 0.9·E·cos²α for filaments, half of the fibre's
  E for spun yarns (usual; from memory).
- In between threads do not grow: what the pulled family's crimp gives, the other's takes on (Peirce 1937). The curve
  turns stiff where the pulled threads are straight, or the others so wavy that they jam.
"""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from taichi_cloth.mechanics.construction import Construction, ThreadFamily
from taichi_cloth.weave.cloth_set import CLOSEST

__all__ = ["Tension", "drawn_stiffness", "family_tension", "interchange_strain", "leg_stiffness", "poisson"]

SPUN_SHARE, FILAMENT_SHARE = 0.5, 0.9
LEAST_ANGLE = 1e-3  # rad: a thread as straight as that does not bend when it is pulled


@dataclass(frozen=True)
class Tension:
    """T(ε) of one family: stiffness at first and with its crimp drawn out [N/m], and the strain at which that is."""

    initial: float
    drawn: float
    crimp_strain: float


def _free_yarn(own: ThreadFamily) -> float:
    """Rigidity of one thread whose fibres slide [mN·mm²]."""
    return own.fibre.flexural * own.tex * own.single_fibre


def _pair(cloth: Construction, pulled: int) -> tuple[ThreadFamily, ThreadFamily]:
    return cloth.families[pulled], cloth.families[1 - pulled]


def drawn_stiffness(own: ThreadFamily) -> float:
    """Of straight threads [N/m]."""
    modulus = own.fibre.modulus  # N/tex
    share = FILAMENT_SHARE * cos(own.helix) ** 2 if own.fibre.form == "filament" else SPUN_SHARE
    return 1e3 * own.per_mm * share * modulus * own.tex / (1.0 + own.crimp)


def initial_stiffness(cloth: Construction, pulled: int) -> float:
    """Of legs that bend, with the yarn's own stretch in series [N/m]."""
    own = cloth.families[pulled]
    return 1.0 / (1.0 / leg_stiffness(cloth, pulled) + 1.0 / drawn_stiffness(own))


def leg_stiffness(cloth: Construction, pulled: int) -> float:
    """Of legs that bend alone [N/m]."""
    own, other = _pair(cloth, pulled)
    b_own, b_other = (_free_yarn(f) for f in (own, other))
    angle, leg = max(own.angle, LEAST_ANGLE), own.straight_leg
    across = b_other * leg**3 * cos(angle) ** 2 / (b_own * other.straight_leg**3 * cos(other.angle) ** 2)
    plain = 12.0 * b_own * own.pitch * own.per_mm / (leg**3 * sin(angle) ** 2) * (1.0 + across)
    return plain / max(own.turns, 1e-3)


def poisson(cloth: Construction, pulled: int) -> float:
    """Contraction of the other family over the growth of the pulled one, while crimp is drawn out."""
    own, other = _pair(cloth, pulled)
    return (
        own.straight_leg
        * cos(own.angle) ** 2
        * sin(other.angle)
        / (other.straight_leg * cos(other.angle) ** 2 * max(sin(own.angle), LEAST_ANGLE))
    )


def interchange_strain(cloth: Construction, pulled: int) -> float:
    """Strain at which threads that do not grow are straight, or those across jam. At most about the crimp.

    Straight legs, L² = p² + h² for each family. The wave that the pulled threads lose goes to the others, whose pitch
    shrinks until it is Peirce's least, p² = h·(2D − h); threads under load are pressed to the closest packing first.
    """
    own, other = _pair(cloth, pulled)
    whole = CLOSEST * (own.height + other.height)
    square = other.pitch**2 + other.height**2

    def jammed(height: float) -> bool:
        return square - height**2 < height * (2.0 * whole - height)

    # The leg's square less h² falls as h·(2D − h) rises, up to h = D: square = 2·D·h where they meet.
    highest = whole if not jammed(whole) else max(square / (2.0 * whole), other.height * CLOSEST)
    left = max(whole - highest, 0.0)
    if left >= own.height:
        return 0.0
    grown = float(np.sqrt(own.pitch**2 + own.height**2 - left**2))
    return own.turns * (grown / own.pitch - 1.0)


def family_tension(cloth: Construction) -> tuple[Tension, Tension]:
    """Of the warp and of the weft."""
    warp, weft = (
        Tension(
            min(initial_stiffness(cloth, k), drawn_stiffness(cloth.families[k])),
            drawn_stiffness(cloth.families[k]),
            interchange_strain(cloth, k),
        )
        for k in (0, 1)
    )
    return warp, weft
