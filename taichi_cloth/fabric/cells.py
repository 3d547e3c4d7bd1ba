"""Threads that are not stored: a cloth woven on cells of key points, a whole number of threads to a cell each way.

A *cell* lies between four neighbouring key points. Warp end j and weft pick i of a panel cross at

    u = (j + ahead_j) / k_warp,  v = (i + ahead_i) / k_weft      [key points of the panel]

on the smooth surface through the key points (`surface`), whose slopes are the directions of weft and warp there. The
repeat of the weave tells which template lies between this crossing and the next (`repeat`). So of a cloth of ten
million crossings there is kept: its key points, one repeat, and of each thread its colour, where its yarn's period
begins and where an outline cuts it. What a camera wants of a cell is worked out when it is asked for (`cell_blocks`).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fabric.repeat import RepeatBank, WeaveRepeat, bank_of
from taichi_cloth.fabric.surface import nodes_of
from taichi_cloth.ground.arrays import F32x1, F32x2, I32x1, I32x2, I64x1
from taichi_cloth.ground.copies import sent
from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.unevenness import uneven_row

__all__ = [
    "AHEAD_ENDS", "AHEAD_PICKS", "COL", "COLS", "DEEP", "END", "ENDS", "FINE", "PER_CELL_ENDS", "PER_CELL_PICKS",
    "PICK", "PICKS", "REPEAT_ENDS", "REPEAT_PICKS", "ROW", "SHADE", "SHIFT_END", "SHIFT_PICK", "TABLE", "TEMPLATES",
    "VARIANTS", "CellCloth", "CellPack", "CellPanel", "CellThreads", "sheet_of_cells",
]  # fmt: skip

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

ROW, COL, END, PICK, ENDS, PICKS, TABLE = range(7)
REPEAT_ENDS, REPEAT_PICKS, AHEAD_ENDS, AHEAD_PICKS, SHIFT_END, SHIFT_PICK, SHADE = range(7, 14)
"""Numbers of a panel's record: the key point where it begins; its first warp end and weft pick among the threads, and
how many it has; where its repeat stands in the table of kinds, its size, where its threads' places stand, and which end
and pick of it the panel begins with; where its crossings' shades stand, −1 for none."""
FINE = 4
"""Places to a cell each way at which the distance from a hem is known."""


@dataclass(frozen=True, eq=False)
class CellPanel:
    """A rectangle of cells with threads of its own.

    row, col: of its first key point. rows, cols: of key points. repeat: number of its weave's repeat. begins: the pick
    and the end of the repeat that it begins with. shade: (picks, ends, 3) float32 linear, what its crossings are dyed
    in place of their threads, NaN for those that are not; None: nothing is.
    """

    row: int
    col: int
    rows: int
    cols: int
    repeat: int = 0
    begins: tuple[int, int] = (0, 0)
    shade: F32 | None = None


@dataclass(frozen=True, eq=False)
class CellThreads:
    """The threads of all panels, one panel after the other, warp ends before weft picks.

    colour: (threads, 3) float32 linear. spans: (n, 2) float32 from and to along a thread [crossings] where it is not
    cut away. first: (threads + 1,) where each thread's spans begin.
    """

    colour: F32
    spans: F32
    first: I32

    @staticmethod
    def whole(colour: F32) -> "CellThreads":
        """Threads that nothing cuts."""
        n = len(colour)
        spans = np.tile(np.array([0.0, 1e9], np.float32), (n, 1))
        return CellThreads(colour, spans, np.arange(n + 1, dtype=np.int32))


_TYPES = {
    "node": F32x2,
    "panel": I32x2,
    "ahead": F32x1,
    "table": I32x2,
    "first": I32x1,
    "phases": I32x1,
    "begin": I32x1,
    "uneven": F32x1,
    "colour": F32x2,
    "span_first": I32x1,
    "span": F32x2,
    "start": I64x1,
    "particle": F32x2,
    "shade": I32x1,
    "hem": F32x2,
    "grid": I32x1,
}
_PACK: Any = ti.types.argpack(**_TYPES)

if TYPE_CHECKING:
    CellPack = Any
else:
    CellPack = _PACK

COLS, PER_CELL_ENDS, PER_CELL_PICKS, VARIANTS, TEMPLATES = range(5)
"""Numbers of `grid`."""
DEEP = 1023.0
"""Steps of a shade's channels, which are kept as their square roots, three in a whole number."""


class CellCloth:
    """A cloth woven on cells of key points.

    shape: (rows, cols) of key points. per_cell: warp ends and weft picks to a cell. present: bool (rows, cols), key
    points that exist; None: all. hem: how far inside a turned hem's edge the cloth is, less the hem's width, at FINE
    places a cell each way, ((rows − 1) · FINE + 1, (cols − 1) · FINE + 1) [m]: where it is below 0 a second layer of
    the same threads lies under the first, its wrong side up. bank: of the repeats, where there is one. even: threads
    are as wide all along. Raises
    InputError where a panel lies outside or threads are missing.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        per_cell: tuple[int, int],
        repeats: tuple[WeaveRepeat, ...],
        panels: tuple[CellPanel, ...],
        threads: CellThreads,
        *,
        present: NDArray[np.bool_] | None = None,
        hem: F32 | None = None,
        seed: int = 0,
        bank: RepeatBank | None = None,
        even: bool = False,
    ) -> None:
        self.shape, self.per_cell, self.repeats, self.panels = shape, per_cell, repeats, panels
        self.threads, self.seed = threads, seed
        self.present = np.ones(shape, bool) if present is None else present
        rows, cols = shape
        if min(per_cell) < 1 or any(p.row + p.rows > rows or p.col + p.cols > cols for p in panels):
            raise InputError(f"cells: {per_cell} threads on {shape} key points; allowed: 1 or more, panels inside")
        sizes = [(p.cols - 1) * per_cell[0] + 1 for p in panels], [(p.rows - 1) * per_cell[1] + 1 for p in panels]
        self.counts = np.stack(sizes, axis=1)
        """Warp ends and weft picks of each panel, (panels, 2)."""
        firsts = np.cumsum(self.counts.ravel()) - self.counts.ravel()
        if len(threads.colour) != int(self.counts.sum()):
            raise InputError(f"cells: {len(threads.colour)} threads; allowed: {int(self.counts.sum())}")
        whole = self.present[:-1, :-1] & self.present[1:, :-1] & self.present[:-1, 1:] & self.present[1:, 1:]
        of_cell = np.full((rows, cols), -1, np.int32)
        places, table, ahead, kinds = [], [], [], 0
        length, lengths = 0, []
        for repeat in repeats:
            places.append((sum(t.shape[1] for t in table), length, length + repeat.shape[1]))
            table.append((repeat.kind + kinds).reshape(2, -1))
            ahead += [*repeat.ahead]
            length += sum(repeat.shape)
            lengths.append(repeat.shape)
            kinds += len(repeat.layout.kinds.section)
        record = []
        for number, (p, (ends, picks)) in enumerate(zip(panels, self.counts.tolist(), strict=True)):
            inside = slice(p.row, p.row + p.rows - 1), slice(p.col, p.col + p.cols - 1)
            of_cell[:-1, :-1][inside] = np.where(whole[inside], number, of_cell[:-1, :-1][inside])
            at, ahead_ends, ahead_picks = places[p.repeat]
            high, wide = lengths[p.repeat]
            first_end, first_pick = firsts[2 * number : 2 * number + 2].tolist()
            row = [p.row, p.col, first_end, first_pick, ends, picks, at, wide, high, ahead_ends, ahead_picks]
            record.append([*row, p.begins[1] % wide, p.begins[0] % high])
        shades, dyed = _packed(panels)
        for row, at in zip(record, dyed, strict=True):
            row.append(at)
        rng = np.random.Generator(np.random.Philox(key=[seed, 31]))
        self.of_cell: I32 = of_cell.ravel()
        """Number of the panel of the cell that begins at each key point, −1 for none, (rows · cols,)."""
        self.layers: I32 = np.ones(rows * cols, np.int32)
        """Layers of threads in each cell, (rows · cols,)."""
        if hem is not None:
            self.layers.reshape(rows, cols)[:-1, :-1] += _lowest(hem) < 0
        self.bank: RepeatBank = bank or bank_of(repeats)
        self.cells: I32 = np.flatnonzero(of_cell.ravel() >= 0).astype(np.int32)
        """Numbers of the cells there are, each that of its first key point."""
        shade = 1.0 + 0.03 * np.clip(rng.standard_normal((len(threads.colour), 1)), -2.0, 2.0)
        self._arrays = {
            "panel": np.array(record, np.int32),
            "ahead": np.concatenate(ahead).astype(np.float32),
            "table": np.concatenate(table, axis=1).astype(np.int32),
            "first": self.bank.first,
            "phases": self.bank.phases,
            "begin": rng.integers(0, 1 << 30, len(threads.colour)).astype(np.int32),
            "uneven": _uneven(repeats[0], even),
            "colour": np.clip(threads.colour * shade, 0.0, 1.0).astype(np.float32),
            "span_first": threads.first,
            "span": np.ascontiguousarray(threads.spans, np.float32),
            "start": self.bank.start,
            "particle": self.bank.particle,
            "shade": shades,
            "hem": np.zeros((1, 1), np.float32) if hem is None else np.ascontiguousarray(hem, np.float32),
            "grid": np.array([cols, *per_cell, self.bank.variants, self.bank.templates], np.int32),
        }
        self._arrays = {name: sent(array) for name, array in self._arrays.items()}
        self.node: F32 = np.zeros((rows * cols, 12), np.float32)
        self._node: F32 | None = None

    @property
    def crossings(self) -> int:
        """Of all cells, of one layer."""
        return len(self.cells) * self.per_cell[0] * self.per_cell[1]

    @property
    def blocks(self) -> int:
        """Fibre blocks of all cells, of all layers."""
        return 2 * int(self.layers[self.cells].sum()) * self.per_cell[0] * self.per_cell[1]

    @property
    def particles(self) -> int:
        """Of all cells at the finest level, on average."""
        return round(self.blocks * float(self.bank.size[0]))

    @property
    def bytes(self) -> int:
        """Memory of all that is kept."""
        return self.node.nbytes + sum(array.nbytes for array in self._arrays.values())

    def of_thread(self) -> I32:
        """Number of the panel that each thread is of, (threads,)."""
        return np.repeat(np.arange(len(self.panels)), self.counts.sum(axis=1)).astype(np.int32)

    def family_of_thread(self) -> I32:
        """0 for a warp end, 1 for a weft pick, (threads,)."""
        return np.repeat(np.tile([0, 1], len(self.panels)), self.counts.ravel()).astype(np.int32)

    def move(self, points: NDArray) -> None:
        """Lay the cloth on key points (rows, cols, 3) [m]. Raises InputError on another grid."""
        if points.shape != (*self.shape, 3):
            raise InputError(f"points: shape {points.shape}; allowed: {(*self.shape, 3)}")
        self.node, self._node = nodes_of(points, self.present), None

    def pack(self) -> Any:
        """The argument of a kernel, where no variable may have a member's name; made for each call."""
        if self._node is None:
            self._node = sent(self.node)
        return _PACK(node=self._node, **self._arrays)


def _uneven(repeat: WeaveRepeat, even: bool) -> F32:
    """How threads of both families vary along, as kernels read it."""
    layout = repeat.layout
    rows = []
    for threads, period in ((layout.warp, layout.warp_period), (layout.weft, layout.weft_period)):
        unevenness = 0.0 if even else threads.yarn.unevenness
        rows.append(uneven_row(unevenness, period.block_length, float(threads.width.mean()) / threads.pitch))
    return np.concatenate(rows)


def _packed(panels: tuple[CellPanel, ...]) -> tuple[I32, list[int]]:
    """Shades of all panels' crossings, −1 for none, and where each panel's begin, −1 for none."""
    out, at, length = [np.zeros(1, np.int32)], [], 1
    for panel in panels:
        if panel.shade is None:
            at.append(-1)
            continue
        steps = np.rint(DEEP * np.sqrt(np.clip(np.nan_to_num(panel.shade), 0.0, 1.0))).astype(np.int32)
        packed = steps[..., 0] << 20 | steps[..., 1] << 10 | steps[..., 2]
        out.append(np.where(np.isnan(panel.shade[..., 0]), -1, packed).ravel().astype(np.int32))
        at.append(length)
        length += out[-1].size
    return np.concatenate(out), at


def _lowest(hem: F32) -> NDArray[np.float32]:
    """The lowest value of each cell."""
    low = np.full((hem.shape[0] // FINE, hem.shape[1] // FINE), np.inf, np.float32)
    for i in range(FINE + 1):
        for j in range(FINE + 1):
            np.minimum(low, hem[i : i + FINE * low.shape[0] : FINE, j : j + FINE * low.shape[1] : FINE], out=low)
    return low


def sheet_of_cells(
    shape: tuple[int, int],
    per_cell: tuple[int, int],
    repeat: WeaveRepeat,
    colours: tuple[NDArray, NDArray],
    *,
    seed: int = 0,
) -> CellCloth:
    """A rectangular sheet of one weave. colours: of its warp ends and weft picks, linear, (n, 3) each."""
    threads = CellThreads.whole(np.concatenate(colours).astype(np.float32))
    return CellCloth(shape, per_cell, (repeat,), (CellPanel(0, 0, *shape),), threads, seed=seed)
