"""How stiff a sheet has become: `FrequencyBound` of the shape at the end of a frame, in vector code.

Springs that turn towards each other, and threads that are drawn taut, are stiffer together than at rest, and Verlet's
longest step shrinks (`stability.py`). This is looked at after every frame, so it may cost no more than two substeps:
the largest eigenvalue of a key point's matrix A is taken as (tr A³²)^(1/32), which four squarings give, and which is
never too small and at most 3.5 % too large.
"""

from typing import Any

import numpy as np
import taichi as ti

from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, Int, Template
from taichi_cloth.motion.crew import PARTS
from taichi_cloth.motion.stencil import largest, load, near, nothing, store
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.stability import FrequencyBound

__all__ = ["Stiffest"]

SPRINGS = 12
"""Of a key point at most: four threads, four diagonals, and four of the paper's to second neighbours."""

XX, YY, ZZ, XY, XZ, YZ, MOST = (k * LANES for k in range(7))


@ti.data_oriented
class Stiffest:
    """The terms of a padded grid of up to `size` elements, spring by spring, so that their code is compiled once; and
    room for the matrices of 8 neighbouring key points, six numbers each, and for the largest bound so far."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.springs: Any = ti.field(ti.i32, ())
        self.offset, self.rest = ti.field(ti.i32, SPRINGS), ti.field(ti.f32, SPRINGS)
        self.term, self.bend = ti.field(ti.f32, SPRINGS * size), ti.field(ti.f32, size)
        self.room = ti.field(ti.f32, 7 * LANES)

    def take(self, bound: FrequencyBound, step: float) -> None:
        """The terms of a sheet's bound × step² [s²]."""
        sheet = bound.sheet
        terms = np.zeros((SPRINGS + 1, sheet.padded_shape[0] * sheet.width), np.float32)
        offsets, rests = np.zeros(SPRINGS, np.int32), np.ones(SPRINGS, np.float32)
        for k, (link, first, second) in enumerate(bound.terms):
            (i, j), (down, along) = ([w.start for w in window] for window in (link.one, link.two))
            for n, window, values, way in ((2 * k, link.one, first, 1), (2 * k + 1, link.two, second, -1)):
                term = np.zeros(sheet.shape)
                term[window] = step**2 * values
                terms[n] = sheet.padded(term).ravel()
                offsets[n], rests[n] = way * ((down - i) * sheet.width + along - j), link.rest
        terms[SPRINGS] = sheet.padded(step**2 * bound.bend).ravel()
        self._take(2 * len(bound.terms), offsets, rests, terms)

    @ti.kernel
    def _take(self, springs: Int, offsets: I32x1, rests: F32x1, terms: F32x2):
        """terms: (SPRINGS + 1, elements of the padded grid), the last the terms of bending."""
        ti.loop_config(serialize=True)
        for k in range(SPRINGS):
            self.offset[k], self.rest[k] = offsets[k], rests[k]
        for p in range(terms.shape[1]):
            for k in range(SPRINGS):
                self.term[k * self.size + p] = terms[k, p]
        for p in range(terms.shape[1]):
            self.bend[p] = terms[SPRINGS, p]
        self.springs[None] = springs

    @ti.func
    def find(self, work: Template):
        """The largest bound of (ω h)² with the key points of a `Stencil` where they are."""
        for k in range(LANES):
            self.room[MOST + k] = 0.0
        for e in range(work.cut[0], work.cut[PARTS]):
            p = work.lanes(work.packet[e] * LANES)
            # The matrices of 8 key points, spring by spring; their bound, and the largest of each lane so far.
            for k in range(MOST):
                self.room[k] = 0.0
            for k in range(self.springs[None]):
                self.spring(work, p, k)
            xx, yy, zz = load(self.room, XX), load(self.room, YY), load(self.room, ZZ)
            xy, xz, yz = load(self.room, XY), load(self.room, XZ), load(self.room, YZ)
            bound = eigenvalue(xx, yy, zz, xy, xz, yz) + load(self.bend, p)
            store(self.room, MOST, ti.max(load(self.room, MOST), bound))
        return largest(load(self.room, MOST))

    @ti.func
    def spring(self, work: Template, p, k):
        """Adds spring k of the lanes at p."""
        xx, yy, zz, xy, xz, yz = self.held(work, p, k)
        self.add(XX, xx)
        self.add(YY, yy)
        self.add(ZZ, zz)
        self.add(XY, xy)
        self.add(XZ, xz)
        self.add(YZ, yz)

    @ti.func
    def held(self, work: Template, p, k):
        """What spring k of the key points taken at p adds to their matrices: c n nᵀ, and where it is longer than at
        rest what holds it straight, c (1 − L/l) (I − n nᵀ). Six numbers."""
        q = near(p + self.offset[k])
        # The way (x, y, z) to the other end; what the spring holds across it, and along it beyond that.
        constant = load(self.term, work.lanes(k * self.size + p))
        x = load(work.position[0], q) - load(work.position[0], p)
        y = load(work.position[1], q) - load(work.position[1], p)
        z = load(work.position[2], q) - load(work.position[2], p)
        inverse = 1.0 / ti.sqrt(ti.max(x * x + y * y + z * z, 1e-20))
        across = constant * ti.max(1.0 - self.rest[k] * inverse, 0.0)
        along = (constant - across) * inverse * inverse
        return (
            along * x * x + across,
            along * y * y + across,
            along * z * z + across,
            along * x * y,
            along * x * z,
            along * y * z,
        )

    @ti.func
    def add(self, k: Template, values):
        store(self.room, k, load(self.room, k) + values)

    @ti.func
    def bound(self, work: Template, p):
        """That of the key points taken at p, where many are worked out at once and each needs room of its own."""
        xx, yy, zz, xy, xz, yz = nothing(), nothing(), nothing(), nothing(), nothing(), nothing()
        for k in range(self.springs[None]):
            a, b, c, d, e, f = self.held(work, p, k)
            xx, yy, zz, xy, xz, yz = xx + a, yy + b, zz + c, xy + d, xz + e, yz + f
        return eigenvalue(xx, yy, zz, xy, xz, yz) + load(self.bend, p)


@ti.func
def eigenvalue(xx, yy, zz, xy, xz, yz):
    """The largest of matrices that have none below 0."""
    # A over its trace, so that no power leaves float32; squared to A¹⁶, whose own square has the trace asked for.
    trace = xx + yy + zz
    s = 1.0 / ti.max(trace, 1e-30)
    a = squared(squared(squared(squared((xx * s, yy * s, zz * s, xy * s, xz * s, yz * s)))))
    power = a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + 2.0 * (a[3] * a[3] + a[4] * a[4] + a[5] * a[5])
    return trace * ti.sqrt(ti.sqrt(ti.sqrt(ti.sqrt(ti.sqrt(power)))))


@ti.func
def squared(a):
    """A² of a symmetric matrix, by its six numbers xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = a
    return (
        xx * xx + xy * xy + xz * xz,
        xy * xy + yy * yy + yz * yz,
        xz * xz + yz * yz + zz * zz,
        xx * xy + xy * yy + xz * yz,
        xx * xz + xy * yz + xz * zz,
        xy * xz + yy * yz + yz * zz,
    )
