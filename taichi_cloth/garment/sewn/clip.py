"""A panel's cells as triangles, those on its outline clipped by it."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.cut import CutPanel, intervals

__all__ = ["clipped", "crossed_at"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Ring = list[tuple[float, float]]

SNAP = 0.003
"""Share of a cell within which what an outline crosses near a key point is taken for the key point."""
LEAST = 1e-7
"""Area of a triangle, in cells, below which it is left out."""


def clipped(piece: CutPanel, outline: F64) -> tuple[F64, I64, I64, I64]:
    """Points (n, 2) in cells from the panel's first key point, columns first; column and row (n, 2) of a cell that each
    is in; triangles (m, 3); and column and row (m, 2) of theirs.

    outline: (k, 2) of the cloth, in grain coordinates [m]. Two triangles a cell, along the diagonal from its first key
    point: whole ones inside, parts of them on the outline.
    """
    outline = (outline - piece.origin) / np.asarray(piece.spacing)
    cut, inside = _crossed(outline, piece.share.shape), _inside(outline, piece.share.shape)
    number: dict[tuple[float, float], int] = {}
    points: Ring = []
    within: list[tuple[int, int]] = []
    triangles: list[tuple[int, int, int]] = []
    cells: list[tuple[int, int]] = []

    def numbered(x: float, y: float, cell: tuple[int, int]) -> int:
        near = round(x), round(y)
        if abs(x - near[0]) < SNAP and abs(y - near[1]) < SNAP:
            x, y = near
        key = (round(x, 6), round(y, 6))
        if key not in number:
            number[key] = len(points)
            points.append((float(x), float(y)))
            within.append(cell)
        return number[key]

    ring: Ring = [(float(x), float(y)) for x, y in outline]
    if _area(ring) < 0:
        ring = ring[::-1]

    @cache
    def column(j: int) -> Ring:
        return _half(_half(ring, 1, 0, -j), -1, 0, j + 1)

    for i, j in np.argwhere(cut | inside).tolist():
        x, y = float(j), float(i)
        part = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        if cut[i, j]:
            part = _half(_half(column(j), 0, 1, -i), 0, -1, i + 1)
        for sign in (1, -1):  # below the diagonal, above it
            half = _half(part, sign, -sign, sign * (i - j)) if len(part) > 2 else []
            index = list(dict.fromkeys(numbered(u, v, (j, i)) for u, v in half))
            for one in _triangles(index, points):
                triangles.append(one)
                cells.append((j, i))
    of = np.asarray(cells, np.int64).reshape(-1, 2)
    return np.asarray(points), np.asarray(within, np.int64), np.asarray(triangles, np.int64), of


def crossed_at(a: float, b: float) -> F64:
    """Shares of the way from one number to another at which it comes to whole ones."""
    return (np.arange(np.ceil(min(a, b)), np.floor(max(a, b)) + 1) - a) / (b - a) if a != b else np.zeros(0)


def _area(ring: Ring) -> float:
    return sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(ring, ring[1:] + ring[:1], strict=True)) / 2


def _half(ring: Ring, a: float, b: float, c: float) -> Ring:
    """A polygon clipped to a x + b y + c ≥ 0 (Sutherland and Hodgman 1974)."""
    out: Ring = []
    for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
        s, t = a * p[0] + b * p[1] + c, a * q[0] + b * q[1] + c
        if s >= 0:
            out.append(p)
        if (s > 0 > t) or (s < 0 < t):
            share = s / (s - t)
            out.append((p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])))
    return out


def _triangles(index: list[int], points: Ring) -> list[tuple[int, int, int]]:
    """Of a polygon that turns left: its ears, one after the other (Meisters 1975), the one with the shortest cut first,
    so that no cut runs close along an outline."""
    out, left = [], list(index)

    def size(k: int) -> float:
        p, q, r = (points[left[m % len(left)]] for m in (k - 1, k, k + 1))
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    def cut_at(k: int) -> float:
        p, q = (points[left[m % len(left)]] for m in (k - 1, k + 1))
        return (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2

    def free(k: int) -> bool:
        """Whether no other corner lies in the triangle at k."""
        ear = [left[m % len(left)] for m in (k - 1, k, k + 1)]
        ring = [points[m] for m in ear]
        for other in (points[m] for m in left if m not in ear):
            sides = [
                (q[0] - p[0]) * (other[1] - p[1]) - (q[1] - p[1]) * (other[0] - p[0])
                for p, q in zip(ring, ring[1:] + ring[:1], strict=True)
            ]
            if min(sides) > -1e-12:
                return False
        return True

    while len(left) > 2:
        sizes = [size(k) for k in range(len(left))]
        order = sorted(range(len(left)), key=cut_at)
        ear = next((k for k in order if sizes[k] > LEAST and free(k)), None)
        if ear is None:  # what is left is no wider than a line
            flat = min(range(len(left)), key=lambda k: abs(sizes[k]))
            if abs(sizes[flat]) > LEAST:
                break
            del left[flat]
            continue
        out.append(tuple(left[m % len(left)] for m in (ear - 1, ear, ear + 1)))
        del left[ear]
    return out


def _crossed(outline: F64, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """(rows, columns) of cells that the outline runs through, by the middles of what lies between two of its crossings
    with rows and columns: a cell of which it cuts next to nothing off would not fit to those beside it, taken whole."""
    out = np.zeros(shape, bool)
    ends = np.roll(outline, -1, axis=0)
    for p, q in zip(outline, ends, strict=True):
        crossings = [crossed_at(a, b) for a, b in zip(p.tolist(), q.tolist(), strict=True)]
        share = np.unique(np.clip(np.concatenate([[0.0, 1.0], *crossings]), 0.0, 1.0))
        at = p + (0.5 * (share[:-1] + share[1:]))[:, None] * (q - p)
        for shift in (-1e-6, 1e-6):
            cell = np.clip(np.floor(at + shift).astype(int), 0, np.array(shape[::-1]) - 1)
            out[cell[:, 1], cell[:, 0]] = True
    return out


def _inside(outline: F64, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """(rows, columns) of cells whose middle is inside the outline."""
    out = np.zeros(shape, bool)
    middle = np.arange(shape[1]) + 0.5
    for i in range(shape[0]):
        for left, right in intervals(outline, i + 0.5, 1):
            out[i] |= (middle > left) & (middle < right)
    return out
