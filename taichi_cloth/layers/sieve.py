"""Which of the pairs of cells that boxes have left are parted by the direction from one's middle to the other's.

Boxes along the axes of space are wide round cloth that lies aslant: most cells two apart in a bent sheet are near each
other by their boxes alone.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.distances import dot, gather
from taichi_cloth.layers.paths import CELL, EAST, NORTH
from taichi_cloth.layers.search import element
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Sieve"]


@ti.data_oriented
class Sieve:
    """one, other: elements of the cells at hand. gap: [lane] [m]."""

    def __init__(self) -> None:
        self.one, self.other = (ti.field(ti.i32, LANES) for _ in range(2))
        self.gap = ti.field(ti.f32, LANES)

    @routine
    def sift(self, points: Template, paths: Template, tree: Template, search: Template, reach: Float, horizon: Float):
        """Takes from the cells that a search has found those that stay further apart than `reach` [m] until the
        horizon [substeps]."""
        width, total, left = points.row[None], search.count[0], 0
        for group in range((total + LANES - 1) // LANES):
            for k in range(LANES):
                pair = ti.min(group * LANES + k, total - 1)
                self.one[k] = element(search.one[0, pair], width)
                self.other[k] = element(search.other[0, pair], width)
            self.measure(paths, width, horizon)
            for k in range(ti.min(total - group * LANES, LANES)):
                pair, gap = group * LANES + k, self.gap[k]
                if gap > reach:
                    p, q = self.one[k], self.other[k]
                    tree.clear[p], tree.clear[q] = ti.min(tree.clear[p], 0.5 * gap), ti.min(tree.clear[q], 0.5 * gap)
                else:
                    search.one[0, left], search.other[0, left] = search.one[0, pair], search.other[0, pair]
                    left += 1
        search.count[0] = left

    @ti.func
    def measure(self, paths: Template, width, horizon):
        """How far the cells at hand are apart at least, until the horizon."""
        a, b, c, d = self.corners(paths, width, load(self.one, 0))
        e, f, g, h = self.corners(paths, width, load(self.other, 0))
        x, y, z = self.middle(paths, a, b, c, d)
        u, v, w = self.middle(paths, e, f, g, h)
        x, y, z = x - u, y - v, z - w
        scale = 1.0 / ti.sqrt(x * x + y * y + z * z + 1e-20)
        way = (x * scale, y * scale, z * scale)
        low, slow = ti.Vector([1e9] * LANES), ti.Vector([1e9] * LANES)
        high, fast = ti.Vector([-1e9] * LANES), ti.Vector([-1e9] * LANES)
        for p in ti.static((a, b, c, d)):
            low, slow = ti.min(low, self.along(paths.now, p, way)), ti.min(slow, self.along(paths.pace, p, way))
        for p in ti.static((e, f, g, h)):
            high, fast = ti.max(high, self.along(paths.now, p, way)), ti.max(fast, self.along(paths.pace, p, way))
        store(self.gap, 0, low - high - horizon * ti.max(fast - slow, 0.0))

    @ti.func
    def corners(self, paths: Template, width, p):
        """Of cells p (lanes); what of them there is no cloth at is the first."""
        has = gather(paths.has, p)
        return (
            p,
            ti.select((has & EAST) != 0, p + 1, p),
            ti.select((has & NORTH) != 0, p + width, p),
            ti.select((has & CELL) != 0, p + width + 1, p),
        )

    @ti.func
    def middle(self, paths: Template, a, b, c, d):
        """Four times that of four corners."""
        x, y, z = (
            gather(paths.now[0], a) + gather(paths.now[0], b) + gather(paths.now[0], c) + gather(paths.now[0], d),
            gather(paths.now[1], a) + gather(paths.now[1], b) + gather(paths.now[1], c) + gather(paths.now[1], d),
            gather(paths.now[2], a) + gather(paths.now[2], b) + gather(paths.now[2], c) + gather(paths.now[2], d),
        )
        return x, y, z

    @ti.func
    def along(self, field: Template, p, way: Template):
        return dot((gather(field[0], p), gather(field[1], p), gather(field[2], p)), way)
