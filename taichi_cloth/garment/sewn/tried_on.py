"""What a sewn garment shows to be tight: rows of threads that its body has drawn longer, panel by panel."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from taichi_cloth.garment.fit.let_out import LetOut, axes
from taichi_cloth.garment.pattern.pattern import Flat
from taichi_cloth.garment.sewn.garment import Garment

__all__ = ["tight"]

F64 = NDArray[np.float64]

TAUT = 0.03
"""Mean strain of what is not slack of a row, from which on it is tight: a thread that hangs or lies has less."""
EASE = 0.015
"""Over what would take that strain away."""
LEAST = 3
"""Pieces of thread of a row that tells something."""
SPREAD = 0.02
"""Along a panel to either side of a tight row, over which it is let out as much [m]."""
ALIKE = 0.005
"""Between corners of two panels where they are placed, one of them mirrored, that are a left and a right one [m]."""
LYING = 0.9
"""Cosine between rows of threads and the width of a panel, at least: threads aslant tell little of widths."""


def tight(garment: Garment, positions: NDArray) -> LetOut:
    """What is tight and how much wider it wants to be, but for hoods and collars, which lie or stand where they meet
    nothing; a left and a right panel that are drawn alike as much as the tighter of them: a strain that trembles near
    TAUT would make a garment lopsided. positions: key points (rows, cols, 3) as sewn [m]."""
    found = dict[str, tuple[F64, F64]]()
    weft, warp = garment.sheet().stretch(positions.astype(np.float32))
    for piece in garment.atlas.panels:
        place, part = piece.panel.place, piece.panel.label
        if not isinstance(place, Flat) or piece.panel.grain or part == "head":
            continue
        up, across = axes(place.rotation, part)
        along = int(abs(across[0]) < LYING)  # 0: across are threads of the weft
        if abs(across[along]) < LYING:
            continue
        rows, cols = piece.shape
        own = (slice(piece.row, piece.row + rows - along), slice(piece.col, piece.col + cols - 1 + along))
        strain = (warp.T if along else weft)[own[::-1] if along else own]
        found[piece.panel.name] = _rows(strain, piece.origin, np.asarray(piece.spacing), up, 1 - along)
    corners = {
        panel.name: panel.place.points(np.array([edge[0] for edge in panel.edges]))
        for panel in garment.pattern.panels
        if panel.name in found and isinstance(panel.place, Flat)
    }
    out = dict[str, tuple[F64, F64]]()
    for name, (at, by) in found.items():
        for other in found:
            if other != name and _mirrored(corners[name], corners[other]):
                theirs = found[other][0] - found[other][0][0]
                by = np.maximum(by, np.interp(at - at[0], theirs, found[other][1]))
        if by.max(initial=1.0) > 1.0:
            out[name] = at, by
    return out


def _mirrored(corners: F64, others: F64) -> bool:
    """Whether corners (n, 3) of one panel lie where those of another (m, 3) are, mirrored in the body's middle."""
    apart = np.linalg.norm((corners * [-1, 1, 1])[:, None] - others, axis=2)
    return len(corners) == len(others) and max(apart.min(axis=0).max(), apart.min(axis=1).max()) < ALIKE


def _rows(strain: F64, origin: F64, spacing: F64, up: F64, axis: int) -> tuple[F64, F64]:
    """Of each row of threads (n, m) where it lies along `up`, rising [m], and how much wider it wants to be. axis: of
    flat coordinates along which rows follow each other."""
    asked = strain != 0
    count = asked.sum(axis=1)
    mean = np.where(asked, np.maximum(strain, 0.0), 0.0).sum(axis=1) / np.maximum(count, 1)
    by = np.where((count >= LEAST) & (mean > TAUT), 1 + mean + EASE, 1.0)
    wide = max(1, round(SPREAD / float(spacing[axis])))
    by = gaussian_filter1d(maximum_filter1d(by, 2 * wide + 1, mode="nearest"), 0.5 * wide, mode="nearest")
    at = (origin[axis] + spacing[axis] * np.arange(len(by))) * float(np.sign(up[axis]))
    order = np.argsort(at)
    return at[order], by[order]
