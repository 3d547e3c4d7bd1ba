"""Arrays that stay on a device: what the host may do with them, and what it is told of them."""

import numpy as np
import pytest

from taichi_cloth.ground import copies, runtime
from taichi_cloth.ground.copies import DeviceArray, every, extent, fetched, filled, put, sent, zeros


def seen_as_device(values: np.ndarray) -> DeviceArray:
    """Memory of the host as if it were a device's: kernels read both."""
    return DeviceArray.at(values.ctypes.data, values.shape, values.dtype, values)


def test_the_host_cuts_it_and_does_not_read_it() -> None:
    array = seen_as_device(np.zeros((4, 3, 16), np.float32))
    assert array[1:3].shape == (2, 3, 16)
    assert array[:, :0].shape == (4, 0, 16)
    assert array.reshape(4, -1)[2].owner is array.owner
    assert [row.shape for row in array] == [(3, 16)] * 4
    assert "DeviceArray((4, 3, 16)" in repr(array)
    for read in (
        lambda: array[0, 0, 0],
        lambda: array[np.arange(2)],
        lambda: array[array.reshape(-1)],
        lambda: array + 1,
        lambda: array.min(),
        lambda: array.tobytes(),
        lambda: list(array.reshape(-1)),
        lambda: np.concatenate([array, array]),
    ):
        with pytest.raises(TypeError):
            read()
    with pytest.raises(TypeError):
        array[0] = 1.0


def test_what_the_host_is_told_is_what_lies_there() -> None:
    if not runtime.on_host():
        pytest.skip("memory of the host is no device's")
    values = np.random.default_rng(5).standard_normal((5, 200, 16)).astype(np.float32)
    array = seen_as_device(values)
    assert (every(array, 7) == values[:, ::7]).all()
    assert every(values, 7).base is not None
    assert (extent(array) == extent(values)).all()
    assert (extent(array)[0] == values[:3].min(axis=(1, 2))).all()
    assert (extent(values[:, :0]) == 0).all()


def test_copies_there_and_back_are_what_went_in() -> None:
    """On a CPU nothing is copied; with --arch cuda this goes through its memory."""
    values = np.arange(60, dtype=np.float32).reshape(3, 4, 5)
    there = sent(values)
    assert (there is values) == (not runtime.resident())
    assert (fetched(there) == values).all()
    put(there[1:2], values[:1] + 100)
    assert (fetched(there)[1] == values[0] + 100).all()
    assert (fetched(filled((2, 3), 0.5)) == 0.5).all()
    assert (fetched(zeros((2, 3), np.int64)) == 0).all()
    assert zeros((3, 0)).shape == (3, 0)


def test_a_copy_that_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    class Driver:
        @staticmethod
        def cuMemcpyDtoH_v2(*_: object) -> int:
            return 700

    monkeypatch.setattr(copies, "_driver", Driver)
    with pytest.raises(RuntimeError, match=r"64 bytes .* CUDA's error 700"):
        fetched(seen_as_device(np.zeros(16, np.float32)))
