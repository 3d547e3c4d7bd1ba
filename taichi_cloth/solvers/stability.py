"""How long a step the springs allow: ω_max of the sheet, and the limit of Störmer–Verlet that follows.

ω_max is that of one shape, at rest where none is named. Where springs turn towards each other or threads are drawn taut
it grows: by 11 % in a sheet pulled by 12 % whose diagonals are stiffer than its threads, by less than 4 % in all
built-in scenes.

Without damping Verlet is stable for h ω_max < 2. With damping along the springs (stress lags by τ, taken with the
last step) the highest mode obeys z² − (2 − τω²h − ω²h²) z + 1 − τω²h = 0, which leaves the unit circle at z = −1:

    h² + 2 τ h = 2 (1 + D) / ω²

with D the share of the step that viscous damping leaves; D ≈ 1 at any step that can be used.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from taichi_cloth.ground.blas import one_thread
from taichi_cloth.sheet.energy import Links, hinges, links, twists
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["FrequencyBound", "highest_frequency", "longest_in", "longest_step", "rounding_speed"]

F64 = NDArray[np.float64]

STILLEST = 0.1
"""Rate [1/s] at which motion is taken to be damped at least: without damping rounding heats a sheet for ever."""

LARGE = 50_000
"""Key points beyond which the bound stands for the frequency itself: iterations take as many products as a sheet has
key points along an edge, and at 1024 × 1024 have not ended after 200 s."""

BALANCE = 24
"""Steps in which scales of the bound are sought: half of them come within 3 %."""


@dataclass(frozen=True)
class _Pull:
    """Springs of one direction in one shape of the sheet. along: x, y, z of unit vectors, of all of them or of each.
    taut: 1 − L/l where they are longer than at rest, else 0: by that share they hold themselves straight."""

    link: Links
    along: tuple[F64 | float, F64 | float, F64 | float]
    taut: F64 | float


def _pulls(sheet: Sheet, positions: F64 | None) -> Iterator[_Pull]:
    """At positions (rows, cols, 3) [m]; None: at rest, in the x–y plane."""
    for link in links(sheet):
        if positions is None:
            yield _Pull(link, (*link.direction, 0.0), 0.0)
            continue
        apart = np.moveaxis(positions[link.two] - positions[link.one], -1, 0)
        length = np.maximum(np.sqrt((apart * apart).sum(axis=0)), 1e-10)
        x, y, z = apart / length
        yield _Pull(link, (x, y, z), np.maximum(1 - link.rest / length, 0.0))


def _stiffness_times(sheet: Sheet, pulls: list[_Pull], u: F64) -> F64:
    """K u, u (3, rows, cols): springs act along themselves, taut ones across too, hinges every way. What pressed
    springs take off is left out: K is never too small."""
    out = np.zeros_like(u)
    for pull in pulls:
        one, two, taut = pull.link.one, pull.link.two, pull.taut
        axes = [k for k in range(3) if np.ndim(pull.along[k]) or pull.along[k]]
        apart = {k: u[k][two] - u[k][one] for k in axes}
        force = pull.link.constant * (1 - taut) * sum(pull.along[k] * apart[k] for k in axes)
        across = pull.link.constant * taut if np.ndim(taut) else None
        for k in axes:
            share = force * pull.along[k] if across is None else force * pull.along[k] + across * apart[k]
            out[k][one] -= share
            out[k][two] += share
    for before, at, after, beta in hinges(sheet):
        for part, of in zip(out, u, strict=True):
            bend = beta * (of[before] - 2 * of[at] + of[after])
            part[before] += bend
            part[at] -= 2 * bend
            part[after] += bend
    if (found := twists(sheet)) is not None:
        (one, two, three, four), constant = found
        for part, of in zip(out, u, strict=True):
            turn = constant * (of[one] - of[two] - of[three] + of[four])
            for window, sign in ((one, 1), (two, -1), (three, -1), (four, 1)):
                part[window] += sign * turn
    return out


def highest_frequency(sheet: Sheet, positions: F64 | None = None, *, tolerance: float = 1e-4) -> float:
    """ω_max [rad/s] of the free key points: the largest eigenvalue of M^−½ K M^−½ by Lanczos' form of power iteration,
    matrix-free, started from a seeded vector. 0 where nothing can move.

    positions: (rows, cols, 3) [m] of the shape whose K it is; None: at rest. tolerance: of ω², which is rounded up;
    with 1e-2 it takes a sixth of the time. Of more than LARGE key points it is the bound, at rest up to 2 % above.
    """
    root = np.sqrt(sheet.inverse_mass)
    size = root.size * 3
    if not root.any():
        return 0.0
    if root.size > LARGE:
        return FrequencyBound(sheet).at(positions)
    pulls = list(_pulls(sheet, positions))

    def times(v: F64) -> F64:
        return (root * _stiffness_times(sheet, pulls, root * v.reshape(3, *sheet.shape))).ravel()

    if size <= 60:  # too small for Lanczos
        matrix = np.stack([times(row) for row in np.eye(size)])
        return sqrt(max(0.0, float(np.linalg.eigvalsh((matrix + matrix.T) / 2)[-1])))
    start = np.random.Generator(np.random.Philox(key=1)).standard_normal(size)
    if not times(start).any():  # no spring at all
        return 0.0
    operator = LinearOperator((size, size), matvec=times, dtype=np.float64)  # pyright: ignore[reportCallIssue]
    with one_thread():  # a tenth of the time that two threads take, which spin between products of long thin matrices
        (value,) = eigsh(  # pyright: ignore[reportAssignmentType]
            operator,
            k=1,
            which="LA",
            v0=start,
            tol=tolerance,  # pyright: ignore[reportArgumentType]
            ncv=24,
            return_eigenvectors=False,
        )
    return sqrt(max(0.0, float(value)) * (1 + max(tolerance, 1e-3)))


class FrequencyBound:
    """A bound of ω_max that takes no iteration, in any shape of a sheet: ω² ≤ max_p λ_max(A_p), for all scales s > 0,

        A_p = Σ k |c_p| w_p/s_p (Σ_q |c_q| w_q s_q) N,     w = m^(−1/2), 0 where pinned,

    over springs (c = 1, 1; N as in K), hinges (c = 1, 2, 1; N = I) and twisted cells (1, 1, 1, 1; N = I) that p
    is part of: Gershgorin's theorem for blocks (Feingold and Varga 1962) with rows and columns scaled. Here s is such
    that the bound at rest is small: within 2 % of ω_max, where one without scales is 5 to 9 % above.

    terms: (link, at its first ends, at its second ends), k |c_p| w_p/s_p (…) in windows [1/s²]. bend: what hinges and
    torsion add to every eigenvalue, (rows, cols) [1/s²].
    """

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        scale = _balanced(sheet, _flat_eigenvalue)
        self.terms, self.bend = _terms(sheet, scale)

    def at(self, positions: F64 | None = None) -> float:
        """[rad/s]. positions: as of `highest_frequency`."""
        stiff = np.zeros((*self.sheet.shape, 3, 3))
        for pull, (_, first, second) in zip(_pulls(self.sheet, positions), self.terms, strict=True):
            taut = np.asarray(pull.taut)[..., None, None]
            along = np.stack(pull.along, axis=-1)
            one = (1 - taut) * along[..., :, None] * along[..., None, :] + taut * np.eye(3)
            stiff[pull.link.one] += first[..., None, None] * one
            stiff[pull.link.two] += second[..., None, None] * one
        return float(np.sqrt(np.max(np.linalg.eigvalsh(stiff)[..., -1] + self.bend)))

    def anywhere(self) -> float:
        """[rad/s]; it holds wherever the key points are: as if springs acted every way, as hinges do."""
        terms, bend = _terms(self.sheet, _balanced(self.sheet, _sum))
        return float(np.sqrt(np.max(_sum(self.sheet, terms) + bend)))


Terms = list[tuple[Links, F64, F64]]


def _terms(sheet: Sheet, scale: F64) -> tuple[Terms, F64]:
    """`FrequencyBound.terms` and `bend`. scale: s, (rows, cols)."""
    root = np.sqrt(sheet.inverse_mass)
    out, into, terms = root / scale, root * scale, []
    for link in links(sheet):
        both = link.constant * (into[link.one] + into[link.two])
        terms.append((link, both * out[link.one], both * out[link.two]))
    bend = np.zeros(sheet.shape)
    for before, at, after, beta in hinges(sheet):
        all_three = beta * (into[before] + 2 * into[at] + into[after])
        for window, share in ((before, 1), (at, 2), (after, 1)):
            bend[window] += share * all_three * out[window]
    if (found := twists(sheet)) is not None:
        corners, constant = found
        all_four = constant * sum(into[window] for window in corners)
        for window in corners:
            bend[window] += all_four * out[window]
    return terms, bend


def _balanced(sheet: Sheet, largest: Callable[[Sheet, Terms], F64]) -> F64:
    """Scales that make the bound small. largest: eigenvalues of the springs' part, (rows, cols)."""
    scale = best = np.ones(sheet.shape)
    least = np.inf
    for _ in range(BALANCE):
        terms, bend = _terms(sheet, scale)
        bound = largest(sheet, terms) + bend
        most = bound.max()
        if most <= 0:
            break
        if most < least:
            least, best = most, scale
        scale = scale * np.sqrt(np.maximum(bound / most, 0.3))
        scale = scale / scale.max()
    return best


def _flat_eigenvalue(sheet: Sheet, terms: Terms) -> F64:
    """The largest of Σ k n nᵀ at rest, (rows, cols)."""
    xx, xy, yy = (np.zeros(sheet.shape) for _ in range(3))
    for link, first, second in terms:
        nx, ny = link.direction
        for window, k in ((link.one, first), (link.two, second)):
            xx[window] += nx * nx * k
            xy[window] += nx * ny * k
            yy[window] += ny * ny * k
    return (xx + yy) / 2 + np.sqrt(((xx - yy) / 2) ** 2 + xy**2)


def _sum(sheet: Sheet, terms: Terms) -> F64:
    """Σ k, (rows, cols)."""
    out = np.zeros(sheet.shape)
    for link, first, second in terms:
        out[link.one] += first
        out[link.two] += second
    return out


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


def longest_in(sheet: Sheet, frequency: float) -> float:
    """`longest_step` of a sheet, as its most damped cloth has it."""
    damping = sheet.most(lambda cloth: cloth.material.fibre_damping)
    air = sheet.most(lambda cloth: cloth.material.air_damping)
    return longest_step(frequency, fibre_damping=damping, air_damping=air)


def rounding_speed(step: float, ulp: float, *, air_damping: float = 0.0, fibre_damping: float = 0.0) -> float:
    """Root mean square speed [m/s] that key points get from positions in float32, where the step is short.

    Rounding throws a position off by ε = ulp/√12; springs with ω h ≈ 1.8 then kick it by ω² ε h = 3.2 ε/h in each
    step, at random; what is damped at a rate c keeps the kicks of 1/(2 c h) steps. ulp: between neighbouring numbers at
    the coordinates, root mean square [m]. The motion is as fast as the quickest waves and therefore as small as the
    rounding, but it is energy, and contact feels it.
    """
    rate = max(air_damping, STILLEST) + 2 * fibre_damping / step**2
    return 3.2 * ulp / sqrt(12) / step * sqrt(max(1.0, 1 / (2 * rate * step)))
