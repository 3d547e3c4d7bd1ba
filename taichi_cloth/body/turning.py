"""Solids turned to a skin together, by Levenberg and Marquardt's method on the distances of their union."""

# SciPy and NumPy say less about their types than they do.
# pyright: reportArgumentType=false

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from taichi_cloth.body.distance import signed_distance
from taichi_cloth.body.samples import SkinSpace
from taichi_cloth.body.skin_field import SkinField
from taichi_cloth.body.slopes import distance_slopes, farthest_slopes
from taichi_cloth.body.solids import Solid, starts

__all__ = ["Piece", "Task", "ball", "cost_of", "nearest", "turn"]

F64 = NDArray[np.float64]
SCALE = 0.02
"""Beyond this distance [m] an error counts linearly: soft L1, so that single fingers do not pull a hand."""
OUT = 0.003
"""A solid's farthest points may be this far outside the skin [m] at no cost."""
_TURN = np.pi * (3 - np.sqrt(5)) * np.arange(60)
_UP = 1 - (2 * np.arange(60) + 1) / 60
DIRECTIONS = np.stack([np.sqrt(1 - _UP**2) * np.cos(_TURN), _UP, np.sqrt(1 - _UP**2) * np.sin(_TURN)], axis=-1)
"""Sixty unit vectors spread over the ball: Fibonacci's spiral."""


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


def _beyond(solid: Solid, skin: SkinField) -> F64:
    """How far a solid's farthest points in many directions are outside the skin [m], beyond what is allowed."""
    return np.maximum(skin(solid.farthest(DIRECTIONS)) - OUT, 0)


def _beyond_cost(solid: Solid, skin: SkinField) -> float:
    return float(cost_of(_beyond(solid, skin)).sum())


def ball(solid: Solid) -> tuple[F64, float]:
    """A ball that holds a solid: its middle (3,) and radius [m]."""
    p = solid.primitive
    if p is None:
        return np.full(3, 1e9), 0.0
    return (p.start + p.end) / 2, float(np.linalg.norm(p.end - p.start)) / 2 + max(p.radii)


def nearest(solids: Sequence[Solid], points: F64) -> tuple[F64, F64, NDArray[np.int64]]:
    """The least signed distance (n,) over all, its normal (n, 3), and whose it is (n,). Only those are asked whose ball
    may hold it."""
    made = [s.primitive for s in solids]
    middle, reach = (np.array(of) for of in zip(*map(ball, solids), strict=True))
    away = cdist(points, middle)
    most = (away + [0.0 if p is None else -min(p.radii) * (p.kind != "elliptic") for p in made]).min(axis=1)
    best, normal, whose = np.full(len(points), np.inf), np.zeros(points.shape), np.zeros(len(points), np.int64)
    for k, primitive in enumerate(made):
        if primitive is None:
            continue
        near = np.flatnonzero(away[:, k] - reach[k] <= most)
        distance, gradient = signed_distance(primitive, points[near])
        closer = distance < best[near]
        here = near[closer]
        best[here], normal[here], whose[here] = distance[closer], gradient[closer], k
    return best, normal, whose


def turn(pieces: list[Piece], task: Task, rounds: int, only: Sequence[int] | None = None) -> tuple[list[Piece], float]:
    """All solids, or those `only`, towards the least soft-L1 sum of the union's distances, a damping each: the best
    state met, and its cost."""
    space, skin = task.space, task.skin
    moving = range(len(pieces)) if only is None else only
    solids = [pieces[k].solid for k in moving]
    others = [p.solid for k, p in enumerate(pieces) if k not in moving]
    count, points = len(solids), space.at
    rest = nearest(others, points)[0] if others else np.full(len(points), np.inf)

    def asked(solids: list[Solid]) -> tuple[F64, F64, NDArray[np.int64]]:
        distance, normal, whose = nearest(solids, points)
        return np.minimum(distance, rest), normal, np.where(rest < distance, count, whose)

    damping = np.full(count, 1e-2)
    distance, normal, whose = asked(solids)
    error = space.error(distance)
    beyond = np.array([_beyond_cost(s, skin) for s in solids])
    always = sum(_beyond_cost(s, skin) for s in others)
    best, least = solids, float(cost_of(error).sum() + beyond.sum())
    for _ in range(rounds):
        trial = []
        for k, solid in enumerate(solids):
            mine = np.flatnonzero((whose == k) & (error != 0))
            if len(mine) < 4:
                trial.append(solid)
                continue
            far = solid.farthest(DIRECTIONS)
            said, rise = skin.slope(far)
            out = said > OUT
            slope = np.concatenate(
                [
                    distance_slopes(solid, points[mine], distance[mine], normal[mine]),
                    farthest_slopes(solid, far[out], DIRECTIONS[out], rise[out]),
                ]
            )
            wrong = np.concatenate([error[mine], said[out] - OUT])
            weight = 1 / np.sqrt(1 + (wrong / SCALE) ** 2)
            square = slope.T @ (weight[:, None] * slope)
            ridge = damping[k] * np.diag(square) + 1e-9 * np.trace(square) + 1e-12
            step = np.linalg.solve(square + np.diag(ridge), -slope.T @ (weight * wrong))
            moved = solid.moved(step)
            trial.append(moved if moved.primitive is not None else solid)
        new_distance, new_normal, new_whose = asked(trial)
        new_beyond = np.array([_beyond_cost(s, skin) for s in trial])
        before = np.bincount(whose, cost_of(error), count + 1)[:count] + beyond
        after = np.bincount(whose, cost_of(space.error(new_distance)), count + 1)[:count] + new_beyond
        better = after <= before
        damping = np.clip(np.where(better, damping / 3, damping * 5), 1e-7, 1e7)
        if not better.all():
            trial = [t if b else s for t, s, b in zip(trial, solids, better, strict=True)]
            new_distance, new_normal, new_whose = asked(trial)
        solids, distance, normal, whose = trial, new_distance, new_normal, new_whose
        error = space.error(distance)
        beyond = np.where(better, new_beyond, beyond)
        cost = float(cost_of(error).sum() + beyond.sum())
        gain = least - cost
        if gain > 0:
            best, least = solids, cost
        if 0 <= gain < 1e-6 * least and better.all():
            break
    out = list(pieces)
    for k, solid in zip(moving, best, strict=True):
        out[k] = replace(pieces[k], solid=solid)
    return out, least + always
