"""Twist all along the yarn: order 2 against the closed form and against travelling waves, turns never lost."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from numpy.typing import ArrayLike

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.twist import transient_twist, twist_angle, zone_twist
from taichi_cloth.yarn.twist_field import TwistField, twist_field
from taichi_cloth.yarn.twist_steps import Drive

A, B, V, S = 0.3, 0.2, 0.5, 60.0
STEPS = [0.04, 0.02, 0.01, 0.005, 0.0025]
TIMES = np.linspace(0, 2, 6)


def slope(steps: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def field(
    times: ArrayLike, *, waves: float, spin: Drive, cells: int, step: float | None, speed: Drive = V
) -> TwistField:
    """twist_field of the test's yarn, whose twist waves run at `waves` m/s."""
    return twist_field(
        times,
        a_m=A,
        b_m=B,
        speed_m_s=speed,
        spin_turns_s=spin,
        inertia_kg_m=3e-9 / (2 * pi * waves**2),
        stiffness_n_m2=3e-9,
        cells=(cells, cells),
        max_step_s=step,
    )


def test_field_without_inertia_converges_to_the_closed_form_at_order_2() -> None:
    truth = transient_twist(TIMES, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=S)
    errors = []
    for step in STEPS:
        got = field(TIMES, waves=np.inf, spin=S, cells=8, step=step)
        errors.append(
            float(max(np.abs(got.twist[:, :8].T - truth[0]).max(), np.abs(got.twist[:, 8:].T - truth[1]).max()))
        )
    assert slope(STEPS, errors) == pytest.approx(2, abs=0.15)


def smooth_start(t: ArrayLike) -> np.ndarray:
    """From 0 to S within 0.25 s, three times differentiable."""
    u = np.clip(np.asarray(t) / 0.25, 0, 1)
    return S * u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)


def smooth_spin(t: float) -> float:
    return float(smooth_start(t))


def waves_to_and_fro(t: float, x: np.ndarray, w: float, spin: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """d'Alembert's solution at constant V, summed over reflections: T at x.

    r = s - wT runs downstream at w + V, q = s + wT upstream at w - V. At A, F = 0 turns q into r = -e q with
    e = (w-V)/(w+V); at B, s = s_B turns r into q = 2 s_B - r; behind B, V T - s = F turns q into
    r = -(2 w F)/(w+V) - e q; at C, s = 0 turns r into q = -r.
    """
    e = (w - V) / (w + V)

    def echoes(source: Callable[[np.ndarray], np.ndarray], length: float, at: np.ndarray) -> np.ndarray:
        period = length / (w - V) + length / (w + V)
        return sum((e**k * source(at - k * period) for k in range(int(t / period) + 2)), np.zeros_like(at))

    def twist_a(at: np.ndarray, y: np.ndarray) -> np.ndarray:
        q = 2 * echoes(spin, A, at - (A - y) / (w - V))
        r = -2 * e * echoes(spin, A, at - y / (w + V) - A / (w - V))
        return (q - r) / (2 * w)

    def entering(at: np.ndarray) -> np.ndarray:
        return -2 * w / (w + V) * (V * twist_a(at, np.full_like(at, A)) - spin(at))

    def twist_b(at: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = echoes(entering, B, at - y / (w + V))
        q = -echoes(entering, B, at - B / (w + V) - (B - y) / (w - V))
        return (q - r) / (2 * w)

    now = np.full_like(x, t)
    return np.where(x < A, twist_a(now, np.minimum(x, A)), twist_b(now, np.maximum(x - A, 0)))


@pytest.mark.parametrize("waves", [1.5, 4.0])
def test_twist_waves_converge_at_order_2_in_step_and_cell(waves: float) -> None:
    steps, errors = [], []
    for cells in (16, 32, 64, 128):
        step = A / cells / waves / 1.5
        got = field([0, 0.3, 0.6], waves=waves, spin=smooth_spin, cells=cells, step=step)
        truth = [waves_to_and_fro(t, got.cells_m, waves, smooth_start) for t in (0.3, 0.6)]
        steps.append(step)
        errors.append(float(np.abs(got.twist[1:] - truth).max()))
    assert slope(steps, errors) == pytest.approx(2, abs=0.15)
    assert errors[-1] < 1e-3 * S / V


def test_order_2_in_the_step_alone_while_the_waves_are_shorter_than_it() -> None:
    """Stiff: w = 300 m/s, steps of up to 13 cells' passage; the reference is the same grid at a tenth of the step."""
    truth = field([0, 0.5], waves=300, spin=smooth_spin, cells=16, step=0.0005).twist[-1]
    steps = [0.02, 0.01, 0.005, 0.0025]
    errors = [
        float(np.abs(field([0, 0.5], waves=300, spin=smooth_spin, cells=16, step=h).twist[-1] - truth).max())
        for h in steps
    ]
    assert slope(steps, errors) == pytest.approx(2, abs=0.15)


def test_inertia_fades_to_the_zone_solution() -> None:
    zones = zone_twist(TIMES, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=smooth_spin, max_step_s=0.004)
    waves = [8.0, 16.0, 32.0, 64.0]
    errors = []
    for w in waves:
        got = field(TIMES, waves=w, spin=smooth_spin, cells=16, step=0.004)
        errors.append(float(np.abs(got.twist[:, :16].T - zones.twist_a).max()))
    assert slope([1 / w**2 for w in waves], errors) == pytest.approx(1, abs=0.15)  # in proportion to I
    none = field(TIMES, waves=np.inf, spin=smooth_spin, cells=16, step=0.004)
    np.testing.assert_allclose(none.twist_a, zones.twist_a, atol=1e-9)
    np.testing.assert_allclose(none.twist_b, zones.twist_b, atol=1e-9)
    np.testing.assert_allclose(none.passed, zones.passed, atol=1e-9)


@pytest.mark.parametrize("waves", [0.6, 4.0, 1e3, 1e9, np.inf])
@pytest.mark.parametrize("step", [1e-3, 0.05, 10.0])
def test_turns_change_by_the_ends_alone_and_nothing_blows_up(waves: float, step: float) -> None:
    times = np.linspace(0, max(0.5, 40 * step), 5)
    got = field(times, waves=waves, spin=S, cells=12, step=step, speed=lambda t: V * (0.5 + 0.5 * np.cos(9 * t)))
    turns = got.twist @ np.diff(got.faces_m)
    scale = np.abs(got.passed).max()
    np.testing.assert_allclose(turns, got.passed[:, 0] - got.passed[:, 2], atol=1e-13 * scale)
    in_a = A * got.twist_a
    np.testing.assert_allclose(in_a, got.passed[:, 0] - got.passed[:, 1], atol=1e-13 * scale)
    assert np.abs(got.twist).max() < 2 * (S * times[-1] / B)
    if step < 1:
        assert np.abs(got.twist).max() < 20 * S / V


def test_steady_yarn_turns_as_one_in_zone_a_and_leaves_untwisted() -> None:
    """False twist: T_a = s/V, s the same all along zone a, and nothing left in zone b."""
    got = field([0, 15.0], waves=20.0, spin=S, cells=8, step=0.01)
    np.testing.assert_allclose(got.twist[-1, :8], S / V, rtol=1e-9)
    np.testing.assert_allclose(got.twist[-1, 8:], 0, atol=1e-7)
    np.testing.assert_allclose(got.spin[-1, 1:9], S, rtol=1e-9)


def test_spread_torque_tilts_the_twist() -> None:
    got = twist_field(
        [0, 20.0],
        a_m=A,
        b_m=B,
        speed_m_s=V,
        spin_turns_s=S,
        inertia_kg_m=0,
        stiffness_n_m2=2e-9,
        torque_n=1e-8,
    )
    slopes = np.diff(got.twist[-1, :64]) / np.diff(got.cells_m[:64])
    np.testing.assert_allclose(slopes, -1e-8 / 2e-9, rtol=1e-8)
    assert got.twist[-1, 63] - 0.5 * (A / 64) * 5 == pytest.approx(S / V, rel=1e-9)  # the twister still feeds s/V


def test_angle_is_the_integral_of_twist() -> None:
    x = np.array([-1.0, 0.0, 0.1, A, A + 0.05, A + B, 9.0])
    got = field([0, 0.2, 0.4], waves=np.inf, spin=S, cells=8, step=0.01)
    assert got.angle(x).shape == (3, 7)
    expected = twist_angle(x, a_m=A, b_m=B, twist_a=got.twist_a[:, None], twist_b=got.twist_b[:, None])
    np.testing.assert_allclose(got.angle(x), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"speed_m_s": -0.1}, "cannot run backwards"),
        ({"speed_m_s": lambda t: 0.5 - t}, "cannot run backwards"),
        ({"a_m": 0.0}, "twist.a_m: 0 is not allowed"),
        ({"b_m": float("nan")}, "twist.b_m: nan"),
        ({"spin_turns_s": lambda t: float("inf")}, "twist.spin_turns_s: inf at"),
        ({"times_s": [0, 1, 1]}, "each later than the one before"),
        ({"max_step_s": 0.0}, "twist.max_step_s: 0"),
        ({"max_step_s": 1e-9}, "the limit is 2000000"),
        ({"inertia_kg_m": -1.0}, "twist.inertia_kg_m: -1"),
        ({"inertia_kg_m": 1.0}, "no faster than the yarn"),
        ({"stiffness_n_m2": 0.0}, "twist.stiffness_n_m2: 0"),
        ({"cells": (3, 8)}, "3 cells"),
    ],
)
def test_bad_input_is_refused_in_one_line(change: dict, says: str) -> None:
    good = {"times_s": [0.0, 1.0], "a_m": A, "b_m": B, "speed_m_s": V, "spin_turns_s": S}
    good |= {"inertia_kg_m": 0.0, "stiffness_n_m2": 1e-9, "max_step_s": 0.1}
    arguments = good | change
    with pytest.raises(InputError, match=says) as caught:
        twist_field(arguments.pop("times_s"), **arguments)
    assert "\n" not in str(caught.value)
