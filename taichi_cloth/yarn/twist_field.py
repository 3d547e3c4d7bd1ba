"""Twist all along a yarn: the paper's equations (1) and (2) as a conservative scheme (paper 2.2.1 and 2.2.2).

The equations, their symbols and what the nips do are stated in `twist`, whose zone means this field has.
"""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.twist_steps import GAMMA, Array, Drive, drive_at, finite, line, speed_at, time_steps

__all__ = ["TwistField", "twist_field"]


@dataclass(frozen=True)
class TwistField:
    """Twist all along the yarn from A to C at the times asked for.

    times_s (k,) [s]; faces_m (n+1,) and cells_m (n,) [m from A], B being one of the faces; twist (k, n)
    [turns/m], the mean over each cell; spin (k, n+1) [turns/s] at the faces, upstream of the nip at A, B and
    C; twist_a, twist_b (k,) [turns/m], the mean over each zone; passed (k, 3) [turns], as in ZoneTwist.
    """

    times_s: Array
    faces_m: Array
    cells_m: Array
    twist: Array
    spin: Array
    twist_a: Array
    twist_b: Array
    passed: Array

    def angle(self, x_m: ArrayLike) -> Array:
        """2 pi times the integral of T from A to x_m [rad], shape (k, *x_m.shape); constant outside."""
        turns = np.cumsum(self.twist * np.diff(self.faces_m), axis=1)
        turns = np.concatenate([np.zeros((len(turns), 1)), turns], axis=1)
        x = np.asarray(x_m, dtype=np.float64)
        return 2 * pi * np.stack([np.interp(x, self.faces_m, row) for row in turns])


def twist_field(
    times_s: ArrayLike,
    *,
    a_m: float,
    b_m: float,
    speed_m_s: Drive,
    spin_turns_s: Drive,
    inertia_kg_m: float,
    stiffness_n_m2: float,
    torque_n: Drive = 0.0,
    cells: tuple[int, int] = (64, 64),
    max_step_s: float | None = None,
) -> TwistField:
    """Equations (1) and (2) on [A, C] from an untwisted yarn at rest: order 2, stable for any step.

    inertia_kg_m is I [kg m^2 per m] >= 0, stiffness_n_m2 is c [N m per turn/m] > 0, torque_n is m [N m per m]
    spread evenly over the yarn, a number or a function of t. cells are the numbers in zones a and b, 4 or
    more each. The other arguments are those of zone_twist. Raises InputError.

    The scheme. T lives in cells and s on faces, so that the torque c dT/dx sits where s does; a cell's turns
    change only by F through its two faces, T(face) being the mean of both sides (upwind extrapolation at B
    and C). SDIRK2 takes torque and transport implicitly, so twist waves (speed w = sqrt(c/(2 pi I))) shorter
    than a step are damped, not amplified; choose max_step_s near cell/w to follow them. B is a face: T jumps
    there, no difference is taken across it, and one F leaves zone a and enters zone b, so order 2 holds on
    both sides. A jump of s_B in time starts a wave front of height s_B/w in T that runs to and fro and fades
    as e^(-Vt/a); near the front the scheme rings and order 2 is lost.

    I = 0 needs no other scheme: the same equations then hold T flat in each zone (at the slope -m/c when m
    is not 0), where its means are those of zone_twist at the same steps, and s follows from F. As I falls to
    0, T tends to that solution, in proportion to I for a smooth start and, until the fronts have faded or a
    long step has damped them, to sqrt(I) for a sudden one. A yarn faster than its twist waves is refused: the
    twister could not reach zone a.
    """
    a, b, times = line(times_s, a_m, b_m)
    inertia = float(finite("twist.inertia_kg_m", inertia_kg_m, lowest=0))
    stiffness = float(finite("twist.stiffness_n_m2", stiffness_n_m2, lowest=0, above=True))
    for count in cells:
        if not 4 <= count <= 100_000:
            raise InputError(f"twist.cells: {count} cells in a zone; allowed 4 to 100000")
    slowness2 = 2 * pi * inertia / stiffness  # 1/w^2 [s^2/m^2]
    zones = (_Zone(a, cells[0], slowness2), _Zone(b, cells[1], slowness2))
    passed = np.zeros(3)
    twists, spins, passes = [np.zeros(sum(cells))], [], [passed.copy()]
    spins.append(_joined_spin(zones, drive_at("twist.spin_turns_s", spin_turns_s, times[0])))
    for t, h, output in time_steps(times, min(a, b), speed_m_s, max_step_s):
        spin = 0.0
        for zone in zones:
            zone.begin_step()
        for weight, at in ((1.0 - GAMMA, t + GAMMA * h), (GAMMA, t + h)):
            speed, spin = speed_at(speed_m_s, at), drive_at("twist.spin_turns_s", spin_turns_s, at)
            if slowness2 * speed**2 >= 1:
                raise InputError(
                    f"twist.inertia_kg_m: twist waves at {1 / sqrt(slowness2):.4g} m/s are no faster than the"
                    f" yarn at {speed:.4g} m/s, so the twister cannot twist zone a; lower one of the two"
                )
            slope = drive_at("twist.torque_n", torque_n, at) / stiffness
            entering = 0.0
            for zone, end_spin in zip(zones, (spin, 0.0), strict=True):
                entering = zone.stage(h, weight, speed, entering, end_spin, slope)
        for zone in zones:
            zone.end_step()
        passed += (zones[0].crossed[0], zones[0].crossed[-1], zones[1].crossed[-1])
        if output:
            twists.append(np.concatenate([zone.twist for zone in zones]))
            spins.append(_joined_spin(zones, spin))
            passes.append(passed.copy())
    faces = np.concatenate([np.linspace(0, a, cells[0] + 1), np.linspace(a, a + b, cells[1] + 1)[1:]])
    twist = np.array(twists)
    means = twist[:, : cells[0]].mean(axis=1), twist[:, cells[0] :].mean(axis=1)
    centres = 0.5 * (faces[1:] + faces[:-1])
    return TwistField(times, faces, centres, twist, np.array(spins), *means, np.array(passes))


class _Zone:
    """One zone's twist (n,) and spin (n+1,), and the banded equations of one implicit stage.

    Unknowns are interleaved s_0 T_1 s_1 ... T_n s_n. Both kinds of row are multiplied by the cell's length
    dx: dx T_i' = F_(i-1) - F_i, and (dx/w^2) s_j' = T_(j+1) - T_j + dx m/c - (V/w^2) (s_(j+1) - s_(j-1))/2.
    """

    def __init__(self, length: float, count: int, slowness2: float) -> None:
        self.dx = length / count
        self.slowness2 = slowness2
        self.twist = np.zeros(count)
        self.spin = np.zeros(count + 1)
        self.crossed = np.zeros(count + 1)  # turns through each face in this step

    def begin_step(self) -> None:
        self.crossed = np.zeros_like(self.crossed)
        self.pushed = np.zeros(len(self.twist) - 1)  # change of spin/w^2 at the inner faces in this step

    def stage(self, h: float, weight: float, speed: float, entering: float, end_spin: float, slope: float) -> float:
        """Solve one stage given F at the upstream nip and s at the downstream one; return F at the latter."""
        from scipy.linalg import solve_banded  # a tenth of a second, of all that import this

        n, dx, k = len(self.twist), self.dx, GAMMA * h
        half, drag = 0.5 * k * speed, 0.5 * k * speed * self.slowness2 / dx
        size = 2 * n + 1
        band = np.zeros((6, size))  # band[3 + row - column, column]
        # T rows: dx T + k (F_i - F_(i-1)) with F_j = V (T_j + T_(j+1))/2 - s_j inside and
        # F_n = V (3 T_n - T_(n-1))/2 - s_n at the end
        band[3, 1::2] = dx
        band[3, 1] += half
        band[3, size - 2] += 2 * half
        band[1, 3::2] = half  # T_(i+1)
        band[5, 1 : size - 3 : 2] = -half  # T_(i-1)
        band[5, size - 4] -= half
        band[2, 2::2] = -k  # s_i
        band[4, 2 : size - 2 : 2] = k  # s_(i-1)
        # inner s rows, divided by dx
        band[3, 2 : size - 1 : 2] = self.slowness2
        band[2, 3::2] = -k / dx
        band[4, 1 : size - 2 : 2] = k / dx
        band[1, 4::2] = drag
        band[5, 0 : size - 4 : 2] = -drag
        # ends: s_0 = V T(0) - F_in with T(0) = (3 T_1 - T_2)/2, and s_n given
        band[3, 0] = band[3, size - 1] = 1.0
        band[2, 1] = -1.5 * speed
        band[0, 3] = 0.5 * speed
        right = np.empty(size)
        right[1::2] = dx * self.twist - np.diff(self.crossed)
        right[1] += k * entering
        right[2 : size - 1 : 2] = self.slowness2 * self.spin[1:-1] + self.pushed + k * slope
        right[0], right[size - 1] = -entering, end_spin
        solution = solve_banded((2, 3), band, right, overwrite_ab=True, overwrite_b=True, check_finite=False)
        twist, spin = solution[1::2], solution[0::2]
        flux = np.empty(n + 1)
        flux[0] = entering
        flux[1:-1] = 0.5 * speed * (twist[1:] + twist[:-1]) - spin[1:-1]
        flux[-1] = speed * (1.5 * twist[-1] - 0.5 * twist[-2]) - end_spin
        rate = np.diff(twist) / dx + slope - 0.5 * speed * self.slowness2 / dx * (spin[2:] - spin[:-2])
        self.crossed += weight * h * flux
        self.pushed += weight * h * rate
        self.spin_next = spin
        return float(flux[-1])

    def end_step(self) -> None:
        self.twist = self.twist - np.diff(self.crossed) / self.dx
        self.spin = self.spin_next


def _joined_spin(zones: tuple[_Zone, _Zone], twister: float) -> Array:
    """s on all faces, as it is upstream of each nip: 0 at A, the twister's at B, 0 at C."""
    spin = np.concatenate([zones[0].spin, zones[1].spin[1:]])
    spin[0], spin[len(zones[0].twist)], spin[-1] = 0.0, twister, 0.0
    return spin
