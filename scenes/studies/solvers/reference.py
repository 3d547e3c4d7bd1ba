"""The reference of the solvers' diagrams, Störmer–Verlet in float64, and in the same plain loops two schemes that are
not in the program: XPBD and one stable sweep.

float32 will not do for very stiff sheets: at 10⁴ × cotton a step of 0.4 µs moves a key point by less than float32 tells
apart at half a metre where it is slower than 4 cm/s. The springs are those of `energy.links`.

    Verlet      all springs explicitly
    XPBD        (Macklin et al. 2016) shear and bending explicitly, then threads one by one, in colours
    one sweep   forces of all springs where key points would be without them, over m/h² + c Σk: stable at any step
"""

from dataclasses import dataclass
from math import ceil, exp, expm1
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import I32x1, I32x2, Template
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.energy import Links, accelerations, hinges, links
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.stability import highest_frequency

__all__ = ["Scheme", "reference", "scheme_course"]

F64 = NDArray[np.float64]
Scheme = Literal["Verlet", "XPBD", "one sweep"]
VERLET, XPBD, ONE_SWEEP = range(3)
SAFE = 1.5
"""c: 1 is just stable where stiffness is spread evenly."""

MOST = 50_000
"""Steps of one call of the kernel."""

if TYPE_CHECKING:
    F64x1 = Any
    F64x2 = Any
else:
    F64x1 = ti.types.ndarray(ti.f64, 1)
    F64x2 = ti.types.ndarray(ti.f64, 2)


@ti.func
def _pull(ends: Template, rest: Template, x: Template, s):
    """Of spring s: where it points, and how much longer it is than at rest."""
    i, j = ends[s, 0], ends[s, 1]
    d = ti.Vector([x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]])
    length = d.norm()
    return i, j, d / length, length - rest[s]


@ti.kernel
def _run(
    # model
    ends: I32x2,
    constant: F64x1,
    rest: F64x1,
    corners: I32x2,
    beta: F64x1,
    inverse: F64x1,
    world: F64x1,
    counts: I32x1,
    # in and out
    x: F64x2,
    u: F64x2,
    f: F64x2,
    tension: F64x1,
):
    """world: gravity h² (3), kept share of a step, centre (3), radius, friction of the ball, share of the springs' step
    that is taken; constants come × h². counts: steps, scheme, threads, which come before all other springs, sweeps."""
    ti.loop_config(serialize=True)
    for _once in range(1):
        for _ in range(counts[0]):
            if counts[1] == ONE_SWEEP:  # to where key points would be; f then moves them on from there
                for p in range(inverse.shape[0]):
                    if inverse[p] > 0:
                        for a in range(3):
                            u[p, a] = world[3] * u[p, a] + world[a]
                            x[p, a] += u[p, a]
            for s in range(ti.select(counts[1] == XPBD, counts[2], 0), constant.shape[0]):
                i, j, n, longer = _pull(ends, rest, x, s)
                for a in ti.static(range(3)):
                    f[i, a] += constant[s] * longer * n[a]  # pyright: ignore[reportIndexIssue]
                    f[j, a] -= constant[s] * longer * n[a]  # pyright: ignore[reportIndexIssue]
            for s in range(beta.shape[0]):
                i, j, k = corners[s, 0], corners[s, 1], corners[s, 2]
                for a in range(3):
                    bend = beta[s] * (x[i, a] - 2.0 * x[j, a] + x[k, a])
                    f[i, a] -= bend
                    f[j, a] += 2.0 * bend
                    f[k, a] -= bend
            for p in range(inverse.shape[0]):
                for a in range(3):
                    move = world[9] * inverse[p] * f[p, a]
                    if counts[1] == ONE_SWEEP:
                        u[p, a] += move
                        x[p, a] += move
                    elif inverse[p] > 0:
                        u[p, a] = world[3] * u[p, a] + move + world[a]
                        x[p, a] += u[p, a]
                    f[p, a] = 0.0
            if counts[1] == XPBD:
                for s in range(counts[2]):
                    tension[s] = 0.0
                for _sweep in range(counts[3]):
                    for s in range(counts[2]):
                        i, j, n, longer = _pull(ends, rest, x, s)
                        give = 1.0 / constant[s]
                        change = -(longer + give * tension[s]) / (inverse[i] + inverse[j] + give)
                        tension[s] += change
                        for a in ti.static(range(3)):
                            x[i, a] -= inverse[i] * change * n[a]  # pyright: ignore[reportIndexIssue]
                            u[i, a] -= inverse[i] * change * n[a]  # pyright: ignore[reportIndexIssue]
                            x[j, a] += inverse[j] * change * n[a]  # pyright: ignore[reportIndexIssue]
                            u[j, a] += inverse[j] * change * n[a]  # pyright: ignore[reportIndexIssue]
            for p in range(inverse.shape[0]):
                if inverse[p] > 0:
                    n = ti.Vector([x[p, 0] - world[4], x[p, 1] - world[5], x[p, 2] - world[6]])
                    distance = n.norm()
                    depth = world[7] - distance
                    if depth > 0:
                        n /= distance
                        d = ti.Vector([u[p, 0], u[p, 1], u[p, 2]])
                        t = d - d.dot(n) * n
                        held = ti.min(world[8] * depth / ti.max(t.norm(), 1e-300), 1.0)
                        for a in ti.static(range(3)):
                            u[p, a] += depth * n[a] - held * t[a]
                            x[p, a] += depth * n[a] - held * t[a]


@dataclass(frozen=True, eq=False)
class _Plain:
    """A sheet as lists: springs, threads first and by colours, with their two key points, constants [N/m] and rest
    lengths [m]; hinges with their three, and β [N/m]. threads: how many springs are."""

    ends: NDArray[np.int32]
    constant: F64
    rest: F64
    corners: NDArray[np.int32]
    beta: F64
    threads: int


def _plain(sheet: Sheet) -> _Plain:
    numbers = np.arange(sheet.mass.size).reshape(sheet.shape)

    def listed(link: Links, which: NDArray[np.bool_]) -> tuple[NDArray, F64, F64]:
        ends = np.stack([numbers[link.one][which], numbers[link.two][which]], -1)
        return ends, link.constant[which], np.full(len(ends), link.rest)

    every = list(links(sheet))
    parts = []
    for link, axis in zip(every[:2], (1, 0), strict=True):
        even = np.indices(link.constant.shape)[axis] % 2 == 0
        parts += [listed(link, even), listed(link, ~even)]
    threads = sum(len(part[0]) for part in parts)
    parts += [listed(link, np.ones(link.constant.shape, bool)) for link in every[2:]]
    ends, constant, rest = (np.concatenate(part) for part in zip(*parts, strict=True))
    bends = [(np.stack([numbers[w].ravel() for w in three], -1), b.ravel()) for *three, b in hinges(sheet)]
    corners, beta = (np.concatenate(part) for part in zip(*bends, strict=True))
    return _Plain(ends.astype(np.int32), constant, rest, corners.astype(np.int32), beta, threads)


def scheme_course(
    sheet: Sheet,
    forces: Forces,
    start: F64,
    seconds: float,
    *,
    frames: int,
    substeps: int,
    scheme: Scheme = "Verlet",
    sweeps: int = 1,
) -> F64:
    """Positions (frames, rows, cols, 3) [m] at equal times up to `seconds` after rest, with so many steps between two.

    Gravity and a ball only; a hinge sheet whose key points are all there."""
    h = seconds / frames / substeps
    c = sheet.material.air_damping
    h2 = h * h * (-expm1(-c * h) / (c * h) if c > 0 else 1.0)
    plain = _plain(sheet)
    ball = forces.sphere
    place = (*ball.centre, ball.radius + ball.gap, ball.friction) if ball else (0.0, 0.0, 0.0, -1.0, 0.0)
    inverse = sheet.inverse_mass.ravel()
    share = 1.0
    if scheme == "one sweep":
        stiffness = np.zeros(inverse.size)
        for ends, constant in ((plain.ends, plain.constant), (plain.corners, 2 * plain.beta)):
            for end in ends.T:
                np.add.at(stiffness, end, constant)
        share = 1 / (1 + SAFE * h2 * float((stiffness * inverse).max()))
    world = np.array([*(h2 * g for g in forces.gravity), exp(-c * h), *place, share])
    x = np.ascontiguousarray(start.reshape(-1, 3), np.float64).copy()
    u = -0.5 * h2 * accelerations(sheet, start, forces.gravity).reshape(-1, 3)
    if scheme != "Verlet":  # what threads pull follows from what pulls at them
        u = np.where(inverse[:, None] > 0, -0.5 * h2 * np.array(forces.gravity), 0.0)
    model = (plain.ends, h2 * plain.constant, plain.rest, plain.corners, h2 * plain.beta, inverse, world)
    room = np.zeros_like(x), np.zeros(plain.threads)
    kind = {"Verlet": VERLET, "XPBD": XPBD, "one sweep": ONE_SWEEP}[scheme]
    out = []
    for _ in range(frames):
        for done in range(0, substeps, MOST):
            counts = np.array([min(substeps - done, MOST), kind, plain.threads, sweeps], np.int32)
            _run(*model, counts, x, u, *room)
        out.append(x.reshape(start.shape).copy())
    return np.stack(out)


def reference(
    sheet: Sheet, forces: Forces, start: F64, seconds: float, *, share: float = 0.45, frames: int = 1
) -> tuple[F64, int]:
    """`scheme_course` of Verlet, and its steps. share: of the longest stable step."""
    substeps = ceil(seconds / frames / (share * 2 / highest_frequency(sheet)))
    return scheme_course(sheet, forces, start, seconds, frames=frames, substeps=substeps), frames * substeps
