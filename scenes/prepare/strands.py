"""What is shown without a cloth, a fibre, a length of yarn, a yarn being twisted: counted but not made."""

from dataclasses import dataclass

from taichi_cloth.fibre.contours import contour
from taichi_cloth.fibre.sphere_set import SphereSet, sphere_set_from_rows
from taichi_cloth.yarn.yarn import Yarn

from ..scene.schema import Scene
from .fibre_count import EVERY
from .yarns import fibre_kind, yarn_of

__all__ = ["STEPS", "YarnPiece", "fibre_spheres", "twist_particles", "yarn_piece"]

STEPS = 10
"""Particles along a fibre in a block of a yarn that is shown alone."""


@dataclass(frozen=True)
class YarnPiece:
    """A length [m] of yarn in blocks, with so many fibres drawn a ply."""

    yarn: Yarn
    length: float
    blocks: int
    fibres: int

    @property
    def particles(self) -> int:
        """Of its plies, without hairs."""
        return STEPS * self.blocks * self.yarn.plies * self.fibres


def yarn_piece(scene: Scene) -> YarnPiece:
    """The yarn of a scene that shows nothing else."""
    assert scene.yarn is not None
    yarn = yarn_of(scene.yarn, fibre_kind(scene))
    length = scene.yarn.length_mm * 1e-3
    blocks = max(4, round(length / (yarn.diameter * 1.2)))
    return YarnPiece(yarn, length, blocks, min(scene.yarn.fibres or EVERY, yarn.fibres_in_section))


def twist_particles(scene: Scene) -> int:
    """The most that a yarn being twisted has."""
    assert scene.yarn is not None
    assert scene.twist is not None
    s, yarn = scene.twist, yarn_of(scene.yarn, fibre_kind(scene))
    length = 1e-3 * (s.zone_a_mm + s.zone_b_mm + 2 * s.feed_mm + s.speed_mm_per_s * s.duration_s)
    return int(length / (yarn.diameter / 5)) * yarn.plies * min(scene.yarn.fibres or EVERY, yarn.fibres_in_section)


def fibre_spheres(scene: Scene) -> SphereSet:
    """The sphere set of a fibre that is shown alone: the scene's own, or its kind's."""
    rows = scene.fibre.spheres
    if rows is not None:
        return sphere_set_from_rows(rows)
    return contour(scene.fibre.kind, length_m=scene.fibre.length_um * 1e-6)
