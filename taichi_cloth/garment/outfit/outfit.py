"""Several garments as one: their panels, seams and holds in one grid of key points, each garment its own rows of it.

So all of them move in one simulation, and what keeps a garment from passing through itself keeps them from passing
through each other. Their key points are equally far apart; masses, stiffness, friction within and hems are each
garment's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.cut import Atlas
from taichi_cloth.garment.pattern.pattern import Hold, Pattern, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.ground.errors import InputError
from taichi_cloth.sheet.sheet import Band, Sheet

__all__ = ["Outfit", "outfit_of", "pattern_of_all"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Outfit(Garment):
    """pattern, atlas: of all, panels named "garment panel". material, hem: of the first. names, parts: the garments, in
    the order worn, the innermost first. Made by `outfit_of`."""

    names: tuple[str, ...] = ()
    parts: tuple[Garment, ...] = ()

    @cached_property
    def first_rows(self) -> tuple[int, ...]:
        """The row of the grid at which each garment begins."""
        return tuple(np.cumsum([0, *(part.atlas.shape[0] + 1 for part in self.parts[:-1])]).tolist())

    @cached_property
    def layers(self) -> F64:
        return _stacked([part.layers for part in self.parts])

    def sheet(self) -> Sheet:
        sheets = [part.sheet() for part in self.parts]
        bands = [Band(row, one.material, one.springs) for row, one in zip(self.first_rows, sheets, strict=True)]
        return replace(sheets[0], cells=self.layers, pinned=np.zeros(self.atlas.shape, bool), bands=tuple(bands[1:]))

    def borne(self, friction: float) -> F64:
        return np.concatenate([part.borne(friction) for part in self.parts])

    def of(self, number: int, values: NDArray) -> NDArray:
        """What of values at key points (rows, cols, …) is that of one garment's."""
        rows, cols = self.parts[number].atlas.shape
        first = self.first_rows[number]
        return values[first : first + rows, :cols]

    def wearer(self, panel: int) -> int:
        """The number of the garment that a panel is of, by its number."""
        return int(np.searchsorted(np.cumsum([len(part.atlas.panels) for part in self.parts]), panel, side="right"))


def outfit_of(names: Sequence[str], parts: Sequence[Garment]) -> Outfit:
    """Garments in the order worn as one. Raises InputError on names that are alike, and on garments whose key points
    are not equally far apart."""
    for name in names:
        if list(names).count(name) > 1:
            raise InputError(f"outfit: two garments called {name!r}; allowed: one of a name")
    spacing = parts[0].atlas.spacing
    if any(part.atlas.spacing != spacing for part in parts):
        raise InputError("outfit: garments whose key points are not equally far apart; allowed: one spacing for all")
    pattern = pattern_of_all(names, [part.pattern for part in parts])
    pieces, row, panels = [], 0, iter(pattern.panels)
    for part in parts:
        pieces += [replace(piece, panel=next(panels), row=piece.row + row) for piece in part.atlas.panels]
        row += part.atlas.shape[0] + 1
    atlas = Atlas(tuple(pieces), spacing, _stacked([part.atlas.cells for part in parts]))
    return Outfit(pattern, atlas, parts[0].material, parts[0].hem, names=tuple(names), parts=tuple(parts))


def pattern_of_all(names: Sequence[str], patterns: Sequence[Pattern]) -> Pattern:
    """Patterns of garments as one, panels named "garment panel"."""
    own = [_named(pattern, name) for pattern, name in zip(patterns, names, strict=True)]
    return Pattern(
        " under ".join(names),
        tuple(panel for one in own for panel in one.panels),
        tuple(seam for one in own for seam in one.seams),
        tuple(hold for one in own for hold in one.holds),
        tuple(note for one in own for note in one.notes),
        hung=tuple(hold for one in own for hold in one.hung),
    )


def _named(pattern: Pattern, name: str) -> Pattern:
    """The pattern with its panels named for the garment, and seams that no longer ask where panels start."""

    def side(of: Side) -> Side:
        return Side(f"{name} {of.panel}", of.edge)

    def held(holds: tuple[Hold, ...]) -> tuple[Hold, ...]:
        return tuple(replace(hold, side=side(hold.side)) for hold in holds)

    return replace(
        pattern,
        panels=tuple(replace(panel, name=f"{name} {panel.name}") for panel in pattern.panels),
        seams=tuple(
            replace(seam, first=side(seam.first), second=side(seam.second), alike=pattern.is_alike(seam))
            for seam in pattern.seams
        ),
        holds=held(pattern.holds),
        hung=held(pattern.hung),
        notes=tuple(f"{name}: {note}" for note in pattern.notes),
    )


def _stacked(cells: Sequence[F64]) -> F64:
    """Cells (rows − 1, cols − 1) of grids one below the other, two rows without cloth between."""
    wide = max(one.shape[1] for one in cells)
    padded = [np.pad(one, ((0, 2), (0, wide - one.shape[1]))) for one in cells]
    return np.concatenate(padded)[:-2]
