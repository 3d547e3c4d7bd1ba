"""A yarn being twisted: particles turn about the axis by what the twist in front of them has grown."""

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.twist import transient_twist, twist_angle
from taichi_cloth.yarn.twisting import TwistingYarn
from taichi_cloth.yarn.yarn import Yarn

A, B, FEED = 6e-3, 4e-3, 1e-3


def machine(*, speed: float = 4e-3, spin: float = 2.0, construction: str = "fibres", plies: int = 2) -> TwistingYarn:
    return TwistingYarn(
        Yarn(count_tex=60, plies=plies, migration=0.0),
        a=A,
        b=B,
        speed=speed,
        spin_speed=spin,
        duration=3.0,
        feed=FEED,
        fibres=6,
        construction=construction,
        colours=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        seed=2,
    )


def angles(yarn: TwistingYarn, ply: int) -> tuple[np.ndarray, np.ndarray]:
    """x and the angle about the axis of one ply's middle, in slices along the yarn."""
    mine = yarn.colour[:, ply] > 0.5
    p = yarn.position[mine].astype(np.float64)
    edges = np.linspace(-FEED, A + B + FEED, 200)
    slot = np.digitize(p[:, 0], edges)
    used = [k for k in range(1, len(edges)) if np.any(slot == k)]
    middle = np.array([p[slot == k].mean(axis=0) for k in used])
    return middle[:, 0], np.unwrap(np.arctan2(middle[:, 2], middle[:, 1]))


@pytest.mark.parametrize("construction", ["fibres", "lattice"])
def test_no_twist_before_the_twister_turns(construction: str):
    yarn = machine(construction=construction)
    assert yarn.twist == (0.0, 0.0)
    for ply in (0, 1):
        x, angle = angles(yarn, ply)
        assert abs(np.polyfit(x, angle, 1)[0]) * (A + B) < 0.25


@pytest.mark.parametrize("speed", [0.0, 4e-3])
def test_helix_is_the_closed_form_one(speed: float):
    """After the run the ply's angle along x is φ(x) of the closed-form twist, between A and C."""
    yarn = machine(speed=speed)
    yarn.step_to(3.0)
    twist_a, twist_b = transient_twist(3.0, a_m=A, b_m=B, speed_m_s=speed, spin_turns_s=2.0)
    assert yarn.twist == pytest.approx((float(twist_a), float(twist_b)), rel=1e-3)
    x, angle = angles(yarn, 0)
    inside = (x > 0) & (x < A + B)
    wanted = twist_angle(x[inside], a_m=A, b_m=B, twist_a=twist_a, twist_b=twist_b)
    error = angle[inside] - wanted
    error -= 2 * np.pi * np.rint(error.mean() / (2 * np.pi))
    assert np.abs(error).max() < 0.12


def test_particles_are_shared_evenly_and_keep_their_distance_from_the_axis():
    for construction in ("fibres", "lattice"):
        yarn = machine(construction=construction, plies=2)
        shares = (yarn.colour[:, 0] > yarn.colour[:, 1]).mean()
        assert shares == pytest.approx(0.5, abs=0.001)
        before = np.hypot(yarn.position[:, 1], yarn.position[:, 2])
        yarn.step_to(2.0)
        after = np.hypot(yarn.position[:, 1], yarn.position[:, 2])
        np.testing.assert_allclose(after, before, rtol=2e-4, atol=1e-9)


def test_the_yarn_is_carried_along_at_its_speed():
    yarn = machine(speed=4e-3)
    before = yarn.position[:, 0].astype(np.float64)
    yarn.step_to(1.5)
    np.testing.assert_allclose(yarn.position[:, 0] - before, 4e-3 * yarn.time, atol=3e-7)


def test_tangents_follow_the_helix():
    yarn = machine(speed=0.0)
    yarn.step_to(3.0)
    cloud = yarn.cloud()
    np.testing.assert_allclose(np.linalg.norm(cloud.tangent, axis=1), 1.0, atol=1e-5)
    in_a = (cloud.position[:, 0] > 0.2 * A) & (cloud.position[:, 0] < 0.9 * A)
    r = np.hypot(cloud.position[in_a, 1], cloud.position[in_a, 2])
    slope = 2 * np.pi * yarn.twist[0] * r
    np.testing.assert_allclose(np.abs(cloud.tangent[in_a, 0]), 1 / np.sqrt(1 + slope**2), atol=2e-3)


def test_s_turns_the_other_way():
    z, s = machine(spin=2.0), machine(spin=-2.0)
    z.step_to(1.0)
    s.step_to(1.0)
    assert z.twist[0] == pytest.approx(-s.twist[0])


def test_steps_do_not_depend_on_where_they_stop():
    once, often = machine(), machine()
    once.step_to(2.0)
    for t in np.linspace(0.0, 2.0, 9):
        often.step_to(float(t))
    assert once.position.tobytes() == often.position.tobytes()


def test_never_backwards_nor_beyond_the_end():
    yarn = machine()
    yarn.step_to(1.0)
    for t in (0.5, 4.0):
        with pytest.raises(InputError, match="cannot step to"):
            yarn.step_to(t)
