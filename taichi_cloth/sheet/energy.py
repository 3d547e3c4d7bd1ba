"""Energy and forces of a sheet in float64 on the host: the reference that kernels and tests are held against.

W = Σ k/2 (|d| − L)² over structural, diagonal and second-neighbour springs + Σ β/2 |x₋ − 2x + x₊|² over hinges
  + Σ τ/2 |x₀₀ − x₁₀ − x₀₁ + x₁₁|² + Σ k/2 (|x₁₁ − x₀₀| − |x₀₁ − x₁₀|)² over cells

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
    table = [
        (0, 1, s.structural_x * east, a, (1.0, 0.0)),
        (1, 0, s.structural_y * north, b, (0.0, 1.0)),
        (1, 1, s.diagonal * cell, l, (a / l, b / l)),
        (1, -1, s.diagonal * falling, l, (-a / l, b / l)),
    ]
    if s.law == "spring":
        table += [
            (0, 2, s.second_x * np.minimum(east, np.roll(east, -1, 1)), 2 * a, (1.0, 0.0)),
            (2, 0, s.second_y * np.minimum(north, np.roll(north, -1, 0)), 2 * b, (0.0, 1.0)),
        ]
    for i, j, constant, rest, direction in table:
        one, two = _window(sheet.shape, i, j)
        yield Links(one, two, constant[one], rest, direction)


def hinges(sheet: Sheet) -> Iterator[tuple[Window, Window, Window, F64]]:
    """Hinges of the law "hinge": windows of the point before, at and after each, and β [N/m]."""
    s, (east, north, _) = sheet.springs, sheet.weights
    rows, cols = sheet.shape
    every = slice(None)
    if s.hinge_x > 0 and cols > 2:
        before, at, after = ((every, slice(k, cols - 2 + k)) for k in range(3))
        yield before, at, after, s.hinge_x * np.minimum(east[before], east[at])
    if s.hinge_y > 0 and rows > 2:
        before, at, after = ((slice(k, rows - 2 + k), every) for k in range(3))
        yield before, at, after, s.hinge_y * np.minimum(north[before], north[at])


def twists(sheet: Sheet) -> tuple[tuple[Window, Window, Window, Window], F64] | None:
    """Windows of the corners 00, 10, 01 and 11 of all cells, and τ [N/m] of each; None of a sheet without torsion."""
    if sheet.springs.twist == 0:
        return None
    rows, cols = sheet.shape
    low, left, high, right = slice(0, rows - 1), slice(0, cols - 1), slice(1, rows), slice(1, cols)
    return ((low, left), (high, left), (low, right), (high, right)), sheet.springs.twist * sheet.cells


def sheared(sheet: Sheet, x: F64) -> Iterator[tuple[Window, Window, F64, F64]]:
    """Both diagonals of all cells that shear: windows of their ends, vectors between them (rows − 1, cols − 1, 3) [m],
    and how much each is pulled along itself (rows − 1, cols − 1) [N]; nothing where diagonals are springs. x: positions
    (rows, cols, 3) [m]."""
    if sheet.springs.shear == 0:
        return
    rows, cols = sheet.shape
    low, left, high, right = slice(0, rows - 1), slice(0, cols - 1), slice(1, rows), slice(1, cols)
    ends = ((low, left), (high, right)), ((low, right), (high, left))
    vectors = [x[two] - x[one] for one, two in ends]
    lengths = [np.linalg.norm(d, axis=-1) for d in vectors]
    pull = sheet.springs.shear * sheet.cells * (lengths[0] - lengths[1])
    for (one, two), d, sign in zip(ends, vectors, (1, -1), strict=True):
        yield one, two, d, sign * pull


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
    for _, _, d, pull in sheared(sheet, x):  # k (d₁ − d₂) d₁/2 and −k (d₁ − d₂) d₂/2
        total += 0.5 * float(np.sum(pull * np.linalg.norm(d, axis=-1)))
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
    for one, two, d, along in sheared(sheet, x):
        pull = (along / np.maximum(np.linalg.norm(d, axis=-1), 1e-30))[..., None] * d
        out[one] += pull
        out[two] -= pull
    return out


def accelerations(sheet: Sheet, positions: ArrayLike, gravity: ArrayLike) -> F64:
    """By springs, hinges and gravity [m/s²], (rows, cols, 3); 0 of pinned and absent key points."""
    free = sheet.inverse_mass[..., None]
    forces = elastic_forces(sheet, np.where(sheet.present[..., None], positions, 0.0))
    return forces * free + np.where(free > 0, gravity, 0.0)


def kinetic_energy(sheet: Sheet, velocities: ArrayLike) -> float:
    """½ Σ m v² [J]. velocities: (rows, cols, 3) [m/s]."""
    return 0.5 * float(np.sum(sheet.mass[..., None] * np.asarray(velocities, np.float64) ** 2))
