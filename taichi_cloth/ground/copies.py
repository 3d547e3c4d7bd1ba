"""Copies between the host and a device: of fields of any size, and arrays that stay on the device.

Taichi sends an array of NumPy's to a device and back at each call of a kernel: 60 ms for two million particles, which
take less than one to be gone through. But what it is told to be CUDA's memory it takes where it lies. `DeviceArray` is
such memory, seen as an array of NumPy's that only kernels may read: whatever makes large arrays asks `zeros`, `filled`
or `sent` for them, and `fetched` for what the host must know. On a CPU, and on devices that are not `resident`, these
are plain arrays, and nothing is copied.

Taichi's own `to_numpy` and `from_numpy` are parallel loops whose bounds are known when they are compiled. A device with
Vulkan runs such a loop as one thread an iteration, and is bound to take 65,535 groups of 128 threads only: of a longer
field they end in a traceback. A loop whose end comes when it runs has no such limit.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import DTypeLike, NDArray
from taichi.lang.impl import get_runtime

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x1, Int, Template
from taichi_cloth.ground.particles import LANES, RADIUS, fill_up

__all__ = [
    "DeviceArray", "copy_in", "copy_out", "every", "extent", "fetched", "filled", "filled_up", "on_host", "paste",
    "put", "sent", "zeros",
]  # fmt: skip


@ti.kernel
def _floats_in(values: F32x1, field: Template):
    for k in range(values.shape[0]):
        field[k] = values[k]


@ti.kernel
def _integers_in(values: I32x1, field: Template):
    for k in range(values.shape[0]):
        field[k] = values[k]


@ti.kernel
def _floats_out(field: Template, first: Int, out: F32x1):
    for k in range(out.shape[0]):
        out[k] = field[first + k]


def copy_in(values: Any, field: Any) -> None:
    """values: float32 or int32, (n,), contiguous; into the first n elements of a field of the same type."""
    if field.dtype == ti.i32:
        _integers_in(values, field)
    else:
        _floats_in(values, field)


def copy_out(field: Any, first: int, out: Any) -> None:
    """Elements of a float32 field from `first` on into `out`, float32 (n,), contiguous."""
    _floats_out(field, first, out)


class DeviceArray(np.ndarray):
    """An array in CUDA's memory, for kernels. On the host it can be cut and reshaped; reading it raises TypeError.

    owner: what the memory is of. Valid until Taichi starts again.
    """

    owner: Any = None
    __array_ufunc__: Any = None

    def __array_finalize__(self, obj: Any) -> None:
        self.owner = getattr(obj, "owner", None)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return NotImplemented

    def __getitem__(self, key: Any) -> Any:
        keys = key if isinstance(key, tuple) else (key,)
        numbers = [one for one in keys if isinstance(one, int | np.integer)]
        if len(numbers) == self.ndim or not all(isinstance(one, slice) for one in keys if one not in numbers):
            raise TypeError("an array on the device: only kernels read its elements; see copies.fetched")
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        raise TypeError("an array on the device: only kernels write its elements; see copies.put")

    def _unread(self, *_: Any, **__: Any) -> Any:
        raise TypeError("an array on the device: only kernels read its elements; see copies.fetched")

    def __iter__(self) -> Any:
        return (self[k] for k in range(len(self))) if self.ndim > 1 else self._unread()

    copy = tobytes = astype = tolist = item = __reduce__ = _unread  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        return f"DeviceArray({self.shape}, {self.dtype})"

    @classmethod
    def at(cls, address: int, shape: tuple[int, ...], dtype: DTypeLike, owner: Any) -> "DeviceArray":
        """Memory of a device from an address on."""
        kind = np.dtype(dtype)
        memory = (ctypes.c_char * (prod(shape) * kind.itemsize)).from_address(address)
        out = np.frombuffer(memoryview(memory), kind).reshape(shape).view(cls)
        out.owner = owner
        return out


def zeros(shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> Any:
    """Of zeros, where kernels read and write them."""
    lengths = (shape,) if isinstance(shape, int) else shape
    size = prod(lengths) * np.dtype(dtype).itemsize
    if not runtime.resident() or not size:
        return np.zeros(lengths, dtype)
    owner = ti.ndarray(ti.i32, -(-size // 4))
    address = get_runtime().prog.get_ndarray_data_ptr_as_int(owner.arr)  # pyright: ignore[reportOptionalMemberAccess]
    return DeviceArray.at(address, lengths, dtype, owner)


def filled(shape: tuple[int, ...], value: float) -> Any:
    """Of one number, float32."""
    out = zeros(shape)
    if isinstance(out, DeviceArray):
        _fill(value, out.reshape(-1))
    else:
        out[:] = value
    return out


def sent(values: Any) -> Any:
    """A copy on the device, or the array itself where that is not needed."""
    if not runtime.resident() or isinstance(values, DeviceArray) or not values.size:
        return values
    out = zeros(values.shape, values.dtype)
    put(out, values)
    return out


def put(array: Any, values: NDArray[Any]) -> None:
    """Writes values into an array of the same shape, wherever it lies."""
    if isinstance(array, DeviceArray):
        there = np.ascontiguousarray(values, array.dtype)
        assert array.flags.c_contiguous
        assert array.shape == there.shape
        _copied(_driver().cuMemcpyHtoD_v2, array, there.ctypes.data, array.nbytes, into=True)
    else:
        array[...] = values


def fetched(array: Any) -> Any:
    """A copy on the host, or the array itself where it lies there."""
    if not isinstance(array, DeviceArray):
        return array
    assert array.flags.c_contiguous
    out = np.empty(array.shape, array.dtype)
    if array.size:
        _copied(_driver().cuMemcpyDtoH_v2, array, out.ctypes.data, array.nbytes, into=False)
    return out


@contextmanager
def on_host(array: Any) -> Iterator[Any]:
    """For the host to read and write: the array itself, or a copy that is put back."""
    here = fetched(array)
    yield here
    if here is not array:
        put(array, here)


def every(groups: Any, step: int) -> Any:
    """Every so many groups of particles (rows, groups, 16), on the host."""
    if not isinstance(groups, DeviceArray):
        return groups[:, ::step]
    out = np.zeros((groups.shape[0], -(-groups.shape[1] // step), groups.shape[2]), groups.dtype)
    _every(step, groups, out)
    return out


def extent(groups: Any) -> NDArray[np.float64]:
    """The box (2, 3) [m] of all places in groups of particles (rows, groups, 16)."""
    if not groups.shape[1]:
        return np.zeros((2, 3))
    if not isinstance(groups, DeviceArray):
        places = groups[:3].reshape(3, -1)
        return np.stack([places.min(axis=1), places.max(axis=1)]).astype(np.float64)
    parts = np.zeros((min(PARTS, groups.shape[1] * LANES), 6), np.float32)
    _extents(groups, parts)
    return np.stack([parts[:, :3].min(axis=0), parts[:, 3:].max(axis=0)]).astype(np.float64)


def paste(groups: Any, first: int, values: NDArray[np.float32]) -> None:
    """Writes particles (rows, n) into groups (rows, groups, 16), from place `first` on."""
    if isinstance(groups, DeviceArray):
        _paste(groups, first, np.ascontiguousarray(values, np.float32))
    else:
        groups.reshape(len(groups), -1)[:, first : first + values.shape[1]] = values


def filled_up(groups: Any, count: int) -> None:
    """`fill_up`, wherever the groups lie."""
    if not isinstance(groups, DeviceArray):
        fill_up(groups, count)
    elif count % LANES:
        _fill_up(groups, count)


PARTS = 8192
"""Threads of a device that look for the ends of all places."""


@lru_cache(maxsize=1)
def _driver() -> Any:
    """CUDA's own library, which Taichi has loaded too."""
    return ctypes.CDLL("nvcuda.dll" if os.name == "nt" else "libcuda.so.1")


def _copied(copy: Any, array: DeviceArray, host: int, size: int, *, into: bool) -> None:
    device = ctypes.c_uint64(array.ctypes.data)
    there, here = (device, ctypes.c_void_p(host)) if into else (ctypes.c_void_p(host), device)
    code = copy(there, here, ctypes.c_size_t(size))
    if code:
        raise RuntimeError(f"a copy of {size:,} bytes to or from the device failed: CUDA's error {code}")


@ti.kernel
def _fill(value: Float, out: F32x1):
    for k in range(out.shape[0]):
        out[k] = value


@ti.kernel
def _every(step: Int, groups: F32x3, out: F32x3):
    for b in range(out.shape[1]):
        for row in range(out.shape[0]):
            for lane in range(LANES):
                out[row, b, lane] = groups[row, b * step, lane]


@ti.kernel
def _extents(groups: F32x3, parts_out: F32x2):
    for t in range(parts_out.shape[0]):
        low, high = ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        count = groups.shape[1] * LANES
        for k in range((count - t + parts_out.shape[0] - 1) // parts_out.shape[0]):
            i = t + k * parts_out.shape[0]
            for c in ti.static(range(3)):
                x = groups[c, i // LANES, i % LANES]
                low[c], high[c] = ti.min(low[c], x), ti.max(high[c], x)
        for c in ti.static(range(3)):
            parts_out[t, c], parts_out[t, 3 + c] = low[c], high[c]


@ti.kernel
def _paste(groups: F32x3, first: Int, values: F32x2):
    for k in range(values.shape[1]):
        for row in range(values.shape[0]):
            groups[row, (first + k) // LANES, (first + k) % LANES] = values[row, k]


@ti.kernel
def _fill_up(groups: F32x3, count: Int):
    for row in range(groups.shape[0]):
        b, last = count // LANES, count % LANES
        for lane in range(last, LANES):
            groups[row, b, lane] = ti.select(row == RADIUS, 0.0, groups[row, b, last - 1])
