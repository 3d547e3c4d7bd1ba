"""Motions of SMPL's: what a T pose, a heading and a step mean to our skeleton; files that are none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.moving.captured import leg_length
from taichi_cloth.body.moving.smpl import LEG, smpl_motion
from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton
from taichi_cloth.ground.errors import InputError

L_KNEE, L_SHOULDER = 4, 16
SHIN, FOOT, ARM, FOREARM = (JOINTS.index(name) for name in ("shin_l", "foot_l", "upper_arm_l", "forearm_l"))


@pytest.fixture(scope="module")
def skeleton() -> Skeleton:
    return built_in_body(gender="female").skeleton


def written(path: Path, poses: Any, **more: Any) -> Path:
    np.savez(path, **{"poses": poses, "mocap_framerate": 20.0} | more)  # pyright: ignore[reportArgumentType]
    return path


def places(skeleton: Skeleton, pose: Any) -> np.ndarray:
    moved = skeleton.transforms(pose)
    return np.einsum("jab,jb->ja", moved[:, :3, :3], skeleton.joints) + moved[:, :3, 3]


def direction(at: np.ndarray, start: int, end: int) -> np.ndarray:
    return (at[end] - at[start]) / np.linalg.norm(at[end] - at[start])


@pytest.mark.parametrize("width", [72, 156, 165])
def test_its_rest_is_a_t_pose_on_the_floor(skeleton: Skeleton, tmp_path: Path, width: int) -> None:
    act = smpl_motion(written(tmp_path / "t.npz", np.zeros((2, width))), skeleton)
    at = places(skeleton, act.pose(2.0))
    assert direction(at, ARM, FOREARM) @ [1, 0, 0] > 0.99
    assert direction(at, SHIN, FOOT) @ [0, -1, 0] > 0.99
    assert at[FOOT, 1] == pytest.approx(skeleton.joints[FOOT, 1], abs=0.01)


def test_who_walks_in_a_world_with_z_up_walks_forward_here(skeleton: Skeleton, tmp_path: Path) -> None:
    """Half a metre on, with the left knee bent by a right angle, headed anywhere; frames between two are half-way."""
    heading = Rotation.from_rotvec([0, 0, 0.7])
    stands = heading * Rotation.from_rotvec([np.pi / 2, 0, 0])
    poses = np.zeros((3, 72))
    poses[:, :3] = stands.as_rotvec()
    poses[1:, 3 * L_KNEE] = np.pi / 2
    ahead = stands.apply([0, 0, 1])
    way = [3.0, 4.0, 0.9] + np.array([0.0, 0.5, 0.5])[:, None] * ahead
    act = smpl_motion(written(tmp_path / "walk.npz", poses, trans=way), skeleton, blend_in=1e-3)
    first, half, last = (act.cycle(time) for time in (0.0, 0.025, 0.05))
    scale = leg_length(skeleton.joints, "ours") / LEG
    np.testing.assert_allclose(last.translation - first.translation, [0, 0, 0.5 * scale], atol=1e-9)
    np.testing.assert_allclose(half.translation - first.translation, [0, 0, 0.25 * scale], atol=1e-9)
    turned = skeleton.transforms(last)[:, :3, :3] @ np.swapaxes(skeleton.transforms(first)[:, :3, :3], 1, 2)
    np.testing.assert_allclose(turned[SHIN], Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(turned[ARM], np.eye(3), atol=1e-9)
    assert skeleton.transforms(first)[0, :3, 2] @ [0, 0, 1] > 0.99, "it looks forward"


def test_an_arm_goes_with_what_carries_it(skeleton: Skeleton, tmp_path: Path) -> None:
    """Arm lowered by 60° from the T, and the spine turned: the forearm is turned by both."""
    poses = np.zeros((2, 72))
    poses[:, 3 * L_SHOULDER + 2] = -np.pi / 3
    down = smpl_motion(written(tmp_path / "down.npz", poses), skeleton)
    at = places(skeleton, down.pose(2.0))
    assert direction(at, ARM, FOREARM) @ [0.5, -np.sqrt(0.75), 0] > 0.99
    poses[:, 3 * 3 + 1] = np.pi / 2
    turned = smpl_motion(written(tmp_path / "turned.npz", poses), skeleton)
    assert direction(places(skeleton, turned.pose(2.0)), ARM, FOREARM) @ [0, -np.sqrt(0.75), -0.5] > 0.99


@pytest.mark.parametrize(
    ("held", "match"),
    [
        ({"poses": np.zeros((2, 30))}, "poses of shape"),
        ({"poses": np.full((2, 72), np.nan)}, "not numbers"),
        ({"poses": np.array([["a"] * 72])}, "not numbers"),
        ({"trans": np.zeros((3, 3))}, "as many as poses"),
        ({"mocap_framerate": 0.0}, "0.1 to 10,000"),
        ({"trans": np.array([[0, 0, 0], [0, 0, 900.0]])}, "goes .* far"),
    ],
)
def test_what_is_no_motion_is_refused_in_one_line(
    skeleton: Skeleton, tmp_path: Path, held: dict[str, Any], match: str
) -> None:
    with pytest.raises(InputError, match=match) as error:
        smpl_motion(written(tmp_path / "x.npz", **{"poses": np.zeros((2, 72))} | held), skeleton)
    assert "\n" not in str(error.value)


def test_files_that_are_none_are_refused_in_one_line(skeleton: Skeleton, tmp_path: Path) -> None:
    np.savez(tmp_path / "shape.npz", betas=np.zeros(10))
    np.savez(tmp_path / "rate.npz", poses=np.zeros((2, 72)))
    (tmp_path / "words.npz").write_text("a poem")
    (tmp_path / "cut.npz").write_bytes((tmp_path / "rate.npz").read_bytes()[:300])
    np.savez(tmp_path / "object.npz", poses=np.array([{}], object))
    for name, match in (
        ("shape.npz", "no poses among betas"),
        ("rate.npz", "no frames a second among poses"),
        ("words.npz", "cannot be read"),
        ("cut.npz", "cannot be read"),
        ("object.npz", "cannot be read"),
        ("absent.npz", "cannot be read"),
    ):
        with pytest.raises(InputError, match=match) as error:
            smpl_motion(tmp_path / name, skeleton)
        assert "\n" not in str(error.value)
