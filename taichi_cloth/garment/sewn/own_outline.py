"""What of a garment can meet cloth: the triangles that are drawn of it, and where they are one."""

from typing import TYPE_CHECKING

import numpy as np

from taichi_cloth.garment.sewn.joined import seam_distance
from taichi_cloth.layers.outline import Outline

if TYPE_CHECKING:
    from taichi_cloth.garment.sewn.garment import Garment

__all__ = ["outline_of"]


def outline_of(garment: "Garment") -> Outline:
    """Of all panels, sewn."""
    surface, atlas = garment.surface, garment.atlas
    return Outline(
        blend=surface.blend,
        corner=surface.corner,
        faces=surface.faces,
        cell=surface.cell,
        flat=surface.lattice * np.asarray(atlas.spacing),
        panel=surface.panel,
        same=surface.same,
        seam=seam_distance(garment.seam_lines, surface.panel, surface.flat, min(atlas.spacing)),
        part=surface.part,
        ghosts=surface.ghosts,
        ghost_blend=surface.ghost_blend,
    )
