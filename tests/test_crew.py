"""What threads share: every block is in one part, parts are even, and the quicker number of threads is taken."""

import numpy as np
import pytest

from taichi_cloth.sheet import LANES
from taichi_cloth.solvers.crew import PARTS, PERIOD, SIDES, TRIALS, Pace, parts_of, sides_of

RANDOM = np.random.Generator(np.random.Philox(7))
SHAPES = [(9, 8), (84, 96), (5, 24), (41, 40)]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_block_is_in_one_part_and_parts_are_even(shape: tuple[int, int]) -> None:
    present = RANDOM.random(shape) < 0.2
    blocks, cuts = parts_of(present, RANDOM.random(shape))
    held = np.flatnonzero(present.reshape(-1, LANES).any(axis=1))
    assert sorted(blocks.tolist()) == held.tolist()
    assert len(cuts) == PARTS + 1
    assert (cuts[0], cuts[-1]) == (0, len(blocks))
    assert np.ptp(np.diff(cuts)) <= 2  # a pair of blocks stays together, and a side is cut into whole blocks


def test_sides_are_ordered_and_no_cache_line_is_of_two() -> None:
    present = np.ones((12, 32), bool)
    across = np.broadcast_to(np.arange(32.0), (12, 32))
    blocks, cuts = parts_of(present, across)
    side = sides_of(blocks, cuts, present.size // LANES)
    assert np.array_equal(side.reshape(12, 4), np.broadcast_to([0, 0, 1, 1], (12, 4)))
    empty = parts_of(np.arange(32) < np.full((12, 1), 8), across)
    side = sides_of(*empty, present.size // LANES).reshape(12, 4)
    assert (side[:, 1:] == -1).all()
    assert set(side[:, 0]) == set(range(SIDES))


@pytest.mark.parametrize(("one", "two", "expected"), [(1.0, 0.6, 2), (1.0, 1.4, 1)])
def test_the_quicker_number_of_threads_is_taken_and_tried_again(one: float, two: float, expected: int) -> None:
    pace, taken = Pace(2), []
    for _ in range(2 * PERIOD):
        taken.append(pace.threads())
        pace.took(two if taken[-1] == 2 else one)
    assert taken[1 : TRIALS + 1] == taken[PERIOD + 1 : PERIOD + TRIALS + 1] == [1, 2] * (TRIALS // 2)
    assert set(taken[TRIALS + 1 : PERIOD]) == {expected}
