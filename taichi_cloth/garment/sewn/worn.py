"""A garment as it is worn on the body that it was sewn on; whether it fits, and what of it does not."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.pattern import Seam
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.lies import lying_faults

__all__ = ["DEEPEST", "OPEN", "TAUT", "Worn", "beyond", "misfit"]

F32 = NDArray[np.float32]

OPEN = 2e-3
"""A seam is closed when its gap is no wider than this [m]."""
DEEPEST = 3e-3
"""In the body, of the cloth of a garment that fits [m]."""
TAUT = 0.08
"""Largest strain at rest of a garment that fits, away from its seams."""
MOVING = 0.05
"""Speed of a garment that has not come to rest [m/s]: frills may tremble at less for as long as one waits."""


@dataclass(frozen=True, eq=False)
class Worn:
    """A garment at rest on a body.

    positions: key points (rows, cols, 3) [m]. gap: of the widest seam [m]. depth: of the deepest cloth in the body [m];
    of cloth, not of key points, which stand outside it at an outline. stretch, taut: largest strain of a thread, and of
    one that ends in no seam and at no hold. speed: at the end, see `STILL` in `sew.py` [m/s].
    frames: that sewing took. pull: of a thread of a garment that closes as stretchy cloth, and not as its own [N/m].

    What a simulation that goes on from there needs, or it begins with a jerk: pushes, what keeps its seams closed, see
    `Ties.pushes`; slid, how far places that hold it have, see `Ties.slid`; sweeps, over whole yarns, 0 of another
    solver; anchors, see `KernelSolver.anchors`; spared, of the body as it was, see `Colliders`, empty where nothing is;
    speeds, last steps (rows, cols, 3) [m/s], 20 to 30 mm/s (rms) of cloth that does not move: what ties and skin mend
    in each substep in positions alone is in steps.
    """

    positions: F32
    gap: float
    depth: float
    stretch: float
    taut: float
    speed: float
    frames: int
    pull: float = 0.0
    pushes: F32 = field(default_factory=lambda: np.zeros((3, 0), np.float32))
    slid: F32 = field(default_factory=lambda: np.zeros((3, 0), np.float32))
    sweeps: int = 0
    anchors: F32 = field(default_factory=lambda: np.zeros((0, 0, 0), np.float32))
    spared: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    speeds: F32 = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))


def misfit(garment: Garment, worn: Worn, primitives: Sequence[Primitive] = ()) -> str | None:
    """Why a garment does not fit the body it was sewn on, in one line with numbers and where; None: it fits.
    primitives: what stands for the body; without them it is not asked how the garment lies on it (`lies.py`)."""
    faults = _faults(garment, worn, primitives)
    if faults and (darts := [width for seam in garment.pattern.seams if (width := _narrow(garment, seam))]):
        faults.append(
            f"its darts, from {1e3 * min(darts):.0f} mm wide, want key points {1e3 * min(darts) / 2:.0f} mm apart: "
            f"garment.key_points={10 * round(garment.pattern.points_for_darts / 10)}"
        )
    return "; ".join(faults) or None


def beyond(
    garment: Garment, worn: Worn, through: float, allowed: float, primitives: Sequence[Primitive]
) -> tuple[int, float]:
    """How far a garment is from fitting, to choose between two of them: how many limits it breaks, then by how much,
    the shares of what is allowed together. through: what passes through itself of it; allowed: how much may, 0 where
    that is a count. primitives: see `misfit`."""
    counted = allowed > 0 and len(primitives) > 0  # among the faults of how it lies
    broken = len(_faults(garment, worn, primitives)) + (through > allowed and not counted) + (worn.speed > MOVING)
    shares = worn.gap / OPEN, worn.depth / DEEPEST, worn.taut / TAUT, worn.speed / MOVING
    over = sum(max(0.0, share - 1) for share in shares)
    return broken, over + max(0.0, through / allowed - 1 if allowed else through)


def _faults(garment: Garment, worn: Worn, primitives: Sequence[Primitive]) -> list[str]:
    """What is beyond a limit, a line each."""
    faults = lying_faults(garment, worn.positions, primitives) if len(primitives) else []
    if worn.gap > OPEN:
        nodes, weights = garment.seams()
        ends = np.einsum("nkc,nk->nc", worn.positions[nodes[..., 0], nodes[..., 1]], weights)
        worst = int(np.argmax(garment.asked * np.linalg.norm(ends, axis=1)))
        row, col = nodes[worst, 0]
        name = garment.pattern.panels[garment.atlas.owner()[row, col]].name
        why = _reason(garment, garment.pattern.seams[int(np.searchsorted(garment.last_ties(), worst))])
        faults.append(f"a seam of {name} stays {1e3 * worn.gap:.1f} mm open (allowed {1e3 * OPEN:g}){why}")
    if worn.depth > DEEPEST:
        whose, part = _deepest(garment, worn, primitives) if len(primitives) else ("cloth", "body")
        faults.append(f"{whose} lies {1e3 * worn.depth:.1f} mm in the {part} (allowed {1e3 * DEEPEST:g})")
    if worn.pull > 0:
        faults.append(f"sewn of stretchy cloth, threads of its own would be pulled by {worn.pull:.2g} N/m")
    if worn.taut > TAUT:
        strain = max(garment.strains(worn.positions), key=lambda s: s.max())
        row, col = np.unravel_index(int(np.argmax(strain)), strain.shape)
        name = garment.pattern.panels[garment.atlas.owner()[row, col]].name
        x, y, z = worn.positions[row, col]
        where = f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        faults.append(f"threads of {name} are {100 * worn.taut:.1f} % longer {where} (allowed {100 * TAUT:g})")
    return faults


def _deepest(garment: Garment, worn: Worn, primitives: Sequence[Primitive]) -> tuple[str, str]:
    """The panel whose cloth lies deepest in a body, and the part that it lies in."""
    present = garment.atlas.present()
    distance, _, whose = nearest_distance(primitives, worn.positions[present])
    k = int(np.argmin(distance))
    return garment.pattern.panels[garment.atlas.owner()[present][k]].name, primitives[whose[k]].part.replace("_", " ")


def _narrow(garment: Garment, seam: Seam) -> float:
    """Width of a dart that is narrower than two cells [m]; 0 for any other seam."""
    wide = garment.pattern.dart_width(seam)
    return wide if wide < 2 * max(garment.atlas.spacing) else 0.0


def _reason(garment: Garment, seam: Seam) -> str:
    """What of a seam itself keeps it open: a dart narrower than two cells, or edges of unequal length."""
    if wide := _narrow(garment, seam):
        return f": a dart {1e3 * wide:.0f} mm wide"
    edges = [garment.pattern.edge(side) for side in (seam.first, seam.second)]
    longer, shorter = sorted((length(edge) for edge in edges), reverse=True)
    if longer > 1.05 * shorter:
        return f": {100 * longer:.1f} cm of cloth gathered onto {100 * shorter:.1f} cm"
    return ""
