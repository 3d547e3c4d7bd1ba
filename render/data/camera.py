"""A pinhole camera in OpenCV's convention, and how to place one so that everything is in the picture."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["Camera", "box_corners", "direction_from_angles", "frame", "look_at", "orbit"]

MAX_PIXELS = 16384
"""Widest and highest image [px]."""

AT_ONCE = 1 << 14
"""Points that are gone through at once: what is reckoned of them stays near the processor."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Camera axes: x right, y down, z forward. A world point p is at `rotation @ p + translation` and lands
    on pixel (focal * x / z + cx, focal * y / z + cy); pixel i covers [i, i + 1), its centre is i + 0.5.

    Raises InputError when a value is not finite, the rotation is none, or the size is outside 1..16384 px.
    """

    rotation: NDArray[np.float64]
    """World to camera, shape (3, 3)."""
    translation: NDArray[np.float64]
    """World to camera [m], shape (3,)."""
    focal: float
    """Focal length [px]."""
    cx: float
    """Principal point, x [px]."""
    cy: float
    """Principal point, y [px]."""
    width: int
    """Image width [px]."""
    height: int
    """Image height [px]."""
    near: float = 1e-3
    """Particles whose centre is nearer than this [m], or behind, are not drawn."""

    def __post_init__(self) -> None:
        rotation = np.asarray(self.rotation, np.float64)
        translation = np.asarray(self.translation, np.float64)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise InputError(
                f"camera: rotation {rotation.shape}, translation {translation.shape}; allowed: (3, 3) and (3,)"
            )
        numbers = (self.focal, self.cx, self.cy, self.near)
        if not (np.isfinite(rotation).all() and np.isfinite(translation).all() and np.isfinite(numbers).all()):
            raise InputError("camera: a value is NaN or infinite; check eye, target and field of view")
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
            raise InputError("camera.rotation: not a rotation; allowed: orthonormal rows, determinant +1")
        if self.focal <= 0 or self.near <= 0:
            raise InputError(f"camera: focal {self.focal:g}, near {self.near:g}; allowed: above 0")
        check_size(self.width, self.height)

    @property
    def eye(self) -> NDArray[np.float64]:
        """Position of the camera [m], world, shape (3,)."""
        return -self.rotation.T @ self.translation

    @property
    def forward(self) -> NDArray[np.float64]:
        """Unit viewing direction, world, shape (3,)."""
        return self.rotation[2]

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Pixel x, pixel y and depth z [px, px, m] of world points (n, 3), shape (n, 3); as cv2.projectPoints.

        Points behind the camera get a depth below 0 and meaningless pixels.
        """
        at = np.asarray(points, np.float64) @ self.rotation.T + self.translation
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = self.focal * at[:, :2] / at[:, 2:] + (self.cx, self.cy)
        return np.column_stack([pixels, at[:, 2]])

    def on_canvas(self, by: float) -> "Camera":
        """The same view with `by` pixels for one along each side, or fewer where below 1."""
        size = {name: round(by * getattr(self, name)) for name in ("width", "height")}
        return replace(self, focal=by * self.focal, cx=by * self.cx, cy=by * self.cy, **size)

    def matrices(self) -> dict[str, Any]:
        """The camera as plain lists and numbers for JSON: intrinsic K (3, 3), rotation R, translation t, size."""
        return {
            "convention": "OpenCV: x right, y down, z forward; pixel centres at i + 0.5",
            "K": [[self.focal, 0.0, self.cx], [0.0, self.focal, self.cy], [0.0, 0.0, 1.0]],
            "R": self.rotation.tolist(),
            "t": self.translation.tolist(),
            "width": self.width,
            "height": self.height,
        }


def check_size(width: int, height: int) -> None:
    """Raises InputError when an image of this size [px] cannot be drawn."""
    for name, size in (("width", width), ("height", height)):
        if not isinstance(size, (int, np.integer)) or not 1 <= size <= MAX_PIXELS:
            raise InputError(f"image {name}: {size!r}; allowed: whole pixels from 1 to {MAX_PIXELS}")


def look_at(
    eye: ArrayLike,
    target: ArrayLike,
    *,
    width: int,
    height: int,
    fov: float = 30.0,
    up: ArrayLike = (0.0, 1.0, 0.0),
    near: float = 1e-3,
) -> Camera:
    """A camera at `eye` [m] that looks at `target` [m].

    fov: angle seen over the image's height [degrees]. up: world direction that points up in the image; when
    the camera looks along it, -z (or +z from below) is up instead, as on a map.
    Raises InputError when eye and target coincide or the angle is outside 0..180.
    """
    eye, target = np.asarray(eye, np.float64), np.asarray(target, np.float64)
    away = target - eye
    distance = float(np.linalg.norm(away))
    if not distance > 0:
        raise InputError(f"look_at: eye {eye.tolist()} and target coincide; move one of them")
    rotation = _facing(away / distance, np.asarray(up, np.float64))
    return Camera(
        rotation=rotation,
        translation=-rotation @ eye,
        focal=_focal(fov, height),
        cx=width / 2,
        cy=height / 2,
        width=width,
        height=height,
        near=near,
    )


def direction_from_angles(azimuth: float, elevation: float) -> NDArray[np.float64]:
    """Unit direction from the subject to the camera, shape (3,), from two angles [degrees].

    azimuth: 0 is from +z, 90 from +x. elevation: 0 is level, 90 straight from above.
    """
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


def box_corners(low: ArrayLike, high: ArrayLike) -> NDArray[np.float64]:
    """The eight corners (8, 3) of the box from `low` to `high` (3,), for `frame` and `orbit`."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    pick = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)], bool)
    return np.where(pick, high, low)


def frame(
    points: ArrayLike,
    *,
    width: int,
    height: int,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    fov: float = 30.0,
    margin: float = 0.05,
    radius: float = 0.0,
) -> Camera:
    """The nearest camera from this side that sees all of `points` (n, 3) [m], centred.

    azimuth, elevation: as in `direction_from_angles`. margin: share of the width and height left free on each
    side. radius: how far things reach around each point [m]. Points that are not finite are ignored.

    A point (x, y, z) in the camera's axes is inside when |x - x0| <= k (z - z0) with k = tan(half angle). Each
    side of the picture is one linear bound on the camera's place (x0, z0), so the nearest place is closed form.
    Raises InputError when no point is finite.
    """
    forward = -direction_from_angles(azimuth, elevation)
    rotation = _facing(forward, np.array([0.0, 1.0, 0.0]))
    at = _finite(points).astype(np.float64, copy=False) @ rotation.T
    if not 0 <= margin < 0.5:
        raise InputError(f"margin: {margin:g}; allowed: from 0 to below 0.5 of the image")
    focal = _focal(fov, height)
    place = np.zeros(3)
    depth = [at[:, 2].min() - radius]  # the camera stays in front of everything
    for axis, size in ((0, width), (1, height)):
        k = size * (0.5 - margin) / focal
        reach = radius * np.hypot(1.0, k)
        right = float((at[:, axis] - k * at[:, 2]).max()) + reach
        left = float((-at[:, axis] - k * at[:, 2]).max()) + reach
        place[axis] = (right - left) / 2
        depth.append(-(right + left) / (2 * k))
    extent = float(np.ptp(at, axis=0).max()) + 2 * radius
    place[2] = min(depth) - 1e-6 * extent - (1e-3 if extent == 0 else 0.0)
    near = min(1e-3, 0.1 * max(float(at[:, 2].min()) - radius - place[2], 1e-6))
    return Camera(
        rotation=rotation,
        translation=-place,
        focal=focal,
        cx=width / 2,
        cy=height / 2,
        width=width,
        height=height,
        near=near,
    )


def orbit(
    points: ArrayLike,
    count: int,
    *,
    width: int,
    height: int,
    elevation: float = 7.0,
    start: float = 0.0,
    fov: float = 30.0,
    margin: float = 0.05,
    radius: float = 0.0,
) -> tuple[Camera, ...]:
    """`count` cameras evenly round the vertical axis through the middle of `points` (n, 3) [m].

    All have the same distance, height and lens, and every point stays inside the margin from every azimuth,
    also between the views: what is framed is the body of revolution that holds all points.
    start: azimuth of the first view [degrees]. The other options are those of `frame`.
    Raises InputError when no point is finite or `count` is below 1.
    """
    if count < 1:
        raise InputError(f"orbit: {count} views; allowed: 1 or more")
    at = _finite(points)
    middle = (at.min(axis=0).astype(np.float64) + at.max(axis=0)) / 2
    rings = _rings(at, middle)
    options: dict[str, Any] = {"width": width, "height": height, "fov": fov, "margin": margin, "radius": radius}
    cameras = []
    for k in range(count):
        camera = frame(rings, azimuth=0.0, elevation=elevation, **options)
        turn = np.radians(start + 360.0 * k / count)
        spin = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        rotation = camera.rotation @ spin.T
        eye = spin @ camera.eye + middle
        cameras.append(
            Camera(
                rotation=rotation,
                translation=-rotation @ eye,
                focal=camera.focal,
                cx=camera.cx,
                cy=camera.cy,
                width=width,
                height=height,
                near=camera.near,
            )
        )
    return tuple(cameras)


def _rings(points: NDArray[Any], middle: NDArray[np.float64], bands: int = 128, sides: int = 64) -> NDArray[np.float64]:
    """Points about `middle` (3,) whose convex hull holds `points` (n, 3) turned by any angle about y through it."""
    low, high = points[:, 1].min() - middle[1], points[:, 1].max() - middle[1]
    edges = np.linspace(low, high, bands + 1)
    widest = np.full(bands, -1.0)
    for first in range(0, len(points), AT_ONCE):
        x, y, z = points[first : first + AT_ONCE].T - middle[:, None]
        band = np.clip(((y - low) * (bands / max(high - low, 1e-30))).astype(int), 0, bands - 1)
        np.maximum.at(widest, band, np.hypot(x, z))
    used = widest >= 0
    circle = 2 * np.pi * np.arange(sides) / sides
    outer = np.repeat(widest[used], 2) / np.cos(np.pi / sides)  # the polygon is drawn round the circle
    level = np.stack([edges[:-1][used], edges[1:][used]], 1).ravel()
    rings = np.empty((len(outer), sides, 3))
    rings[..., 0] = outer[:, None] * np.sin(circle)
    rings[..., 1] = level[:, None]
    rings[..., 2] = outer[:, None] * np.cos(circle)
    return rings.reshape(-1, 3)


def _facing(forward: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """World to camera rotation (3, 3) that looks along the unit vector `forward`."""
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6 * max(np.linalg.norm(up), 1e-30):
        right = np.cross(forward, [0.0, 0.0, -1.0 if forward[1] <= 0 else 1.0])
    if np.linalg.norm(right) < 1e-6:  # forward is along z too: up was not y
        right = np.array([1.0, 0.0, 0.0])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def _focal(fov: float, height: int) -> float:
    if not 0 < fov < 180:
        raise InputError(f"fov: {fov:g} degrees; allowed: above 0 and below 180")
    return height / 2 / np.tan(np.radians(fov) / 2)


def _finite(points: ArrayLike) -> NDArray[Any]:
    """Those of (n, 3) that are, as floats of the width they have; the array itself where all are."""
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points: shape {points.shape}; allowed: (n, 3)")
    if points.dtype not in (np.float32, np.float64):
        points = points.astype(np.float64)
    if not np.isfinite(points.sum()):  # a sum is finite only of numbers that are
        points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise InputError("points: none has finite coordinates; nothing to frame")
    return points
