"""Springs of the key points (paper 3.1, Figure 7), with constants that make the *sheet* right.

On a grid of key points with spacing a along the weft (index j) and b along the warp (index i) lie structural springs
to the four neighbours, two crossing diagonals in every cell for shear, and a law between second neighbours for
bending. A homogeneous strain (e_x, e_y, shear angle g) costs, per area,

    2 W = C_x e_x² + 2 G e_x e_y + C_y e_y² + G g²,      l² = a² + b²
    G   = 2 k_d a b / l²                                 both diagonals of a cell
    C_x = (k_x + 4 q_x) a/b + G a²/b²                    structural, second neighbours (q), diagonals
    C_y = (k_y + 4 q_y) b/a + G b²/a²

so the diagonals also stiffen the sheet along its threads, and couple the two directions. Pulled along x with free
edges such a sheet answers with E_x = C_x − G²/C_y, and E_x / E_y = C_x / C_y. Given E_x, E_y, G, solve

    C_y = (E_y + sqrt(E_y² + 4 G² E_y / E_x)) / 2,       C_x = C_y E_x / E_y

and then k_d, k_x and k_y: all calibrated together. Springs on an edge of the sheet stand for half a strip and get
half the constant, as edge key points get half the mass (`sheet.py`).

Diagonals get shorter together where a cell is twisted, though nothing is sheared: with threads that keep their length
by G a⁴ κ_xy⁴/32 an area, which on wide grids is more than bending. So a fabric that has friction or locking within, of
whose cells each is looked at anyway (`motion/slipping.py`), has cells in their place. They measure shear by the
difference of their diagonals' lengths: k_c/2 (d₁ − d₂)², k_c = k_d/2. Then C_x = E_x, C_y = E_y and nothing couples.

Threads of bent cloth are arcs, and their chords feign a shear: on a cylinder at an angle to them each thread is a
helix, whose chords lean towards the other family's, so that the product of a cell's mean edges is less by κ_xy a b
(a² κ_xx + b² κ_yy)/6. That is added again, as T·C/(12 l) to d₁ − d₂: T = x₀₀ − x₁₀ − x₀₁ + x₁₁ is a b κ_xy, C the sum
of all second differences at the cell's corners, 4 (a² κ_xx + b² κ_yy). It is part of the energy, whose forces act on
all twelve key points; what is left falls with a⁴. Where a corner has no hinge cells keep to their chords.

Bending laws:
- "hinge" (default): energy B/2 ∫ κ² with κ ≈ |x₋ − 2x + x₊| / a², the quadratic bending of Bergou et al. 2006 on a
  grid; linear in the positions, right near the flat state. Energy of a hinge: β/2 |x₋ − 2x + x₊|², β = B b/a³.
- "spring": the paper's spring to the second neighbour. Its length changes only with the square of the angle, so it
  has no stiffness near the flat state; it stores the energy of B at one curvature κ₀ only: q = 16 B b / (a⁵ κ₀²).

What woven cloth has beside, each where the fabric has it:
- Torsion: J/2 ∫ κ_xy² with κ_xy ≈ |x₀₀ − x₁₀ − x₀₁ + x₁₁| / (a b) of a cell's corners; τ/2 |…|², τ = J/(a b). Bent
  at an angle φ to the warp the sheet then has Cooper's B₁ cos⁴φ + B₂ sin⁴φ + J cos²φ sin²φ. Diagonals are springs
  along themselves, and add nothing to that near the flat state.
- Friction of bending: an elastic part in series with a slider (Prandtl), at every hinge, on c = (x₋ − 2x + x₊)·n: it
  pulls by r (c − c₀), at most by s = HB b/a, and beyond that c₀ is dragged along. r is that of HELD_BENDING × B, or of
  what reaches HB at the curvature SLIPS, whichever is less.
- Friction of shear: the same in every cell, on the difference of its diagonals' lengths: s = HG l/2 and r = r_G
  l²/(4ab), r_G = HELD_SHEAR × G.
- Locking: as threads touch, shear gets stiffer: from LOCKS_OVER before the locking angle to as much after it its
  stiffness rises evenly from G to (1 + LOCKED) G, and stays there.
"""

from dataclasses import dataclass, fields, replace
from math import hypot, isfinite, pi, sin, sqrt
from typing import Literal, get_args

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.sheet.materials import Material

__all__ = ["BendingLaw", "Springs", "calibrate"]

BendingLaw = Literal["hinge", "spring"]

HELD_BENDING, SLIPS = 4.0, 10.0
"""Bending before fibres slip, over B at most; and the curvature [1/m] at which they do at least."""

HELD_SHEAR = 0.3
"""Shear stiffness that friction adds before crossings turn, over G. KES finds them turning within half a degree, which
asks for some 2; but shear sets the step, and this costs a seventh of it. So loops of less than 5° or so are narrow."""

LOCKED, LOCKS_OVER = 8.0, 0.07
"""What locking adds to the shear stiffness, over G, and half of the angle in which it comes [rad]: 4°."""


@dataclass(frozen=True, kw_only=True)
class Springs:
    """Constants of the interior of a sheet. x is along the weft (j), y along the warp (i).

    structural_x, structural_y, diagonal: [N/m]. shear: k_c of cells, in place of diagonals [N/m].
    second_x, second_y: the paper's bending springs [N/m], 0 with hinges.
    hinge_x, hinge_y: β [N/m], 0 with springs. spacing_x, spacing_y: rest lengths [m]. law: which of them bends.
    twist: τ [N/m]. rub_x, rub_y: r of hinges [N/m], couple_x, couple_y: their s [N]. rub_shear: r of cells [N/m],
    slip_shear: their s [N]. lock: what locking adds in the end [N/m], on the difference of diagonals' lengths from
    lock_from [m] on, fully after lock_over more.
    Raises InputError on constants below 0 and rest lengths that are not above.
    """

    structural_x: float
    structural_y: float
    diagonal: float
    second_x: float
    second_y: float
    hinge_x: float
    hinge_y: float
    spacing_x: float
    spacing_y: float
    law: BendingLaw
    shear: float = 0.0
    twist: float = 0.0
    rub_x: float = 0.0
    rub_y: float = 0.0
    couple_x: float = 0.0
    couple_y: float = 0.0
    rub_shear: float = 0.0
    slip_shear: float = 0.0
    lock: float = 0.0
    lock_from: float = 0.0
    lock_over: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name == "law":
                continue
            value, length = getattr(self, field.name), field.name.startswith("spacing")
            if not (isfinite(value) and (value > 0 if length else value >= 0)):
                allowed = "above 0" if length else "0 or more"
                raise InputError(f"springs.{field.name}: {value!r}; allowed: a finite number, {allowed}")

    @property
    def diagonal_length(self) -> float:
        return hypot(self.spacing_x, self.spacing_y)

    @property
    def without_threads(self) -> "Springs":
        """What is soft in cloth: shear and bending."""
        return replace(self, structural_x=0.0, structural_y=0.0)

    def alone(self, diagonal: float) -> "Springs":
        """Diagonals [N/m] and nothing else."""
        names = ("structural_x", "structural_y", "second_x", "second_y", "hinge_x", "hinge_y", "twist", "shear")
        return replace(self, diagonal=diagonal, **dict.fromkeys(names, 0.0))

    @property
    def slips(self) -> bool:
        """Whether anything rubs within the sheet, or locks: what is not a spring."""
        return max(self.rub_x, self.rub_y, self.rub_shear, self.lock, self.shear) > 0

    @property
    def relaxed(self) -> "Springs":
        """Without the friction within, whose sliders go along and pull nothing: what has been moved about for long
        comes to rest so (its anhysteretic state)."""
        names = ("rub_x", "rub_y", "couple_x", "couple_y", "rub_shear", "slip_shear")
        return replace(self, **dict.fromkeys(names, 0.0))

    @property
    def held(self) -> "Springs":
        """As stiff as before anything slips: what steps have to follow. What pulls by the difference of two diagonals
        is at most twice as stiff on each."""
        return replace(
            self,
            hinge_x=self.hinge_x + self.rub_x,
            hinge_y=self.hinge_y + self.rub_y,
            diagonal=self.diagonal + 2 * (self.shear + self.rub_shear),
            shear=0.0,
        )

    def drawn(self, material: Material) -> "Springs":
        """Once the crimp of threads is drawn out, of a material whose threads get stiffer then; what diagonals add
        stays what it is."""
        a, b = self.spacing_x, self.spacing_y
        more_x, more_y = (
            max(drawn - soft, 0.0)
            for drawn, soft in (
                (material.drawn_weft, material.tensile_weft),
                (material.drawn_warp, material.tensile_warp),
            )
        )
        return replace(
            self, structural_x=self.structural_x + more_x * b / a, structural_y=self.structural_y + more_y * a / b
        )


def calibrate(
    material: Material,
    *,
    spacing_x: float,
    spacing_y: float,
    bending: BendingLaw = "hinge",
    reference_curvature: float = 100.0,
) -> Springs:
    """Spring constants that give a sheet of key points the material's moduli.

    spacing_x, spacing_y: between neighbours along the weft and along the warp [m]. reference_curvature: κ₀ [1/m], for
    bending = "spring" only. Raises InputError where no positive springs make such a sheet.
    """
    if bending not in get_args(BendingLaw):
        known = get_args(BendingLaw)
        raise InputError(f"bending: unknown law {bending!r}; known: {', '.join(known)}{did_you_mean(bending, known)}")
    for name, value in (
        ("spacing_x", spacing_x),
        ("spacing_y", spacing_y),
        ("reference_curvature", reference_curvature),
    ):
        if not (isfinite(value) and value > 0):
            raise InputError(f"springs.{name}: {value!r}; allowed: a finite number above 0")
    a, b = spacing_x, spacing_y
    friction = _friction(material, a, b) | _locking(material, a, b)
    cells = max(friction.values()) > 0
    g = 0.0 if cells else material.shear  # of diagonals
    e_x, e_y = material.tensile_weft, material.tensile_warp
    c_y = (e_y + sqrt(e_y**2 + 4 * g**2 * e_y / e_x)) / 2
    c_x = c_y * e_x / e_y
    q_x = q_y = h_x = h_y = 0.0
    if bending == "spring":
        q_x = 16 * material.bending_weft * b / (a**5 * reference_curvature**2)
        q_y = 16 * material.bending_warp * a / (b**5 * reference_curvature**2)
    else:
        h_x = material.bending_weft * b / a**3
        h_y = material.bending_warp * a / b**3
    k_x = (c_x - g * a**2 / b**2) * b / a - 4 * q_x
    k_y = (c_y - g * b**2 / a**2) * a / b - 4 * q_y
    for family, k, e, second in (("weft", k_x, e_x, q_x), ("warp", k_y, e_y, q_y)):
        if k <= 0 and second > 0:
            raise InputError(
                f"bending: second-neighbour springs of {second:.3g} N/m along the {family} leave nothing of {e:g} N/m "
                'for the structural springs; use bending "hinge", wider spacing or a larger reference_curvature'
            )
        if k <= 0:
            raise InputError(
                f"material.shear: {g:g} N/m; diagonals of key points {a:g} m by {b:g} m apart would alone be stiffer "
                f"along the {family} than {e:g} N/m; use a smaller shear stiffness or squarer spacing"
            )
    return Springs(
        structural_x=k_x,
        structural_y=k_y,
        diagonal=g * (a**2 + b**2) / (2 * a * b),
        shear=material.shear * (a**2 + b**2) / (4 * a * b) if cells else 0.0,
        second_x=q_x,
        second_y=q_y,
        hinge_x=h_x,
        hinge_y=h_y,
        spacing_x=a,
        spacing_y=b,
        law=bending,
        twist=material.torsion / (a * b),
        **friction,
    )


def _friction(material: Material, a: float, b: float) -> dict[str, float]:
    """Sliders of hinges and cells. a, b: spacing_x, spacing_y [m]."""

    def held(couple: float, bending: float) -> float:
        """Rigidity before fibres slip [N·m]; where nothing else bends what the couple reaches at SLIPS."""
        return min(couple / SLIPS, HELD_BENDING * bending if bending > 0 else couple / SLIPS)

    shear = HELD_SHEAR * material.shear if material.shear_friction > 0 else 0.0
    return {
        "rub_x": held(material.couple_weft, material.bending_weft) * b / a**3,
        "rub_y": held(material.couple_warp, material.bending_warp) * a / b**3,
        "couple_x": material.couple_weft * b / a,
        "couple_y": material.couple_warp * a / b,
        "rub_shear": shear * (a * a + b * b) / (4 * a * b),
        "slip_shear": material.shear_friction * hypot(a, b) / 2,
    }


def _locking(material: Material, a: float, b: float) -> dict[str, float]:
    """By the difference of a sheared cell's diagonals, sqrt(l² + 2 a b sin γ) − sqrt(l² − 2 a b sin γ)."""
    if material.locking <= 0:
        return {}

    def apart(angle: float) -> float:
        turned = 2 * a * b * sin(min(max(angle, 0.0), pi / 2))
        return sqrt(a * a + b * b + turned) - sqrt(a * a + b * b - turned)

    begin, end = (apart(material.locking + way * LOCKS_OVER) for way in (-1, 1))
    stiffness = LOCKED * material.shear * (a * a + b * b) / (4 * a * b)
    return {"lock": stiffness, "lock_from": begin, "lock_over": end - begin}
