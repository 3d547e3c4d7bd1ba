"""Little loops in an outline, where two edges that should end in a corner pass each other by a hair: cut off.

Generators of patterns leave them, at a deep neckline's end on the shoulder for one, and pass them on.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.pattern import Panel, area

__all__ = ["SMALL", "without_loops"]

F64 = NDArray[np.float64]

SMALL = 2e-4
"""Area of a loop that is cut off [m²]."""


def without_loops(panel: Panel) -> tuple[Panel, list[str]]:
    """The panel with loops under SMALL between an edge and the next one cut off, and a line for each. Larger ones, and
    those of edges that are no neighbours, stay: `Pattern` refuses them."""
    edges = [np.array(edge) for edge in panel.edges]
    notes = []
    for k in range(len(edges)):
        after = (k + 1) % len(edges)
        if after == k or len(edges[k]) < 2 or len(edges[after]) < 2:
            continue
        found = _last_crossing(edges[k], edges[after])
        if found is None:
            continue
        i, j, point = found
        loop = np.concatenate([[point], edges[k][i + 1 :], edges[after][1 : j + 1]])
        size = abs(area(loop))
        if size < SMALL:
            edges[k] = np.concatenate([edges[k][: i + 1], [point]])
            edges[after] = np.concatenate([[point], edges[after][j + 1 :]])
            notes.append(
                f"panel {panel.name}: a loop of {1e4 * size:.2f} cm² where edges {k} and {after} cross, cut off"
            )
    return (replace(panel, edges=tuple(edges)) if notes else panel), notes


def _last_crossing(one: F64, two: F64) -> tuple[int, int, F64] | None:
    """Segments (i, j) of two polylines, the second of which begins where the first ends, that cross nearest to the
    start of the first, and where; that they meet in the corner is no crossing."""
    a, d = one[:-1, None], np.diff(one, axis=0)[:, None]
    b, e = two[None, :-1], np.diff(two, axis=0)[None]
    det = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    off = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (off[..., 0] * e[..., 1] - off[..., 1] * e[..., 0]) / det
        t = (off[..., 0] * d[..., 1] - off[..., 1] * d[..., 0]) / det
    crossed = (det != 0) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    crossed[-1, 0] = False
    if not crossed.any():
        return None
    i, j = (int(v) for v in np.argwhere(crossed)[0])
    return i, j, one[i] + s[i, j] * (one[i + 1] - one[i])
