"""Strain limit (Provot 1995, "Deformation constraints", section 4): threads that have grown too long are shortened.

Threads are the structural springs. Those near the limit are few: they are listed, and then gone through one after the
other, each seeing what those before it did (Gauss–Seidel, as Provot's own), in turns from the first to the last and
from the last to the first. Both ends of a thread move by the share of their inverse mass, so that momentum is kept and
pinned key points stay. From the steps is taken the speed at which a thread grows, and no more: what was too long before
is mended in positions alone, and so adds no energy of motion.

A sweep mends a thread but hardly the long row that hangs on it. What does not change from substep to substep is the
pull that each has to bear, so a substep begins with that of the one before, and sweeps only add to it or take of it
what turns out too much (warm starting; Catto 2005, "Iterative Dynamics with Temporal Coherence"). So one sweep is
enough where five that begin anew left more. Pulls are part of the state: a run that goes on is the run left alone.

Threads of one direction share key points within their yarn alone. So where frames are parallel loops a yarn is one
thread of the device, which goes along it in the order of the list, and the answer is the list's.
"""

from collections.abc import Callable
from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.capacity import capacity_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.crew import PARTS
from taichi_cloth.motion.stencil import largest, load, load_xyz, near, store
from taichi_cloth.sheet.sheet import LANES, PAD, Sheet, SheetState

__all__ = ["ThreadLimit"]

NEAR = 0.005
"""Share of its length by which a thread may be shorter than the limit and is listed: the others may stretch it."""

KEPT = 0.985
"""Share of a pull with which the next substep begins: a little less than all, so that what threads strike dies out."""

MOST = 1.0
"""Share of its length by which a thread is drawn together, at most, before a sweep looks at it: without an end to it a
start with threads many times too long blows up."""

NONE = -1.0
"""Below what any thread can be: there is none [m²]."""


@ti.data_oriented
class ThreadFields:
    """How much each thread was drawn together for the limit, by its first key point, along rows and across. And lists
    of the threads near the limit or drawn together: those along rows, in the order of their columns,
    and those across, in the order of their rows. So a sweep goes along every yarn from end to end, but the threads next
    to each other in a list are of different yarns, and a processor need not wait for one to begin with the next."""

    def __init__(self, size: int) -> None:
        self.holder: object = None
        self.size, self.turn = size, ti.field(ti.i32, ())
        self.pull = tuple(ti.field(ti.f32, size) for _ in range(2))  # by how much in a substep [m]
        self.count = ti.field(ti.i32, 2)
        self.found, self.found_at, self.along, self.across = (ti.field(ti.i32, size) for _ in range(4))
        self.column = ti.field(ti.i32, size // LANES + 1)
        self.over = tuple(ti.field(ti.f32, size) for _ in range(2))
        self.own, self.near = ti.field(ti.f32, 2 * LANES), ti.field(ti.f32, 2 * LANES)

    @ti.kernel
    def clear(self):
        """No thread is over or listed, also where there is no cloth: what is beside cloth is looked at."""
        for p in range(self.size):
            self.over[0][p] = self.over[1][p] = 0.0
            self.along[p] = self.across[p] = 0

    @ti.func
    def grown(self, points: Template, p, offset, weight: Template, near, pull: Template):
        """By how much the squared length of the threads to p + offset is above `near`² [m²], more where they are drawn
        together; NONE where none is."""
        here = load_xyz(points.position, p)
        x, y, z = points.away(points.position, here, p, offset)
        there = ti.min(load(weight, p) * 1e30, 1.0)
        over = x * x + y * y + z * z - near * near + 1e12 * load(pull, p)
        return there * over + (1.0 - there) * NONE

    @ti.func
    def measure(self, points: Template, p, x, y):
        """By how much the threads of the lanes at p are over what is near, along rows (x) and across (y)."""
        store(self.over[0], p, self.grown(points, p, 1, points.east, x, self.pull[0]))
        store(self.over[1], p, self.grown(points, p, points.row[None], points.north, y, self.pull[1]))

    @ti.func
    def mark(self, points: Template, p):
        """Of the lanes at p, which threads are listed: in place of the lists, where frames are parallel loops."""
        for over, listed, offset in ti.static(
            ((self.over[0], self.along, 1), (self.over[1], self.across, points.row[None]))
        ):
            own = load(over, p)
            near_here = ti.max(load(over, near(p - offset)), own, load(over, near(p + offset)))
            for k in ti.static(range(LANES)):
                listed[p + k] = int(near_here[k] > 0.0 and own[k] > NONE)  # pyright: ignore[reportIndexIssue]

    @routine
    def seek(self, points: Template, x: Float, y: Float):
        """Lists the threads near the limit or drawn together, and those before and after each in its yarn, which may be
        short because it is long: key points that are drawn back and forth between them. x, y: lengths that are near the
        limit, along rows and across [m]."""
        over_x, over_y = ti.static(*self.over)
        along, across = 0, 0
        row = points.row[None]
        for c in range(row + 1):
            self.column[c] = 0
        for e in range(points.cut[0], points.cut[PARTS]):
            self.measure(points, points.lanes(points.packet[e] * LANES), x, y)
        # A thread is listed where it or one beside it in its yarn is over; and how many each column has.
        for e in range(points.cut[0], points.cut[PARTS]):
            p = points.lanes(points.packet[e] * LANES)
            own_x, own_y = load(over_x, p), load(over_y, p)
            near_x = ti.max(load(over_x, near(p - 1)), own_x, load(over_x, near(p + 1)))
            near_y = ti.max(load(over_y, near(p - row)), own_y, load(over_y, near(p + row)))
            if largest(ti.max(near_x, near_y)) > 0.0:
                store(self.own, 0, own_x)
                store(self.own, LANES, own_y)
                store(self.near, 0, near_x)
                store(self.near, LANES, near_y)
                first = p % row
                for k in range(LANES):
                    if self.near[k] > 0.0 and self.own[k] > NONE:
                        self.found[along], self.found_at[along] = p + k, first + k
                        self.column[first + k + 1] += 1
                        along += 1
                    if self.near[LANES + k] > 0.0 and self.own[LANES + k] > NONE:
                        self.across[across] = p + k
                        across += 1
        # Those along rows in the order of their columns (counting sort).
        for c in range(row):
            self.column[c + 1] += self.column[c]
        for k in range(along):
            c = self.found_at[k]
            self.along[self.column[c]] = self.found[k]
            self.column[c] += 1
        self.count[0], self.count[1] = along, across

    @routine
    def pull_again(self, points: Template):
        """Draws together the threads of the lists as in the last substep."""
        self.pull_all(points, self.along, self.count[0], 1, self.pull[0])
        self.pull_all(points, self.across, self.count[1], points.row[None], self.pull[1])

    @ti.func
    def go_along(
        self, points: Template, listed: Template, pull: Template, first, offset, count, longest, back, again: Template
    ):
        """A yarn: of its threads that are marked, drawn together as in the last substep, where `again`, or to
        `longest`. first: its first key point; offset: to the next; count: how many."""
        for k in range(count):
            p = first + (count - 1 - k if back else k) * offset
            if listed[p] > 0:
                if ti.static(again):
                    self.pull_one(points, p, offset, pull)
                else:
                    self.shorten_one(points, p, offset, longest, pull)

    @ti.func
    def pull_all(self, points: Template, listed: Template, count, offset, pull: Template):
        for k in range(count):
            self.pull_one(points, listed[k], offset, pull)

    @ti.func
    def pull_one(self, points: Template, p, offset, pull: Template):
        """The thread from p to p + offset, as in the last substep."""
        x, y, z = ti.static(*points.position)
        q = p + offset
        if pull[p] > 0.0:
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            pull[p] *= KEPT
            share = pull[p] / ti.sqrt(ti.max(dx * dx + dy * dy + dz * dz, 1e-20))
            self.draw(points, p, q, dx, dy, dz, share, share)

    @routine
    def shorten(self, points: Template, back: Int, x: Float, y: Float):
        """Every thread of the lists once, from their first to their last or back, to x along rows and y across [m]."""
        self.shorten_all(points, self.along, self.count[0], 1, x, self.pull[0], back)
        self.shorten_all(points, self.across, self.count[1], points.row[None], y, self.pull[1], back)

    @ti.func
    def shorten_all(self, points: Template, listed: Template, count, offset, longest, pull: Template, back):
        """Every thread of a list."""
        for k in range(count):
            self.shorten_one(points, listed[count - 1 - k if back else k], offset, longest, pull)

    @ti.func
    def shorten_one(self, points: Template, p, offset, longest, pull: Template):
        """The thread from p to p + offset to `longest` [m] where it is longer, or lets it grow to that where it was
        pulled too much."""
        x, y, z = ti.static(*points.position)
        u, v, w = ti.static(*points.step)
        q = p + offset
        dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        squared = dx * dx + dy * dy + dz * dz
        if squared > longest * longest or pull[p] > 0.0:
            length = ti.sqrt(ti.max(squared, 1e-20))
            scale = 1.0 / length
            # Shares of its length: what it is too long by, what it grows by in this step, what the step loses.
            over = 1.0 - longest * scale
            growth = ((u[q] - u[p]) * dx + (v[q] - v[p]) * dy + (w[q] - w[p]) * dz) * scale * scale
            slow = ti.max(ti.min(growth, over), -pull[p] * scale)
            if over < 0.0:
                over = slow
            pull[p] = ti.min(ti.max(pull[p] + slow * length, 0.0), MOST * longest)
            self.draw(points, p, q, dx, dy, dz, over, slow)

    @ti.func
    def draw(self, points: Template, p, q, dx, dy, dz, over, slow):
        """Draws p and q together by a share of their distance (dx, dy, dz) [m], and their steps by another."""
        x, y, z = ti.static(*points.position)
        u, v, w = ti.static(*points.step)
        # Each end by its share of the inverse masses.
        free = points.inverse_mass[p] + points.inverse_mass[q]
        here = points.inverse_mass[p] / ti.max(free, 1e-30)
        there = points.inverse_mass[q] / ti.max(free, 1e-30)
        x[p] += here * over * dx
        y[p] += here * over * dy
        z[p] += here * over * dz
        u[p] += here * slow * dx
        v[p] += here * slow * dy
        w[p] += here * slow * dz
        x[q] -= there * over * dx
        y[q] -= there * over * dy
        z[q] -= there * over * dz
        u[q] -= there * slow * dx
        v[q] -= there * slow * dy
        w[q] -= there * slow * dz


class ThreadLimit(SharedConstraint):
    """The limit of one sheet's threads; how far they may grow stands in the solver's `Numbers`."""

    fields_of = ThreadFields
    answers = "strain_limit"
    whole = True
    repeated = True
    remembers = 2
    spreads = True

    def __init__(self, sheet: Sheet) -> None:
        self._size = capacity_of(sheet.padded_shape)

    @property
    def kind(self) -> tuple[int]:
        return (self._size,)

    def fill(self, state: SheetState) -> None:
        self.fields.clear()

    def rescale(self, state: SheetState, share: float) -> None:
        state.values[6:8] *= share**2  # what a force does in a step

    def loop(self, loops: Any, again: bool) -> Callable[..., Any]:
        return self._along_yarns(loops, False)

    def warm_loops(self, loops: Any) -> tuple[Callable[..., Any], ...]:
        fields, points, packets = self.fields, loops.frame, loops.packets

        @ti.kernel
        def mark():
            for e in range(packets):
                if loops.now() % 2 == 0:
                    n = points.shared()
                    x, y = n.longest_x - NEAR * n.spacing_x, n.longest_y - NEAR * n.spacing_y
                    fields.measure(points, points.lanes(points.packet[e] * LANES), x, y)
            for e in range(packets):
                if loops.now() % 2 == 0:
                    fields.mark(points, points.lanes(points.packet[e] * LANES))

        return mark, self._along_yarns(loops, True)

    def _along_yarns(self, loops: Any, again: bool) -> Callable[..., Any]:
        fields, points = self.fields, loops.frame
        rows, width = loops.padded_shape[0] - 2 * PAD, loops.padded_shape[1]
        first = PAD * width

        @ti.kernel
        def go():
            for i in range(rows):
                back, longest = 0 if ti.static(again) else fields.turn[None] % 2, points.shared().longest_x
                fields.go_along(points, fields.along, fields.pull[0], first + i * width, 1, width, longest, back, again)
            for j in range(width):
                back, longest = 0 if ti.static(again) else fields.turn[None] % 2, points.shared().longest_y
                fields.go_along(points, fields.across, fields.pull[1], first + j, width, rows, longest, back, again)
            for _ in range(1):
                fields.turn[None] = loops.now() if ti.static(again) else fields.turn[None] + 1

        return go

    @ti.func
    def open(self, points: Template, values: Template, p):
        for axis in ti.static(range(2)):
            store(self.fields.pull[axis], p, load(values, points.plane_at(6 + axis, p)))

    @ti.func
    def open_one(self, values: Template, p, i, j):
        for axis in ti.static(range(2)):
            self.fields.pull[axis][p] = values[6 + axis, i, j]

    @ti.func
    def close(self, points: Template, values: Template, p):
        for axis in ti.static(range(2)):
            store(values, points.plane_at(6 + axis, p), load(self.fields.pull[axis], p))

    @ti.func
    def close_one(self, values: Template, p, i, j):
        for axis in ti.static(range(2)):
            values[6 + axis, i, j] = self.fields.pull[axis][p]

    @ti.func
    def warm_start(self, points: Template, done, n: Template):
        if done % 2 == 0:  # what comes near within a substep is seen to in the next
            self.fields.seek(points, n.longest_x - NEAR * n.spacing_x, n.longest_y - NEAR * n.spacing_y)
        self.fields.pull_again(points)
        self.fields.turn[None] = done

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        self.fields.shorten(points, self.fields.turn[None] % 2, n.longest_x, n.longest_y)
        self.fields.turn[None] += 1
