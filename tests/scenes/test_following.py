"""The camera of an animation goes with a body that walks away, and stands still for any other."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.body.moving.motion import MOTIONS, Motion, motion
from taichi_cloth.body.skin.skeleton import Pose
from taichi_cloth.render.data.camera import frame
from taichi_cloth.scenes.models.following import AWAY, camera_path
from taichi_cloth.scenes.models.garment_model import box_round
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body

FRAMES, FPS = 150, 30.0


@pytest.fixture(scope="module")
def body():
    return prepare_body(BodySection(gender="female"))


def walker(body, speed: float = 1.3, turn_deg: float = 20.0) -> Motion:
    """Walks off at a speed [m/s], a quarter to its left, from rest within a second."""
    spot = motion("walk", body.skeleton)
    way = speed * np.array([np.sin(np.radians(turn_deg)), 0.0, np.cos(np.radians(turn_deg))])

    def cycle(time: float) -> Pose:
        pose = spot.cycle(time)
        return Pose(pose.rotations, pose.translation + way * time)

    return Motion("walks-off", cycle, None)


def seen(body, moves: Motion, path: np.ndarray) -> np.ndarray:
    """For each tenth frame, how far the trunk's skin reaches from the middle of the picture, in half pictures."""
    names = body.skeleton.names
    trunk = np.isin(np.argmax(body.weights, axis=1), [names.index(n) for n in ("pelvis", "spine1", "spine2", "spine3")])
    bounds = box_round(body.vertices[trunk])
    out = []
    for k in range(0, FRAMES, 10):
        camera = frame(bounds + path[k], width=640, height=480, azimuth=25, elevation=8, fov=24, margin=0.03)
        at = camera.project(body.posed(moves.pose(k / FPS))[trunk])
        out.append(np.abs(at[:, :2] / [640, 480] * 2 - 1).max() if (at[:, 2] > 0).all() else np.inf)
    return np.array(out)


def test_a_walker_stays_in_the_picture(body):
    moves = walker(body)
    path = camera_path(moves, FRAMES, FPS)
    assert seen(body, moves, path).max() < 1.0
    standing = seen(body, moves, np.zeros((FRAMES, 3)))
    assert standing[2:].max() > 1.0  # without it, it is gone


def test_the_camera_begins_where_it_stood_and_does_not_shake(body):
    moves = walker(body)
    path = camera_path(moves, FRAMES, FPS)
    assert np.abs(path[0]).max() < 1e-9
    assert np.linalg.norm(path[-1]) > 4
    own = np.array([moves.pose(k / FPS).translation for k in range(FRAMES)]) * [1, 0, 1]
    jolt = FPS**2 * np.linalg.norm(np.diff(path, 2, axis=0), axis=1)  # m/s²
    of_body = FPS**2 * np.linalg.norm(np.diff(own, 2, axis=0), axis=1)
    assert jolt[:45].max() < of_body[:45].max()  # as it sets off
    assert jolt[60:].max() < 0.3 * of_body[60:].max()  # of each stride's sway a quarter is left
    assert np.abs(path[:, 1]).max() == 0  # steps do not lift it


@pytest.mark.parametrize("name", MOTIONS)
def test_who_stays_is_seen_from_one_place(body, name):
    assert not camera_path(motion(name, body.skeleton), FRAMES, FPS).any()


def test_it_can_be_asked_for_and_left_out(body):
    assert not camera_path(walker(body), FRAMES, FPS, wanted=False).any()
    sits = motion("sit", body.skeleton)
    assert np.abs(camera_path(sits, FRAMES, FPS, wanted=True)).max() > 0.2
    short = walker(body, speed=0.9 * AWAY / (FRAMES / FPS))
    assert not camera_path(short, FRAMES, FPS).any()
    late = replace(walker(body), start=2.0)
    assert np.abs(camera_path(late, FRAMES, FPS)[:20]).max() < 1e-9
