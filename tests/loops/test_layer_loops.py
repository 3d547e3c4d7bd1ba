"""Cloth on cloth as parallel loops: what many threads list, against NumPy; layers, beside the kernel of one thread.
What devices make of it is in `test_devices.py`."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import taichi as ti
from device_cases import moved, sack, simulation, through
from scipy.sparse import csr_array

from taichi_cloth.ground import runtime
from taichi_cloth.layer_loops.places import GROUP, Lists, Places
from taichi_cloth.layers.tangles import Tangles
from taichi_cloth.motion import foresight
from taichi_cloth.motion.foresight import FEWEST, Foresight
from taichi_cloth.solvers.verlet import Verlet

RNG = np.random.Generator(np.random.Philox(key=31))
KEYS, ENTRIES = 90, 700


@ti.data_oriented
class Listing:
    def __init__(self) -> None:
        self.lists: Any = Lists(KEYS, ENTRIES)
        self.key = ti.field(ti.i32, ENTRIES)

    @ti.kernel
    def run(self):
        self.lists.clear()
        for k in range(ENTRIES):
            self.lists.count(self.key[k])
        self.lists.places.sum_up()
        for k in range(ENTRIES):
            self.lists.put(self.key[k], k)
        self.lists.sort()


@ti.data_oriented
class Summing:
    def __init__(self, room: int) -> None:
        self.count = ti.field(ti.i32, ())
        self.places: Any = Places(room, self.count)

    @ti.kernel
    def run(self):
        self.places.sum_up()


def test_entries_are_in_the_order_of_their_keys_and_then_their_own() -> None:
    one, keys = Listing(), RNG.integers(0, KEYS, ENTRIES).astype(np.int32)
    one.key.from_numpy(keys)
    for _ in range(2):
        one.run()
        assert one.lists.entry.to_numpy().tolist() == np.argsort(keys, kind="stable").tolist()
        assert one.lists.size.to_numpy().tolist() == np.bincount(keys, minlength=KEYS).tolist()


@pytest.mark.parametrize("count", [0, 1, GROUP, GROUP + 1, GROUP**2 + 5, GROUP**2 + 70])
def test_places_are_the_sums_of_all_before(count: int) -> None:
    """Of fewer than there is room for, beyond one block of groups."""
    one, found = Summing(GROUP**2 + 70), RNG.integers(0, 14, GROUP**2 + 70).astype(np.int32)
    one.places.of.from_numpy(found)
    one.count[None] = count
    one.run()
    assert one.places.of.to_numpy()[:count].tolist() == (np.cumsum(found) - found)[:count].tolist()
    assert one.places.total[None] == found[:count].sum()


def test_what_may_meet_is_told_and_a_garment_left_as_it_is() -> None:
    """The order of key points in its blends, by which places are summed, is that of the next simulation too."""
    outline, sheet = sack().outline, simulation("verlet, sack").sheet
    before = outline.blend.indices.copy()
    assert not csr_array(outline.blend).has_sorted_indices, "or this tells nothing"
    opened = Tangles(sheet, outline).open(np.zeros(sheet.shape, np.int32), np.ones((*sheet.shape, 3)))
    assert opened.all()
    np.testing.assert_array_equal(outline.blend.indices, before)


@pytest.mark.slow  # all of it is compiled
@pytest.mark.parametrize("case", ["verlet, layers", "verlet, sack"])
def test_layers_as_loops_do_what_the_kernel_does(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two panels thrown at each other, a sack that falls: nothing passes through anything, and they come to lie as the
    kernel has them."""
    if not runtime.on_host():
        pytest.skip("on a device there are only loops")
    kernel = moved(case, 8)[-1, ..., 1]
    monkeypatch.setattr(Verlet, "loops_from", 0)
    moving = simulation(case)
    for _ in range(8):
        moving.step()
        assert through(case, moving) == 0
        assert not moving.solver.let_off
    loops = moving.positions[..., 1]
    assert loops.min() == pytest.approx(kernel.min(), abs=1e-3)
    assert loops.mean() == pytest.approx(kernel.mean(), abs=1e-3)


@pytest.mark.slow  # the same kernels
def test_frames_that_are_foreseen_have_the_bytes_of_those_that_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sack that falls, of which a frame is foreseen as soon as one went as the one before: some go otherwise."""
    monkeypatch.setattr(Verlet, "loops_from", 0)
    found, start, told = [], Foresight.start, [0, 0]

    def counted(foresight: Foresight, *settings: float) -> None:
        told[1] += foresight.wrong
        start(foresight, *settings)
        told[0] += foresight.ahead

    monkeypatch.setattr(Foresight, "start", counted)
    for fewest in (1_000, 1):
        monkeypatch.setattr(foresight, "FEWEST", fewest)
        moving, states = simulation("verlet, sack"), []
        for _ in range(24):
            moving.step()
            states.append(moving.state.values.tobytes())
        found.append(states)
        assert fewest == 1 or told == [0, 0]
    assert found[0] == found[1]
    assert told[0] > told[1] > 0


def test_a_frame_is_foreseen_once_frames_go_alike_and_looked_at_once_at_its_end() -> None:
    """Three questions a frame; above 1 the answer asks for one more kernel. What matters is what was decided, not what
    was told."""
    one, frames = Foresight(), [[0.1, 0.2, k % 5 / 10] for k in range(FEWEST + 3)]
    frames += [[0.1, 2.0, 0.3]] + [[0.4, 3.0, 0.1]] * 2

    def gone_through(read: Callable[[int], tuple[float]]) -> list[tuple]:
        launched: list[tuple] = []
        for k in range(3):
            for what in ("look", "mend")[: 1 + (k > 0 and one.answer(read)[0] > 1)]:
                if one.decided(what, k):
                    launched.append((what, k))
        return launched

    asked, wrong = [], []
    for answers in frames:
        while True:
            waited: list[int] = []

            def read(row: int, answers: list = answers, waited: list = waited) -> tuple[float]:
                waited.append(row)
                return (answers[row],)

            one.start(7.0)
            launched = gone_through(read)
            asked.append(len(waited))
            if one.ahead:
                with one.repeated([(answer,) for answer in answers]):
                    assert not gone_through(read), "without kernels"
                assert not one.wrong or answers[1] > 1
            else:
                one.end(True)
            if not one.wrong:
                assert launched == [("look", k) for k in range(3)] + [("mend", 2)] * (answers[1] > 1)
                break
            wrong.append(answers)
    assert asked == [2] * (FEWEST + 1) + [0, 0] + [0, 2, 2, 2]
    assert wrong == [frames[FEWEST + 3]]
