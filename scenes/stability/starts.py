"""Starts of a sheet that no one would wish for: where it is, how fast, and what is done to it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.motion.forces import Forces, Plane, Sphere, Wind
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["FREE", "STARTS", "WORKING", "pins_of", "start_of"]

F64 = NDArray[np.float64]
PLACES: dict[str, Callable[[F64, np.random.Generator], F64]] = {
    "held": lambda flat, _: flat,
    "point": lambda flat, _: 0.0 * flat,
    "line": lambda flat, _: flat * [1.0, 0.0, 0.0],
    "shuffled": lambda flat, rng: rng.permutation(flat.reshape(-1, 3)).reshape(flat.shape),
    "crumpled": lambda flat, rng: flat.mean((0, 1)) + 0.1 * np.ptp(flat) * rng.standard_normal(flat.shape),
    "stretched": lambda flat, _: 10.0 * flat,
    "inverted": lambda flat, _: -flat,
    "inside out": lambda flat, _: flat[:, ::-1],
    "folded": lambda flat, _: np.abs(flat - flat.mean((0, 1))),
    "twisted": lambda flat, _: _twisted(flat),
    "dropped": lambda flat, _: flat + np.array([0.0, 10.0, 0.0]),
}
"""Key points (rows, cols, 3) [m] from those of a sheet that lies level, held along its first row, at y = 0. What is not
here starts from there."""

FORCES: dict[str, Callable[[], Forces]] = {
    "dropped": lambda: Forces(sphere=BALL, plane=FLOOR),
    "thrown": lambda: Forces(sphere=BALL, plane=FLOOR),
    "teleport": lambda: Forces(plane=FLOOR, body=_jumping()),
    "wind": lambda: Forces(wind=Wind(velocity=(60.0, 0.0, 80.0), gusts=0.2)),
}
STARTS = (
    *PLACES, *(name for name in FORCES if name not in PLACES), "pulled", "no rest length", "no mass",
)  # fmt: skip
FREE = ("dropped", "thrown", "teleport")
"""Starts of a sheet that nothing holds."""

WORKING = ("teleport", "wind", "pulled")
"""Starts in which something outside does work, so that energy tells nothing."""

THROWN = (0.0, -50.0, 0.0)  # [m/s]
FLOOR = Plane(height=-0.5)
BALL = Sphere(centre=(0.14, -0.3, 0.16), radius=0.1)


def start_of(name: str, sheet: Sheet) -> tuple[F64, tuple[float, float, float], Forces]:
    """Positions [m], velocities [m/s] and forces. Pinned key points lie where they do in the level sheet."""
    u, v = sheet.flat()[..., 0], sheet.flat()[..., 1]
    flat = np.stack([u, 0.0 * u, v], axis=-1)
    rng = np.random.Generator(np.random.Philox(key=7))
    x = np.array(PLACES[name](flat, rng)) if name in PLACES else flat.copy()
    x[sheet.pinned] = flat[sheet.pinned]
    return x, THROWN if name == "thrown" else (0.0, 0.0, 0.0), FORCES[name]() if name in FORCES else Forces()


def pins_of(name: str, sheet: Sheet, start: F64) -> tuple[Pins, ...]:
    """Held still; where the sheet is pulled the last row moves away by a fifth of its length within two seconds."""
    if name != "pulled":
        return (Pins(sheet.pinned),)
    first, last = sheet.pinned.copy(), sheet.pinned.copy()
    first[-1], last[0] = False, False
    away = 0.2 * (start[-1] - start[0])
    return Pins(first), Pins(last, lambda time: start[-1] + min(time / 2, 1.0) * away)


def _twisted(flat: F64) -> F64:
    """Ten turns about the middle of its width."""
    side = float(flat[..., 0].max())
    across, turn = flat[..., 0] - side / 2, 20 * np.pi * flat[..., 2] / side
    return np.stack([side / 2 + across * np.cos(turn), across * np.sin(turn), flat[..., 2]], axis=-1)


def _jumping() -> Colliders:
    """A ball under the sheet that is somewhere else every half second."""
    places = np.random.Generator(np.random.Philox(key=11)).uniform(-0.3, 0.3, (16, 3))

    def motion(seconds: float) -> F64:
        out = np.eye(4)[None].copy()
        out[0, :3, 3] = places[int(seconds / 0.5) % 16]
        return out

    centre = np.array([0.15, -0.11, 0.15])
    ball = Primitive(kind="sphere", start=centre, end=centre, radii=(0.1, 0.1))
    return Colliders(primitives=(ball,), motion=motion, name="jumping")
