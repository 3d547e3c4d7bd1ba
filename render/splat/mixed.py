"""Light that is told more finely near one place: maps of all of a scene, and finer ones of what lies round there.

The finer maps know nothing of what stands farther off, so that what they say is brought to the mean of what the coarser
ones say there, row by row. On the way from one to the other both are looked up and mixed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.copies import on_host
from taichi_cloth.ground.particles import LANES, RADIUS

from ..light.particle_light import Held, LightMaps, LookedUp
from ..light.shade import Shading

__all__ = ["MixedMaps", "mixed"]

F32 = NDArray[np.float32]
MEASURED = 1500
"""Blocks of particles over which means are taken."""
LEAST, MOST = 0.02, 4.0
"""Of the factors: a mean of nothing is not divided by."""
SHARES = 3
"""Rows of the sky that are shares; after them come a direction and what is behind, which have no factor."""


@dataclass(frozen=True, eq=False)
class MixedMap:
    """Of one light, or of the sky: what `far` says and, `share` of it, what `near` says times `factor`, (rows,)."""

    far: LookedUp
    near: LookedUp
    share: float
    factor: F32

    def on_particles(self, blocks: F32, light_out: F32, row: int, depth: float = 0.0) -> None:
        """As of the maps themselves."""
        rows = slice(row, row + len(self.factor))
        if self.share < 1.0:
            self.far.on_particles(blocks, light_out, row, depth)
        fine = np.ones((blocks.shape[1], len(self.factor), LANES), np.float32)
        self.near.on_particles(blocks, fine, 0, depth)
        fine *= self.factor[None, :, None]
        np.minimum(fine[:, :SHARES], 1.0, out=fine[:, :SHARES])
        with on_host(light_out) as light:
            light[:, rows] = fine if self.share >= 1.0 else light[:, rows] * (1.0 - self.share) + self.share * fine


@dataclass(frozen=True, eq=False)
class MixedMaps:
    """As `LightMaps`, of which `far` are for all of the scene, or mixed themselves."""

    far: Held
    near: LightMaps
    share: float
    lights: tuple[LookedUp | None, ...]
    sky: LookedUp | None

    def coarse(self, depth: float) -> float:
        """As of `LightMaps`."""
        return self.far.coarse(depth) * (1.0 - self.share) + self.near.coarse(depth) * self.share

    def blind(self, depth: float) -> float:
        """As of `LightMaps`."""
        return self.far.blind(depth) * (1.0 - self.share) + self.near.blind(depth) * self.share


def mixed(far: Held, near: LightMaps, blocks: F32, depth: float) -> Callable[[float], MixedMaps]:
    """Maps by the share that is told by the nearer ones. blocks: packed particles there, of a cloth `depth` [m] thick:
    those count that see much of the sky by both, which are those that are seen."""
    some = np.ascontiguousarray(blocks[:, :: max(1, blocks.shape[1] // MEASURED)])
    weight = (some[RADIUS] > 0).astype(np.float64)

    def found(one: LookedUp, rows: int) -> F32:
        out = np.ones((some.shape[1], rows, LANES), np.float32)
        one.on_particles(some, out, 0, depth)
        return out

    def factor(one: LookedUp, other: LookedUp, rows: int) -> F32:
        have, want = ((found(m, rows) * weight[:, None]).sum(axis=(0, 2), dtype=np.float64) for m in (other, one))
        out = np.clip(want / np.maximum(have, 1e-9), LEAST, MOST)
        out[SHARES:] = 1.0
        if bulk:  # what a particle's neighbours hide is not the coarser maps' to say, but what gets to the cloth is
            out[0 if rows == of_sky_rows else slice(of_light_rows)] = out[1]
        return out.astype(np.float32)

    bulk = depth > 0
    of_light_rows, of_sky_rows = Shading(bulk=bulk).of_light, Shading(bulk=bulk).of_sky
    if near.sky is not None:
        weight *= found(near.sky, of_sky_rows)[:, 0]
        if far.sky is not None:
            weight *= found(far.sky, of_sky_rows)[:, 0]
    pairs = list(zip(far.lights, near.lights, strict=True))
    of_light = [None if a is None or b is None else factor(a, b, of_light_rows) for a, b in pairs]
    of_sky = None if far.sky is None or near.sky is None else factor(far.sky, near.sky, of_sky_rows)

    def at(share: float) -> MixedMaps:
        lights = tuple(
            None if a is None or b is None or f is None else MixedMap(a, b, share, f)
            for (a, b), f in zip(pairs, of_light, strict=True)
        )
        sky = None
        if far.sky is not None and near.sky is not None and of_sky is not None:
            sky = MixedMap(far.sky, near.sky, share, of_sky)
        return MixedMaps(far, near, share, lights, sky)

    return at
