"""Routines: what they change is seen by the loop that calls them, called as on a CPU or copied as elsewhere."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import taichi as ti

from taichi_cloth.ground import routine as place
from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Float, Int
from taichi_cloth.ground.routine import routine


@ti.data_oriented
class Sums:
    def __init__(self) -> None:
        self.total = ti.field(ti.f32, ())

    @ti.func
    def up_to(self, k):
        out = 0
        for i in range(k):
            out += i
        return out

    @routine
    def add(self, k: Int) -> Float:
        for _ in range(2):
            self.total[None] = self.total[None] + k
        return float(self.up_to(k))

    @ti.kernel
    def run(self) -> Float:
        """The field is read in the loop that calls what changes it, and the routine has a loop of a function within."""
        out = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            for k in range(4):
                out += self.add(k) + self.total[None]
        return out


@pytest.mark.parametrize("arch", [None, ti.vulkan])
def test_what_a_routine_changes_is_seen_by_its_caller(monkeypatch: pytest.MonkeyPatch, arch: object) -> None:
    """Totals 0, 2, 6, 12 beside the sums 0, 0, 1, 3 of the numbers below each."""
    if arch is not None:
        monkeypatch.setattr(place, "current_cfg", lambda: SimpleNamespace(arch=arch))
    sums = Sums()
    with runtime.plain_code(routines=True):
        assert sums.run() == 0 + 2 + 6 + 12 + 0 + 0 + 1 + 3
    assert sums.total[None] == 12


def test_a_kernel_that_keeps_fields_in_registers_may_call_none() -> None:
    if not runtime.on_host():
        pytest.skip("on a device routines are copied")
    with pytest.raises(ti.TaichiCompilationError, match="add: what it changes would not be seen"):
        Sums().run()


MANY = """
import taichi as ti
from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Int, Template
from taichi_cloth.ground.routine import routine

@ti.data_oriented
class Many:
    def __init__(self):
        self.total = ti.field(ti.i32, ())

    @routine
    def add(self, much: Template, times: Int):
        for _ in range(times):
            self.total[None] += much

    @ti.kernel
    def run(self, times: Int):
        for much in ti.static(range(32)):
            self.add(much, times)

runtime.start("cpu", threads=1)
many = Many()
with runtime.plain_code(routines=True):
    many.run(2)
print(many.total.to_numpy())
"""


def test_a_kernel_with_routines_comes_from_the_cache_in_another_process(tmp_path: Path) -> None:
    """Objects of 32 routines that lie where they happen to give it another hash in each of three processes."""
    (tmp_path / "many.py").write_text(MANY)
    cache, found = tmp_path / "cache", []
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "many.py"],
            cwd=tmp_path,
            env={**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": str(cache)},
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
        assert done.stdout == "992\n"
        found.append({path.name for path in cache.glob("**/*.tic")})
    assert found[0]
    assert found[0] == found[1] == found[2]
