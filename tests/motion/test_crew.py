"""What threads share: every block is in one part, parts are even, and the quicker number of threads is taken."""

import numpy as np
import pytest

from taichi_cloth.motion.crew import PARTS, PERIOD, TRIALS, Pace, parts_of
from taichi_cloth.sheet.sheet import LANES

RANDOM = np.random.Generator(np.random.Philox(7))
SHAPES = [(9, 8), (84, 96), (5, 24), (41, 40)]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_block_is_in_one_part_and_parts_are_even(shape: tuple[int, int]) -> None:
    present = RANDOM.random(shape) < 0.2
    blocks, cuts = parts_of(present)
    held = np.flatnonzero(present.reshape(-1, LANES).any(axis=1))
    assert blocks.tolist() == held.tolist()
    assert len(cuts) == PARTS + 1
    assert (cuts[0], cuts[-1]) == (0, len(blocks))
    assert np.ptp(np.diff(cuts)) <= 1


@pytest.mark.parametrize(("one", "two", "expected"), [(1.0, 0.6, 2), (1.0, 1.4, 1)])
def test_the_quicker_number_of_threads_is_taken_and_tried_again(one: float, two: float, expected: int) -> None:
    pace, taken = Pace(2), []
    for _ in range(2 * PERIOD):
        taken.append(pace.threads())
        pace.took(two if taken[-1] == 2 else one)
    assert taken[1 : TRIALS + 1] == taken[PERIOD + 1 : PERIOD + TRIALS + 1] == [1, 2] * (TRIALS // 2)
    assert set(taken[TRIALS + 1 : PERIOD]) == {expected}
