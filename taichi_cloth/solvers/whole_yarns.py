"""Yarns solved whole: all threads of a warp end, or of a weft pick, in one tridiagonal system a yarn.

A thread s between two key points p and q of a yarn has length l, direction n and rest length L. With the masses of key
points counted in m₀, r = m₀/m, and its tension as a displacement, λ = −h² T/m₀, a push by λ moves q by r_q n λ and p by
−r_p n λ. What the threads of a yarn ask of each other is, for the change of λ (Macklin et al. 2016, "XPBD", with all
constraints of a yarn at once instead of one by one; Goldenthal et al. 2007 solve all of a cloth at once):

    (α + (1 + τ/h) J W Jᵀ) Δλ = −(C + τ/h dC + α λ),      C = l − L,   α = m₀/(k h²)

    diagonal r_p + r_q + α,      beside it −r (n_s · n_{s+1}), r of the key point between both

which is well conditioned however stiff the thread: α → 0 is one that cannot be stretched. dC: how C changed in this
step, for damping of the time τ along the threads.

It is solved as a LDLᵀ factorisation, 8 yarns side by side: yarns along the columns as they lie; of those along the rows
tiles of 8 × 8 are turned on the way, so that both go through the same code.

Where n leads: pushed along where it leads after the step (order 1) cloth loses energy as it turns; along where it led
before (order 2, as SHAKE's) it is lost where it folds sharply. So it is pushed along the latter, and half of what of
the turn differs from the mean turn of the threads beside it in the yarn; in wild substeps, that begin with a thread
strained by 2 % beyond its crimp, along where it leads after the step.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x2, I32x2, Int, Template
from taichi_cloth.motion.stencil import largest, load, near, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["ThreadNumbers", "WholeYarns"]

THREAD_NUMBERS = (
    "rest",  # L [m]
    "soft",  # α before the thread's crimp is drawn out, and of a linear one
    "stiff",  # α from then on
    "crimp",  # [m] of C at which it is drawn out
    "offset",  # [m] by which C seems less from then on: crimp (1 − stiff/soft)
    "bound",  # [m] of C that a strain limit leaves it
    "calm",  # [m] of C, either way, beyond which the next substep is wild
    "mass",  # m₀ [kg]
    "damped",  # τ/h
)

ThreadNumbers: Any = ti.types.struct(**dict.fromkeys(THREAD_NUMBERS, ti.f32))
"""Of the threads along the rows (0) and of those along the columns (1), in a field: changing them compiles nothing."""

LEAST = 1e-6
"""Of a pivot: what rounding may leave of one that is 0."""

HELD = 0.9
"""Share of a strain limit down to which a thread at it stays held while its pull is more than its own."""

AVERAGED = 8.0
"""Substeps over which the pull of a thread is averaged."""

TILE = LANES * LANES


@ti.data_oriented
class WholeYarns:
    """Fields of the threads of a padded grid of up to `size` key points, each by the first key point it joins.

    row: width of the grid. tall: its rows, of whole tiles.
    weight: share of the interior constant, family after family.
    normal: [axis], n, 0 where there is no thread; first that before the step, which by `turning` becomes that after it.
    grown, growing: C, and τ/h dC [m]. strained: the largest |C| of a substep for each lane, as a share of what is calm.
    wild: 1 in a wild substep, else 0. tension: λ [m], family after family. held: 1 where a strain limit holds a thread.
    diagonal, beside, right: of the systems; beside couples a thread with the one before it.
    pivot: 1/d of the factorisation. change: first z, then Δλ. turned_…: the same of yarns along the rows, which lie as
    columns there, between a row of zeros before and one after.
    tile: first element of each 8 × 8 tile that holds key points, and turned_tile its place when turned, in the order of
    columns. pulled: −λ r/L of each thread, family after family, averaged over some AVERAGED substeps: a blow is over in
    one. tight: the largest of these in this frame, for each lane.
    """

    def __init__(self, size: int) -> None:
        def fields(count: int, of: int) -> list[ti.Field]:
            return [ti.field(ti.f32, of) for _ in range(count)]

        self.size = size
        self.normal = fields(3, size)
        self.weight, self.tension, self.held, self.pulled = fields(4, 2 * size)
        self.diagonal, self.beside, self.right, self.pivot, self.change = fields(5, size)
        self.turning, self.grown, self.growing = fields(3, size), ti.field(ti.f32, size), ti.field(ti.f32, size)
        self.strained, self.wild = ti.field(ti.f32, LANES), ti.field(ti.f32, ())
        self.turned_pivot, self.turned_change, self.turned_beside = fields(3, size)
        self._forgotten = (  # turned ones, and those of one family and of both
            (self.turned_pivot, self.turned_change, self.turned_beside),
            (*self.normal, *self.turning, self.beside, self.right, self.pivot, self.change),
            (self.tension, self.held, self.pulled),
        )
        self.room = fields(3, TILE)
        self.tile, self.turned_tile = (ti.field(ti.i32, size // TILE) for _ in range(2))
        self.row: Any = ti.field(ti.i32, ())
        self.tall: Any = ti.field(ti.i32, ())
        self.tiles: Any = ti.field(ti.i32, ())
        self.tight = ti.field(ti.f32, LANES)
        self.numbers = ThreadNumbers.field(shape=2)
        self._number = [self.numbers.get_member_field(name) for name in THREAD_NUMBERS]

    def take(self, present: NDArray, east: NDArray, north: NDArray, numbers: list[dict[str, float]]) -> None:
        """present, east, north: key points and weights of `Sheet` in the padded grid. numbers: of `ThreadNumbers`, of
        threads along rows and along columns."""
        rows, width = present.shape
        high = -(-rows // LANES)
        more = ((0, high * LANES - rows), (0, 0))
        tiles = np.pad(present > 0, more).reshape(high, LANES, width // LANES, LANES)
        column, row = np.nonzero(tiles.any(axis=(1, 3)).T)
        places = row * LANES * width + column * LANES, (column * LANES + 1) * high * LANES + row * LANES
        weights = np.stack([np.pad(one, more).ravel() for one in (east, north)])
        named = np.array([[one[name] for name in THREAD_NUMBERS] for one in numbers], np.float32)
        self._take(width, weights, np.stack(places).astype(np.int32), named)

    @ti.kernel
    def _take(self, width: Int, weights: F32x2, places: I32x2, named: F32x2):
        """weights: (family, elements of whole tiles). places: of tiles, and of the same turned. No yarn pulls yet."""
        ti.loop_config(serialize=True)
        for p in range(weights.shape[1]):
            for family in ti.static(range(2)):
                self.weight[p + family * self.size] = weights[family, p]
                for field in ti.static(self._forgotten[2]):
                    field[p + family * self.size] = 0.0
            for field in ti.static(self._forgotten[1]):
                field[p] = 0.0
            self.diagonal[p] = 1.0
        ti.loop_config(serialize=True)
        for p in range(weights.shape[1] // width * (width + 2)):
            for field in ti.static(self._forgotten[0]):
                field[p] = 0.0
        ti.loop_config(serialize=True)
        for k in range(places.shape[1]):
            self.tile[k], self.turned_tile[k] = places[0, k], places[1, k]
        ti.loop_config(serialize=True)
        for family in range(2):
            for k, number in ti.static(enumerate(self._number)):
                number[family] = named[family, k]
        self.row[None], self.tall[None], self.tiles[None] = width, weights.shape[1] // width, places.shape[1]

    @ti.func
    def judge(self):
        """Before a substep: whether it is wild, by how much threads were strained in the last."""
        self.wild[None] = ti.select(largest(load(self.strained, 0)) > 1.0, 1.0, 0.0)
        store(self.strained, 0, ti.Vector([0.0] * LANES))

    @ti.func
    def begin(self, p):
        """No tension yet in this substep."""
        for family in ti.static(range(2)):
            store(self.tension, p + family * self.size, ti.Vector([0.0] * LANES))

    @ti.func
    def solve(self, points: Template, family, packets: Template, first, last):
        """One sweep over the yarns of a family, 0 along the rows and 1 along the columns, through packets of lanes
        number `first` to `last`, in the order of their rows."""
        row, tall = self.row[None], self.tall[None]
        if family == 1:
            n = self.numbers[1]
            for e in range(first, last):
                self.aim(points, points.lanes(packets[e] * LANES), ti.static(self.size), row, n)
            for e in range(first, last):
                self.systems(points, points.lanes(packets[e] * LANES), ti.static(self.size), row, n)
            for e in range(first, last):
                self.down(points.lanes(packets[e] * LANES), row)
            for e in range(first, last):
                self.up(points.lanes(packets[first + last - 1 - e] * LANES), row)
            for e in range(first, last):
                self.push(points, points.lanes(packets[e] * LANES), ti.static(self.size), row, n)
        else:
            n = self.numbers[0]
            for e in range(first, last):
                self.aim(points, points.lanes(packets[e] * LANES), 0, 1, n)
            for e in range(first, last):
                self.systems(points, points.lanes(packets[e] * LANES), 0, 1, n)
            for k in range(self.tiles[None]):
                self.turned_down(points.lanes(self.tile[k]), points.lanes(self.turned_tile[k]), row, tall)
            for k in range(self.tiles[None]):
                m = self.tiles[None] - 1 - k
                self.turned_up(points.lanes(self.tile[m]), points.lanes(self.turned_tile[m]), row, tall)
            for e in range(first, last):
                self.push(points, points.lanes(packets[e] * LANES), 0, 1, n)

    @ti.func
    def aim(self, points: Template, p, family: Template, offset: Template, n: Template):
        """The threads that begin at the lanes at p: their direction before the step and how it turned, their
        elongation after it, and how that changed."""
        fixed = ti.static(isinstance(offset, int))  # and needs no bounds
        q = p + offset if ti.static(fixed) else near(p + offset)
        s = family + p
        there = ti.min(load(self.weight, s) * 1e30, 1.0)
        # After the step, and in it.
        x = load(points.position[0], q) - load(points.position[0], p)
        y = load(points.position[1], q) - load(points.position[1], p)
        z = load(points.position[2], q) - load(points.position[2], p)
        u = load(points.step[0], q) - load(points.step[0], p)
        v = load(points.step[1], q) - load(points.step[1], p)
        w = load(points.step[2], q) - load(points.step[2], p)
        length = ti.sqrt(x * x + y * y + z * z + 1e-16)
        scale = there / length
        # Before it.
        a, b, c = x - u, y - v, z - w
        before = there / ti.sqrt(a * a + b * b + c * c + 1e-16)
        a, b, c = before * a, before * b, before * c
        x, y, z = scale * x, scale * y, scale * z
        grown = length - n.rest
        store(self.grown, p, grown)
        store(self.growing, p, n.damped * (u * x + v * y + w * z))
        store(self.strained, 0, ti.max(load(self.strained, 0), there * ti.abs(grown) / n.calm))
        for axis, old, new in ti.static(((0, a, x), (1, b, y), (2, c, z))):
            store(self.normal[axis], p, old)
            store(self.turning[axis], p, new - old)

    @ti.func
    def systems(self, points: Template, p, family: Template, offset: Template, n: Template):
        """Rows of the systems for the threads that begin at the lanes at p. family: where its fields begin."""
        fixed = ti.static(isinstance(offset, int))  # and needs no bounds
        q = p + offset if ti.static(fixed) else near(p + offset)
        b = p - offset if ti.static(fixed) else near(p - offset)
        s = family + p
        before = s - offset if ti.static(fixed) else near(s - offset)
        after = s + offset if ti.static(fixed) else near(s + offset)
        weight = load(self.weight, s)
        there = ti.min(weight * 1e30, 1.0)
        # Where to push: as before the step, and half of what turned otherwise than the threads beside it in the yarn.
        behind, ahead = (
            ti.min(load(self.weight, before) * 1e30, 1.0),
            ti.min(load(self.weight, after) * 1e30, 1.0),
        )
        mean = 1.0 / (behind + ahead + 1e-6)
        x, y, z = self.aimed(0, p, b, q, mean), self.aimed(1, p, b, q, mean), self.aimed(2, p, b, q, mean)
        scale = there / ti.sqrt(x * x + y * y + z * z + 1e-16)
        x, y, z = scale * x, scale * y, scale * z
        grown, growing = load(self.grown, p), load(self.growing, p)
        # Its law: soft until the crimp is drawn out, then stiff; held where it is at its limit.
        tension = load(self.tension, s)
        drawn = ti.select(grown > n.crimp, 1.0, 0.0)
        compliance = (n.soft + drawn * (n.stiff - n.soft)) / ti.max(weight, 1e-6)
        seems = grown - drawn * n.offset
        was = load(self.held, s)
        over = ti.select(grown > n.bound * (1.0 - (1.0 - HELD) * was), 1.0, 0.0)
        store(self.held, s, over)
        asked = seems + growing + compliance * tension
        asked += over * (grown - n.bound - asked)
        compliance *= 1.0 - over
        # The row of its yarn's system, and the coupling with the thread before it.
        m = n.mass * load(points.inverse_mass, p)
        more = 1.0 + n.damped * (1.0 - over)
        both = more * (m + n.mass * load(points.inverse_mass, q)) + compliance
        store(self.normal[0], p, x)
        store(self.normal[1], p, y)
        store(self.normal[2], p, z)
        # Along the rows, the thread before that of a lane is the one of the lane before: only now it is there.
        along = x * load(self.normal[0], b) + y * load(self.normal[1], b) + z * load(self.normal[2], b)
        store(self.diagonal, p, there * both + (1.0 - there))
        store(self.beside, p, -more * m * along)
        store(self.right, p, -there * asked)

    @ti.func
    def aimed(self, axis: Template, p, b, q, mean):
        """A direction's coordinate. In a wild substep that after the step, which damps what turns."""
        turned = load(self.turning[axis], p)
        rough = turned - mean * (load(self.turning[axis], b) + load(self.turning[axis], q))
        return load(self.normal[axis], p) + self.wild[None] * turned + (1.0 - self.wild[None]) * 0.5 * rough

    @ti.func
    def down(self, p, row):
        """Factorises the rows of the lanes at p, those before them done: L d Lᵀ, and z of L z = right."""
        b = near(p - row)
        beside, pivot = load(self.beside, p), load(self.pivot, b)
        store(self.pivot, p, 1.0 / ti.max(load(self.diagonal, p) - beside * beside * pivot, LEAST))
        store(self.change, p, load(self.right, p) - beside * pivot * load(self.change, b))

    @ti.func
    def up(self, p, row):
        """Δλ of the lanes at p, those after them done."""
        q = near(p + row)
        store(
            self.change, p, load(self.pivot, p) * (load(self.change, p) - load(self.beside, q) * load(self.change, q))
        )

    @ti.func
    def turned_down(self, p, t, row, tall):
        """`down` of the yarns along the rows in the tile at p, which when turned is at t."""
        diagonal, beside, right = ti.static(*self.room)
        for k in range(LANES):
            a = near(p + k * row)
            for c in range(LANES):
                diagonal[c * LANES + k] = self.diagonal[a + c]
                beside[c * LANES + k] = self.beside[a + c]
                right[c * LANES + k] = self.right[a + c]
        for c in range(LANES):
            q = near(t + c * tall)
            b = near(q - tall)
            m = c * LANES
            off, pivot = load(beside, m), load(self.turned_pivot, b)
            store(self.turned_pivot, q, 1.0 / ti.max(load(diagonal, m) - off * off * pivot, LEAST))
            store(self.turned_change, q, load(right, m) - off * pivot * load(self.turned_change, b))
            store(self.turned_beside, q, off)

    @ti.func
    def turned_up(self, p, t, row, tall):
        """`up` of the same, and Δλ back to where its threads lie."""
        change = ti.static(self.room[0])
        for back in range(LANES):
            c = LANES - 1 - back
            q = near(t + c * tall)
            a = near(q + tall)
            new = load(self.turned_pivot, q) * (
                load(self.turned_change, q) - load(self.turned_beside, a) * load(self.turned_change, a)
            )
            store(self.turned_change, q, new)
            store(change, c * LANES, new)
        for k in range(LANES):
            b = near(p + k * row)
            for c in range(LANES):
                self.change[b + c] = change[c * LANES + k]

    @ti.func
    def push(self, points: Template, p, family: Template, offset: Template, n: Template):
        """What the threads before and after the lanes at p move them by; and how tight the latter are."""
        b = p - offset if ti.static(isinstance(offset, int)) else near(p - offset)
        s = family + p
        before, after, m = load(self.change, b), load(self.change, p), n.mass * load(points.inverse_mass, p)
        tension = load(self.tension, s) + after
        store(self.tension, s, tension)
        own = n.bound * load(self.weight, s)  # a limit lets go of what pulls less than the thread itself would
        store(self.held, s, ti.select(tension * n.stiff < -own, load(self.held, s), 0.0))
        for axis in ti.static(range(3)):
            move = m * (before * load(self.normal[axis], b) - after * load(self.normal[axis], p))
            store(points.position[axis], p, load(points.position[axis], p) + move)
            store(points.step[axis], p, load(points.step[axis], p) + move)

    @ti.func
    def pull(self, points: Template, p, family: Template):
        """At the end of a substep: how tight threads are, for what the wave along a taut string asks of the step."""
        n = self.numbers[family]
        q = p + 1 if ti.static(family == 0) else near(p + self.row[None])
        s = p + ti.static(family * self.size)
        mobile = n.mass * ti.max(load(points.inverse_mass, p), load(points.inverse_mass, q))
        before = load(self.pulled, s)
        pulled = before + (-load(self.tension, s) * mobile / n.rest - before) / AVERAGED
        store(self.pulled, s, pulled)
        store(self.tight, 0, ti.max(load(self.tight, 0), pulled))

    @ti.func
    def loosen(self, p):
        """Forgets how tight the threads from the lanes at p were: a frame follows from its state alone."""
        none = ti.Vector([0.0] * LANES)
        store(self.tight, 0, none)
        store(self.strained, 0, none)
        for family in ti.static(range(2)):
            store(self.pulled, p + family * self.size, none)
            store(self.held, p + family * self.size, none)

    @ti.func
    def tightest(self):
        return largest(load(self.tight, 0))
