"""Which device a run takes, what `plan` says of it, and what a device has no room for."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti

from taichi_cloth.ground import device_memory
from taichi_cloth.ground.copies import copy_in, copy_out
from taichi_cloth.ground.device_memory import field_bytes, is_out_of_memory, require_device_memory, said_of_memory
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.commands.device import device_of
from taichi_cloth.scenes.plan.lines import plan_lines
from taichi_cloth.scenes.plan.plan import Plan, plan
from taichi_cloth.scenes.scene.load import load_scene

ALONE = "forces.self_contact=false"
SMALL = ["cloth.columns=20", "cloth.rows=20", "cloth.representation=mesh"]


def planned(name: str, *overrides: str) -> Plan:
    return plan(load_scene(name, [*SMALL, *overrides]))


@pytest.mark.parametrize("overrides", [(), (ALONE,)])
def test_a_sheet_runs_on_the_device_that_is_asked_for(
    overrides: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    made = planned("drape", *overrides)
    assert made.lacks == ""
    assert any("devices" in line and "runs there" in line for line in plan_lines(made))
    assert device_of(made, "vulkan") == "vulkan"
    assert capsys.readouterr().err == ""


def test_what_has_no_parallel_form_takes_the_cpu_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    made = replace(planned("drape"), lacks="several cloths in one sheet")
    assert device_of(made, "vulkan") == "cpu"
    assert capsys.readouterr().err.splitlines() == [
        "taichi-cloth: --arch vulkan: several cloths in one sheet has no parallel form yet; the whole run takes the CPU"
    ]
    assert device_of(made, "cpu") == "cpu"
    assert device_of(made, "vulkann") == "vulkann"  # whoever starts it refuses it
    assert capsys.readouterr().err == ""
    limited = ["forces.strain_limit={percent=5}", "solver.name=verlet"]
    assert planned("drape", ALONE, *limited).lacks == ""


def test_a_garment_runs_on_the_device_that_is_asked_for() -> None:
    made = plan(load_scene("tshirt", ["garment.representation=mesh", "garment.key_points=500"]))
    assert made.lacks == ""
    assert device_of(made, "vulkan") == "vulkan"


class Holder:
    def __init__(self) -> None:
        self.one, self.many = ti.field(ti.f32, 100), [ti.field(ti.i32, 10), ti.field(ti.f32, ())]
        self.again = self.many[0]


Holder.__module__ = "taichi_cloth.somewhere"


def test_more_than_one_buffer_holds_is_refused_with_what_would_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    holder = Holder()
    assert field_bytes(holder) == 4 * (100 + 10 + 1)
    require_device_memory("sheet", 100, [holder])
    monkeypatch.setattr(device_memory, "MOST_BYTES", 222)
    with pytest.raises(InputError, match=r"sheet: 100 key points .* about 47 would fit"):
        require_device_memory("sheet", 100, [holder])
    require_device_memory("sheet", 100, [holder], known=[holder.one])
    assert field_bytes(holder, known=[holder.one]) == 4 * (10 + 1)
    monkeypatch.setattr(device_memory, "_taken", {"sheet": (900, 10**9), "cloth on cloth": (900, 2 * 10**9)})
    assert said_of_memory() == "; 900 key points take 3 GB of it"


def test_a_device_that_has_no_memory_left_is_told_from_other_errors() -> None:
    for said in (
        "[runtime.cpp:add_root_buffer@739] Failed to allocate root buffer",
        "CUDA_ERROR_OUT_OF_MEMORY: out of",
    ):
        assert is_out_of_memory(RuntimeError(said))
    assert not is_out_of_memory(RuntimeError("something else"))
    assert not is_out_of_memory(ValueError("out of memory"))


def test_copies_are_what_went_in() -> None:
    """Beyond what a loop with bounds known before could take on every device: 65,535 groups of 128."""
    values = np.arange(65_535 * 128 + 1000, dtype=np.float32)
    field, few = ti.field(ti.f32, len(values)), ti.field(ti.i32, 10)
    copy_in(values, field)
    out = np.zeros(1200, np.float32)
    copy_out(field, len(values) - 1200, out)
    np.testing.assert_array_equal(out, values[-1200:])
    copy_in(np.array([3, 4], np.int32), few)
    assert few[1] == 4
