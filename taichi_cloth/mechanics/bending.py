"""Bending: of a yarn between two bounds, of a cloth by the crossings that press it, on the bias by torsion.

- Fibres that slide bend like as many springs side by side: R·T·t, from the specific flexural rigidity R, the yarn's tex
  T and the fibre's tex t; the lower bound. Bonded into one rod they make R·T²/φ², with φ the packing; the upper.
- A yarn lies χ times above the lower bound. χ: 3 for spun cellulosics, fitted to a cotton measured by KES after the
  correction of crossings; 1 for wool and filament. Size and resin raise it (`FINISHES`): raw denim asks for 8.
- Where a yarn is wrapped around threads of the other family, it is pressed and cannot slip; the rest is its free length
  (Peirce 1937, l − Dθ; Abbott, Grosberg & Leaf 1973; de Jong & Postle): the share f = i·D·θ/l is held, i changes of
  face a crossing, D the sum of both diameters, θ the weave angle, l the yarn from crossing to crossing; at most 0.75.
  Fibres slicker than cotton are held as much less. A family's rigidity a width then is n·χ·R·T·t / ((1 + c)·(1 − f)); 1
  + c is that of a yarn bent along its crimped path (Livesey & Owen 1964).
- The couple that must be overcome before fibres slip (Grosberg 1966), HB = n·i·µ·k·V·d/2, from the force of a crossing
  of set yarns V = 8·B·θ/p² (Olofsson 1964), B one yarn's, d its diameter, µ of fibre on fibre. k is the part of that
  force which cloth keeps after it has relaxed: 0.13 gives 2HB as KES finds it within a factor of 1.8, 1.22 mN for a
  cotton broad cloth and 0.32 for a wool tropical (Matsudaira et al. 2015), taken as Ne 40 poplin and as 2/60 Nm plain.
"""

from dataclasses import dataclass
from math import cos, sin

from taichi_cloth.mechanics.construction import FINISHES, Construction, ThreadFamily
from taichi_cloth.mechanics.fibre_mechanics import FIBRE_MECHANICS, FibreMechanics
from taichi_cloth.yarn.yarn import Yarn

__all__ = [
    "KEPT",
    "YarnBending",
    "bias_bending",
    "cohesion",
    "crossing_force",
    "family_bending",
    "family_couple",
    "family_torsion",
    "yarn_bending",
]

COHESION = {"spun cellulosic": 3.0, "other": 1.0}
LARGEST_PRESSED = 0.75
KEPT = 0.13
"""Part of the force of a crossing that is left in relaxed cloth."""


@dataclass(frozen=True)
class YarnBending:
    """Flexural rigidity of a yarn [mN·mm²]: fibres that slide, as expected, and bonded into one rod."""

    free: float
    expected: float
    bonded: float


def cohesion(fibre: FibreMechanics, finish: str = "plain") -> float:
    """χ: a yarn's rigidity over that of its fibres if they slide."""
    held = fibre.cellulosic and fibre.form == "spun"
    return COHESION["spun cellulosic" if held else "other"] * FINISHES[finish]


def yarn_bending(yarn: Yarn, fibre: FibreMechanics, finish: str = "plain") -> YarnBending:
    """A yarn that is bent by itself.

    >>> from taichi_cloth.mechanics.fibre_mechanics import fibre_mechanics
    >>> bending = yarn_bending(Yarn(count_tex=15, plies=1), fibre_mechanics("cotton"))
    >>> round(bending.free, 3), round(bending.expected, 2), round(bending.bonded)
    (0.485, 1.45, 119)
    """
    tex = yarn.folded_tex
    free = fibre.flexural * tex * 0.1 * yarn.fineness_dtex
    return YarnBending(free, cohesion(fibre, finish) * free, fibre.flexural * (tex / yarn.packing) ** 2)


def one_yarn(family: ThreadFamily, finish: str) -> float:
    """Flexural rigidity of one thread of a family as expected [mN·mm²]."""
    return cohesion(family.fibre, finish) * family.fibre.flexural * family.tex * family.single_fibre


def pressed(family: ThreadFamily) -> float:
    """Share f of a thread's length where those that it crosses hold its fibres."""
    wrapped = family.angle * (family.diameter + family.other_diameter)
    share = min(family.turns * wrapped / family.leg, LARGEST_PRESSED)
    return share * min(family.fibre.slipping / FIBRE_MECHANICS["cotton"].slipping, 1.0)


def family_bending(cloth: Construction) -> tuple[float, float]:
    """Bending rigidity of the cloth when the warp, and when the weft, is bent [µN·m]."""
    warp, weft = (
        own.per_mm * one_yarn(own, cloth.finish) / ((1.0 + own.crimp) * (1.0 - pressed(own))) for own in cloth.families
    )
    return warp, weft


def crossing_force(family: ThreadFamily) -> float:
    """Force with which a thread presses one that it crosses [mN], V = 8·B·θ/p², as far as relaxed cloth keeps it.

    It is that of the yarn itself: a finish dries on cloth that lies still, and presses nothing.
    """
    return KEPT * 8.0 * one_yarn(family, "plain") * family.angle / family.pitch**2


def family_couple(cloth: Construction) -> tuple[float, float]:
    """Frictional couple HB a width of cloth, half of KES's 2HB, of the warp and of the weft [mN = mN·mm/mm]."""
    warp, weft = (
        own.per_mm * own.turns * own.fibre.slipping * crossing_force(own) * own.diameter / 2.0 for own in cloth.families
    )
    return warp, weft


def family_torsion(cloth: Construction) -> float:
    """Torsional rigidity of the sheet J = J₁ + J₂ [µN·m]: that of the threads of both families, χ·S·T·t each, with S
    the fibres' specific torsional rigidity (Cooper 1960)."""
    return sum(
        own.per_mm * cohesion(own.fibre, cloth.finish) * own.fibre.torsional * own.tex * own.single_fibre
        for own in cloth.families
    )


def bias_bending(warp: float, weft: float, torsion: float, angle: float) -> float:
    """Bending rigidity of a strip cut at an angle [rad] to the warp (Cooper 1960), all in one unit:
    B(φ) = B₁ cos⁴φ + B₂ sin⁴φ + J cos²φ sin²φ.

    A sheet bent to the curvature κ at φ bends its threads by κ cos²φ and κ sin²φ and twists both families by κ sinφ
    cosφ: the energy of the three is that of the strip.
    """
    c, s = cos(angle) ** 2, sin(angle) ** 2
    return warp * c * c + weft * s * s + torsion * c * s
