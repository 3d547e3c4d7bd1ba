"""Taichi is started once for the whole run: a second `ti.init` would throw away every field made before."""

from typing import get_args

import pytest

from taichi_cloth.ground import runtime


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--arch", choices=get_args(runtime.Arch), default="cpu", help="device that kernels run on")


@pytest.fixture(scope="session", autouse=True)
def taichi_runtime(pytestconfig: pytest.Config) -> runtime.Runtime:
    return runtime.start(pytestconfig.getoption("arch") or "cpu")
