"""Threads beside ties: those that end at a key point which a tie moves, among whole yarns.

Ties are closed after the yarns of a substep. What that asks of the last thread of a yarn the yarn hands on in the next
substep only, and at the ends of seams, where ties of two or three of them meet in one cell, that thread stays long: of
a T-shirt that walks one came to 10 %, while those beside it in its yarn were within 1. So at the end of a substep
those longer than `LONGEST` are drawn together one after the other, as Provot's limit does it, in turn with the ties at
their ends, so that what a tie asks is shared among a few threads of its yarn. What moves
places moves steps (mended in positions alone, cloth at rest shook at 4 mm/s). While seams are still being drawn
together threads are left to their law.

Cloth beside a seam is not as soft as the cloth it is cut from: its allowance lies double there, sewn to itself.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taichi_cloth.ground.arrays import F32x2, I32x1, I32x2, Template
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import PAD, Sheet

__all__ = ["LINKS", "LONGEST", "PULL", "Beside", "BesideFields", "beside", "longest_beside"]

LONGEST, PULL = 0.018, 50.0
"""Strain up to which such a thread is left to its law, or what that gives it at a pull [N/m], whichever is more: a soft
thread is to stay one. T-shirts come to 45 N/m beside their seams as they walk, trousers to 120."""

NEARLY = 0.5
"""Share of it from which on a thread is looked at again in the turns of a substep: what is drawn together beside it may
draw it beyond."""

LINKS = 8
"""Room for ties of a thread, on average: 2.6 in a T-shirt."""


@dataclass(frozen=True, eq=False)
class Beside:
    """ends: (n, 2) elements of the padded grid. numbers: (n, 4), how long a thread may be and nearly so [m²], both
    squared, and what share of a growth each of its ends takes back. begin: (n + 1,), where its ties begin in `tie`."""

    ends: NDArray[np.int32]
    numbers: NDArray[np.float32]
    begin: NDArray[np.int32]
    tie: NDArray[np.int32]


def beside(sheet: Sheet, index: NDArray[np.int32], weight: NDArray[np.float32]) -> Beside:
    """index, weight: (ties, nodes), elements of the padded grid that ties blend."""
    inverse = sheet.padded(sheet.inverse_mass).ravel()
    at = np.repeat(np.arange(len(index)), index.shape[1]), index.ravel()
    named = csr_array(((weight != 0).ravel().astype(np.int32), at), shape=(len(index), inverse.size))
    touched = np.asarray(named.sum(axis=0)).ravel() > 0
    east, north, _ = (sheet.padded(one).ravel() for one in sheet.weights)
    ends, squares = [], []
    rest = sheet.springs.spacing_x, sheet.springs.spacing_y
    for way, (there, far, length) in enumerate(zip((east, north), (1, sheet.width), rest, strict=True)):
        may = sheet.constant(lambda cloth, way=way: longest_beside(cloth.material)[way])
        p = np.flatnonzero(there > 0)
        p = p[(touched[p] | touched[p + far]) & (inverse[p] + inverse[p + far] > 0)]
        ends.append(np.stack([p, p + far], axis=1))
        strain = np.broadcast_to(may, (sheet.shape[0], 1))[p // sheet.width - PAD, 0]
        squares.append(np.stack([(length * (1 + s)) ** 2 for s in (strain, NEARLY * strain)], axis=1))
    ends, squares = np.concatenate(ends), np.concatenate(squares)
    mobile = inverse[ends] / inverse[ends].sum(axis=1, keepdims=True)
    threads = np.repeat(np.arange(len(ends)), 2), ends.ravel()
    of = csr_array((np.ones(ends.size, np.int32), threads), shape=(len(ends), inverse.size)) @ named.T
    of.sort_indices()
    return Beside(
        ends.astype(np.int32),
        np.column_stack([squares, mobile]).astype(np.float32),
        of.indptr.astype(np.int32),
        of.indices.astype(np.int32),
    )


def longest_beside(m: Material) -> list[float]:
    """Strain that threads beside ties may have, of weft and warp."""
    out = []
    for soft, stiff, crimp in (
        (m.tensile_weft, m.drawn_weft, m.crimp_weft),
        (m.tensile_warp, m.drawn_warp, m.crimp_warp),
    ):
        strain = PULL / soft
        if stiff > 0 and strain > crimp:
            strain = crimp + (PULL - soft * crimp) / stiff
        out.append(max(LONGEST, strain))
    return out


@ti.data_oriented
class BesideFields:
    """Room for so many threads. nearly: numbers of those that were nearly too long, or more, at the last look, and
    listed: how many. drawn: of those that were drawn together in this turn."""

    def __init__(self, threads: int) -> None:
        self.count: Any = ti.field(ti.i32, ())
        self.listed: Any = ti.field(ti.i32, ())
        self.ends, self.number = ti.field(ti.i32, (threads, 2)), ti.field(ti.f32, (threads, 4))
        self.begin, self.tie = (_numbers(n) for n in (threads + 1, LINKS * threads))
        self.nearly, self.drawn = ti.field(ti.i32, threads), ti.field(ti.i32, threads)

    @ti.kernel
    def take(self, ends: I32x2, numbers: F32x2, begin: I32x1, tie: I32x1):
        ti.loop_config(serialize=ti.static(on_host()))  # less work than to wake threads
        for t in range(ends.shape[0]):
            for k in ti.static(range(2)):
                self.ends[t, k] = ends[t, k]
            for k in ti.static(range(4)):
                self.number[t, k] = numbers[t, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for t in range(begin.shape[0]):
            self.begin[t] = begin[t]
        ti.loop_config(serialize=ti.static(on_host()))
        for e in range(tie.shape[0]):
            self.tie[e] = tie[e]
        self.count[None] = ends.shape[0]

    @ti.func
    def look(self, points: Template):
        """Lists those that are nearly too long: how many."""
        found = 0
        for t in range(self.count[None]):
            if self.is_nearly(points, t):
                self.nearly[found] = t
                found += 1
        return found

    @ti.func
    def is_nearly(self, points: Template, t):
        """Whether thread t is nearly too long."""
        x, y, z = self.across(points, t)
        return x * x + y * y + z * z > self.number[t, 1]

    @ti.func
    def draw(self, points: Template, listed):
        """Draws together those of the first `listed` that are too long: how many."""
        found = 0
        for m in range(listed):
            t = self.nearly[m]
            x, y, z = self.across(points, t)
            squared, most = x * x + y * y + z * z, self.number[t, 0]
            if squared > most:
                over = 1.0 - ti.sqrt(most / squared)
                p, q = self.ends[t, 0], self.ends[t, 1]
                a, b = self.number[t, 2] * over, self.number[t, 3] * over
                for axis, apart in ti.static(((0, x), (1, y), (2, z))):
                    points.position[axis][p] += a * apart
                    points.step[axis][p] += a * apart
                    points.position[axis][q] -= b * apart
                    points.step[axis][q] -= b * apart
                self.drawn[found] = t
                found += 1
        return found

    @ti.func
    def across(self, points: Template, t):
        """From one end of thread t to the other."""
        p, q = self.ends[t, 0], self.ends[t, 1]
        return (
            points.position[0][q] - points.position[0][p],
            points.position[1][q] - points.position[1][p],
            points.position[2][q] - points.position[2][p],
        )


def _numbers(shape: int) -> Any:
    """Any: type checkers take an element of a field for a matrix, which is no bound of a loop."""
    return ti.field(ti.i32, shape)
