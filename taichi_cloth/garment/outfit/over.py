"""Where a garment's panels start that is worn over others: round all that is worn already, clear of it.

A pattern has its panels start round the bare body. What is worn under it may stand farther off, as a skirt's folds or
the seat of trousers do: planes go outwards along their right side, rings grow, until all of it lies behind them.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.outfit.outfit import Outfit
from taichi_cloth.garment.pattern.pattern import Bent, Flat, Panel, Wrap

__all__ = ["cleared", "start_over"]

F64 = NDArray[np.float64]

ROOM = 0.012
"""Between what is worn and a panel that starts over it [m]."""
ROUND = 1.8
"""Of a ring's radius, up to which what is beside its axis is taken to be within it: what lies farther off is of another
limb."""


def start_over(outfit: Outfit, inner: NDArray) -> F64:
    """(rows, cols, 3) where key points start [m]: all garments but the last where they lie, the last with its panels
    round them. inner: key points of the outfit without the last garment (rows, cols, 3) [m]."""
    last = outfit.parts[-1].atlas
    out = np.zeros((*outfit.atlas.shape, 3))
    out[: inner.shape[0], : inner.shape[1]] = inner
    worn = outfit.atlas.present()
    worn[outfit.first_rows[-1] :] = False
    points, own = out[worn], outfit.of(len(outfit.parts) - 1, out)
    for piece in sorted(last.panels, key=lambda piece: isinstance(piece.panel.place, Flat | Bent)):  # rings come first
        (rows, cols), panel = piece.shape, cleared(piece.panel, points)
        placed = panel.place.points(piece.lattice().reshape(-1, 2)).reshape(rows, cols, 3)
        own[piece.row : piece.row + rows, piece.col : piece.col + cols] = placed
        if not isinstance(panel.place, Flat | Bent):
            points = np.concatenate([points, panel.place.points(panel.outline)])
    return out


def cleared(panel: Panel, points: F64) -> Panel:
    """The panel where it starts clear of points (n, 3) [m]."""
    place, outline = panel.place, panel.outline
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    if isinstance(place, Flat | Bent):
        plane = place if isinstance(place, Flat) else place.plane
        x, y, before = ((points - plane.translation) @ plane.rotation).T
        behind = (x > left - ROOM) & (x < right + ROOM) & (y > low - ROOM) & (y < high + ROOM)
        reach = float(before[behind].max(initial=-np.inf))
        out = max(reach + ROOM, 0.0)
        plane = replace(plane, translation=plane.translation + out * plane.rotation[:, 2])
        return replace(panel, place=plane if isinstance(place, Flat) else replace(place, plane=plane))
    axis = place.axis if isinstance(place, Wrap) else np.array([0.0, 1.0, 0.0])
    off = points - place.origin
    along = off @ axis
    if isinstance(place, Wrap):
        along = along + place.top
    a, b = place.radius
    share = np.hypot(off @ place.outward / a, off @ np.cross(axis, place.outward) / b)
    if isinstance(place, Wrap):
        share = share / np.maximum(1.0 + place.taper * (along - place.top), 0.05)
    within = (along > low - ROOM) & (along < high + ROOM) & (share < ROUND)
    grow = max(float(share[within].max(initial=0.0)) + ROOM / min(a, b), 1.0)
    return replace(panel, place=replace(place, radius=(a * grow, b * grow)))
