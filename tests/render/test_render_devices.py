"""The same picture from a graphics device as from a CPU. Run with: pytest --arch vulkan, or cuda."""

import subprocess
import sys
from pathlib import Path

import device_picture
import numpy as np
import pytest


def test_a_graphics_device_draws_what_a_cpu_draws(tmp_path: Path, pytestconfig: pytest.Config) -> None:
    """No value is off by more than 4 of 255, and the mean by less than 0.05."""
    if pytestconfig.getoption("arch") == "cpu":
        pytest.skip("of --arch vulkan or cuda only")
    file = tmp_path / "cpu.npy"
    subprocess.run([sys.executable, "-P", device_picture.__file__, file], check=True, timeout=300)
    difference = np.abs(device_picture.picture().astype(int) - np.load(file))
    assert difference.max() <= 4
    assert difference.mean() < 0.05
