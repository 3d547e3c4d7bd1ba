"""Strain limit (Provot 1995, "Deformation constraints", section 4): threads that have grown too long are shortened.

Threads are the structural springs. Those near the limit are few: they are listed, and then gone through one after the
other, each seeing what those before it did (Gauss–Seidel, as Provot's own), in turns from the first to the last and
from the last to the first. Both ends of a thread move by the share of their inverse mass, so that momentum is kept and
pinned key points stay. From the steps is taken the speed at which a thread grows, and no more: what was too long before
is mended in positions alone, and so adds no energy of motion.

Threads within the two sides of a sheet are seen to on two threads of the processor, and then those between the sides.
"""

# In kernels a vector is a Taichi expression, which type checkers cannot follow.
# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false

from functools import lru_cache

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.arrays import Template
from taichi_cloth.forces import FrameForces
from taichi_cloth.sheet import LANES, Sheet, SheetState
from taichi_cloth.solvers.crew import LINE, SIDES
from taichi_cloth.solvers.passes import Pass
from taichi_cloth.solvers.stencil import load, store

__all__ = ["ThreadLimit"]

Mask = NDArray[np.bool_]

NEAR = 0.005
"""Share of its length by which a thread may be shorter than the limit and is listed: the others may stretch it."""

LISTED = 2
"""How often they are listed in a substep: as the springs left them, and once more when seams have pulled at them."""

SWEEPS = 2
"""Over the list, each time: they cost little beside those of the other passes that take turns with them."""


@ti.func
def largest(values):
    """Of the lanes; in halves, as vector instructions have it."""
    four = ti.Vector([ti.max(values[k], values[k + 4]) for k in ti.static(range(4))])
    two = ti.Vector([ti.max(four[k], four[k + 2]) for k in ti.static(range(2))])
    return ti.max(two[0], two[1])


class ThreadLimit(Pass):
    """The limit of one sheet's threads; how far they may grow stands in the solver's `Numbers`."""

    parts = SIDES
    whole = True
    repeated = True

    def __init__(self, sheet: Sheet) -> None:
        self.memory = _memory(runtime.generation(), sheet.padded_shape)
        self._there = [sheet.padded(weight).ravel() > 0 for weight in sheet.weights[:2]]
        self._sides = np.zeros(0, np.int32)

    # Limits that share their memory are one pass to the solver: they need no second kernel.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, ThreadLimit) and self.memory is other.memory

    def __hash__(self) -> int:
        return id(self.memory)

    def join(self, substeps: int, step: float, sides: NDArray[np.int32]) -> None:
        self._sides = sides

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        if self.memory.holder is not self._sides:
            self.memory.take(self._sides, *self._there)
            self.memory.holder = self._sides

    @ti.func
    def before(self, work: Template, done, n: Template):
        for listed in range(SIDES + 1):
            self.memory.calls[listed * LINE] = 0

    @ti.func
    def after(self, work: Template, part, first, last, done, n: Template):
        if self.memory.calls[part * LINE] < LISTED:
            self.memory.seek(work, part, first, last, n)
        self.memory.calls[part * LINE] += 1
        for sweep in range(SWEEPS):
            self.memory.shorten(work, part, sweep, n)

    @ti.func
    def after_all(self, work: Template, done, n: Template):
        if self.memory.calls[SIDES * LINE] < LISTED:
            self.memory.seek_between(work, n)
        self.memory.calls[SIDES * LINE] += 1
        for sweep in range(SWEEPS):
            self.memory.shorten(work, SIDES, sweep, n)


@lru_cache(maxsize=8)
def _memory(generation: int, padded_shape: tuple[int, int]) -> "_Memory":
    """Fields and functions for grids of that shape. generation: of the Taichi runtime."""
    return _Memory(*padded_shape)


@ti.data_oriented
class _Memory:
    """Lists of the threads near the limit, by their first key point: those along rows, in the order of their columns,
    and those across, in the order of their rows. So a sweep goes along every yarn from end to end, but the threads next
    to each other in a list are of different yarns, and a processor need not wait for one to begin with the next.

    There is a pair of lists for each side, and one for what lies between; each has its own `size` elements of `along`
    and `across`.
    """

    def __init__(self, rows: int, width: int) -> None:
        self.width, self.size = width, rows * width
        self.holder: object = None
        self.side = ti.field(ti.i32, self.size // LANES)
        self.calls = ti.field(ti.i32, (SIDES + 1) * LINE)
        self.between, self.between_count = ti.field(ti.i32, 2 * self.size), ti.field(ti.i32, 2)
        self.along_count, self.across_count = (ti.field(ti.i32, (SIDES + 1) * LINE) for _ in range(2))
        self.found = ti.field(ti.i32, SIDES * self.size)
        self.along, self.across = (ti.field(ti.i32, (SIDES + 1) * self.size) for _ in range(2))
        self.column = ti.field(ti.i32, SIDES * (width + LINE))
        self.over = ti.field(ti.f32, (SIDES + 1) * LINE)

    def take(self, sides: NDArray[np.int32], along: Mask, across: Mask) -> None:
        """sides: of the blocks. along, across: where there is a thread, of all elements."""
        of = np.repeat(sides, LANES)
        left = [np.flatnonzero(t[:-k] & (of[:-k] != of[k:])) for t, k in ((along, 1), (across, self.width))]
        listed = np.concatenate(left).astype(np.int32)
        self.side.from_numpy(sides)
        self.between.from_numpy(np.pad(listed, (0, self.between.shape[0] - len(listed))))
        self.between_count.from_numpy(np.array([len(left[0]), len(listed)], np.int32))

    @ti.func
    def seek_between(self, work: Template, n: Template):
        """Lists the threads near the limit that go from side to side."""
        x, y = n.longest_x - NEAR * n.spacing_x, n.longest_y - NEAR * n.spacing_y
        along, across = SIDES * self.size, SIDES * self.size
        for k in range(self.between_count[1]):
            p, upright = self.between[k], k >= self.between_count[0]
            q = p + (self.width if upright else 1)
            near, squared = y if upright else x, 0.0
            for axis in ti.static(range(3)):
                squared += (work.position[axis][q] - work.position[axis][p]) ** 2
            if squared > near * near:
                if upright:
                    self.across[across] = p
                    across += 1
                else:
                    self.along[along] = p
                    along += 1
        self.along_count[SIDES * LINE], self.across_count[SIDES * LINE] = (
            along - SIDES * self.size,
            across - SIDES * self.size,
        )

    @ti.func
    def grown(self, work: Template, p, offset: Template, weight: Template, near):
        """By how much the squared length of the threads to p + offset is above `near`² [m²]; below 0 where none is."""
        x, y, z = work.away(work.position, p, offset)
        there = ti.min(load(weight, p) * 1e30, 1.0)
        return there * (x * x + y * y + z * z) - near * near

    @ti.func
    def seek(self, work: Template, side, first, last, n: Template):
        """Lists the threads near the limit within a side. (Of those that leave it the end may be changing just now.)"""
        x, y = n.longest_x - NEAR * n.spacing_x, n.longest_y - NEAR * n.spacing_y
        here = side * self.size
        along, across = here, here
        column, over = side * (self.width + LINE), (side + 1) * LINE
        for c in range(self.width + 1):
            self.column[column + c] = 0
        for e in range(first, last):
            p = work.lanes(work.block[e] * LANES)
            over_x = self.grown(work, p, 1, work.east, x)
            over_y = self.grown(work, p, ti.static(self.width), work.north, y)
            if largest(ti.max(over_x, over_y)) > 0.0:
                store(self.over, over, over_x)
                store(self.over, over + LANES, over_y)
                for k in range(LANES):
                    q = p + k
                    if self.over[over + k] > 0.0 and self.side[(q + 1) // LANES] == side:
                        self.found[along] = q
                        self.column[column + q % self.width + 1] += 1
                        along += 1
                    if self.over[over + LANES + k] > 0.0 and self.side[(q + self.width) // LANES] == side:
                        self.across[across] = q
                        across += 1
        for c in range(self.width):
            self.column[column + c + 1] += self.column[column + c]
        for k in range(here, along):
            q = self.found[k]
            c = column + q % self.width
            self.along[here + self.column[c]] = q
            self.column[c] += 1
        self.along_count[side * LINE], self.across_count[side * LINE] = along - here, across - here

    @ti.func
    def shorten(self, work: Template, listed, sweep, n: Template):
        """Every thread of a pair of lists once, from their first to their last or back."""
        first, back = listed * self.size, sweep % 2
        self.shorten_all(work, self.along, first, self.along_count[listed * LINE], 1, n.longest_x, back)
        self.shorten_all(work, self.across, first, self.across_count[listed * LINE], self.width, n.longest_y, back)

    @ti.func
    def shorten_all(self, work: Template, listed: Template, first, count, offset: Template, longest, back):
        x, y, z = ti.static(*work.position)
        u, v, w = ti.static(*work.step)
        for k in range(count):
            p = listed[first + (count - 1 - k if back else k)]
            q = p + offset
            dx, dy, dz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
            squared = dx * dx + dy * dy + dz * dz
            free = work.inverse_mass[p] + work.inverse_mass[q]
            if squared > longest * longest and free > 0.0:
                scale = 1.0 / ti.sqrt(squared)
                over = 1.0 - longest * scale
                growth = ((u[q] - u[p]) * dx + (v[q] - v[p]) * dy + (w[q] - w[p]) * dz) * scale * scale
                slow = ti.min(ti.max(growth, 0.0), over)
                here = work.inverse_mass[p] / free
                there = 1.0 - here
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
