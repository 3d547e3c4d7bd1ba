"""A body's figure read off its skin: girths by tape, heights where sections split and are widest or narrowest."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.spatial import ConvexHull

from taichi_cloth.body.skin.sections import section_pieces
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.garment.pattern.measures import Figure, Limb, Section
from taichi_cloth.ground.errors import InputError

__all__ = ["figure_of"]

F64 = NDArray[np.float64]

STEP = 0.005  # between the heights that are looked at [m]


@lru_cache(maxsize=4)
def figure_of(body: Body) -> Figure:
    """What patterns need to know of a body at rest; the last few are remembered.

    Raises InputError on one without two arms and two legs apart.
    """
    skin = _Skin(body)
    tall = body.stature
    joints = dict(zip(body.skeleton.names, body.skeleton.joints, strict=True))
    shoulders = [joints[f"upper_arm_{side}"] for side in "lr"]
    top = float(np.mean([s[1] for s in shoulders]))
    crotch = skin.split(0.35 * tall, 0.56 * tall, 2, 0.12 * tall, "legs")
    underarm = skin.split(top - 0.16 * tall, top + 0.02, 3, tall, "arms")

    def trunk(y: float) -> F64:
        """(n, 2) x and z of the section through the trunk at a height."""
        return skin.middle(y)

    waist = _best(trunk, crotch + 0.09 * tall, underarm - 0.05 * tall, widest=False)
    hip = _best(trunk, crotch + 0.01, waist - 0.02 * tall, widest=True)
    chest = _best(trunk, waist + 0.05 * tall, underarm - 0.01, widest=True)
    neck_joint = joints["neck"]
    neck = _best(trunk, neck_joint[1], joints["head"][1], widest=False)
    girth = _girth(trunk(neck))
    tips = float(np.mean([abs(s[0]) for s in shoulders]))
    arms = [skin.limb(joints[f"upper_arm_{side}"], joints[f"forearm_{side}"]) for side in "lr"]
    legs = [skin.limb(joints[f"thigh_{side}"], joints[f"foot_{side}"]) for side in "lr"]
    return Figure(
        stature=tall,
        neck=girth,
        chest=_girth(trunk(chest)),
        waist=_girth(trunk(waist)),
        hip=_girth(trunk(hip)),
        upper_arm=skin.tape((arms[0].top + 2 * arms[0].bottom) / 3, arms[0].axis),
        thigh=skin.tape(np.array([legs[0].top[0], crotch - 0.03, legs[0].top[2]]), np.array([0.0, 1.0, 0.0])),
        shoulder=2 * tips + 0.04,  # the bone's tip lies outside the joint's middle
        neck_height=skin.top(girth / (2 * np.pi) + 0.012, neck_joint[1] + 0.03),
        shoulder_height=skin.top(tips, top + 0.12),
        underarm_height=underarm,
        waist_height=waist,
        hip_height=hip,
        crotch_height=crotch,
        sections={name: _section(trunk(y)) for name, y in (("chest", chest), ("waist", waist), ("hip", hip))},
        arms=(arms[0], arms[1]),
        legs=(legs[0], legs[1]),
    )


class _Skin:
    def __init__(self, body: Body) -> None:
        self.vertices, self.faces = body.vertices, body.faces

    def loops(self, point: F64, normal: F64) -> list[F64]:
        """Points (n, 3) of each piece of the section through a point, square to the normal; none that only grazes."""
        pieces = section_pieces(self.vertices, self.faces, point, normal)
        return [piece for piece in pieces if len(piece) >= 8]

    def level(self, y: float) -> list[F64]:
        return self.loops(np.array([0.0, y, 0.0]), np.array([0.0, 1.0, 0.0]))

    def middle(self, y: float) -> F64:
        """(n, 2) x and z of the largest piece on the middle plane at a height."""
        across = [p[:, [0, 2]] for p in self.level(y) if p[:, 0].min() < 0 < p[:, 0].max()]
        if not across:
            raise InputError(f"body: no trunk {y:.2f} m above the ground; allowed: a standing body")
        return max(across, key=_girth)

    def limb(self, top: F64, bottom: F64) -> Limb:
        axis = (top - bottom) / np.linalg.norm(top - bottom)
        reach = 0.0
        for share in np.arange(0.25, 0.85, 0.1):
            point = top + share * (bottom - top)
            off = self.round(point, axis) - point
            reach = max(reach, float(np.linalg.norm(off - np.outer(off @ axis, axis), axis=1).max()))
        return Limb(top, bottom, reach)

    def round(self, point: F64, axis: F64) -> F64:
        """(n, 3) of the section's piece round a point, square to an axis."""
        return min(self.loops(point, axis), key=lambda p: float(np.linalg.norm(p.mean(axis=0) - point)))

    def tape(self, point: F64, axis: F64) -> float:
        """Girth [m] of the limb round a point, square to its axis."""
        across = np.linalg.svd(axis[None])[2][1:]
        return _girth(self.round(point, axis) @ across.T)

    def split(self, low: float, high: float, pieces: int, reach: float, what: str) -> float:
        """The greatest height with that many pieces within `reach` of the middle plane [m]."""

        def count(y: float) -> int:
            return sum(abs(p[:, 0].mean()) < reach for p in self.level(y))

        found = [y for y in np.arange(low, high, STEP) if count(float(y)) >= pieces]
        if not found:
            raise InputError(f"body: no {what} apart from the trunk; allowed: a standing body, its {what} apart")
        return float(found[-1])

    def top(self, x: float, limit: float) -> float:
        """Height of the skin at ±x, below a limit."""
        near = (np.abs(np.abs(self.vertices[:, 0]) - x) < 0.008) & (self.vertices[:, 1] < limit)
        return float(self.vertices[near, 1].max())


def _girth(section: F64) -> float:
    """Length of a tape round a section (n, 2) [m]."""
    return float(ConvexHull(section).area)  # in two dimensions the "area" is the perimeter


def _best(trunk: Callable[[float], F64], low: float, high: float, *, widest: bool) -> float:
    heights = np.arange(low, max(high, low + STEP), STEP)
    # A section that only grazes the mesh's own rows of vertices loses pieces: one odd girth is no extreme.
    girths = median_filter([_girth(trunk(float(y))) for y in heights], 3, mode="nearest")
    return float(heights[int(np.argmax(girths) if widest else np.argmin(girths))])


def _section(points: F64) -> Section:
    low, high = points.min(axis=0), points.max(axis=0)
    return Section((high[0] - low[0]) / 2, (high[1] - low[1]) / 2, (high[1] + low[1]) / 2)
