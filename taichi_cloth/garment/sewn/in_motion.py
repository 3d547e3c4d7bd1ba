"""How deep a garment lies in its moving body, and how long its threads are, at one moment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Solid, solid_distance
from taichi_cloth.garment.sewn.garment import Garment

__all__ = ["Moment", "Watch"]

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Moment:
    """depth: of the deepest cloth in the body [m], 0 outside. part: of the body that it lies in, or "".
    stretch: largest strain of a thread. taut: of those that end in no seam and at no hold, and panel: whose that is.
    let_off: pairs that contact could not keep apart, since the frame before."""

    depth: float
    part: str
    stretch: float
    taut: float
    panel: str
    let_off: int = 0


class Watch:
    """Looks at one garment on one body. solids: primitives or grids at rest, each moving with its bone."""

    def __init__(self, garment: Garment, solids: Sequence[Solid]) -> None:
        self._garment = garment
        self._sheet = garment.sheet()
        self._free = garment.free_threads()
        self._solids: dict[tuple[int, str], list[Solid]] = {}
        for solid in solids:
            self._solids.setdefault((solid.bone, solid.part), []).append(solid)

    def at(self, positions: NDArray, bones: F64 | None = None) -> Moment:
        """positions: key points (rows, cols, 3) [m]. bones: (bones, 4, 4) from rest to now; None: at rest."""
        points = self._garment.surface.places(positions)
        deepest, where = 0.0, ""
        for (bone, part), of in self._solids.items():
            own = points
            if bones is not None:  # a rigid move: looked at from the bone, the solid rests
                own = (points - bones[bone, :3, 3]) @ bones[bone, :3, :3]
            depth = -float(solid_distance(of, own).min())
            if depth > deepest:
                deepest, where = depth, part
        both = self._sheet.stretch(positions)
        free = [strain * free for strain, free in zip(both, self._free, strict=True)]
        worst = max(free, key=lambda s: float(s.max()))
        row, col = np.unravel_index(int(np.argmax(worst)), worst.shape)
        panel = self._garment.pattern.panels[self._garment.atlas.owner()[row, col]].name
        return Moment(deepest, where, max(float(s.max()) for s in both), float(worst.max()), panel)
