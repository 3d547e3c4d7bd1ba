"""Shear: threads that bend between their crossings in the plane, crossings that rub, and threads that touch at last.

- G = a·12 / (s₁·l₁³/(B₁·p₁) + s₂·l₂³/(B₂·p₂)) (Kilby 1963; Leaf & Sheta 1984), legs l between pinned crossings, s
  the room of a thread, p its pitch, B one yarn's rigidity with its cohesion but without a finish. a = 0.21 brings it
  to what is measured: three polyesters of 41 to 61 N/m, denim of 53 to 84, and the ranges usual of shirting, suiting
  and habotai; without it yarns that bend freely in the plane would be five times as stiff.
- 2HG = 2·n₁·n₂·i·µ·V·2r/3 (Grosberg & Park 1966): every crossing that holds turns under friction, as a disc of the
  threads' radius r does.
- Neighbours touch at the shear angle where cos γ = d/s; d of threads pressed to a packing of 0.75.
"""

from math import acos, degrees

from taichi_cloth.mechanics.bending import crossing_force, one_yarn
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.weave.cloth_set import CLOSEST

__all__ = ["locking_angle", "shear_hysteresis", "shear_stiffness"]

PINNED = 0.21
"""Of the formula for free legs."""


def shear_stiffness(cloth: Construction) -> float:
    """G [N/m], force per width and radian."""
    give = sum(own.leg**3 / (own.per_mm * one_yarn(own, "plain") * own.pitch) for own in cloth.families)
    return PINNED * 12.0 / give


def shear_hysteresis(cloth: Construction) -> float:
    """2HG [N/m], the width of the loop of force per width against angle."""
    warp, weft = cloth.families
    force = (crossing_force(warp) + crossing_force(weft)) / 2.0
    radius = (warp.diameter + weft.diameter) / 4.0
    rubbing = (warp.fibre.friction + weft.fibre.friction) / 2.0
    held = (warp.turns + weft.turns) / 2.0
    return 2.0 * warp.per_mm * weft.per_mm * held * rubbing * force * 2.0 / 3.0 * radius


def locking_angle(cloth: Construction) -> float:
    """Shear angle at which neighbouring threads touch [°]; 0 where they do before."""
    return min(degrees(acos(min(CLOSEST * own.diameter * own.per_mm, 1.0))) for own in cloth.families)
