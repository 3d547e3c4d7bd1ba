"""Which solver a sheet gets that names none: the one that takes less time at equal error.

A simulated second takes key points × substeps × what a solver takes for one of these. Verlet's substeps follow from the
stiffest springs, those of whole yarns from those that they do not solve whole; but one of theirs takes three times as
long. So they win where threads are more than some ten times as stiff as shear (docs/solvers.md).

Equal error: both take the steps that they take by themselves, with which cloth that is let go is within half a
millimetre of the reference after 0.3 s. What Verlet does worse at any step is no question of cost: its springs are of
one stiffness, and its strain limit leaves threads longer than it says.

The choice follows from the sheet and not from the machine it is on: the same scene makes the same bytes.
"""

from dataclasses import dataclass, replace

from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.kernel_solver import WORTH_THREADS
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.stability import highest_frequency, longest_in
from taichi_cloth.solvers.step_choice import ROUGH, substeps_of
from taichi_cloth.solvers.yarns import left_explicit

__all__ = ["Choice", "Cost", "choose"]

NANOSECONDS = {"verlet": (12.0, 18.5), "yarns": (47.0, 60.0)}
"""What a key point takes in a substep on one core, without seams and with them. Medians of CPU time, both solvers on
the same sheet in turn, frame by frame: `flag`, `drape`, `hanging`, `stretch`, `sheet-walk` and `drape-body` (9 to 15
and 37 to 59, ratio 3.6 to 4.1), `tshirt` at rest (ratio 3.3). Times are of one machine; only their ratio decides.
`docs/solver_costs.py` measures them again."""

WITHIN = {"verlet": 1.7, "yarns": 1.15}
"""How many times as long that takes of cloth with friction within, whose cells shear by arcs: the middle of `drape` and
`drape-body` (Verlet 1.65 and 1.70, whole yarns 1.18 and 1.13). `docs/solver_costs.py --within` measures it again."""

SECOND_CORE = 1.7
"""By how much a second core makes Verlet faster; whole yarns, and cloth with seams, keep to one."""


@dataclass(frozen=True)
class Cost:
    """Of one solver for one sheet. step: the longest [s]. share: time it takes over time that passes in the scene."""

    step: float
    share: float

    def substeps(self, frame_rate: float) -> int:
        """Of a frame of 1/frame_rate [s]."""
        return substeps_of(frame_rate, self.step)

    def milliseconds(self, frame_rate: float) -> float:
        """Of a frame, with whole substeps."""
        return 1e3 * self.share * self.step * self.substeps(frame_rate)


@dataclass(frozen=True)
class Choice:
    """name: of the solver. why: in a few words. costs: of each, by name; of Verlet with threads as stiff as they get.
    ratio: how many times as stiff as shear that is; infinite without shear."""

    name: str
    why: str
    costs: dict[str, Cost]
    ratio: float


def choose(
    sheet: Sheet, forces: Forces, *, seams: bool = False, safety: float = 0.9, step: float | None = None
) -> Choice:
    """safety, step: of both, see `Verlet`. Needs no Taichi."""
    points = int(sheet.present.sum())
    slips = any(cloth.springs.slips for cloth in sheet.cloths)

    def longest(explicit: Sheet) -> float:
        held = explicit.with_springs(lambda springs: springs.held)
        return safety * longest_in(held, highest_frequency(held, tolerance=ROUGH))

    def cost(name: str, allowed: float, factor: float) -> Cost:
        """allowed: step [s]."""
        taken = min(allowed, step or allowed)
        each = NANOSECONDS[name][seams] * (WITHIN[name] if slips else 1.0)
        return Cost(taken, 1e-9 * factor * points * each / taken)

    second = points >= WORTH_THREADS and not seams
    _, allowed, factor = left_explicit(sheet, longest)
    drawn = sheet.with_cloths(lambda cloth: replace(cloth, springs=cloth.springs.drawn(cloth.material)))
    costs = {
        "verlet": cost("verlet", min(longest(drawn), 1.0), 1 / SECOND_CORE if second else 1.0),
        "yarns": cost("yarns", allowed, factor),
    }
    ratio = sheet.most(lambda cloth: _ratio(cloth.material))
    if any(cloth.material.curved for cloth in sheet.cloths):
        return Choice("yarns", "threads get stiffer as their crimp is drawn out", costs, ratio)
    if forces.strain_limit is not None:
        return Choice("yarns", "they hold a strain limit in the same solve", costs, ratio)
    name = min(costs, key=lambda one: costs[one].share)
    return Choice(name, "it takes less time at equal error", costs, ratio)


def _ratio(material: Material) -> float:
    most = max(material.tensile_warp, material.tensile_weft, material.drawn_warp, material.drawn_weft)
    return most / material.shear if material.shear else float("inf")
