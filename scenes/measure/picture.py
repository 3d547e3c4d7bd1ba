"""A fabric's picture as numbers to compare: on a plain grey ground, as a screen shows it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.pose import pose_points

from ...render.data.camera import Camera, frame
from ...render.data.light import Lighting
from ...render.image.image import linear_to_srgb
from ...render.splat.splat import Splatter
from ..models.fabric_model import FabricModel
from ..picture.view import finish_of, lighting_of
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import load_scene

__all__ = ["Swatch", "difference", "shown"]

F64 = NDArray[np.float64]
GROUND = 0.2
SCENE = "swatch"
THREADS = (24, 18)


FIBRES = 12
"""A ply, where a study says nothing of it."""


class Swatch:
    """The scene `swatch` with fewer threads and fibres, drawn by a splatter on its own. changes: of it, `key=value`."""

    def __init__(self, *changes: str) -> None:
        ends, picks = THREADS
        own = [f"weave.ends={ends}", f"weave.picks={picks}", f"yarn.fibres={FIBRES}", *changes]
        self.scene = load_scene(SCENE, own)
        model = FabricModel(self.scene, prepare_fabric(self.scene))
        self.layout = model.prepared.layout
        self.particles = model.particles()
        self.lighting: Lighting = lighting_of(self.scene)
        self.finish = finish_of(self.scene)

    def camera(self, size: tuple[int, int], zoom: float = 1.0) -> Camera:
        """That of the scene, `zoom` times nearer, looking at the middle threads."""
        c = self.scene.camera
        points = pose_points(self.layout, "flat").reshape(-1, 3)
        middle = points.mean(axis=0)
        return frame(
            middle + (points - middle) / zoom,
            width=size[0],
            height=size[1],
            elevation=c.elevation_deg,
            azimuth=c.azimuth_deg,
            fov=c.fov_deg,
            margin=c.margin,
        )

    def drawing(self, splatter: Splatter, camera: Camera) -> Callable[[], object]:
        """What a new pose costs: particles taken in, light cast, the picture drawn."""

        def draw() -> None:
            splatter.load(self.particles)
            splatter.render(camera, lighting=self.lighting, finish=self.finish)

        return draw


def shown(splatter: Splatter, by: int = 1) -> F64:
    """The last frame over grey, averaged over `by` × `by` pixels in linear light, as 8-bit sRGB but not rounded."""
    rgba = splatter.linear().astype(np.float64)
    height, width, _ = rgba.shape
    light = rgba[..., :3] + (1 - rgba[..., 3:]) * GROUND
    light = light.reshape(height // by, by, width // by, by, 3).mean(axis=(1, 3))
    return 255 * np.asarray(linear_to_srgb(np.clip(light, 0, 1)), np.float64)


def difference(one: F64, two: F64) -> float:
    """Root mean square over pixels and channels, in steps of 8 bits."""
    return float(np.sqrt(((one - two) ** 2).mean()))
