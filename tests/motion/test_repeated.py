"""A kernel that is called again and again with the same arrays does what Taichi's own calls of it do."""

import numpy as np
import pytest
import taichi as ti

from taichi_cloth.ground.arrays import F32x1, Float, Int, Template
from taichi_cloth.motion.repeated import Repeated
from taichi_cloth.sheet.sheet import SheetState


@ti.data_oriented
class Sums:
    def __init__(self) -> None:
        self.calls = ti.field(ti.i32, ())

    @ti.kernel
    def add(self, values: F32x1, scale: Float, twice: Template, times: Int) -> Int:
        ti.loop_config(serialize=True)
        for k in range(values.shape[0]):
            values[k] = values[k] + scale * times * (2 if ti.static(twice) else 1)
        self.calls[None] = self.calls[None] + 1
        return times + 1


def prepared_otherwise(self: Repeated) -> None:
    raise AttributeError("make_launch_context")


@pytest.mark.parametrize("known", [True, False])
def test_numbers_change_from_call_to_call_and_arrays_do_not(known: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of a Taichi whose inner calls are not known."""
    if not known:
        monkeypatch.setattr(Repeated, "_prepare", prepared_otherwise)
    one, other, values, wanted = Sums(), Sums(), np.arange(5, dtype=np.float32), np.arange(5, dtype=np.float32)
    add = Repeated(one.add, values, 0.5, True, 0)
    for scale, times in ((0.5, 3), (0.25, 7), (0.25, -2)):
        assert add(times=times, scale=scale) == times + 1
        other.add(wanted, scale, True, times)  # pyright: ignore[reportCallIssue]
    np.testing.assert_array_equal(values, wanted)
    assert one.calls[None] == 3


def test_an_array_in_pieces_is_refused() -> None:
    with pytest.raises(AssertionError, match="values: an array that does not lie in one piece"):
        Repeated(Sums().add, np.zeros(6, np.float32)[::2], 1.0, False, 1)()


def test_a_state_in_a_row_is_the_state() -> None:
    state = SheetState(np.zeros((6, 2, 8), np.float32))
    state.in_a_row[17] = 3.0
    assert state.values[1, 0, 1] == 3.0
    with pytest.raises(AttributeError):
        _ = SheetState(state.values[:, :, :4]).in_a_row
