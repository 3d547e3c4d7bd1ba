"""Taichi is started once for the whole run: a second `ti.init` would throw away every field made before."""

import pytest

from taichi_cloth import runtime


@pytest.fixture(scope="session", autouse=True)
def taichi_runtime() -> runtime.Runtime:
    return runtime.start("cpu")
