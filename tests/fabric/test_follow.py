"""Fibres that follow: rigid under rotation, equal to the plain loop, smooth across key points; crossings between."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_fabric import woven

from taichi_cloth.fabric.crossings import refine_points, refined_mask
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.ground import runtime
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.runtime import Runtime
from taichi_cloth.yarn.yarn import Yarn

UNEVEN = Yarn(count_tex=20, plies=2, twist_per_m=700, singles_twist_per_m=250, unevenness=0.2)
NAMES = ("position", "tangent", "normal", "colour", "radius", "half_length", "openness")


@pytest.fixture(scope="module")
def fabric() -> Fabric:
    return build_fabric(woven(ends=11, picks=9, fibres=3, steps=5, fringe=1.5, yarn=UNEVEN))


@pytest.fixture(scope="module")
def smooth(fabric: Fabric) -> FibreFollower:
    return FibreFollower(fabric)


@pytest.fixture(scope="module")
def paper(fabric: Fabric) -> FibreFollower:
    return FibreFollower(fabric, rule="paper", rest=pose_points(fabric.layout))


def turned(points: np.ndarray, degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Points turned about a slanted axis, and the rotation."""
    axis = np.array([2.0, 1.0, -2.0]) / 3
    cross = np.cross(np.eye(3), axis)
    angle = np.radians(degrees)
    turn = np.eye(3) + np.sin(angle) * cross.T + (1 - np.cos(angle)) * (cross @ cross)
    return points @ turn.T, turn


def thickness(fabric: Fabric) -> float:
    return float(fabric.layout.warp.thickness[0])


def test_equals_the_plain_loop_block_by_block(fabric: Fabric) -> None:
    """Every particle as `Fabric.cloud` lays it, to float32 rounding: 1e-5 of a thread, 1e-5 for directions."""
    points = pose_points(fabric.layout, "roll")
    follower = FibreFollower(fabric, rule="linear")
    follower.follow(points)
    ours, theirs = follower.cloud(), fabric.cloud(points)
    assert follower.particles == fabric.particles
    assert (follower.threads == fabric.threads()).all()
    for name in NAMES:
        scale = thickness(fabric) if name in ("position", "radius", "half_length") else 1.0
        assert getattr(ours, name) == pytest.approx(getattr(theirs, name), abs=1e-5 * max(scale, 1e-3)), name


def test_a_sheet_that_turns_takes_its_fibres_with_it(fabric: Fabric, smooth: FibreFollower) -> None:
    """Offsets from a rigid turn: 1e-5 of the largest coordinate is float32's rounding; demanded of the thread."""
    points = pose_points(fabric.layout, "wave")
    smooth.follow(points)
    before = smooth.cloud()
    there, turn = turned(points.astype(np.float64), 100.0)
    smooth.follow(there)
    after = smooth.cloud()
    extent = float(np.abs(points).max())
    rounding = 4 * np.finfo(np.float32).eps * extent
    assert np.abs(after.position - before.position @ turn.T).max() < 1e-5 * thickness(fabric) + rounding
    for name in ("tangent", "normal"):
        assert getattr(after, name) == pytest.approx(getattr(before, name) @ turn.T, abs=2e-5)


def test_the_papers_rule_loses_the_thickness_of_a_sheet_that_turns(fabric: Fabric, paper: FibreFollower) -> None:
    """Its offsets stay in the world's axes: right at rest, and off by more than half a thread after a quarter turn."""
    points = pose_points(fabric.layout)
    paper.follow(points)
    before = paper.cloud().position
    assert before == pytest.approx(fabric.cloud(points).position, abs=1e-5 * thickness(fabric))
    there, turn = turned(points.astype(np.float64), 90.0)
    paper.follow(there)
    assert np.abs(paper.cloud().position - before @ turn.T).max() > 0.5 * thickness(fabric)


def test_tangents_and_normals_are_of_length_1(fabric: Fabric, smooth: FibreFollower) -> None:
    rng = np.random.default_rng(3)
    rough = pose_points(fabric.layout, "roll") + rng.normal(0, 0.2 * fabric.layout.warp.pitch, (9, 11, 3))
    smooth.follow(rough)
    cloud = smooth.cloud()
    for directions in (cloud.tangent, cloud.normal):
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0, abs=2e-5)


def test_on_a_flat_sheet_all_rules_agree(fabric: Fabric, smooth: FibreFollower, paper: FibreFollower) -> None:
    points = pose_points(fabric.layout)
    smooth.follow(points)
    paper.follow(points)
    assert smooth.cloud().position == pytest.approx(paper.cloud().position, abs=2e-5 * thickness(fabric))


def test_a_yarn_has_no_corner_at_a_key_point(fabric: Fabric) -> None:
    """A sheet round a roll, 12° a crossing, and only the yarns' axes: straight pieces meet at 12°, those of the smooth
    rule turn gradually, the most at the ends of a cubic (12° · 1.5 / 5 particles)."""
    angle = np.radians(12.0) * (np.arange(11) - 5)
    points = pose_points(fabric.layout)
    radius = fabric.layout.warp.pitch / np.radians(12.0)
    points[..., 0], points[..., 1] = radius * np.sin(angle), radius * np.cos(angle)
    axis = replace(fabric, bank=replace(fabric.bank, offset=0 * fabric.bank.offset))
    blocks, worst = fabric.layout.blocks, {}
    pick = np.flatnonzero((blocks.thread == 11 + 4) & (blocks.key0 != blocks.key1))
    for rule in ("smooth", "linear"):
        follower = FibreFollower(axis, rule=rule)
        follower.follow(points)
        course = [follower.cloud().position[fabric.particle_start[b] :][:5] for b in pick]
        step = np.diff(np.concatenate(course), axis=0)
        step /= np.linalg.norm(step, axis=1)[:, None]
        worst[rule] = np.degrees(np.arccos((step[:-1] * step[1:]).sum(1).clip(-1, 1))).max()
    assert worst["linear"] > 5.9  # the corner lies between two particles: half of it on each side
    assert worst["smooth"] < 4.0


def test_blocks_without_their_key_points_are_left_out(fabric: Fabric) -> None:
    present = np.ones((9, 11), bool)
    present[:4, :5] = False
    points = pose_points(fabric.layout, "wave")
    points[~present] = np.nan
    follower = FibreFollower(fabric, present=present)
    follower.follow(points)
    blocks = fabric.layout.blocks
    kept = present.ravel()[blocks.key0] & present.ravel()[blocks.key1]
    assert (follower.kept == np.flatnonzero(kept)).all()
    assert np.isfinite(fetched(follower.groups)).all()
    assert follower.particles == np.diff(fabric.particle_start)[kept].sum()


def test_places_left_over_are_not_drawn(fabric: Fabric, smooth: FibreFollower) -> None:
    points = pose_points(fabric.layout)
    groups = fetched(smooth.follow(points))
    radius = groups[3].ravel()
    assert np.count_nonzero(radius) == smooth.particles < smooth.slots
    place = groups[:3].reshape(3, -1).T
    drawn = place[radius > 0]
    assert (place.min(axis=0) >= drawn.min(axis=0)).all()
    assert (place.max(axis=0) <= drawn.max(axis=0)).all()


def test_wrong_shapes_and_rules_are_refused(fabric: Fabric, smooth: FibreFollower) -> None:
    with pytest.raises(InputError, match="points"):
        smooth.follow(np.zeros((3, 3, 3)))
    with pytest.raises(InputError, match="present"):
        FibreFollower(fabric, present=np.ones((2, 2)))
    with pytest.raises(InputError, match="smooth"):
        FibreFollower(fabric, rule="smoth")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="rest"):
        FibreFollower(fabric, rule="paper")


def test_crossings_go_through_the_key_points_and_keep_a_plane() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(5, 6, 3)).astype(np.float32)
    fine = refine_points(points, None, 4)
    assert fine.shape == (17, 21, 3)
    assert (fine[::4, ::4] == points).all()
    assert (refine_points(points, None, 1) == points).all()
    i, j = np.indices((5, 6))
    plane = np.stack([0.3 * j + 1, 0.1 * i - 2.0, 0.2 * i + 0.5 * j], -1)
    fine = refine_points(plane, None, 5)
    i, j = np.indices((21, 26)) / 5
    assert fine == pytest.approx(np.stack([0.3 * j + 1, 0.1 * i - 2.0, 0.2 * i + 0.5 * j], -1), abs=2e-6)


def test_crossings_have_no_crease_and_err_by_the_third_power() -> None:
    """The slope on either side of a key point agrees; halving the spacing of a wave divides the error by 8 or more."""
    errors = []
    for n in (16, 32):
        x = np.linspace(0, 2 * np.pi, n + 1)
        points = np.zeros((4, n + 1, 3))
        points[..., 0], points[..., 1] = x, np.sin(x)
        fine = refine_points(points, None, 8)[5]
        inside = slice(16, -16)
        errors.append(np.abs(fine[inside, 1] - np.sin(fine[inside, 0])).max())
        steps = np.diff(fine[:, 1])
        jump = np.abs(np.diff(steps))[7::8][1:-1]
        assert jump.max() < 3 * np.abs(np.diff(np.sin(np.linspace(0, 2 * np.pi, 8 * n + 1)), 2)).max()
    assert errors[0] / errors[1] > 7.0


def test_crossings_of_a_mask_lie_between_present_key_points_only() -> None:
    present = np.ones((6, 7), bool)
    present[:3, :3] = False
    points = np.random.default_rng(2).normal(size=(6, 7, 3)).astype(np.float32)
    points[~present] = np.nan
    fine, mask = refine_points(points, present, 3), refined_mask(present, 3)
    assert np.isfinite(fine).all()
    assert (np.abs(fine).sum(-1) > 0).tolist() == mask.tolist()
    assert not mask[:9, :9].any()
    assert mask[9:, :].all()
    assert mask[:, 9:].all()


THREADS = """
import sys
from taichi_cloth.ground import runtime
runtime.start("cpu", threads=int(sys.argv[1]))
sys.path.insert(0, sys.argv[2])
from test_follow import many_blocks
print(many_blocks())
"""


def many_blocks() -> str:
    """Digest of the particles of a fabric of more than 1024 blocks, so that two threads share them."""
    fabric = build_fabric(woven(ends=41, picks=41, fibres=2, steps=4, fringe=1.0))
    assert len(fabric.layout.blocks.kind) > 1024
    coarse = np.random.default_rng(5).normal(size=(11, 11, 3))
    groups = FibreFollower(fabric).follow(refine_points(coarse, None, 4))
    return hashlib.sha256(fetched(groups).tobytes()).hexdigest()


def test_the_same_bytes_with_one_thread_and_two(taichi_runtime: Runtime) -> None:
    """Here, and in a process of its own, as Taichi starts anew: with one thread, unless that is all there are here."""
    if not runtime.on_host():
        pytest.skip("of threads of a CPU")
    other = 1 if taichi_runtime.threads > 1 else 2
    command = [sys.executable, "-P", "-c", THREADS, str(other), str(Path(__file__).parent)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said.split() == [many_blocks()]
