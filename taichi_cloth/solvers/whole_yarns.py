"""Yarns solved whole: all threads of a warp end, or of a weft pick, in one tridiagonal system a yarn.

A thread s between two key points p and q of a yarn has length l, direction n and rest length L. With the masses of key
points counted in m₀, r = m₀/m, and its tension as a displacement, λ = −h² T/m₀, a push by λ moves q by r_q n λ and p by
−r_p n λ. What the threads of a yarn ask of each other is, for the change of λ (Macklin et al. 2016, "XPBD", with all
constraints of a yarn at once instead of one by one; Goldenthal et al. 2007 solve all of a cloth at once):

    (α + (1 + τ/h) J W Jᵀ) Δλ = −(C + τ/h dC + α λ),      C = l − L,   α = m₀/(k h²)

    diagonal r_p + r_q + α,      beside it −r (n_s · n_{s+1}), r of the key point between both

which is well conditioned however stiff the thread: α → 0 is one that cannot be stretched. dC: how C changed in this
step, for damping of the time τ along the threads. Whether its crimp is drawn out is told by its tension, that of the
substep before where there is none yet in this one, and not by C: what a seam has drawn apart within a substep pulls no
harder for it, and taken for a stiff thread would be left as long as its crimp is.

It is solved as a LDLᵀ factorisation, 8 yarns side by side: yarns along the columns as they lie; those along the rows
are read across 8 rows at once, and their factors lie turned, so that both go through the same recursion. A family is
gone through forth and back in one go each, everything that a key point needs in turn, while it is in the cache. The
second sweep of a substep takes the factors of the first, unless a thread's law has changed by so much that the old
matrix would overshoot; directions and right sides are those of where key points are by then.

Where n leads: pushed along where it leads after the step (order 1) cloth loses energy as it turns; along where it led
before (order 2, as SHAKE's) it is lost where it folds sharply. So it is pushed along the latter, and half of what of
the turn differs from the mean turn of the threads beside it in the yarn; in wild substeps, that begin with a thread
strained by 2 % beyond its crimp, along where it leads after the step, which is then looked at in each sweep.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.crew import LINE
from taichi_cloth.motion.stencil import largest, load, near, nothing, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.yarn_fields import NEVER, YarnFields
from taichi_cloth.solvers.yarn_order import DELAY, GROUPS

__all__ = ["WholeYarns"]

LEAST = 1e-6
"""Of a pivot: what rounding may leave of one that is 0."""

HELD = 0.9
"""Share of a strain limit down to which a thread at it stays held while its pull is more than its own."""

AVERAGED = 8.0
"""Substeps over which the pull of a thread is averaged. It is looked at in every other one."""

OVERSHOOT = 0.5
"""Share of a row's diagonal by which α may have changed since its matrix was factorised: the old one is used again."""


@ti.data_oriented
class WholeYarns(YarnFields):
    """The systems of all families, solved in the fields of `YarnFields`."""

    @ti.func
    def begin_frame(self):
        """Nothing was strained, nothing is tight: a frame follows from its state alone."""
        for group in range(GROUPS):
            store(self.tight, group * LINE, ti.Vector([0.0] * LANES))
            store(self.strained, group * LINE, ti.Vector([0.0] * LANES))

    @ti.func
    def loosen(self, p):
        """Forgets how tight the threads from the lanes at p were."""
        none = ti.Vector([0.0] * LANES)
        for family in ti.static(range(self.families)):
            store(self.pulled, p + family * self.size, none)
            store(self.held, p + family * self.size, none)
            store(self.tension, p + family * self.size, none)

    @ti.func
    def judge(self):
        """Before a substep: whether it is wild, by how much threads were strained in the last."""
        self.wild[None] = ti.select(self.largest_of(self.strained) > 1.0, 1.0, 0.0)
        for group in range(GROUPS):
            store(self.strained, group * LINE, ti.Vector([0.0] * LANES))

    @ti.func
    def tightest(self):
        return self.largest_of(self.tight)

    @ti.func
    def largest_of(self, field: Template):
        most = 0.0
        for group in range(GROUPS):
            most = ti.max(most, largest(load(field, group * LINE)))
        return most

    @ti.func
    def unsolved(self, points: Template, p, family):
        """By how much the threads of a family that begin at the lanes at p are longer than what they pull says, as a
        share of their length: what has moved their ends since their yarns were solved, most of all ties and the body. 0
        of those that are not `long` for their kind."""
        s, q = points.lanes(p + family * self.size), near(p + self.offset[family])
        n = self.own(points, p, family * self.size, self.numbers[family * self.cloths])
        x = load(points.position[0], q) - load(points.position[0], p)
        y = load(points.position[1], q) - load(points.position[1], p)
        z = load(points.position[2], q) - load(points.position[2], p)
        slack = load(self.slack, s)
        pull = -slack * load(self.tension, s)
        own = ti.select(n.soft * pull > n.crimp, n.offset + n.stiff * pull, n.soft * pull)
        grown = ti.sqrt(x * x + y * y + z * z) - n.rest
        long = ti.select(grown > n.long, present_at(slack), 0.0)
        return long * (grown - ti.max(own, 0.0)) * n.slimmer

    @ti.func
    def solve(self, points: Template, family, group, sweep, pulls):
        """A sweep over the yarns of a group of a family, the first of a substep being 0. pulls: whether to look how
        tight they are after it."""
        carried = ti.select(sweep == 0, 0.0, 1.0)  # nothing pulls yet in the first
        if self.count[family * GROUPS + group] > 0:
            # A limit, which threads come to and leave, asks for matrices of its own.
            anew = sweep == 0 or self.wild[None] > 0.0 or self.numbers[family * self.cloths].bound < NEVER
            if not anew:
                store(self.differs, group * LINE, ti.Vector([0.0] * LANES))
                self.go_down_again(points, family, group, carried)
                anew = largest(load(self.differs, group * LINE)) > 0.0
            if anew:
                self.go_down(points, family, group, carried)
            self.go_up(points, family, group, carried, ti.cast(pulls, ti.i32))

    @routine
    def go_down_again(self, points: Template, family: Int, group: Int, carried: Float):
        """Right sides and z, with the matrices of the sweep before. carried: 0 where nothing pulls yet in this substep,
        else 1."""
        k, n = family * GROUPS + group, self.numbers[family * self.cloths]
        begin, count, lag, mark = self.begin[k], self.count[k], self.lag[k], group * LINE
        base, offset = family * self.size, self.offset[family]
        for e in range(begin - lag, begin + count):
            ahead = self.lanes(e + lag)
            self.aim(points, ahead, base, offset, self.own(points, ahead, base, n))
            p = self.lanes(e)
            self.straighten(points, p, base, offset)
            self.ask(points, p, base, offset, mark, carried, self.own(points, p, base, n), False)
            if family > 0:
                self.down(points, p, base, offset, False)
            elif self.closes[e] >= 0:
                self.turned_down(self.tile[self.closes[e]], self.turned_tile[self.closes[e]], False)

    @routine
    def go_down(self, points: Template, family: Int, group: Int, carried: Float):
        """Matrices, right sides and z. Arguments as of `go_down_again`."""
        k, n = family * GROUPS + group, self.numbers[family * self.cloths]
        begin, count, lag, mark = self.begin[k], self.count[k], self.lag[k], group * LINE
        base, offset, limited = family * self.size, self.offset[family], n.bound < NEVER
        for e in range(begin - lag - DELAY, begin + count):
            ahead, next_one = self.lanes(e + lag + DELAY), self.lanes(e + DELAY)
            self.aim(points, ahead, base, offset, self.own(points, ahead, base, n))
            self.straighten(points, next_one, base, offset)
            self.ask(points, next_one, base, offset, mark, carried, self.own(points, next_one, base, n), True)
            if limited:
                self.hold(points, next_one, base, self.own(points, next_one, base, n))
            p = self.lanes(e)
            self.couple(points, p, base, offset, self.own(points, p, base, n))
            if family > 0:
                self.down(points, p, base, offset, True)
            elif self.closes[e] >= 0:
                self.turned_down(self.tile[self.closes[e]], self.turned_tile[self.closes[e]], True)

    @routine
    def go_up(self, points: Template, family: Int, group: Int, carried: Float, pulls: Int):
        """Δλ, and what it moves. Arguments as of `go_down_again` and `solve`."""
        k, n = family * GROUPS + group, self.numbers[family * self.cloths]
        begin, count, lag, mark = self.begin[k], self.count[k], self.lag[k], group * LINE
        base, offset, limited = family * self.size, self.offset[family], n.bound < NEVER
        for back in range(count + lag):
            e = begin + count - 1 - back
            if family > 0:
                self.up(points, self.lanes(e), base, offset)
            elif self.closes[e] >= 0:
                self.turned_up(self.tile[self.closes[e]], self.turned_tile[self.closes[e]])
            p = self.lanes(e + lag)
            self.push(points, p, base, offset, carried, self.own(points, p, base, n))
            if limited:
                self.let_go(points, p, base, self.own(points, p, base, n))
            if pulls == 1:
                self.pull(points, p, base, offset, mark, self.own(points, p, base, n))

    @ti.func
    def lanes(self, e):
        """First element of packet number e in the orders."""
        return ti.min(ti.max(self.order[e], 0), 1 << 21) * LANES

    @ti.func
    def own(self, points: Template, p, base, n: Template):
        """The numbers of the threads that begin at the lanes at p. base: of their family. n: its first cloth's."""
        if ti.static(self.cloths == 1):
            return n
        else:
            return self.numbers[base // self.size * self.cloths + points.kind(p)]

    @ti.func
    def aim(self, points: Template, p, base, offset, n: Template):
        """The threads that begin at the lanes at p: their direction before the step and how it turned, their
        elongation after it, and how that changed."""
        q, s = near(p + offset), points.lanes(base + p)
        # After the step, and in it.
        x = load(points.position[0], q) - load(points.position[0], p)
        y = load(points.position[1], q) - load(points.position[1], p)
        z = load(points.position[2], q) - load(points.position[2], p)
        u = load(points.step[0], q) - load(points.step[0], p)
        v = load(points.step[1], q) - load(points.step[1], p)
        w = load(points.step[2], q) - load(points.step[2], p)
        length = ti.sqrt(x * x + y * y + z * z + 1e-16)
        scale = present_at(load(self.slack, s)) / length
        store(self.grown, p, length - n.rest)
        store(self.growing, p, n.damped * scale * (u * x + v * y + w * z))
        back = ti.select(self.wild[None] > 0.0, 0.0, 0.5)
        for axis, apart, change in ti.static(((0, x, u), (1, y, v), (2, z, w))):
            store(self.normal[axis], s, scale * (apart - back * change))
            store(self.turning[axis], p, scale * change)

    @ti.func
    def straighten(self, points: Template, p, base, offset):
        """Where to push: as before the step, and half of what turned otherwise than the threads beside it in the yarn.
        In a wild substep as after the step, which damps what turns."""
        b, q, s = near(p - offset), near(p + offset), points.lanes(base + p)
        share = ti.select(self.wild[None] > 0.0, 0.0, 1.0) * load(self.mean, s)
        x = load(self.normal[0], s) - share * (load(self.turning[0], b) + load(self.turning[0], q))
        y = load(self.normal[1], s) - share * (load(self.turning[1], b) + load(self.turning[1], q))
        z = load(self.normal[2], s) - share * (load(self.turning[2], b) + load(self.turning[2], q))
        scale = present_at(load(self.slack, s)) / ti.sqrt(x * x + y * y + z * z + 1e-16)
        for axis, value in ti.static(((0, x), (1, y), (2, z))):
            store(self.normal[axis], s, scale * value)

    @ti.func
    def ask(self, points: Template, p, base, offset, mark, carried, n: Template, anew: Template):
        """The right sides, and the diagonals where they are made anew. mark: where a group keeps its largest."""
        s = points.lanes(base + p)
        slack = load(self.slack, s)
        there = present_at(slack)
        grown, growing = load(self.grown, p), load(self.growing, p)
        # Its law: soft until its pull draws the crimp out, then stiff.
        drawn = ti.select(-n.soft * slack * load(self.tension, s) > n.crimp, 1.0, 0.0)
        compliance = (n.soft + drawn * (n.stiff - n.soft)) * slack
        asked = grown - drawn * n.offset + growing + compliance * (carried * load(self.tension, s))
        store(self.right, p, -there * asked)
        m = n.mass * load(points.inverse_mass, p)
        mobile = (1.0 + n.damped) * (m + n.mass * load(points.inverse_mass, near(p + offset)))
        if ti.static(anew):
            store(self.diagonal, p, there * (mobile + compliance) + (1.0 - there))
            store(self.compliance, s, compliance)
            store(self.strained, mark, ti.max(load(self.strained, mark), there * ti.abs(grown) * n.calm))
        else:
            old = load(self.compliance, s)
            differs = there * (ti.abs(compliance - old) - OVERSHOOT * (mobile + old))
            store(self.differs, mark, ti.max(load(self.differs, mark), differs))

    @ti.func
    def hold(self, points: Template, p, base, n: Template):
        """Threads at their limit, in place of their law."""
        s = points.lanes(base + p)
        was, grown = load(self.held, s), load(self.grown, p)
        there = present_at(load(self.slack, s))
        over = there * ti.select(grown > n.bound * (1.0 - (1.0 - HELD) * was), 1.0, 0.0)
        store(self.held, s, over)
        right = load(self.right, p)
        store(self.right, p, right + over * (n.bound - grown - right))
        store(self.diagonal, p, load(self.diagonal, p) - over * load(self.compliance, s))

    @ti.func
    def let_go(self, points: Template, p, base, n: Template):
        """A limit lets go of what pulls less than the thread itself would."""
        s = points.lanes(base + p)
        own = -load(self.tension, s) * n.stiff * load(self.slack, s)
        store(self.held, s, ti.select(own > n.bound, load(self.held, s), 0.0))

    @ti.func
    def couple(self, points: Template, p, base, offset, n: Template):
        """The coupling with the thread before, where both are there."""
        s, b = points.lanes(base + p), near(base + p - offset)
        along = (
            load(self.normal[0], s) * load(self.normal[0], b)
            + load(self.normal[1], s) * load(self.normal[1], b)
            + load(self.normal[2], s) * load(self.normal[2], b)
        )
        m = n.mass * load(points.inverse_mass, p)
        store(self.coupling, p, -(1.0 + n.damped) * m * along)

    @ti.func
    def down(self, points: Template, p, base, offset, anew: Template):
        """Factorises the rows of the lanes at p, those before them done: L d Lᵀ, and z of L z = right."""
        s, b = points.lanes(base + p), near(p - offset)
        if ti.static(anew):
            beside = load(self.coupling, p)
            store(self.beside, s, beside)
            less = beside * beside * load(self.pivot, near(base + p - offset))
            store(self.pivot, s, 1.0 / ti.max(load(self.diagonal, p) - less, LEAST))
        less = load(self.beside, s) * load(self.pivot, near(base + p - offset)) * load(self.change, b)
        store(self.change, p, load(self.right, p) - less)

    @ti.func
    def up(self, points: Template, p, base, offset):
        """Δλ of the lanes at p, those after them done."""
        q, s = near(p + offset), points.lanes(base + p)
        after = load(self.beside, near(base + p + offset)) * load(self.change, q)
        store(self.change, p, load(self.pivot, s) * (load(self.change, p) - after))

    @ti.func
    def turned_down(self, p, t, anew: Template):
        """`down` of the yarns along the rows in the tile at p, which when turned is at t."""
        row, tall = self.row[None], self.tall[None]
        for c in range(LANES):
            a, q, b = p + c, near(t + c * tall), near(t + c * tall - tall)
            if ti.static(anew):
                beside, diagonal = self.across(self.coupling, a, row), self.across(self.diagonal, a, row)
                store(self.beside, q, beside)
                store(self.pivot, q, 1.0 / ti.max(diagonal - beside * beside * load(self.pivot, b), LEAST))
            less = load(self.beside, q) * load(self.pivot, b) * load(self.turned_change, b)
            store(self.turned_change, q, self.across(self.right, a, row) - less)

    @ti.func
    def turned_up(self, p, t):
        """`up` of the same, and Δλ back to where its threads lie."""
        row, tall = self.row[None], self.tall[None]
        for back in range(LANES):
            c = LANES - 1 - back
            q, a = near(t + c * tall), near(t + c * tall + tall)
            after = load(self.beside, a) * load(self.turned_change, a)
            new = load(self.pivot, q) * (load(self.turned_change, q) - after)
            store(self.turned_change, q, new)
            for k in ti.static(range(LANES)):
                self.change[p + c + k * row] = new[k]  # pyright: ignore[reportIndexIssue]

    @ti.func
    def across(self, field: Template, p, row):
        """Element p of 8 rows, each `row` after the one before."""
        return ti.Vector([field[p + k * row] for k in ti.static(range(LANES))])

    @ti.func
    def push(self, points: Template, p, base, offset, carried, n: Template):
        """What the threads before and after the lanes at p move them by."""
        b, s = near(p - offset), points.lanes(base + p)
        before, after, m = load(self.change, b), load(self.change, p), n.mass * load(points.inverse_mass, p)
        tension = carried * load(self.tension, s) + after
        store(self.tension, s, tension)
        for axis in ti.static(range(3)):
            move = m * (before * load(self.normal[axis], near(base + p - offset)) - after * load(self.normal[axis], s))
            store(points.position[axis], p, load(points.position[axis], p) + move)
            store(points.step[axis], p, load(points.step[axis], p) + move)

    @ti.func
    def pull(self, points: Template, p, base, offset, mark, n: Template):
        """At the end of a substep: how much threads pull, and how tight they are."""
        self.average(points, p, base, offset, n)
        self.tighten(points, p, base, mark, n)

    @ti.func
    def average(self, points: Template, p, base, offset, n: Template):
        """How much threads pull."""
        s = points.lanes(base + p)
        mobile = n.mass * ti.max(load(points.inverse_mass, p), load(points.inverse_mass, near(p + offset)))
        was = load(self.pulled, s)
        pulled = was - (load(self.tension, s) * mobile * n.slimmer + was) * ti.static(2.0 / AVERAGED)
        store(self.pulled, s, pulled)

    @ti.func
    def tighten(self, points: Template, p, base, mark, n: Template):
        """How tight threads are, for what the wave along a taut string asks of the step: the mean of those on both
        sides and of the yarns that cross there, as all hold a key point that leaves the line."""
        across, pulled = nothing(), load(self.pulled, points.lanes(base + p))
        for family in ti.static(range(self.families)):
            first = p + family * self.size
            across += ti.max(load(self.pulled, points.lanes(first)), 0.0)
            across += ti.max(load(self.pulled, near(first - self.offset[family])), 0.0)
        tight = ti.select(n.watched < NEVER, 0.25 * across, pulled)
        store(self.tight, mark, ti.max(load(self.tight, mark), tight))


@ti.func
def present_at(slack):
    """1 where there is a thread, which may be stiffer than one inside, else 0."""
    return ti.min(slack * 1e30, 1.0)
