"""Where the time of a frame goes: time stamps from inside its kernel.

A frame is one kernel, so its stages cannot be timed from outside; and a frame with a stage left out is another motion.
So the kernel calls the system's own clock wherever a stage ends, and notes which. Each span between two stamps belongs
to the stage that ended with it: together they are the kernel's time, none counted twice.

The address of the clock is written into the code, and is another one in the next process: such a kernel is never kept
on disk. A stamp takes some 50 ns, of some 20 a substep.
"""

import ctypes
import time
from collections.abc import Hashable
from typing import Any

import numpy as np
import taichi as ti
from taichi.lang import impl
from taichi.lang.expr import make_expr_group

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.errors import InputError

__all__ = ["StageClock"]

ROOM = 1 << 18
"""Stamps between two readings: of a frame of 4,096 substeps, and of one that is taken again."""

START = 0


def _clock_address() -> int | None:
    """Of the C library's clock_gettime; None where there is none (Windows), or kernels do not run on the CPU."""
    if not runtime.on_host() or not hasattr(time, "CLOCK_MONOTONIC"):
        return None
    found = getattr(ctypes.CDLL(None), "clock_gettime", None)
    return None if found is None else ctypes.cast(found, ctypes.c_void_p).value


@ti.data_oriented
class StageClock:
    """Stamps of one solver's frames. Taichi is running. Raises InputError where its kernels cannot ask for the time."""

    def __init__(self) -> None:
        address = _clock_address()
        if address is None:
            raise InputError("stages of a frame: kernels can ask for the time on a CPU under Linux or macOS only")
        self._address = address
        self._times = np.zeros((ROOM, 2), np.int64)  # [s], [ns]
        self._place = self._times.ctypes.data
        self._stage = ti.field(ti.i32, ROOM)
        self._count: Any = ti.field(ti.i32, ())
        self._names: list[Hashable] = [None]

    def number(self, name: Hashable) -> int:
        """Of a stage, from 1; for kernels that are being compiled."""
        if name not in self._names:
            self._names.append(name)
        return self._names.index(name)

    @ti.func
    def start(self, thread: Template):
        """What passed since the last stamp is no stage's. thread: who says so; the first alone is heard."""
        if thread == 0:
            self._stamp(START)

    @ti.func
    def end(self, name: Template, thread: Template):
        """What passed since the last stamp is this stage's."""
        if thread == 0:
            self._stamp(ti.static(self.number(name)))

    @ti.func
    def _stamp(self, stage):
        at = ti.atomic_add(self._count[None], 1)
        if at < ROOM:  # pyright: ignore[reportOperatorIssue]
            self._stage[at] = stage
            place = ti.u64(self._place) + ti.cast(at, ti.u64) * 16
            ti.static(self._ask(place))

    def _ask(self, place: Any) -> int:
        """Compiled into the kernel: clock_gettime(CLOCK_MONOTONIC, place of the stamp)."""
        arguments = make_expr_group(time.CLOCK_MONOTONIC, place)
        where = impl._ti_core.DebugInfo(impl.get_runtime().get_current_src_info())
        compiled: Any = impl.get_runtime().compiling_callable
        compiled.ast_builder().insert_external_func_call(
            self._address, "", "", "", arguments, make_expr_group([]), where
        )
        return 0

    def forget(self) -> None:
        """All stamps so far."""
        self._count[None] = 0

    def read(self) -> dict[Hashable, float]:
        """Seconds of each stage since the last reading, which it forgets. Raises InputError where they were too
        many."""
        count = int(self._count[None])
        self.forget()
        if count > ROOM:
            raise InputError(f"stages of a frame: {count} stamps, room for {ROOM}; use fewer substeps")
        seconds, nanoseconds = self._times[:count].T
        when = seconds * 1_000_000_000 + nanoseconds
        order = np.argsort(when, kind="stable")
        stages, spans = self._stage.to_numpy()[:count][order], np.diff(when[order])
        took = np.bincount(stages[1:], 1e-9 * spans, len(self._names))
        return {name: float(took[k]) for k, name in enumerate(self._names) if k != START}
