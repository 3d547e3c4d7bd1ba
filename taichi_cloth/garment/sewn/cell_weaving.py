"""Weaving a garment's panels at a sett of their own: threads between key points that end where the outline ends, of
which nothing is stored but where each is cut.

As `weaving`, for cloth of more threads than can be laid out: each panel has its own threads on the cells of the atlas
(`fabric.cells`), its outline cuts every one of them, and under its hems lies a second layer.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taichi_cloth.fabric.cells import FINE, CellCloth, CellPanel, CellThreads
from taichi_cloth.fabric.crossings import refine_points, refined_mask
from taichi_cloth.fabric.repeat import WeaveRepeat
from taichi_cloth.garment.pattern.cut import Atlas, CutPanel, intervals, turned
from taichi_cloth.garment.pattern.hems import from_hems
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.garment.sewn.weaving import Colours

__all__ = ["CellWeaving"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

COARSE = 4
"""Places to a cell each way on which stitches lie."""
FAR = 1.0
"""From a hem that there is none of [m]."""


class CellWeaving:
    """A garment's threads, worked out where they are drawn.

    per_cell: warp ends and weft picks between key points. repeats: of its drafts. own: of panels by name, which of the
    repeats is theirs; the others have the first. colours: repeats of thread colours of every panel. hem: width that the
    panels' hems are turned inwards [m]. prints: pictures on panels by name.

    cloth: the panels as cells. present: (rows, cols) of a grid COARSE times as fine as the key points, where there is
    cloth; threads_per_key_point, height: as of `Weaving`, for stitches, which lie on that grid.
    """

    def __init__(
        self,
        atlas: Atlas,
        per_cell: tuple[int, int],
        repeats: tuple[WeaveRepeat, ...],
        own: Mapping[str, int],
        colours: Mapping[str, Colours],
        *,
        hem: float = 0.0,
        prints: Mapping[str, Print] | None = None,
        seed: int = 0,
    ) -> None:
        self.atlas, self.threads_per_key_point = atlas, COARSE
        places, nodes, shares = atlas.ghosts()
        cols = atlas.shape[1]
        self._ghost_places = places[:, 0] * cols + places[:, 1]
        starts = np.arange(0, shares.size + 1, shares.shape[1])
        self._ghost_blends = csr_array(
            (shares.ravel(), (nodes[..., 0] * cols + nodes[..., 1]).ravel(), starts),
            shape=(len(places), atlas.shape[0] * cols),
        )
        self._mask = atlas.present()
        self._mask[tuple(places.T)] = True
        self.present = refined_mask(self._mask, COARSE)
        panels, shades, cuts = [], [], []
        for piece in atlas.panels:
            name, number = piece.panel.name, own.get(piece.panel.name, 0)
            ends, picks = _threads(piece, per_cell)
            dyed = None
            if prints and name in prints:
                dyed = _printed(prints[name], piece, per_cell)
            # A draft of the whole garment runs on from panel to panel as they lie in the atlas.
            begins = (0, 0) if number else (piece.row * per_cell[1], piece.col * per_cell[0])
            panels.append(CellPanel(piece.row, piece.col, *piece.shape, number, begins, dyed))
            for axis, (repeat, count) in enumerate(((colours[name].warp, ends), (colours[name].weft, picks))):
                first = round(float(piece.origin[axis]) / (piece.spacing[axis] / per_cell[axis]))
                shades.append(repeat[(first + np.arange(count)) % len(repeat)])
                cuts += _cuts(piece, per_cell, axis, count)
        first = np.concatenate([[0], np.cumsum([len(one) for one in cuts])]).astype(np.int32)
        threads = CellThreads(np.concatenate(shades).astype(np.float32), np.concatenate(cuts).astype(np.float32), first)
        self.cloth = CellCloth(
            atlas.shape,
            per_cell,
            repeats,
            tuple(panels),
            threads,
            present=self._mask,
            hem=_hems(atlas, hem) if hem > 0 else None,
            seed=seed,
        )
        self.height = self.cloth.bank.height

    def whole(self, positions: NDArray) -> F64:
        """Key points (rows, cols, 3) [m] with those that lie beside the ones that are simulated."""
        points = np.array(positions, np.float64)
        flat = points.reshape(-1, 3)
        flat[self._ghost_places] = self._ghost_blends @ flat
        return points

    def crossings(self, positions: NDArray) -> F32:
        """The places that stitches lie on, COARSE times as fine as key points `whole` [m]."""
        return refine_points(positions, self._mask, COARSE)


def _threads(piece: CutPanel, per_cell: tuple[int, int]) -> tuple[int, int]:
    """Warp ends and weft picks of a panel's rectangle."""
    rows, cols = piece.shape
    return (cols - 1) * per_cell[0] + 1, (rows - 1) * per_cell[1] + 1


def _cuts(piece: CutPanel, per_cell: tuple[int, int], axis: int, count: int) -> list[F64]:
    """Of each warp end (axis 0) or weft pick (axis 1) of a panel where it is inside the outline, (n, 2) crossings."""
    outline, other = piece.outline(), 1 - axis
    across, pitch = piece.spacing[axis] / per_cell[axis], piece.spacing[other] / per_cell[other]
    return [
        (intervals(outline, float(piece.origin[axis]) + number * across, axis) - piece.origin[other]) / pitch
        for number in range(count)
    ]


def _printed(picture: Print, piece: CutPanel, per_cell: tuple[int, int]) -> F32:
    """The picture at each crossing of a panel, (picks, ends, 3)."""
    ends, picks = _threads(piece, per_cell)
    x = piece.origin[0] + piece.spacing[0] / per_cell[0] * np.arange(ends)
    out = np.empty((picks, ends, 3), np.float32)
    for pick in range(picks):
        y = piece.origin[1] + piece.spacing[1] / per_cell[1] * pick
        out[pick] = picture.at(turned(np.column_stack([x, np.full(ends, y)]), -piece.panel.grain))
    return out


def _hems(atlas: Atlas, width: float) -> F32:
    """How far each place of the cells is from the hems of its panel, less their width [m]."""
    rows, cols = atlas.shape
    out = np.full(((rows - 1) * FINE + 1, (cols - 1) * FINE + 1), FAR, np.float32)
    for piece in atlas.panels:
        if not piece.panel.hems:
            continue
        high, wide = ((n - 1) * FINE + 1 for n in piece.shape)
        x = piece.origin[0] + piece.spacing[0] / FINE * np.arange(wide)
        y = piece.origin[1] + piece.spacing[1] / FINE * np.arange(high)
        points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        away = from_hems(piece, points).reshape(high, wide)
        out[piece.row * FINE :, piece.col * FINE :][:high, :wide] = away - width
    return out
