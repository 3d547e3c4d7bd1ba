"""Patterns of others, scaled and stood round a body."""

from dataclasses import replace

import numpy as np

from taichi_cloth.garment.figure import Figure
from taichi_cloth.garment.pattern import Flat, Hold, Pattern, Side

__all__ = ["fitted"]

OWN_STATURE = 1.70
OWN_CHEST = 0.92
"""The body that GarmentCode's and the Garment-Pattern-Generator's sample patterns were drafted for, about [m]."""
OWN_CENTRE = 0.655
"""Height of the Garment-Pattern-Generator's origin in statures: its shoulders lie 0.295 m above it."""


def fitted(pattern: Pattern, figure: Figure) -> Pattern:
    """A pattern scaled by stature (heights) and girth (widths), and lifted to the body it is to be worn by.

    Coordinates that go below the ground are meant from the middle of the body, as the Garment-Pattern-Generator's are.
    What does not reach the shoulders is held at its uppermost free edges, as a waistband.
    """
    out = pattern.scaled(figure.chest / OWN_CHEST, figure.stature / OWN_STATURE)
    points = [panel.place.points(panel.outline) for panel in out.panels]
    if min(float(p[:, 1].min()) for p in points) < -0.05:
        lift = np.array([0.0, OWN_CENTRE * figure.stature, 0.0])
        panels = []
        for panel in out.panels:
            place = panel.place
            if isinstance(place, Flat):
                place = Flat(place.rotation, place.translation + lift)
            panels.append(replace(panel, place=place))
        out = replace(out, panels=tuple(panels))
    top = max(float(panel.place.points(panel.outline)[:, 1].max()) for panel in out.panels)
    if top < figure.underarm_height:
        out = replace(out, holds=_band(out))
    return out


def _band(pattern: Pattern) -> tuple[Hold, ...]:
    """The free edges near the top of a pattern."""
    sewn = {(side.panel, side.edge) for seam in pattern.seams for side in (seam.first, seam.second)}
    heights = {
        (panel.name, k): float(panel.place.points(edge)[:, 1].mean())
        for panel in pattern.panels
        for k, edge in enumerate(panel.edges)
        if (panel.name, k) not in sewn
    }
    if not heights:
        return ()
    top = max(heights.values())
    return tuple(Hold(Side(*key), "pelvis") for key, height in heights.items() if height > top - 0.06)
