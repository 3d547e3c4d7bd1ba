"""What of a frame is Verlet's own: one stage for springs, gravity, wind and fixed shapes; and the look after it."""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.stiffest import Stiffest

__all__ = ["VerletFrame"]


@ti.data_oriented
class VerletFrame(Frame):
    """stiff: the terms of the sheet's `FrequencyBound`."""

    def __init__(self, padded_shape: tuple[int, int], threads: int, constraints: tuple[Constraint, ...]) -> None:
        super().__init__(padded_shape, threads, constraints)
        self.stiff = Stiffest(self.size)

    @ti.func
    def move(self, thread, stage, ended, done, at, wind, values: Template, n: Template, features: Template):
        return self.in_parts(self.substep_part, thread, stage, ended, done, at, wind, values, n, features)

    @ti.func
    def substep_part(self, part, done, at, wind, values: Template, n: Template, features: Template):
        for e in range(self.cut[part], self.cut[part + 1]):
            self.substep(features, at, self.lanes(self.packet[e] * LANES), wind, n)

    @ti.func
    def substep(self, features: Template, at, p, wind, n: Template):
        """Störmer–Verlet for the lanes at p: dx ← D dx + a h², x ← x + dx. at: which buffer of `ahead` is read, 0 or
        `size`; all around the lanes must be in it."""
        # Where the lanes are, and the step that brought them there.
        a = self.lanes(p + at)
        here = ti.static(self.position if features.apart else self.ahead)
        q = p if ti.static(features.apart) else a
        px, py, pz = load(here[0], q), load(here[1], q), load(here[2], q)
        sx, sy, sz = load(self.step[0], p), load(self.step[1], p), load(self.step[2], p)
        # Forces × h², and the step that follows from them.
        fx, fy, fz = self.elastic(features, a, p, n)
        if ti.static(features.wind):
            x, y, z = self.air(a, p, sx, sy, sz, wind, n)
            fx, fy, fz = fx + x, fy + y, fz + z
        inverse = load(self.inverse_mass, p)
        free = ti.min(inverse * 1e30, 1.0)  # 1, or 0 for pinned and absent key points, which keep their step
        dx = sx + free * ((n.kept - 1.0) * sx + inverse * fx + n.gravity_x)
        dy = sy + free * ((n.kept - 1.0) * sy + inverse * fy + n.gravity_y)
        dz = sz + free * ((n.kept - 1.0) * sz + inverse * fz + n.gravity_z)
        dx, dy, dz = self.collide(features, free, px, py, pz, dx, dy, dz, n)
        # Where that leads to, and what is ahead of it.
        if ti.static(features.apart):
            store(self.position[0], p, px + dx)
            store(self.position[1], p, py + dy)
            store(self.position[2], p, pz + dz)
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
