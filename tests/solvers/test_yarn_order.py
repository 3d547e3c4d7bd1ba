import numpy as np
import pytest

from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.yarn_order import DELAY, GROUPS, yarn_order

HIGH, WIDE = 3, 4  # tiles
WIDTH = WIDE * LANES


def packets(empty: bool) -> np.ndarray:
    there = np.ones((HIGH, LANES, WIDE), bool)
    if empty:
        there[1, 3:, 2] = there[0, :, 0] = False
    return there


@pytest.mark.parametrize("empty", [False, True])
def test_each_family_meets_every_packet_once_and_its_neighbours_no_further_on_than_the_lag(empty: bool) -> None:
    there = packets(empty)
    offsets = [1, WIDTH, WIDTH + 1, WIDTH - 1]
    order = yarn_order(there, offsets)
    full = np.flatnonzero(there)
    for family, offset in enumerate(offsets):
        met = []
        for group in range(family * GROUPS, (family + 1) * GROUPS):
            own = order.packets[order.begins[group] :][: order.counts[group]].tolist()
            met += own
            for at, packet in enumerate(own):
                for lane in range(LANES):
                    other = (packet * LANES + lane + offset) // LANES
                    assert other not in own or own.index(other) - at <= order.lags[group]
        assert sorted(met) == full.tolist()


def test_between_lists_stand_packets_without_key_points_for_what_reads_ahead() -> None:
    order = yarn_order(packets(True), [1, WIDTH])
    inside = np.zeros(len(order.packets), bool)
    for begin, count in zip(order.begins, order.counts, strict=True):
        inside[begin : begin + count] = True
        for edge in (slice(begin - max(order.lags) - DELAY, begin), slice(begin + count, begin + count + DELAY)):
            assert not order.packets[edge].any()
    assert not order.packets[~inside].any()
    assert len(order.packets) >= max(order.begins) + order.counts[-1] + max(order.lags) + DELAY


def test_the_last_packet_of_a_tile_closes_it() -> None:
    there = packets(True)
    order = yarn_order(there, [1, WIDTH])
    tiles = list(zip(order.tile.tolist(), order.column.tolist(), strict=True))
    assert sorted(tiles) == list(zip(*map(list, np.nonzero(there.any(axis=1))), strict=True))
    left = {tile: int(there[tile[0], :, tile[1]].sum()) for tile in tiles}
    for group in range(GROUPS):
        for at in range(order.begins[group], order.begins[group] + order.counts[group]):
            row, column = divmod(int(order.packets[at]), WIDE)
            left[row // LANES, column] -= 1
            closes = tiles[order.closes[at]] if order.closes[at] >= 0 else None
            assert closes == (None if left[row // LANES, column] else (row // LANES, column))
    assert not any(left.values())
