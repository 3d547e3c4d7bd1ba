"""The named parts of a body, found from its shape alone: in any pose, turned any way, of any size and meshing.

The five ends of a person (crown, fingertips, toes) are the far points of the skin; which is which follows from the
distances between them along the skin, and left from right from the way a foot points. Distance from an end then runs
along its limb, and the length of its level curves is the limb's girth: wrist, neck and ankle are narrowest, armpits
and crotch are where the girth jumps. Knees, elbows and the levels of the trunk stand at measured shares of the
lengths between those (Drillis and Contini, "Body segment parameters", 1966). Each cut is a plane square to the limb.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from taichi_cloth.body.skin.laplacian import Surface
from taichi_cloth.body.skin.names import JOINTS as BODY_JOINTS
from taichi_cloth.ground.errors import InputError

__all__ = ["BONES", "JOINTS", "PARTS", "cut", "ends"]

F64 = NDArray[np.float64]
TRUNK = ("head", "neck", "chest", "abdomen", "pelvis")
ARM = ("upper arm", "lower arm", "hand")
LEG = ("upper leg", "lower leg", "foot")
PARTS = (*TRUNK, *(f"{side} {part}" for side in ("left", "right") for part in (*ARM, *LEG)))

JOINTS = {
    "head": "head", "neck": "neck", "chest": "spine3", "abdomen": "spine2", "pelvis": "pelvis",
    **{f"{side} {part}": f"{bone}_{side[0]}" for side in ("left", "right") for part, bone in (
        ("upper arm", "upper_arm"), ("lower arm", "forearm"), ("hand", "hand"),
        ("upper leg", "thigh"), ("lower leg", "shin"), ("foot", "foot"))},
}  # fmt: skip
"""The joint of `skeleton.JOINTS` that each part moves with."""
BONES = {part: BODY_JOINTS.index(joint) for part, joint in JOINTS.items()}
"""Its number there."""

LEVELS = 96
"""Level curves along a limb."""
WRIST, ANKLE = (0.26, 0.42), (0.22, 0.36)
"""Where the narrowest place is looked for: shares of the way along the skin from the fingertips to the armpit (the
hand is 0.108 of the stature, the arm to the armpit 0.39), and from the toes to the crotch."""
ELBOW = 0.50
"""Share of the way from the wrist to the armpit: the forearm is 0.146 of the stature, the armpit about as far on."""
KNEE = (0.42, 0.54)
"""Where the hollow of the knee is looked for: shares of the way from the ankle to the crotch."""
JUMP = 1.35
"""The arm ends where its girth is this many times that of the upper arm."""
WAIST, BUST = 0.32, 0.62
"""Shares of the way from the crotch to the base of the neck where the abdomen starts and ends."""
JAW, NAPE = 1.18, 1.30
"""The neck ends where its girth is this many times its least, upward and downward."""
SHORTEST_NECK = 0.5
"""Its length, in diameters at its narrowest, is at least this."""
HIP_TILT = np.radians(30.0)
"""The groin's crease rises outward by this angle."""


@dataclass(frozen=True)
class Ends:
    """Vertex numbers of a person's five ends, and the distance along the skin from each [m], shape (v,)."""

    crown: int
    hands: tuple[int, int]
    feet: tuple[int, int]
    away: dict[int, F64]


def ends(surface: Surface) -> Ends:
    """The five ends of a person's skin; the pairs are in no order. Raises InputError where there are no five."""
    first = surface.distance_from(0)
    seeds = [int(first.argmax())]
    rows = [surface.distance_from(seeds[0])]
    for _ in range(11):  # spread over the skin, to find its middle
        seeds.append(int(np.min(rows, axis=0).argmax()))
        rows.append(surface.distance_from(seeds[-1]))
    middle = int(np.mean(rows, axis=0).argmin())
    out = surface.distance_from(middle)
    peaks = _peaks(surface, out)
    picked: list[int] = []
    nearest = out.copy()
    away: dict[int, F64] = {}
    for _ in range(5):
        if len(peaks) == 0:
            raise InputError(
                "mesh: not a person: fewer than five ends (crown, hands, feet) stand out; use a whole body"
            )
        tip = int(peaks[nearest[peaks].argmax()])
        picked.append(tip)
        away[tip] = surface.distance_from(tip)
        nearest = np.minimum(nearest, away[tip])
        peaks = peaks[peaks != tip]
    between = np.array([[away[a][b] for b in picked] for a in picked])
    between = (between + between.T) / 2

    def unlike(order: tuple[int, ...]) -> float:
        """How far a crown, two hands and two feet in this order are from mirror symmetry [m]."""
        c, a, b, p, q = order
        d = between
        return abs(d[c, a] - d[c, b]) + abs(d[c, p] - d[c, q]) + abs(d[a, p] - d[b, q]) + abs(d[a, q] - d[b, p])

    best = min(
        permutations(range(5)), key=lambda o: unlike(o) + (1e9 if between[o[0], o[1]] > between[o[0], o[3]] else 0)
    )
    c, a, b, p, q = (picked[k] for k in best)
    if away[c][a] + away[c][b] > 0.95 * (away[c][p] + away[c][q]):
        raise InputError("mesh: not a person: hands and feet cannot be told apart by their distance; use a whole body")
    return Ends(c, (a, b), (p, q), away)


def _peaks(surface: Surface, out: F64) -> NDArray[np.int64]:
    """Vertices at least as far as all within two rings."""
    rings = surface.adjacency + surface.adjacency @ surface.adjacency
    i, j = rings.nonzero()
    beaten = np.zeros(len(out), bool)
    beaten[i[out[j] > out[i]]] = True
    return np.flatnonzero(~beaten)


def girths(surface: Surface, distance: F64, levels: F64, within: NDArray[np.bool_]) -> tuple[F64, F64]:
    """Length [m] and middle (3,) of the level curve of a distance at each level, on the faces `within`."""
    faces = surface.faces[within]
    corner, value = surface.vertices[faces], distance[faces]
    length, middle = np.zeros(len(levels)), np.full((len(levels), 3), np.nan)
    for n, level in enumerate(levels):
        above = value > level
        crossed = above.any(axis=1) & ~above.all(axis=1)
        v, p, up = value[crossed], corner[crossed], above[crossed]
        alone = np.where(up.sum(axis=1) == 1, up.argmax(axis=1), (~up).argmax(axis=1))
        k = np.arange(len(v))
        tip, ends_ = p[k, alone], []
        for turn in (1, 2):
            other = (alone + turn) % 3
            share = (level - v[k, alone]) / (v[k, other] - v[k, alone])
            ends_.append(tip + share[:, None] * (p[k, other] - tip))
        piece = np.linalg.norm(ends_[0] - ends_[1], axis=1)
        length[n] = piece.sum()
        if length[n] > 0:
            middle[n] = ((ends_[0] + ends_[1]) / 2 * piece[:, None]).sum(axis=0) / length[n]
    return length, middle


def cut(surface: Surface) -> NDArray[np.int32]:
    """The part of each face, its number in PARTS, shape (f,). Raises InputError for what is no whole person."""
    found = ends(surface)
    faces, centres = surface.faces, surface.centres
    arm_out = np.stack([found.away[h] for h in found.hands])
    leg_out = np.stack([found.away[t] for t in found.feet])
    arm_face, leg_face = arm_out[:, faces].mean(axis=-1), leg_out[:, faces].mean(axis=-1)
    reach = (found.away[found.hands[0]][found.hands[1]]) / 2
    fork = (found.away[found.feet[0]][found.feet[1]]) / 2
    crotch = surface.vertices[leg_out.max(axis=0).argmin()]

    legs = [_limb(surface, leg_out[k], fork, leg_face[k] < leg_face[1 - k]) for k in (0, 1)]
    arms = [_limb(surface, arm_out[k], reach, arm_face[k] < arm_face[1 - k]) for k in (0, 1)]
    girth = (arms[0].girth + arms[1].girth) / 2
    armpit = _armpit(arms[0].levels, girth)
    wrist = _narrowest(arms[0].levels, girth, WRIST[0] * armpit, WRIST[1] * armpit)
    elbow = wrist + ELBOW * (armpit - wrist)
    girth = (legs[0].girth + legs[1].girth) / 2
    ankle = _narrowest(legs[0].levels, girth, ANKLE[0] * fork, ANKLE[1] * fork)
    low, high = (ankle + share * (fork - ankle) for share in KNEE)
    knee = _narrowest(legs[0].levels, girth, low, high)
    if min(knee - low, high - knee) < 0.02 * fork:  # no hollow there
        knee = (low + high) / 2

    shoulders = np.stack([arm.at(armpit) for arm in arms])
    trunk, neck_low, neck_high, spine = _neck(surface, found, shoulders, arm_face.min(axis=0) < armpit)
    hips = np.stack([leg.at(0.97 * fork) for leg in legs])
    side = _left(legs, ankle, knee, hips, surface.vertices[list(found.feet)])
    across = hips[0] - hips[1]
    left_leg = 0 if side > 0 else 1
    left_arm = 0 if (side * across) @ (shoulders[0] - shoulders[1]) > 0 else 1

    label = np.full(len(faces), -1, np.int32)
    up = neck_low - crotch
    height = (centres - crotch) @ up / (up @ up)
    label[:] = np.where(height < WAIST, PARTS.index("pelvis"), PARTS.index("abdomen"))
    label[height > BUST] = PARTS.index("chest")
    above = trunk & ((centres - neck_low) @ spine > 0)
    label[above] = PARTS.index("neck")
    label[trunk & ((centres - neck_high) @ spine > 0)] = PARTS.index("head")

    down = np.array([leg.towards(knee, 0.1 * fork) for leg in legs])
    for k in (0, 1):
        outward = hips[k] - hips[1 - k]
        outward = _unit(outward - outward @ down[k] * down[k])
        normal = np.cos(HIP_TILT) * down[k] + np.sin(HIP_TILT) * outward
        joints = [
            (fork, crotch, normal, 0.18 * fork),
            *(legs[k].joint(at, wide) for at, wide in ((knee, 0.4 * (knee - ankle)), (ankle, 0.4 * (knee - ankle)))),
        ]
        name = "left" if k == left_leg else "right"
        _lay(label, centres, leg_face[k], leg_face[k] < leg_face[1 - k], joints, [f"{name} {p}" for p in LEG])
        lateral = _unit(shoulders[k] - shoulders[1 - k])
        normal = _unit(arms[k].towards(armpit - 0.1 * reach, 0.1 * reach) + lateral)
        joints = [
            (armpit, shoulders[k], normal, 0.12 * armpit),
            *(arms[k].joint(at, wide) for at, wide in ((elbow, 0.4 * (elbow - wrist)), (wrist, 0.4 * (elbow - wrist)))),
        ]
        name = "left" if k == left_arm else "right"
        _lay(label, centres, arm_face[k], arm_face[k] < arm_face[1 - k], joints, [f"{name} {p}" for p in ARM])
    missing = sorted(set(range(len(PARTS))) - set(np.unique(label).tolist()))
    if missing:
        raise InputError(f"mesh: no {PARTS[missing[0]]} found; use a whole person with its limbs apart")
    return label


@dataclass(frozen=True)
class _Limb:
    """Level curves of the distance from a limb's end."""

    levels: F64
    girth: F64
    middle: F64

    def at(self, level: float) -> F64:
        known = np.isfinite(self.middle[:, 0])
        return np.stack([np.interp(level, self.levels[known], m) for m in self.middle[known].T])

    def towards(self, level: float, wide: float) -> F64:
        """Unit vector along the limb towards its end."""
        return _unit(self.at(level - wide) - self.at(level + wide))

    def joint(self, level: float, wide: float) -> tuple[float, F64, F64, float]:
        return level, self.at(level), self.towards(level, wide), wide


def _limb(surface: Surface, away: F64, length: float, within: NDArray[np.bool_]) -> _Limb:
    levels = np.linspace(0, length, LEVELS + 1)[1:]
    girth, middle = girths(surface, away, levels, within)
    return _Limb(levels, gaussian_filter1d(girth, 1.0), middle)


def _unit(v: F64) -> F64:
    return v / max(float(np.linalg.norm(v)), 1e-300)


def _narrowest(levels: F64, girth: F64, low: float, high: float) -> float:
    inside = np.flatnonzero((levels >= low) & (levels <= high))
    k = int(inside[girth[inside].argmin()])
    if k in (inside[0], inside[-1]):
        return float(levels[k])
    a, b, c = girth[k - 1 : k + 2]
    bend = a - 2 * b + c
    return float(levels[k] + (levels[1] - levels[0]) * (0.5 * (a - c) / bend if bend > 0 else 0))


def _armpit(levels: F64, girth: F64) -> float:
    """Where the girth leaves that of the arm: half to three quarters of the way to the breastbone is upper arm."""
    arm = np.median(girth[(levels > 0.5 * levels[-1]) & (levels < 0.66 * levels[-1])])
    wide = np.flatnonzero((girth > JUMP * arm) & (levels > 0.6 * levels[-1]))
    if len(wide) == 0:
        raise InputError("mesh: no shoulder found where an arm meets the chest; use a whole person with arms apart")
    k = int(wide[0])
    share = (JUMP * arm - girth[k - 1]) / max(girth[k] - girth[k - 1], 1e-300)
    return float(levels[k - 1] + np.clip(share, 0, 1) * (levels[k] - levels[k - 1]))


def _neck(
    surface: Surface, found: Ends, shoulders: F64, arms: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], F64, F64, F64]:
    """Faces that may be head or neck, a point of the neck's lower and upper cut, and the neck's unit axis, upward."""
    faces, centres = surface.faces, surface.centres
    root = shoulders.mean(axis=0)
    out = found.away[found.crown]
    out_face = out[faces].mean(axis=1)
    far = float(out[np.linalg.norm(surface.vertices - root, axis=1).argsort()[:50]].mean())
    skull = out_face < 0.5 * far
    axis = _unit(np.average(centres[skull], axis=0, weights=surface.areas[skull]) - root)
    within = ~arms & (out_face < 1.3 * far)
    height = (surface.vertices - root) @ axis
    top = float(height[found.crown])
    levels = np.linspace(0.0, top, LEVELS + 1)[1:-1]
    girth, middle = girths(surface, height, levels, within)
    girth = gaussian_filter1d(girth, 1.0)
    neck = _narrowest(levels, girth, 0.15 * top, 0.65 * top)
    k = int(np.abs(levels - neck).argmin())
    rise = np.flatnonzero((girth > JAW * girth[k]) & (levels > neck))
    fall = np.flatnonzero((girth > NAPE * girth[k]) & (levels < neck))
    high = int(rise[0]) if len(rise) else k
    low = int(fall[-1]) if len(fall) else k
    short = SHORTEST_NECK * girth[k] / np.pi / 2  # half of it, each way from the narrowest place
    low = min(low, int(np.searchsorted(levels, neck - short)))
    high = min(max(high, int(np.searchsorted(levels, neck + short))), len(levels) - 1)
    return within, middle[low], middle[high], axis


def _left(legs: list[_Limb], ankle: float, knee: float, hips: F64, toes: F64) -> float:
    """Above 0 where leg 0 is the left one: the shin upward, crossed with the way the foot points, points left."""
    vote = 0.0
    for leg, toe in zip(legs, toes, strict=True):
        shin = -leg.towards((ankle + knee) / 2, (knee - ankle) / 3)
        vote += float(np.cross(shin, toe - leg.at(ankle)) @ (hips[0] - hips[1]))
    return vote


def _lay(
    label: NDArray[np.int32],
    centres: F64,
    out: F64,
    mine: NDArray[np.bool_],
    joints: list[tuple[float, F64, F64, float]],
    names: list[str],
) -> None:
    """Label a limb's faces, from its root to its end: near a joint its plane says which side a face is on, away from
    it the distance along the skin."""
    for (level, point, normal, wide), name in zip(joints, names, strict=True):
        near = np.abs(out - level) < wide
        beyond = np.where(near, (centres - point) @ normal > 0, out < level)
        label[mine & beyond] = PARTS.index(name)
