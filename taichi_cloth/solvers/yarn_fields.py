"""What whole yarns work on: their threads, in what order they are gone through, and room for their systems."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x3, I32x2, Int
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.motion.crew import LINE, PARTS
from taichi_cloth.sheet.sheet import LANES
from taichi_cloth.solvers.yarn_order import GROUPS, yarn_order

__all__ = ["NEVER", "Family", "YarnFields"]

THREAD_NUMBERS = (
    "rest",  # L [m]
    "slimmer",  # 1/L
    "soft",  # α before the thread's crimp is drawn out, and of a linear one
    "stiff",  # α from then on
    "crimp",  # [m] of C at which its pull has drawn it out
    "offset",  # [m] by which C seems less from then on: crimp (1 − stiff/soft)
    "bound",  # [m] of C that a strain limit leaves it, NEVER without one
    "long",  # [m] by which it may be longer, whatever it pulls (`WholeYarns.unsolved`)
    "calm",  # 1/[m], of the C, either way, beyond which the next substep is wild
    "mass",  # m₀ [kg]
    "damped",  # τ/h
    "watched",  # substep of a frame from which on it is looked whether they are solved, or NEVER
)
"""Of the threads of a family, in a field: changing them compiles nothing."""

ThreadNumbers: Any = ti.types.struct(**dict.fromkeys(THREAD_NUMBERS, ti.f32))

NEVER = 1e6  # [m] that no thread grows by

TILE = LANES * LANES

MOST_SUBSTEPS = 4096
"""Of a frame."""
ASKED = PARTS * LINE
"""Place in `YarnFields.missed` of the turn up to which the first substep goes on; what is before is of each part."""


@dataclass(frozen=True)
class Family:
    """Threads that run alike. step: rows and columns from one key point of a yarn to the next. weight: in the padded
    grid, of the thread that begins at each key point, 0 where there is none. numbers: `ThreadNumbers` of each cloth."""

    step: tuple[int, int]
    weight: NDArray[np.float32]
    numbers: list[dict[str, float]]


@ti.data_oriented
class YarnFields:
    """Fields of the threads of a padded grid of up to `size` key points, each by the first key point it joins. Those of
    a family lie `size` elements after those of the one before; family 0 is that along the rows.

    families: how many. cloths: as of `Stencil`; numbers of family f and cloth c are at f · cloths + c. row: width of
    the grid. tall: its rows, of whole tiles. offset: [family], elements from one key point of a yarn to the next.
    order: packets of lanes that hold key points, list after list: of each group of yarns along the rows in the order of
    tiles, column of tiles after column; of each group of those along the columns in that of rows; and, where diagonals
    are chains, all of them. Between lists stand packets that hold none. begin, count, lag: [family × GROUPS + group],
    where its list begins, how long it is, and how many packets on from any the last is that it has neighbours in.
    closes: of packets in the order of tiles, the tile that they are the last of, or −1. tile: first element of each 8 ×
    8 tile that holds key points, and turned_tile its place when turned: yarns along the rows lie as columns there,
    between a row of zeros before and one after.
    slack: 1 over the share of the interior constant, and 0 where there is no thread. mean: ½ over how many threads are
    beside it in its yarn. tension: λ [m]. held: 1 where a strain limit holds a thread. pulled: −λ r/L of each thread,
    averaged over some AVERAGED substeps: a blow is over in one. tight: the largest of these in this frame, for each
    group and lane.
    normal: [axis], n, 0 where there is no thread. compliance: α, when it was last factorised. beside: what couples a
    thread with the one before it, and pivot: 1/d of the factorisation, both turned for family 0.
    Of the family at work: turning, [axis], by how much n turns in this step. grown, growing: C, and τ/h dC [m].
    diagonal, coupling, right: of the systems, as they lie. change: first z, then Δλ; turned_change: the same turned.
    strained: the largest |C| of a substep for each group and lane, as a share of what is calm. wild: 1 in a wild
    substep, else 0. differs: the same, above 0 where a factorisation is too old. missed:
    at another time in the same place, what threads are longer by than they pull, for each part and lane; and see ASKED.
    """

    def __init__(self, size: int, families: int, cloths: int = 1) -> None:
        def fields(count: int, of: int) -> list[ti.Field]:
            return [ti.field(ti.f32, of) for _ in range(count)]

        self.size, self.families, self.cloths, every = size, families, cloths, families * size
        self.normal = fields(3, every)
        self.slack, self.mean, self.tension, self.held, self.pulled = fields(5, every)
        self.compliance, self.beside, self.pivot = fields(3, every)
        self.turning = fields(3, size)
        self.grown, self.growing, self.diagonal, self.coupling, self.right, self.turned_change = fields(6, size)
        self.change: Any = ti.field(ti.f32, size)
        self._forgotten = (  # of each family, and of the one at work
            (*self.normal, self.tension, self.held, self.pulled, self.beside, self.pivot),
            (*self.turning, self.coupling, self.right, self.change, self.turned_change),
        )
        self.strained, self.tight = fields(2, GROUPS * LINE)
        self.differs = self.missed = ti.field(ti.f32, ASKED + MOST_SUBSTEPS + 1)
        self.wild = ti.field(ti.f32, ())
        self.order, self.closes = (_whole_numbers(6 * (size // LANES) + 1024) for _ in range(2))
        self.tile, self.turned_tile = (_whole_numbers(size // TILE) for _ in range(2))
        self.offset = _whole_numbers(families)
        self.begin, self.count, self.lag = (_whole_numbers(families * GROUPS) for _ in range(3))
        self.row, self.tall = (_whole_numbers(()) for _ in range(2))
        self.numbers = ThreadNumbers.field(shape=families * cloths)
        self._number = [self.numbers.get_member_field(name) for name in THREAD_NUMBERS]

    def take(self, present: NDArray, families: list[Family]) -> None:
        """present: key points of `Sheet` in the padded grid. families: first that along the rows."""
        rows, width = present.shape
        high = -(-rows // LANES)
        more = ((0, high * LANES - rows), (0, 0))
        packets = np.any(np.pad(present > 0, more).reshape(high, LANES, -1, LANES), axis=3)
        offsets = [one.step[0] * width + one.step[1] for one in families]
        weights = np.stack([np.pad(one.weight, more).ravel() for one in families])
        there = weights > 0
        slack = np.divide(1.0, weights, out=np.zeros_like(weights), where=there)
        beside = np.stack(
            [np.roll(one, far) * 1.0 + np.roll(one, -far) for one, far in zip(there, offsets, strict=True)]
        )
        order = yarn_order(packets, offsets)
        tile, column = order.tile * LANES, order.column * LANES
        places = tile * width + column, (column + 1) * high * LANES + tile
        named = np.array(
            [[[cloth[name] for name in THREAD_NUMBERS] for cloth in one.numbers] for one in families], np.float32
        )
        self._take(
            width,
            np.stack([slack, 0.5 / (beside + 1e-6)]).astype(np.float32),
            np.stack([order.packets, order.closes]).astype(np.int32),
            np.stack(places).astype(np.int32),
            np.array([order.begins, order.counts, order.lags, np.repeat(offsets, GROUPS)], np.int32),
            named,
        )

    @ti.kernel
    def _take(self, width: Int, weights: F32x3, orders: I32x2, places: I32x2, reach: I32x2, named: F32x3):
        """weights: slack and mean, (2, family, elements of whole tiles). orders: `order`, `closes`. places: of tiles,
        and of the same turned. reach: begin, count and lag of each group of each family, and the family's offset.
        named: of each family and cloth. No yarn pulls yet."""
        for p in range(weights.shape[2]):
            for family in ti.static(range(self.families)):
                self.slack[p + family * self.size] = weights[0, family, p]
                self.mean[p + family * self.size] = weights[1, family, p]
            self.diagonal[p] = 1.0
        for p in range(weights.shape[2] // width * (width + 2)):  # of those turned, with what is around
            for field in ti.static(self._forgotten[1]):
                field[p] = 0.0
            for family in ti.static(range(self.families)):
                for field in ti.static(self._forgotten[0]):
                    field[p + family * self.size] = 0.0
        ti.loop_config(serialize=ti.static(on_host()))
        for e in range(orders.shape[1]):
            self.order[e], self.closes[e] = orders[0, e], orders[1, e]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(places.shape[1]):
            self.tile[k], self.turned_tile[k] = places[0, k], places[1, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for family in range(self.families):
            self.offset[family] = reach[3, family * GROUPS]
            for k, number in ti.static(enumerate(self._number)):
                for cloth in range(named.shape[1]):
                    number[family * self.cloths + cloth] = named[family, cloth, k]
        ti.loop_config(serialize=ti.static(on_host()))
        for k in range(reach.shape[1]):
            self.begin[k], self.count[k], self.lag[k] = reach[0, k], reach[1, k], reach[2, k]
        self.row[None], self.tall[None] = width, weights.shape[2] // width


def _whole_numbers(shape: int | tuple[()]) -> Any:
    """Any: type checkers take an element of a field for a matrix, which is no index."""
    return ti.field(ti.i32, shape)
