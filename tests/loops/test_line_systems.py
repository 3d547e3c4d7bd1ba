"""Tridiagonal systems in pieces against NumPy's solution of the whole; loops against the kernel of threads."""

from typing import Any

import numpy as np
import pytest
import taichi as ti
from device_cases import WITHIN, moved

from taichi_cloth.ground import runtime
from taichi_cloth.loops.line_systems import PIECE, LineSystems
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

RNG = np.random.Generator(np.random.Philox(key=30))


class Systems:
    """As much of `WholeYarns` as systems need."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.beside, self.pivot, self.change, self.right, self.diagonal, self.coupling = (
            ti.field(ti.f32, size) for _ in range(6)
        )


@ti.data_oriented
class Solved:
    def __init__(self, system: LineSystems) -> None:
        self.system: Any = system

    @ti.kernel
    def run(self, anew: ti.i32):  # pyright: ignore[reportInvalidTypeForm]
        for t in range(self.system.count):
            self.system.down(t, anew > 0)
        for line in range(self.system.lines):
            self.system.join(line, anew > 0)
        for t in range(self.system.count):
            self.system.up(t)


@pytest.mark.parametrize("length", [2, PIECE, PIECE + 1, 3 * PIECE - 1, 5 * PIECE + 7])
@pytest.mark.parametrize("across", [False, True])
def test_pieces_solve_what_the_whole_line_is(length: int, across: bool) -> None:
    """As badly conditioned as threads that cannot be stretched: diagonal 2, couplings of −1 to 1."""
    lines = 5
    steps = (0, 1, lines) if across else (0, length, 1)
    fields = Systems(lines * length)
    solved = Solved(LineSystems(fields, 0, lines, length, steps))
    coupling = RNG.uniform(-1.0, 1.0, (lines, length))
    coupling[:, 0] = 0.0
    coupling[2] = -1.0
    coupling[2, 0] = 0.0
    coupling[4, length // 2] = 0.0
    diagonal, right = np.full((lines, length), 2.0), RNG.standard_normal((lines, length))

    def laid(values: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(values.T if across else values, np.float32).ravel()

    for field, values in ((fields.diagonal, diagonal), (fields.coupling, coupling)):
        field.from_numpy(laid(values))
    for anew in (1, 0):  # the second with the factors of the first, for another right side
        right = RNG.standard_normal((lines, length))
        fields.right.from_numpy(laid(right))
        solved.run(anew)
        found = fields.change.to_numpy()
        found = found.reshape(length, lines).T if across else found.reshape(lines, length)
        for line in range(lines):
            beside = coupling[line, 1:]
            whole = np.diag(diagonal[line]) + np.diag(beside, 1) + np.diag(beside, -1)
            exact = np.linalg.solve(whole, right[line])
            assert np.abs(found[line] - exact).max() < 1e-6 * np.linalg.cond(whole) * np.abs(exact).max()


@pytest.mark.parametrize("case", ["verlet, wind", "verlet, seam"])
def test_loops_give_the_bytes_of_the_kernel(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In wind; and sewn, hung from places, its threads at a limit."""
    if not runtime.on_host():
        pytest.skip("on a device there are only loops")
    kernel = moved(case, 4)
    monkeypatch.setattr(Verlet, "loops_from", 0)
    assert moved(case, 4).tobytes() == kernel.tobytes()


@pytest.mark.slow  # both forms of whole yarns are compiled
def test_loops_of_whole_yarns_give_the_motion_of_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    if not runtime.on_host():
        pytest.skip("on a device there are only loops")
    for case in ("yarns, wind", "yarns, chains", "yarns, limit", "yarns, table", "yarns, seam"):
        monkeypatch.setattr(Yarns, "loops_from", np.inf)
        kernel = moved(case, 8)
        monkeypatch.setattr(Yarns, "loops_from", 0)
        assert np.abs(moved(case, 8) - kernel).max() < WITHIN.get(case, 1e-6), case


def test_loops_of_whole_yarns_fold_over_a_ball_as_the_kernel_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fixed shapes. Where it folds point by point it is no oracle, but as a whole."""
    if not runtime.on_host():
        pytest.skip("on a device there are only loops")
    kernel = moved("yarns, drape", 8)[..., 1]
    monkeypatch.setattr(Yarns, "loops_from", 0)
    loops = moved("yarns, drape", 8)[..., 1]
    assert np.abs(loops[:4] - kernel[:4]).max() < 1e-6
    assert loops[-1].min() == pytest.approx(kernel[-1].min(), abs=5e-3)
    assert loops[-1].mean() == pytest.approx(kernel[-1].mean(), abs=2e-3)
