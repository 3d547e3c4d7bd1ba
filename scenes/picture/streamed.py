"""A fabric that is drawn in batches, in the light of the whole: shadows, the sky's occlusion, and the floor it lies on.

Batches know nothing of one another, so what darkens them is cast by a sample of the whole fabric that fits in memory.
"""

import numpy as np
from numpy.typing import NDArray

from ...render.data.backdrop import Backdrop
from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera
from ...render.data.finish import Finish
from ...render.data.light import Background, Lighting
from ...render.data.light_sizes import MAP_SIZE
from ...render.splat.splat import Splatter
from ...render.splat.stream import Source, stream
from ...render.stage.paint import paint
from ...render.stage.stage import stage_under
from ...render.tiles.mesh import Mesh

__all__ = ["Streamed"]


class Streamed:
    """Draws on one splatter. sample: of the whole. floor: whether it lies on one. mesh: what stands among the fibres.
    resolution: texels along a shadow map, at most."""

    def __init__(
        self,
        splatter: Splatter,
        sample: ParticleBlocks,
        *,
        floor: bool,
        mesh: Mesh | None = None,
        resolution: int = MAP_SIZE,
    ) -> None:
        self.splatter, self.sample, self.mesh, self.resolution = splatter, sample, mesh, resolution
        self.stage = stage_under(sample, mesh) if floor else None
        self._towards: NDArray[np.float64] | None = None

    def behind(self, camera: Camera, lighting: Lighting, background: Background) -> Backdrop | None:
        """What stands behind the fabric. The splatter holds the maps of these lights from now on; they are cast anew
        only where a light has moved."""
        towards = np.array([light.towards(camera) for light in lighting.lights])
        if self._towards is None or not np.allclose(towards, self._towards, atol=1e-6):
            light = self.splatter.light
            light.hold(None)
            self.splatter.load(self.sample, self.mesh)
            light.hold(self.splatter.cast_light(camera, lighting, resolution=self.resolution))
            self._towards = towards
        around = {"mesh": self.mesh, "stage": self.stage, "maps": self.splatter.light.held}
        samples = 1 if self.mesh is None else 2
        return paint(camera, lighting=lighting, background=background, samples=samples, **around)

    def draw(
        self,
        camera: Camera,
        source: Source,
        *,
        lighting: Lighting,
        finish: Finish,
        background: Background,
        linear: NDArray[np.float32] | None = None,
    ) -> tuple[NDArray[np.uint8], Backdrop | None]:
        """The image and what stands behind. linear: takes the linear colour without it (see `stream`)."""
        backdrop = self.behind(camera, lighting, background)
        options = {"lighting": lighting, "finish": finish, "background": background, "backdrop": backdrop}
        image, _ = stream(self.splatter, camera, source, linear=linear, **options)
        return image, backdrop
