"""What every zoom shares: how the camera goes from a whole cloth to one fibre, and that fibre's surface."""

from math import radians, tan

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fibre.contours import contour
from taichi_cloth.fibre.relief import skin_of
from taichi_cloth.fibre.sphere_set import sphere_set_from_rows

from ...render.data.camera import Camera, look_at
from ..prepare.yarns import fibre_kind
from ..scene.schema import Scene

__all__ = ["RESOLUTION", "TURN", "nearing", "skin_in"]

F64 = NDArray[np.float64]

END_WIDTHS = 5.5
"""Height of the last picture, in diameters of a fibre."""
TURN = 0.7
"""How far the camera turns from the scene's view towards the cloth's normal on its way."""
SKIN_LENGTH = 350e-6
RESOLUTION = 1024
"""Texels along a shadow map: more than for a still, for the camera comes near."""


def nearing(
    first: Camera, fov: float, centre: NDArray, end: F64, normal: F64, diameter: float, count: int, *, crop: float = 1.0
) -> list[Camera]:
    """`count` cameras from `first`, or `crop` times nearer than it, to a fibre: the distance falls by the same factor
    from each to the next, and what is looked at moves from the middle of the first picture, as far away as `centre`
    (3,) [m], to `end` in proportion to the distance left, so that it drifts to the middle of the picture evenly.
    normal: the cloth's there. diameter: of its fibres [m]. fov: over the height [degrees]."""
    lens = {"width": first.width, "height": first.height, "fov": fov}
    far = float((centre - first.eye) @ first.forward)
    begin = first.eye + first.forward * far
    far /= crop
    near = END_WIDTHS * diameter / 2 / tan(radians(fov) / 2)
    start = -first.forward
    final = start + TURN * (normal - start)
    cameras = []
    for k in range(count):
        share = k / max(1, count - 1)
        distance = far * (near / far) ** share
        left = (distance - near) / (far - near)
        at = end + (begin - end) * left
        ease = share * share * (3 - 2 * share)
        direction = start + (final - start) * ease
        direction /= np.linalg.norm(direction)
        # The picture's up stays that of the first view, so that a look straight down does not spin.
        cameras.append(
            look_at(at + direction * distance, at, up=-first.rotation[1], near=distance * 0.3, **lens)  # pyright: ignore
        )
    return cameras


def skin_in(scene: Scene) -> NDArray[np.float32]:
    """The height map of the surface of a scene's fibres, see `relief.skin_of`."""
    rows = scene.fibre.spheres
    return skin_of(
        sphere_set_from_rows(rows) if rows is not None else contour(fibre_kind(scene).name, length_m=SKIN_LENGTH)
    )
