"""`plan` says the memory that the whole process takes: beside the peak that the system measured."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.scene.load import load_scene

NEAR = 0.25
RUNS = {
    "small": ("turntable", "plain", ["weave.ends=6", "weave.picks=6", "output.size=[64, 48]", "output.views=1"]),
    "yarn": ("turntable", "yarn", ["output.views=1"]),
    "plain": ("turntable", "plain", ["output.views=1"]),
    "swatch": ("turntable", "swatch", ["output.views=1"]),
    "flag": ("animate", "flag", ["output.frames=2"]),
    "small mesh": ("animate", "drape", ["cloth.representation=mesh", "output.frames=2", "output.size=[64, 48]"]),
    "mesh": ("animate", "drape", ["cloth.representation=mesh", "output.frames=2"]),
}


def peak(command: str, scene: str, changes: list[str], out: Path) -> int:
    """Largest resident memory of a command in a process of its own [bytes]."""
    words = [word for change in changes for word in ("--set", change)]
    arguments = [sys.executable, "-m", "taichi_cloth.scenes", command, scene, *words, "--out", str(out)]
    with subprocess.Popen(arguments, cwd=out.parent, stdout=subprocess.DEVNULL) as run:
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    assert run.returncode == 0
    return used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "wait4"), reason="measured as POSIX does")
@pytest.mark.parametrize("name", RUNS)
def test_the_peak_is_within_a_quarter_of_what_plan_says(name: str, tmp_path: Path) -> None:
    command, scene, changes = RUNS[name]
    peak(command, scene, changes, tmp_path / "first")  # compiles kernels, which takes more than running them
    measured = peak(command, scene, changes, tmp_path / "out")
    assert plan(load_scene(scene, changes)).bytes == pytest.approx(measured, rel=NEAR)


def test_plan_counts_the_process_itself() -> None:
    changes = ["weave.ends=6", "weave.picks=6", "output.size=[64, 48]"]
    assert 200e6 < plan(load_scene("plain", changes)).bytes < 450e6
