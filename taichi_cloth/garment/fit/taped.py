"""Landmarks read off a body's skin: its arms cut off by their weights first, so that a T pose's chest is no three
metres round."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.spatial import ConvexHull, QhullError

from taichi_cloth.body.skin.sections import section_pieces
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.ground.errors import InputError

__all__ = ["ARMS", "landmarks_of"]

F64 = NDArray[np.float64]

ARMS = ("upper_arm", "forearm", "hand")
STEP = 0.005
"""Between the heights that are looked at [m]."""
ANKLES = 0.07
"""Of the lowest tape round both legs, in statures: feet lie below."""
HIP = 0.03, 0.07
"""Where the hip is looked for, over the crotch, in statures: below, the widest girth is that of the thighs' tops."""


@lru_cache(maxsize=4)
def landmarks_of(body: Body) -> Landmarks:
    """Raises InputError on a body without legs apart or without a trunk."""
    skin = _Skin(body)
    joints, tall = skin.joints, body.stature
    underarm = skin.underarm()
    crotch = skin.crotch()
    waist = skin.extreme(crotch + 0.11 * tall, underarm - 0.06 * tall, widest=False)
    hip = skin.extreme(crotch + 0.02, waist - 0.04 * tall, widest=True)
    hip = float(np.clip(hip, crotch + HIP[0] * tall, crotch + HIP[1] * tall))
    bust = skin.extreme(waist + 0.06 * tall, underarm - 0.005, widest=True)
    neck = skin.extreme(float(joints["neck"][1]), float(joints["head"][1]), widest=False)
    head = skin.extreme(neck + 0.035 * tall, 0.97 * tall, widest=True)
    round_neck = _tape(skin.trunk(neck))
    tips = float(np.mean([abs(joints[f"upper_arm_{side}"][0]) for side in "lr"]))
    underbust = 0.45 * waist + 0.55 * bust
    height = {
        "floor": 0.0,
        "knee": float(joints["shin_l"][1]),
        "crotch": crotch,
        "hip": hip,
        "waist": waist,
        "underbust": underbust,
        "bust": bust,
        "underarm": underarm,
        "shoulder": skin.top(tips, tall),
        "neck": skin.top(round_neck / (2 * np.pi) + 0.007 * tall, float(joints["neck"][1]) + 0.018 * tall),
        "top": tall,
    }
    level = {name: skin.trunk(height[name]) for name in ("hip", "waist", "underbust", "bust")}
    level |= {"neck": skin.trunk(neck), "head": skin.trunk(head)}
    arm = np.array([joints[f"{name}_l"] for name in ARMS])
    leg = np.array([joints[f"{name}_l"] for name in ("thigh", "shin", "foot")])
    girth = {name: _tape(points) for name, points in level.items()}
    girth["upper_arm"] = skin.limb(0.4 * arm[0] + 0.6 * arm[1], arm[1] - arm[0])
    girth["wrist"] = skin.limb(arm[2] + 0.04 * (arm[1] - arm[2]), arm[2] - arm[1])
    girth["thigh"] = skin.limb(np.array([leg[0, 0], crotch - 0.018 * tall, leg[0, 2]]), np.array([0.0, 1.0, 0.0]))
    girth["knee"] = skin.limb(leg[1], leg[2] - leg[0])
    girth["ankle"] = skin.limb(leg[2] + 0.06 * (leg[1] - leg[2]), leg[2] - leg[1])
    depth = {
        "top" if name == "head" else name: (float(p[:, 1].max()), float(p[:, 1].min())) for name, p in level.items()
    }
    rings = []
    for y in np.arange(ANKLES * tall, height["shoulder"], 2 * STEP):
        p = skin.trunk(float(y)) if y > crotch + STEP else np.concatenate(skin.level(float(y)))[:, [0, 2]]
        low, high = p.min(axis=0), p.max(axis=0)
        rings.append([y, _tape(p), (high[0] - low[0]) / 2, (high[1] - low[1]) / 2, (high[1] + low[1]) / 2])
    return Landmarks(height, girth, depth, 2 * tips, arm, leg, np.array(rings))


class _Skin:
    def __init__(self, body: Body) -> None:
        self.vertices, self.faces, self.tall = body.vertices, body.faces, body.stature
        names = body.skeleton.names
        self.joints = dict(zip(names, body.skeleton.joints, strict=True))
        of_arms = [k for k, name in enumerate(names) if name.startswith(ARMS)]
        self.arm = np.isin(np.argmax(body.weights, axis=1), of_arms)
        self.without_arms = self.faces[~self.arm[self.faces].any(axis=1)]

    def level(self, y: float) -> list[F64]:
        """(n, 3) of each piece of the section at a height, arms apart, but for what only grazes."""
        pieces = section_pieces(self.vertices, self.without_arms, np.array([0, y, 0.0]), np.array([0, 1.0, 0]))
        return [piece for piece in pieces if len(piece) >= 8]

    def trunk(self, y: float) -> F64:
        """(n, 2) x and z of what lies on the middle plane at a height."""
        pieces = [p[:, [0, 2]] for p in self.level(y) if p[:, 0].min() < 0.01 and p[:, 0].max() > -0.01]
        if not pieces:
            raise InputError(f"body: no trunk {y:.2f} m above the ground; allowed: a standing body")
        return np.concatenate(pieces)

    def underarm(self) -> float:
        """Height of the lowest skin between trunk and arms, or where those stand apart [m]."""
        of_arm = self.arm[self.faces]
        rim = self.faces[of_arm.any(axis=1) & ~of_arm.all(axis=1)]
        ring = self.vertices[np.unique(rim)]
        sides = [ring[ring[:, 0] * side > 0][:, 1] for side in (1.0, -1.0)]
        if not all(len(side) for side in sides):
            raise InputError("body: no arms; allowed: a standing body with two arms")
        found = float(np.mean([side.min() for side in sides]))
        shoulder = float(self.joints["upper_arm_l"][1])
        for y in np.arange(shoulder, found, -STEP):  # weights of a stout body's arms begin on its chest
            pieces = section_pieces(self.vertices, self.faces, np.array([0, y, 0.0]), np.array([0, 1.0, 0]))
            if sum(len(p) >= 8 for p in pieces) >= 3:
                return float(y)
        return found

    def crotch(self) -> float:
        heights = np.arange(0.3 * self.tall, 0.56 * self.tall, STEP)
        apart = [y for y in heights if sum(abs(p[:, 0].mean()) < 0.12 * self.tall for p in self.level(float(y))) >= 2]
        if not apart:
            raise InputError("body: no legs apart from each other; allowed: a standing body, its legs apart")
        return float(apart[-1])

    def extreme(self, low: float, high: float, *, widest: bool) -> float:
        """The height between two at which the trunk is widest or narrowest [m]."""
        heights = np.arange(low, max(high, low + STEP), STEP)
        girths = median_filter([_tape(self.trunk(float(y))) for y in heights], 3, mode="nearest")
        return float(heights[int(np.argmax(girths) if widest else np.argmin(girths))])

    def top(self, x: float, limit: float) -> float:
        """Height of the skin at ±x in the plane of the neck, below a limit [m]."""
        v = self.vertices
        there = (np.abs(np.abs(v[:, 0]) - x) < 0.005 * self.tall) & (v[:, 1] < limit)
        there &= np.abs(v[:, 2] - self.joints["neck"][2]) < 0.05 * self.tall
        if not there.any():
            raise InputError("body: no shoulders beside its neck; allowed: a standing body")
        return float(v[there, 1].max())

    def limb(self, point: F64, way: F64) -> float:
        """Girth of a limb round a point, square to a direction [m]."""
        way = way / np.linalg.norm(way)
        across = np.linalg.svd(way[None])[2][1:]
        pieces = [p for p in section_pieces(self.vertices, self.faces, point, way) if len(p) >= 8]
        if not pieces:
            raise InputError("body: a limb without skin; allowed: a standing body with two arms and two legs")
        return _tape(min(pieces, key=lambda p: float(np.linalg.norm(p.mean(axis=0) - point))) @ across.T)


def _tape(points: F64) -> float:
    """Length of a tape round a section (n, 2) [m]."""
    try:
        return float(ConvexHull(points).area)  # in two dimensions the "area" is the perimeter
    except QhullError:
        return 0.0
