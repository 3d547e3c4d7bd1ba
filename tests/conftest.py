"""Taichi is started once in each process: a second `ti.init` would throw away every field and every compiled kernel.

Compiling kernels is half of the suite's work, so tests that share kernels, bodies or garments run in one process.
"""

import gc
from collections.abc import Iterator
from typing import Any, get_args

import pytest
import taichi as ti
from xdist.scheduler.loadscope import LoadScopeScheduling

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError

SHARED = {
    "motion": (
        "constraints",
        "loops",
        "motion",
        "solvers",
        "garment/test_limbs.py",
        "garment/test_outline.py",
        "scenes/test_body_scenes.py",
        "scenes/test_cloth_scenes.py",
        "scenes/test_report.py",
        "scenes/test_stability.py",
        "scenes/test_tables.py",
    ),
    "drawing": (
        "render",
        "detail",
        "garment/test_garment_cloth.py",
        "scenes/test_profile.py",
        "scenes/test_still.py",
        "scenes/test_still_ids.py",
        "scenes/test_sequence.py",
        "scenes/test_sett.py",
        "test_readme.py",
    ),
    "worn": ("body", "garment"),
}
"""Folders and files whose tests run in one process; those of any other file run in one, too."""
EVERYDAY = "not slow"
"""Tests of every day take longer to compile kernels than to run them, so theirs are drafts; slow ones run what the
program runs (`ground/test_draft.py`: to the same bytes)."""
GROUPS = {place: name for name, places in SHARED.items() for place in places}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--arch", choices=get_args(runtime.Arch), default="cpu", help="device that kernels run on")


class ByGroup(LoadScopeScheduling):
    """Hands out groups of tests as wholes. `--dist loadgroup` would, too, but cannot with pytest 9."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.split("::")[0].removeprefix("tests/")
        return GROUPS.get(file) or GROUPS.get(file.split("/")[0], file)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByGroup:
    return ByGroup(config, log)


def pytest_collection_finish() -> None:
    """What collecting has made stays, and need not be looked through for garbage again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def taichi_runtime(pytestconfig: pytest.Config) -> Iterator[runtime.Runtime]:
    try:
        everyday = pytestconfig.getoption("markexpr") == EVERYDAY
        yield runtime.start(pytestconfig.getoption("arch") or "cpu", draft=everyday)
    except InputError as error:  # such a device is not here
        pytest.skip(str(error))
    ti.reset()  # writes the kernels that it keeps: not all that Python ends with is freed


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Any:
    """What has no parallel form is not tested on a device."""
    try:
        return (yield)
    except InputError as error:
        if "no parallel form" in str(error):
            pytest.skip(str(error))
        raise


@pytest.fixture(autouse=True)
def started_once(taichi_runtime: runtime.Runtime) -> Iterator[None]:
    before = runtime.generation()
    yield
    assert runtime.generation() == before, "this test started Taichi anew; use the fixture keep_taichi"


@pytest.fixture
def keep_taichi(monkeypatch: pytest.MonkeyPatch, taichi_runtime: runtime.Runtime) -> None:
    """For tests of commands, which start Taichi themselves."""
    monkeypatch.setattr(runtime, "start", lambda *_, **__: taichi_runtime)
