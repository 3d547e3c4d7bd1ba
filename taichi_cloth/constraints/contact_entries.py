"""What cloth meets of a body in every substep: planes as they lie now, one after the other in memory, and how those of
one limb give way to another that pinches the cloth against it.
"""

from typing import Any

import taichi as ti

from taichi_cloth.constraints.contact_surface import BodySurface
from taichi_cloth.ground.arrays import Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.stencil import relative
from taichi_cloth.sheet.sheet import LANES

__all__ = ["ENTRY", "FACED", "GAP", "OFFSET", "RUBS", "Entries"]

ENTRY, OFFSET, GAP, RUBS = 6, 3 * LANES, 4 * LANES, 5 * LANES
"""Numbers of an entry for each key point: normal and offset now, how far off they are kept, and µ."""
SKIN = 2e-3
"""Give way by which a surface holds nothing any more [m]: skin that is pinched goes along with the cloth. Held by both
limbs, which slide past each other, cloth would be torn."""
FACED = 8
"""Primitives that some key points of a packet are spared from and that it may come near, at most."""


@ti.data_oriented
class Entries(BodySurface):
    """Of padded grids of up to `size` key points, so many `slots` a packet. spared: bits of `Colliders.spared`."""

    # Its numbers are bounds of loops: type checkers would take them for matrices.
    entries: Any

    def __init__(
        self, size: int, slots: int, capacity: int, kinds: tuple[int, ...], nodes: int, parts: int, line: int
    ) -> None:
        super().__init__(capacity, kinds, nodes, parts, line)
        blocks = size // LANES
        # Blocks, their primitives, and normals and offsets now.
        self.entries = ti.field(ti.i32, parts * line)
        self.entry_block, self.entry_of = ti.field(ti.i32, blocks * slots), ti.field(ti.i32, blocks * slots)
        self.entry = ti.field(ti.f32, blocks * slots * ENTRY * LANES)
        # What key points are spared from: of a packet, and of each the nearest, its normal and how far off it is [m].
        self.spared = ti.field(ti.i32, size)
        self.faces, self.faced = ti.field(ti.i32, blocks), ti.field(ti.i32, blocks * FACED)
        self.facing = [ti.field(ti.f32, size) for _ in range(4)]

    @ti.func
    def lanes_of(self, k, numbers: Template):
        """The first lane of slot or entry k, of so many numbers; bounds tell the compiler that nothing overflows."""
        return ti.min(ti.max(k, 0), 1 << 22) * numbers * LANES

    @routine
    def face(self, points: Template, part: Int, packet: Int):
        """What each key point of a packet is spared from, the nearest."""
        a, q = points.lanes(packet * LANES), self.scratch_of(part)
        for p in range(packet * LANES, (packet + 1) * LANES):
            self.facing[3][p] = 1e6
        for m in range(packet * FACED, packet * FACED + self.faces[packet]):
            i = self.faced[m]
            x, y, z = relative(points.position, a, self.anchor(i))
            self.measure(i, q, x, y, z)
            for k in range(LANES):
                p = packet * LANES + k
                if (self.spared[p] >> self.bone(i)) & 1 == 1 and self.scratch[q + k] < self.facing[3][p]:
                    for axis in ti.static(range(3)):
                        self.facing[axis][p] = self.scratch[q + (axis + 1) * LANES + k]
                    self.facing[3][p] = self.scratch[q + k]

    @routine
    def give_way(self, points: Template, e: Int):
        """An entry's planes, where what key points are spared from faces them: no farther than to where those are as
        deep in the one as in the other, less what is left between.

        At a distance d, and b of what faces them, whose normals have the cosine c, a push by s takes them to d + s and
        b + c s: both are (b − c d) / (1 − c).
        """
        o, c, first = self.lanes_of(e, ENTRY), self.anchor(self.entry_of[e]), self.entry_block[e] * LANES
        for k in range(LANES):
            p, d, along = first + k, -self.entry[o + OFFSET + k], 0.0
            for axis in ti.static(range(3)):
                n = self.entry[o + axis * LANES + k]
                d += n * (points.position[axis][p] - c[axis])
                along += n * self.facing[axis][p]
            self.yield_to(o + k, along, d, self.facing[3][p])

    @routine
    def give_between(self, points: Template, first: Int, last: Int):
        """The same of planes of one packet, entries number `first` to `last`, that are of two limbs and face each
        other: what a belly and a thigh both meet."""
        for e in range(first, last):
            o, c = self.lanes_of(e, ENTRY), self.anchor(self.entry_of[e])
            for f in range(first, last):
                if self.limb(self.entry_of[e]) != self.limb(self.entry_of[f]):
                    q, b = self.lanes_of(f, ENTRY), self.anchor(self.entry_of[f])
                    for k in range(LANES):
                        p, along = self.entry_block[e] * LANES + k, 0.0
                        d, other = -self.entry[o + OFFSET + k], -self.entry[q + OFFSET + k]
                        for axis in ti.static(range(3)):
                            n, m = self.entry[o + axis * LANES + k], self.entry[q + axis * LANES + k]
                            d += n * (points.position[axis][p] - c[axis])
                            other += m * (points.position[axis][p] - b[axis])
                            along += n * m
                        self.yield_to(o + k, along, d, other)

    @ti.func
    def yield_to(self, at, along, d, other):
        """What a plane at a distance d keeps free and holds, numbers from `at`, where another is `other` away, and the
        cosine of their normals is `along`."""
        middle = (other - along * d) / ti.max(1.0 - along, 0.1) - self.between[None]
        yields = ti.min(ti.max(-2.0 * along, 0.0), 1.0) * ti.max(self.gap[None] - middle, 0.0)
        self.entry[at + GAP] = ti.min(self.entry[at + GAP], self.gap[None] - yields)
        holds = self.friction[None] * ti.max(1.0 - yields / SKIN, 0.0)
        self.entry[at + RUBS] = ti.min(self.entry[at + RUBS], holds)
