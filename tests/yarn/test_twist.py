"""Twist of the two zones: the closed form to 1e-9 at its limits, the scheme at its stated order, turns never lost."""

from decimal import Decimal, localcontext
from math import pi

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.twist import transient_twist, twist_angle, zone_twist

A, B, V, S = 0.3, 0.2, 0.5, 60.0


def exact_to_many_digits(t: float, a: float, b: float, v: float, s: float) -> tuple[float, float]:
    """The paper's own formula, or its limit, with 300 digits."""
    with localcontext() as context:
        context.prec = 300
        dt, da, db, dv, ds = (Decimal(x) for x in (t, a, b, v, s))
        if v == 0:
            return float(ds * dt / da), float(-ds * dt / db)
        in_a, in_b = (-dv * dt / da).exp(), (-dv * dt / db).exp()
        twist_a = ds / dv * (1 - in_a)
        if a == b:
            return float(twist_a), float(-ds * dt / da * in_a)
        return float(twist_a), float(-ds / dv * da / (da - db) * (in_a - in_b))


@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-13, 1e-9, -1e-9, 1e-6, 1e-3, 0.5, -0.2, 30.0])
@pytest.mark.parametrize("speed", [0.0, 1e-60, 1e-18, 1e-12, 1e-6, 1e-2, 1.0, 40.0])
@pytest.mark.parametrize("t", [0.0, 1e-9, 1e-3, 1.0, 5.0])
def test_closed_form_keeps_its_digits_everywhere(gap: float, speed: float, t: float) -> None:
    a, b = 0.3, 0.3 * (1 + gap)
    found = transient_twist(t, a_m=a, b_m=b, speed_m_s=speed, spin_turns_s=S)
    assert found == pytest.approx(exact_to_many_digits(t, a, b, speed, S), rel=1e-12, abs=1e-290)


def test_limits_are_the_limit_formulas() -> None:
    t = np.linspace(0, 3, 40)
    twist_a, twist_b = transient_twist(t, a_m=A, b_m=A, speed_m_s=V, spin_turns_s=S)
    np.testing.assert_allclose(twist_b, -(S * t / A) * np.exp(-V * t / A), rtol=1e-14)
    still_a, still_b = transient_twist(t, a_m=A, b_m=B, speed_m_s=0, spin_turns_s=S)
    np.testing.assert_array_equal(still_a, S * t / A)
    np.testing.assert_array_equal(still_b, -S * t / B)
    assert transient_twist(np.inf, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=S) == (S / V, 0.0)
    assert twist_a[-1] < S / V


def test_closed_form_broadcasts_and_keeps_the_sign_of_the_spin() -> None:
    t, a = np.linspace(0, 1, 5)[:, None], np.array([0.1, 0.2, 0.3])
    right = transient_twist(t, a_m=a, b_m=B, speed_m_s=V, spin_turns_s=S)
    left = transient_twist(t, a_m=a, b_m=B, speed_m_s=V, spin_turns_s=-S)
    assert right[0].shape == right[1].shape == (5, 3)
    np.testing.assert_array_equal(right, np.negative(left))


def slope(steps: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


STEPS = [0.04, 0.02, 0.01, 0.005, 0.0025]
TIMES = np.linspace(0, 2, 6)


@pytest.mark.parametrize("b", [B, A, 0.7])
def test_zones_converge_to_the_closed_form_at_order_2(b: float) -> None:
    truth = transient_twist(TIMES, a_m=A, b_m=b, speed_m_s=V, spin_turns_s=S)
    errors = []
    for step in STEPS:
        got = zone_twist(TIMES, a_m=A, b_m=b, speed_m_s=V, spin_turns_s=S, max_step_s=step)
        errors.append(float(np.max(np.abs([got.twist_a - truth[0], got.twist_b - truth[1]]))))
    assert slope(STEPS, errors) == pytest.approx(2, abs=0.15)
    assert errors[-1] < 1e-5 * S / V


def test_varying_drive_converges_at_order_2() -> None:
    def run(step: float) -> np.ndarray:
        got = zone_twist(
            [0, 1.0, 2.0],
            a_m=A,
            b_m=B,
            speed_m_s=lambda t: 0.4 + 0.3 * np.sin(3 * t),
            spin_turns_s=lambda t: 50 * np.cos(2 * t),
            start=(20.0, -5.0),
            max_step_s=step,
        )
        return np.concatenate([got.twist_a, got.twist_b])

    truth = run(0.0002)
    assert slope(STEPS, [float(np.abs(run(h) - truth).max()) for h in STEPS]) == pytest.approx(2, abs=0.15)


def test_default_step_is_accurate() -> None:
    times = [0, 0.1, 4.0]
    got = zone_twist(times, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=S)
    truth = transient_twist(times, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=S)
    np.testing.assert_allclose([got.twist_a, got.twist_b], truth, atol=2e-4 * S / V)


def test_turns_of_the_zones_are_conserved() -> None:
    got = zone_twist(TIMES, a_m=A, b_m=B, speed_m_s=lambda t: 0.5 + 0.4 * np.sin(t), spin_turns_s=S, start=(9, -4))
    turns = A * got.twist_a + B * got.twist_b
    np.testing.assert_allclose(turns - turns[0], -got.passed[:, 2], atol=1e-12)


def test_angle_is_the_integral_of_twist() -> None:
    x = np.array([-1.0, 0.0, 0.1, A, A + 0.05, A + B, 9.0])
    turns = np.array([0, 0, 5, 15, 14, 11, 11])
    np.testing.assert_allclose(twist_angle(x, a_m=A, b_m=B, twist_a=50, twist_b=-20), 2 * pi * turns, atol=1e-12)


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
    ],
)
def test_bad_input_is_refused_in_one_line(change: dict, says: str) -> None:
    good = {"times_s": [0.0, 1.0], "a_m": A, "b_m": B, "speed_m_s": V, "spin_turns_s": S, "max_step_s": 0.1}
    arguments = good | change
    with pytest.raises(InputError, match=says) as caught:
        zone_twist(arguments.pop("times_s"), **arguments)
    assert "\n" not in str(caught.value)


def test_closed_form_refuses_what_has_no_answer() -> None:
    with pytest.raises(InputError, match="cannot run backwards"):
        transient_twist(1.0, a_m=A, b_m=B, speed_m_s=-1.0, spin_turns_s=S)
    with pytest.raises(InputError, match="standing yarn"):
        transient_twist(np.inf, a_m=A, b_m=B, speed_m_s=0.0, spin_turns_s=S)
    with pytest.raises(InputError, match="0 or later"):
        transient_twist(-1.0, a_m=A, b_m=B, speed_m_s=V, spin_turns_s=S)
