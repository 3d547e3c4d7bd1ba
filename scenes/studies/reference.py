"""The reference of the solvers' diagrams: Störmer–Verlet in float64, spring by spring, as plain as it gets.

float32 will not do for very stiff sheets: at 10⁴ × cotton a step of 0.4 µs moves a key point by less than float32 tells
apart at half a metre where it is slower than 4 cm/s. The springs are those of `energy.links`.
"""

from math import ceil, exp, expm1
from typing import TYPE_CHECKING, Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import I32x2, Int
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.energy import accelerations, hinges, links
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.stability import highest_frequency

__all__ = ["reference"]

F64 = NDArray[np.float64]

if TYPE_CHECKING:
    F64x1 = Any
    F64x2 = Any
else:
    F64x1 = ti.types.ndarray(ti.f64, 1)
    F64x2 = ti.types.ndarray(ti.f64, 2)


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
    steps: Int,
    # in and out
    x: F64x2,
    u: F64x2,
    f: F64x2,
):
    """world: gravity h² (3), kept share of a step, centre (3), radius, friction of the ball; constants come × h²."""
    ti.loop_config(serialize=True)
    for _once in range(1):
        for _ in range(steps):
            for s in range(constant.shape[0]):
                i, j = ends[s, 0], ends[s, 1]
                dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
                c = constant[s] * (1.0 - rest[s] / ti.sqrt(dx * dx + dy * dy + dz * dz))
                f[i, 0] += c * dx
                f[i, 1] += c * dy
                f[i, 2] += c * dz
                f[j, 0] -= c * dx
                f[j, 1] -= c * dy
                f[j, 2] -= c * dz
            for s in range(beta.shape[0]):
                i, j, k = corners[s, 0], corners[s, 1], corners[s, 2]
                for a in range(3):
                    bend = beta[s] * (x[i, a] - 2.0 * x[j, a] + x[k, a])
                    f[i, a] -= bend
                    f[j, a] += 2.0 * bend
                    f[k, a] -= bend
            for p in range(inverse.shape[0]):
                if inverse[p] > 0:
                    d = ti.Vector([0.0, 0.0, 0.0], dt=ti.f64)
                    n = ti.Vector([0.0, 0.0, 0.0], dt=ti.f64)
                    for a in range(3):
                        d[a] = world[3] * u[p, a] + inverse[p] * f[p, a] + world[a]
                        n[a] = x[p, a] + d[a] - world[4 + a]
                    distance = n.norm()
                    depth = world[7] - distance
                    if depth > 0:
                        n /= distance
                        along = d.dot(n)
                        t = d - along * n
                        held = ti.min(world[8] * depth / ti.max(t.norm(), 1e-300), 1.0)
                        d = d + depth * n - held * t
                    for a in range(3):
                        u[p, a] = d[a]
                        x[p, a] += d[a]
                for a in range(3):
                    f[p, a] = 0.0


def reference(sheet: Sheet, forces: Forces, start: F64, seconds: float, *, share: float = 0.45) -> tuple[F64, int]:
    """Positions (rows, cols, 3) [m] after `seconds` from rest, and the steps taken. share: of the longest stable step.

    Gravity and a ball only; a hinge sheet whose key points are all there."""
    limit = share * 2 / highest_frequency(sheet)
    count = ceil(seconds / limit)
    h = seconds / count
    c = sheet.material.air_damping
    h2 = h * h * (-expm1(-c * h) / (c * h) if c > 0 else 1.0)
    numbers = np.arange(sheet.mass.size).reshape(sheet.shape)
    ends, constant, rest = [], [], []
    for link in links(sheet):
        ends.append(np.stack([numbers[link.one].ravel(), numbers[link.two].ravel()], -1))
        constant.append(h2 * link.constant.ravel())
        rest.append(np.full(link.constant.size, link.rest))
    corners = [(np.stack([numbers[w].ravel() for w in three], -1), h2 * b.ravel()) for *three, b in hinges(sheet)]
    ball = forces.sphere
    place = (*ball.centre, ball.radius + ball.gap, ball.friction) if ball else (0.0, 0.0, 0.0, -1.0, 0.0)
    world = np.array([*(h2 * g for g in forces.gravity), exp(-c * h), *place])
    x = np.ascontiguousarray(start.reshape(-1, 3), np.float64)
    inverse = sheet.inverse_mass.ravel()
    f = np.zeros_like(x)
    u = np.zeros_like(x)
    arrays = (np.concatenate(ends).astype(np.int32), np.concatenate(constant), np.concatenate(rest))
    bends = (np.concatenate([c for c, _ in corners]).astype(np.int32), np.concatenate([b for _, b in corners]))
    x = x.copy()
    u[:] = -0.5 * h2 * accelerations(sheet, start, forces.gravity).reshape(-1, 3)
    done = 0
    while done < count:
        some = min(count - done, 50_000)
        _run(*arrays, *bends, inverse, world, some, x, u, f)
        done += some
    return x.reshape(start.shape), count
