"""What rubs and locks within a sheet: fibres in a bent yarn, crossings in a sheared cell, threads that touch.

A slider with an elastic part in series (Prandtl) remembers one number, where it would pull nothing: of both hinges of a
key point a second difference along the normal, of the cell that begins there a difference of its diagonals' lengths
[m]. These are the planes ANCHORS of a state; 0 is the sheet as it was woven, flat and square.

It is found for 8 key points before the springs of each substep, at what is ahead: how much each hinge and each cell
pulls, of which key points then take their parts (`Stencil.elastic`). With hinges come those that only bend, with cells
those that only shear, so that their code is not there twice.

Cells shear by their threads' arcs and not by their chords (`sheet/springs.py`), so they pull at the hinges around them
too; hinges get that when all cells are known (`spread`).
"""

from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import F32x2, Float, Template
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.motion.numbers import take_numbers
from taichi_cloth.motion.stencil import area_around, load, near, nothing, scaled, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.sheet.springs import Springs

__all__ = ["ANCHORS", "Slipping", "slip_numbers"]

ANCHORS = 3
ALONG_X, ALONG_Y, SHEAR = range(ANCHORS)

LEAST = 1e-30

SPRINGS = (
    *("hinge_x", "hinge_y", "shear", "rub_x", "rub_y", "rub_shear", "lock"),  # × h² [kg]
    *("couple_x", "couple_y", "slip_shear"),  # × h² [kg m]
)
SLIP_NUMBERS = (
    *SPRINGS,
    *("give_x", "give_y", "give_shear"),  # 1/r over h², 0 where nothing rubs [1/kg]
    *("lock_from", "lock_over"),  # [m]
    "arc",  # 1/(12 l) [1/m]
)

SlipNumbers: Any = ti.types.struct(**dict.fromkeys(SLIP_NUMBERS, ti.f32))


def slip_numbers(springs: Springs, squared: float) -> dict[str, float]:
    """The values of `SlipNumbers`. squared: h², less what the air takes meanwhile [s²]."""
    out = {name: squared * getattr(springs, name) for name in SPRINGS}
    for way in ("x", "y", "shear"):
        rub = out[f"rub_{way}"]
        out[f"give_{way}"] = 1 / rub if rub > 0 else 0.0
    out |= {"lock_from": springs.lock_from, "lock_over": max(springs.lock_over, 1e-9)}
    return out | {"arc": 1 / (12 * springs.diagonal_length)}


@ti.func
def slider(value, anchor, rub, give, most):
    """The pull of a slider at `value`, and where it would pull nothing from now on."""
    pull = ti.max(ti.min(rub * (value - anchor), most), -most)
    return pull, value - give * pull


@ti.data_oriented
class Slipping:
    """Fields for a padded grid of up to `size` elements.

    anchor: see above. bent: [along x, along y][axis], what a hinge pulls by [kg m]. sheared: what the two diagonals of
    a cell are pulled by over their lengths [kg]. arc: the number of that name, of cells all of whose corners have
    hinges both ways, else 0. leant: [axis], what a cell's arcs pull its corners by; turned: the hinges there; pushed:
    what all four cells lean on a key point [kg m]. locked: of each part of the sheet and each lane, the largest share
    of the stiffness `lock` that a cell had in this frame. parts: how many there are, each `line` elements from the
    next. cloths: as of `Stencil`.
    """

    def __init__(self, size: int, parts: int = PARTS, line: int = LINE, cloths: int = 1) -> None:
        def fields(count: int) -> list[ti.Field]:
            return [ti.field(ti.f32, size) for _ in range(count)]

        self.size, self.parts, self.line, self.cloths = size, parts, line, cloths
        self.anchor, self.sheared = fields(ANCHORS), fields(2)
        self.bent = [fields(3), fields(3)]
        self.arc, self.leant, self.turned, self.pushed = ti.field(ti.f32, size), fields(3), fields(3), fields(3)
        self.locked = ti.field(ti.f32, parts * line)
        self.numbers = SlipNumbers.field(shape=() if cloths == 1 else cloths)
        self._number = [self.numbers.get_member_field(name) for name in SLIP_NUMBERS]
        told = *self.sheared, *self.leant, *self.turned, *self.pushed, *self.bent[0], *self.bent[1]
        self._all = (*self.anchor, self.arc, *told)

    @ti.kernel
    def take(self, named: F32x2):
        """named: values of `SlipNumbers` of each cloth. Nothing pulls yet, also where there is no cloth."""
        for p in range(self.size):
            for field in ti.static(self._all):
                field[p] = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            take_numbers(self._number, named, self.cloths)

    @ti.func
    def own(self, work: Template, p):
        """The numbers of the lanes at p."""
        if ti.static(self.cloths == 1):
            return self.numbers[None]
        else:
            return self.numbers[work.kind(p)]

    @ti.func
    def find(self, work: Template, hinges: Template, part, a, p):
        """All of the lanes at p, at a of what is ahead. work: the `Stencil`. hinges: whether there are any that bend.
        part: that the lanes are of."""
        n, row = self.own(work, p), work.row[None]
        around = work.around(a)
        # Bending, along the normal.
        nx, ny, nz = area_around(work, around, p)
        inverse = 1.0 / ti.sqrt(nx * nx + ny * ny + nz * nz + LEAST)
        normal = scaled((nx, ny, nz), inverse)
        weft = n.rub_x, n.give_x, n.couple_x, n.hinge_x
        warp = n.rub_y, n.give_y, n.couple_y, n.hinge_y
        self.bend(ALONG_X, p, around[1], around[2], 1, work.east, normal, weft, hinges)
        self.bend(ALONG_Y, p, around[3], around[4], row, work.north, normal, warp, hinges)
        # Shear of the cell whose first corner is here: its diagonals, from here and from the next in the row.
        to, x, y = work.away(work.ahead, around[0], a, row + 1), around[1], around[3]
        u, v, w = y[0] - x[0], y[1] - x[1], y[2] - x[2]
        first = ti.sqrt(ti.max(to[0] * to[0] + to[1] * to[1] + to[2] * to[2], 1e-20))
        second = ti.sqrt(ti.max(u * u + v * v + w * w, 1e-20))
        arc = load(self.arc, p)
        curl = self.curl(work, around, to, a)
        turn = to[0] - x[0] - y[0], to[1] - x[1] - y[1], to[2] - x[2] - y[2]
        apart = first - second + arc * (turn[0] * curl[0] + turn[1] * curl[1] + turn[2] * curl[2])
        pull, anchor = slider(apart, load(self.anchor[SHEAR], p), n.rub_shear, n.give_shear, n.slip_shear)
        store(self.anchor[SHEAR], p, anchor)
        beyond = ti.max(ti.abs(apart) - n.lock_from, 0.0)
        begun = ti.min(beyond, n.lock_over)
        lock = n.lock * (0.5 * begun * begun / n.lock_over + beyond - begun)
        pull = load(work.cell, p) * (n.shear * apart + pull + ti.select(apart > 0.0, lock, -lock))
        store(self.sheared[0], p, pull / first)
        store(self.sheared[1], p, -pull / second)
        for axis in ti.static(range(3)):
            store(self.leant[axis], p, pull * arc * curl[axis])
            store(self.turned[axis], p, pull * arc * turn[axis])
        there = ti.min(load(work.cell, p) * 1e30, 1.0) * begun / n.lock_over
        o = part * self.line
        store(self.locked, o, ti.max(load(self.locked, o), there))

    @ti.func
    def curl(self, work: Template, around: Template, to: Template, a):
        """The sum of both second differences at all corners of the cells that begin in the lanes at a. around: see
        `Stencil`. to: vectors to the last corner."""
        row = work.row[None]
        cx = around[2][0] + around[4][0] - 2.0 * (around[1][0] + around[3][0] + to[0])
        cy = around[2][1] + around[4][1] - 2.0 * (around[1][1] + around[3][1] + to[1])
        cz = around[2][2] + around[4][2] - 2.0 * (around[1][2] + around[3][2] + to[2])
        for offset in ti.static((1 - row, 2, row - 1, row + 2, 2 * row, 2 * row + 1)):
            u, v, w = work.away(work.ahead, around[0], a, offset)
            cx, cy, cz = cx + u, cy + v, cz + w
        return cx, cy, cz

    @ti.func
    def spread(self, work: Template, p):
        """What arcs pull the hinges of the lanes at p by, of the four cells around; after `find` of all."""
        row = work.row[None]
        for axis in ti.static(range(3)):
            pull = load(self.turned[axis], p) + load(self.turned[axis], near(p - 1))
            pull += load(self.turned[axis], near(p - row)) + load(self.turned[axis], near(p - row - 1))
            for way in ti.static(range(2)):
                store(self.bent[way][axis], p, load(self.bent[way][axis], p) + pull)
            push = load(self.leant[axis], near(p - 1)) - load(self.leant[axis], p)
            push += load(self.leant[axis], near(p - row)) - load(self.leant[axis], near(p - row - 1))
            store(self.pushed[axis], p, push)

    @ti.func
    def inner(self, work: Template, p):
        """`arc` of the cells that begin in the lanes at p: as much of it as the lightest thread has that it reaches."""
        row, least = work.row[None], nothing() + 1.0
        for k in ti.static((-1, 0, 1)):
            least = ti.min(least, load(work.east, near(p + k)), load(work.east, near(p + row + k)))
            least = ti.min(least, load(work.north, near(p + k * row)), load(work.north, near(p + k * row + 1)))
        store(self.arc, p, least * self.own(work, p).arc)

    @ti.func
    def bend(self, way: Template, p, to: Template, back: Template, offset, weight, normal, numbers, hinges: Template):
        """One hinge of the lanes at p. to, back: vectors to its neighbours. weight: field of the springs between."""
        rub, give, couple, hinge = numbers
        share = ti.min(load(weight, near(p - offset)), load(weight, p))
        x, y, z = to[0] + back[0], to[1] + back[1], to[2] + back[2]
        along = x * normal[0] + y * normal[1] + z * normal[2]
        pull, anchor = slider(along, load(self.anchor[way], p), rub, give, couple)
        store(self.anchor[way], p, anchor)
        for axis, of in ti.static(((0, x), (1, y), (2, z))):
            if ti.static(hinges):
                store(self.bent[way][axis], p, share * (hinge * of + pull * normal[axis]))
            else:
                store(self.bent[way][axis], p, share * pull * normal[axis])

    @ti.func
    def bending(self, axis: Template, p, row):
        """What all hinges, and cells along their arcs, pull the lanes at p by, along an axis."""
        hinges = self.taken(self.bent[ALONG_X][axis], p, 1) + self.taken(self.bent[ALONG_Y][axis], p, row)
        return hinges + load(self.pushed[axis], p)

    @ti.func
    def taken(self, bent: Template, p, offset):
        """Of the three hinges along one family that the lanes at p are part of."""
        return 2.0 * load(bent, p) - load(bent, near(p + offset)) - load(bent, near(p - offset))

    @ti.func
    def begin(self, part, done):
        """Substeps of a frame, of a part; the frame itself where none is done."""
        if done == 0:
            store(self.locked, part * self.line, nothing())

    @ti.kernel
    def most_locked(self) -> Float:
        """The largest of `locked`."""
        most = 0.0
        ti.loop_config(serialize=True)
        for part in range(self.parts):
            for lane in range(ti.static(min(LANES, self.line))):
                most = ti.max(most, self.locked[part * self.line + lane])
        return most
