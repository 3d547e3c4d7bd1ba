"""How long a step the springs allow: ω_max of the sheet, and the limit of Störmer–Verlet that follows.

Without damping Verlet is stable for h ω_max < 2. With damping along the springs (stress lags by τ, taken with the
last step) the highest mode obeys z² − (2 − τω²h − ω²h²) z + 1 − τω²h = 0, which leaves the unit circle at z = −1:

    h² + 2 τ h = 2 (1 + D) / ω²

with D the share of the step that viscous damping leaves; D ≈ 1 at any step that can be used.
"""

# scipy says less about its types than it does.
# pyright: reportCallIssue=false, reportArgumentType=false, reportAssignmentType=false

from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from taichi_cloth.blas import one_thread
from taichi_cloth.energy import hinges, links
from taichi_cloth.sheet import Sheet

__all__ = ["frequency_bound", "highest_frequency", "longest_step", "rounding_speed"]

F64 = NDArray[np.float64]

STILLEST = 0.1
"""Rate [1/s] at which motion is taken to be damped at least: without damping rounding heats a sheet for ever."""


def _stiffness_times(sheet: Sheet, u: F64) -> F64:
    """K u at rest, u (rows, cols, 3), the sheet in the x–y plane: springs act along themselves, hinges every way."""
    out = np.zeros_like(u)
    for link in links(sheet):
        nx, ny = link.direction
        d = u[link.two] - u[link.one]
        pull = link.constant * (nx * d[..., 0] + ny * d[..., 1])
        for axis, n in ((0, nx), (1, ny)):
            if n != 0.0:
                out[(*link.one, axis)] -= n * pull
                out[(*link.two, axis)] += n * pull
    for before, at, after, beta in hinges(sheet):
        bend = beta[..., None] * (u[before] - 2 * u[at] + u[after])
        out[before] += bend
        out[at] -= 2 * bend
        out[after] += bend
    return out


def highest_frequency(sheet: Sheet) -> float:
    """ω_max [rad/s] of the free key points at rest: the largest eigenvalue of M^−½ K M^−½ by Lanczos' form of power
    iteration, matrix-free, started from a seeded vector. 0 where nothing can move."""
    root = np.sqrt(sheet.inverse_mass)[..., None]
    size = root.size * 3
    if not root.any():
        return 0.0

    def times(v: F64) -> F64:
        return (root * _stiffness_times(sheet, root * v.reshape(*sheet.shape, 3))).ravel()

    if size <= 60:  # too small for Lanczos
        matrix = np.stack([times(row) for row in np.eye(size)])
        return sqrt(max(0.0, float(np.linalg.eigvalsh((matrix + matrix.T) / 2)[-1])))
    start = np.random.Generator(np.random.Philox(key=1)).standard_normal(size)
    operator = LinearOperator((size, size), matvec=times, dtype=np.float64)
    with one_thread():  # a tenth of the time that two threads take, which spin between products of long thin matrices
        (value,) = eigsh(operator, k=1, which="LA", v0=start, tol=1e-4, ncv=24, return_eigenvectors=False)
    return min(sqrt(max(0.0, float(value)) * (1 + 1e-3)), frequency_bound(sheet))


def frequency_bound(sheet: Sheet) -> float:
    """A closed bound of ω_max [rad/s]: ω² ≤ max over key points of 2 λ_max(Σ k n nᵀ)/m + those of hinges.

    From (n·(u − w))² ≤ 2 ((n·u)² + (n·w)²) for springs, and |u₋ − 2u + u₊|² ≤ 4 (|u₋|² + 2|u|² + |u₊|²) for hinges.
    """
    xx, xy, yy, bend = (np.zeros(sheet.shape) for _ in range(4))
    for link in links(sheet):
        nx, ny = link.direction
        for window in (link.one, link.two):
            xx[window] += nx * nx * link.constant
            xy[window] += nx * ny * link.constant
            yy[window] += ny * ny * link.constant
    for before, at, after, beta in hinges(sheet):
        bend[before] += 4 * beta
        bend[at] += 8 * beta
        bend[after] += 4 * beta
    largest = (xx + yy) / 2 + np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    return float(np.sqrt(np.max((2 * largest + bend) * sheet.inverse_mass)))


def longest_step(frequency: float, *, fibre_damping: float = 0.0, air_damping: float = 0.0) -> float:
    """The step [s] at which Verlet stops being stable. frequency: ω_max [rad/s]. fibre_damping: τ [s]."""
    if frequency <= 0:
        return float("inf")
    tau = fibre_damping
    step = 2 / frequency
    for _ in range(3):  # D depends on the step, weakly
        limit = (2 + 2 * np.exp(-air_damping * step)) / frequency**2
        step = float(-tau + sqrt(tau**2 + limit))
    return step


def rounding_speed(step: float, ulp: float, *, air_damping: float = 0.0, fibre_damping: float = 0.0) -> float:
    """Root mean square speed [m/s] that key points get from positions in float32, where the step is short.

    Rounding throws a position off by ε = ulp/√12; springs with ω h ≈ 1.8 then kick it by ω² ε h = 3.2 ε/h in each
    step, at random; what is damped at a rate c keeps the kicks of 1/(2 c h) steps. ulp: between neighbouring numbers at
    the coordinates, root mean square [m]. The motion is as fast as the quickest waves and therefore as small as the
    rounding, but it is energy, and contact feels it.
    """
    rate = max(air_damping, STILLEST) + 2 * fibre_damping / step**2
    return 3.2 * ulp / sqrt(12) / step * sqrt(max(1.0, 1 / (2 * rate * step)))
