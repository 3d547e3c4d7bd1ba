"""Skeleton, skinning and motions: rigid, joined, seamless, soft at the start."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.moving.legs import sole_height
from taichi_cloth.body.moving.motion import MOTIONS, _turns, motion
from taichi_cloth.body.skin.laplacian import cotangent_laplacian
from taichi_cloth.body.skin.skeleton import JOINTS, PARENTS, Pose
from taichi_cloth.ground.errors import InputError


@pytest.fixture(scope="module")
def body():
    return built_in_body(gender="female")


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_bones_move_rigidly_and_stay_joined(body) -> None:
    rng = np.random.default_rng(2)
    moved = body.bone_transforms(Pose(rng.normal(0, 0.5, (20, 3)), rng.normal(0, 0.2, 3)))
    turns = moved[:, :3, :3]
    np.testing.assert_allclose(turns @ np.swapaxes(turns, 1, 2), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    for j, parent in enumerate(PARENTS):
        if parent >= 0:
            point = np.append(body.skeleton.joints[j], 1)
            np.testing.assert_allclose(moved[j] @ point, moved[parent] @ point, atol=1e-12)


def test_skin_at_rest_turned_and_moved(body) -> None:
    np.testing.assert_allclose(body.posed(Pose.rest()), body.vertices, atol=1e-12)
    turn = Rotation.from_rotvec([0.1, 0.7, -0.2])
    whole = body.posed(Pose.of({"pelvis": turn.as_rotvec()}, (0.3, 0.1, 0.2)))
    pelvis = body.skeleton.joints[0]
    np.testing.assert_allclose(whole, turn.apply(body.vertices - pelvis) + pelvis + [0.3, 0.1, 0.2], atol=1e-12)


def test_weights_are_shares_and_stay_in_their_part(body) -> None:
    weights, tall = body.weights, body.stature
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-12)
    arm = [j for j, name in enumerate(JOINTS) if "arm" in name or "hand" in name]
    x, y = np.abs(body.vertices[:, 0]) / tall, body.vertices[:, 1] / tall
    chest = (x < 0.07) & (y > 0.56) & (y < 0.74)
    assert weights[chest][:, arm].sum(1).max() < 0.05
    left = [j for j, name in enumerate(JOINTS) if name.startswith(("thigh_l", "shin_l", "foot_l"))]
    assert weights[(body.vertices[:, 0] < -0.02) & (y < 0.38)][:, left].sum(1).max() < 0.02
    hand = np.linalg.norm(body.vertices - body.skeleton.tips[JOINTS.index("hand_l")], axis=1).argmin()
    assert weights[hand, JOINTS.index("hand_l")] > 0.9


@pytest.mark.parametrize(
    ("joint", "turn"), [("shin_l", (1.05, 0, 0)), ("forearm_l", (-1.05, 0, 0)), ("thigh_l", (-1.05, 0, 0))]
)
def test_a_bend_of_60_degrees_keeps_the_limb_full(body, joint: str, turn: tuple) -> None:
    bent = body.posed(Pose.of({joint: turn}))
    before, after = volume(body.vertices, body.faces), volume(bent, body.faces)
    assert abs(after / before - 1) < 0.02  # linear blending thins a bend; a collapsed one loses over 5 %
    a, b, c = (bent[body.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    assert np.quantile(area / np.linalg.norm(np.cross(b - a, c - a), axis=1), 0.001) > 0.1


def test_laplacian_kills_constants_and_sees_the_area(body) -> None:
    laplacian, mass = cotangent_laplacian(body.vertices, body.faces)
    assert np.abs(laplacian @ np.ones(len(body.vertices))).max() < 1e-9
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    assert mass.sum() == pytest.approx(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("name", MOTIONS)
def test_motion_starts_at_rest_softly_and_has_no_jump(body, name: str) -> None:
    act = motion(name, body.skeleton)
    np.testing.assert_allclose(body.posed(act.pose(0)), body.vertices, atol=1e-12)
    joints = body.skeleton

    def places(time: float) -> np.ndarray:
        moved = joints.transforms(act.pose(time))
        return np.einsum("jab,jb->ja", moved[:, :3, :3], joints.tips) + moved[:, :3, 3]

    assert np.abs(places(0.01) - joints.tips).max() < 1e-5  # rises with the cube of time
    times = np.arange(0, 3.2, 1 / 60)
    path = np.array([places(t) for t in times])
    speed, change = np.diff(path, axis=0) * 60, np.diff(path, 2, axis=0) * 3600
    assert np.linalg.norm(speed, axis=-1).max() < 6.0
    assert np.linalg.norm(change, axis=-1).max() < 90.0  # [m/s²]; a jump of 5 cm in a frame would be 180


@pytest.mark.parametrize("name", ["idle", "turn", "walk", "arms-raised"])
def test_motion_repeats_without_a_seam(body, name: str) -> None:
    act = motion(name, body.skeleton)
    assert act.period is not None
    for time in (2.03, 2.9):
        np.testing.assert_allclose(body.posed(act.pose(time)), body.posed(act.pose(time + act.period)), atol=1e-9)
    fast = motion(name, body.skeleton, speed=2.0)
    assert fast.period == pytest.approx(act.period / 2)


def test_feet_stay_on_the_floor(body) -> None:
    feet = [JOINTS.index("foot_l"), JOINTS.index("foot_r")]
    for name in ("idle", "sit"):
        act = motion(name, body.skeleton)
        for time in (1.3, 3.0, 4.4):
            moved = body.bone_transforms(act.pose(time))[feet]
            np.testing.assert_allclose(moved, np.tile(np.eye(4), (2, 1, 1)), atol=2e-3)


def test_a_walking_body_is_carried_by_the_floor(body) -> None:
    """Its skin, not only its bones: the lower foot is on the floor in each moment, heel, sole or toes. A foot that
    turned as its ankle does and no more would be 30 mm under it as it leaves, and 25 mm over it before."""
    walk = motion("walk", body.skeleton)
    feet = [JOINTS.index("foot_l"), JOINTS.index("foot_r")]
    own = np.isin(np.argmax(body.weights, axis=1), feet)
    assert walk.period is not None
    times = 2 + np.linspace(0, walk.period, 48)
    skin = [body.posed(walk.pose(t))[own, 1].min() for t in times]
    assert min(skin) > -0.003
    assert max(skin) < 0.003
    low = [sole_height(body.skeleton, walk.pose(t)) for t in times]
    assert np.abs(np.array(low) - skin).max() < 0.002
    heights = np.array([walk.pose(t).translation[1] for t in np.linspace(2, 2 + walk.period, 96)])
    assert np.ptp(heights) < 0.06  # it rises and sinks by a few centimetres
    assert np.abs(np.diff(heights, 2)).max() < 0.002  # and not in jolts: under 14 m/s² at 96 a stride


def test_walking_swings_arms_against_legs(body) -> None:
    walk = motion("walk", body.skeleton)
    hand, foot = JOINTS.index("hand_l"), JOINTS.index("foot_l")
    assert walk.period is not None
    z = []
    for time in 2 + np.linspace(0, walk.period, 48, endpoint=False):
        moved = body.bone_transforms(walk.pose(time))
        z.append([(moved[j] @ np.append(body.skeleton.joints[j], 1))[2] for j in (hand, foot)])
    z = np.array(z)
    assert np.corrcoef(z.T)[0, 1] < -0.7
    assert np.ptp(z[:, 1]) > 0.5  # a step's length [m]


def test_bad_motions_and_joints_are_refused(body) -> None:
    with pytest.raises(InputError, match='did you mean "walk"'):
        motion("wlak", body.skeleton)
    with pytest.raises(InputError, match="motion_speed"):
        motion("walk", body.skeleton, speed=0)
    with pytest.raises(InputError, match='did you mean "shin_l"'):
        Pose.of({"shinl": (0, 0, 0)})
    with pytest.raises(InputError, match="joint: unknown"):
        body.skeleton.index("tail")


def test_turns_compose_like_rotation_matrices() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        steps = [(str(rng.choice(list("xyz"))), float(rng.uniform(-170, 170))) for _ in range(3)]
        expected = np.eye(3)
        for axis, degrees in steps:
            expected = Rotation.from_euler(axis, degrees, degrees=True).as_matrix() @ expected
        np.testing.assert_allclose(Rotation.from_rotvec(_turns(*steps)).as_matrix(), expected, atol=1e-12)
    np.testing.assert_array_equal(_turns(("x", 0.0)), 0)
