"""Where cloth may touch a body, looked for inside the frame's kernel: 8 neighbouring key points at once, a packet.

Four stages, ever more often and ever cheaper: a packet's list of primitives from the tree (`walk`), with the time
before which none of its key points can touch each; exact distances to those whose time has come (`look`), which leave a
plane for each key point; whether one has `moved` too far for its plane; and after every substep the response to the
planes (`contact_response.py`).

A plane lasts until its key point has slid by a hundredth of the least radius of curvature, or by half of its distance
when it was looked at: of one that touches the normal is then off by 10 mrad, and it lies 2 µm off a limb of 40 mm.
Cloth that sticks to a limb keeps its planes.

A packet's lists and planes are its own, so parts of the sheet on several threads share nothing they write.
"""

from typing import Any

import taichi as ti

from taichi_cloth.constraints.contact_entries import ENTRY, FACED, GAP, OFFSET, RUBS, Entries
from taichi_cloth.constraints.contact_surface import BOX
from taichi_cloth.ground.arrays import F32x1, Float, I32x1, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.motion.stencil import Lanes, load, load_xyz, relative, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Planes"]

KEPT = 4
"""Planes a packet may have for each key point and keep. Of more than that the nearest are merged into one, which lasts
until the next look; beside it there is room for the plane that is merged."""
SLOTS = KEPT + 2
PLANE = 8
"""Numbers of a plane for each key point: its normal at the look, from 0; from the anchor, OFFSET: how far the plane is,
and PLACE: where the key point was; LASTS: how far it may slide from there [m]."""
PLACE, LASTS = 4 * LANES, 7 * LANES
SOON = 6
"""Substeps. What may touch within them gets its planes now: a response to them costs a fifth of a look."""
GROWTH = 1.25  # of the approach to a surface until the next look at it
TURNING = 0.25  # share of the slip that may become approach meanwhile


@ti.data_oriented
class Planes(Entries):
    """Lists and planes of padded grids of up to `size` key points."""

    # Its numbers are bounds of loops: type checkers would take them for matrices.
    count: Any

    def __init__(
        self,
        size: int,
        capacity: int,
        kinds: tuple[int, ...],
        long_steps: bool,
        nodes: int,
        parts: int = PARTS,
        line: int = LINE,
    ) -> None:
        super().__init__(size, SLOTS, capacity, kinds, nodes, parts, line)
        self.long_steps = long_steps
        blocks = size // LANES
        self.count, self.next = ti.field(ti.i32, blocks), ti.field(ti.i32, blocks)
        self.list, self.due = ti.field(ti.i32, blocks * capacity), ti.field(ti.i32, blocks * capacity)
        self.used = ti.field(ti.i32, blocks)  # a bit a slot
        self.owner, self.pair, self.looked = (ti.field(ti.i32, blocks * SLOTS) for _ in range(3))
        self.plane = ti.field(ti.f32, blocks * SLOTS * PLANE * LANES)

    @ti.kernel
    def take_constant(self, values: F32x1, spared: I32x1):
        """values: of all distance grids. spared: of the elements of the padded grid."""
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(values.shape[0]):
            self.nodes[k] = values[k]
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(spared.shape[0]):
            self.spared[p] = spared[p]

    @routine
    def walk(self, points: Template, part: Int, packet: Int, done: Int):
        """A packet's list: what it can reach until the next walk, by boxes and then by capsules, and when."""
        # The packet: the box of its free key points, that of their steps, the longest step.
        low, high = ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        fastest, slow, fast = 0.0, ti.Vector([1e30, 1e30, 1e30]), ti.Vector([-1e30, -1e30, -1e30])
        spared, some = -1, 0  # by every key point of the packet, and by any
        for k in range(packet * LANES, (packet + 1) * LANES):
            if points.inverse_mass[k] > 0.0:
                here, step = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0])
                for c in ti.static(range(3)):
                    here[c], step[c] = points.position[c][k], points.step[c][k]
                low, high = ti.min(low, here), ti.max(high, here)
                slow, fast = ti.min(slow, step), ti.max(fast, step)
                fastest = ti.max(fastest, step.norm_sqr())
                spared &= self.spared[k]
                some |= self.spared[k]
        count, faces, soonest = 0, 0, 1 << 24
        if self.between[None] < 0.0:
            some = 0
        if low[0] < 1e29:  # pyright: ignore[reportIndexIssue]
            # How near a box must be to be met before the next walk; the packet as a ball that moves.
            wait = self.wait[None]
            margin = self.gap[None] + wait * (self.spare_step[None] + GROWTH * ti.sqrt(fastest))
            middle, radius = 0.5 * (low + high), 0.5 * (high - low).norm()  # pyright: ignore[reportOptionalCall]
            step, spread = 0.5 * (slow + fast), 0.5 * (fast - slow).norm()  # pyright: ignore[reportOptionalCall]
            # The tree in depth-first order: past a box that is out of reach, `skip` leads on behind its children.
            node, nodes = 0, int(self.boxes[None])
            while node < nodes:
                q = node * BOX
                apart = 0.0
                for k in ti.static(range(3)):
                    apart = ti.max(apart, self.box[q + k] - high[k], low[k] - self.box[q + 3 + k])  # pyright: ignore[reportIndexIssue]
                if apart > margin:
                    node = self.skip[node]
                else:
                    i = self.leaf[node]
                    bone = self.bone(ti.max(i, 0))
                    met, faced = 1 - ((spared >> bone) & 1), (some >> bone) & 1
                    if i >= 0 and (met | faced) == 1:
                        # A leaf: how fast the ball slips over it at most, and so when it could touch first.
                        here = middle - self.anchor(i)
                        u, v, w = self.slip(i, here[0], here[1], here[2], step[0], step[1], step[2])  # pyright: ignore[reportIndexIssue]
                        slip = ti.sqrt(u * u + v * v + w * w) + spread + radius * self.turn(i).norm()
                        rate = self.spare_step[None] + GROWTH * slip
                        free = (self.apart(points, part, packet, i) - self.gap[None]) / rate
                        if free < wait and faced == 1 and faces < FACED:
                            self.faced[packet * FACED + faces] = i
                            faces += 1
                        if free < wait and met == 1:
                            due = done + ti.max(int(free), 0)
                            self.list[packet * self.capacity + count] = i
                            self.due[packet * self.capacity + count] = due
                            soonest = ti.min(soonest, due)
                            count += 1
                    node += 1
        self.count[packet], self.next[packet], self.used[packet] = count, soonest, 0
        self.faces[packet] = faces

    @ti.func
    def apart(self, points: Template, part, packet, i):
        """Least distance [m] of the packet's free key points from the capsule around primitive i."""
        a = points.lanes(packet * LANES)
        q = self.scratch_of(part)
        # Away from the nearest place of the capsule's axis; pinned and absent key points are put far off.
        c, axis = self.anchor(i), self.axis(i)
        x, y, z = relative(points.position, a, c)
        along = x * axis[0] + y * axis[1] + z * axis[2]
        along = ti.min(ti.max(along, self.low(i)), self.high(i))
        x, y, z = x - along * axis[0], y - along * axis[1], z - along * axis[2]
        free = ti.min(load(points.inverse_mass, a) * 1e30, 1.0)
        store(self.scratch, q, x * x + y * y + z * z + (1.0 - free) * 1e12)
        least = self.scratch[q]
        for k in range(q + 1, q + LANES):
            least = ti.min(least, self.scratch[k])
        return ti.sqrt(least) - self.radius(i)

    @ti.func
    def change(self, u, v, w, nx, ny, nz, push, pressed, friction):
        """What a push along the normal changes, at a slip (u, v, w) [m], with friction of as much of it as presses."""
        along = u * nx + v * ny + w * nz
        u, v, w = u - along * nx, v - along * ny, w - along * nz
        held = ti.min(friction * pressed / ti.sqrt(u * u + v * v + w * w + 1e-30), 1.0)
        return push * nx - held * u, push * ny - held * v, push * nz - held * w

    @routine
    def cross(self, points: Template, a: Int, i: Int, q: Int, free: Lanes):
        """Where a long step of the lanes at a meets the primitive on its way it is pushed back to the first such place:
        so far that it stays outside."""
        # Places against the anchor and steps past the surface; pieces of a quarter of the thinnest primitive.
        gap, c = self.gap[None], self.anchor(i)
        x, y, z = relative(points.position, a, c)
        dx, dy, dz = load_xyz(points.step, a)
        u, v, w = self.slip(i, x, y, z, dx, dy, dz)
        longest = ti.sqrt((free * (u * u + v * v + w * w)).max())
        pieces = ti.min(int(longest / (0.25 * self.thinnest[None])), 64)
        # From where the step began on: normal and push at the first place that lies too deep.
        nx, ny, nz, push = 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x
        for j in range(1, pieces):
            left = 1.0 - j / float(pieces)
            self.measure(i, q, x - left * u, y - left * v, z - left * w)
            d, ax = load(self.scratch, q), load(self.scratch, q + LANES)
            ay, az = load(self.scratch, q + 2 * LANES), load(self.scratch, q + 3 * LANES)
            depth = free * ti.max(gap - d, 0.0)
            hit = ti.select((depth > 0.0) & (push == 0.0), 1.0, 0.0)
            nx, ny, nz = nx + hit * (ax - nx), ny + hit * (ay - ny), nz + hit * (az - nz)
            push += hit * (depth + left * ti.max(-(u * ax + v * ay + w * az), 0.0))
        # The response there, all of it as of what presses.
        u, v, w = self.change(u, v, w, nx, ny, nz, push, push, self.friction[None])
        for axis, more in ti.static(((0, u), (1, v), (2, w))):
            store(points.position[axis], a, load(points.position[axis], a) + more)
            store(points.step[axis], a, load(points.step[axis], a) + more)

    @routine
    def look(self, points: Template, part: Int, packet: Int, i: Int, slot: Int) -> Float:
        """Planes of a packet on primitive i, into a slot. Returns the substeps until one of them could be touched."""
        a = points.lanes(packet * LANES)
        q = self.scratch_of(part)
        o = self.lanes_of(slot, PLANE)
        c = self.anchor(i)
        # 1 for key points that meet this primitive, 0 for those that are pinned, absent or spared.
        free = ti.min(load(points.inverse_mass, a) * 1e30, 1.0)
        met = 1 - ((load(self.spared, a) >> self.bone(i)) & 1)
        free *= ti.cast(met, ti.f32)
        if ti.static(self.long_steps):
            self.cross(points, a, i, q, free)
        # Distances d and normals n; the slip (u, v, w) of the step past the surface.
        x, y, z = relative(points.position, a, c)
        self.measure(i, q, x, y, z)
        d, nx = load(self.scratch, q), load(self.scratch, q + LANES)
        ny, nz = load(self.scratch, q + 2 * LANES), load(self.scratch, q + 3 * LANES)
        dx, dy, dz = load_xyz(points.step, a)
        u, v, w = self.slip(i, x, y, z, dx, dy, dz)
        # The plane n · x = offset, far below those it is not for; where the key point was, how far it may slide.
        store(self.plane, o, nx)
        store(self.plane, o + LANES, ny)
        store(self.plane, o + 2 * LANES, nz)
        store(self.plane, o + OFFSET, x * nx + y * ny + z * nz - d - (1.0 - free) * 1e6)
        away, pinned = ti.max(d - self.gap[None], 0.0), (1.0 - free) * 1e6
        store(self.plane, o + PLACE, x)
        store(self.plane, o + PLACE + LANES, y)
        store(self.plane, o + PLACE + 2 * LANES, z)
        lasts = 0.0 * away if ti.static(self.long_steps) else ti.max(0.5 * away, self.slide(i))
        store(self.plane, o + LASTS, lasts + pinned)
        # By how much the gap shrinks in a substep at most, and so in how many it could be closed.
        along = u * nx + v * ny + w * nz
        share = ti.static(GROWTH if self.long_steps else TURNING)
        rate = self.spare_step[None] + GROWTH * ti.max(-along, 0.0) + share * ti.sqrt(u * u + v * v + w * w)
        store(self.scratch, q, away / rate + pinned)
        arrives = 1e6
        for k in range(q, q + LANES):
            arrives = ti.min(arrives, self.scratch[k])
        return arrives

    @ti.func
    def moved(self, points: Template, part, slot, done):
        """Whether a key point has slid further over the primitive from where it was looked at than its plane lasts."""
        a = points.lanes(slot // SLOTS * LANES)
        o = self.lanes_of(slot, PLANE)
        q = self.scratch_of(part)
        i = self.owner[slot]
        # The way (u, v, w) from where each key point was at the look, in the axes that the primitive had then.
        c, m = self.anchor(i), self.turned(i, float(done - self.looked[slot]))
        x, y, z = relative(points.position, a, c)
        u = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z - load(self.plane, o + PLACE)
        v = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z - load(self.plane, o + PLACE + LANES)
        w = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z - load(self.plane, o + PLACE + 2 * LANES)
        # Of it what is along the surface; squares, so that the sign tells.
        out = u * load(self.plane, o) + v * load(self.plane, o + LANES) + w * load(self.plane, o + 2 * LANES)
        lasts = load(self.plane, o + LASTS)
        store(self.scratch, q, u * u + v * v + w * w - out * out - lasts * lasts)
        most = self.scratch[q]
        for k in range(q + 1, q + LANES):
            most = ti.max(most, self.scratch[k])
        return most >= 0.0

    @ti.func
    def merge(self, points: Template, packet, kept, new):
        """Slot `kept` takes, for each key point of the packet, the plane of slot `new` where nearer. It moves on as the
        primitive that has the slot, until the next look."""
        other = self.anchor(self.owner[kept])
        mine = self.anchor(self.owner[new])
        for lane in range(LANES):
            j, k = kept * PLANE * LANES + lane, new * PLANE * LANES + lane
            # How far the key point is above either plane, and what the new offset gains from the kept anchor.
            one, two, shift = -self.plane[j + OFFSET], -self.plane[k + OFFSET], 0.0
            for c in ti.static(range(3)):
                x = points.position[c][packet * LANES + lane]
                one += self.plane[j + c * LANES] * (x - other[c])
                two += self.plane[k + c * LANES] * (x - mine[c])
                shift += self.plane[k + c * LANES] * (mine[c] - other[c])
            if two < one:
                self.plane[k + OFFSET] = self.plane[k + OFFSET] + shift
                for c in range(4):
                    self.plane[j + c * LANES] = self.plane[k + c * LANES]

    @routine
    def refresh(self, points: Template, part: Int, packet: Int, done: Int):
        """Looks at those of the packet's list whose time has come."""
        base, pairs = packet * SLOTS, packet * self.capacity
        # Planes that still last.
        used = self.used[packet] & ((1 << KEPT) - 1)
        for k in range(KEPT):
            if (used >> k) & 1 == 1 and self.due[pairs + self.pair[base + k]] <= done:
                used ^= 1 << k
        # The others of the list, each into the first free slot, or merged with the last.
        every, soonest = int(self.every[None]), 1 << 24
        for c in range(self.count[packet]):
            if self.due[pairs + c] <= done:
                i, k = self.list[pairs + c], 0
                while k < KEPT + 1 and (used >> k) & 1 == 1:
                    k += 1
                slot = base + k
                arrives = self.look(points, part, packet, i, slot)
                due = done + ti.max(int(arrives) // every, 1) * every
                # Its planes are kept if one could touch soon: until they have turned too far, or the next look.
                if arrives < ti.max(SOON, every):
                    self.owner[slot], self.pair[slot], self.looked[slot] = i, c, done
                    if k < KEPT:
                        due = done + ti.max(int(self.most_turn[None] / (self.turn(i).norm() + 1e-9)), every)
                    else:
                        due = done + every
                    if k <= KEPT:
                        used |= 1 << k
                    else:
                        self.merge(points, packet, slot - 1, slot)
                self.due[pairs + c] = due
            soonest = ti.min(soonest, self.due[pairs + c])
        self.used[packet], self.next[packet] = used, soonest

    @ti.func
    def look_all(self, points: Template, part, first, last, done):
        """Lists, planes and entries of a part, packets number `first` to `last`, at the end of substep `done`."""
        if done % int(self.wait[None]) == 0:
            for m in range(first, last):
                self.walk(points, part, points.packet[m], done)
        # Whose planes last no longer looks again; all planes there are become entries.
        e = first * SLOTS
        for m in range(first, last):
            packet = points.packet[m]
            used = self.used[packet]
            if used != 0:
                for k in range(KEPT):
                    slot = packet * SLOTS + k
                    if (used >> k) & 1 == 1 and self.moved(points, part, slot, done):
                        self.due[packet * self.capacity + self.pair[slot]] = done
                        self.next[packet] = done
            if self.next[packet] <= done:
                self.refresh(points, part, packet, done)
            used = self.used[packet]
            if used != 0:
                begun = e
                if self.faces[packet] > 0:
                    self.face(points, part, packet)
                for k in range(KEPT + 1):
                    if (used >> k) & 1 == 1:
                        self.enter(packet * SLOTS + k, e, packet, done)
                        if self.faces[packet] > 0:
                            self.give_way(points, e)
                        e += 1
                if self.between[None] >= 0.0 and e - begun > 1:
                    self.give_between(points, begun, e)
        self.entries[part * self.line] = e

    @ti.func
    def enter(self, slot, e, packet, done):
        """A slot's planes as entry e, turned as its primitive has."""
        i = self.owner[slot]
        m = self.turned(i, float(done - self.looked[slot]))
        self.entry_block[e], self.entry_of[e] = packet, i
        o = self.lanes_of(slot, PLANE)
        q = self.lanes_of(e, ENTRY)
        x, y, z = load(self.plane, o), load(self.plane, o + LANES), load(self.plane, o + 2 * LANES)
        for k in ti.static(range(3)):
            store(self.entry, q + k * LANES, m[k, 0] * x + m[k, 1] * y + m[k, 2] * z)
        store(self.entry, q + OFFSET, load(self.plane, o + OFFSET))
        store(self.entry, q + GAP, 0.0 * x + self.gap[None])
        store(self.entry, q + RUBS, 0.0 * x + self.friction[None])
