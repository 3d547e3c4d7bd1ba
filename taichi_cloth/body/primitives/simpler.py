"""The simpler of two kinds of primitive where both stand for the skin as well: a sphere has 4 numbers, a cylinder 8, an
elliptic cylinder 10 (half as many places off the plane of symmetry), and each number has to earn its keep.

"As well" is by the information criterion (Schwarz 1978, "Estimating the dimension of a model"): of models with cost C
over n points and k numbers the one with the least n ln C + k ln n.
"""

from dataclasses import replace

import numpy as np

from taichi_cloth.body.primitives.primitives import PrimitiveKind
from taichi_cloth.body.primitives.turning import Piece, Task, nearest, turn

__all__ = ["simpler"]

KINDS: tuple[PrimitiveKind, ...] = ("sphere", "cylinder", "elliptic")
"""From simple to not."""
FEWEST = 8
"""Points of the skin that a solid is begun from."""
HOPELESS = 1.2
"""Where another kind, turned by itself, raises the cost by more than this its neighbours are not turned to help."""


def simpler(pieces: list[Piece], task: Task) -> list[Piece]:
    """The pieces, those of a simpler kind that lose nothing by it by the criterion; those that gain most first."""
    points = int((task.space.side == 0).sum())
    pieces, cost = turn(pieces, task, 40)

    def change(k: int, kind: PrimitiveKind) -> tuple[float, list[Piece], float]:
        trial, new = _of_kind(kind, k, pieces, task, HOPELESS * cost)
        spared = pieces[k].solid.freedom - trial[k].solid.freedom
        return points * (np.log(cost) - np.log(new)) + spared * np.log(points), trial, new

    gains = {(k, kind): change(k, kind)[0] for k, p in enumerate(pieces) for kind in _before(p.solid.kind)}
    for k, kind in sorted((key for key, gain in gains.items() if gain > 0), key=lambda key: -gains[key]):
        if kind in _before(pieces[k].solid.kind):
            gain, trial, new = change(k, kind)  # those round it may have changed
            if gain > 0:
                pieces, cost = trial, new
    return pieces


def _before(kind: PrimitiveKind) -> tuple[PrimitiveKind, ...]:
    return KINDS[: KINDS.index(kind)]


def _of_kind(kind: PrimitiveKind, k: int, pieces: list[Piece], task: Task, most: float) -> tuple[list[Piece], float]:
    """The pieces with another kind in place k, turned with what it touches, and the cost; infinite above `most`."""
    whose = nearest([p.solid for p in pieces], task.space.at)[1]
    mine = task.space.at[(whose == k) & (task.space.side == 0)]
    begun = [s for s in task.starts(mine, pieces[k].twin) if s.kind == kind] if len(mine) >= FEWEST else []
    tried = [turn([*pieces[:k], replace(pieces[k], solid=s), *pieces[k + 1 :]], task, 6, [k]) for s in begun]
    trial, cost = min(tried, key=lambda t: t[1], default=(pieces, np.inf))
    return turn(trial, task, 10, _touched(k, trial)) if cost < most else (pieces, np.inf)


def _touched(k: int, pieces: list[Piece]) -> list[int]:
    """Which pieces' balls meet that of piece k, itself among them."""
    made = [p.solid.primitive for p in pieces]
    mine = made[k]
    assert mine is not None
    return [j for j, other in enumerate(made) if other is not None and mine.meets(other)]
