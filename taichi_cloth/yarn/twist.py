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

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.twist_steps import BACKWARDS, GAMMA, Array, Drive, drive_at, finite, line, speed_at, time_steps

__all__ = ["ZoneTwist", "transient_twist", "twist_angle", "zone_twist"]


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
    a, b = finite("twist.a_m", a_m, lowest=0, above=True), finite("twist.b_m", b_m, lowest=0, above=True)
    spin, speed = finite("twist.spin_turns_s", spin_turns_s), finite("twist.speed_m_s", speed_m_s)
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


def twist_angle(
    x_m: ArrayLike, *, a_m: float, b_m: float, twist_a: ArrayLike, twist_b: ArrayLike
) -> NDArray[np.float64]:
    """Turn of the section at x_m about the yarn's axis, 2 pi times the integral of T from A to x_m [rad].

    Particles drawn at x turn by this angle (paper Step 2, Figure 4). x_m [m from A], twist_a and twist_b
    [turns/m] broadcast; before A the angle is 0, behind C it stays what it is at C. Returns float64. Raises
    InputError.
    """
    a, b = (
        float(finite("twist.a_m", a_m, lowest=0, above=True)),
        float(finite("twist.b_m", b_m, lowest=0, above=True)),
    )
    x = finite("twist.x_m", x_m)
    in_a, in_b = np.clip(x, 0.0, a), np.clip(x - a, 0.0, b)
    return 2 * pi * (finite("twist.twist_a", twist_a) * in_a + finite("twist.twist_b", twist_b) * in_b)


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
    a, b, times = line(times_s, a_m, b_m)
    twist_a, twist_b = (float(finite("twist.start", value)) for value in start)
    passed_b = passed_c = 0.0
    rows = [(twist_a, twist_b, passed_b, passed_c)]
    first, second = 1.0 - GAMMA, GAMMA
    for t, h, output in time_steps(times, min(a, b), speed_m_s, max_step_s):
        out_b = out_c = 0.0  # turns crossing B and C in this step
        for weight, at in ((first, t + GAMMA * h), (second, t + h)):
            speed, spin = speed_at(speed_m_s, at), drive_at("twist.spin_turns_s", spin_turns_s, at)
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
