"""`animate` of built-in scenes to its end on a device, cloth on cloth and all, beside a CPU's pictures: in programs of
their own. Run with: pytest --arch vulkan, or cuda. On a CPU these are skipped."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from taichi_cloth.ground import runtime

SHEET = ("cloth.representation=mesh", "cloth.columns=25", "cloth.rows=25")
WALKS = "garment.representation=mesh", "body.motion=walk"
WORN = (*WALKS, "garment.key_points=500")
SCENES = {
    "drape": (8, SHEET),
    "flag": (6, ("cloth.representation=mesh", "cloth.columns=25", "cloth.rows=17")),
    "sheet-walk": (4, SHEET),
    "tshirt": (3, WORN),
    "dress": (3, WORN),
    "outfit-tartan": (3, (*WALKS, "garment.skirt.key_points=500", "garment.tshirt.key_points=500")),
}
"""Frames, and what is set."""

MEAN, FAR, SHARE = 1.0, 8, 0.02
"""Of 255: how far pictures may be apart in the mean; and which share of their numbers by more than that."""


def animated(name: str, arch: str, folder: Path) -> list[np.ndarray]:
    """The pictures of a run to its end. A garment is sewn by whoever comes first, and read from a file by the other."""
    frames, more = SCENES[name]
    said = [part for one in (*more, f"output.frames={frames}") for part in ("--set", one)]
    program = [sys.executable, "-m", "taichi_cloth.scenes", "animate", name, "--arch", arch, "--size", "120x150"]
    done = subprocess.run(
        [*program, "--out", str(folder), *said], capture_output=True, text=True, check=False, timeout=3600
    )
    # An outfit of so few key points does not fit, which is said of it at its end.
    assert done.returncode == (3 if name.startswith("outfit") else 0), done.stderr
    assert "takes the CPU" not in done.stderr
    files = sorted(folder.glob("frame_*.png"))
    assert len(files) == frames
    return [np.asarray(cv2.imread(str(file)), np.int32) for file in files]


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_comes_to_its_end_with_the_pictures_of_a_cpu(
    name: str, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    if runtime.on_host():
        pytest.skip("compares a device with the CPU: run with --arch vulkan, cuda or metal")
    there = animated(name, "cpu", tmp_path / "cpu")
    here = animated(name, str(pytestconfig.getoption("arch")), tmp_path / "device")
    apart = np.stack([abs(one - other) for one, other in zip(here, there, strict=True)])
    assert there[0].std() > 5.0  # there is something to be seen
    assert apart.mean(axis=(1, 2, 3)).max() < MEAN
    assert (apart > FAR).mean(axis=(1, 2, 3)).max() < SHARE
