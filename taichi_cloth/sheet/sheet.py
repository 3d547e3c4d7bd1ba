"""The sheet: key points on a padded structured grid, what is constant about it, and its state.

Neighbours are fixed offsets in one flat array of `rows + 2 PAD` by `width`, a whole number of LANES, so that a kernel
works on 8 neighbours at once. What is absent has weight 0: no branch, no list. Any mask of cells is a sheet, so
several panels can lie in one grid with PAD empty rows between them.

State is one float32 array (6 and more, padded rows, width): x, y, z [m], the steps dx, dy, dz since the substep before
[m], and what constraints remember of each key point from frame to frame. The step is stored and not the
velocity or the former position because float32 would lose g·h² beside a position.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.springs import Springs

__all__ = ["LANES", "PAD", "Band", "Sheet", "SheetState"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

LANES = 8
PAD = 2  # empty rows before the first and after the last: the reach of a second neighbour


@dataclass(frozen=True)
class Band:
    """Rows of a sheet from `row` on that are of a cloth of their own: several garments in one grid. Its key points
    are as far apart as those of all others."""

    row: int
    material: Material
    springs: Springs


@dataclass(frozen=True, eq=False)
class Sheet:
    """What is constant about a sheet.

    cells: (rows − 1, cols − 1), share of each patch between four key points that is cloth: 1, or less where an outline
    cuts it, 0 where there is none, up to 2 where cloth lies double, as in a hem. material, springs: of all of them, or
    of those before the first of `bands`. pinned: bool (rows, cols), key points that forces do not move. lightest: least
    mass of a key point, in corners of a whole cell. bands: of other cloths, by rising rows; no cell of cloth lies
    between a row of one and a row of another.
    """

    cells: F64
    material: Material
    springs: Springs
    pinned: Mask
    lightest: float = 1.0
    bands: tuple[Band, ...] = ()

    @classmethod
    def rectangle(
        cls, rows: int, cols: int, *, material: Material, springs: Springs, pinned: ArrayLike | None = None
    ) -> "Sheet":
        """A whole rectangle of rows × cols key points. pinned: bool, any shape that spreads to (rows, cols)."""
        return cls.of_cells(np.ones((rows - 1, cols - 1)), material=material, springs=springs, pinned=pinned)

    @classmethod
    def of_cells(
        cls,
        cells: ArrayLike,
        *,
        material: Material,
        springs: Springs,
        pinned: ArrayLike | None = None,
        lightest: float = 1.0,
    ) -> "Sheet":
        """A sheet of any outline. Raises InputError on one without a cell, or pins that do not fit."""
        share = np.asarray(cells, np.float64)
        if share.ndim != 2 or not share.any():
            raise InputError(
                f"sheet: cells of shape {share.shape}; allowed: 2 rows and 2 columns of key points or more"
            )
        if not (np.isfinite(share).all() and (share >= 0).all()):
            raise InputError("sheet: cells that are negative or not finite; allowed: shares of 0 or more")
        shape = (share.shape[0] + 1, share.shape[1] + 1)
        held = np.asarray(False if pinned is None else pinned, bool)
        try:
            pins = np.broadcast_to(held, shape).copy()
        except ValueError:
            raise InputError(f"pins: shape {held.shape}; allowed: {shape}, one for each key point") from None
        return cls(share, material, springs, pins, lightest)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of key points."""
        return self.cells.shape[0] + 1, self.cells.shape[1] + 1

    @property
    def width(self) -> int:
        """Row width in memory, whole lanes."""
        return -(-self.shape[1] // LANES) * LANES

    @property
    def padded_shape(self) -> tuple[int, int]:
        return self.shape[0] + 2 * PAD, self.width

    @property
    def cloths(self) -> tuple[Band, ...]:
        """All cloths, from the first row on."""
        return (Band(0, self.material, self.springs), *self.bands)

    def constant(self, of: Callable[[Band], float], rows: slice = slice(None)) -> float | F64:
        """A number of each cloth: one where there is one, else of each row of a window of rows, (rows, 1)."""
        if not self.bands:
            return of(self.cloths[0])
        begins = [*(band.row for band in self.bands), self.shape[0]]
        return np.repeat([of(cloth) for cloth in self.cloths], np.diff([0, *begins]))[rows, None]

    def with_cloths(self, change: Callable[[Band], Band]) -> "Sheet":
        """The same of other cloths."""
        first, *others = map(change, self.cloths)
        return replace(self, material=first.material, springs=first.springs, bands=tuple(others))

    def with_springs(self, change: Callable[[Springs], Springs]) -> "Sheet":
        """The same with other springs in each of its cloths."""
        return self.with_cloths(lambda cloth: replace(cloth, springs=change(cloth.springs)))

    def most(self, of: Callable[[Band], float]) -> float:
        """The largest number of any of its cloths."""
        return max(map(of, self.cloths))

    @cached_property
    def mass(self) -> F64:
        """(rows, cols) [kg]: areal density × area, a quarter of each cell that meets there; 0 where there is none.

        None is lighter than `lightest`: where an outline cuts off less, the allowance of a seam or a hem has more cloth
        than that inside, and seams between very light and heavy key points close slowly.
        """
        s = self.springs
        corners = np.sum([_shifted(self.cells, i, j) for i in (0, 1) for j in (0, 1)], axis=0)
        corners = np.where(corners > 0, np.maximum(corners, self.lightest), 0.0)
        return self.constant(lambda cloth: cloth.material.density) * s.spacing_x * s.spacing_y * corners / 4

    @cached_property
    def present(self) -> Mask:
        return self.mass > 0

    @cached_property
    def inverse_mass(self) -> F64:
        """(rows, cols) [1/kg], 0 for pinned and absent key points."""
        free = self.present & ~self.pinned
        return np.where(free, 1.0, 0.0) / np.where(free, self.mass, 1.0)

    @cached_property
    def weights(self) -> tuple[F64, F64, F64]:
        """Share of the interior constant, each (rows, cols): of the spring from (i, j) to (i, j+1), of that to
        (i+1, j), ½ on an edge, and of both diagonals of the cell (i, j). 0 where there is none."""
        here = _shifted(self.cells, 0, 0)
        return (here + _shifted(self.cells, 1, 0)) / 2, (here + _shifted(self.cells, 0, 1)) / 2, here

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """(m, 3) numbers of key points, row by row: two for each cell of cloth, as they are drawn."""
        number = np.arange(self.shape[0] * self.shape[1]).reshape(self.shape)
        there = self.cells > 0
        a, b, c, d = (n[there] for n in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
        return np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 1).reshape(-1, 3)

    def padded(self, values: ArrayLike) -> F32:
        """(rows, cols) as float32 in the padded grid, 0 around."""
        out = np.zeros(self.padded_shape, np.float32)
        out[PAD:-PAD, : self.shape[1]] = values
        return out

    def state(self, positions: ArrayLike, remembered: int = 0) -> "SheetState":
        """A state at rest at positions (rows, cols, 3) [m]. remembered: numbers of a key point that constraints keep.
        Raises InputError on wrong shapes or numbers."""
        x = np.asarray(positions, np.float64)
        if x.shape != (*self.shape, 3):
            raise InputError(f"sheet: positions of shape {x.shape}; allowed: {(*self.shape, 3)}")
        if not np.isfinite(x[self.present]).all():
            raise InputError("sheet: positions that are not finite; allowed: finite numbers [m]")
        values = np.zeros((6 + remembered, *self.padded_shape), np.float32)
        # Around the sheet lie distinct dummy positions: no spring, not even one of weight 0, has length 0.
        values[0] = 1.0e3 * self.springs.spacing_x + np.arange(self.width) * self.springs.spacing_x
        values[1] = np.arange(self.padded_shape[0])[:, None] * self.springs.spacing_y
        inside = values[:, PAD:-PAD, : self.shape[1]]
        inside[:3][:, self.present] = np.moveaxis(x, -1, 0)[:, self.present]
        return SheetState(values)

    def flat(self) -> F64:
        """Rest positions (rows, cols, 3) [m] in the x–y plane, from the origin; columns along x, rows along y."""
        rows, cols = self.shape
        out = np.zeros((rows, cols, 3))
        out[..., 0] = np.arange(cols) * self.springs.spacing_x
        out[..., 1] = np.arange(rows)[:, None] * self.springs.spacing_y
        return out

    def positions(self, state: "SheetState") -> F32:
        """(rows, cols, 3) float32 [m], a copy."""
        return np.moveaxis(state.values[:3, PAD:-PAD, : self.shape[1]], 0, -1).copy()

    def steps(self, state: "SheetState") -> F32:
        """(rows, cols, 3) float32 [m] moved in the last substep, a copy."""
        return np.moveaxis(state.values[3:6, PAD:-PAD, : self.shape[1]], 0, -1).copy()

    def set_steps(self, state: "SheetState", steps: ArrayLike, where: Mask | None = None) -> None:
        """Writes steps (rows, cols, 3) [m] of the key points in `where`, (rows, cols); None: of all present."""
        chosen = self.present if where is None else where
        inside = state.values[3:6, PAD:-PAD, : self.shape[1]]
        inside[:, chosen] = np.moveaxis(np.asarray(steps), -1, 0)[:, chosen]

    def stretch(self, positions: NDArray) -> tuple[NDArray, NDArray]:
        """Strain of the threads: of the weft (rows, cols − 1) and of the warp (rows − 1, cols); 0 where absent."""
        s = self.springs
        weft = np.linalg.norm(np.diff(positions, axis=1), axis=-1) / s.spacing_x - 1
        warp = np.linalg.norm(np.diff(positions, axis=0), axis=-1) / s.spacing_y - 1
        return np.where(self._threads[0], weft, 0.0), np.where(self._threads[1], warp, 0.0)

    @cached_property
    def _threads(self) -> tuple[Mask, Mask]:
        """Where there is a piece of the weft, (rows, cols − 1), and of the warp, (rows − 1, cols)."""
        return self.weights[0][:, :-1] > 0, self.weights[1][:-1] > 0

    def largest_stretch(self, state: "SheetState") -> float:
        """The largest of both `stretch`, ten times as fast, for every frame."""
        return self._longest(state.values[:3]) - 1

    def largest_slip(self, state: "SheetState") -> float:
        """By how much two neighbours along a thread moved against each other in the last substep, at most; as a share
        of their distance at rest."""
        return self._longest(state.values[3:6])

    def _longest(self, values: F32) -> float:
        """The largest difference of vectors (3, padded rows, width) [m] along a thread, as a share of the spacing."""
        inside = values[:, PAD:-PAD, : self.shape[1]]
        spacings, found = (self.springs.spacing_x, self.springs.spacing_y), []
        for axis, spacing, there in zip((2, 1), spacings, self._threads, strict=True):
            apart = np.diff(inside, axis=axis)
            apart *= apart
            found.append(np.sqrt(apart.sum(axis=0).max(where=there, initial=0.0)) / spacing)
        return float(max(found))


@dataclass(frozen=True, eq=False)
class SheetState:
    """values: float32 (6 and more, padded rows, width), see the head of this module. A solver changes it in place."""

    values: F32

    @property
    def in_a_row(self) -> F32:
        """The same numbers, plane after plane; not a copy."""
        out = self.values.view()
        out.shape = (-1,)  # an error where it would have to be one
        return out

    def copy(self) -> "SheetState":
        return SheetState(self.values.copy())


def _shifted(cells: F64, i: int, j: int) -> F64:
    """(rows, cols): the cell whose corner number (i, j) the key point is."""
    return np.pad(cells, ((i, 1 - i), (j, 1 - j)))
