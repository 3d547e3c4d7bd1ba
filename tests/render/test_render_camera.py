"""The camera: OpenCV's own projection agrees, and framing keeps everything in the picture."""

import json

import cv2
import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.camera import Camera, box_corners, frame, look_at, orbit

SIZE = {"width": 320, "height": 200}


def cloud(count: int = 400, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 3)) * (0.2, 0.5, 0.1) + (0.3, -1.0, 2.0)


def test_projection_is_opencvs() -> None:
    camera = look_at((0.5, 0.2, 4.0), (0.1, 0.0, 0.0), fov=40, **SIZE)
    points = np.random.default_rng(0).normal(size=(200, 3)) * 0.5
    k = np.array(camera.matrices()["K"])
    expected, _ = cv2.projectPoints(points, cv2.Rodrigues(camera.rotation)[0], camera.translation, k, None)
    assert np.abs(camera.project(points)[:, :2] - expected[:, 0]).max() < 1e-3


def test_axes_are_right_down_forward() -> None:
    camera = look_at((0, 0, 5), (0, 0, 0), **SIZE)
    middle, right, up = camera.project([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    assert middle == pytest.approx((160, 100, 5))
    assert right[0] > 160
    assert up[1] < 100
    assert camera.eye == pytest.approx((0, 0, 5))


@pytest.mark.parametrize("eye", [(0, 3, 0), (0, -3, 0)])
def test_looks_straight_along_up(eye: tuple[float, float, float]) -> None:
    camera = look_at(eye, (0, 0, 0), **SIZE)
    assert camera.project([(0, 0, 0)])[0] == pytest.approx((160, 100, 3))
    assert camera.project([(1, 0, 0)])[0, 0] > 160  # x stays right, from above and from below


def test_field_of_view_spans_the_height() -> None:
    camera = look_at((0, 0, 2), (0, 0, 0), fov=60, **SIZE)
    assert camera.project([(0, 2 * np.tan(np.radians(30)), 0)])[0, 1] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("elevation", [-90, -30, 0, 20, 90])
@pytest.mark.parametrize("width", [100, 800])
def test_frame_is_tight_and_complete(elevation: float, width: int) -> None:
    points = cloud()
    camera = frame(points, width=width, height=200, azimuth=33, elevation=elevation, margin=0.1)
    x, y, z = camera.project(points).T
    inside = [x.min() - 0.1 * width, 0.9 * width - x.max(), y.min() - 20, 180 - y.max()]
    assert min(inside) > -1e-6
    assert min(inside) < 0.5  # one side touches
    assert abs(inside[0] - inside[1]) < 1e-3 or abs(inside[2] - inside[3]) < 1e-3  # and lies in the middle
    assert z.min() > camera.near


def test_frame_leaves_room_for_the_radius() -> None:
    camera = frame([(0, 0, 0)], radius=0.5, margin=0, fov=90, **SIZE)
    assert camera.project([(0, 0, 0)])[0, 2] == pytest.approx(0.5 * np.sqrt(2), rel=1e-5)  # touches the cone


def test_frame_of_a_single_point_and_of_a_box() -> None:
    assert frame([(1, 2, 3)], **SIZE).project([(1, 2, 3)])[0, :2] == pytest.approx((160, 100))
    corners = box_corners((0, 0, 0), (1, 2, 3))
    assert len(np.unique(corners, axis=0)) == 8
    assert (corners.min(axis=0) == 0).all()
    assert corners.max(axis=0) == pytest.approx((1, 2, 3))


@pytest.mark.parametrize("elevation", [0, 25, 90])
def test_orbit_frames_all_views_alike(elevation: float) -> None:
    points = cloud()
    cameras = orbit(points, 7, elevation=elevation, margin=0.05, **SIZE)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    distances = [np.linalg.norm(camera.eye - middle) for camera in cameras]
    assert np.ptp(distances) < 1e-9
    for camera in cameras:
        x, y, _ = camera.project(points).T
        assert x.min() > 0.05 * 320 - 1e-6
        assert x.max() < 0.95 * 320 + 1e-6
        assert y.min() > 0.05 * 200 - 1e-6
        assert y.max() < 0.95 * 200 + 1e-6


def test_orbit_begins_where_frame_looks_from() -> None:
    assert orbit(cloud(), 4, elevation=10, start=40, **SIZE)[0].forward == pytest.approx(
        frame(cloud(), azimuth=40, elevation=10, **SIZE).forward
    )


def test_a_canvas_shows_the_same_view() -> None:
    near = frame(cloud(), azimuth=40, elevation=10, **SIZE)
    fine = near.on_canvas(2)
    assert (fine.width, fine.height) == (640, 2 * near.height)
    assert fine.project(cloud())[:, :2] == pytest.approx(2 * near.project(cloud())[:, :2])
    assert fine.on_canvas(0.5).matrices() == near.matrices()


def test_matrices_are_json() -> None:
    matrices = json.loads(json.dumps(look_at((1, 2, 3), (0, 0, 0), **SIZE).matrices()))
    assert matrices["width"] == 320
    assert np.shape(matrices["R"]) == (3, 3)


def test_bad_cameras_are_refused() -> None:
    with pytest.raises(InputError, match="coincide"):
        look_at((0, 0, 0), (0, 0, 0), **SIZE)
    with pytest.raises(InputError, match="fov"):
        look_at((0, 0, 1), (0, 0, 0), fov=180, **SIZE)
    with pytest.raises(InputError, match="width"):
        look_at((0, 0, 1), (0, 0, 0), width=0, height=10)
    with pytest.raises(InputError, match="NaN"):
        Camera(np.eye(3), np.full(3, np.nan), 1, 0, 0, 1, 1)
    with pytest.raises(InputError, match="rotation"):
        Camera(2 * np.eye(3), np.zeros(3), 1, 0, 0, 1, 1)
    with pytest.raises(InputError, match="finite"):
        frame([(np.nan, 0, 0)], **SIZE)
    with pytest.raises(InputError, match="views"):
        orbit(cloud(), 0, **SIZE)
