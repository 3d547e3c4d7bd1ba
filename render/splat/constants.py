"""The numbers of one view: camera, lights and finish as `project` and `shade` read them."""

import numpy as np
from numpy.typing import NDArray

from ..data.camera import Camera
from ..data.finish import Finish
from ..data.light import Lighting
from ..light import shade as rows
from .project import DEEPEST_KEY

__all__ = ["set_constants"]

SLOPE_GAIN, KEY_SHADE = 0.6, 0.6
"""Shading across a round thread at roundness 1 (with `splat.LIMB_DARKENING` its worst case stays above 0), and the
share of the key light that a particle loses when it sees no sky at all; half that where it casts shadows too."""


def set_constants(
    c: NDArray[np.float32],
    camera: Camera,
    lighting: Lighting,
    finish: Finish,
    box: NDArray[np.float64],
    *,
    opacity: float,
    edge: float,
) -> None:
    """Fill c (shade.CONSTANT_ROWS, 3). box: (2, 3) [m] that holds the particles. edge: of the sprite, 0 for crisp."""
    key, sky, ground = lighting.radiances()
    corners = np.array([[box[i >> k & 1, k] for k in range(3)] for i in range(8)])
    depths = corners @ camera.rotation[2] + camera.translation[2]
    nearest = max(camera.near, float(depths.min()))
    key_share = float(key.sum() / max(key.sum() + (sky.sum() + ground.sum()) / 2, 1e-12))
    c[rows.ROTATION : rows.ROTATION + 3] = camera.rotation
    c[rows.TRANSLATION] = camera.translation
    c[rows.EYE] = camera.eye
    c[rows.LENS] = camera.focal, camera.cx, camera.cy
    c[rows.KEY_DIRECTION] = lighting.towards_key(camera)
    c[rows.KEY], c[rows.SKY], c[rows.GROUND] = key, sky, ground
    c[rows.DOME] = lighting.rise
    c[rows.FIBRE] = finish.fibre, finish.specular, finish.exponent / 16
    c[rows.SURFACE] = finish.tint, finish.sheen, SLOPE_GAIN * finish.roundness * key_share
    c[rows.IMAGE] = camera.width, camera.height, camera.near
    scale = DEEPEST_KEY / max(float(depths.max()) - nearest, 1e-9)
    c[rows.DEPTH] = nearest, scale, opacity
    sharpness = 1.0 / (8.0 * np.sin(np.radians(finish.spread)) ** 2)
    c[rows.EDGE] = edge, KEY_SHADE / (2 if lighting.shadows else 1), sharpness
    c[rows.LOBES] = finish.reflect, finish.transmit, finish.internal
    for k, other in enumerate(lighting.others):
        c[rows.OTHERS + 2 * k] = other.towards(camera)
        c[rows.OTHERS + 2 * k + 1] = np.multiply(other.intensity * 2.0**lighting.exposure, other.colour)
