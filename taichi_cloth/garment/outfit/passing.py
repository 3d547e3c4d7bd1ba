"""Which garments of an outfit pass through each other, and by how much."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.outfit.outfit import Outfit
from taichi_cloth.layers.outline import crossings_of

__all__ = ["passing"]


def passing(outfit: Outfit, positions: NDArray) -> str | None:
    """In one line, of key points (rows, cols, 3) [m]; None where none passes through another."""
    outline = outfit.outline
    wearer = np.array([outfit.wearer(k) for k in range(len(outfit.atlas.panels))])
    of = wearer[outline.panel[outline.faces[:, 0]]]
    pairs = np.sort(of[crossings_of(outline, positions).pairs], axis=1)
    found = Counter((int(a), int(b)) for a, b in pairs if a != b)
    said = [
        f"{outfit.names[b]} passes through {outfit.names[a]}: {n} pairs of triangles" for (a, b), n in found.items()
    ]
    return "; ".join([*said, "change the order in which they are worn, or their ease"]) if said else None
