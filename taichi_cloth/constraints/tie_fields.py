"""Closing ties inside the frame's kernel, all at once by a matrix that is known or one after the other (`ties.py`)."""

from typing import Any

import taichi as ti

from taichi_cloth.constraints.beside_ties import BesideFields
from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, I32x2, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.motion.stencil import load, nothing, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["ALLOWED", "EAGER", "MOST", "NODES", "PATH", "USUAL", "TieFields"]

NODES = 8
SHARE = NODES
ROW = 2 * NODES
"""Numbers of a tie that stay: weights, shares w/m / Σ w²/m."""
ALLOWED = 6
USUAL = ALLOWED + 2
MOST = USUAL + 3
PATH = MOST + 1
"""Numbers of a tie for a frame: target at its start [m] and how far it moves, width allowed at its start [m] and how
that changes, what it is usually pushed by in a substep, and what it bears in one at most [m]."""

EAGER = 7
"""Of the numbers of all ties: above 0 where something is learnt from ties that are closed one after the other."""

FRESH, PUSHED = -1, -2
"""In place of how many ties are listed, in a substep: nothing was done yet; what those before were pushed by."""

SLACK = 1e-4
"""By how much a tie has to be too wide to be seen to more than once in a substep [m]: few are."""

LEAST = 0.1
"""Share of MOVING of `ties.py` that a tie which lies learns as if it had: a curtain that is hung still must learn."""

LOOKS = 4
"""Substeps from one look at all threads beside ties to the next, and in the last of a frame; those that are nearly too
long then are looked at in each."""

TURNS = 8
"""At most, of threads beside ties and these. Walking, 45 frames: with 4 of them 24 threads of a pair of trousers were
beyond 3 % in all, with 8 two."""


@ti.data_oriented
class TieFields:
    """Room for so many ties, for what they are to do in a frame, for so many threads beside them, and for so many
    numbers of the matrix by which ties are closed at once; none where they are gone through one after the other.

    usual, apart, push: LANES numbers of each tie, of which the first three are [m] of places, the next three of steps.
    borne, slid: as many numbers of ties to places: what they have pushed by in this substep, and how far their places
    have gone along in this frame.
    far: of each tie, whether it was wider than SLACK when all were closed at once.
    point, point_begin: key points that ties move, and where those of each begin in `of`, with their shares in `share`.
    answer: of the matrix row after row what is not negligible, `other` its columns, answer_begin where rows begin.
    """

    wide: Any  # its number is the bound of a loop: type checkers would take it for a matrix

    def __init__(self, capacity: int, repeated: bool, numbers: int, threads: int) -> None:
        self.capacity, self.repeated, self.at_once = capacity, repeated, numbers > 0
        self.row, self.path = ti.field(ti.f32, (capacity, ROW)), ti.field(ti.f32, (capacity + 1, PATH))
        self.node = ti.field(ti.i32, (capacity, NODES))
        self.usual, self.apart, self.push = (ti.field(ti.f32, LANES * capacity) for _ in range(3))
        self.borne, self.slid = (ti.field(ti.f32, LANES * (1 if repeated else capacity)) for _ in range(2))
        self.points: Any = ti.field(ti.i32, ())
        self.point, self.of, self.share = (ti.field(kind, NODES * capacity) for kind in (ti.i32, ti.i32, ti.f32))
        self.point_begin: Any = _begins(NODES * capacity)
        if self.at_once:
            self.answer, self.other = (ti.field(kind, numbers) for kind in (ti.f32, ti.i32))
            self.answer_begin: Any = _begins(capacity)
        self.holder: object = None
        self.wide, self.listed = ti.field(ti.i32, ()), ti.field(ti.i32, capacity)
        self.far = ti.field(ti.i32, capacity)
        self.beside = BesideFields(threads)

    @ti.kernel
    def take(self, path: F32x2):
        """For a frame; its last row is of all ties."""
        ti.loop_config(serialize=ti.static(on_host()))  # less work than to wake threads
        for i, j in ti.ndrange(path.shape[0], path.shape[1]):
            self.path[i if i < path.shape[0] - 1 else self.capacity, j] = path[i, j]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(path.shape[0] - 1):
            for c in range(3):
                self.usual[k * LANES + c] = path[k, USUAL + c]
                self.usual[k * LANES + 3 + c] = path[k, USUAL + c]
        if ti.static(not self.repeated):
            for e in range(LANES * (path.shape[0] - 1)):
                self.borne[e] = self.slid[e] = 0.0

    @ti.kernel
    def give_slid(self, slid: F32x2):
        """How far places have gone along in this frame, (3, ties) [m]."""
        ti.loop_config(serialize=ti.static(on_host()))
        for c, k in ti.ndrange(slid.shape[0], slid.shape[1]):
            slid[c, k] = self.slid[k * LANES + c]

    @ti.kernel
    def give(self, usual: F32x2):
        """What ties are usually pushed by, (3, ties) [m]."""
        ti.loop_config(serialize=ti.static(on_host()))
        for c, k in ti.ndrange(usual.shape[0], usual.shape[1]):
            usual[c, k] = self.usual[k * LANES + c]

    @ti.kernel
    def take_constant(
        self, node: I32x2, row: F32x2, points: I32x2, of: I32x1, share: F32x1, begin: I32x1, other: I32x1, answer: F32x1
    ):
        """points: (key points, 2), element and where its ties begin in `of` and `share`. begin: (ties + 1,), where the
        pushes that answer a tie's gap begin in `other` and `answer`, nothing where ties are not closed at once."""
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(node.shape[0]):
            for j in range(NODES):
                self.node[k, j] = node[k, j]
            for j in range(ROW):
                self.row[k, j] = row[k, j]
            for c in range(LANES):
                self.apart[k * LANES + c] = 0.0
        ti.loop_config(serialize=ti.static(on_host()))
        for m in range(points.shape[0]):
            self.point[m], self.point_begin[m] = points[m, 0], points[m, 1]
        ti.loop_config(serialize=ti.static(on_host()))
        for e in range(of.shape[0]):
            self.of[e], self.share[e] = of[e], share[e]
        if ti.static(self.at_once):
            ti.loop_config(serialize=ti.static(on_host()))
            for k in range(begin.shape[0]):
                self.answer_begin[k] = begin[k]
            ti.loop_config(serialize=ti.static(on_host()))
            for e in range(other.shape[0]):
                self.other[e], self.answer[e] = other[e], answer[e]
        self.points[None], self.point_begin[points.shape[0]] = points.shape[0], of.shape[0]

    @routine
    def pull(self, points: Template, done: Int):
        """Every tie, the first time in a substep; from then on those that were much too wide, one after the other."""
        share = self.share_of(done)
        if ti.static(not self.repeated) and self.wide[None] < 0:
            self.slide(points, share)
        if ti.static(points.sums and self.repeated) and self.wide[None] == FRESH:
            self.move_all(points, self.usual)
            self.wide[None] = PUSHED
        elif ti.static(self.at_once):
            if self.wide[None] < 0 or ti.static(points.sums and not self.repeated):  # yarns pull again at what is held
                self.close_all(points, share)
                if ti.static(points.sums and not self.repeated):
                    self.draw_beside(points, share, done)
            elif ti.static(self.repeated):
                for m in range(self.wide[None]):
                    self.close(points, self.listed[m], share)
                if ti.static(points.sums):
                    self.draw_beside(points, share, done)
        else:
            first = self.wide[None] < 0
            count, found = self.count() if first else self.wide[None], 0
            for m in range(count):  # pyright: ignore[reportArgumentType]
                k = m if first else self.listed[m]
                if self.close(points, k, share) and first:
                    self.listed[found] = k
                    found += 1
            if first:
                self.wide[None] = found

    @ti.func
    def draw_beside(self, points: Template, share, done):
        """Threads beside ties that are too long, in turn with the ties at their ends."""
        listed = 0
        if self.closed():
            if self.looks(share, done):
                self.beside.listed[None] = self.beside.look(points)
            listed = self.beside.listed[None]
        self.take_turns(points, listed, share)

    @ti.func
    def take_turns(self, points: Template, found, share):
        """Threads beside ties that were found, and ties at their ends. Seams have the last word, and threads where
        cloth is held: it may be held a hair off, and no thread is so long for it."""
        listed = found
        for turn in range(TURNS):
            if listed > 0:
                drawn = self.beside.draw(points, listed)
                last = ti.static(not self.repeated) and turn == TURNS - 1
                for m in range(0 if last else drawn):
                    t = self.beside.drawn[m]
                    for e in range(self.beside.begin[t], self.beside.begin[t + 1]):
                        self.close(points, self.beside.tie[e], share)
                if drawn == 0:
                    listed = 0

    @ti.func
    def closed(self):
        """Whether no tie is still being drawn together."""
        return self.path[self.capacity, 5] > 0.0

    @ti.func
    def looks(self, share, done):
        """Whether all threads beside ties are looked at in this substep."""
        return done % LOOKS == 0 or share > 1.0 - 0.5 * self.path[self.capacity, 1]

    @ti.func
    def share_of(self, done):
        """How much of the frame is over after a substep."""
        return ti.cast(done + 1, ti.f32) * self.path[self.capacity, 1]

    @ti.func
    def count(self) -> Any:
        """Of all ties."""
        return ti.cast(self.path[self.capacity, 0], ti.i32)

    @ti.func
    def close_all(self, points: Template, share):
        """Closes all ties at once, and lists those that were wider than SLACK."""
        found, count = 0, self.count()
        for k in range(count):
            if self.ask(points, k, share):
                self.listed[found] = k
                found += 1
        self.wide[None] = found
        for k in range(count):
            self.answer_one(points, k)
        self.move_all(points, self.push)
        for k in range(count):
            self.learn_one(points, k)

    @ti.func
    def ask(self, points: Template, k, share):
        """d: how much tie k, and its steps, is to come together; six numbers. Returns whether it was wider by SLACK."""
        push, wide = self.wanted(points, k, share)
        for c in ti.static(range(6)):
            self.apart[k * LANES + c] = push[c]
        return wide

    @ti.func
    def answer_one(self, points: Template, k):
        """λ of tie k: d of all times the known matrix, all six numbers at once; of a place, what it bears of it."""
        together = nothing()
        for e in range(self.answer_begin[k], self.answer_begin[k + 1]):
            together += self.answer[e] * load(self.apart, points.lanes(self.other[e] * LANES))
        store(self.push, points.lanes(k * LANES), together)
        if ti.static(not self.repeated):
            borne = self.bear(k, ti.Vector([self.push[k * LANES + c] for c in ti.static(range(6))]))
            for c in ti.static(range(6)):
                self.push[k * LANES + c] = borne[c]

    @ti.func
    def learn_one(self, points: Template, k):
        """From what tie k was pushed by when all were closed."""
        self.learn(points, k, ti.Vector([self.push[k * LANES + c] for c in ti.static(range(6))]))

    @ti.func
    def move_all(self, points: Template, push: Template):
        """Brings all ties together by what `push` has for them, key point after key point: to change one as often as
        ties name it would take each time as long as the last to be written."""
        for m in range(self.points[None]):
            self.move_point(points, push, m)

    @ti.func
    def move_point(self, points: Template, push: Template, m):
        """By what `push` has for its ties, the key point that is number m of those that ties move."""
        moves = nothing()
        for e in range(self.point_begin[m], self.point_begin[m + 1]):
            moves += self.share[e] * load(push, points.lanes(self.of[e] * LANES))
        p = self.point[m]
        for c in ti.static(range(3)):
            points.position[c][p] -= moves[c]  # pyright: ignore[reportIndexIssue]
            points.step[c][p] -= moves[3 + c]  # pyright: ignore[reportIndexIssue]

    @ti.func
    def measure(self, points: Template, k, share):
        """How far tie k is apart after this share of the frame, and how that changed in this step [m]."""
        out, moved = ti.Vector([0.0] * 6), self.path[self.capacity, 1]
        for c in ti.static(range(3)):
            out[c] = -self.path[k, c] - share * self.path[k, 3 + c]
            out[3 + c] = -moved * self.path[k, 3 + c]
            if ti.static(not self.repeated):
                out[c] -= self.slid[k * LANES + c]
        for j in ti.static(range(NODES)):
            p, weight = self.node[k, j], self.row[k, j]
            for c in ti.static(range(3)):
                out[c] += weight * points.position[c][p]
                out[3 + c] += weight * points.step[c][p]
        return out

    @ti.func
    def move(self, points: Template, k, push):
        """Brings tie k together by so much, and its steps by so much [m]."""
        for j in ti.static(range(NODES)):
            p, f = self.node[k, j], self.row[k, SHARE + j]
            for c in ti.static(range(3)):
                points.position[c][p] -= f * push[c]
                points.step[c][p] -= f * push[3 + c]

    @ti.func
    def bear(self, k, push):
        """Of what tie k to a place is to be pushed by, as much as it bears beside what it has borne in this substep."""
        out, most = ti.Vector([push[c] for c in ti.static(range(6))]), self.path[k, MOST]
        for part in ti.static((0, 3)):
            whole = ti.Vector([push[part + c] + self.borne[k * LANES + part + c] for c in ti.static(range(3))])
            share = most / ti.max(whole.norm(), 1e-15)
            for c in ti.static(range(3)):
                if share < 1.0:
                    out[part + c] = share * whole[c] - self.borne[k * LANES + part + c]
                self.borne[k * LANES + part + c] = ti.min(share, 1.0) * whole[c]
        return out

    @ti.func
    def slide(self, points: Template, share):
        """`slide_one` of all."""
        for k in range(self.count()):
            self.slide_one(points, k, share)

    @ti.func
    def slide_one(self, points: Template, k, share):
        """Before anything is pushed in a substep: the place of tie k, if it bore all it can, has gone along to where
        the substep before left it (Coulomb)."""
        longest = 0.0
        for part in ti.static((0, 3)):
            borne = ti.Vector([self.borne[k * LANES + part + c] for c in ti.static(range(3))])
            longest = ti.max(longest, borne.norm())
        apart = self.measure(points, k, share)
        for c in ti.static(range(3)):
            if longest > 0.999 * self.path[k, MOST]:
                self.slid[k * LANES + c] += apart[c] - apart[3 + c]
        for c in ti.static(range(6)):
            self.borne[k * LANES + c] = 0.0

    @ti.func
    def wanted(self, points: Template, k, share):
        """How much tie k is to come together to the width allowed after this share of the frame, and its steps [m]; and
        whether it was wider by SLACK."""
        # How wide the gap is and may be, and how fast it grows as a share of itself.
        push = self.measure(points, k, share)
        gap = ti.sqrt(push[0] ** 2 + push[1] ** 2 + push[2] ** 2)
        allowed = self.path[k, ALLOWED] + share * self.path[k, ALLOWED + 1]
        growth = (push[0] * push[3] + push[1] * push[4] + push[2] * push[5]) / ti.max(gap * gap, 1e-24)
        most = self.path[self.capacity, 2] / ti.max(gap, 1e-12) + ti.max(growth, 0.0)
        # The share of it to close: what is too wide, at most what the set speed covers.
        over = ti.min(ti.max(gap - allowed, 0.0) / ti.max(gap, 1e-12), most)
        if allowed > 0.0:  # still being drawn together: no more of the step than it grows, along the gap
            for c in ti.static(range(3)):
                push[3 + c] = ti.min(ti.max(growth, 0.0), over) * push[c]
        for c in ti.static(range(3)):
            push[c] *= over
        return push, gap > allowed + SLACK

    @ti.func
    def close(self, points: Template, k, share):
        """Closes tie k to the width allowed after this share of the frame. Returns whether it was wider by SLACK."""
        push, wide = self.wanted(points, k, share)
        if ti.static(not self.repeated):
            push = self.bear(k, push)
        self.move(points, k, push)
        if self.path[self.capacity, EAGER] > 0.0:
            self.learn(points, k, push)
        return wide

    @ti.func
    def learn(self, points: Template, k, push):
        """That tie k was pushed by so much more than usual, if that is not little, nor the tie still being drawn in.
        The slower it moves the less it learns."""
        if ti.static(points.sums and self.repeated) and self.path[k, ALLOWED] <= 0.0:
            size, least = ti.sqrt(push[3] ** 2 + push[4] ** 2 + push[5] ** 2), self.path[self.capacity, 4]
            if size > least:
                gain = self.path[self.capacity, 3] * (1.0 - least / size)
                gain *= ti.min(ti.max(self.path[self.capacity, 6] * self.speed(points, k), LEAST), 1.0)
                for c in ti.static(range(3)):
                    self.usual[k * LANES + c] += gain * push[3 + c]
                    self.usual[k * LANES + 3 + c] += gain * push[3 + c]

    @ti.func
    def speed(self, points: Template, k):
        """How far what tie k joins moved in this step [m]."""
        x, y, z, weights = 0.0, 0.0, 0.0, 0.0
        for j in ti.static(range(NODES)):
            p, weight = self.node[k, j], ti.abs(self.row[k, j])
            x += weight * points.step[0][p]
            y += weight * points.step[1][p]
            z += weight * points.step[2][p]
            weights += weight
        return ti.sqrt(x * x + y * y + z * z) / weights


def _begins(count: int) -> Any:
    """Where so many lists begin, and where the last one ends. Any: their numbers are bounds of loops."""
    return ti.field(ti.i32, count + 1)
