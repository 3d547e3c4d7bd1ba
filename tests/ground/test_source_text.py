"""Sources that are read once: what kernels are made of is what Taichi would have found each time."""

from typing import Any

import pytest
import taichi as ti

from taichi_cloth.ground import source_text
from taichi_cloth.ground.arrays import Float


@ti.func
def power(x, n: ti.template()):  # pyright: ignore[reportInvalidTypeForm]
    """A function that is copied into itself, between what it has found before and what it finds after."""
    if ti.static(n == 0):
        return 1.0
    else:
        return x * power(x, n - 1) + 0.0 * x


@ti.data_oriented
class Seven:
    @ti.func
    def max(self):
        return 7.0


@ti.func
def largest(one: ti.template()):  # pyright: ignore[reportInvalidTypeForm]
    return one.max()


@ti.kernel
def powers(x: Float) -> Float:
    return power(x, 3) + 10.0 * power(x, 2) + 100.0 * power(x + 1.0, 1)


seven = Seven()


@ti.kernel
def of_both() -> Float:
    """The same place in a function is a method that Taichi has for vectors in one copy, and an object's in the next."""
    v = ti.Vector([1.0, 5.0])
    return largest(v) + 10.0 * largest(seven) + 100.0 * largest(v)


def test_a_function_that_is_copied_into_itself() -> None:
    assert powers(2.0) == pytest.approx(2.0**3 + 10 * 2.0**2 + 100 * 3.0)


def test_one_copy_leaves_nothing_for_the_next() -> None:
    assert of_both() == pytest.approx(5 + 10 * 7 + 100 * 5)


def test_a_function_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[str] = []

    def noted(function: Any) -> Any:
        found.append(function.__name__)
        return theirs(function)

    theirs = source_text._lines
    monkeypatch.setattr(source_text, "_lines", noted)

    @ti.func
    def twice(x):
        return 2.0 * x

    @ti.kernel
    def often(x: Float) -> Float:
        return twice(twice(x)) + twice(1.0) + twice(x)

    assert often(3.0) == 12 + 2 + 6
    assert sorted(found) == ["often", "twice"]
