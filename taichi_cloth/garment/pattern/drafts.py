"""Built-in patterns, drafted from a body's measures: T-shirt, short skirt, dress, trousers.

Proportions follow the usual block for woven cloth (Aldrich, "Metric Pattern Cutting"): a quarter of each girth and its
ease to a panel's half, the armhole between a fifth and a quarter of the chest deep, the sleeve's cap as long as the
armhole. Coordinates of a panel: x from its middle, y up, 0 at the neck's side (tops) or at the waist.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import bezier, length
from taichi_cloth.garment.pattern.measures import Figure, Section
from taichi_cloth.garment.pattern.pattern import Bent, Cone, Flat, Hold, Panel, Pattern, Seam, Side, Wrap
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["DRAFTS", "Cut", "draft"]

F64 = NDArray[np.float64]

UP = np.array([0.0, 1.0, 0.0])
FRONT = np.array([0.0, 0.0, 1.0])
CLEAR = 0.012  # between the body and a panel where it starts [m]
SNUG = 0.007  # between the body and a waistband [m]
SEAT, LEAN = 0.05, 0.16  # by which the back of trousers is higher at its middle [m]; by which its seam leans, over y
GAPE = 0.012  # by which each half of the front of a dress is narrower above the bust than its back [m]
BEND = 0.02  # radius of the bend by which forks lie between the legs [m]


@dataclass(frozen=True, kw_only=True)
class Cut:
    """What a person may change of a built-in pattern; None: the pattern's own.

    ease: of the chest, or of the hip for what hangs from the waist [share of the girth]. length: from the neck's side
    or from the waist to the hem [m]. sleeve: from the underarm to its hem [m]. flare: girth of the hem over that of
    the hip.
    """

    ease: float | None = None
    length: float | None = None
    sleeve: float | None = None
    flare: float | None = None


def draft(name: str, figure: Figure, cut: Cut | None = None) -> Pattern:
    """A built-in pattern for a figure. Raises InputError on an unknown name or a cut that makes no garment."""
    if name not in DRAFTS:
        raise InputError(f"garment: unknown pattern {name!r}; known: {', '.join(DRAFTS)}{did_you_mean(name, DRAFTS)}")
    limits = {"ease": (-0.1, 1.0), "length": (0.05, 1.6), "sleeve": (0.02, 0.8), "flare": (0.8, 8.0)}
    for key, (low, high) in limits.items():
        value = getattr(cut, key, None)
        if value is not None and not (isfinite(value) and low <= value <= high):
            raise InputError(f"garment.{key}: {value!r}; allowed: {low:g} to {high:g}")
    return DRAFTS[name](figure, cut or Cut())


def _set(value: float | None, own: float) -> float:
    return own if value is None else value


def _line(*points: tuple[float, float]) -> F64:
    return np.asarray(points, np.float64)


def _mirrored(edge: F64) -> F64:
    """The edge on the other side of x = 0, walked so that the loop goes on the same way round."""
    return edge[::-1] * np.array([-1.0, 1.0])


def _perimeter(section: Section, clear: float) -> float:
    """Of an ellipse round the section at a distance (Ramanujan 1914) [m]."""
    a, b = section.depth + clear, section.breadth + clear
    h = ((a - b) / (a + b)) ** 2
    return pi * (a + b) * (1 + 3 * h / (10 + sqrt(4 - 3 * h)))


def _ring(section: Section, girth: float, clear: float) -> tuple[float, float]:
    """(outward, sideways) semi-axes of a ring of that girth in the section's proportions, clear of the body [m]."""
    scale = max(1.0, girth / _perimeter(section, clear))
    return (section.depth + clear) * scale, (section.breadth + clear) * scale


def _round(f: Figure, height: float, *, back: bool) -> Wrap:
    """Round the chest, the panel's middle at the front or at the back, its y = 0 at a height [m]: so far from the body
    that the armholes clear the shoulders, the sides open under the arms."""
    chest = f.sections["chest"]
    origin = np.array([0.0, height, chest.middle])
    return Wrap(origin, UP, -FRONT if back else FRONT, (chest.depth + 0.045, chest.breadth + 0.035))


def _before(f: Figure, height: float, *, back: bool) -> Flat:
    """A plane before or behind the trunk, clear of the arms too, the panel's y = 0 at a height [m]."""
    chest = f.sections["chest"]
    turn = np.diag([-1.0, 1.0, -1.0]) if back else np.eye(3)
    reach = chest.depth + 2 * CLEAR
    return Flat(turn, np.array([0.0, height, chest.middle + (-reach if back else reach)]))


@dataclass(frozen=True)
class _Top:
    """Half a bodice: half widths at the chest, shoulder and neck, depths below the neck's side; how far the armhole is
    hollowed out within the shoulder's width; how far the shoulder lies above y = 0 [m]."""

    chest: float
    shoulder: float
    neck: float
    slope: float
    armhole: float
    neck_depth: float
    hollow: float = 0.016
    rise: float = 0.0

    def upper(self) -> list[F64]:
        """From the underarm on the right over shoulder, neck and shoulder to that on the left."""
        w, s, n = self.chest, self.shoulder, self.neck
        reach, top, drop = self.armhole, self.rise, self.slope - self.rise
        hole = bezier(
            [
                (w, -reach),
                (w - (0.8 if self.hollow < 0.03 else 0.95) * (w - s + 0.012), -reach),
                (s - self.hollow, -drop - 0.5 * (reach - drop)),
                (s, -drop),
            ]
        )
        side = _line((s, -drop), (n, top))
        d = 4 / 3 * self.neck_depth - top
        collar = bezier([(n, top), (0.9 * n, -d), (-0.9 * n, -d), (-n, top)])
        return [hole, side, collar, _mirrored(side), _mirrored(hole)]


def _tshirt(f: Figure, cut: Cut) -> Pattern:
    girth = f.chest * (1 + _set(cut.ease, 0.12))
    long = _set(cut.length, f.neck_height - f.hip_height + 0.05)
    neck = f.neck / (2 * pi) + 0.028
    reach = f.neck_height - f.underarm_height + 0.09
    if long <= reach + 0.02:
        raise InputError(f"garment.length: {long:g}; allowed: above {reach + 0.02:.3f} m, below the armhole")
    panels = []
    holes = 0.0
    for name, deep in (("front", 0.085), ("back", 0.032)):
        top = _Top(girth / 4, f.shoulder / 2 + 0.012, neck, f.neck_height - f.shoulder_height, reach, deep)
        w = top.chest
        side = _line((w, -long), (w, -reach))
        edges = [_line((-w, -long), (w, -long)), side, *top.upper(), _mirrored(side)]
        holes += length(edges[2])
        place = _before(f, f.neck_height + 0.02, back=name == "back")
        panels.append(Panel(name, tuple(edges), place, hems=(0, 4)))
    width, short = min(f.upper_arm * 1.5 + 0.03, 0.92 * holes), _set(cut.sleeve, 0.11)
    for which, name in enumerate(("left", "right")):
        panels.append(_sleeve(f, which, f"{name}_sleeve", width, short, holes * 1.015))
    seams = [
        *_sides("front", "back", ((1, 7), (7, 1), (3, 5), (5, 3))),
        *_sides("left_sleeve", "left_sleeve", ((1, 4),)),
        *_sides("right_sleeve", "right_sleeve", ((1, 4),)),
        *_sides("left_sleeve", "back", ((2, 6),)),
        *_sides("left_sleeve", "front", ((3, 2),)),
        *_sides("right_sleeve", "front", ((2, 6),)),
        *_sides("right_sleeve", "back", ((3, 2),)),
    ]
    return Pattern("tshirt", tuple(panels), tuple(seams))


def _sides(a: str, b: str, edges: tuple[tuple[int, int], ...]) -> list[Seam]:
    return [Seam(Side(a, i), Side(b, j), alike=False) for i, j in edges]


def _sleeve(f: Figure, which: int, name: str, width: float, below: float, cap: float) -> Panel:
    """A set-in sleeve whose cap has the length `cap` [m]: from its underarm on the right over the top to the left."""

    def half(height: float) -> F64:
        return bezier([(width / 2, -height), (0.30 * width, -height), (0.22 * width, 0.0), (0.0, 0.0)])

    low, high = 0.01, 0.5
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if 2 * length(half(middle)) < cap else (low, middle)
    up, end = half(low), 0.47 * width
    bottom = -low - below
    under = _line((end, bottom), (width / 2, -low))
    edges = (_line((-end, bottom), (end, bottom)), under, up, _mirrored(up), _mirrored(under))
    arm = f.arms[which]
    outward = UP - arm.axis * arm.axis[1]
    outward /= np.linalg.norm(outward)
    radius = max(width / (2 * pi), arm.radius + CLEAR)
    place = Wrap(arm.top + 0.045 * arm.axis, arm.axis, outward, (radius, radius))
    return Panel(name, edges, place, hems=(0,))


def _sector(name: str, waist: float, hem: float, long: float, f: Figure, *, back: bool, height: float) -> Panel:
    """Half a flared skirt: a ring sector, its inner arc on the waist. waist, hem: lengths of this half [m]."""
    angle = max((hem - waist) / long, 1e-3)
    r = waist / angle

    def ring(radius: float, a: float, b: float) -> F64:
        t = np.linspace(a, b, 65)
        return np.stack([radius * np.sin(t), r - radius * np.cos(t)], -1)

    inner, outer = ring(r, angle / 2, -angle / 2), ring(r + long, -angle / 2, angle / 2)
    edges = (outer, np.stack([outer[-1], inner[0]]), inner, np.stack([inner[-1], outer[0]]))
    section = f.sections["waist"]
    origin = np.array([0.0, height, section.middle])
    place = Cone(origin, -FRONT if back else FRONT, _ring(section, 2 * waist, SNUG), r, angle)
    return Panel(name, edges, place, hems=(0,))


def _skirt(f: Figure, cut: Cut) -> Pattern:
    waist = _perimeter(f.sections["waist"], SNUG)
    hem = f.hip * _set(cut.flare, 1.9) * (1 + _set(cut.ease, 0.0))
    long = _set(cut.length, 0.26 * f.stature)
    panels = [
        _sector(name, waist / 2, hem / 2, long, f, back=name == "back", height=f.waist_height)
        for name in ("front", "back")
    ]
    band = tuple(Hold(Side(name, 2)) for name in ("front", "back"))
    return Pattern("skirt", tuple(panels), tuple(_sides("front", "back", ((1, 3), (3, 1)))), band)


def _dress(f: Figure, cut: Cut) -> Pattern:
    girth, waist = f.chest * (1 + _set(cut.ease, 0.07)), f.waist * 1.12
    down = f.neck_height - f.waist_height + 0.035  # over the bust and the shoulder blades
    long = _set(cut.length, down + 0.33 * f.stature)
    if long <= down + 0.05:
        raise InputError(f"garment.length: {long:g}; allowed: above {down + 0.05:.3f} m, below the waist")
    hem = f.hip * _set(cut.flare, 1.8)
    reach = f.neck_height - f.underarm_height + 0.065
    neck, shoulder = f.neck / (2 * pi), f.shoulder / 2 - 0.035
    slope, wide = f.neck_height - f.shoulder_height, neck + 0.035
    fall = slope * (wide - neck) / (f.shoulder / 2 - neck)  # of the shoulder's line, from the neck's side to its own
    panels = []
    for name, deep, rise, gape in (("front", 0.12, 0.012, GAPE), ("back", 0.045, -0.018, 0.0)):
        top = _Top(
            girth / 4, shoulder - gape, wide - gape, slope - fall, reach, deep - fall, 0.045, rise - fall
        )  # fmt: skip
        w, v = top.chest, waist / 4
        side = bezier([(v, -down), (v, -down + 0.3 * (down - reach)), (w, -reach - 0.4 * (down - reach)), (w, -reach)])
        edges = [_line((-v, -down), (v, -down)), side, *top.upper(), _mirrored(side)]
        place = _round(f, f.neck_height + 0.01, back=name == "back")
        panels.append(Panel(name, tuple(edges), place, hems=(2, 4, 6)))
    for name in ("front", "back"):
        height = f.waist_height + 0.005
        panels.append(_sector(f"skirt_{name}", waist / 2, hem / 2, long - down, f, back=name == "back", height=height))
    seams = [
        *_sides("front", "back", ((1, 7), (7, 1), (3, 5), (5, 3))),
        *_sides("skirt_front", "skirt_back", ((1, 3), (3, 1))),
        *_sides("front", "skirt_front", ((0, 2),)),
        *_sides("back", "skirt_back", ((0, 2),)),
    ]
    return Pattern("dress", tuple(panels), tuple(seams))


def _trousers(f: Figure, cut: Cut) -> Pattern:
    """Two fronts and two backs; y = 0 at the waist. The fork is 0.06 (front) and 0.13 (back) of the hip, 3.5 cm below
    the crotch. The back's centre seam leans from the waist to the hip and rises above the waist: the way over the seat
    grows where a person sits, and the way round it, for which backs are wider than fronts."""
    ease = 1 + _set(cut.ease, 0.08)
    down = f.waist_height - f.crotch_height + 0.035
    long = _set(cut.length, f.waist_height - 0.05)
    if long <= down + 0.05:
        raise InputError(f"garment.length: {long:g}; allowed: above {down + 0.05:.3f} m, below the crotch")
    waist = f.waist * 1.08
    section = f.sections["waist"]
    middle_of_waist = np.array([0.0, f.waist_height, section.middle])
    ring = _ring(section, waist, SNUG)
    panels, band = [], []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, share, round_hip, fork, away in (
            ("front", 0.245, 0.245, 0.06, 0.16),
            ("back", 0.255, 0.285, 0.13, -0.18),
        ):
            hip, hem = f.hip * ease * round_hip, f.thigh * 0.42
            crotch = fork * f.hip * ease
            middle = hip / 2 + 0.25 * crotch - crotch / 2  # of the leg
            rise, lean = (SEAT, LEAN * down) if name == "back" else (0.0, 0.0)
            top = lean + waist * share
            # x from the centre line of the body outwards; the loop: hem, outer side, waist, centre, inner leg
            outer = bezier([(middle + hem / 2, -long), (hip, -0.62 * long), (hip * 1.02, -down * 0.6), (top, 0.0)])
            straight = 0.45 * lean * down / (down + rise)  # where the centre seam begins to curve
            centre = bezier([(lean, rise), (straight, -0.55 * down), (0.0, -0.97 * down), (-crotch, -down)])
            inside = middle - hem / 2
            inner = bezier([(-crotch, -down), (-crotch * 0.55, -down - 0.1), (inside, -0.6 * long), (inside, -long)])
            edges = [
                _line((inside, -long), (inside + hem, -long)),
                outer,
                _line((top, 0.0), (lean, rise)),
                centre,
                inner,
            ]
            mirrored = sign if name == "front" else -sign  # a back panel is seen from behind
            if mirrored < 0:
                edges = [_mirrored(edges[0]), *(_mirrored(e) for e in edges[:0:-1])]
            turn = np.eye(3) if name == "front" else np.diag([-1.0, 1.0, -1.0])
            # Forks lie between the legs, along each other: in their planes they would lie across each other.
            plane = Flat(turn, np.array([0.0, f.waist_height, away]))
            place = Bent(plane, -mirrored, -CLEAR / 2, BEND)
            panels.append(Panel(f"{side}_{name}", tuple(edges), place, hems=(0,)))
            outward = FRONT if name == "front" else -FRONT
            round_waist = Wrap(middle_of_waist, UP, outward, ring, middle=mirrored * lean)
            band.append(Hold(Side(f"{side}_{name}", 2 if mirrored > 0 else 3), place=round_waist))

    def edge(panel: str, part: int) -> Side:
        """part: 1 outer, 3 centre, 4 inner; a mirrored loop counts the other way."""
        flipped = panel in ("right_front", "left_back")
        return Side(panel, {1: 4, 3: 2, 4: 1}[part] if flipped else part)

    seams = [Seam(edge(f"{s}_front", k), edge(f"{s}_back", k)) for s in ("left", "right") for k in (1, 4)]
    seams += [Seam(edge(f"left_{s}", 3), edge(f"right_{s}", 3)) for s in ("front", "back")]
    return Pattern("trousers", tuple(panels), tuple(seams), tuple(band))


DRAFTS: dict[str, Callable[[Figure, Cut], Pattern]] = {
    "tshirt": _tshirt,
    "skirt": _skirt,
    "dress": _dress,
    "trousers": _trousers,
}
