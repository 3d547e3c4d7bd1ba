"""What maps of light tell of a cloth that lies flat, with nothing near it but something dark behind, where their texels
are far wider than it is thick: those of a whole garment are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.copies import fetched, on_host
from taichi_cloth.ground.particles import NORMAL

from ...render.light.particle_light import LookedUp
from ...render.maps.map_place import open_to

__all__ = ["FlatLight"]

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class _Unhidden:
    """A light that nothing is in the way of."""

    def on_particles(self, blocks: F32, light_out: F32, row: int, depth: float = 0.0) -> None:
        del blocks, depth
        with on_host(light_out) as light:
            light[:, row : row + 3] = 1.0


@dataclass(frozen=True)
class _SkyBefore:
    """All of the sky before a cloth and nothing of that behind it. up: which way that is, 1 or -1."""

    up: float

    def on_particles(self, blocks: F32, light_out: F32, row: int, depth: float = 0.0) -> None:
        del depth
        normals = fetched(blocks[NORMAL : NORMAL + 3])
        with on_host(light_out) as light:
            light[:, row : row + 2] = 1.0
            light[:, row + 2] = 0.0
            light[:, row + 3 : row + 6] = open_to(normals, self.up).swapaxes(0, 1)
            light[:, row + 6] = 1.0


_UNHIDDEN, _BEFORE = _Unhidden(), {up: _SkyBefore(up) for up in (1.0, -1.0)}


@dataclass(frozen=True)
class FlatLight:
    """As `LightMaps`, on the right side of a cloth, 1, or on its wrong side, -1. count: of lights."""

    up: float
    count: int

    @property
    def lights(self) -> tuple[LookedUp | None, ...]:
        return (_UNHIDDEN,) * self.count

    @property
    def sky(self) -> LookedUp:
        return _BEFORE[self.up]

    def coarse(self, depth: float) -> float:
        del depth
        return 1.0

    def blind(self, depth: float) -> float:
        del depth
        return 1.0
