"""What the lights send to each particle, computed once for a pose and a light direction, and only if asked for.

A light that stays where it is while the camera turns keeps its pass; one that follows the camera needs a new one
a view. Without shadows and occlusion nothing runs and nothing is allocated.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import LANES
from .blocks import Layout
from .camera import Camera
from .errors import RenderError
from .finish import Finish
from .light import Lighting
from .occlusion import occlude
from .shade import MOST_OTHERS, Shading
from .shadow import ShadowMap, cast

__all__ = ["NO_LIGHT", "LightPass", "shading_of"]

NO_LIGHT = np.ones((1, 1, LANES), np.float32)
"""What `project` gets where no light pass is needed."""


def shading_of(lighting: Lighting, finish: Finish) -> Shading:
    """What has to be compiled for these lights and this finish. Raises RenderError for too many lights."""
    lights = lighting.lights
    if len(lights) > 1 + MOST_OTHERS:
        raise RenderError(f"lighting.others: {len(lights) - 1} lights; allowed: up to {MOST_OTHERS}")
    rows, row = [], 0
    for light in lights:
        needed = light.casts_shadow and light.intensity > 0
        rows.append(row if needed else -1)
        row += needed
    return Shading(
        shadows=tuple(rows),
        sky=row if lighting.occlusion and lighting.fill > 0 else -1,
        lobes=finish.model == "marschner",
    )


class LightPass:
    """The light that reaches the particles of one splatter. `passes` counts the passes made so far."""

    def __init__(self) -> None:
        self.passes = 0
        self._light: NDArray[np.float32] | None = None
        self._known: dict[int, Any] = {}
        self._maps: dict[Any, ShadowMap] = {}

    def forget(self) -> None:
        """The particles have changed: what is known of them is void."""
        self._known, self._maps = {}, {}

    def on_particles(
        self,
        shading: Shading,
        lighting: Lighting,
        camera: Camera,
        layout: Layout,
        blocks: NDArray[np.float32],
        box: NDArray[np.float64],
        *,
        opacity: float,
        chunks: int,
    ) -> NDArray[np.float32]:
        """The light 0..1 on packed particles, (blocks, shading.rows, 16), with the rows that `shading` names."""
        if shading.rows == 0:
            return NO_LIGHT
        if self._light is None or self._light.shape != (len(blocks), shading.rows, LANES):
            self._light = np.ones((len(blocks), shading.rows, LANES), np.float32)
            self._known = {}
        for light, row in zip(lighting.lights, shading.shadows, strict=True):
            mark = (*np.round(light.towards(camera), 6).tolist(), light.size)
            if row >= 0 and self._known.get(row) != mark:
                self._maps = {k: m for k, m in self._maps.items() if k in self._known.values()}
                self._maps[mark] = cast(
                    layout, blocks, box, mark[:3], opacity=opacity, size_deg=light.size, chunks=chunks
                )
                self._maps[mark].on_particles(blocks, self._light, row)
                self._known[row] = mark
                self.passes += 1
        if shading.sky >= 0 and self._known.get(shading.sky) != "sky":
            occlude(layout, blocks, box, self._light, shading.sky, opacity=opacity, chunks=chunks)
            self._known[shading.sky] = "sky"
            self.passes += 1
        return self._light

    def key_map(self) -> ShadowMap | None:
        """The shadow map of the key light as last used; None where it casts no shadow."""
        return self._maps.get(self._known.get(0))
