"""A substep of whole yarns as parallel loops, in the order of `YarnFrame`; their systems in pieces (`line_systems.py`).

A key point has a thread of the device of its own, on a CPU too. Which threads strained the last substep, and which
matrices are too old for a second sweep, is told by flags that whoever finds it sets to 1: it does not matter who was
first. Factors are made anew yarn by yarn, and not by groups of yarns as on a CPU.
"""

from collections.abc import Callable, Iterator
from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.loops.frame_loops import NOW, WIND, FrameLoops, Largest, Launch
from taichi_cloth.loops.line_systems import LineSystems
from taichi_cloth.motion.frame import Frame
from taichi_cloth.motion.stencil import Features, taking
from taichi_cloth.sheet.sheet import PAD

__all__ = ["YarnLoops"]

THREADS = 2
"""Families of yarns, before those of chains."""
FAR = 1e5
"""[m] that a strain limit lets a thread grow by where there is none, at least."""


@ti.data_oriented
class YarnLoops(FrameLoops):
    """systems: of each family. late: of each line of the family at work, whether its factors are too old; 0 between two
    sweeps. seen: whether a thread was strained so much in the last substep that the next is wild."""

    def __init__(
        self, frame: Frame, features: Features, packets: int, lanes: int, padded_shape: tuple[int, int]
    ) -> None:
        super().__init__(frame, features, packets, 1, padded_shape)
        rows, width = padded_shape[0] - 2 * PAD, padded_shape[1]
        self.yarns: Any = self.frame.yarns
        self.tight, self.missed = Largest(frame.size), Largest(frame.size)
        self.yarns.tight = self.tight.value  # each thread has its own place
        self.yarns.strained, self.yarns.differs = (ti.field(ti.f32, frame.size) for _ in range(2))
        self.families, first = self.frame.families, PAD * width
        # Chains along the diagonals are the columns of a grid that is one element wider, or narrower.
        chains = ((width + 1, 2), (width - 1, 3))[: self.families - THREADS]
        self.systems = (
            LineSystems(self.yarns, 0, rows, width, (first, width, 1)),
            LineSystems(self.yarns, 1, width, rows, (first, 1, width)),
            *(LineSystems(self.yarns, own, many, -(-rows * width // many), (first, 1, many)) for many, own in chains),
        )
        self.late, self.seen = ti.field(ti.i32, max(one.lines for one in self.systems)), ti.field(ti.i32, ())

    def substep(self, odd: int) -> Iterator[Launch]:
        sweeps = self.sweeps()
        yield self.kernel("soft", _soft), WIND, 1
        yield from self._touch(False, False)
        for sweep in range(sweeps):
            for family in reversed(range(self.families)) if odd else range(self.families):
                kind = family, sweep == 0, sweep == sweeps - 1
                yield self.kernel(kind, lambda loops, kind=kind: _solve(loops, *kind)), (), 1
            yield from self._touch(True, sweep == sweeps - 1)

    def _touch(self, again: bool, last: bool) -> Iterator[Launch]:
        """In the order of `YarnFrame.correct_all`. last: of the substep."""
        for one in self.frame.first:
            yield from self.constrain(one, again)
        if self.features.sphere or self.features.plane:
            yield self.kernel(("shapes", last), lambda loops: _shapes(loops, int(last))), (), 1
        for one in (*[one for one in self.frame.constraints if one.parts], *self.frame.last):
            yield from self.constrain(one, again)

    @ti.func
    def begin(self, p):
        self.yarns.tight[p], self.yarns.strained[p] = 0.0, 0.0
        for family in ti.static(range(self.families)):
            s = p + family * self.frame.size
            self.yarns.pulled[s], self.yarns.held[s], self.yarns.tension[s] = 0.0, 0.0, 0.0
        if p == 0:
            self.seen[None] = 0

    @ti.func
    def judge(self):
        """A loop: what is ahead; and whether the substep that begins is wild."""
        for t in range(self.count):
            if t == 0:
                self.turn[NOW] = self.turn[NOW] + 1
            p = self.place(t)
            self.frame.lead(p, self.own(p))
            if self.yarns.strained[p] > 1.0:
                self.seen[None] = 1
            self.yarns.strained[p] = 0.0

    @ti.func
    def soften(self, wind):
        """A loop: the soft springs."""
        for t in range(self.count):
            if t == 0:
                self.yarns.wild[None] = ti.select(self.seen[None] > 0, 1.0, 0.0)
            air = ti.Vector([wind[c] + self.turn[NOW] * wind[3 + c] for c in ti.static(range(3))])
            p = self.place(t)
            self.frame.soft(p, air, self.own(p), self.features)

    @ti.func
    def shapes(self, last: Template):
        """A loop: the fixed ball and half space. last: 1 in the last turn of a substep."""
        for t in range(self.count):
            self.frame.touch(self.place(t), last, self.frame.shared(), self.features)

    @ti.func
    def all_anew(self, n: Template, first: Template):
        """Whether all factors of a family are made in this sweep; a limit asks for matrices of its own."""
        return first or self.yarns.wild[None] > 0.0 or n.bound < FAR

    @ti.func
    def solve(self, system: Template, y: Template, family: Template, first: Template, last: Template):
        """Loops: a sweep over the yarns y of a family, the first or the last of a substep. system: of the family."""
        base, offset = ti.static(family * self.frame.size), ti.static(system.next_point)
        carried, shared = ti.static(0.0 if first else 1.0, family * y.cloths)
        # Where threads lie and how they turned.
        for t in range(self.count):
            if t == 0:
                self.seen[None] = 0
            p = self.place(t)
            y.aim(self.frame, p, base, offset, y.own(self.frame, p, base, y.numbers[shared]))
        # Where to push, and what is asked.
        for t in range(self.count):
            p = self.place(t)
            n = y.own(self.frame, p, base, y.numbers[shared])
            y.straighten(self.frame, p, base, offset)
            if self.all_anew(n, first):
                y.ask(self.frame, p, base, offset, p, carried, n, True)
                if n.bound < FAR:
                    y.hold(self.frame, p, base, n)
            else:
                y.differs[p] = 0.0
                y.ask(self.frame, p, base, offset, p, carried, n, False)
                if y.differs[p] > 0.0:
                    self.late[system.line(p)] = 1
        # The systems: couplings and factors where they are made anew; pieces, their ends, pieces.
        for t in range(system.count):
            anew = self.all_anew(y.numbers[shared], first)
            line, piece = system.piece_of(t)
            late = not anew and self.late[line] > 0
            if anew or late:
                begin, end = system.reach(piece)
                for k in range(begin, end + 1):
                    p = system.element(line, k)
                    n = y.own(self.frame, p, base, y.numbers[shared])
                    if late:
                        y.ask(self.frame, p, base, offset, p, carried, n, True)
                    y.couple(self.frame, p, base, offset, n)
            system.down(t, anew or late)
        for line in range(system.lines):
            system.join(line, self.all_anew(y.numbers[shared], first) or self.late[line] > 0)
            self.late[line] = 0
        for t in range(system.count):
            system.up(t)
        # What they move.
        for t in range(self.count):
            p = self.place(t)
            n = y.own(self.frame, p, base, y.numbers[shared])
            y.push(self.frame, p, base, offset, carried, n)
            if n.bound < FAR:
                y.let_go(self.frame, p, base, n)
            if ti.static(last):  # noqa: SIM102 (one is known when it is compiled)
                if self.turn[NOW] % 2 == 1:
                    y.average(self.frame, p, base, offset, n)
        # How tight they are, when all is known of how much they pull.
        if ti.static(last):
            for t in range(self.count):
                if self.turn[NOW] % 2 == 1:
                    p = self.place(t)
                    y.tighten(self.frame, p, base, p, y.own(self.frame, p, base, y.numbers[shared]))

    def tightest(self) -> float:
        """As `YarnFrame.tightest`."""
        return self.tight.find()

    def unsolved(self) -> float:
        """As `YarnFrame.unsolved`."""
        with taking(1):
            self._find_unsolved()
        return self.missed.find()

    @ti.kernel
    def _find_unsolved(self):
        for p in range(self.frame.size):
            most = 0.0
            for family in ti.static(range(THREADS)):
                most = ti.max(most, self.yarns.unsolved(self.frame, p, family))
            self.missed.value[p] = most


def _soft(loops: Any) -> Callable[..., Any]:
    @ti.kernel
    def soft(wx: Float, wy: Float, wz: Float, cx: Float, cy: Float, cz: Float):
        loops.judge()
        loops.slip()
        loops.soften(ti.Vector([wx, wy, wz, cx, cy, cz]))

    return soft


def _shapes(loops: Any, last: int) -> Callable[..., Any]:
    @ti.kernel
    def shapes():
        loops.shapes(last)

    return shapes


def _solve(loops: Any, family: int, first: bool, last: bool) -> Callable[..., Any]:
    system, yarns = loops.systems[family], loops.yarns

    @ti.kernel
    def solve():
        loops.solve(system, yarns, family, first, last)

    return solve
