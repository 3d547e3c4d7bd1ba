"""Pairs of boxes that overlap, by a tree that is gone down level by level, many pairs of a level at once.

Boxes may have more sides than six: what is cut off aslant as well is closer to what it holds.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["overlapping"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

BITS = 10
"""Of each axis in the order of the boxes along a curve that stays near (Morton 1966)."""

CHUNK = 1 << 15
"""Pairs at once: as many as a cache holds what is asked of them."""


def overlapping(low: F64, high: F64, among: NDArray[np.bool_] | None = None) -> I64:
    """(m, 2), first < second: all pairs of boxes (n, k) to (n, k) that have a point in common along each of k
    directions, of which the first are the three axes. among: (n,), boxes of which one at least is in each pair."""
    order = np.argsort(_along_curve(0.5 * (low + high)[:, :3]), kind="stable")
    pairs = np.zeros((2, 1), np.int64)
    levels = _levels(low[order], high[order], np.ones(len(low), bool) if among is None else among[order])
    for level in levels[1:]:
        apart, children = pairs[:, pairs[0] != pairs[1]], [pairs[:, :0]]
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            parents = apart if i > j else pairs
            for k in range(0, parents.shape[1], CHUNK):
                one, other = 2 * parents[:, k : k + CHUNK] + [[i], [j]]
                children.append(_meeting(one, other, *level))
        pairs = np.concatenate(children, axis=1)
    pairs = pairs[:, pairs[0] != pairs[1]]
    return np.sort(order[pairs.T], axis=1)


def _meeting(one: I64, other: I64, low: list[F64], high: list[F64], among: NDArray[np.bool_]) -> I64:
    """Those of pairs, (2, m), that overlap, and of which one is `among`. low, high: of boxes, along each direction."""
    some = np.flatnonzero(among[one] | among[other])
    one, other = one[some], other[some]
    for least, most in zip(low, high, strict=True):
        some = np.flatnonzero((least[one] <= most[other]) & (least[other] <= most[one]))
        one, other = one[some], other[some]
    return np.stack([one, other])


def _levels(low: F64, high: F64, among: NDArray[np.bool_]) -> list[tuple[list[F64], list[F64], NDArray[np.bool_]]]:
    """Boxes of the nodes of a binary tree, along each direction, and whether they have any `among`, from its root down
    to the boxes; empty ones fill up the last."""
    empty = (1 << max(0, len(low) - 1).bit_length()) - len(low)
    least = [np.concatenate([one, np.full(empty, np.inf)]) for one in low.T]
    most = [np.concatenate([one, np.full(empty, -np.inf)]) for one in high.T]
    among = np.concatenate([among, np.zeros(empty, bool)])
    out = [(least, most, among)]
    while len(among) > 1:
        least = [np.minimum(one[::2], one[1::2]) for one in least]
        most = [np.maximum(one[::2], one[1::2]) for one in most]
        among = among[::2] | among[1::2]
        out.append((least, most, among))
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
