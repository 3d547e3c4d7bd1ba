"""Patterns of others: scaled to a body by their own girths, stood round it with their right sides out, and held."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.cut import intervals, turned
from taichi_cloth.garment.pattern.measures import Figure
from taichi_cloth.garment.pattern.pattern import Flat, Hold, Panel, Pattern, Seam, Side, Wrap
from taichi_cloth.ground.errors import InputError

__all__ = ["fitted"]

F64 = NDArray[np.float64]

OWN_STATURE = 1.70
OWN_CHEST = 0.92
"""The body that GarmentCode's and the Garment-Pattern-Generator's sample patterns were drafted for, about [m]."""
EASE = 0.04
"""Least share of the figure's girths at chest, waist and hip that cloth over them has more."""
MOST = 1.6
"""A pattern that has to be widened by more than this is none for the figure."""
BELOW = 0.04
"""Of an armhole's lowest point under the arm where a top starts [m]; pulls at the armpit otherwise."""
DEEPER = 1.5  # armholes are deepened by this at most
SHORTER = 0.5  # least share of its length below the arms that a bodice is shortened to, for its skirt's sake
CLEAR = 0.020  # between the body and a waistband [m]
DROP = 0.02  # from the neck's side, where it starts, to the neck where a top rests [m]
UP = np.array([0.0, 1.0, 0.0])


def fitted(pattern: Pattern, figure: Figure) -> Pattern:
    """A pattern scaled by stature (heights) and by girth (widths), and stood round the body it is to be worn by.

    Widths follow the chest, or the waist for what hangs from it, and more where the panels' own girth at chest, waist
    or hip would leave less than EASE. A top starts at the neck's side, its panels before and behind the body, its
    sleeves along the arms, its shoulders carried by the shoulder blades once it rests; what does not reach the
    shoulders starts round the waist, where its uppermost free edges are held as a waistband. Panels whose right side
    would face the body are turned over.

    Raises InputError on a pattern that would have to be widened beyond reason.
    """
    tall = figure.stature / OWN_STATURE
    out = _outwards(pattern.scaled(figure.chest / OWN_CHEST, tall), figure)
    low, high = _reach(out)
    is_top = high - low > 0.55 * figure.stature or any(_is_sleeve(p, figure) for p in out.panels) or _has_neck(out)
    if not is_top:
        band = _band(out)
        top = sum(length(out.edge(side)) for side in band)
        if top < 1e-3:
            raise InputError(f"pattern {pattern.name}: no free edge at its top; allowed: a waist to hold it by")
        need = max(figure.waist * (1 + EASE), _waistband(figure)[1]) / top
        _check(pattern, need * figure.chest / OWN_CHEST)
        out = out.scaled(need, 1.0)
        high = _reach(out)[1]
        tight = (
            (1 + EASE) * figure.hip / max(_girth(out, high - (figure.waist_height - figure.hip_height), figure), 0.1)
        )
        return _round_waist(out.scaled(max(1.0, tight), 1.0) if tight > 1.02 else out, figure)
    out = _graded(_hung(out, figure), figure)
    out = _hung(out, figure)
    out = _stacked(out, figure)
    heights = np.arange(figure.crotch_height + 0.02, figure.underarm_height - 0.02, 0.01)
    known = [figure.hip_height, figure.waist_height, figure.underarm_height - 0.02]
    girths = np.interp(heights, known, [figure.hip, figure.waist, figure.chest])
    need = 1.0
    for height, girth in zip(heights, girths, strict=True):
        own = _girth(out, float(height), figure)
        if own > 0.4 * girth:  # less: the garment ends above, or is sewn of parts that do not meet yet
            need = max(need, (1 + EASE) * float(girth) / own)
    _check(pattern, need * figure.chest / OWN_CHEST)
    return _along_arms(_clear(out.scaled(need, 1.0), figure), figure)


def _graded(pattern: Pattern, figure: Figure) -> Pattern:
    """A top's heights by the figure's: its armholes end under the arms, and a bodice ends no lower than half-way from
    the waist to the hip. Sleeves are widened as the armholes are deepened, so that they still meet."""
    high, underarm = _reach(pattern)[1], _underarm(pattern, figure)
    under = figure.underarm_height - BELOW
    deeper = min(max((figure.neck_height + DROP - under) / max(high - underarm, 0.05), 1.0), DEEPER)
    bodice = {one.panel for one, _ in _joints(pattern, figure)}
    level = [_at(pattern, one)[:, 1].mean() for one, _ in _joints(pattern, figure)]
    shorter = 1.0
    if level:
        down = under - (figure.waist_height + figure.hip_height) / 2
        shorter = float(np.clip(down / (underarm - np.mean(level)), SHORTER, 1.0))
    panels = []
    for panel in pattern.panels:
        place = panel.place
        if not isinstance(place, Flat):
            continue
        up = place.rotation[1, :2]
        steep = float(up @ up)
        if _is_sleeve(panel, figure):
            panel = replace(panel, edges=tuple(edge * np.array([1.0, deeper]) for edge in panel.edges))
        elif steep > 0.1:
            below = shorter if panel.name in bodice else 1.0

            def raised(edge: F64, up: F64 = up, place: Flat = place, below: float = below, steep: float = steep) -> F64:
                above = edge @ up + place.translation[1] - underarm
                return edge + np.outer(above * (np.where(above > 0, deeper, below) - 1), up / steep)

            panel = replace(panel, edges=tuple(raised(edge) for edge in panel.edges))
        panels.append(panel)
    return replace(pattern, panels=tuple(panels))


def _check(pattern: Pattern, widened: float) -> None:
    if widened > MOST:
        raise InputError(
            f"pattern {pattern.name}: does not fit: its widths would have to be {widened:.2f} times what they are; "
            f"allowed: up to {MOST:g}; use a pattern of a larger size, or a smaller body"
        )


def _reach(pattern: Pattern) -> tuple[float, float]:
    """Least and greatest height [m]."""
    heights = np.concatenate([panel.world[:, 1] for panel in pattern.panels])
    return float(heights.min()), float(heights.max())


def _placed(pattern: Pattern, change: dict[str, Flat | Wrap]) -> Pattern:
    panels = tuple(replace(p, place=change[p.name]) if p.name in change else p for p in pattern.panels)
    return replace(pattern, panels=panels)


def _hung(pattern: Pattern, figure: Figure) -> Pattern:
    """The pattern so high that its top is where a top starts, DROP over the neck."""
    by = figure.neck_height + DROP - _reach(pattern)[1]
    moved: dict[str, Flat | Wrap] = {
        p.name: Flat(p.place.rotation, p.place.translation + by * UP)
        for p in pattern.panels
        if isinstance(p.place, Flat)
    }
    return _placed(pattern, moved)


def _at(pattern: Pattern, side: Side) -> F64:
    """(k, 3) where an edge starts [m]."""
    return pattern.panel(side.panel).place.points(pattern.edge(side))


def _joints(pattern: Pattern, figure: Figure) -> list[tuple[Side, Side]]:
    """Seams between what reaches the arms and what does not: bodice and skirt."""
    tops = {p.name for p in pattern.panels if p.world[:, 1].max() > figure.underarm_height}
    sides = [s for seam in pattern.seams for s in ((seam.first, seam.second), (seam.second, seam.first))]
    return [(one, other) for one, other in sides if one.panel in tops and other.panel not in tops]


def _stacked(pattern: Pattern, figure: Figure) -> Pattern:
    """Skirts of dresses raised or lowered to the bodices that they are sewn to."""
    offsets: dict[str, list[float]] = {}
    for one, other in _joints(pattern, figure):
        y = [_at(pattern, side)[:, 1].mean() for side in (one, other)]
        offsets.setdefault(other.panel, []).append(float(y[0] - y[1]))
    moved: dict[str, Flat | Wrap] = {
        p.name: Flat(p.place.rotation, p.place.translation + (np.mean(offsets[p.name]) - 0.01) * UP)
        for p in pattern.panels
        if p.name in offsets and isinstance(p.place, Flat)
    }
    return _placed(pattern, moved)


def _outwards(pattern: Pattern, figure: Figure) -> Pattern:
    """Every panel's right side away from the body: those that face it are mirrored and turned half round, so that no
    point of theirs moves. Which ends of a seam meet is settled before."""
    middle = figure.sections["chest"].middle
    seams = tuple(Seam(s.first, s.second, pattern.is_alike(s)) for s in pattern.seams)
    panels = []
    half = np.diag([-1.0, 1.0, -1.0])
    for panel in pattern.panels:
        place = panel.place
        if isinstance(place, Flat):
            outward = (panel.world.mean(axis=0) - np.array([0.0, 0.0, middle])) * np.array([1.0, 0.0, 1.0])
            if float(place.rotation[:, 2] @ outward) < 0:
                edges = tuple(edge * np.array([-1.0, 1.0]) for edge in panel.edges)
                panel = replace(
                    panel, edges=edges, grain=-panel.grain, place=Flat(place.rotation @ half, place.translation)
                )
        panels.append(panel)
    return replace(pattern, panels=tuple(panels), seams=seams)


def _is_sleeve(panel: Panel, figure: Figure) -> bool:
    """Whether a panel starts beside the trunk, before or behind an arm."""
    points = panel.world
    beside = float(np.abs(points[:, 0]).min()) > 0.3 * figure.shoulder and points[:, 0].min() * points[:, 0].max() > 0
    place = panel.place
    return beside and isinstance(place, Flat) and abs(float(place.rotation[2, 2])) > 0.7


def _sleeves(pattern: Pattern, figure: Figure) -> set[str]:
    """Names of the panels that start beside the trunk."""
    return {panel.name for panel in pattern.panels if _is_sleeve(panel, figure)}


def _has_neck(pattern: Pattern) -> bool:
    """Whether seams join panels at the very top: shoulders."""
    low, high = _reach(pattern)
    near = high - 0.15 * (high - low)
    return any(
        float(pattern.panel(s.panel).place.points(pattern.edge(s))[:, 1].min()) > near
        for seam in pattern.seams
        for s in (seam.first,)
    )


def _girth(pattern: Pattern, height: float, figure: Figure) -> float:
    """Width of all panels but sleeves at a height [m]."""
    total = 0.0
    for panel in pattern.panels:
        place = panel.place
        if not isinstance(place, Flat) or _is_sleeve(panel, figure):
            continue
        across, along_ = place.rotation[1, :2]
        steep = float(np.hypot(across, along_))
        if steep < 0.1:
            continue
        ring = turned(panel.outline, float(np.arctan2(across, along_)))
        pieces = intervals(ring, (height - float(place.translation[1])) / steep, 1)
        total += float((pieces[:, 1] - pieces[:, 0]).sum())
    return total


def _underarm(pattern: Pattern, figure: Figure) -> float:
    """Height of the top of the seams between fronts and backs, shoulders aside [m]; the top where there are none."""
    middle = figure.sections["chest"].middle
    high, tops = _reach(pattern)[1], []
    sleeves = _sleeves(pattern, figure)
    depth = {panel.name: float(panel.world[:, 2].mean()) - middle for panel in pattern.panels}
    for seam in pattern.seams:
        sides = (seam.first, seam.second)
        if depth[seam.first.panel] * depth[seam.second.panel] < 0 and not any(s.panel in sleeves for s in sides):
            y = np.concatenate([_at(pattern, side) for side in sides])[:, 1]
            if y.min() < high - 0.15:
                tops.append(float(y.max()))
    return max(tops, default=high)


def _clear(pattern: Pattern, figure: Figure) -> Pattern:
    """Fronts before the body, backs behind it."""
    trunk = list(figure.sections.values())
    front = max(s.middle + s.depth for s in trunk) + 0.02
    back = min(s.middle - s.depth for s in trunk) - 0.02
    change: dict[str, Flat | Wrap] = {}
    for panel in pattern.panels:
        place = panel.place
        if isinstance(place, Flat) and abs(float(place.rotation[2, 2])) > 0.9 and not _is_sleeve(panel, figure):
            z = float(panel.world[:, 2].mean())
            shift = np.array([0.0, 0.0, front - z if place.rotation[2, 2] > 0 else back - z])
            change[panel.name] = Flat(place.rotation, place.translation + shift)
    return _placed(pattern, change)


def _along_arms(pattern: Pattern, figure: Figure) -> Pattern:
    """Sleeves turned about the shoulder so that they lie along the arm, and moved so that it is in their middle."""
    change: dict[str, Flat | Wrap] = {}
    for arm in figure.arms:
        sleeves = [p for p in pattern.panels if _is_sleeve(p, figure) and p.world[:, 0].mean() * arm.top[0] > 0]
        if not sleeves:
            continue
        inner, outer = [], []
        for panel in sleeves:
            sewn = _sewn(pattern, panel.name)
            own = {s.edge for seam in pattern.seams for s in (seam.first, seam.second) if s.panel == panel.name
                   and {seam.first.panel, seam.second.panel} - {p.name for p in sleeves}}  # fmt: skip
            inner += [panel.place.points(panel.edges[k]).mean(axis=0) for k in own]
            outer += [panel.place.points(e).mean(axis=0) for k, e in enumerate(panel.edges) if k not in sewn]
        if not inner or not outer:
            continue
        way, down = np.mean(outer, axis=0) - np.mean(inner, axis=0), -arm.axis
        turn = float(np.arctan2(down[1], down[0]) - np.arctan2(way[1], way[0]))
        c, s = np.cos(turn), np.sin(turn)
        spin = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        pivot = np.mean(inner, axis=0)
        start = arm.top + 0.02 * down
        for panel in sleeves:
            place = panel.place
            assert isinstance(place, Flat)
            z = float(panel.world[:, 2].mean())
            side = 1.0 if place.rotation[2, 2] > 0 else -1.0
            shift = start - pivot
            shift[2] = arm.top[2] + side * (arm.radius + 0.03) - z
            change[panel.name] = Flat(spin @ place.rotation, spin @ (place.translation - pivot) + pivot + shift)
    return _placed(pattern, change)


def _sewn(pattern: Pattern, panel: str) -> set[int]:
    return {s.edge for seam in pattern.seams for s in (seam.first, seam.second) if s.panel == panel}


def _band(pattern: Pattern) -> list[Side]:
    """The free edges near the top of a pattern."""
    sewn = {(s.panel, s.edge) for seam in pattern.seams for s in (seam.first, seam.second)}
    heights = {
        (panel.name, k): float(panel.place.points(edge)[:, 1].mean())
        for panel in pattern.panels
        for k, edge in enumerate(panel.edges)
        if (panel.name, k) not in sewn
    }
    top = max(heights.values(), default=0.0)
    return [Side(*key) for key, height in heights.items() if height > top - 0.06]


def _waistband(figure: Figure) -> tuple[tuple[float, float], float]:
    """Semi-axes (outward, sideways) and length of an ellipse round the waist, CLEAR of it [m] (Ramanujan 1914)."""
    section = figure.sections["waist"]
    a, b = section.depth + CLEAR, section.breadth + CLEAR
    h = ((a - b) / (a + b)) ** 2
    return (a, b), float(np.pi * (a + b) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h))))


def _round_waist(pattern: Pattern, figure: Figure) -> Pattern:
    """Panels side by side round the waist, in the order they stood in, their band at its height and held."""
    band = _band(pattern)
    section = figure.sections["waist"]

    def azimuth(side: Side) -> float:
        x, _, z = pattern.panel(side.panel).world.mean(axis=0)
        return float(np.arctan2(x, z - section.middle))

    widths = {side: length(pattern.edge(side)) for side in band}
    girth = sum(widths.values())
    (a, b), around = _waistband(figure)
    ring = (a * girth / around, b * girth / around)
    order = sorted(band, key=azimuth)
    centres = np.cumsum([widths[s] for s in order]) - np.array([widths[s] / 2 for s in order])
    front = min(range(len(order)), key=lambda k: abs(azimuth(order[k])))
    hip = figure.sections["hip"]
    off = abs(hip.middle - section.middle)
    wider = max((hip.depth + off + CLEAR) / ring[0], (hip.breadth + CLEAR) / ring[1]) - 1
    taper = -max(wider, 0.0) / max(0.6 * (figure.waist_height - figure.hip_height), 0.05)
    change: dict[str, Flat | Wrap] = {}
    for side, centre in zip(order, centres - centres[front], strict=True):
        edge = pattern.edge(side)
        at = (centre + girth / 2) % girth - girth / 2
        origin = np.array([0.0, figure.waist_height, section.middle])
        middle, top = (float(v) for v in edge[[0, -1]].mean(axis=0))
        change[side.panel] = Wrap(
            origin, UP, np.array([0.0, 0.0, 1.0]), ring, middle=middle, taper=taper, at=at, top=top
        )
    return replace(_placed(pattern, change), holds=tuple(Hold(side) for side in band))
