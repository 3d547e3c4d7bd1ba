"""What a device's motion is measured by: `pytest --arch vulkan tests/loops` compares it with the CPU, in a process of
its own, as one process runs on one device. On a CPU these are skipped."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from device_cases import CASES, WHOLE, WITHIN, moved, simulation, through
from strips import PLAIN, simulate

from taichi_cloth.constraints.ties import Ties
from taichi_cloth.ground import runtime
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate

FRAMES, TIES = 12, 1100
THIN = "verlet, thin", "verlet, many thin"


@pytest.fixture(scope="module", autouse=True)
def _on_a_device(taichi_runtime: runtime.Runtime) -> None:
    if runtime.on_host():
        pytest.skip("compares a device with the CPU: run with --arch vulkan, cuda or metal")


def on_cpu(case: str, folder: Path) -> np.ndarray:
    file = folder / "cpu.npy"
    program = str(Path(__file__).with_name("device_cases.py"))
    subprocess.run([sys.executable, program, case, "cpu", str(file)], check=True, timeout=600)
    return np.load(file)


@pytest.mark.parametrize("case", [case for case in CASES if case not in (*WHOLE, *THIN)])
def test_what_does_not_buckle_is_where_it_is_on_a_cpu(case: str, tmp_path: Path) -> None:
    there, here = moved(case, FRAMES), on_cpu(case, tmp_path)
    apart = np.abs(there.astype(np.float64) - here).max(axis=(1, 2, 3))
    assert apart.max() < WITHIN.get(case, 1e-6), apart


@pytest.mark.parametrize("case", THIN)
def test_middles_of_springs_answer_alike_in_another_order(case: str, tmp_path: Path) -> None:
    """A bar, or nine side by side, that key points alone would let through. Springs that share an end are gone through
    by colours on a device, and in the order of a list on a CPU."""
    apart = np.abs(moved(case, FRAMES) - on_cpu(case, tmp_path))
    assert apart.max() < 2e-4, apart.max(axis=(1, 2, 3))


def test_two_runs_on_a_device_give_the_same_bytes() -> None:
    for case in ("yarns, drape", "verlet, table", "verlet, many thin", "verlet, layers", "yarns, sack"):
        assert moved(case, FRAMES).tobytes() == moved(case, FRAMES).tobytes()


def test_more_ties_than_a_cpu_closes_at_once_are_closed_at_once() -> None:
    """Two strips of 1,100 rows, thrown about by 0.1 m/s; two runs give the same bytes."""
    cells = np.ones((TIES - 1, 5), bool)
    cells[:, 2] = False
    sheet = Sheet.of_cells(cells, material=PLAIN, springs=calibrate(PLAIN, spacing_x=0.01, spacing_y=0.01))
    row = np.arange(TIES)
    nodes = np.stack([np.stack([row, np.full(TIES, c)], -1) for c in (2, 3)], 1)
    x = sheet.flat()
    x[:, 3:, 0] -= 0.01
    found = []
    for _ in range(2):
        ties = Ties(sheet, nodes, np.tile([1.0, -1.0], (TIES, 1)))
        velocities = 0.1 * np.random.Generator(np.random.Philox(3)).standard_normal((*sheet.shape, 3))
        moving = simulate(sheet, positions=x, velocities=velocities, ties=(ties,))
        for _ in range(4):
            moving.step()
            assert ties.gaps(moving.state).max() < 1e-5
        found.append(moving.state.values.tobytes())
    assert found[0] == found[1]


@pytest.mark.parametrize("case", WHOLE)
def test_cloth_that_folds_comes_to_the_same_shape_as_a_whole(case: str, tmp_path: Path) -> None:
    """Point by point a sheet that buckles is no oracle: 1e-7 m at the start are 10 cm later. Nor as a whole a sack that
    falls over: 1e-5 m at the start are 1 mm of its mean height after 8 frames, and 2 after 12."""
    last = 7 if "sack" in case else -1
    there, here = moved(case, FRAMES)[last, ..., 1], on_cpu(case, tmp_path)[last, ..., 1]
    assert there.min() == pytest.approx(here.min(), abs=5e-3)
    assert there.mean() == pytest.approx(here.mean(), abs=2e-3)


@pytest.mark.parametrize("case", ["verlet, layers", "yarns, layers", "verlet, sack", "yarns, sack"])
def test_layers_do_not_pass_through_each_other(case: str) -> None:
    """By the exact test, in every frame; and each interval is proven."""
    moving = simulation(case)
    for _ in range(FRAMES):
        moving.step()
        assert through(case, moving) == 0
        assert not moving.solver.let_off
