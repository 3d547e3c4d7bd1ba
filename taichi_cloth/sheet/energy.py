"""Energy and forces of a sheet in float64 on the host: the reference that kernels and tests are held against.

W = Σ k/2 (|d| − L)² over structural, diagonal and second-neighbour springs + Σ β/2 |x₋ − 2x + x₊|² over hinges
  + Σ τ/2 |x₀₀ − x₁₀ − x₀₁ + x₁₁|² + Σ k/2 (|x₁₁ − x₀₀| − |x₀₁ − x₁₀| + T·C/12l)² over cells

(T is the sum under τ, C that of all eight second differences at a cell's corners; T·C counts by the lightest of the
threads that it reaches, of those inside 1, and not at all where one is missing.)

Friction within the sheet follows from what went before and is not in it, nor is locking.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.sheet.sheet import Sheet

__all__ = [
    "Links",
    "accelerations",
    "elastic_energy",
    "elastic_forces",
    "hinges",
    "kinetic_energy",
    "links",
    "sheared",
    "twists",
]

F64 = NDArray[np.float64]
Window = tuple[slice, slice]


@dataclass(frozen=True)
class Links:
    """Springs of one direction: from the key points of window `one` to those of `two`. constant: array [N/m]. rest:
    length [m]. direction: unit vector (2,) in the resting sheet, x along columns."""

    one: Window
    two: Window
    constant: F64
    rest: float
    direction: tuple[float, float]


def _window(shape: tuple[int, int], i: int, j: int) -> tuple[Window, Window]:
    """Windows of the points that have a neighbour i rows and j columns on (i ≥ 0), and of those neighbours."""
    rows, cols = shape
    one = slice(0, rows - i), slice(max(0, -j), cols - max(0, j))
    return one, (slice(i, rows), slice(max(0, j), cols - max(0, -j)))


def links(sheet: Sheet) -> Iterator[Links]:
    """All springs of a sheet, direction by direction, each once."""
    s, (east, north, cell) = sheet.springs, sheet.weights
    a, b, l = s.spacing_x, s.spacing_y, s.diagonal_length  # noqa: E741
    falling = np.zeros_like(cell)
    falling[:, 1:] = cell[:, :-1]  # the other diagonal of a cell starts at its right corner
    diagonal = sheet.constant(lambda cloth: cloth.springs.diagonal)
    table = [
        (0, 1, sheet.constant(lambda cloth: cloth.springs.structural_x) * east, a, (1.0, 0.0)),
        (1, 0, sheet.constant(lambda cloth: cloth.springs.structural_y) * north, b, (0.0, 1.0)),
        (1, 1, diagonal * cell, l, (a / l, b / l)),
        (1, -1, diagonal * falling, l, (-a / l, b / l)),
    ]
    if s.law == "spring":
        x, y = (
            sheet.constant(of) for of in (lambda cloth: cloth.springs.second_x, lambda cloth: cloth.springs.second_y)
        )
        table += [
            (0, 2, x * np.minimum(east, np.roll(east, -1, 1)), 2 * a, (1.0, 0.0)),
            (2, 0, y * np.minimum(north, np.roll(north, -1, 0)), 2 * b, (0.0, 1.0)),
        ]
    for i, j, constant, rest, direction in table:
        one, two = _window(sheet.shape, i, j)
        yield Links(one, two, constant[one], rest, direction)


def hinges(sheet: Sheet) -> Iterator[tuple[Window, Window, Window, F64]]:
    """Hinges of the law "hinge": windows of the point before, at and after each, and β [N/m]."""
    (east, north, _), (rows, cols) = sheet.weights, sheet.shape
    every = slice(None)
    if cols > 2 and sheet.most(lambda cloth: cloth.springs.hinge_x) > 0:
        before, at, after = ((every, slice(k, cols - 2 + k)) for k in range(3))
        yield (
            before,
            at,
            after,
            sheet.constant(lambda cloth: cloth.springs.hinge_x) * np.minimum(east[before], east[at]),
        )
    if rows > 2 and sheet.most(lambda cloth: cloth.springs.hinge_y) > 0:
        before, at, after = ((slice(k, rows - 2 + k), every) for k in range(3))
        beta = sheet.constant(lambda cloth: cloth.springs.hinge_y, at[0])
        yield before, at, after, beta * np.minimum(north[before], north[at])


def twists(sheet: Sheet) -> tuple[tuple[Window, Window, Window, Window], F64] | None:
    """Windows of the corners 00, 10, 01 and 11 of all cells, and τ [N/m] of each; None of a sheet without torsion."""
    if sheet.most(lambda cloth: cloth.springs.twist) == 0:
        return None
    rows, cols = sheet.shape
    low, left, high, right = slice(0, rows - 1), slice(0, cols - 1), slice(1, rows), slice(1, cols)
    twist = sheet.constant(lambda cloth: cloth.springs.twist, low)
    return ((low, left), (high, left), (low, right), (high, right)), twist * sheet.cells


@dataclass(frozen=True)
class Cells:
    """All cells of a sheet that shear, (rows − 1, cols − 1, …). corners: windows of 00, 10, 01, 11. diagonals: vectors
    11 − 00 and 01 − 10 [m]. turn, curl: T and C [m]. arc: 1/12l, and less near edges [1/m]. apart: d₁ − d₂ + T·C/12l
    [m]. pull: ∂W/∂ of that [N]."""

    corners: tuple[Window, Window, Window, Window]
    diagonals: tuple[F64, F64]
    turn: F64
    curl: F64
    arc: F64
    apart: F64
    pull: F64


def sheared(sheet: Sheet, x: F64) -> Cells | None:
    """None where diagonals are springs. x: positions (rows, cols, 3) [m]."""
    if sheet.most(lambda cloth: cloth.springs.shear) == 0:
        return None
    rows, cols = sheet.shape
    low, left, high, right = slice(0, rows - 1), slice(0, cols - 1), slice(1, rows), slice(1, cols)
    corners = (low, left), (high, left), (low, right), (high, right)
    one, two, three, four = (x[corner] for corner in corners)
    first, second = np.linalg.norm(four - one, axis=-1), np.linalg.norm(three - two, axis=-1)
    turn, bent, whole = one - two - three + four, np.zeros_like(x), np.zeros((2, rows, cols))
    for way, between in enumerate(sheet.weights[1::-1]):  # along columns, along rows
        before, at, after = (
            tuple(slice(k, n - 2 + k) if way == axis else slice(n) for axis, n in enumerate((rows, cols)))
            for k in range(3)
        )
        if sheet.shape[way] > 2:
            bent[at] += x[before] - 2 * x[at] + x[after]
            whole[way][at] = np.minimum(between[before], between[at])
    least = np.minimum(1.0, np.min([one[corner] for one in whole for corner in corners], axis=0))
    curl = np.sum([bent[corner] for corner in corners], axis=0)
    arc = least / (12 * sheet.springs.diagonal_length)
    apart = first - second + arc * np.sum(turn * curl, axis=-1)
    pull = sheet.constant(lambda cloth: cloth.springs.shear, low) * sheet.cells * apart
    return Cells(corners, (four - one, three - two), turn, curl, arc, apart, pull)


def elastic_energy(sheet: Sheet, positions: ArrayLike) -> float:
    """Energy of all springs and hinges [J]. positions: (rows, cols, 3) [m]."""
    x = np.asarray(positions, np.float64)
    total = 0.0
    for link in links(sheet):
        length = np.linalg.norm(x[link.two] - x[link.one], axis=-1)
        total += 0.5 * float(np.sum(link.constant * (length - link.rest) ** 2))
    for before, at, after, beta in hinges(sheet):
        bend = x[before] - 2 * x[at] + x[after]
        total += 0.5 * float(np.sum(beta[..., None] * bend**2))
    if (found := twists(sheet)) is not None:
        (one, two, three, four), constant = found
        turn = x[one] - x[two] - x[three] + x[four]
        total += 0.5 * float(np.sum(constant[..., None] * turn**2))
    if (cells := sheared(sheet, x)) is not None:
        total += 0.5 * float(np.sum(cells.pull * cells.apart))
    return total


def elastic_forces(sheet: Sheet, positions: ArrayLike) -> F64:
    """−∂W/∂x of every key point, (rows, cols, 3) [N]."""
    x = np.asarray(positions, np.float64)
    out = np.zeros_like(x)
    for link in links(sheet):
        d = x[link.two] - x[link.one]
        length = np.maximum(np.linalg.norm(d, axis=-1), 1e-30)
        pull = (link.constant * (1 - link.rest / length))[..., None] * d
        out[link.one] += pull
        out[link.two] -= pull
    for before, at, after, beta in hinges(sheet):
        bend = beta[..., None] * (x[before] - 2 * x[at] + x[after])
        out[before] -= bend
        out[at] += 2 * bend
        out[after] -= bend
    if (found := twists(sheet)) is not None:
        (one, two, three, four), constant = found
        turn = constant[..., None] * (x[one] - x[two] - x[three] + x[four])
        for window, sign in ((one, -1), (two, 1), (three, 1), (four, -1)):
            out[window] += sign * turn
    if (cells := sheared(sheet, x)) is not None:
        _add_shear(cells, out)
    return out


def _add_shear(cells: Cells, out: F64) -> None:
    """The forces of cells on all key points (rows, cols, 3) [N]."""
    one, two, three, four = cells.corners
    for start, end, d, sign in ((one, four, cells.diagonals[0], 1), (two, three, cells.diagonals[1], -1)):
        along = (sign * cells.pull / np.maximum(np.linalg.norm(d, axis=-1), 1e-30))[..., None] * d
        out[start] += along
        out[end] -= along
    arc = (cells.pull * cells.arc)[..., None]
    hinge = np.zeros_like(out)
    for corner, sign in zip(cells.corners, (-1, 1, 1, -1), strict=True):
        out[corner] += sign * arc * cells.curl
        hinge[corner] += arc * cells.turn
    out[:, 1:-1] += 2 * hinge[:, 1:-1]
    out[:, :-2] -= hinge[:, 1:-1]
    out[:, 2:] -= hinge[:, 1:-1]
    out[1:-1] += 2 * hinge[1:-1]
    out[:-2] -= hinge[1:-1]
    out[2:] -= hinge[1:-1]


def accelerations(sheet: Sheet, positions: ArrayLike, gravity: ArrayLike) -> F64:
    """By springs, hinges and gravity [m/s²], (rows, cols, 3); 0 of pinned and absent key points."""
    free = sheet.inverse_mass[..., None]
    forces = elastic_forces(sheet, np.where(sheet.present[..., None], positions, 0.0))
    return forces * free + np.where(free > 0, gravity, 0.0)


def kinetic_energy(sheet: Sheet, velocities: ArrayLike) -> float:
    """½ Σ m v² [J]. velocities: (rows, cols, 3) [m/s]."""
    return 0.5 * float(np.sum(sheet.mass[..., None] * np.asarray(velocities, np.float64) ** 2))
