"""A fabric that is drawn in batches, in the light of the whole: shadows, the sky's occlusion, and the floor it lies on.

Batches know nothing of one another, so what darkens them is cast by a sample of the whole fabric that fits in memory.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.copies import fetched

from ...render.data.backdrop import Backdrop
from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera
from ...render.data.finish import Finish
from ...render.data.light import Background, Lighting
from ...render.data.light_sizes import MAP_SIZE
from ...render.data.particles import Particles
from ...render.light.particle_light import Held, LightMaps
from ...render.splat.mixed import MixedMaps, mixed
from ...render.splat.splat import Splatter
from ...render.splat.stream import Source, stream
from ...render.stage.paint import paint
from ...render.stage.stage import stage_under
from ...render.tiles.mesh import Mesh, join

__all__ = ["Closer", "Streamed"]

FADE = 0.45, 0.08
"""Heights of what a picture shows of a closer region, in its own sizes, from which on its maps begin to tell light, and
at which they alone do. From farther off cloth is a sheet, which lies within the fibres that fine maps tell of."""
MIXING = 1.2
"""Power of the way between by which finer maps tell it: by the first of them threads shade each other, which is most of
what changes."""


@dataclass(frozen=True)
class Closer:
    """Regions round one place (3,) [m], `sizes` across [m], each in the one before it, which have finer maps of light
    where a camera is near. sample: the particles in one, which cast its light."""

    place: NDArray[np.float64]
    sizes: tuple[float, ...]
    sample: Callable[[float], ParticleBlocks]


class Streamed:
    """Draws on one splatter. sample: of the whole. floor: whether it lies on one. mesh: what stands among the fibres.
    shading: what else casts shadows on all that. resolution: texels along a shadow map, at most. closer: where light is
    told more finely from near by."""

    def __init__(
        self,
        splatter: Splatter,
        sample: Particles | ParticleBlocks,
        *,
        floor: bool,
        mesh: Mesh | None = None,
        shading: Mesh | None = None,
        resolution: int = MAP_SIZE,
        closer: Closer | None = None,
    ) -> None:
        self.splatter, self.sample, self.mesh, self.resolution = splatter, sample, mesh, resolution
        both = [one for one in (mesh, shading) if one is not None]
        self._shading = join(both) if len(both) > 1 else mesh or shading
        self.stage = stage_under(sample, mesh) if floor else None
        self._towards: NDArray[np.float64] | None = None
        self._whole: LightMaps | None = None
        self._closer = closer
        self._mixed: list[Callable[[float], MixedMaps]] = []

    def behind(self, camera: Camera, lighting: Lighting, background: Background) -> Backdrop | None:
        """What stands behind the fabric. The splatter holds the maps of these lights from now on; they are cast anew
        only where a light has moved."""
        towards = np.array([light.towards(camera) for light in lighting.lights])
        if self._towards is None or not np.allclose(towards, self._towards, atol=1e-6):
            light = self.splatter.light
            light.hold(None)
            self.splatter.load(self.sample, self._shading)
            self._whole, self._mixed = self.splatter.cast_light(camera, lighting, resolution=self.resolution), []
            light.hold(self._whole, each=True)
            self._towards = towards
        around = {"mesh": self.mesh, "stage": self.stage, "maps": self._whole}
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
        drawn: NDArray[np.float32] | None = None,
    ) -> tuple[NDArray[np.uint8], Backdrop | None]:
        """The image and what stands behind. linear: takes the linear colour without it (see `stream`). drawn: linear
        colour (height, width, 3) of what was drawn before it, and stands behind."""
        backdrop = self.behind(camera, lighting, background)
        if drawn is not None and backdrop is not None:
            colour = fetched(backdrop.colour)
            colour[:, : camera.width] = drawn
            backdrop = replace(backdrop, colour=colour)
        if self._closer is not None:
            self.splatter.light.hold(self._told(self._closer, camera, lighting, finish.depth), each=True)
        options = {"lighting": lighting, "finish": finish, "background": background, "backdrop": backdrop}
        image, _ = stream(self.splatter, camera, source, linear=linear, **options)
        return image, backdrop

    def _told(self, closer: Closer, camera: Camera, lighting: Lighting, depth: float) -> Held:
        """The maps of light for a camera: of all, and mixed into them those of the regions that it is near to."""
        assert self._whole is not None
        height = camera.height / camera.focal * float((closer.place - camera.eye) @ camera.forward)
        maps: Held = self._whole
        for k, size in enumerate(closer.sizes):
            share = log(height / size / FADE[0]) / log(FADE[1] / FADE[0])
            if share <= 0.0:
                break
            if k == len(self._mixed):
                light, sample = self.splatter.light, closer.sample(size)
                light.hold(None)
                self.splatter.load(sample)
                near = self.splatter.cast_light(camera, lighting, resolution=self.resolution)
                self._mixed.append(mixed(maps, near, sample.blocks, depth))
            maps = self._mixed[k](min(share, 1.0) ** MIXING)
        return maps
