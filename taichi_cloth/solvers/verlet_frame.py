"""What of a frame is Verlet's own: one stage for springs, gravity, wind and fixed shapes; and the look after it."""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.stiffest import Stiffest

__all__ = ["VerletFrame"]


@ti.data_oriented
class VerletFrame(Frame):
    """stiff: the terms of the sheet's `FrequencyBound`."""

    def __init__(
        self,
        size: int,
        threads: int,
        constraints: tuple[Constraint, ...],
        clock: StageClock | None = None,
        slips: bool = False,
        cloths: int = 1,
    ) -> None:
        super().__init__(size, threads, constraints, clock, slips, cloths)
        self.stiff = Stiffest(self.size)

    @ti.func
    def move(self, thread, stage, ended, done, at, wind, values: Template, n: Template, features: Template):
        return self.in_parts(self.substep_part, thread, stage, ended, done, at, wind, values, n, features)

    @ti.func
    def substep_part(self, part, done, at, wind, values: Template, n: Template, features: Template):
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            self.substep(features, at, p, wind, self.own(p, n))

    @ti.func
    def substep(self, features: Template, at, p, wind, n: Template):
        """Störmer–Verlet for the lanes at p: dx ← D dx + a h², x ← x + dx. at: which buffer of `ahead` is read, 0 or
        `size`; all around the lanes must be in it."""
        # Where the lanes are.
        a = self.lanes(p + at)
        here = ti.static(self.position if features.apart else self.ahead)
        q = p if ti.static(features.apart) else a
        px, py, pz = load(here[0], q), load(here[1], q), load(here[2], q)
        # The step that forces make of the last one, and fixed shapes of that.
        free, dx, dy, dz = self.accelerate(features, a, p, wind, n)
        dx, dy, dz, bx, by, bz = self.collide(features, p, free, px, py, pz, dx, dy, dz, n)
        # Where that leads to, and what is ahead of it.
        if ti.static(features.apart):
            x, y, z = px + dx, py + dy, pz + dz
            if ti.static(features.grips):
                x, y, z = x + bx, y + by, z + bz
            store(self.position[0], p, x)
            store(self.position[1], p, y)
            store(self.position[2], p, z)
        store(self.step[0], p, dx)
        store(self.step[1], p, dy)
        store(self.step[2], p, dz)
        if ti.static(features.leads):
            b = self.lanes(p + self.size - at)
            store(self.ahead[0], b, px + dx + n.lag * dx)
            store(self.ahead[1], b, py + dy + n.lag * dy)
            store(self.ahead[2], b, pz + dz + n.lag * dz)

    @ti.kernel
    def stiffest(self) -> Float:
        """The largest bound of (ω h)² at the end of the last frame."""
        most = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            most = self.stiff.find(self)
        return most
