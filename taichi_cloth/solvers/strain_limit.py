"""Strain limit (Provot 1995, "Deformation constraints", section 4): threads that have grown too long are shortened.

Threads are the structural springs. Those near the limit are few: they are listed, and then gone through one after the
other, each seeing what those before it did (Gauss–Seidel, as Provot's own), in turns from the first to the last and
from the last to the first. Both ends of a thread move by the share of their inverse mass, so that momentum is kept and
pinned key points stay. From the steps is taken the speed at which a thread grows, and no more: what was too long before
is mended in positions alone, and so adds no energy of motion.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false

from functools import lru_cache

import taichi as ti

from taichi_cloth import runtime
from taichi_cloth.arrays import Template
from taichi_cloth.sheet import LANES, Sheet
from taichi_cloth.solvers.passes import Pass
from taichi_cloth.solvers.stencil import load, store

__all__ = ["ThreadLimit"]

NEAR = 0.005
"""Share of its length by which a thread may be shorter than the limit and is listed: the others may stretch it."""

LISTED = 2
"""How often they are listed in a substep: as the springs left them, and once more when seams have pulled at them."""

SWEEPS = 2
"""Over the list, each time: they cost little beside those of the other passes that take turns with them."""


class ThreadLimit(Pass):
    """The limit of one sheet's threads; how far they may grow stands in the solver's `Numbers`."""

    local = False
    repeated = True

    def __init__(self, sheet: Sheet) -> None:
        self.memory = _memory(runtime.generation(), sheet.padded_shape)

    # Limits that share their memory are one pass to the solver: they need no second kernel.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, ThreadLimit) and self.memory is other.memory

    def __hash__(self) -> int:
        return id(self.memory)

    @ti.func
    def before(self, work: Template, first, last, shift, done, n: Template):
        self.memory.calls[None] = 0

    @ti.func
    def after(self, work: Template, first, last, shift, done, n: Template):
        if self.memory.calls[None] < LISTED:
            self.memory.seek(work, first, last, n)
        self.memory.calls[None] += 1
        for sweep in range(SWEEPS):
            self.memory.shorten(work, sweep, n)


@lru_cache(maxsize=8)
def _memory(generation: int, padded_shape: tuple[int, int]) -> "_Memory":
    """Fields and functions for grids of that shape. generation: of the Taichi runtime."""
    return _Memory(*padded_shape)


@ti.data_oriented
class _Memory:
    def __init__(self, rows: int, width: int) -> None:
        self.width = width
        self.count, self.calls = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.one, self.two = (ti.field(ti.i32, 2 * rows * width) for _ in range(2))
        self.over_x, self.over_y = (ti.field(ti.f32, rows * width) for _ in range(2))

    @ti.func
    def grown(self, work: Template, p, offset: Template, weight: Template, near):
        """By how much the squared length of the threads to p + offset is above `near`² [m²]; below 0 where none is."""
        x, y, z = work.away(work.position, p, offset)
        there = ti.min(load(weight, p) * 1e30, 1.0)
        return there * (x * x + y * y + z * z) - near * near

    @ti.func
    def seek(self, work: Template, first, last, n: Template):
        """Lists the threads near the limit, in the order of their key points."""
        row = ti.static(self.width)
        x, y = n.longest_x - NEAR * n.spacing_x, n.longest_y - NEAR * n.spacing_y
        found = 0
        for b in range(first, last):
            q = work.lanes(b * LANES)
            store(self.over_x, q, self.grown(work, q, 1, work.east, x))
            store(self.over_y, q, self.grown(work, q, row, work.north, y))
            most = -1.0
            for k in range(q, q + LANES):
                most = ti.max(most, self.over_x[k], self.over_y[k])
            if most > 0.0:
                for k in range(q, q + LANES):
                    for over, offset in ti.static(((self.over_x, 1), (self.over_y, row))):
                        if over[k] > 0.0:
                            self.one[found], self.two[found] = k, k + offset
                            found += 1
        self.count[None] = found

    @ti.func
    def shorten(self, work: Template, sweep, n: Template):
        """Every thread of the list once."""
        x, y, z = ti.static(*work.position)
        u, v, w = ti.static(*work.step)
        total = self.count[None]
        for k in range(total):
            m = k if sweep % 2 == 0 else total - 1 - k
            p, q = self.one[m], self.two[m]
            longest = n.longest_x if q == p + 1 else n.longest_y
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            length = ti.sqrt(dx * dx + dy * dy + dz * dz)
            here, there = work.inverse_mass[p], work.inverse_mass[q]
            if length > longest and here + there > 0.0:
                over = length - longest
                growth = ((u[q] - u[p]) * dx + (v[q] - v[p]) * dy + (w[q] - w[p]) * dz) / length
                move, slow = over / length, ti.min(ti.max(growth, 0.0), over) / length
                here, there = here / (here + there), there / (here + there)
                x[p] += here * move * dx
                y[p] += here * move * dy
                z[p] += here * move * dz
                u[p] += here * slow * dx
                v[p] += here * slow * dy
                w[p] += here * slow * dz
                x[q] -= there * move * dx
                y[q] -= there * move * dy
                z[q] -= there * move * dz
                u[q] -= there * slow * dx
                v[q] -= there * slow * dy
                w[q] -= there * slow * dz
