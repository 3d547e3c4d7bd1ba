"""The middles of springs against what is too thin for the key points to keep out (`thin_limbs.py`; paper 4.1).

They meet the same surfaces by the same law as key points (`contact_response.py`), right after these: a middle that
stands deeper than the gap is pushed out along the normal, which takes its velocity towards the surface and no more,
and is held by friction. A push of the middle by δ moves each end by 2 δ w / (w₁ + w₂), w its inverse mass: both get
the same impulse, so that no moment about the middle is made, and a pinned end stays.

Springs are those that hold the sheet in its plane: along the weft, along the warp, and both diagonals of each cell.
Every 16 milliseconds those that could come near a thin solid are listed, by a capsule around it. Eight at a time their
distances are measured, again when one of them could touch; what could touch soon gets a plane. Only these are gone
through every substep, one after the other in a fixed order, each seeing what those before it did. A middle that gets
from one side of a limb to the other within one step is not seen.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_planes import GROWTH, TURNING
from taichi_cloth.constraints.contact_response import Response
from taichi_cloth.constraints.middle_loops import MiddleLoops
from taichi_cloth.constraints.middle_response import respond, room_for
from taichi_cloth.ground.arrays import Float, I32x1, Int, Template
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.motion.capacity import capacity_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.crew import PARTS
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.motion.stencil import load, relative, store
from taichi_cloth.sheet.sheet import LANES, Sheet, SheetState

__all__ = ["MiddleContact"]

FAMILIES = 4
PLANE = 4  # normal, offset from the anchor


@ti.data_oriented
class MiddleFields:
    """Springs near thin solids, in groups of LANES that are near the same one, and the planes that they may touch."""

    # Numbers of these are bounds of loops: type checkers would take them for matrices.
    solids: Any
    groups: Any
    entries: Any

    def __init__(self, surface: Response, size: int) -> None:
        self.surface, self.room = surface, room_for(size)
        self.holder: object = None
        self.solid, self.solids = ti.field(ti.i32, surface.capacity), ti.field(ti.i32, ())
        self.groups, self.most, self.entries = (ti.field(ti.i32, ()) for _ in range(3))
        self.looked = ti.field(ti.i32, ())  # substep of the frame in which it was last seen what may touch
        self.one, self.two = (ti.field(ti.i32, self.room + LANES) for _ in range(2))  # ends of each spring
        self.owner, self.due = (ti.field(ti.i32, self.room // LANES + 1) for _ in range(2))  # of each group
        self.place = ti.field(ti.f32, 6 * LANES)  # of the group at work: middles against the anchor, and their steps
        self.entry, self.plane = ti.field(ti.i32, self.room), ti.field(ti.f32, PLANE * self.room)

    @ti.kernel
    def take(self, solids: I32x1):
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(solids.shape[0]):
            self.solid[k] = solids[k]
        self.solids[None] = solids.shape[0]

    @routine
    def touch(self, points: Template, done: Int, reach: Float):
        """Response of the middles at the end of substep `done`, to poses that `Contact` has just brought up to date.
        reach: of a spring [m], at most."""
        since = done % int(self.surface.every[None])
        if since == 0 and self.looked[None] != done:  # whole yarns ask several times in a substep
            self.looked[None] = done
            if done % int(self.surface.wait[None]) == 0:
                self.seek(points, done, reach)
            self.entries[None] = 0
            for g in range(self.groups[None]):
                if self.due[g] <= done:
                    self.look(points, g, done)
        for e in range(self.entries[None]):
            self.respond(points, e, float(since))

    @routine
    def seek(self, points: Template, done: Int, reach: Float):
        """Lists the springs whose middles could reach a thin solid before the next time."""
        found = 0
        for s in range(self.solids[None]):
            i, begun = self.solid[s], found // LANES
            for e in range(points.cut[0], points.cut[PARTS]):
                if self.near(points, points.packet[e], i, reach):
                    found = self.enlist(points, points.packet[e], i, found)
            while found % LANES != 0:  # a group is of one solid; the rest of the last is empty
                if found < self.room:
                    self.one[found] = -1
                found += 1
            for g in range(begun, ti.min(found, self.room) // LANES):
                self.owner[g], self.due[g] = i, done
        self.most[None] = ti.max(self.most[None], found)
        self.groups[None] = ti.min(found, self.room) // LANES

    @ti.func
    def near(self, points: Template, packet, i, reach):
        """Whether a middle not farther than `reach` [m] from a packet's key point could touch solid i before the next
        time: by the capsule around it."""
        # Key points against the anchor, steps (u, v, w) against its own; what its turn adds to those at most.
        a = points.lanes(packet * LANES)
        c, axis, shift = self.surface.anchor(i), self.surface.axis(i), self.surface.shift(i)
        x, y, z = relative(points.position, a, c)
        u, v, w = relative(points.step, a, shift)
        turning = self.surface.turn(i).norm() * (ti.sqrt(x * x + y * y + z * z) + reach)
        # From the capsule, less what the spring reaches, less what may be covered until the next time.
        along = x * axis[0] + y * axis[1] + z * axis[2]
        along = ti.min(ti.max(along, self.surface.low(i)), self.surface.high(i))
        x, y, z = x - along * axis[0], y - along * axis[1], z - along * axis[2]
        far = ti.sqrt(x * x + y * y + z * z) - self.surface.radius(i) - self.surface.gap[None] - reach
        rate = self.surface.spare_step[None] + GROWTH * (ti.sqrt(u * u + v * v + w * w) + turning)
        store(self.place, 0, far - self.surface.wait[None] * rate)
        least = self.place[0]
        for k in range(1, LANES):
            least = ti.min(least, self.place[k])
        return least < 0.0

    @ti.func
    def enlist(self, points: Template, packet, i, found):
        """Appends the springs that begin in a packet. Returns how many there are then."""
        row = points.row[None]
        for k in range(packet * LANES, (packet + 1) * LANES):
            for family in range(FAMILIES):  # along the weft, along the warp, both diagonals of the cell
                p, q, weight = k, k + 1, points.east[k]
                if family == 1:
                    q, weight = k + row, points.north[k]
                elif family >= 2:
                    weight = points.cell[k]
                    p, q = k + family - 2, k + row + 3 - family
                met = weight > 0.0 and points.inverse_mass[p] + points.inverse_mass[q] > 0.0
                spared = self.surface.spared[p] | self.surface.spared[q]
                met = met and (spared >> self.surface.bone(i)) & 1 == 0
                if met:
                    if found < self.room:
                        self.one[found], self.two[found] = p, q
                    found += 1
        return found

    @routine
    def look(self, points: Template, g: Int, done: Int):
        """Distances of a group from its solid, and when to look again; planes for those that could touch before."""
        i, every = self.owner[g], int(self.surface.every[None])
        c, q = self.surface.anchor(i), self.surface.scratch_of(0)
        # The middles against the anchor, and their steps; what is missing in a group stands far off.
        for k in range(LANES):
            p1, p2 = self.one[g * LANES + k], self.two[g * LANES + k]
            for axis in ti.static(range(3)):
                x, u = 1e6, 0.0
                if p1 >= 0:
                    x = 0.5 * (points.position[axis][p1] + points.position[axis][p2]) - c[axis]
                    u = 0.5 * (points.step[axis][p1] + points.step[axis][p2])
                self.place[axis * LANES + k], self.place[(axis + 3) * LANES + k] = x, u
        # Distances d, normals n, and the slip (u, v, w) past the surface.
        x, y, z = load(self.place, 0), load(self.place, LANES), load(self.place, 2 * LANES)
        self.surface.measure(i, q, x, y, z)
        u, v, w = load(self.place, 3 * LANES), load(self.place, 4 * LANES), load(self.place, 5 * LANES)
        u, v, w = self.surface.slip(i, x, y, z, u, v, w)
        d, nx = load(self.surface.scratch, q), load(self.surface.scratch, q + LANES)
        ny, nz = load(self.surface.scratch, q + 2 * LANES), load(self.surface.scratch, q + 3 * LANES)
        # In how many substeps each could touch, and the offset of its plane.
        away, along = ti.max(d - self.surface.gap[None], 0.0), u * nx + v * ny + w * nz
        rate = self.surface.spare_step[None] + GROWTH * ti.max(-along, 0.0) + TURNING * ti.sqrt(u * u + v * v + w * w)
        store(self.surface.scratch, q, away / rate)
        store(self.place, 0, x * nx + y * ny + z * nz - d)
        # Planes for those that could before the next look.
        soonest, e = 1e6, self.entries[None]
        for k in range(LANES):
            arrives = self.surface.scratch[q + k]
            soonest = ti.min(soonest, arrives)
            if arrives < every:
                self.entry[e] = g * LANES + k
                for m in ti.static(range(3)):
                    self.plane[e * PLANE + m] = self.surface.scratch[q + (m + 1) * LANES + k]
                self.plane[e * PLANE + 3] = self.place[k]
                e += 1
        self.entries[None] = e
        self.due[g] = done + ti.max(int(soonest) // every, 1) * every

    @ti.func
    def respond(self, points: Template, e, since):
        """Of one entry. since: substeps since the poses were worked out."""
        k, normal = self.entry[e], ti.Vector([0.0, 0.0, 0.0])
        for axis in ti.static(range(3)):
            normal[axis] = self.plane[e * PLANE + axis]
        offset = self.plane[e * PLANE + 3]
        respond(self.surface, points, self.owner[k // LANES], self.one[k], self.two[k], normal, offset, since)


def middle_fields(surface: Response, size: int, spread: bool) -> MiddleFields | MiddleLoops:
    return MiddleLoops(surface, size) if spread else MiddleFields(surface, size)


class MiddleContact(SharedConstraint):
    """Of one sheet, after the contact of its key points. solids: numbers (n,) of those that the middles meet."""

    fields_of = staticmethod(middle_fields)
    known_as = "thin limbs"
    whole = True
    spreads = True

    def __init__(self, contact: Contact, sheet: Sheet, solids: NDArray[np.int32]) -> None:
        self.contact, self.solids, self._size = contact, solids, capacity_of(sheet.padded_shape)

    @property
    def kind(self) -> tuple[Response, int, bool]:
        return self.contact.fields, self._size, self.spread

    def loop(self, loops: Any, again: bool) -> Callable[..., Any]:
        fields, points = self.fields, loops.frame

        @ti.kernel
        def middles():
            if ti.static(not again):
                for e in range(loops.packets):
                    if loops.now() % int(fields.surface.every[None]) == 0:
                        fields.look_all(points, e, loops.now())
            for family, odd in ti.static(ti.ndrange(FAMILIES, 2)):
                for t in range(loops.packets * LANES):
                    if ti.static(family == 0 and odd == 0):  # noqa: SIM102 (one is known when it is compiled)
                        if t == 0:
                            fields.count_up()
                    p = points.packet[t // LANES] * LANES + t % LANES
                    since = loops.now() % int(fields.surface.every[None])
                    fields.respond(points, family, odd, p, float(since))

        return middles

    def fill(self, state: SheetState) -> None:
        self.fields.take(self.solids)

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        if not self.spread:
            self.fields.most[None], self.fields.looked[None] = 0, -1

    def end(self, state: SheetState) -> None:
        """Raises InputError where there was no room for all springs near thin solids."""
        found = self.fields.most[None]
        room = self.fields.slots * LANES if self.spread else self.fields.room
        if self.spread:
            found *= LANES
        if found > room:
            raise InputError(
                f"contact: {found} springs near thin parts of the body, room for {room}; use key points closer together"
            )

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        self.fields.touch(points, done, n.diagonal_length)
