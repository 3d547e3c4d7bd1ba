"""The stages of a frame with whole yarns: soft springs explicitly, then warp and weft in turns, and what touches them.

    of each substep:
        move      shear, bending, gravity, wind: where key points would be without their threads
        touch     fixed shapes, the body
        of each sweep, more of them at the end of a frame where threads are not solved yet:
            solve     the yarns of one family, then those of the other; who begins alternates. Where shear is stiff
                      the diagonals are families too
            touch     again; what it pushed and held in this substep may grow or be taken back

Contact and friction are sums over the substep: taken anew in each sweep they would hold several times as much.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.motion.stencil import BALL, FLOOR, largest, load, load_xyz, nothing, rub_anew, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.whole_yarns import WholeYarns
from taichi_cloth.solvers.yarn_fields import ASKED
from taichi_cloth.solvers.yarn_order import GROUPS

__all__ = ["ChainFrame", "YarnFrame"]

MOST_SWEEPS, UNSOLVED = 6, 0.01
"""Sweeps at most of a substep, or of a frame that is taken again, since ties and the body have made a thread longer
than its yarn was solved for, by such a share of its length; those that are not LONG may be (`yarns.py`)."""


@ti.data_oriented
class YarnFrame(Frame):
    """yarns: their systems. pressed, rubbed: [shape], [shape][axis], what a fixed shape has pushed key points by in
    this substep, and its friction [m]."""

    sums = True
    families = 2

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
        self.yarns = WholeYarns(size, self.families, cloths)
        whole = [one for one in constraints if one.whole and not one.parts and not one.paired]
        self.last = [one for one in whole if one.stops and any(other.parts for other in constraints)]
        self.first = [one for one in whole if one not in self.last]
        self.pressed = [ti.field(ti.f32, self.size) for _ in (BALL, FLOOR)]
        self.rubbed = [[ti.field(ti.f32, self.size) for _ in range(3)] for _ in (BALL, FLOOR)]

    @ti.func
    def stages(self, thread, values: Template, n: Template, wind, change, first, last, fresh, features: Template):
        families = ti.static(self.families)
        turns = families * ti.cast(n.sweeps, ti.i32)
        self.begins(thread)
        stage, ended = self.in_parts(self.open, thread, 0, 0, first, fresh, wind, values, n, features)
        self.ends(thread, "state")
        for done in range(first, last):
            air = wind + done * change
            stage, ended = self.in_parts(self.prepare, thread, stage, ended, done, 0, air, values, n, features)
            self.ends(thread, "ahead")
            if ti.static(features.slips):
                stage, ended = self.in_parts(self.slip, thread, stage, ended, done, 0, air, values, n, features)
                stage, ended = self.in_parts(self.spread, thread, stage, ended, done, 0, air, values, n, features)
                self.ends(thread, "friction within")
            stage, ended = self.in_parts(self.soften, thread, stage, ended, done, 0, air, values, n, features)
            self.ends(thread, "springs")
            turn, end, watched = 0, turns, done >= ti.cast(self.yarns.numbers[0].watched, ti.i32)
            while turn <= end:
                if turn % families == 0:
                    stage, ended = self.correct_all(thread, stage, ended, turn, turns, done, values, n, features)
                    if watched and turn >= turns:
                        stage, ended = self.in_parts(
                            self.miss, thread, stage, ended, done, turn, air, values, n, features
                        )
                        stage, ended = self.judge_missed(thread, stage, ended, done, turn)
                        self.ends(thread, "threads")
                        end = ti.max(end, ti.cast(self.yarns.missed[ASKED + done], ti.i32))
                if turn < end:
                    family = turn % families
                    if done % 2 == 1:
                        family = families - 1 - family
                    pulls = turn >= turns - families and done % 2 == 1
                    stage, ended = self.solve(thread, stage, ended, family, turn // families, pulls)
                    self.ends(thread, "threads")
                turn += 1
        self.in_parts(self.write, thread, stage, ended, last, 0, wind, values, n, features)
        self.ends(thread, "state")

    @ti.func
    def solve(self, thread, stage, ended, family, sweep, pulls):
        """One stage: a sweep over the yarns of a family. Returns as `in_parts`."""
        here, goal = stage + 1, ended + GROUPS
        for turn in range(GROUPS):
            group = self.crew.take(thread, turn, here, GROUPS, goal)
            if group >= 0:
                self.yarns.solve(self, family, group, sweep, pulls)
                self.crew.finish()
        self.crew.meet(goal)
        return here, goal

    @ti.func
    def correct_all(self, thread, stage, ended, turn, turns, done, values: Template, n: Template, features: Template):
        """Stages: ties, fixed shapes, the body; at the end of a substep what is not summed. Cloth on cloth comes after
        a body: what two limbs pinch gives way into them, not through other cloth. Returns as `in_parts`."""
        here, goal = stage, ended
        for one in ti.static(self.first):
            here, goal = self.correct(one, thread, here, goal, done, n)
        if ti.static(features.sphere or features.plane):
            end = int(turn == turns)
            here, goal = self.in_parts(self.touch_all, thread, here, goal, done, end, 0.0, values, n, features)
            self.ends(thread, "shapes")
        for one in ti.static([one for one in self.constraints if one.parts]):
            here, goal = here + 1, goal + PARTS
            for look in range(PARTS):
                part = self.crew.take(thread, look, here, PARTS, goal)
                if part >= 0:
                    if turn == 0:
                        one.correct_part(self, part, self.cut[part], self.cut[part + 1], done, n)
                    else:
                        one.correct_again(self, part, self.cut[part], self.cut[part + 1], done, n)
                    self.crew.finish()
            self.crew.meet(goal)
            self.ends(thread, one)
        if turn == turns and done % 2 == 1:
            for one in ti.static([one for one in self.constraints if one.paired]):
                here, goal = self.correct(one, thread, here, goal, done, n)
        for one in ti.static(self.last):
            here, goal = self.correct(one, thread, here, goal, done, n)
        return here, goal

    @ti.func
    def miss(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """What threads of a part are longer by than they pull says."""
        found = nothing()
        for e in range(self.cut[part], self.cut[part + 1]):
            for family in ti.static(range(2)):
                found = ti.max(found, self.yarns.unsolved(self, self.lanes(self.packet[e] * LANES), family))
        store(self.yarns.missed, part * LINE, found)

    @ti.func
    def judge_missed(self, thread, stage, ended, done, turn):
        """One stage, by one thread: whether there is another sweep in substep `done`, after turn `turn`."""
        here, goal = stage + 1, ended + 1
        if self.crew.take(thread, 0, here, 1, goal) == 0:
            most = 0.0
            for part in range(PARTS):
                most = ti.max(most, largest(load(self.yarns.missed, part * LINE)))
            if most > UNSOLVED and turn < MOST_SWEEPS * ti.static(self.families):
                self.yarns.missed[ASKED + done] = ti.cast(turn + ti.static(self.families), ti.f32)
            self.crew.finish()
        self.crew.meet(goal)
        return here, goal

    @ti.func
    def open(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """`read`; at the start of a frame threads that nothing pulls."""
        self.read(part, done, at, wind, values, n, features)
        if done == 0:
            if part == 0:
                self.yarns.begin_frame()
            for e in range(self.cut[part], self.cut[part + 1]):
                self.yarns.loosen(self.lanes(self.packet[e] * LANES))

    @ti.func
    def prepare(self, part, done, at, wind, values: Template, n: Template, features: Template):
        if part == 0:
            self.yarns.judge()
            self.yarns.missed[ASKED + done] = 0.0
            self.before_springs(done, n)
        self.lead_part(part, n)

    @ti.func
    def soften(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """`soft` of a part."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            self.soft(p, wind, self.own(p, n), features)

    @ti.func
    def touch_all(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """`touch` of a part. at: whether it is the last turn of the substep."""
        for e in range(self.cut[part], self.cut[part + 1]):
            self.touch(self.lanes(self.packet[e] * LANES), at, n, features)

    @ti.func
    def soft(self, p, wind, n: Template, features: Template):
        """Steps and positions of the lanes at p but for threads and contact."""
        _, dx, dy, dz = self.accelerate(features, p, p, wind, n)
        for axis, step in ti.static(((0, dx), (1, dy), (2, dz))):
            store(self.position[axis], p, load(self.position[axis], p) + step)
            store(self.step[axis], p, step)
        # Nothing pulls, presses or rubs yet.
        none = nothing()
        for shape, there in ti.static(((BALL, features.sphere), (FLOOR, features.plane))):
            if ti.static(there):
                store(self.pressed[shape], p, none)
                for axis in ti.static(range(3)):
                    store(self.rubbed[shape][axis], p, none)

    @ti.func
    def touch(self, p, at, n: Template, features: Template):
        """The fixed ball and half space. at: as of `touch_all`."""
        x, y, z = load(self.position[0], p), load(self.position[1], p), load(self.position[2], p)
        if ti.static(features.sphere):
            u, v, w = x - n.sphere_x, y - n.sphere_y, z - n.sphere_z
            squared = ti.max(u * u + v * v + w * w, 1e-12)
            if self.near(BALL, p, n.sphere_radius * n.sphere_radius - squared):
                distance = ti.sqrt(squared)
                scale, depth = 1.0 / distance, n.sphere_radius - distance
                self.press(BALL, p, u * scale, v * scale, w * scale, depth, n.sphere_friction)
                if ti.static(features.grips):
                    self.hold(BALL, p, at, (u * scale, v * scale, w * scale), n.sphere_friction)
        if ti.static(features.plane):
            depth = n.plane_height - (x * n.plane_x + y * n.plane_y + z * n.plane_z)
            if self.near(FLOOR, p, depth):
                self.press(FLOOR, p, n.plane_x, n.plane_y, n.plane_z, depth, n.plane_friction)
                if ti.static(features.grips):
                    self.hold(FLOOR, p, at, (n.plane_x, n.plane_y, n.plane_z), n.plane_friction)

    @ti.func
    def near(self, shape: Template, p, depth):
        """Whether a shape has pushed any of the lanes at p in this substep, or is about to, as `depth` is above 0.
        To others it does nothing."""
        return largest(ti.max(depth, load(self.pressed[shape], p))) > 0.0

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
        # Its friction, and by how much that changes.
        dx, dy, dz = load(self.step[0], p), load(self.step[1], p), load(self.step[2], p)
        fx, fy, fz = load(self.rubbed[shape][0], p), load(self.rubbed[shape][1], p), load(self.rubbed[shape][2], p)
        gx, gy, gz = rub_anew(nx, ny, nz, push, friction, dx, dy, dz, fx, fy, fz)
        store(self.rubbed[shape][0], p, gx)
        store(self.rubbed[shape][1], p, gy)
        store(self.rubbed[shape][2], p, gz)
        x, y, z = out * nx + gx - fx, out * ny + gy - fy, out * nz + gz - fz
        for axis, move in ti.static(((0, x), (1, y), (2, z))):
            store(self.position[axis], p, load(self.position[axis], p) + move)
            store(self.step[axis], p, load(self.step[axis], p) + move)

    @ti.func
    def hold(self, shape: Template, p, at, normal: Template, friction):
        """What a shape keeps in place of what it has pressed and rubbed in this substep. at: as of `touch_all`."""
        if at != 0:
            taken = load_xyz(self.rubbed[shape], p)
            here = load_xyz(self.position, p)
            way = self.grip.back(shape, p, normal, friction * load(self.pressed[shape], p), taken, here)
            for axis in ti.static(range(3)):
                store(self.position[axis], p, here[axis] + way[axis])

    @ti.kernel
    def tightest(self) -> Float:
        """The largest −λ r/L of a thread in the last frame."""
        most = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            most = self.yarns.tightest()
        return most

    @ti.kernel
    def unsolved(self) -> Float:
        """The largest of `WholeYarns.unsolved` after the last frame."""
        most = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            found = nothing()
            for e in range(self.cut[PARTS]):
                for family in ti.static(range(2)):
                    found = ti.max(found, self.yarns.unsolved(self, self.lanes(self.packet[e] * LANES), family))
            most = largest(found)
        return most


@ti.data_oriented
class ChainFrame(YarnFrame):
    """The diagonals as chains: whole lines of shear springs are solved like yarns."""

    families = 4
