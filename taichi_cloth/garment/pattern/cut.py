"""Cutting (paper 4): panels on a lattice of key points, the warp along the grain, and all of them in one atlas.

A panel's outline need not follow the lattice. A cell that it crosses keeps the share of its area that lies inside:
its springs and its mass are that share of a whole cell's, so the sheet's stable step stays what it was. The key points
that lie outside carry the cloth up to the outline and no further; everything on the cloth, seams and yarn ends
included, is *embedded*: a fixed blend of the four key points of its cell. A cell with less than SLIVER inside is left
out, and its share goes to the neighbour that carries what is in it.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from taichi_cloth.garment.pattern.pattern import Panel, Pattern
from taichi_cloth.ground.errors import InputError

__all__ = ["SLIVER", "Atlas", "CutPanel", "cut", "inside", "intervals", "spacing_for", "turned"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

SLIVER = 0.3
SCANLINES = 32  # a cell; along a line the share is exact


@dataclass(frozen=True, eq=False)
class CutPanel:
    """One panel on its lattice. Grain coordinates: the panel's, turned so that the warp runs along +y.

    origin: (2,) of key point (0, 0) in grain coordinates [m]. spacing: along the weft and along the warp [m].
    share: (rows − 1, cols − 1), of each cell that is cloth. row, col: where key point (0, 0) lies in the atlas.
    """

    panel: Panel
    origin: F64
    spacing: tuple[float, float]
    share: F64
    row: int = 0
    col: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of key points."""
        return self.share.shape[0] + 1, self.share.shape[1] + 1

    def outline(self) -> F64:
        """(n, 2) in grain coordinates [m]."""
        return turned(self.panel.outline, self.panel.grain)

    def lattice(self) -> F64:
        """(rows, cols, 2) of the key points in the panel's own coordinates [m]."""
        rows, cols = self.shape
        x = self.origin[0] + self.spacing[0] * np.arange(cols)
        y = self.origin[1] + self.spacing[1] * np.arange(rows)
        points = np.stack(np.meshgrid(x, y), -1)
        return turned(points.reshape(-1, 2), -self.panel.grain).reshape(rows, cols, 2)

    @cached_property
    def _cloth(self) -> tuple[I64, KDTree]:
        """Columns and rows (n, 2) of the cells that are cloth, and their middles to search."""
        cells = np.argwhere(self.share > 0)[:, ::-1]
        return cells, KDTree(cells + 0.5)

    def embed(self, xy: F64) -> tuple[I64, F64]:
        """Points (n, 2) in grain coordinates as blends of key points: (n, 4, 2) rows and columns in the atlas, and
        (n, 4) shares that sum to 1. Beyond the last cell that is cloth the blend goes on straight."""
        at = (np.asarray(xy, np.float64) - self.origin) / np.asarray(self.spacing)
        cell = np.floor(at).astype(np.int64)
        limit = np.array(self.share.shape[::-1]) - 1
        inside = (cell >= 0).all(axis=1) & (cell <= limit).all(axis=1)
        kept = np.clip(cell, 0, limit)
        good = inside & (self.share[kept[:, 1], kept[:, 0]] > 0)
        if not good.all():
            cells, tree = self._cloth
            kept[~good] = cells[tree.query(at[~good])[1]]
        u, v = (at - kept).T
        i, j = kept[:, 1] + self.row, kept[:, 0] + self.col
        nodes = np.stack([np.stack([i + di, j + dj], -1) for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1))], 1)
        return nodes, np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], -1)


@dataclass(frozen=True, eq=False)
class Atlas:
    """All panels of a garment in one grid of key points, none touching another.

    cells: (rows − 1, cols − 1), share of each cell that is cloth, 0 between panels.
    """

    panels: tuple[CutPanel, ...]
    spacing: tuple[float, float]
    cells: F64

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of key points."""
        return self.cells.shape[0] + 1, self.cells.shape[1] + 1

    @property
    def key_points(self) -> int:
        return int(self.present().sum())

    def panel(self, name: str) -> CutPanel:
        return next(p for p in self.panels if p.panel.name == name)

    def start(self) -> F64:
        """(rows, cols, 3) where the key points start round the body [m]; 0 where there are none."""
        out = np.zeros((*self.shape, 3))
        for p in self.panels:
            rows, cols = p.shape
            placed = p.panel.place.points(p.lattice().reshape(-1, 2)).reshape(rows, cols, 3)
            out[p.row : p.row + rows, p.col : p.col + cols] = placed
        return out

    def ghosts(self) -> tuple[I64, I64, F64]:
        """Key points that are not simulated but lie beside some that are, in their panel's rectangle: (g, 2) rows and
        columns, and the blend of key points that each goes on from: (g, 4, 2) and (g, 4). Cloth that a left-out cell
        should have carried is drawn on them."""
        present = self.present()
        places, nodes, shares = [], [], []
        for p in self.panels:
            rows, cols = p.shape
            window = present[p.row : p.row + rows, p.col : p.col + cols]
            grown = np.pad(window, 1)
            near = np.zeros_like(window)
            for i in range(3):
                for j in range(3):
                    near |= grown[i : i + rows, j : j + cols]
            at = np.argwhere(near & ~window)
            blend = p.embed(p.origin + at[:, ::-1] * np.asarray(p.spacing))
            places.append(at + np.array([p.row, p.col]))
            nodes.append(blend[0])
            shares.append(blend[1])
        return np.concatenate(places), np.concatenate(nodes), np.concatenate(shares)

    def present(self) -> NDArray[np.bool_]:
        """(rows, cols): key points that are simulated."""
        c = np.pad(self.cells > 0, 1)
        return c[1:, 1:] | c[1:, :-1] | c[:-1, 1:] | c[:-1, :-1]

    def owner(self) -> NDArray[np.int32]:
        """(rows, cols): number of the panel whose rectangle a key point lies in, −1 for none."""
        out = np.full(self.shape, -1, np.int32)
        for k, p in enumerate(self.panels):
            out[p.row : p.row + p.shape[0], p.col : p.col + p.shape[1]] = k
        return out


def cut(pattern: Pattern, spacing: tuple[float, float]) -> Atlas:
    """Every panel of a pattern on a lattice of key points `spacing` apart, along the weft and along the warp [m].

    Raises InputError on a spacing that leaves a panel without cloth.
    """
    if not all(np.isfinite(s) and s > 0 for s in spacing):
        raise InputError(f"garment.spacing: {spacing!r}; allowed: two lengths above 0 [m]")
    pieces = [_cut_panel(panel, spacing) for panel in pattern.panels]
    places, (rows, cols) = _pack([p.shape for p in pieces])
    cells = np.zeros((rows - 1, cols - 1))
    placed = []
    for p, (row, col) in zip(pieces, places, strict=True):
        cells[row : row + p.share.shape[0], col : col + p.share.shape[1]] = p.share
        placed.append(CutPanel(p.panel, p.origin, p.spacing, p.share, row, col))
    return Atlas(tuple(placed), spacing, cells)


def spacing_for(pattern: Pattern, key_points: int, *, ratio: float = 1.0) -> tuple[float, float]:
    """Spacing [m] at which a pattern has that many key points, to 0.5 %. ratio: warp spacing over weft spacing."""
    area = sum(panel.area for panel in pattern.panels)
    a = float(np.sqrt(area / key_points / ratio))
    best, miss = a, float("inf")
    low, high = 0.5 * a, 1.5 * a
    for _ in range(14):  # the count jumps where a row or a column comes or goes
        count = cut(pattern, (a, a * ratio)).key_points
        if abs(count - key_points) < miss:
            best, miss = a, abs(count - key_points)
        if miss <= 0.002 * key_points:
            break
        low, high = (a, high) if count > key_points else (low, a)
        a = (low + high) / 2
    return best, best * ratio


def turned(xy: F64, angle: float) -> F64:
    """Points (n, 2), turned anticlockwise so that what ran `angle` from +y towards +x runs along +y."""
    c, s = cos(angle), sin(angle)
    return xy @ np.array([[c, s], [-s, c]])


def intervals(outline: F64, value: float, axis: int) -> F64:
    """Where the line with coordinate `axis` = value is inside a closed polygon (n, 2): (m, 2), from and to."""
    a, b = outline, np.roll(outline, -1, axis=0)
    crossed = (a[:, axis] <= value) != (b[:, axis] <= value)
    a, b = a[crossed], b[crossed]
    share = (value - a[:, axis]) / (b[:, axis] - a[:, axis])
    return np.sort(a[:, 1 - axis] + share * (b[:, 1 - axis] - a[:, 1 - axis])).reshape(-1, 2)


def inside(outline: F64, points: F64) -> NDArray[np.bool_]:
    """Which points (m, 2) lie in a closed polygon (n, 2): those with an odd number of its edges to their right."""
    a, b = outline, np.roll(outline, -1, axis=0)
    y = points[:, 1, None]
    crossed = (a[:, 1] <= y) != (b[:, 1] <= y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return (crossed & (at > points[:, 0, None])).sum(axis=1) % 2 == 1


def _cut_panel(panel: Panel, spacing: tuple[float, float]) -> CutPanel:
    outline = turned(panel.outline, panel.grain)
    low, high = outline.min(axis=0), outline.max(axis=0)
    count = [max(1, ceil((h - lo) / s - 1e-9)) for lo, h, s in zip(low, high, spacing, strict=True)]
    origin = (low + high) / 2 - np.array(count) * np.asarray(spacing) / 2
    share = _shares(outline, origin, spacing, (count[1], count[0]))
    if not (share >= SLIVER).any():
        raise InputError(
            f"panel {panel.name}: {1e4 * panel.area:.3g} cm² hold no cell of {spacing[0]:g} m by {spacing[1]:g} m; "
            "use closer key points, or a larger panel"
        )
    kept = np.where(share >= SLIVER, share, 0.0)
    cells, lost = np.argwhere(kept > 0), np.argwhere((share > 0) & (share < SLIVER))
    if len(lost):
        _, nearest = KDTree(cells).query(lost)
        np.add.at(kept, tuple(cells[nearest].T), share[tuple(lost.T)])
    return CutPanel(panel, origin, spacing, kept)


def _shares(outline: F64, origin: F64, spacing: tuple[float, float], shape: tuple[int, int]) -> F64:
    """(rows, cols) share of each cell inside the outline: exact along SCANLINES lines through a row of cells."""
    rows, cols = shape
    out = np.zeros(shape)
    edges = np.arange(cols + 1)
    y = origin[1] + spacing[1] * (np.arange(rows * SCANLINES) + 0.5) / SCANLINES
    # Where the outline crosses each line: from and to, from left to right, lines upwards.
    a, b = outline, np.roll(outline, -1, axis=0)
    line, edge = np.nonzero((a[:, 1] <= y[:, None]) != (b[:, 1] <= y[:, None]))
    a, b = a[edge], b[edge]
    x = a[:, 0] + (y[line] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    order = np.lexsort((x, line))
    spans = ((x[order] - origin[0]) / spacing[0]).reshape(-1, 2)
    row = line[order][::2] // SCANLINES
    # A span of each row of cells at a time, so that every cell's are summed in the order of the lines.
    begin = np.searchsorted(row, np.arange(rows + 1))
    for k in range(int(np.diff(begin).max(initial=0))):
        there = np.flatnonzero(begin[:-1] + k < begin[1:])
        left, right = spans[begin[there] + k].T
        out[there] += np.diff(np.clip(edges, left[:, None], right[:, None]), axis=1)
    return out / SCANLINES


def _pack(shapes: list[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Rectangles (rows, cols) on shelves, an empty row or column between them: their corners, and the size of all.

    The width that wastes least wins.
    """
    order = sorted(range(len(shapes)), key=lambda k: -shapes[k][0])
    widest, total = max(s[1] for s in shapes), sum(s[1] + 1 for s in shapes)
    best: tuple[int, list[tuple[int, int]], tuple[int, int]] | None = None
    for width in range(-(-widest // 8) * 8, -(-total // 8) * 8 + 1, 8):
        places, row, col, tall, used = [(0, 0)] * len(shapes), 0, 0, 0, 0
        for k in order:
            if col + shapes[k][1] > width:
                row, col, tall = row + tall + 1, 0, 0
            places[k] = (row, col)
            used = max(used, col + shapes[k][1])
            col, tall = col + shapes[k][1] + 1, max(tall, shapes[k][0])
        size = (row + tall, used)
        if best is None or size[0] * width < best[0]:
            best = (size[0] * width, places, size)
    assert best is not None
    return best[1], best[2]
