"""Vectors that LLVM gets as vectors: the same numbers as element by element."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
import taichi as ti
from numpy.typing import NDArray
from taichi.lang import impl

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x2, I32x2
from taichi_cloth.ground.whole_vectors import kept_as_vectors

N = 8


@ti.func
def of_numbers(v, w, i):
    """Results [result, lane] of all that lanes are worked on with."""
    s, t = v.max(), w.sum()
    total = v
    total -= w
    total += 2.0 * v
    total *= w
    if s > 1e3:
        total = v
    picked = v
    picked[3] = t
    for k in range(N):  # an element that is known when it runs
        s += v[k] * w[N - 1 - k]
    return (
        total,
        v / w - v * w + 1.0,
        -v,
        ti.abs(v),
        ti.sqrt(ti.abs(v)) + v**2,
        ti.floor(3.0 * v) + ti.sin(w),
        ti.max(v, 0.0) + ti.min(v, w),
        ti.select(v > w, v, 0.5),
        ti.select((v > w) | (v < 0.0) & ~(w > 0.3), v, w),
        ti.select((i & 1) != 0, v, w),
        ti.select(i & 2, v, w),
        ti.select(not (v > w), v, w),
        ti.select((v > 5.0).any(), v, w),
        ti.cast(i, ti.f32) * v,
        picked * s,
        v.dot(w) * v + v.norm() * w + v.normalized(),
    )


@ti.func
def of_integers(i, j, v):
    found = i
    found |= j
    found -= 2
    found &= 7
    bit = v > 0.0
    if found[2] > 2:
        bit = v < 0.0
    return (
        found,
        i // 2 + i % 3,
        ~i,
        i ^ (j << 1),
        ti.cast(10.0 * v, ti.i32),
        ti.cast(bit, ti.i32),
        ti.select(bit, i, 1),
    )


def results(whole: bool) -> tuple[NDArray, NDArray]:
    rng = np.random.default_rng(1)
    numbers, integers = rng.uniform(-1, 1, (2, N)).astype(np.float32), rng.integers(-5, 9, (2, N)).astype(np.int32)
    floats, ints = np.zeros((16, N), np.float32), np.zeros((7, N), np.int32)

    @ti.kernel
    def go(numbers: F32x2, integers: I32x2, floats: F32x2, ints: I32x2):
        for _ in range(1):
            v = ti.Vector([numbers[0, k] for k in ti.static(range(N))])
            w = ti.Vector([numbers[1, k] for k in ti.static(range(N))])
            i = ti.Vector([integers[0, k] for k in ti.static(range(N))])
            j = ti.Vector([integers[1, k] for k in ti.static(range(N))])
            for m, result in ti.static(enumerate(of_numbers(v, w, i))):
                for k in ti.static(range(N)):
                    floats[m, k] = result[k]
            for m, result in ti.static(enumerate(of_integers(i, j, v))):
                for k in ti.static(range(N)):
                    ints[m, k] = result[k]

    context: Any = kept_as_vectors() if whole else nullcontext()
    with context:
        go(numbers, integers, floats, ints)
    return floats, ints


def test_whole_vectors_give_the_same_numbers_as_elements() -> None:
    if not runtime.on_host():
        pytest.skip("vectors stay whole on a CPU alone")
    (floats, ints), (one, other) = results(whole=True), results(whole=False)
    assert floats.tobytes() == one.tobytes()
    assert ints.tobytes() == other.tobytes()
    assert np.isfinite(floats).all()
    assert (np.ptp(floats, axis=1) > 0).all()
    assert (np.ptp(ints, axis=1) > 0).all()


def test_taichi_is_as_it_was_after() -> None:
    def parts() -> tuple[Any, ...]:
        return ti.select, ti.cast, impl.subscript, impl.current_cfg().real_matrix_scalarize

    def fail() -> None:
        with kept_as_vectors():
            assert not any(one is other for one, other in zip(parts(), before, strict=True))
            raise ValueError("inside")

    before = parts()
    with pytest.raises(ValueError, match="inside"):
        fail()
    assert parts() == before
