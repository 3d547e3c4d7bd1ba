"""How large the maps of light are, and what memory they take; known without Taichi, so that a plan can say it."""

from taichi_cloth.ground.particles import ROWS

__all__ = [
    "KEY_STRIDE",
    "LAYERS",
    "MAP_SIZE",
    "ROUND_STRIDE",
    "SCRATCH_ROWS",
    "SKY_DIRECTIONS",
    "SKY_SIZE",
    "SKY_STRIDE",
    "STAMP_ROWS",
    "light_bytes",
]

MAP_SIZE = 512
"""Texels along the longer side of a shadow map; fewer where a texel would be smaller than TEXEL radii."""

LAYERS = 16
"""Boundaries of layers in a texel: one vector."""

STAMP_ROWS = 11
"""Of a particle on a shadow map."""

KEY_STRIDE = 2
"""Of particles in chains, every so many along a fibre throws and receives the shadows of a distant light."""

ROUND_STRIDE = 2
"""The most where they are round."""

SKY_SIZE = 384
"""Texels along a map of the sky: coarser than a shadow's, which has one direction."""

SKY_DIRECTIONS = 10
"""Maps; each is read from both ends, and a surface sees one end of every one."""

SKY_STRIDE = 8
"""Of particles in chains, every so many along a fibre blocks the sky and reads it: on the T-shirt of 377,508 as near
to a fine map of all of them (0.07 rms of 0.83) as every fourth is."""

SCRATCH_ROWS = 8
"""Of a particle on a map of the sky: u, v [texels], depth [m], optical depth of a point, steps of these, points."""


def light_bytes(particles: int, *, shadows: int, occlusion: bool, chunks: int = 2) -> int:
    """About the memory that the light on particles in chains takes: its maps, what it keeps of every particle,
    and what it works with. shadows: lights that cast one. A map has no more than four texels a particle."""
    texels = 1.2 * min(MAP_SIZE**2, 4 * particles) * 4 / 3
    one = texels * (LAYERS + 1) * 4 + particles * 4
    few = particles / KEY_STRIDE * (STAMP_ROWS + ROWS) * 4
    dome = SKY_DIRECTIONS * 1.2 * min(SKY_SIZE**2, 4 * particles) * (LAYERS + 2) * 4 + particles * 4
    working = particles / SKY_STRIDE * (ROWS + chunks * SCRATCH_ROWS) * 4
    return int(shadows * one + (few if shadows else 0) + (dome + working if occlusion else 0))
