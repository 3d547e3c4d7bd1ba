"""Long kernels that are drafts, as tests of every day compile them, give the bytes of the program's."""

import subprocess
import sys

import pytest

PROGRAM = """
import hashlib, sys
from taichi_cloth.ground import runtime
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.scene.load import load_scene

runtime.start("cpu", threads=1, draft=sys.argv[1] == "draft")
small = ["cloth.representation=mesh", "cloth.columns=31", "cloth.rows=21", "forces.self_contact=false"]
cloth = ClothModel(load_scene("drape", small))
for frame in range(1, 13):
    cloth.step(frame)
print(hashlib.sha256(cloth.simulation.positions.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_a_draft_gives_the_bytes_of_the_whole() -> None:
    """A sheet that falls on a ball."""
    made = [
        subprocess.run([sys.executable, "-c", PROGRAM, kind], check=True, timeout=1800, capture_output=True, text=True)
        for kind in ("draft", "whole")
    ]
    assert made[0].stdout.split()[-1] == made[1].stdout.split()[-1]
