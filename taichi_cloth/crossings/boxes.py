"""Pairs of boxes that overlap, by a tree that is gone down level by level, all pairs of a level at once."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["overlapping"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

BITS = 10
"""Of each axis in the order of the boxes along a curve that stays near (Morton 1966)."""


def overlapping(low: F64, high: F64) -> I64:
    """(m, 2), first < second: all pairs of boxes (n, 3) to (n, 3) that have a point in common."""
    order = np.argsort(_along_curve(0.5 * (low + high)), kind="stable")
    levels = _levels(low[order], high[order])
    pairs = np.zeros((1, 2), np.int64)
    for low_here, high_here in levels[1:]:
        one, other = pairs.T
        children = np.concatenate([2 * pairs + [i, j] for i in (0, 1) for j in (0, 1)])
        twice = np.concatenate([one == other] * 4) & (children[:, 0] > children[:, 1])
        children = children[~twice]
        first, second = children.T
        meet = np.ones(len(children), bool)
        for axis in range(3):
            meet &= low_here[first, axis] <= high_here[second, axis]
            meet &= low_here[second, axis] <= high_here[first, axis]
        pairs = children[meet]
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return np.sort(order[pairs], axis=1)


def _levels(low: F64, high: F64) -> list[tuple[F64, F64]]:
    """Boxes of the nodes of a binary tree, from its root down to the boxes; empty ones fill up the last."""
    count = 1 << max(0, len(low) - 1).bit_length()
    empty = count - len(low)
    level = (
        np.concatenate([low, np.full((empty, 3), np.inf)]),
        np.concatenate([high, np.full((empty, 3), -np.inf)]),
    )
    out = [level]
    while len(level[0]) > 1:
        level = np.minimum(level[0][::2], level[0][1::2]), np.maximum(level[1][::2], level[1][1::2])
        out.append(level)
    return out[::-1]


def _along_curve(points: F64) -> I64:
    """A number of each point, (n,): near numbers are near points."""
    span = np.ptp(points, axis=0)
    cell = np.where(span > 0, (points - points.min(axis=0)) / np.where(span > 0, span, 1.0), 0.0)
    steps = np.minimum((cell * 2**BITS).astype(np.int64), 2**BITS - 1)
    out = np.zeros(len(points), np.int64)
    for bit in range(BITS):
        for axis in range(3):
            out |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return out
