"""How a sewn garment lies on its body, panel by panel, whatever placed it there: slipped, astray, turned, folded.

Told by positions alone. A panel has slipped where the middle of its area is far from the height at which it was
placed, by landmarks; it is astray where it lies on another limb than its own; turned where its right side faces the
body; folded where neighbouring triangles face each other. Free edges, necks, hems and cuffs, make loops: each goes
round its part of the body as often as it did where the panels were placed round it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import turned
from taichi_cloth.garment.pattern.folded import Fin, Folded
from taichi_cloth.garment.pattern.pattern import Cone, Panel, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.limbs import LIMBS
from taichi_cloth.layers.outline import crossings_of

__all__ = ["CROSSED", "Lie", "Loop", "crossed", "free_loops", "lies", "lying_faults"]

F64 = NDArray[np.float64]

OWN = {
    "trunk": ("trunk", "leg_l", "leg_r"),
    "head": ("trunk",),
    "skirt": ("trunk", "leg_l", "leg_r"),
    "arm_l": ("arm_l", "clavicle_l", "trunk"),
    "arm_r": ("arm_r", "clavicle_r", "trunk"),
    "leg_l": ("leg_l", "trunk"),
    "leg_r": ("leg_r", "trunk"),
}
"""By a panel's label, the limbs that it may lie on, and bones of others: caps lie on collar bones, tunics over legs,
wide sleeves beside the trunk."""
WAIST = 0.1  # [m]
NEAR = 0.08
"""From the body within which it is asked which side of the cloth faces it [m]."""
FACING = 0.5
"""Cosine between a triangle's normal and the way to the body from which on it faces it: a frill that stands off from a
cuff is seen from its edge, and faces neither way."""
BOTH = 0.2
"""Share of a loop's points at each leg from which on it goes round both."""
FOLD = np.cos(np.radians(150.0))
"""Of the angle between the normals of two neighbouring triangles that are a fold."""
AROUND = np.array([(np.cos(turn), np.sin(turn)) for turn in np.linspace(0.0, np.pi, 8, endpoint=False)]).T
"""Ways in which it is asked how long a panel is."""
BESIDE = 1
"""Cells from those that a dart's edges run through."""
LAID = 0.6
"""Share of its outline below which a panel that is sewn along one stretch may be turned over: lapels are."""

SLIPPED, ASTRAY, TURNED, FOLDED, CROSSED = 0.10, 0.35, 0.25, 1.5, 0.05
"""What is allowed of a garment that fits: of `Lie.rise` either way [m], `astray`, `turned`, `folded`, and of `crossed`.
docs/garments.md has what good and bad ones come to."""


@dataclass(frozen=True)
class Lie:
    """Of one panel. rise: of the middle of its area over where it was placed [m]; of one placed as a cone that of its
    top, WAIST high, as the rest may hang straight down; of a tier over that, or under where it then would be; of a
    sleeve that of its armhole. astray: share of its area that lies nearest to another limb than its own, 0 of one
    without a label. turned: share whose right side faces the body (a sleeve's: its arm), 0 of one that hangs by one
    side; of collars, which may fold over, and of godets, which hang in a fold, by how much that is more than the rest.
    folded: length of its folds over the root of its area; one across it has about 1. Of collars and godets what is more
    than one as long as they are: along a narrow one that alone is 2."""

    panel: str
    rise: float
    astray: float
    turned: float
    folded: float


@dataclass(frozen=True)
class Loop:
    """A closed loop of free edges. sides: in their order. placed, worn: how often it goes round its part of the body,
    where panels were placed and as it is worn; of both legs round the one of which these differ more."""

    sides: tuple[Side, ...]
    placed: int
    worn: int


def lies(garment: Garment, positions: NDArray, primitives: Sequence[Primitive]) -> list[Lie]:
    """Of each panel. positions: key points (rows, cols, 3) [m] on the body at rest that primitives stand for."""
    cloth = garment.apart
    at, start = cloth.places(positions), cloth.places(garment.atlas.start())
    faces, owner = cloth.faces, cloth.panel[cloth.faces[:, 0]]
    a, b, c = (cloth.flat[faces[:, k]] for k in range(3))
    area = np.abs(_cross(b - a, c - a)) / 2
    corner = at[faces]
    middle, normal = corner.mean(axis=1), np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.sign(_cross(b - a, c - a))[:, None]  # faces may run either way in the flat
    distance, away, whose = nearest_distance(primitives, middle)
    bone = np.array([JOINTS[p.bone] for p in primitives])[whose]
    inward = (np.einsum("na,na->n", normal, away) < -FACING) & (distance < NEAR)
    fold, long, of = _folds(faces, normal, at, owner)
    sewn = {side for seam in garment.pattern.seams for side in (seam.first, seam.second)}
    out = []
    for number, piece in enumerate(garment.atlas.panels):
        mine, own = owner == number, OWN.get(piece.panel.label)
        share = area[mine] / max(float(area[mine].sum()), 1e-12)
        placed = start[faces[mine], 1].mean(axis=1)
        top, place = np.ones_like(placed, bool), piece.panel.place
        rises = middle[mine, 1] - placed
        if isinstance(place, Folded) and place.begins:
            lowest = place.hanging(turned(cloth.flat[faces[mine]].mean(axis=1), -piece.panel.grain))
            rises = middle[mine, 1] - np.clip(middle[mine, 1], np.minimum(lowest, placed), placed)
        elif isinstance(place, Cone):
            top = placed > placed.max() - WAIST
        rise = float(np.average(rises[top], weights=share[top]))
        if piece.panel.label.startswith("arm"):
            rise = _armhole_rise(garment, piece.panel, positions)
        bones = [one for name in own or () for one in LIMBS.get(name, (name,))]
        astray = 0.0 if own is None else float(share @ ~np.isin(bone[mine], bones))
        edges = of == number
        limb = LIMBS.get(piece.panel.label, tuple(JOINTS))  # a sleeve's inside may lie on the trunk
        facing = 0.0 if _hangs_by_one_side(piece.panel, sewn) else float(share @ (inward & np.isin(bone, limb))[mine])
        folds = float((long * fold)[edges].sum())
        if piece.panel.label == "head" or isinstance(place, Fin):
            facing = max(0.0, 2 * facing - 1)
            folds = max(0.0, folds - float(np.ptp(cloth.flat[faces[mine]].reshape(-1, 2) @ AROUND, axis=0).max()))
        folded = folds / np.sqrt(max(float(area[mine].sum()), 1e-12))
        out.append(Lie(piece.panel.name, rise, astray, facing, folded))
    return out


def lying_faults(garment: Garment, positions: NDArray, primitives: Sequence[Primitive]) -> list[str]:
    """What of it does not lie as it should, a line for each kind, the worst panel of each."""
    found = lies(garment, positions, primitives)
    out = []
    far = max(found, key=lambda lie: abs(lie.rise))
    if abs(far.rise) > SLIPPED:
        way = "over" if far.rise > 0 else "under"
        out.append(
            f"{far.panel} lies {100 * abs(far.rise):.0f} cm {way} where it belongs (allowed {100 * SLIPPED:.0f})"
        )
    for name, allowed, what in (
        ("astray", ASTRAY, "lies nearest to another limb than its own"),
        ("turned", TURNED, "has its right side to the body"),
    ):
        worst = max(found, key=lambda lie: getattr(lie, name))
        share = getattr(worst, name)
        if share > allowed:
            out.append(f"{100 * share:.0f} % of {worst.panel} {what} (allowed {100 * allowed:.0f})")
    creased = max(found, key=lambda lie: lie.folded)
    if creased.folded > FOLDED:
        out.append(f"{creased.panel} has folds {creased.folded:.1f} times as long as it is wide (allowed {FOLDED:g})")
    for loop in free_loops(garment, positions, primitives):
        if loop.worn < loop.placed or loop.worn > max(loop.placed, 1):  # wide armholes are placed beside the arm
            panels = ", ".join(dict.fromkeys(side.panel for side in loop.sides))
            out.append(f"the free edge of {panels} goes {loop.worn} times round its limb, not {loop.placed}")
    through = crossed(garment, positions)
    if through > CROSSED:
        out.append(f"it passes through itself: {100 * through:.0f} of each 100 triangles (allowed {100 * CROSSED:.0f})")
    return out


def crossed(garment: Garment, positions: NDArray) -> float:
    """Triangles that pass through others, over all, of what is sewn: closed along its seams. What lies on both sides of
    a dart, beside it, counts as one: at the tip, narrower than a cell, it is of the same key points, which crumple."""
    pairs = crossings_of(garment.outline, positions).pairs
    pairs = pairs[~_of_one_dart(garment, pairs)]
    return len(np.unique(pairs)) / max(len(garment.outline.faces), 1)


def _of_one_dart(garment: Garment, pairs: NDArray) -> NDArray[np.bool_]:
    """Which pairs of triangles (n, 2) have both of their cells beside the same dart, within BESIDE cells."""
    atlas, cols = garment.atlas, garment.atlas.shape[1]
    row, col = np.divmod(garment.outline.cell[pairs], cols)
    out = np.zeros(len(pairs), bool)
    for seam in garment.pattern.seams:
        if not garment.pattern.dart_width(seam):
            continue
        piece = atlas.panel(seam.first.panel)
        edges = [garment.pattern.edge(side) for side in (seam.first, seam.second)]
        count = int(2 * max(length(edge) for edge in edges) / min(atlas.spacing)) + 2
        line = np.concatenate([along(edge, np.linspace(0, 1, count)) for edge in edges])
        at = (turned(line, piece.panel.grain) - piece.origin) / np.asarray(piece.spacing) + [piece.col, piece.row]
        cells = np.unique(np.floor(at).astype(np.int64), axis=0)
        near = np.zeros((atlas.shape[0] + 2 * BESIDE, cols + 2 * BESIDE), bool)
        for i in range(2 * BESIDE + 1):
            for j in range(2 * BESIDE + 1):
                near[cells[:, 1] + i, cells[:, 0] + j] = True
        out |= near[row + BESIDE, col + BESIDE].all(axis=1)
    return out


def free_loops(garment: Garment, positions: NDArray, primitives: Sequence[Primitive]) -> list[Loop]:
    """All loops of free edges that are closed by seams, with how often each goes round."""
    start = garment.atlas.start()
    out = []
    for loop in _loops(garment):
        placed, worn = (np.concatenate([_edge(garment, s, x)[::way] for s, way in loop]) for x in (start, positions))
        labels = {garment.pattern.panel(side.panel).label for side, _ in loop}
        axes = _axes(placed, primitives, min(labels) if len(labels) == 1 else "")
        turns = [(_turns(placed, *axis), _turns(worn, *axis)) for axis in axes]
        worst = max(turns, key=lambda both: abs(both[1] - both[0]))
        out.append(Loop(tuple(side for side, _ in loop), *worst))
    return out


def _armhole_rise(garment: Garment, panel: Panel, positions: NDArray) -> float:
    """How far what joins a sleeve to other parts lies over where those were placed [m]; 0 of what joins none."""
    pattern, rises = garment.pattern, []
    for seam in pattern.seams:
        for own, other in ((seam.first, seam.second), (seam.second, seam.first)):
            if own.panel == panel.name and pattern.panel(other.panel).label != panel.label:
                worn, placed = _edge(garment, own, positions), _edge(garment, other, garment.atlas.start())
                rises.append((length(pattern.edge(own)), worn[:, 1].mean() - placed[:, 1].mean()))
    return float(np.average([rise for _, rise in rises], weights=[long for long, _ in rises])) if rises else 0.0


def _hangs_by_one_side(panel: Panel, sewn: set[Side]) -> bool:
    """Whether a panel is sewn along one stretch of its outline that is less than LAID of it."""
    fast = [Side(panel.name, k) in sewn for k in range(len(panel.edges))]
    long = [length(edge) for edge in panel.edges]
    stretches = sum(now and not before for before, now in zip(fast[-1:] + fast, fast, strict=False))
    return stretches == 1 and sum(one for one, is_sewn in zip(long, fast, strict=True) if is_sewn) < LAID * sum(long)


def _cross(u: F64, v: F64) -> F64:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _folds(faces: NDArray, normal: F64, at: F64, owner: NDArray) -> tuple[NDArray[np.bool_], F64, NDArray]:
    """For each pair of triangles of a panel with a side in common: whether it is a fold, how long the side is [m], and
    which panel it is of."""
    ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    of = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(ends.T)
    ends, of = ends[order], of[order]
    two = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    one, other = of[two], of[two + 1]
    cosine = np.einsum("na,na->n", normal[one], normal[other])
    long = np.linalg.norm(at[ends[two, 0]] - at[ends[two, 1]], axis=1)
    return cosine < FOLD, long, owner[one]


def _loops(garment: Garment) -> list[list[tuple[Side, int]]]:
    """Free edges in the order in which they follow each other, over the ends of seams, each with 1 where it is gone
    along its outline, −1 against it."""
    pattern = garment.pattern
    count = {panel.name: len(panel.edges) for panel in pattern.panels}
    partner: dict[Side, tuple[Side, bool]] = {}
    for seam in pattern.seams:
        alike = pattern.is_alike(seam)
        partner[seam.first], partner[seam.second] = (seam.second, alike), (seam.first, alike)
    free = [Side(name, k) for name, n in count.items() for k in range(n) if Side(name, k) not in partner]
    out, seen = [], set[Side]()
    for first in free:
        if first in seen:
            continue
        loop, side, way = [], first, 1
        while side not in seen:
            seen.add(side)
            loop.append((side, way))
            for _ in range(sum(count.values())):
                side = Side(side.panel, (side.edge + way) % count[side.panel])
                if side not in partner:
                    break
                side, alike = partner[side]  # its end next to ours is where we go on, away from the seam
                way = -way if alike else way
        if side == first:
            out.append(loop)
    return out


def _edge(garment: Garment, side: Side, positions: NDArray) -> F64:
    """(k, 3) along an edge of the cloth [m]."""
    piece, edge = garment.atlas.panel(side.panel), garment.pattern.edge(side)
    count = max(2, int(np.ceil(length(edge) / min(garment.atlas.spacing))) + 1)
    nodes, weights = piece.embed(turned(along(edge, np.linspace(0.0, 1.0, count)), piece.panel.grain))
    return np.einsum("nkc,nk->nc", np.asarray(positions, np.float64)[nodes[..., 0], nodes[..., 1]], weights)


def _axes(line: F64, primitives: Sequence[Primitive], label: str) -> list[tuple[F64, F64]]:
    """A point (3,) and the way (3,) of the limbs that a loop (k, 3) lies round: that of its panels' label, else that of
    most of its points. Round both legs it has to go round each: a fold of a hem may well hang between them."""
    limb_of = {JOINTS.index(name): limb for limb, names in LIMBS.items() for name in names}
    limbs = [limb_of[p.bone] for p in primitives]
    nearest = [limbs[k] for k in nearest_distance(primitives, line)[2]]
    share = {limb: nearest.count(limb) / len(nearest) for limb in LIMBS}
    limb = max(share, key=lambda name: share[name])
    if label.startswith(("arm", "leg")):  # a wide cuff reaches over to the other leg where it starts
        limb = label
    elif min(share["leg_l"], share["leg_r"]) > BOTH:
        return [_limb_axis(line, primitives, limbs, leg) for leg in ("leg_l", "leg_r")]
    if limb == "trunk":
        own = [p for p, name in zip(primitives, limbs, strict=True) if name == "trunk"]
        ends = np.array([(p.start, p.end) for p in own]).reshape(-1, 3)
        height = float(line[:, 1].mean())
        near = np.exp(-(((ends[:, 1] - height) / 0.15) ** 2)) + 1e-9
        return [((near / near.sum()) @ ends, np.array([0.0, 1.0, 0.0]))]
    return [_limb_axis(line, primitives, limbs, limb)]


def _limb_axis(line: F64, primitives: Sequence[Primitive], limbs: Sequence[str], limb: str) -> tuple[F64, F64]:
    """The middle line, a point (3,) and its way (3,), of the part of a limb next to the middle of a loop (k, 3).
    limbs: that each primitive is of."""
    middle, best = line.mean(axis=0), (np.inf, line.mean(axis=0), np.array([0.0, 1.0, 0.0]))
    for p, name in zip(primitives, limbs, strict=True):
        way = p.end - p.start
        if name != limb or JOINTS[p.bone].startswith("foot") or not way.any():  # a foot lies across its leg
            continue
        at = p.start + float(np.clip((middle - p.start) @ way / (way @ way), 0.0, 1.0)) * way
        best = min(best, (float(np.linalg.norm(middle - at)), at, way / np.linalg.norm(way)), key=lambda one: one[0])
    return best[1:]


def _turns(line: F64, point: F64, way: F64) -> int:
    """How often a closed polyline (k, 3) goes round a line."""
    across = np.linalg.svd(way[None])[2][1:]
    p = (line - point) @ across.T
    turn = np.diff(np.unwrap(np.arctan2(p[:, 1], p[:, 0]), axis=0))
    last = np.arctan2(_cross(p[-1:], p[:1])[0], float(p[-1] @ p[0]))
    return abs(round((float(turn.sum()) + float(last)) / (2 * np.pi)))
