"""Which of the pairs of cells that boxes have left are parted by the direction from one's middle to the other's.

Boxes along the axes of space are wide round cloth that lies aslant: most cells two apart in a bent sheet are near each
other by their boxes alone.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Float, Int, Template
from taichi_cloth.ground.routine import routine
from taichi_cloth.layers.distances import gather
from taichi_cloth.layers.nearest import CORNERS
from taichi_cloth.layers.paths import CELL, EAST, NORTH
from taichi_cloth.layers.search import element
from taichi_cloth.motion.stencil import load, store
from taichi_cloth.sheet.sheet import LANES

__all__ = ["Sieve"]


@ti.data_oriented
class Sieve:
    """one, other: elements of the cells at hand. corner: of their corners, of one and then of the other, by lanes. gap:
    [lane] [m]."""

    def __init__(self) -> None:
        self.one, self.other = (ti.field(ti.i32, LANES) for _ in range(2))
        self.corner = ti.field(ti.i32, 2 * CORNERS * LANES)
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

    @routine
    def measure(self, paths: Template, width: Int, horizon: Float):
        """How far the cells at hand are apart at least, until the horizon."""
        self.corners(paths, width, load(self.one, 0), 0)
        self.corners(paths, width, load(self.other, 0), CORNERS)
        none = ti.Vector([0.0] * LANES)
        x, y, z = none, none, none
        for k in range(2 * CORNERS):
            p, sign = load(self.corner, k * LANES), ti.select(k < CORNERS, 1.0, -1.0)
            x += sign * gather(paths.now[0], p)
            y += sign * gather(paths.now[1], p)
            z += sign * gather(paths.now[2], p)
        scale = 1.0 / ti.sqrt(x * x + y * y + z * z + 1e-20)
        x, y, z = scale * x, scale * y, scale * z
        low, slow = ti.Vector([1e9] * LANES), ti.Vector([1e9] * LANES)
        high, fast = ti.Vector([-1e9] * LANES), ti.Vector([-1e9] * LANES)
        for k in range(2 * CORNERS):
            p, first = load(self.corner, k * LANES), k < CORNERS
            here = x * gather(paths.now[0], p) + y * gather(paths.now[1], p) + z * gather(paths.now[2], p)
            pace = x * gather(paths.pace[0], p) + y * gather(paths.pace[1], p) + z * gather(paths.pace[2], p)
            low, slow = ti.select(first, ti.min(low, here), low), ti.select(first, ti.min(slow, pace), slow)
            high, fast = ti.select(first, high, ti.max(high, here)), ti.select(first, fast, ti.max(fast, pace))
        store(self.gap, 0, low - high - horizon * ti.max(fast - slow, 0.0))

    @ti.func
    def corners(self, paths: Template, width, p, begin: Template):
        """Of cells p (lanes); what of them there is no cloth at is the first."""
        has = gather(paths.has, p)
        store(self.corner, begin * LANES, p)
        store(self.corner, (begin + 1) * LANES, ti.select((has & EAST) != 0, p + 1, p))
        store(self.corner, (begin + 2) * LANES, ti.select((has & NORTH) != 0, p + width, p))
        store(self.corner, (begin + 3) * LANES, ti.select((has & CELL) != 0, p + width + 1, p))
