"""What the lights send to each particle, computed once for a pose and a light direction, and only if asked for.

A light that stays where it is while the camera turns keeps its map; one that follows the camera needs a new one
a view. Without shadows and occlusion nothing runs and nothing is allocated.

maps = splatter.cast_light(camera, lighting)     for a mesh, the ground, or other particles of the scene
splatter.light.hold(maps)                        batches, or a thinned or refined scene, are looked up in them
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.copies import zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES

from ..data.blocks import Layout
from ..data.camera import Camera
from ..data.finish import Finish
from ..data.light import Lighting
from ..data.light_sizes import KEY_STRIDE, MAP_SIZE, ROUND_STRIDE, SKY_STRIDE
from ..maps.map_place import blind
from ..tiles.mesh import Mesh
from .occlusion import SkyMaps, occlude
from .shade import Shading
from .shadow import ShadowMap, cast
from .thin import chain_step, spread, thin
from .view import MOST_OTHERS

__all__ = ["NO_LIGHT", "Held", "LightMaps", "LookedUp", "ParticleLight", "shading_of"]

APART = 0.4
"""Depths of a cloth, about as many crossings, by which particles along a fibre are apart that are looked up: farther
apart, crowns would take a share of the light that gets to the bends under them."""
F32 = NDArray[np.float32]
NO_LIGHT = np.ones((1, 1, LANES), np.float32)
"""What `project` gets where no map of light is needed."""


class LookedUp(Protocol):
    """What tells particles how much of a light, or of the sky, gets to them."""

    def on_particles(
        self, blocks: NDArray[np.float32], light_out: NDArray[np.float32], row: int, depth: float = 0.0
    ) -> None: ...


class Held(Protocol):
    """Maps that particles are looked up in, whatever is loaded."""

    @property
    def lights(self) -> tuple[LookedUp | None, ...]: ...

    @property
    def sky(self) -> LookedUp | None: ...

    def coarse(self, depth: float) -> float: ...

    def blind(self, depth: float) -> float: ...


@dataclass(frozen=True, eq=False)
class LightMaps:
    """How much of each light reaches any place of a scene in one pose."""

    lights: tuple[ShadowMap | None, ...]
    """One for each of `Lighting.lights`, None for one that casts no shadow."""
    sky: SkyMaps | None

    def coarse(self, depth: float) -> float:
        """How far these maps do not show what hides what within a cloth `depth` [m] thick: 0 where ten texels go into
        it, 1 where two do, or with no maps."""
        texels = [m.texel for m in (*self.lights, self.sky) if m is not None]
        return min(max((max(texels) / depth - 0.1) / 0.4, 0.0), 1.0) if texels else 1.0

    def blind(self, depth: float) -> float:
        """How far the maps of the sky tell of such a cloth alone, and not of its threads; 0 without any."""
        return blind(self.sky.texel, depth) if self.sky is not None else 0.0

    @property
    def nbytes(self) -> int:
        return sum(m.nbytes for m in (*self.lights, self.sky) if m is not None)


def shading_of(lighting: Lighting, finish: Finish) -> Shading:
    """What has to be compiled for these lights and this finish. Raises InputError for too many lights."""
    lights = lighting.lights
    if len(lights) > 1 + MOST_OTHERS:
        raise InputError(f"lighting.others: {len(lights) - 1} lights; allowed: up to {MOST_OTHERS}")
    bulk = finish.depth > 0
    rows, row = [], 0
    for light in lights:
        needed = light.casts_shadow and light.intensity > 0
        rows.append(row if needed else -1)
        row += Shading(bulk=bulk).of_light * needed
    return Shading(
        bulk=bulk,
        shadows=tuple(rows),
        sky=row if lighting.occlusion and (lighting.fill > 0 or bulk) else -1,
        lobes=finish.model == "marschner",
        dome=lighting.horizon is not None and lighting.fill > 0,
    )


class ParticleLight:
    """The light that reaches the particles of one splatter. `lookups` counts the maps looked up so far."""

    def __init__(self) -> None:
        self.lookups = 0
        self.held: Held | None = None
        self._each = False
        self._light: NDArray[np.float32] | None = None
        self._known: dict[int, Any] = {}
        self._maps: dict[Any, ShadowMap] = {}
        self._sky: SkyMaps | None = None
        self._few: dict[int, NDArray[np.float32]] = {}
        self._mesh: Mesh | None = None
        self._step: float | None = None
        """From one particle of a chain to the next [m], 0 where there are no chains; None where it is not known yet."""

    def forget(self, mesh: Mesh | None = None) -> None:
        """The particles have changed: what is known of them is void. mesh: stands among the new ones."""
        self._known, self._maps, self._sky, self._few = {}, {}, None, {}
        self._mesh, self._step = mesh, None

    def turned(self) -> None:
        """The particles' normals have changed, on which what they get of any light hangs, but not its maps."""
        self._known, self._few = {}, {}

    def hold(self, maps: Held | None, *, each: bool = False) -> None:
        """From now on look up all particles in these maps, whatever is loaded; None makes maps of what is loaded.

        each: every particle by itself, and not some of a chain for those between them: so batches that differ in what
        they are made of meet without a step."""
        self.held, self._each, self._known = maps, each, {}

    def cast(
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
        resolution: int = MAP_SIZE,
    ) -> LightMaps:
        """The maps that `shading` needs, of packed particles in a box (2, 3) [m] and of the mesh among them.

        resolution: texels along a shadow map, at most.
        """
        if isinstance(self.held, LightMaps):
            return self.held
        if self._mesh is not None:
            corners = self._mesh.vertices[np.isfinite(self._mesh.vertices).all(axis=1)]
            if len(corners):
                both = [corners] if not blocks.shape[1] else [box, corners]
                box = np.stack([np.concatenate(both).min(axis=0), np.concatenate(both).max(axis=0)]).astype(np.float64)
        lights, marks = [], []
        for light, row in zip(lighting.lights, shading.shadows, strict=True):
            mark = (*np.round(light.towards(camera), 6).tolist(), light.size, resolution)
            marks.append(mark)
            if row >= 0 and mark not in self._maps:
                few, stretch = self._thinned(layout, blocks, KEY_STRIDE)
                self._maps[mark] = cast(
                    layout, few, box, mark[:3], opacity=opacity,
                    size_deg=light.size, chunks=chunks, stretch=stretch, mesh=self._mesh, resolution=resolution,
                )  # fmt: skip
            lights.append(self._maps[mark] if row >= 0 else None)
        self._maps = {mark: one for mark, one in self._maps.items() if mark in marks}
        if shading.sky >= 0 and self._sky is None:
            few, stretch = self._thinned(layout, blocks, SKY_STRIDE)
            self._sky = occlude(layout, few, box, opacity=opacity, chunks=chunks, stretch=stretch, mesh=self._mesh)
        return LightMaps(tuple(lights), self._sky if shading.sky >= 0 else None)

    def on_particles(
        self,
        shading: Shading,
        layout: Layout,
        blocks: NDArray[np.float32],
        maps: Held | None,
        depth: float = 0.0,
    ) -> NDArray[np.float32]:
        """The light 0..1 on packed particles, (blocks, shading.rows, 16), with the rows that `shading` names.

        depth: of the cloth that they are in [m], see `Finish.depth`.
        """
        if shading.rows == 0 or maps is None:
            return NO_LIGHT
        shape = blocks.shape[1], shading.rows, LANES
        light = self._light
        if light is None or light.shape != shape:
            light, self._known = zeros(shape), {}
            self._light = light
        known_lights = zip(shading.shadows, maps.lights, strict=True)
        rows: list[tuple[int, int, LookedUp | None, int]] = [
            (row, shading.of_light, one, KEY_STRIDE) for row, one in known_lights if row >= 0
        ]
        if shading.sky >= 0:
            rows.append((shading.sky, shading.of_sky, maps.sky, SKY_STRIDE))
        for row, count, one, stride in rows:
            if one is None:
                raise InputError("light: the maps that are held have none for this light; cast them with it")
            known = self._known.get(row)
            if known is None or known[0] is not one or known[1] != depth:
                few, stride = (blocks, 1) if self._each else self._thinned(layout, blocks, stride, depth)
                found, at = (light, row) if stride == 1 else (zeros((few.shape[1], count, LANES)), 0)
                if isinstance(one, SkyMaps) and depth > 0 and not self._each:
                    self._sky_on(one, layout, blocks, few, stride, found, at, depth)
                else:
                    one.on_particles(few, found, at, depth)
                if stride > 1:
                    spread(stride, count, blocks, found, row, light)
                self._known[row] = one, depth
                self.lookups += 1
        return light

    def _sky_on(
        self, sky: SkyMaps, layout: Layout, blocks: F32, few: F32, stride: int, found: F32, row: int, depth: float
    ) -> None:
        """What the sky sends `few`, every stride-th of the particles `blocks`, in a cloth. What the cloth at their
        place sees hangs little on whether a fibre goes over or under there, and takes two of three lookups: so of
        particles in chains every SKY_STRIDE-th finds it."""
        seldom = SKY_STRIDE if layout.elliptic else ROUND_STRIDE
        if seldom <= stride or not self._step:
            sky.on_particles(few, found, row, depth)
            return
        fewer = self._thin(layout, blocks, seldom)
        of_cloth = zeros((fewer.shape[1], Shading(bulk=True).of_sky, LANES))
        sky.on_particles(fewer, of_cloth, 0, depth, "cloth")
        spread(seldom // stride, of_cloth.shape[1], few, of_cloth, row, found)
        sky.on_particles(few, found, row, depth, "own")

    def key_map(self) -> ShadowMap | None:
        """The shadow map of the key light as last used; None where it casts no shadow."""
        known, _ = self._known.get(0, (None, 0.0))
        return known if isinstance(known, ShadowMap) else None

    def _thinned(
        self, layout: Layout, blocks: NDArray[np.float32], stride: int, depth: float = 0.0
    ) -> tuple[NDArray[np.float32], int]:
        """Every stride-th particle and the stride: fewer of round ones, which are short; 1 where they are no chains; in
        a cloth `depth` [m] thick no farther apart than a part of it."""
        stride = stride if layout.elliptic else min(stride, ROUND_STRIDE)
        if self._step is None:
            self._step = chain_step(layout, blocks) or 0.0
        if not self._step:
            return blocks, 1
        while depth > 0 and stride > 1 and stride * self._step > APART * depth:
            stride //= 2
        return self._thin(layout, blocks, stride), stride

    def _thin(self, layout: Layout, blocks: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
        """Every stride-th particle, packed again."""
        if stride == 1:
            return blocks
        if stride not in self._few:
            known = max((k for k in self._few if stride % k == 0), default=1)
            source = self._few.get(known, blocks)
            few = zeros((layout.rows, -(-source.shape[1] * known // stride), LANES))
            thin(stride // known, source, few)
            self._few[stride] = few
        return self._few[stride]
