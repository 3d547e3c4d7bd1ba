"""How twist runs along a yarn from feed A through the twister B to the take-up C (paper 2.2.1 to 2.2.3).

Zone a is A to B, zone b is B to C. T [turns/m] is twist, V [m/s] the yarn's speed, s [turns/s] the speed at
which a section turns. The paper's equations, with V the same all along the yarn:

    (1)  dT/dt + d(V T)/dx = ds/dx                       turns are neither made nor lost
    (2)  2 pi I (ds/dt + V ds/dx) = c dT/dx + m          torque turns the yarn

Turns cross a section at the rate F = V T - s [turns/s], so (1) is dT/dt = -dF/dx. What the three nips do
follows from that. At A the yarn comes untwisted out of rollers that do not turn, so F = 0 just inside. At B
the yarn arrives turning with the twister, so F = V T(B-) - s_B, on both sides of B. At C it arrives at
rollers that do not turn, so F = V T(C-). Integrated over each zone this is what the paper solves,

    a dT_a/dt = s_B - V T_a,        b dT_b/dt = V (T_a - T_b) - s_B.

Departures from the paper: it prints s_a for the twister's speed and s_a = 0 at A in one paragraph; here the
speed is s_B, the twister's. A yarn moving backwards (V < 0) is refused: it would carry in whatever twist lies
behind C, which neither the paper nor these equations know.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, isfinite, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_banded

from taichi_cloth.errors import InputError

__all__ = ["Drive", "TwistField", "ZoneTwist", "transient_twist", "twist_angle", "twist_field", "zone_twist"]

Array = NDArray[np.float64]
Drive = float | Callable[[float], float]
"""A number, or a function of the time [s] that returns one."""

GAMMA = 1.0 - 1.0 / sqrt(2.0)
"""Alexander's SDIRK2: order 2, L-stable, the second stage is the new state. No step is too long for it."""

LARGEST_STEP_COUNT = 2_000_000
DEFAULT_STEPS_PER_OUTPUT = 8
DEFAULT_ZONE_FRACTION = 0.02  # of the shorter zone, that the yarn may move in one step


def _finite(name: str, value: ArrayLike, *, lowest: float = -inf, above: bool = False) -> Array:
    array = np.asarray(value, dtype=np.float64)
    wrong = ~np.isfinite(array) | ((array <= lowest) if above else (array < lowest))
    if np.any(wrong):
        rule = "finite" if lowest == -inf else f"finite and {'above' if above else 'at least'} {lowest:g}"
        raise InputError(f"{name}: {array[wrong].flat[0]:g} is not allowed; it must be {rule}")
    return array


BACKWARDS = "the yarn cannot run backwards, bringing in unknown twist from behind C; use 0 or more, or swap the zones"


def transient_twist(
    t_s: ArrayLike, *, a_m: ArrayLike, b_m: ArrayLike, speed_m_s: ArrayLike, spin_turns_s: ArrayLike
) -> tuple[Array, Array]:
    """Twist of both zones, t_s after the twister starts on an untwisted yarn (closed form, paper 2.2.3).

        T_a = (s/V) (1 - e^(-Vt/a)),    T_b = -(s/V) a/(a-b) (e^(-Vt/a) - e^(-Vt/b))

    evaluated as T_a = (s t/a) E(Vt/a) and T_b = -(s t/b) e^(-Vt/max(a,b)) E(Vt|a-b|/(ab)) with E(u) = (1 -
    e^-u)/u, in which nothing cancels. The limits are therefore part of the formula: a = b gives T_b = -(s
    t/a) e^(-Vt/a); V = 0 gives T_a = s t/a, T_b = -s t/b; t = inf gives T_a = s/V, T_b = 0.

    All arguments broadcast. t_s [s] >= 0, may be inf where V > 0; a_m, b_m [m] > 0; speed_m_s [m/s] >= 0;
    spin_turns_s [turns/s] of either sign. Returns (T_a, T_b) [turns/m], float64. Raises InputError.
    """
    t = np.asarray(t_s, dtype=np.float64)
    if np.any(np.isnan(t) | (t < 0)):
        raise InputError("twist.t_s: time must be a number, 0 or later")
    a, b = _finite("twist.a_m", a_m, lowest=0, above=True), _finite("twist.b_m", b_m, lowest=0, above=True)
    spin, speed = _finite("twist.spin_turns_s", spin_turns_s), _finite("twist.speed_m_s", speed_m_s)
    if np.any(speed < 0):
        raise InputError(f"twist.speed_m_s: {np.min(speed):g}; {BACKWARDS}")
    t, a, b, speed, spin = np.broadcast_arrays(t, a, b, speed, spin)
    if np.any(np.isinf(t) & (speed == 0)):
        raise InputError("twist.t_s: inf at speed 0; a standing yarn has no final twist, give a finite time")
    settled = np.isinf(t)
    t = np.where(settled, 0.0, t)
    longer, shorter = np.maximum(a, b), np.minimum(a, b)
    twist_a = spin * t / a * _mean_decay(speed * t / a)
    gap = speed * t / longer * (np.abs(a - b) / shorter)
    twist_b = -spin * t / b * np.exp(-speed * t / longer) * _mean_decay(gap)
    final = np.divide(spin, speed, out=np.zeros_like(spin), where=speed > 0)
    return np.where(settled, final, twist_a), np.where(settled, 0.0, twist_b)


def _mean_decay(u: Array) -> Array:
    """(1 - e^-u)/u, and 1 at u = 0: the mean of e^-v over 0 <= v <= u."""
    return np.divide(-np.expm1(-u), u, out=np.ones_like(u), where=u > 0)


@dataclass(frozen=True)
class ZoneTwist:
    """Twist of the two zones at the times asked for.

    times_s (k,) [s]; twist_a, twist_b (k,) [turns/m]; passed (k, 3) [turns] is the number of turns that has
    crossed A, B and C since the start, so that a T_a + b T_b changes by passed[:, 0] - passed[:, 2].
    """

    times_s: Array
    twist_a: Array
    twist_b: Array
    passed: Array


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


def twist_angle(
    x_m: ArrayLike, *, a_m: float, b_m: float, twist_a: ArrayLike, twist_b: ArrayLike
) -> NDArray[np.float64]:
    """Turn of the section at x_m about the yarn's axis, 2 pi times the integral of T from A to x_m [rad].

    Particles drawn at x turn by this angle (paper Step 2, Figure 4). x_m [m from A], twist_a and twist_b
    [turns/m] broadcast; before A the angle is 0, behind C it stays what it is at C. Returns float64. Raises
    InputError.
    """
    a, b = (
        float(_finite("twist.a_m", a_m, lowest=0, above=True)),
        float(_finite("twist.b_m", b_m, lowest=0, above=True)),
    )
    x = _finite("twist.x_m", x_m)
    in_a, in_b = np.clip(x, 0.0, a), np.clip(x - a, 0.0, b)
    return 2 * pi * (_finite("twist.twist_a", twist_a) * in_a + _finite("twist.twist_b", twist_b) * in_b)


def zone_twist(
    times_s: ArrayLike,
    *,
    a_m: float,
    b_m: float,
    speed_m_s: Drive,
    spin_turns_s: Drive,
    start: tuple[float, float] = (0.0, 0.0),
    max_step_s: float | None = None,
) -> ZoneTwist:
    """The two zone equations for varying V(t) and s_B(t): order 2 in the step, stable for any step.

    times_s (k,) [s] rising, the first is the start; speed_m_s [m/s] >= 0 and spin_turns_s [turns/s] are
    numbers or functions of t; start is (T_a, T_b) [turns/m]. A step never crosses an entry of times_s, so put
    one where V or s jumps to keep order 2. max_step_s [s]; by default the yarn moves 2 % of the shorter zone
    a step, and at least 8 steps are taken between two times. Turns leave a zone only as they enter the next,
    to rounding. Raises InputError.
    """
    a, b, times = _line(times_s, a_m, b_m)
    twist_a, twist_b = (float(_finite("twist.start", value)) for value in start)
    passed_b = passed_c = 0.0
    rows = [(twist_a, twist_b, passed_b, passed_c)]
    first, second = 1.0 - GAMMA, GAMMA
    for t, h, output in _steps(times, min(a, b), speed_m_s, max_step_s):
        out_b = out_c = 0.0  # turns crossing B and C in this step
        for weight, at in ((first, t + GAMMA * h), (second, t + h)):
            speed, spin = _speed(speed_m_s, at), _drive("twist.spin_turns_s", spin_turns_s, at)
            stage_a = (twist_a - (out_b - GAMMA * h * spin) / a) / (1 + GAMMA * h * speed / a)
            flux_b = speed * stage_a - spin
            stage_b = (twist_b + (out_b - out_c + GAMMA * h * flux_b) / b) / (1 + GAMMA * h * speed / b)
            out_b += weight * h * flux_b
            out_c += weight * h * speed * stage_b
        twist_a -= out_b / a
        twist_b += (out_b - out_c) / b
        passed_b += out_b
        passed_c += out_c
        if output:
            rows.append((twist_a, twist_b, passed_b, passed_c))
    table = np.array(rows)
    passed = np.column_stack([np.zeros(len(rows)), table[:, 2:]])
    return ZoneTwist(times, table[:, 0], table[:, 1], passed)


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
    a, b, times = _line(times_s, a_m, b_m)
    inertia = float(_finite("twist.inertia_kg_m", inertia_kg_m, lowest=0))
    stiffness = float(_finite("twist.stiffness_n_m2", stiffness_n_m2, lowest=0, above=True))
    for count in cells:
        if not 4 <= count <= 100_000:
            raise InputError(f"twist.cells: {count} cells in a zone; allowed 4 to 100000")
    slowness2 = 2 * pi * inertia / stiffness  # 1/w^2 [s^2/m^2]
    zones = (_Zone(a, cells[0], slowness2), _Zone(b, cells[1], slowness2))
    passed = np.zeros(3)
    twists, spins, passes = [np.zeros(sum(cells))], [], [passed.copy()]
    spins.append(_joined_spin(zones, _drive("twist.spin_turns_s", spin_turns_s, times[0])))
    for t, h, output in _steps(times, min(a, b), speed_m_s, max_step_s):
        spin = 0.0
        for zone in zones:
            zone.begin_step()
        for weight, at in ((1.0 - GAMMA, t + GAMMA * h), (GAMMA, t + h)):
            speed, spin = _speed(speed_m_s, at), _drive("twist.spin_turns_s", spin_turns_s, at)
            if slowness2 * speed**2 >= 1:
                raise InputError(
                    f"twist.inertia_kg_m: twist waves at {1 / sqrt(slowness2):.4g} m/s are no faster than the"
                    f" yarn at {speed:.4g} m/s, so the twister cannot twist zone a; lower one of the two"
                )
            slope = _drive("twist.torque_n", torque_n, at) / stiffness
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


def _line(times_s: ArrayLike, a_m: float, b_m: float) -> tuple[float, float, Array]:
    a = float(_finite("twist.a_m", a_m, lowest=0, above=True))
    b = float(_finite("twist.b_m", b_m, lowest=0, above=True))
    times = _finite("twist.times_s", times_s)
    if times.ndim != 1 or len(times) < 1 or np.any(np.diff(times) <= 0):
        raise InputError("twist.times_s: give a list of one or more times, each later than the one before")
    return a, b, times


def _steps(
    times: Array, shorter_zone: float, speed: Drive, max_step: float | None
) -> Iterator[tuple[float, float, bool]]:
    """(start, length, ends at an entry of times) of every step."""
    if max_step is not None and not (isfinite(max_step) and max_step > 0):
        raise InputError(f"twist.max_step_s: {max_step:g} is not allowed; it must be finite and above 0")
    counts: list[int] = []
    for begin, end in pairwise(times):
        if max_step is not None:
            count = ceil((end - begin) / max_step * (1 - 1e-12))
        else:
            fastest = max(_speed(speed, t) for t in np.linspace(begin, end, 5))
            moved = fastest * (end - begin) / shorter_zone
            count = max(DEFAULT_STEPS_PER_OUTPUT, ceil(moved / DEFAULT_ZONE_FRACTION))
        counts.append(max(count, 1))
    if sum(counts) > LARGEST_STEP_COUNT:
        raise InputError(
            f"twist.max_step_s: {sum(counts)} steps are needed, the limit is {LARGEST_STEP_COUNT};"
            " ask for a shorter time or a longer step"
        )
    return _walk(times, counts)


def _walk(times: Array, counts: Sequence[int]) -> Iterator[tuple[float, float, bool]]:
    for begin, end, count in zip(times[:-1], times[1:], counts, strict=True):
        h = float(end - begin) / count
        for i in range(count):
            yield float(begin) + i * h, h, i == count - 1


def _drive(name: str, drive: Drive, t: float) -> float:
    value = float(drive(t) if callable(drive) else drive)
    if not isfinite(value):
        raise InputError(f"{name}: {value} at {t:g} s; it must be finite")
    return value


def _speed(drive: Drive, t: float) -> float:
    value = _drive("twist.speed_m_s", drive, t)
    if value < 0:
        raise InputError(f"twist.speed_m_s: {value:g} at {t:g} s; {BACKWARDS}")
    return value
