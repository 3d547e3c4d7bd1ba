"""Solids turned to a skin together, by Levenberg and Marquardt's method on the distances of their union."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from taichi_cloth.body.primitives.distance import signed_distance
from taichi_cloth.body.primitives.samples import SkinSpace
from taichi_cloth.body.primitives.skin_field import SkinField
from taichi_cloth.body.primitives.slopes import distance_slopes, farthest_slopes
from taichi_cloth.body.primitives.solids import Solid, starts

__all__ = ["Piece", "Task", "cost_of", "nearest", "turn"]

F64 = NDArray[np.float64]
SCALE = 0.02
"""Beyond this distance [m] an error counts linearly: soft L1, so that single fingers do not pull a hand."""
OUT = 0.003
"""A solid's farthest points may be this far outside the skin [m] at no cost."""
_TURN = np.pi * (3 - np.sqrt(5)) * np.arange(60)
_UP = 1 - (2 * np.arange(60) + 1) / 60
DIRECTIONS = np.stack([np.sqrt(1 - _UP**2) * np.cos(_TURN), _UP, np.sqrt(1 - _UP**2) * np.sin(_TURN)], axis=-1)
"""Sixty unit vectors spread over the ball: Fibonacci's spiral."""
NOWHERE = np.full(3, 1e9), 0.0
"""Middle and radius [m] of the ball round what is no solid."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A solid and the part it is of; twin: there is another, its image in the body's plane of symmetry."""

    solid: Solid
    part: str
    twin: bool = False


@dataclass(frozen=True, eq=False)
class Task:
    """What is fitted: the points, the field they are from, and the plane of symmetry of which they fill one side."""

    space: SkinSpace
    skin: SkinField
    mirror: tuple[F64, float] | None

    def starts(self, points: F64, free: bool) -> list[Solid]:
        """Solids to begin a fit to points (n, 3) of the skin from. free: they may leave the plane of symmetry."""
        if self.mirror is None or free:
            return starts(points)
        normal, level = self.mirror
        image = points - 2 * (points @ normal - level)[:, None] * normal
        return [s for t in starts(np.concatenate([points, image])) if (s := t.on_plane(normal, level))]


def cost_of(distance: F64) -> F64:
    """What errors (n,) [m] cost, soft L1: their square where small, linear beyond SCALE; shape (n,) [m²]."""
    return 2 * SCALE**2 * (np.sqrt(1 + (distance / SCALE) ** 2) - 1)


class _Asked:
    """What is known of a solid at points (n, 3), each asked once at most, and of where it is outside the skin."""

    def __init__(self, solid: Solid, points: F64, skin: SkinField | None) -> None:
        self.solid, self.points = solid, points
        self.known = np.zeros(len(points), bool)
        self.distance, self.normal = np.empty(len(points)), np.empty(points.shape)
        if skin is not None:
            far = solid.farthest(DIRECTIONS)
            said, rise = skin.slope(far)
            out = said > OUT
            self.far, self.towards, self.rise, self.beyond = far[out], DIRECTIONS[out], rise[out], said[out] - OUT
            self.beyond_cost = float(cost_of(self.beyond).sum())

    def at(self, near: NDArray[np.int64]) -> F64:
        """Signed distance [m] of some of the points, by number."""
        primitive = self.solid.primitive
        assert primitive is not None
        new = near[~self.known[near]]
        if len(new):
            self.distance[new], self.normal[new] = signed_distance(primitive, self.points[new])
            self.known[new] = True
        return self.distance[near]

    def step(self, error: F64, mine: NDArray[np.int64], damping: float) -> F64:
        """Of the solid's numbers, to where errors (n,) [m] at points `mine`, and those outside the skin, cost less."""
        slope = np.concatenate(
            [
                distance_slopes(self.solid, self.points[mine], self.distance[mine], self.normal[mine]),
                farthest_slopes(self.solid, self.far, self.towards, self.rise),
            ]
        )
        wrong = np.concatenate([error[mine], self.beyond])
        weight = 1 / np.sqrt(1 + (wrong / SCALE) ** 2)
        square = slope.T @ (weight[:, None] * slope)
        ridge = damping * np.diag(square) + 1e-9 * np.trace(square) + 1e-12
        return np.linalg.solve(square + np.diag(ridge), -slope.T @ (weight * wrong))  # pyright: ignore[reportReturnType]


def nearest(solids: Sequence[Solid], points: F64) -> tuple[F64, NDArray[np.int64]]:
    """The least signed distance (n,) [m] of points (n, 3) [m] over all solids, and whose it is (n,)."""
    return _nearest([_Asked(s, points, None) for s in solids], points)


def _nearest(asked: Sequence[_Asked], points: F64) -> tuple[F64, NDArray[np.int64]]:
    """Only those are asked whose ball may hold a point's nearest."""
    made = [a.solid.primitive for a in asked]
    middle, reach = (np.array(of) for of in zip(*(p.ball if p else NOWHERE for p in made), strict=True))
    away = cdist(points, middle)
    most = (away + [0.0 if p is None else -min(p.radii) * (p.kind != "elliptic") for p in made]).min(axis=1)
    best, whose = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    for k, primitive in enumerate(made):
        if primitive is None:
            continue
        near = np.flatnonzero(away[:, k] - reach[k] <= most)
        distance = asked[k].at(near)
        closer = distance < best[near]
        best[near[closer]], whose[near[closer]] = distance[closer], k
    return best, whose


def turn(pieces: list[Piece], task: Task, rounds: int, only: Sequence[int] | None = None) -> tuple[list[Piece], float]:
    """All solids, or those `only`, towards the least soft-L1 sum of the union's distances, a damping each: the best
    state met, and its cost."""
    space, skin = task.space, task.skin
    moving = range(len(pieces)) if only is None else only
    others = [_Asked(p.solid, space.at, skin) for k, p in enumerate(pieces) if k not in moving]
    rest = _nearest(others, space.at)[0] if others else np.full(len(space.at), np.inf)
    always = sum(a.beyond_cost for a in others)
    solids = [_Asked(pieces[k].solid, space.at, skin) for k in moving]
    count = len(solids)
    damping = np.full(count, 1e-2)

    def errors(solids: list[_Asked]) -> tuple[F64, NDArray[np.int64]]:
        """Of the union at all points (n,) [m], and whose each is (n,): `count` for those that stand still."""
        distance, whose = _nearest(solids, space.at)
        return space.error(np.minimum(distance, rest)), np.where(rest < distance, count, whose)

    def costs(solids: list[_Asked], error: F64, whose: NDArray[np.int64]) -> F64:
        """What each solid answers for, and last those that stand still (count + 1,)."""
        return np.bincount(whose, cost_of(error), count + 1) + np.array([*(a.beyond_cost for a in solids), always])  # pyright: ignore[reportReturnType]

    error, whose = errors(solids)
    before = costs(solids, error, whose)
    best, least = solids, float(before.sum())
    for _ in range(rounds):
        trial = []
        for k, one in enumerate(solids):
            mine = np.flatnonzero((whose == k) & (error != 0))
            moved = one.solid if len(mine) < 4 else one.solid.moved(one.step(error, mine, damping[k]))
            trial.append(one if len(mine) < 4 or moved.primitive is None else _Asked(moved, space.at, skin))
        new_error, new_whose = errors(trial)
        better = (costs(trial, new_error, whose) <= before)[:count]  # of the points that were its own
        damping = np.clip(np.where(better, damping / 3, damping * 5), 1e-7, 1e7)
        if not better.all():
            trial = [t if b else s for t, s, b in zip(trial, solids, better, strict=True)]
            new_error, new_whose = errors(trial)
        solids, error, whose = trial, new_error, new_whose
        before = costs(solids, error, whose)
        gain = least - float(before.sum())
        if gain > 0:
            best, least = solids, least - gain
        if 0 <= gain < 1e-6 * least and better.all():
            break
    out = list(pieces)
    for k, one in zip(moving, best, strict=True):
        out[k] = replace(pieces[k], solid=one.solid)
    return out, least
