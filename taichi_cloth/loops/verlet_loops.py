"""Verlet's substep as parallel loops. Where nothing moves key points after the springs it is one loop, there and back
between both buffers of what is ahead."""

from collections.abc import Callable, Iterator
from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.loops.frame_loops import NOW, WIND, FrameLoops, Largest, Launch
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stencil import Features, store, taking
from taichi_cloth.sheet.sheet import LANES

__all__ = ["VerletLoops"]


@ti.data_oriented
class VerletLoops(FrameLoops):
    def __init__(
        self, frame: Frame, features: Features, packets: int, lanes: int, padded_shape: tuple[int, int]
    ) -> None:
        super().__init__(frame, features, packets, lanes, padded_shape)
        self.bound = Largest(self.count * lanes)

    def substep(self, odd: int) -> Iterator[Launch]:
        if not self.features.leads:
            yield self.kernel("alone", _alone), WIND, self.lanes
            for one in self.frame.constraints:
                for kernel in self.kernel((id(one), "warm"), one.warm_loops):
                    yield kernel, (), LANES
            for one in self.frame.constraints:
                if not one.repeated:
                    yield from self.constrain(one, False)
            for sweep in range(self.sweeps()):
                for one in self.frame.constraints:
                    if one.repeated:
                        yield from self.constrain(one, sweep > 0)
        elif not odd:
            yield self.kernel("both", _both), WIND, self.lanes

    @ti.func
    def springs(self, wind, at):
        """A loop: springs, air, fixed shapes of substep turn[NOW]."""
        for t in range(self.count):
            air = ti.Vector([wind[c] + self.turn[NOW] * wind[3 + c] for c in ti.static(range(3))])
            p = self.place(t)
            self.frame.substep(self.features, at, p, air, self.own(p))

    @ti.func
    def springs_leading(self, u: Template, wind):
        """The same, and what is ahead of it into the other buffer."""
        for t in range(self.count):
            done = self.turn[u]
            if t == 0:
                self.turn[1 - u] = done + 1
            air = ti.Vector([wind[c] + done * wind[3 + c] for c in ti.static(range(3))])
            p = self.place(t)
            self.frame.substep(self.features, u * self.frame.size, p, air, self.own(p))

    @ti.kernel
    def _bounds(self):
        for t in range(self.count):
            store(self.bound.value, self.frame.lanes(t * self.lanes), self.frame.stiff.bound(self.frame, self.place(t)))

    def stiffest(self) -> float:
        """As `VerletFrame.stiffest`."""
        with taking(self.lanes):
            self._bounds()
        return self.bound.find()


def _both(loops: Any) -> Callable[..., Any]:
    @ti.kernel
    def both(wx: Float, wy: Float, wz: Float, cx: Float, cy: Float, cz: Float):
        for u in ti.static(range(2)):
            loops.springs_leading(u, ti.Vector([wx, wy, wz, cx, cy, cz]))

    return both


def _alone(loops: Any) -> Callable[..., Any]:
    @ti.kernel
    def alone(wx: Float, wy: Float, wz: Float, cx: Float, cy: Float, cz: Float):
        loops.lead()
        loops.slip()
        loops.springs(ti.Vector([wx, wy, wz, cx, cy, cz]), 0)

    return alone
