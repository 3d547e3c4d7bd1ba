"""Sleeves along the arms and legs drawn apart along the legs of the body that wears them."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.maps import along_limb
from taichi_cloth.garment.fit.piece import Piece, Work
from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.pattern import Side

__all__ = ["lay_sleeves", "turn_legs"]

F64 = NDArray[np.float64]

CLEAR = 0.03
"""From the arm to a sleeve's half where it starts [m]."""
APART = np.radians(8)
"""Of a leg's panel from the vertical, beyond which it was drawn for legs apart [rad]."""
LEANING = np.radians(6)
"""By which half a leg is turned at most so that its lower end lies over the leg: wide backs, whose lower end is far
out, would be turned over to the other leg [rad]."""
DOWN = np.array([0.857, -0.514, 0.0])
"""About the way of an arm, left."""
SEAM_CLEAR = 0.005
"""From the arm to the seams along it of a sleeve of a front and a back where it starts, at least [m]."""
EASE, MORE = 1.06, 0.015
"""Least girth of a sleeve over the arm's, and what is added to it [m]."""


def lay_sleeves(work: Work, drafted: Landmarks, worn: Landmarks) -> list[str]:
    """Grades the pieces on each arm and stands them before and behind it. The cap grows as the graded armhole that it
    is sewn to, lengths as the arm, widths from the armhole's growth to the wrist's. Gives a line for each that was
    widened for the arm's sake."""
    notes = []
    for sign, part in ((1.0, "arm_l"), (-1.0, "arm_r")):
        group = work.of(part)
        if group:
            notes += _Sleeve(work, group, sign, drafted, worn).lay()
    return notes


def turn_legs(work: Work, worn: Landmarks) -> None:
    """Legs of a body drafted with its legs apart, turned to those of the body that wears them; then each half of a leg
    so that the middle of its lower end lies over the leg, which else its seams would close beside."""
    for sign, part in ((1.0, "leg_l"), (-1.0, "leg_r")):
        way = (worn.leg[2] - worn.leg[0]) * [sign, 1, 1]
        for piece in work.of(part):
            own = piece.rotation[:, 1] * np.sign(piece.rotation[1, 1])
            tilt = np.arctan2(own[0], own[1])
            if abs(tilt) < APART:
                continue
            _turn(piece, float(tilt - np.arctan2(-way[0], -way[1])), sign, worn)
        main = [piece for piece in work.of(part) if piece.worn()[:, 1].max() > worn.height["crotch"]]
        for piece in main:
            turned = 0.0
            for _ in range(3):
                turn = _off_the_leg(piece, sign, worn)
                turn = float(np.clip(turned + turn, -LEANING, LEANING)) - turned
                turned += turn
                for other in [piece, *_hanging(work, piece)]:
                    _turn(other, turn, sign, worn)


def _turn(piece: Piece, turn: float, sign: float, worn: Landmarks) -> None:
    """In its plane, about the hip [rad]."""
    c, s = np.cos(turn), np.sin(turn)
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    pivot = np.array([worn.leg[0, 0] * sign, worn.height["hip"], 0.0])
    piece.rotation = spin @ piece.rotation
    piece.shift = spin @ (piece.shift - pivot) + pivot


def _off_the_leg(piece: Piece, sign: float, worn: Landmarks) -> float:
    """By how much to turn it about the hip so that the middle of its lower end lies over the leg [rad]."""
    w = piece.worn()
    low = w[w[:, 1] < w[:, 1].min() + 0.04]
    middle, y = (low[:, 0].min() + low[:, 0].max()) / 2, float(low[:, 1].mean())
    leg = sign * float(np.interp(y, worn.leg[::-1, 1], worn.leg[::-1, 0]))
    drop = worn.height["hip"] - y
    hip = worn.leg[0, 0] * sign
    return float(np.arctan2(leg - hip, drop) - np.arctan2(middle - hip, drop)) if drop > 0.15 else 0.0


def _hanging(work: Work, piece: Piece) -> list[Piece]:
    """Cuffs of one half of a leg: what is sewn on below it on the same side, and on below that."""
    out, left = list[Piece](), [piece]
    while left:
        upper = left.pop()
        for _, other in work.pairs(upper.name):
            below = work.pieces[other.panel]
            lower = below.worn()[:, 1].mean() < upper.worn()[:, 1].min() + 0.05
            # Short ones may each seem to hang on the other.
            if below.part == piece.part and below.side == piece.side and lower and below not in (piece, *out):
                out.append(below)
                left.append(below)
    return out


class _Sleeve:
    """All pieces on one arm, and the frame they were drawn in: `way` down the arm, `side` across it, from `start`."""

    def __init__(self, work: Work, group: list[Piece], sign: float, drafted: Landmarks, worn: Landmarks) -> None:
        self.work, self.group, self.sign, self.drafted, self.worn = work, group, sign, drafted, worn
        own = {piece.name for piece in group}
        self.caps: list[tuple[Side, Side]] = [
            (a, b) for piece in group for a, b in work.pairs(piece.name) if b.panel not in own
        ]
        self._join_cuffs(own)
        everything = np.concatenate([piece.world() for piece in group])
        if self.caps:
            inner = np.concatenate([work.at(a) for a, _ in self.caps])
        else:
            inner = everything[np.argsort(sign * everything[:, 0])[: max(3, len(everything) // 10)]]
        start = 0.5 * (inner.min(axis=0) + inner.max(axis=0))
        sewn = {
            piece.name: sum(piece.edge_length(a.edge) for a, _ in self.caps if a.panel == piece.name) for piece in group
        }
        first = max(group, key=lambda piece: sewn[piece.name])
        # Sleeves and cuffs are drawn along the arm or across it, so one of a panel's own axes is its way.
        axes = [q * first.rotation[:, k] for k in (0, 1) for q in (1.0, -1.0)]
        self.way = max(axes, key=lambda q: float(q @ (DOWN * [sign, 1, 1])))
        self.side = np.array([-self.way[1], self.way[0], 0.0])
        self.cap = max(float(((inner - start) @ self.way).max()), 0.0) if self.caps else 0.0
        of_cap = [piece.world() for piece in group if sewn[piece.name] > 0] or [everything]
        q = np.concatenate(of_cap) - start
        end = (q @ self.side)[q @ self.way > 0.85 * float((q @ self.way).max())]
        self.start = start + 0.5 * (end.min() + end.max()) * self.side  # the arm in the middle of the opening

    def _join_cuffs(self, own: set[str]) -> None:
        for _ in range(4):
            for piece in self.group:
                if any(a.panel == piece.name for a, _ in self.caps):
                    continue
                gaps = [
                    self.work.at(b).mean(axis=0) - self.work.at(a).mean(axis=0)
                    for a, b in self.work.pairs(piece.name)
                    if b.panel in own and self.work.pieces[b.panel].side == piece.side
                ]
                if gaps:
                    piece.at = piece.at + np.mean(gaps, axis=0) * [1, 1, 0]

    def _shaped(self, piece: Piece, hole: float, wide: tuple[F64, F64]) -> list[F64]:
        """Edges in (down the arm, across it) for an armhole that grew by `hole`. wide: extra factors along the arm."""
        reach = float(along_limb(self.drafted.arm)[-1])
        long = float(along_limb(self.worn.arm)[-1]) / reach
        thin = self.worn.girth["wrist"] / self.drafted.girth["wrist"]
        out = []
        for k in range(len(piece.edges)):
            w = piece.world(k) - self.start
            u, v = w @ self.way, w @ self.side
            f = hole + (thin - hole) * np.clip((u - self.cap) / max(reach - self.cap, 0.05), 0, 1)
            down = np.where(u < self.cap, hole * u, hole * self.cap + long * (u - self.cap))
            out.append(np.stack([down, v * f * np.interp(down, *wide)], -1))
        return out

    def lay(self) -> list[str]:
        hole, wide = 1.0, (np.array([0.0, 1.0]), np.ones(2))
        if self.caps:
            old = sum(self.work.pieces[a.panel].edge_length(a.edge) for a, _ in self.caps)
            others = [(self.work.pieces[b.panel], b.edge) for _, b in self.caps]
            grown = sum(length(p.graded[k]) for p, k in others) / sum(p.edge_length(k) for p, k in others)
            hole = grown
            for _ in range(3):
                now = {piece.name: self._shaped(piece, hole, wide) for piece in self.group}
                hole *= grown * old / sum(length(now[a.panel][a.edge]) for a, _ in self.caps)
        wide, note = self._wide_enough(hole)
        sign, worn = self.sign, self.worn
        flat = (worn.arm[2] - worn.arm[0]) * [sign, 1, 0]
        flat /= np.linalg.norm(flat)
        across = np.array([-flat[1], flat[0], 0.0])
        shoulder = worn.arm[0] * [sign, 1, 1]
        for piece in self.group:
            shaped = self._shaped(piece, hole, wide)
            front = piece.side == "front"
            z = (1 if front else -1) * (worn.girth["upper_arm"] / (2 * np.pi) + CLEAR) * (not piece.tube)
            # The frame's (down, across) turns as the front's right side sees it; the back's sees its mirror image.
            piece.graded = shaped if front else [edge * [-1.0, 1.0] for edge in shaped]
            out = np.array([0.0, 0.0, 1.0])
            piece.rotation = np.stack([flat, across, out] if front else [-flat, across, -out], axis=1)
            piece.shift = shoulder + 0.02 * flat + [0.0, 0.0, z]
        for piece in self.group:
            if piece.side == "front" and not piece.tube:
                aside, backs = self._aside(piece)
                for other in [piece, *backs] if aside else []:
                    other.shift = other.shift + aside * across
        return note

    def _aside(self, front: Piece) -> tuple[float, list[Piece]]:
        """How far up across the arm a front and its backs go so that the arm lies between the seams that join them
        [m], not in one, which would close through it; no farther than to the middle between them."""
        pairs = [(a, self.work.pieces[b.panel]) for a, b in self.work.pairs(front.name)]
        sides = [(front.graded[a.edge], other) for a, other in pairs if other.part == front.part]
        sides = [(line, other) for line, other in sides if other.side == "back"]
        if len(sides) < 2:
            return 0.0, []
        lines = sorted((line for line, _ in sides), key=lambda line: float(line[:, 1].mean()))
        above, below = (
            float((sign * line[:, 1] - self._arm_at(line[:, 0]) / (2 * np.pi) - SEAM_CLEAR).min())
            for sign, line in ((1, lines[-1]), (-1, lines[0]))
        )
        middle = (below - above) / 2
        aside = max(below, middle) if below < 0 else min(-above, middle) if above < 0 else 0.0
        return aside, list({other.name: other for _, other in sides}.values())

    def _arm_at(self, down: F64) -> F64:
        """Girth of the arm so far down it [m]."""
        along, girth = along_limb(self.worn.arm), self.worn.girth
        return np.interp(down, [0.6 * along[1], along[2]], [girth["upper_arm"], girth["wrist"]])

    def _wide_enough(self, hole: float) -> tuple[tuple[F64, F64], list[str]]:
        """Factors along the arm with which no part of the sleeve is tighter than the arm there, and what was done."""
        places = np.linspace(0.0, float(along_limb(self.worn.arm)[-1]) + 0.3, 60)
        own = np.zeros(len(places))
        for piece in self.group:
            outline = np.concatenate([e[:-1] for e in self._shaped(piece, hole, (np.array([0.0, 1.0]), np.ones(2)))])
            own += [_width(outline, float(u)) for u in places]
        arm = self._arm_at(places)
        need = EASE * arm + MORE
        low = hole * self.cap + 0.02
        there = (own > 0.3 * arm) & (places > low)
        factor = np.where(there & (own < need), need / np.maximum(own, 1e-6), 1.0)
        if factor.max() <= 1.0:
            return (np.array([0.0, 1.0]), np.ones(2)), []
        spread = np.array([factor[max(0, k - 2) : k + 3].max() for k in range(len(factor))])
        k = int(np.argmax(factor))
        name = "left" if self.sign > 0 else "right"
        tight = f"{100 * own[k]:.0f} cm round where the arm is {100 * arm[k]:.0f}"
        note = f"{name} sleeve: {tight}: widened to {100 * need[k]:.0f}"
        return (places, np.where(places > low, spread, 1.0)), [note]


def _width(outline: F64, u: float) -> float:
    """Of a closed polygon (n, 2) along the line with first coordinate u [m]."""
    a, b = outline, np.roll(outline, -1, axis=0)
    crossed = (a[:, 0] <= u) != (b[:, 0] <= u)
    a, b = a[crossed], b[crossed]
    at = np.sort(a[:, 1] + (u - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1]))
    return float((at[1::2] - at[::2]).sum())
