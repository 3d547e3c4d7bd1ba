"""How much wider and brighter the particles of a thinned block must be: measured on the fabric itself."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.blocks import Fabric
from taichi_cloth.streaming import FabricStream

from ..render.camera import Camera, frame
from ..render.splat import Splatter
from ..render.stream import stream

__all__ = ["fit_gains", "seen_at"]

SIZE = 320, 192
LEVELS = 4
ROUNDS = 5
MOST_PARTICLES = 4e6
"""A larger fabric keeps gains of 1: measuring it would take longer than the picture."""


def fit_gains(fabric: Fabric, points: NDArray, *, target: float = 0.5) -> NDArray[np.float64]:
    """(LEVELS, 2) gains of radius and colour at λ = 1, 1/4, …, by which the cloth, seen from above at the distance
    where that share is drawn, has the coverage and the brightness of all its particles. The first row is 1."""
    gains = np.ones((LEVELS, 2))
    if fabric.particles > MOST_PARTICLES:
        return gains
    splatter = Splatter(*SIZE)
    for level in range(1, LEVELS):
        camera = seen_at(fabric, points, target * 0.5**level)
        want = _sums(splatter, camera, FabricStream(fabric, points, target=0.0))
        gains[level] = gains[level - 1]
        for _ in range(ROUNDS):
            ladder = np.concatenate([gains[:level], np.tile(gains[level], (2, 1))])
            got = _sums(splatter, camera, FabricStream(fabric, points, target=target, gains=ladder))
            cover, light = want[3] / got[3], want[:3].sum() / got[:3].sum()
            gains[level] *= (np.clip(cover, 0.8, 1.25) ** 1.5, np.clip(light / cover, 0.8, 1.25))
        gains[level + 1 :] = gains[level]
    return gains


def seen_at(fabric: Fabric, points: NDArray, pixels: float) -> Camera:
    """From above at 60°, where the mean radius of a particle is `pixels`."""
    flat = np.asarray(points).reshape(-1, 3)
    camera = frame(flat, width=SIZE[0], height=SIZE[1], elevation=60)
    distance = float(fabric.bank.radius.mean()) * camera.focal / pixels
    place = flat.mean(axis=0) - camera.forward * distance
    return replace(camera, translation=-camera.rotation @ place, near=1e-4)


def _sums(splatter: Splatter, camera: Camera, source: FabricStream) -> NDArray[np.float64]:
    """Red, green, blue and coverage of the whole picture."""
    stream(splatter, camera, source, most=10**9)
    return splatter.linear().sum(axis=(0, 1), dtype=np.float64)
