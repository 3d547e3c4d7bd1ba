"""The stages of a frame with whole yarns: soft springs explicitly, then warp and weft in turns, and what touches them.

    of each substep:
        move      shear, bending, gravity, wind: where key points would be without their threads
        touch     fixed shapes, the body
        of each sweep:
            solve     the yarns of one family, then those of the other; who begins alternates. Where shear is stiff
                      the diagonals are families too
            touch     again; what it pushed and held in this substep may grow or be taken back

Contact and friction are sums over the substep: taken anew in each sweep they would hold several times as much.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.crew import PARTS
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.whole_yarns import WholeYarns

__all__ = ["ChainFrame", "YarnFrame"]

BALL, FLOOR = 0, 1


@ti.data_oriented
class YarnFrame(Frame):
    """yarns: their systems. pressed, rubbed: [shape], [shape][axis], what a fixed shape has pushed key points by in
    this substep, and its friction [m]."""

    sums = True
    families = 2

    def __init__(self, size: int, threads: int, constraints: tuple[Constraint, ...]) -> None:
        super().__init__(size, threads, constraints)
        self.yarns = WholeYarns(size, self.families)
        self.pressed = [ti.field(ti.f32, self.size) for _ in (BALL, FLOOR)]
        self.rubbed = [[ti.field(ti.f32, self.size) for _ in range(3)] for _ in (BALL, FLOOR)]

    @ti.func
    def stages(self, thread, values: Template, n: Template, wind, change, substeps, features: Template):
        first, last = self.cut[0], self.cut[PARTS]
        for part in range(PARTS):
            self.read(part, 0, 0, wind, values, n, features)
        for e in range(first, last):
            self.yarns.loosen(self.lanes(self.packet[e] * LANES))
        families = ti.static(self.families)
        turns = families * ti.cast(n.sweeps, ti.i32)
        for done in range(substeps):
            self.yarns.judge()
            for part in range(PARTS):
                self.prepare(part, done, 0, wind, values, n, features)
            for e in range(first, last):
                self.soft(self.lanes(self.packet[e] * LANES), wind + done * change, n, features)
            for turn in range(turns + 1):
                if turn % families == 0:
                    self.correct_all(turn, turns, done, n, features)
                if turn < turns:
                    family = turn % families
                    if done % 2 == 1:
                        family = families - 1 - family
                    pulls = turn >= turns - families and done % 2 == 1
                    self.yarns.solve(self, family, turn // families, pulls)
        for part in range(PARTS):
            self.write(part, substeps, 0, wind, values, n, features)

    @ti.func
    def correct_all(self, turn, turns, done, n: Template, features: Template):
        """Ties, fixed shapes, the body; at the end of a substep what is not summed."""
        for one in ti.static([one for one in self.constraints if one.whole and not one.parts and not one.paired]):
            one.correct_whole(self, done, n)
        if ti.static(features.sphere or features.plane):
            for e in range(self.cut[0], self.cut[PARTS]):
                self.touch(self.lanes(self.packet[e] * LANES), n, features)
        for one in ti.static([one for one in self.constraints if one.parts]):
            for part in range(PARTS):
                if turn == 0:
                    one.correct_part(self, part, self.cut[part], self.cut[part + 1], done, n)
                else:
                    one.correct_again(self, part, self.cut[part], self.cut[part + 1], done, n)
        if turn == turns:
            for one in ti.static([one for one in self.constraints if one.paired]):
                if done % 2 == 1:
                    one.correct_whole(self, done, n)

    @ti.func
    def soft(self, p, wind, n: Template, features: Template):
        """Steps and positions of the lanes at p but for threads and contact."""
        _, dx, dy, dz = self.accelerate(features, p, p, wind, n)
        for axis, step in ti.static(((0, dx), (1, dy), (2, dz))):
            store(self.position[axis], p, load(self.position[axis], p) + step)
            store(self.step[axis], p, step)
        # Nothing pulls, presses or rubs yet.
        none = ti.Vector([0.0] * LANES)
        for shape, there in ti.static(((BALL, features.sphere), (FLOOR, features.plane))):
            if ti.static(there):
                store(self.pressed[shape], p, none)
                for axis in ti.static(range(3)):
                    store(self.rubbed[shape][axis], p, none)

    @ti.func
    def touch(self, p, n: Template, features: Template):
        """The fixed ball and half space."""
        x, y, z = load(self.position[0], p), load(self.position[1], p), load(self.position[2], p)
        if ti.static(features.sphere):
            u, v, w = x - n.sphere_x, y - n.sphere_y, z - n.sphere_z
            distance = ti.sqrt(ti.max(u * u + v * v + w * w, 1e-12))
            scale = 1.0 / distance
            self.press(BALL, p, u * scale, v * scale, w * scale, n.sphere_radius - distance, n.sphere_friction)
        if ti.static(features.plane):
            depth = n.plane_height - (x * n.plane_x + y * n.plane_y + z * n.plane_z)
            self.press(FLOOR, p, n.plane_x, n.plane_y, n.plane_z, depth, n.plane_friction)

    @ti.func
    def press(self, shape: Template, p, nx, ny, nz, depth, friction):
        """Brings what a shape has pushed the lanes at p by to what keeps them out, `depth` more along n [m], and its
        friction to what stops their slip, at most µ times the push (Coulomb)."""
        # The push of this substep, and by how much it changes.
        free = ti.min(load(self.inverse_mass, p) * 1e30, 1.0)
        was = load(self.pressed[shape], p)
        push = free * ti.max(was + depth, 0.0)
        out = push - was
        store(self.pressed[shape], p, push)
        # The friction that would stop what still slips, cut to Coulomb's cone.
        dx, dy, dz = load(self.step[0], p), load(self.step[1], p), load(self.step[2], p)
        fx, fy, fz = load(self.rubbed[shape][0], p), load(self.rubbed[shape][1], p), load(self.rubbed[shape][2], p)
        along = dx * nx + dy * ny + dz * nz
        gx, gy, gz = fx - dx + along * nx, fy - dy + along * ny, fz - dz + along * nz
        share = ti.min(friction * push / ti.sqrt(gx * gx + gy * gy + gz * gz + 1e-30), 1.0)
        gx, gy, gz = share * gx, share * gy, share * gz
        store(self.rubbed[shape][0], p, gx)
        store(self.rubbed[shape][1], p, gy)
        store(self.rubbed[shape][2], p, gz)
        x, y, z = out * nx + gx - fx, out * ny + gy - fy, out * nz + gz - fz
        for axis, move in ti.static(((0, x), (1, y), (2, z))):
            store(self.position[axis], p, load(self.position[axis], p) + move)
            store(self.step[axis], p, load(self.step[axis], p) + move)

    @ti.kernel
    def tightest(self) -> Float:
        """The largest −λ r/L of a thread in the last frame."""
        most = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            most = self.yarns.tightest()
        return most


@ti.data_oriented
class ChainFrame(YarnFrame):
    """The diagonals as chains: whole lines of shear springs are solved like yarns."""

    families = 4
