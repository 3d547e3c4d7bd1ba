"""A frame as Taichi's parallel loops: the same arithmetic as in one kernel (`motion/frame.py`), cut the other way.

On a CPU a frame of some thousand key points is one kernel whose threads meet inside it. A graphics device has no such
meeting, and wants a thread for each key point. So here every stage of a substep is a loop over all key points at once;
loops of a kernel run in order, and each sees all that the one before it wrote. Kernels of a substep are repeated by a
`ti.graph` as often as the frame has substeps: the host says "go" once a frame, and looks at nothing until it is done.

The functions within the loops are those of the frame; they take one key point a thread on a device, and 8 neighbours an
iteration on a CPU (`stencil.taking`). Every point has one writer, and nothing is summed by atomics: two runs on one
device give the same bytes.

Bounds of loops are numbers when they are compiled: on a device with Vulkan a loop whose end comes later always starts
131,072 threads.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterator
from dataclasses import replace
from typing import Any

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x3, Float, Template
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.slipping import ANCHORS, Slipping
from taichi_cloth.motion.stencil import Features, near, taking
from taichi_cloth.sheet.sheet import LANES

__all__ = ["MOST_ITERATIONS", "NOW", "WIND", "FrameLoops", "Largest", "Launch"]

MOST_ITERATIONS = 65_535 * 128
"""Of a loop whose bounds are known when it is compiled: groups that every device with Vulkan takes, of 128 threads."""

WIND = tuple(ti.graph.Arg(ti.graph.ArgKind.SCALAR, name, ti.f32) for name in ("wx", "wy", "wz", "cx", "cy", "cz"))
"""Wind at the start of a frame [m/s], and its change in a substep."""

NOW = 2
"""Element of `FrameLoops.turn` with the number of the substep."""

Launch = tuple[Callable[..., Any], tuple[Any, ...], int]
"""A kernel, a plain function (a graph takes no methods); what it takes, WIND or nothing; and how many key points at
once."""

GROUP = 256
"""Numbers that one thread goes through for the largest of many."""


@ti.data_oriented
class Largest:
    """The largest of `count` numbers ≥ 0, without atomics: of groups at once, then of those by one thread."""

    def __init__(self, count: int) -> None:
        self.count, self.groups = count, -(-count // GROUP)
        self.value, self.group = ti.field(ti.f32, self.groups * GROUP), ti.field(ti.f32, self.groups)

    @ti.kernel
    def find(self) -> Float:
        for g in range(self.groups):
            most = 0.0
            for k in range(g * GROUP, (g + 1) * GROUP):
                most = ti.max(most, self.value[k])
            self.group[g] = most
        most = 0.0
        ti.loop_config(serialize=True)
        for g in range(self.groups):
            most = ti.max(most, self.group[g])
        return most


@ti.data_oriented
class FrameLoops(ABC):
    """The loops of a frame's fields, for sheets that have so many packets of lanes with key points.

    lanes: key points an iteration. count: iterations of a loop over all of them. turn: [u] the number of a substep, for
    loops that are there twice, for even substeps and odd ones: each leaves the next its number; [NOW] the same for all
    others.
    """

    def __init__(
        self, frame: Frame, features: Features, packets: int, lanes: int, padded_shape: tuple[int, int]
    ) -> None:
        self.frame: Any = frame
        if features.slips and features.leads:  # what rubs has a loop of its own, before which all is written
            features = replace(features, leads=False, apart=True)
        self.features, self.lanes, self.packets = features, lanes, packets
        self.count = packets * (LANES // lanes)
        if self.count > MOST_ITERATIONS:
            raise InputError(f"sheet: {self.count:,} key points; a device takes {MOST_ITERATIONS:,} at once")
        self.padded_shape, self.turn = padded_shape, ti.field(ti.i32, 3)
        if features.slips:
            frame.slipping = Slipping(frame.size, self.count, lanes, frame.cloths)
        planes = 6 + sum(one.remembers for one in frame.constraints) + ANCHORS * int(features.slips)
        stops = any(one.stops for one in frame.constraints)
        self.noted: Any = ti.field(ti.f32, (planes, *padded_shape)) if stops else None
        self._graphs: dict[Any, Any] = {}
        self._kernels: dict[Hashable, Any] = {}

    def enter(self, values: Any) -> None:
        """Before a frame. values: of a `SheetState`, but for what constraints keep for themselves."""
        with taking(self.lanes), runtime.plain_code(routines=True):
            self.read(values)

    def go(self, wind: list[float], change: list[float], first: int, last: int) -> None:
        """Substeps from `first` up to `last` of a frame; of a whole frame an even number. wind, change: see WIND."""
        with taking(self.lanes), runtime.plain_code(routines=True):
            kind = first % 2, last - first, self.sweeps()
            if kind not in self._graphs:
                self._graphs[kind] = self._recorded(first, last)
            names = (arg.name for arg in WIND)
            self._graphs[kind].run(dict(zip(names, [*wind, *change], strict=True)))

    def leave(self, values: Any) -> None:
        """After a frame, back into what `enter` took."""
        with taking(self.lanes), runtime.plain_code(routines=True):
            self.write(values)

    def sweeps(self) -> int:
        """Of a substep: with it goes which kernels that is made of."""
        return int(self.frame.numbers[None if self.frame.cloths == 1 else 0].sweeps)

    def _recorded(self, first: int, last: int) -> Any:
        builder = ti.graph.GraphBuilder()
        either = list(self.substep(0)), list(self.substep(1))
        for done in range(first, last):
            for kernel, takes, lanes in either[done % 2]:
                with taking(lanes):
                    builder.dispatch(kernel, *takes)
        return builder.compile()

    @abstractmethod
    def substep(self, odd: int) -> Iterator[Launch]:
        """Of an even substep, or of an odd one, in order. The same kernel for both is the same object."""

    def kernel(self, name: Hashable, make: Callable[[Any], Any]) -> Any:
        """What `make` makes of these loops, the first time it is asked for."""
        if name not in self._kernels:
            self._kernels[name] = make(self)
        return self._kernels[name]

    def constrain(self, one: Constraint, again: bool) -> Iterator[Launch]:
        """What a constraint does after the springs of a substep; again: once more in the same substep. Constraints take
        packets of neighbours, a packet a thread."""
        kernel = self.kernel((id(one), again), lambda loops: one.loop(loops, again))
        if kernel is not None:
            yield kernel, (), LANES

    @ti.func
    def now(self):
        """Number of the substep."""
        return self.turn[NOW]

    @ti.func
    def place(self, t) -> Any:
        """Element of the padded grid that iteration t of `count` is at."""
        if ti.static(self.lanes == 1):
            return near(self.frame.packet[t // LANES] * LANES + t % LANES)
        else:
            return self.frame.lanes(self.frame.packet[t] * LANES)

    @ti.func
    def own(self, p):
        """The numbers of the lanes at p."""
        return self.frame.own(p, self.frame.shared())

    @ti.func
    def lead(self):
        """A loop: what is ahead, into the first buffer; the substep's number."""
        for t in range(self.count):
            if t == 0:
                self.turn[NOW] = self.turn[NOW] + 1
            p = self.place(t)
            self.frame.lead(p, self.own(p))

    @ti.func
    def slip(self):
        """Loops: what rubs within the sheet, and what cells pull the hinges around them by."""
        if ti.static(self.features.slips):
            for t in range(self.count):
                p = self.place(t)
                self.frame.slipping.find(self.frame, self.features.hinges, t, p, p)
            for t in range(self.count):
                self.frame.slipping.spread(self.frame, self.place(t))

    @ti.kernel
    def read(self, values: F32x3):
        """The state from what the host holds."""
        for _ in range(1):
            self.turn[0], self.turn[1], self.turn[NOW] = 0, 0, -1
        for p in range(values.shape[1] * values.shape[2]):
            i, j = p // values.shape[2], p % values.shape[2]
            n = self.own(p)
            for c in ti.static(range(3)):
                x, u = values[c, i, j], values[3 + c, i, j]
                self.frame.position[c][p] = x
                self.frame.step[c][p] = u
                self.frame.ahead[c][p] = x + n.lag * u
            self.take(values, p, i, j)
            self.begin(p)
        if ti.static(self.features.grips):
            for t in range(self.count):
                self.frame.grip.begin(self.frame.position, self.place(t), 0)
        if ti.static(self.features.slips):
            for t in range(self.count):
                self.frame.slipping.begin(t, 0)
                self.frame.slipping.inner(self.frame, self.place(t))

    @ti.func  # noqa: B027  # nothing, where a solver has nothing of its own
    def begin(self, p):
        """What begins anew with each frame, of element p."""

    @ti.func
    def note(self):
        """A loop: what is remembered of key points beside where they are, and their steps, for `recall`."""
        for p in range(ti.static(self.padded_shape[0] * self.padded_shape[1])):
            self.give(self.noted, p, p // self.padded_shape[1], p % self.padded_shape[1])

    @ti.func
    def recall(self, done):
        """A loop: that, as it was noted; the next substep is number `done`."""
        for p in range(ti.static(self.padded_shape[0] * self.padded_shape[1])):
            if p == 0:
                self.turn[NOW] = done - 1
            self.take(self.noted, p, p // self.padded_shape[1], p % self.padded_shape[1])

    @ti.kernel
    def write(self, values: F32x3):
        """And back. An even number of substeps ends in the first buffer of what is ahead."""
        for p in range(values.shape[1] * values.shape[2]):
            i, j = p // values.shape[2], p % values.shape[2]
            for c in ti.static(range(3)):
                if ti.static(self.features.apart):
                    values[c, i, j] = self.frame.position[c][p]
                else:
                    values[c, i, j] = self.frame.ahead[c][p]
                values[3 + c, i, j] = self.frame.step[c][p]
            self.give(values, p, i, j)

    @ti.func
    def take(self, values: Template, p, i, j):
        """What is remembered of element p beside where it is, and its step: from values[6 on, i, j]."""
        for one in ti.static([one for one in self.frame.constraints if one.remembers]):
            one.open_one(values, p, i, j)
        if ti.static(self.features.slips):
            for k in ti.static(range(ANCHORS)):
                self.frame.slipping.anchor[k][p] = values[self.frame.plane + k, i, j]

    @ti.func
    def give(self, values: Template, p, i, j):
        """And back."""
        for one in ti.static([one for one in self.frame.constraints if one.remembers]):
            one.close_one(values, p, i, j)
        if ti.static(self.features.slips):
            for k in ti.static(range(ANCHORS)):
                values[self.frame.plane + k, i, j] = self.frame.slipping.anchor[k][p]
