"""The middles of springs against thin solids as parallel loops (`contact_middles.py` has the law, and the serial form).

A packet of 8 key points has the springs that begin in it, those of each family side by side in the lanes, and for each
family slots, one behind the other: a thin solid that one of these springs can come near, and when to look at it again.
Where in the room for all of them a packet has its slots says who came first, and nothing depends on it. So packets
share nothing else they write, until it comes to the response, which moves both ends of a spring: of a family every
second row or column of springs at once, then the others. On a CPU springs are gone through in the order of the list
instead; where two that share an end touch at once, who comes first differs.
"""

from typing import Any

import taichi as ti

from taichi_cloth.constraints.contact_planes import GROWTH, TURNING
from taichi_cloth.constraints.contact_response import Response
from taichi_cloth.constraints.middle_response import middle_of, respond, room_for
from taichi_cloth.ground.arrays import I32x1, Template
from taichi_cloth.motion.stencil import load, near, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["MiddleLoops"]

FAMILIES = 4
PLANE = 4 * LANES
FAR = -1e6  # offset [m] of a plane that nothing touches


@ti.data_oriented
class MiddleLoops:
    """surface: the body's. solid: numbers of the thin ones. used: slots at the last look for springs near them; most:
    ever. first, count: of each packet and family, its first slot, and how many it has. Of each slot: owner, due, busy
    (whether one of its planes can be touched before the next look), and plane."""

    solids: Any  # its number is the bound of a loop: type checkers would take it for a matrix
    count: Any
    first: Any
    used: Any

    def __init__(self, surface: Response, size: int) -> None:
        self.surface, packets = surface, size // LANES
        self.packets, self.slots = packets, room_for(size) // LANES
        self.holder: object = None
        self.solid, self.solids = ti.field(ti.i32, surface.capacity), ti.field(ti.i32, ())
        self.used, self.most = (ti.field(ti.i32, ()) for _ in range(2))
        self.first, self.count = (ti.field(ti.i32, FAMILIES * packets) for _ in range(2))
        self.owner, self.due, self.busy = (ti.field(ti.i32, self.slots) for _ in range(3))
        self.plane = ti.field(ti.f32, self.slots * PLANE)
        self.place = ti.field(ti.f32, packets * 3 * LANES)

    @ti.kernel
    def take(self, solids: I32x1):
        for k in range(solids.shape[0]):
            self.solid[k] = solids[k]
        for _ in range(1):
            self.solids[None], self.used[None], self.most[None] = solids.shape[0], 0, 0

    @ti.func
    def ends(self, family, p, row):
        """Both ends of the springs of a family that begin at element p: along the weft, along the warp, diagonals."""
        one = p + ti.select(family == 3, 1, 0)
        two = p + ti.select(family == 0, 1, row + ti.select(family == 2, 1, 0))
        return near(one), near(two)

    @ti.func
    def weight(self, points: Template, family, p):
        return ti.select(family == 0, points.east[p], ti.select(family == 1, points.north[p], points.cell[p]))

    @ti.func
    def look_all(self, points: Template, e, done):
        """Of packet e of the sheet: lists before each walk of the tree, and what is due of them."""
        packet = points.packet[e]
        if done % int(self.surface.wait[None]) == 0:
            self.seek(points, packet, done)
        for family in range(FAMILIES):
            g = family * self.packets + packet
            for slot in range(self.count[g]):
                s = self.first[g] + slot
                self.busy[s] = 0
                if self.due[s] <= done:
                    self.look(points, family, packet, s, e, done)

    @ti.func
    def seek(self, points: Template, packet, done):
        """Slots for the thin solids that middles of the springs of a packet could touch before the next time."""
        total = 0
        for family in range(FAMILIES):
            found = 0
            for m in range(self.solids[None]):
                if self.can_meet(points, family, packet, self.solid[m]):
                    found += 1
            self.count[family * self.packets + packet] = found
            total += found
        self.first[packet] = 0
        if total > 0:
            self.first[packet] = ti.atomic_add(self.used[None], total)
        at = self.first[packet]
        for family in range(FAMILIES):
            g = family * self.packets + packet
            self.first[g] = at
            if self.count[g] > 0:
                for m in range(self.solids[None]):
                    if self.can_meet(points, family, packet, self.solid[m]):
                        if at < self.slots:
                            self.owner[at], self.due[at] = self.solid[m], done
                        at += 1
            self.count[g] = ti.max(ti.min(at, self.slots) - self.first[g], 0)

    @ti.func
    def count_up(self):
        """After all have looked: one thread alone."""
        self.most[None] = ti.max(self.most[None], self.used[None])
        self.used[None] = 0

    @ti.func
    def can_meet(self, points: Template, family, packet, i):
        """Whether one of them is near solid i, by the capsule around it, and is to meet it."""
        row, meets = points.row[None], False
        c, axis, shift = self.surface.anchor(i), self.surface.axis(i), self.surface.shift(i)
        turn = self.surface.turn(i).norm()
        for p in range(packet * LANES, (packet + 1) * LANES):
            one, two = self.ends(family, p, row)
            spared = ((self.surface.spared[one] | self.surface.spared[two]) >> self.surface.bone(i)) & 1
            if self.weight(points, family, p) > 0.0 and self.mobile(points, one, two) > 0.0 and spared == 0:
                x, u = middle_of(points, one, two)
                x, u = x - c, u - shift
                along = ti.min(ti.max(x.dot(axis), self.surface.low(i)), self.surface.high(i))
                far = (x - along * axis).norm() - self.surface.radius(i) - self.surface.gap[None]
                rate = self.surface.spare_step[None] + GROWTH * (u.norm() + turn * x.norm())
                if far < self.surface.wait[None] * rate:
                    meets = True
        return meets

    @ti.func
    def mobile(self, points: Template, one, two):
        return points.inverse_mass[one] + points.inverse_mass[two]

    @ti.func
    def look(self, points: Template, family, packet, s, part, done):
        """Distances of 8 springs from the solid of slot s, when to look again, and planes for those that could touch
        before. part: whose lanes of scratch are used."""
        row, i, every = points.row[None], self.owner[s], int(self.surface.every[None])
        q, o = self.surface.scratch_of(part), near(part * 3) * LANES
        c = self.surface.anchor(i)
        one, two = self.ends(family, points.lanes(packet * LANES), row)
        # Middles against the anchor, their distances d and normals n, and the slip (u, v, w) past the surface.
        for axis in ti.static(range(3)):
            both = load(points.position[axis], one) + load(points.position[axis], two)
            store(self.place, o + axis * LANES, 0.5 * both - c[axis])
        x, y, z = load(self.place, o), load(self.place, o + LANES), load(self.place, o + 2 * LANES)
        self.surface.measure(i, q, x, y, z)
        u = 0.5 * (load(points.step[0], one) + load(points.step[0], two))
        v = 0.5 * (load(points.step[1], one) + load(points.step[1], two))
        w = 0.5 * (load(points.step[2], one) + load(points.step[2], two))
        u, v, w = self.surface.slip(i, x, y, z, u, v, w)
        d, nx = load(self.surface.scratch, q), load(self.surface.scratch, q + LANES)
        ny, nz = load(self.surface.scratch, q + 2 * LANES), load(self.surface.scratch, q + 3 * LANES)
        away, along = ti.max(d - self.surface.gap[None], 0.0), u * nx + v * ny + w * nz
        rate = self.surface.spare_step[None] + GROWTH * ti.max(-along, 0.0) + TURNING * ti.sqrt(u * u + v * v + w * w)
        store(self.surface.scratch, q, away / rate)
        store(self.place, o, x * nx + y * ny + z * nz - d)
        # Planes, and the soonest of what is there.
        soonest = 1e6
        for k in range(LANES):
            p = packet * LANES + k
            here, there = self.ends(family, p, row)
            spared = ((self.surface.spared[here] | self.surface.spared[there]) >> self.surface.bone(i)) & 1
            met = self.weight(points, family, p) > 0.0 and self.mobile(points, here, there) > 0.0 and spared == 0
            at, offset = s * PLANE + k, FAR
            if met:
                arrives = self.surface.scratch[q + k]
                soonest = ti.min(soonest, arrives)
                if arrives < every:
                    offset = self.place[o + k]
                    self.busy[s] = 1
            for m in ti.static(range(3)):
                self.plane[at + m * LANES] = self.surface.scratch[q + (m + 1) * LANES + k]
            self.plane[at + 3 * LANES] = offset
        self.due[s] = done + ti.max(int(soonest) // every, 1) * every

    @ti.func
    def respond(self, points: Template, family: Template, odd: Template, p, since):
        """Of the springs of a family that begin at element p of the sheet, where its row or column is even, or odd.
        since: substeps since the poses were worked out."""
        row = points.row[None]
        line = p // row
        if ti.static(family == 0):
            line = p % row
        g = family * self.packets + p // LANES
        if line % 2 == odd and self.count[g] > 0 and self.weight(points, family, p) > 0.0:
            one, two = self.ends(family, p, row)
            for slot in range(self.count[g]):
                s = self.first[g] + slot
                at = s * PLANE + p % LANES
                if self.busy[s] > 0 and self.plane[at + 3 * LANES] > 0.5 * FAR:
                    normal = ti.Vector([self.plane[at], self.plane[at + LANES], self.plane[at + 2 * LANES]])
                    offset = self.plane[at + 3 * LANES]
                    respond(self.surface, points, self.owner[s], one, two, normal, offset, since)
