"""In what order whole yarns are gone through: lists of packets, one for each group of yarns of each family.

A family is cut into groups that share nothing, so that threads of the processor can each take some. The lists stand one
after the other, and between them packets that hold no key point: what reads ahead of a list, or behind it, meets those.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.sheet.sheet import LANES

__all__ = ["DELAY", "GROUPS", "YarnOrder", "yarn_order"]

DELAY = 8
"""Packets between what stores and what reads across them: a processor waits for stores of another width."""

GROUPS = 4
"""Into which the yarns of a family are cut: they share nothing, so that threads of the processor can each take some."""


@dataclass(frozen=True)
class YarnOrder:
    """packets: numbers of packets, list after list. closes: of each of them, the tile of family 0 that it is the last
    of, or −1. begins, counts, lags: [family × GROUPS + group], where a list begins, how long it is, and how many
    packets on from any the last is that it has neighbours in. tile, column: of each tile, its row and column, in
    tiles."""

    packets: NDArray[np.int64]
    closes: NDArray[np.int64]
    begins: list[int]
    counts: list[int]
    lags: list[int]
    tile: NDArray[np.int64]
    column: NDArray[np.int64]


def yarn_order(packets: NDArray[np.bool_], offsets: list[int]) -> YarnOrder:
    """packets: (rows of tiles, LANES, columns of tiles), whether they hold key points. offsets: of each family,
    elements of the padded grid from one key point of a yarn to the next; first that of the yarns along the rows."""
    lists, closes, tile, column = _lists(packets, len(offsets))
    lags = [_reach(one, far, packets.size * LANES) for one, far in zip(lists, np.repeat(offsets, GROUPS), strict=True)]
    # One after the other, what two families share but once.
    margin, begins, pieces, at = max(lags) + DELAY, [], [], 0
    for one in lists:
        begins.append(at + margin)
        pieces += [np.zeros(margin, int), one]
        at += margin + len(one)
    order = np.concatenate([*pieces, np.zeros(margin, int)])
    closing = np.full(len(order), -1)
    for begin, one in zip(begins[:GROUPS], closes, strict=True):
        closing[begin : begin + len(one)] = one
    return YarnOrder(order, closing, begins, [len(one) for one in lists], lags, tile, column)


def _lists(
    packets: NDArray[np.bool_], families: int
) -> tuple[list[NDArray], list[NDArray], NDArray[np.int64], NDArray[np.int64]]:
    """For each family, a list of packets' numbers for each of its groups; for those of the first family which tile each
    closes, or −1; and row and column of each tile, in tiles. packets: (rows of tiles, LANES, columns of tiles), whether
    they hold key points."""
    high, _, wide = packets.shape
    by_tiles, closes, tiles, columns, known = [], [], [], [], 0
    for low, top in _shared_out(packets.sum(axis=(1, 2))):
        column, tile, row = np.nonzero(packets[low:top].transpose(2, 0, 1))
        last = np.append(np.diff(column * high + tile) != 0, True)[: len(tile)]
        by_tiles.append(((tile + low) * LANES + row) * wide + column)
        closes.append(np.where(last, known + np.cumsum(last) - 1, -1))
        tiles.append(tile[last] + low)
        columns.append(column[last])
        known += int(last.sum())
    row, column = np.nonzero(packets.reshape(high * LANES, wide))
    by_rows = [
        (row * wide + column)[(low <= column) & (column < top)] for low, top in _shared_out(packets.sum(axis=(0, 1)))
    ]
    chains = [row * wide + column, *[np.zeros(0, int)] * (GROUPS - 1)] * (families - 2)  # they cross all columns
    return [*by_tiles, *by_rows, *chains], closes, np.concatenate(tiles), np.concatenate(columns)


def _shared_out(counts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """GROUPS slices of about as many in all."""
    cuts = np.searchsorted(np.cumsum(counts), counts.sum() * np.arange(1, GROUPS) / GROUPS) + 1
    bounds = [0, *np.minimum(cuts, len(counts)).tolist(), len(counts)]
    return list(pairwise(bounds))


def _reach(order: NDArray, offset: int, size: int) -> int:
    """How many packets further in an order the neighbours of one may lie, at `offset` elements from its lanes. order:
    packets' numbers in a grid of `size` elements."""
    number = np.full(size // LANES + 2, -1)
    number[order] = np.arange(len(order))
    most = 0
    for lane in (0, LANES - 1):
        at = number[np.clip((order * LANES + lane + offset) // LANES, 0, size // LANES)]
        most = max(most, int((at - np.arange(len(order)))[at >= 0].max(initial=0)))
    return most
