"""Layers of cloth that the tests of contact share; how near they lie, and where they cross: by brute force, in
float64, apart from what is tested."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate

SPACING, COLS, THICKNESS = 0.01, 7, 0.003
ROWS = 37  # two panels of 17 and 18 rows with an empty row of cells between them, or one of 37
SOFT = Material(
    tensile_warp=150.0,
    tensile_weft=150.0,
    shear=15.0,
    bending_warp=2e-6,
    bending_weft=2e-6,
    density=0.15,
    air_damping=2.0,
    fibre_damping=1e-4,
)


def sheet_of(panels: int) -> Sheet:
    cells = np.ones((ROWS - 1, COLS - 1), bool)
    if panels == 2:
        cells[16:18] = False
    springs = calibrate(SOFT, spacing_x=SPACING, spacing_y=SPACING)
    return Sheet.of_cells(cells, material=SOFT, springs=springs)


def layers(speed: float) -> tuple[Sheet, NDArray, NDArray]:
    """Two panels 6 mm apart, the upper 3 mm off to a side, coming down at `speed` [m/s]; positions and velocities."""
    sheet = sheet_of(2)
    flat = sheet.flat()
    x = flat[..., [0, 2, 1]]
    upper = np.arange(ROWS) >= 18
    x[upper] += [0.003, 0.006, 0.004 - 18 * SPACING]
    v = np.zeros_like(x)
    v[upper, :, 1] = -speed
    return sheet, x, v


def triangles(sheet: Sheet) -> NDArray:
    """(triangles, 3) numbers of key points, two a cell, along the diagonal from (i, j) to (i + 1, j + 1)."""
    i, j = np.nonzero(sheet.cells)
    cols = sheet.shape[1]
    a = i * cols + j
    return np.concatenate(
        [np.stack([a, a + 1, a + cols + 1], 1), np.stack([a, a + cols + 1, a + cols], 1)], dtype=np.int64
    )


def threads(sheet: Sheet) -> NDArray:
    """(threads, 2) numbers of the key points that structural springs join."""
    number = np.arange(sheet.mass.size).reshape(sheet.shape)
    east, north, _ = sheet.weights
    along = np.stack([number[:, :-1], number[:, 1:]], -1)[east[:, :-1] > 0]
    across = np.stack([number[:-1], number[1:]], -1)[north[:-1] > 0]
    return np.concatenate([along, across])


def crossings(sheet: Sheet, x: NDArray, *, apart: int = 0) -> int:
    """Threads that pass through a triangle all of whose corners lie more than `apart` rows away and which is not one
    of its own corners' triangles."""
    y, tri, edge = x.reshape(-1, 3).astype(float), triangles(sheet), threads(sheet)
    a, b, c = (y[tri[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    count = 0
    for p, q in edge:
        s, t = np.einsum("ij,ij->i", n, y[p] - a), np.einsum("ij,ij->i", n, y[q] - a)
        rows = np.abs(tri // sheet.shape[1] - p // sheet.shape[1]).min(1)
        near = (s * t < 0) & ~(tri == p).any(1) & ~(tri == q).any(1) & (rows >= apart)
        m = np.flatnonzero(near)
        share = s[m] / (s[m] - t[m])
        corners = y[tri[m]]  # (near, 3, 3)
        from_corners = (y[p] + (y[q] - y[p]) * share[:, None])[:, None] - corners
        inward = np.cross(np.roll(corners, -1, axis=1) - corners, from_corners)
        count += int(((inward * n[m][:, None]).sum(-1) >= 0).all(axis=1).sum())
    return count


def nearest(sheet: Sheet, x: NDArray, *, apart: float) -> float:
    """Least distance [m] of a key point to a face whose corners all lie farther than `apart` [m] at rest, in the same
    panel; any face of another panel counts (panels: rows of cells with an empty one between)."""
    y, rest = x.astype(float), sheet.flat()
    i, j = np.nonzero(sheet.cells)
    panel = np.cumsum(~sheet.cells.any(1))[i]
    a, b, c, d = y[i, j], y[i, j + 1], y[i + 1, j], y[i + 1, j + 1]
    grid = np.linspace(0, 1, 9)
    u, v = (g.ravel()[:, None, None] for g in np.meshgrid(grid, grid))
    patch = (1 - u) * (1 - v) * a + u * (1 - v) * b + (1 - u) * v * c + u * v * d  # (81, faces, 3)
    middle = (rest[i, j] + rest[i + 1, j + 1]) / 2
    radius = np.linalg.norm(rest[i[0], j[0]] - middle[0])
    row_panel = np.full(sheet.shape[0], -1)
    row_panel[i], row_panel[i + 1] = panel, panel
    best = np.inf
    for p, q in np.argwhere(sheet.present):
        other = (row_panel[p] != panel) | (np.linalg.norm(rest[p, q] - middle, axis=1) - radius > apart)
        centre = np.linalg.norm(patch[40] - y[p, q], axis=1)
        chosen = other & (centre < best + 2 * radius)
        if chosen.any():
            best = min(best, float(np.linalg.norm(patch[:, chosen] - y[p, q], axis=-1).min()))
    return best
