"""Springs of a sheet as one system of equations, in float64 on the host: energy, gradient, banded matrix.

Key points are numbered along the shorter side of the grid, so that the matrix of n × m key points has a band of
6 min(n, m) + 5 (hinges reach two rows) and is factorised as B = L Lᵀ by elimination within it (LAPACK, dpbtrf).

A spring's curvature is k (n nᵀ + s (1 − n nᵀ)), s = 1 − L/l, with s not below 0: of a spring that is pushed together
the part that would fling it sideways is left out, so that the matrix stays positive definite at any step and any state.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import coo_array, csr_array

from taichi_cloth.sheet.energy import hinges, links
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["Assembly"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

SHORTEST = 1.0e-9
"""Share of its rest length below which a spring has no direction of its own and takes that of the resting sheet."""

_ROW, _COLUMN = np.tril_indices(3)


class Assembly:
    """What is constant about the springs of one sheet. Arrays over key points have P = rows × columns rows."""

    def __init__(self, sheet: Sheet) -> None:
        numbers = np.arange(sheet.mass.size).reshape(sheet.shape)
        first, second, constant, rest, course = [], [], [], [], []
        for link in links(sheet):
            one, two = numbers[link.one].ravel(), numbers[link.two].ravel()
            there = link.constant.ravel() > 0
            first.append(one[there])
            second.append(two[there])
            constant.append(link.constant.ravel()[there])
            rest.append(np.full(there.sum(), link.rest))
            course.append(np.tile((*link.direction, 0.0), (there.sum(), 1)))
        self.first, self.second = np.concatenate(first), np.concatenate(second)
        self.constant, self.rest, self.course = np.concatenate(constant), np.concatenate(rest), np.concatenate(course)
        springs, points = np.arange(len(self.first)), numbers.size
        ends, signs = np.concatenate([self.first, self.second]), np.repeat([-1.0, 1.0], len(springs))
        self.gather: csr_array = csr_array(coo_array((signs, (ends, np.tile(springs, 2))), (points, len(springs))))
        """(P, springs): what a pull along each spring does to the key points."""
        self.stiffness: F64 = np.bincount(ends, np.tile(self.constant, 2), minlength=points).astype(np.float64)
        """(P,) of all springs at a key point together [N/m]."""
        self.bending = _bending(sheet, numbers)
        """(P, P): the hinges' energy is ½ xᵀ bending x, axis by axis."""
        self._band(sheet)

    def _band(self, sheet: Sheet) -> None:
        free = sheet.inverse_mass.ravel() > 0
        rows, cols = sheet.shape
        order = np.arange(rows * cols).reshape(rows, cols)
        order = (order if cols <= rows else order.T).ravel()
        self.free = order[free[order]]
        """Key points that move, in the order of the unknowns."""
        place = np.full(rows * cols, -1)
        place[self.free] = np.arange(len(self.free))
        bending = coo_array(self.bending)
        a, b = place[self.first], place[self.second]
        c, d = place[bending.row], place[bending.col]
        inner, bent = (a >= 0) & (b >= 0), (c >= 0) & (d >= 0)
        reach = max(int(np.abs(a - b)[inner].max(initial=0)), int(np.abs(c - d)[bent].max(initial=0)))
        self.width = 3 * reach + 3
        self.size = 3 * len(self.free)
        self._a, self._b, self._inner = a, b, inner
        own = 3 * np.concatenate([a[a >= 0], b[b >= 0]])
        self._own = self._flat(own[:, None] + _ROW, own[:, None] + _COLUMN)
        low, high = 3 * np.minimum(a, b)[inner], 3 * np.maximum(a, b)[inner]
        i, j = np.divmod(np.arange(9), 3)
        self._across = self._flat(high[:, None] + i, low[:, None] + j)
        every = 3 * np.arange(len(self.free))
        self._diagonal = self._flat(every[:, None] + _ROW, every[:, None] + _COLUMN)
        lower = bent & (c >= d)
        at = 3 * np.stack([c[lower], d[lower]])[..., None] + np.arange(3)
        self._hinged = np.bincount(
            self._flat(at[0], at[1]), np.repeat(bending.data[lower], 3), minlength=self.size * self.width
        )

    def _flat(self, row: I64, column: I64) -> I64:
        """Where the entry (row, column) of the lower half lies: a column of the matrix is a row in memory."""
        return (column * self.width + row - column).ravel()

    def spans(self, x: F64) -> tuple[F64, F64]:
        """Lengths (springs,) [m] and directions (springs, 3)."""
        d = x[self.second] - x[self.first]
        length = np.sqrt(np.einsum("si,si->s", d, d))
        short = length < SHORTEST * self.rest
        n = d / np.where(short, 1.0, length)[:, None]
        n[short] = self.course[short]
        return length, n

    def energy(self, x: F64) -> float:
        """Of springs and hinges [J]. x: (P, 3) [m]."""
        d = x[self.second] - x[self.first]
        strain = np.sqrt(np.einsum("si,si->s", d, d)) - self.rest
        return 0.5 * float(self.constant @ strain**2 + np.vdot(x, self.bending @ x))

    def gradient(self, x: F64) -> F64:
        """Of the energy, (P, 3) [N]: the forces of the springs, turned about."""
        length, n = self.spans(x)
        return self.gather @ ((self.constant * (length - self.rest))[:, None] * n) + self.bending @ x

    def matrix(self, x: F64, blocks: F64, lag: float = 0.0) -> F64:
        """Second derivative of the energy plus symmetric blocks (unknowns / 3, 3, 3) on the diagonal [N/m], banded,
        (unknowns, width). lag: τ/h of damping along the springs."""
        length, n = self.spans(x)
        across = np.maximum(1.0 - self.rest / np.maximum(length, 1e-300), 0.0)
        h = (self.constant * (1.0 + lag - across))[:, None, None] * n[:, :, None] * n[:, None, :]
        h += (self.constant * across)[:, None, None] * np.eye(3)
        lower = h[:, _ROW, _COLUMN]
        own = np.concatenate([lower[self._a >= 0], lower[self._b >= 0]])
        total = self.size * self.width
        out = np.bincount(self._own, own.ravel(), minlength=total)
        out -= np.bincount(self._across, h[self._inner].ravel(), minlength=total)
        out += (1.0 + lag) * self._hinged
        out[self._diagonal] += blocks[:, _ROW, _COLUMN].ravel()
        return out.reshape(self.size, self.width)

    @staticmethod
    def factorise(matrix: F64) -> F64:
        """Of what `matrix` gave, in place. Raises numpy.linalg.LinAlgError where it is not positive definite."""
        return cholesky_banded(matrix.T, lower=True, overwrite_ab=True, check_finite=False)

    def solve(self, factor: F64, right: F64) -> F64:
        """(P, 3) for a right side (P, 3); 0 where nothing moves."""
        out = np.zeros_like(right)
        found = cho_solve_banded((factor, True), right[self.free].ravel(), overwrite_b=True, check_finite=False)
        out[self.free] = found.reshape(-1, 3)
        return out


def _bending(sheet: Sheet, numbers: I64) -> csr_array:
    """Σ β cᵀ c of all hinges, c = (1, −2, 1)."""
    row, column, value = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
    for *three, beta in hinges(sheet):
        points = [numbers[window].ravel() for window in three]
        for p, s in zip(points, (1.0, -2.0, 1.0), strict=True):
            for q, t in zip(points, (1.0, -2.0, 1.0), strict=True):
                row.append(p)
                column.append(q)
                value.append(s * t * beta.ravel())
    entries = (np.concatenate(value), (np.concatenate(row), np.concatenate(column)))
    out = csr_array(coo_array(entries, (numbers.size, numbers.size)))
    out.eliminate_zeros()
    return out
