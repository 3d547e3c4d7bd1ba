"""What is held: the top of what hangs from the waist, as by a belt, and of what has no straps over the bust.

A closed loop of cloth of length L slides down to where the body grows as wide as it; there it is held, on a ring of its
own length in the proportions of the body. What lies on shoulders is held by nothing once it is sewn; while seams close
it hangs by those that close over the shoulders, as on a hanger, or skirts would have no weight and fold.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.piece import UP, Piece, Work
from taichi_cloth.garment.fit.stack import Carried, over_head, over_shoulders
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.pattern import Course, Hold, Side

__all__ = ["held", "hung"]

F64 = NDArray[np.float64]

NEAR_TOP = 0.06
"""Of a free edge under the top of what it is part of, to be of its top [m]."""
LEVEL = 0.8
"""Rise over run of an edge of a waist, at most."""
SNUG = 0.006
"""Of a held edge from the body [m]."""
LOOSE = 1.15
"""Girth of a loop over that of the body where it rests."""
FINE = 0.004
"""Between points of a `Course` [m]."""


def held(work: Work, by: Carried, worn: Landmarks) -> tuple[tuple[Hold, ...], list[str]]:
    """Holds, and a line where one carries what would slide off. Moves all pieces so that the top is at its height."""
    if by.by == "shoulders":
        return (), []
    top = _top(work, strapless=by.by == "bust")
    if not top:
        return (), []
    whole = sum(length(work.pieces[side.panel].graded[side.edge]) for side in top)
    heights = [work.pieces[side.panel].level(side.edge, worn=True).mean() for side in top]
    drawn = float(np.average(heights, weights=[length(work.pieces[s.panel].graded[s.edge]) for s in top]))
    notes = []
    if by.by == "waist":
        low, high = worn.height["hip"], worn.height["waist"]
        rest = drawn
        if drawn <= high + 0.02:
            down = np.arange(min(drawn, high), low - 0.005, -0.005)
            wide = [y for y in down if LOOSE * worn.ring(float(y))[0] >= whole]
            rest = float(wide[0]) if wide else drawn
            if not wide:
                notes.append(
                    f"its waist is {100 * whole:.0f} cm round, the hip {100 * worn.girth['hip']:.0f}: it would slide "
                    "off, and is held as by a belt"
                )
        for piece in work.pieces.values():
            piece.shift = piece.shift + (rest - drawn) * UP
    order = sorted(top, key=lambda side: _azimuth(work.pieces[side.panel].worn(side.edge), worn))
    widths = np.array([length(work.pieces[s.panel].graded[s.edge]) for s in order])
    middles = 2 * np.pi * (np.cumsum(widths) - widths / 2) / whole
    own = np.array([_azimuth(work.pieces[s.panel].worn(s.edge), worn) for s in order])
    offset = float(np.angle(np.sum(widths * np.exp(1j * (own - middles)))))
    courses = [
        _course(work.pieces[side.panel], side.edge, float(middle), float(width / whole), whole, worn)
        for side, middle, width in zip(order, middles + offset, widths, strict=True)
    ]
    return tuple(Hold(side, course) for side, course in zip(order, _joined(work, order, courses), strict=True)), notes


def hung(work: Work, by: Carried, worn: Landmarks) -> tuple[Hold, ...]:
    """Both sides of the seams over the shoulders on one line, half way between where they stand, over the joints; those
    over the head likewise, in the middle: halves of a hood stand beside it, and would fall to either side."""
    if by.by != "shoulders":
        return ()
    out, alike = [], {(seam.first, seam.second): bool(seam.alike) for seam in work.seams}
    over = over_shoulders(work)
    for pair in over + over_head(work):
        t = np.linspace(0.0, 1.0, max(8, int(max(length(work.pieces[s.panel].graded[s.edge]) for s in pair) / FINE)))
        lines = [along(work.pieces[side.panel].graded[side.edge], t) for side in pair]
        stands = [work.pieces[side.panel].standing(line) for side, line in zip(pair, lines, strict=True)]
        way = 1 if alike[pair] else -1
        places = 0.5 * (stands[0] + stands[1][::way])
        if pair in over:
            places[:, 2] = worn.arm[0, 2]
        out += [Hold(pair[0], Course(lines[0], places)), Hold(pair[1], Course(lines[1], places[::way]))]
    return tuple(out)


def _top(work: Work, *, strapless: bool) -> list[Side]:
    """Free edges along the top: those that the file marks so, or that lie level near the top of their piece."""
    pieces = work.of("trunk", "skirt", "leg_l", "leg_r")
    sewn = work.sewn()
    free = [(piece, k) for piece in pieces for k in range(len(piece.edges)) if (piece.name, k) not in sewn]
    mark = "strapless_top" if strapless else "lower_interface"
    said = [Side(piece.name, k) for piece, k in free if piece.mark(k) == mark]
    if said:
        return said
    if not free:
        return []
    lowest = max(float(piece.level(k, worn=True).max()) for piece, k in free) - (0.3 if strapless else NEAR_TOP)
    out = []
    for piece, k in free:
        w, y = piece.worn(k), piece.level(k, worn=True)
        steep = np.ptp(y) / max(float(np.ptp(w[:, [0, 2]], axis=0).max()), 1e-6)
        near = float(y.max()) > float(piece.level(worn=True).max()) - (0.12 if strapless else NEAR_TOP)
        rise = piece.rotation[1, :2]
        along_top = float((piece.graded[k][-1] - piece.graded[k][0]) @ np.array([rise[1], -rise[0]])) < 0
        if near and along_top and float(y.mean()) > lowest and (strapless or steep < LEVEL):
            out.append(Side(piece.name, k))
    return out


def _azimuth(points: F64, worn: Landmarks) -> float:
    """Of an edge's middle, from the front to the wearer's left [rad]."""
    x, _, z = points.mean(axis=0)
    return float(np.arctan2(x, z - float(np.mean(worn.depth["waist"]))))


def _course(piece: Piece, edge: int, middle: float, share: float, whole: float, worn: Landmarks) -> Course:
    """Along the ring that the whole loop rests on: an edge that covers a share of it. Seen from outside an outline runs
    counter-clockwise, so along its top from the wearer's left to the right."""
    line = piece.graded[edge]
    count = max(8, int(length(line) / FINE))
    t = np.linspace(0.0, 1.0, count)
    flat = along(line, t)
    y = np.interp(t, np.linspace(0.0, 1.0, len(line)), piece.level(edge, worn=True))
    turn = middle + 2 * np.pi * share * (0.5 - t)
    places = []
    for height, angle in zip(y, turn, strict=True):
        _, breadth, depth, at = worn.ring(float(height))
        breadth, depth = breadth + SNUG, depth + SNUG
        h = ((depth - breadth) / (depth + breadth)) ** 2
        around = np.pi * (depth + breadth) * (1 + 3 * h / (10 + np.sqrt(4 - 3 * h)))  # Ramanujan 1914
        scale = max(1.0, whole / around)
        x, z = _on_ellipse(breadth * scale, depth * scale, float(angle))
        places.append([x, height, at + z])
    return Course(flat, np.array(places))


def _joined(work: Work, sides: list[Side], courses: list[Course]) -> list[Course]:
    """The same, of edges from the front to the left round a loop, where ends that a seam joins meet half way: each was
    graded by itself, and the seam would stay open there by what they differ in height."""
    places = [course.places.copy() for course in courses]
    sewn = {frozenset((seam.first, seam.second)) for seam in work.seams}
    for k, one in enumerate(sides):
        last = (k + 1) % len(sides)
        next_one = sides[last]
        before = Side(one.panel, (one.edge - 1) % len(work.pieces[one.panel].edges))
        after = Side(next_one.panel, (next_one.edge + 1) % len(work.pieces[next_one.panel].edges))
        if frozenset((before, after)) in sewn:
            apart = places[last][-1] - places[k][0]
            places[k] += 0.5 * np.linspace(1.0, 0.0, len(places[k]))[:, None] * apart
            places[last] -= 0.5 * np.linspace(0.0, 1.0, len(places[last]))[:, None] * apart
    return [Course(course.flat, there) for course, there in zip(courses, places, strict=True)]


def _on_ellipse(breadth: float, depth: float, turn: float) -> tuple[float, float]:
    """x and z where a share `turn` / 2π of an ellipse's girth is walked from its front to the left."""
    angle = np.linspace(-np.pi, np.pi, 361)
    ring = np.stack([breadth * np.sin(angle), depth * np.cos(angle)], -1)
    walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    share = ((turn + np.pi) % (2 * np.pi)) / (2 * np.pi)
    at = float(np.interp(share * walked[-1], walked, angle))
    return breadth * float(np.sin(at)), depth * float(np.cos(at))
