"""What cloth that meets cloth does between substeps: searches, contacts and proofs, interval by interval.

A frame is cut into intervals of a few substeps. At the start of each are known: all pairs that are near (from the last
searches), a direction that parts each, and the contacts of the interval. In the interval contacts answer within each
substep. At its end

1. key points that have left the room round their path are pulled back to it (few ever do);
2. the certificate is made out: no near pair has passed through the other (`certificate.py`);
3. it is proven that no other pair can have met: no room and no slack is used up (`paths.py`, `patches.py`);
4. the next interval's length follows from how fast room is used up. Key points that would use up too much of theirs
   in it get a new path, and what has to do with them is searched; all is where that are many, or where it was too long
   ago.

Everything follows from the state at the start of the frame, and one thread does it: the same bytes each time.
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, Float, I32x1, I32x2, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.layers.blends import Blends
from taichi_cloth.layers.certificate import Certificate
from taichi_cloth.layers.contacts import Contacts
from taichi_cloth.layers.near_pairs import NearPairs
from taichi_cloth.layers.nearest import EDGES, FACES
from taichi_cloth.layers.paths import POINT, Paths
from taichi_cloth.layers.pieces import Pieces
from taichi_cloth.layers.search import Search, Sieve
from taichi_cloth.layers.tree import LEVELS, Tree
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.motion.stencil import listed, load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["MOVED", "NUMBERS", "SHIFT", "UNPROVEN", "LayerFields"]

NEXT, FAR, SHARE = 2, 17, 0.12
"""Intervals that a search of all is good for, at least and at most: a frame of 1/30 s, in whatever steps; and for how
much of the room that key points use up which do not go on as those round them."""
EDGE_SHARE = 0.5
"""Of the thickness that edges keep: layers that lie flat are kept apart by their points."""
TURNS, MOST_SPENT = 2, 0.2
"""Searches of what has used up its room, one after the other, as others have less by the last; and of which share of
all at most. If that is not enough all is searched."""
ENOUGH = 0.95
"""Share that others may come to in the next interval after a search of some."""
SHIFT = 1 << 13
"""More than a frame has substeps."""
MOVED, UNPROVEN = 1, 2
"""Bits of what `LayerFields.stop` says."""
NUMBERS = (
    *("thickness", "friction", "reach", "coarse", "margin", "spacing_x", "spacing_y", "most", "held"),
    *("0", "1", "2", "3"),
)
"""What `LayerFields.take` is told, the last by the levels of patches."""


@ti.data_oriented
class LayerFields:
    """All of it, for padded grids of up to `size` elements, and up to `blends` points that are blends of them.
    clock: is told where parts end. position, step, inverse_mass, row: as of `Stencil`, between substeps. use: share of
    room and slack that a search is used for. began, ends: substeps at which the interval did and is over. horizon:
    substeps that the search of all is good for. longest, free: of intervals. substeps: of the frame. searches: of all;
    renewals: of some; intervals, unproven, pulled, retaken: of the frame.
    allowed: how long intervals may be, since one was taken again. moved: whether the last proof has moved anything."""

    def __init__(self, size: int, blends: int, clock: StageClock | None = None) -> None:
        self.holder: object = None
        self.clock: Any = clock  # its functions are called where it is one
        self.timed = clock is not None
        elements = size + blends
        self.position, self.step = ([ti.field(ti.f32, elements) for _ in range(3)] for _ in range(2))
        self._moved = [*self.position, *self.step]
        self.inverse_mass, self.row = ti.field(ti.f32, elements), ti.field(ti.i32, ())
        self.blends, self.pieces = Blends(elements, blends), Pieces(size, blends)
        self.paths, self.tree, self.search, self.sieve = Paths(size), Tree(size), Search(size), Sieve()
        self.near, self.contacts, self.certificate = NearPairs(size), Contacts(size, blends), Certificate()
        self.reach, self.coarse, self.use = (ti.field(ti.f32, ()) for _ in range(3))
        self.began, self.ends, self.horizon, self.longest, self.free, self.substeps = (
            ti.field(ti.i32, ()) for _ in range(6)
        )
        self.searches, self.renewals, self.intervals, self.unproven, self.pulled, self.retaken, self.allowed = (
            ti.field(ti.i32, ()) for _ in range(7)
        )
        self.moved = ti.field(ti.i32, ())

    @ti.kernel
    def take(self, width: Int, labels: I32x2, inverse: F32x1, levels: I32x2, numbers: F32x1):
        """labels: (2, elements of the padded grid), what each has, and its panel. inverse: mass of each [1/kg].
        numbers: of `NUMBERS`."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.row[None] = width
            self.paths.count[None] = labels.shape[1] // LANES
            self.tree.take(levels, 1.0 / numbers[5], 1.0 / numbers[6])
            self.near.take(width)
            self.near.thickness[None], self.near.edge_share[None] = numbers[0], EDGE_SHARE
            self.near.most[None], self.paths.held[None] = numbers[7], numbers[8]
            self.near.spacing[0], self.near.spacing[1] = numbers[5], numbers[6]
            self.contacts.friction[None], self.contacts.margin[None] = numbers[1], numbers[4]
            self.reach[None], self.coarse[None] = numbers[2], numbers[3]
            for level in range(LEVELS):
                self.search.least[level] = numbers[9 + ti.min(level, 3)]
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(labels.shape[1]):
            self.paths.has[p] = labels[0, p]
            self.inverse_mass[p] = inverse[p]
            self.paths.there[p] = ti.cast((labels[0, p] & POINT) != 0, ti.f32)
            self.near.panel[p] = labels[1, p]

    @ti.kernel
    def take_outline(
        self,
        # blends
        count: Int,
        at: I32x1,
        starts: I32x1,
        nodes: I32x1,
        weights: F32x1,
        # pieces
        first: I32x2,
        points: I32x2,
        faces: I32x2,
        edges: I32x2,
        elements: F32x2,
    ):
        """After `take`: of `Tables`."""
        self.blends.take(self, count, at, starts, nodes, weights)
        self.pieces.take(first, points, faces, edges, elements)

    @ti.kernel
    def take_tangles(self, labels: I32x1):
        """labels: of the elements of the padded grid, see `Tangles.labels`."""
        ti.loop_config(serialize=ti.static(on_host()))
        for p in range(labels.shape[0]):
            self.near.tangle[p] = labels[p]

    @ti.kernel
    def start(self, longest: Int, free: Int, substeps: Int, use: Float, lets: Int):
        """Before a frame. lets: whether pairs that nothing parts are let off."""
        self.use[None], self.certificate.lets[None] = use, lets
        self.longest[None], self.free[None], self.substeps[None] = longest, free, substeps
        self.search.overflow[None] = 0
        self.near.overflow[None] = 0
        self.contacts.overflow[None] = 0
        self.contacts.most[None] = 0
        self.contacts.clear()
        self.contacts.blended.overflow[None] = 0
        self.certificate.pushed[None] = 0
        self.certificate.returned[None] = 0
        self.certificate.let_off[None] = 0
        self.searches[None] = 0
        self.renewals[None] = 0
        self.intervals[None] = 0
        self.unproven[None] = 0
        self.pulled[None] = 0
        self.retaken[None] = 0

    @ti.func
    def stamp(self, name: Template):
        """A part, and what passed since the last one did is its time."""
        if ti.static(self.timed):
            self.clock.end(name, 0)

    @ti.kernel
    def stop(self, values: F32x1, done: Int, kept: Int) -> Int:
        """Between two intervals. values: of a `SheetState`, in a row. Returns up to which substep the next goes, times
        SHIFT, plus from which: an earlier one than `done` where the last is taken again; and × SHIFT² bits of whether
        key points were moved, and of whether an interval of the frame is unproven. kept: the plane of values from which
        on contacts are kept from frame to frame, or −1."""
        begun, said = done, 0
        ti.loop_config(serialize=True)
        for _ in range(1):
            if ti.static(self.timed):
                self.clock.start(0)
            self.copy(values, True)
            self.blends.refresh(self)
            self.stamp("copies")
            if done == 0:
                if kept >= 0:
                    self.contacts.before.load(values, kept * self.grid(), self.grid())
                self.open(self)
            else:
                before = self.retaken[None]
                self.close(self, done)
                if self.retaken[None] > before:
                    begun = self.began[None]
                elif done == self.substeps[None] and kept >= 0:
                    self.contacts.keep(self, values, kept * self.grid(), self.grid())
                if self.moved[None] != 0:
                    self.copy(values, False)
                said = ti.select(self.moved[None] != 0, MOVED, 0) + ti.select(self.unproven[None] > 0, UNPROVEN, 0)
                self.stamp("copies")
        return (said * SHIFT + self.ends[None]) * SHIFT + begun

    @ti.func
    def copy(self, values: Template, here: Template):
        """Positions and steps from what the host holds, or back."""
        for e in range(self.paths.count[None]):
            p = self.paths.packet(e)
            for plane, field in ti.static(enumerate(self._moved)):
                at = listed(plane * self.grid() + p)  # bounded, or they would be copied one by one
                host = load(values, at)
                if ti.static(here):
                    store(field, p, host)
                else:
                    store(values, at, ti.select(load(self.blends.of, p) < 0, load(field, p), host))

    @ti.func
    def grid(self):
        """Elements of the padded grid."""
        return self.paths.count[None] * LANES

    @routine
    def open(self, points: Template):
        """A frame: the first search."""
        self.search_all(points, 0.0, self.substeps[None])
        self.paths.keep(points)
        most = ti.select(self.alone(), self.free[None], self.longest[None])
        self.allowed[None] = self.free[None]
        self.begin(points, 0, ti.min(most, self.substeps[None]), True)

    @ti.func
    def alone(self):
        """Whether nothing is near anything."""
        return self.near.pairs.count[FACES] + self.near.pairs.count[EDGES] == 0

    @routine
    def search_all(self, points: Template, span: Float, left: Int):
        """A search of all, from paths that begin here. span: see `Paths.predict`. left: substeps of the frame."""
        self.searches[None] = self.searches[None] + 1
        self.paths.spend_all()
        self.paths.predict(points, span)
        good = SHARE * 0.5 * self.reach[None] / ti.max(self.paths.rough[None], 1e-7)
        most = ti.min(ti.max(ti.cast(good, ti.i32), NEXT * self.longest[None]), FAR * self.longest[None])
        parts = (left + most - 1) // most
        self.horizon[None] = (left + parts - 1) // parts
        self.look(points, 1)

    @routine
    def search_spent(self, points: Template, span: Float):
        """A search of what gets a new path."""
        self.renewals[None] = self.renewals[None] + 1
        self.paths.predict(points, span)
        self.look(points, 0)

    @routine
    def look(self, points: Template, whole: Int):
        """A search. whole: whether nothing is known."""
        reach, coarse = self.reach[None], self.coarse[None]
        ahead = ti.cast(self.horizon[None] - self.paths.since[None], ti.f32)
        self.stamp("paths")
        self.tree.cells(points, self.paths, ahead, whole)
        self.pieces.reach(points, self.paths, self.tree, ahead)
        self.tree.rise(whole)
        self.tree.fit(whole)
        self.stamp("boxes")
        self.search.begin(self.tree, reach + coarse)
        top = self.tree.top[None]
        for down in range(top):
            level = top - down
            self.search.descend(self.tree, level, reach + ti.select(level > 1, coarse, 0.0))
        self.stamp("descent")
        self.sieve.sift(points, self.paths, self.tree, self.search, reach, ahead)
        self.stamp("sieve")
        if whole != 0:
            self.near.none()
        else:
            self.near.thin(points, self.tree, self.search)
            self.stamp("thin")
        self.near.bend(points, self.paths)
        self.paths.stray(points.row[None])
        self.near.find(points, self.paths, self.tree, self.search, reach)
        self.stamp("near pairs")
        self.pieces.find(points, self.paths, self.tree, self.search, self.near, reach)
        self.stamp("near pieces")
        self.tree.settle(points, self.paths)
        self.pieces.settle(points, self.paths, self.tree)
        self.stamp("boxes")

    @ti.func
    def begin(self, points: Template, done, length, woken: Template):
        """An interval. woken: whether those that may touch have to be found first, as after a search."""
        ahead = ti.cast(length, ti.f32)
        if ti.static(woken):
            for kind in range(FACES, EDGES + 1):
                self.contacts.wake(points, self.near.pairs, kind, ahead)
        self.contacts.next(points, self.near, ahead)
        self.stamp("contacts")
        self.began[None], self.ends[None] = done, done + length
        self.intervals[None] = self.intervals[None] + 1

    @routine
    def close(self, points: Template, done: Int):
        """The interval that ends with `done` substeps of the frame, and the start of the next. A long one in which
        anything left its room, or passed through other cloth by much, is taken again, half as long: to put it back
        would draw its threads long, and they would throw it further."""
        span = done - self.began[None]
        self.paths.since[None] = self.paths.since[None] + span
        self.paths.measure(points)
        self.moved[None] = 0
        used, before = self.paths.used[None], self.certificate.pushed[None]
        long = span > ti.max(self.longest[None] // 2, 1)
        again = used > 0.999 and long
        self.stamp("paths")
        if not again:
            if used > 0.999:
                self.paths.pull_back(points, span)
                self.blends.refresh(points)
                self.pulled[None] = self.pulled[None] + 1
            ahead = ti.cast(self.longest[None], ti.f32) / span
            self.certificate.settle(points, self.paths, self.contacts, self.near, ahead, ti.cast(long, ti.i32))
            again = self.certificate.deep[None] > 0
        if again or used > 0.999 or self.certificate.pushed[None] > before:
            self.moved[None] = 1
        if again:
            self.certificate.pushed[None] = before
            self.paths.go_back(points, span)
            self.blends.refresh(points)
            self.retaken[None] = self.retaken[None] + 1
            self.allowed[None] = span // 2
            self.begin(points, self.began[None], span // 2, True)
        else:
            if used > 0.999 or self.certificate.pushed[None] > before:
                self.paths.measure(points)
            if self.paths.used[None] > 1.0 or self.certificate.bad[None] > 0:
                self.unproven[None] = self.unproven[None] + 1
            self.stamp("proof")
            self.allowed[None] = ti.min(self.allowed[None] + ti.max(1, self.allowed[None] // 4), self.free[None])
            left = self.substeps[None] - done
            if left > 0:
                self.go_on(points, done, left, span)

    @ti.func
    def go_on(self, points: Template, done, left, span):
        """The next interval; before it a search, of all or of what has used up its room."""
        most = ti.select(self.alone(), self.free[None], self.longest[None])
        wanted = ti.min(ti.min(most, self.allowed[None]), left)
        length = ti.max(1, ti.min(wanted, ti.cast(self.use[None] / ti.max(self.paths.rate[None], 1e-5), ti.i32)))
        whole, anew, turn = self.paths.since[None] + length > self.horizon[None], False, 0
        while not whole and turn <= TURNS:
            allowed = ti.select(turn == 0, self.use[None], ENOUGH)
            spent = self.paths.spend(allowed, ti.cast(length, ti.f32))
            if spent == 0:
                turn = TURNS + 1
            elif turn == TURNS or spent > MOST_SPENT * LANES * ti.cast(self.paths.count[None], ti.f32):
                whole = True
            else:
                self.search_spent(points, ti.cast(span, ti.f32))
                self.paths.measure(points)
                anew = True
                turn += 1
        if whole:
            self.search_all(points, ti.cast(span, ti.f32), left)
        self.paths.keep(points)
        if anew or whole:
            self.begin(points, done, length, True)
        else:
            self.begin(points, done, length, False)
