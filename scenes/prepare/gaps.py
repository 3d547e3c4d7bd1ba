"""What contact keeps between the middle of a sheet and what it meets: the thickness that is drawn, where key points lie
close enough to keep it."""

from dataclasses import dataclass
from math import hypot

from taichi_cloth.constraints.thin_limbs import least_gap
from taichi_cloth.mechanics.presets import named_construction

from ..scene.cloth_schema import ForcesSection
from ..scene.schema import WOVEN, Scene
from .construction import construction_of

__all__ = ["FINGER", "OF_GARMENTS", "Gap", "SheetGaps", "drawn_thickness", "gaps_of"]

FINGER = 8e-3
"""Radius of the thinnest limb that a sheet lies on whatever its thickness [m]: a finger's."""
FOLD = 0.1
"""Layers are kept apart by this share of the spacing of key points at least: so far a chord from one to the next leaves
a fold whose radius is 5/4 of it, the tightest that they follow."""


@dataclass(frozen=True)
class Gap:
    """size: kept [m]. thickness: of the cloth that is drawn [m]. stated: by the scene."""

    size: float
    thickness: float
    stated: bool

    @property
    def said(self) -> str:
        """In a plan: how far apart, and why where it is not the thickness."""
        apart = f"{1e3 * self.size:.3g} mm apart"
        if self.stated:
            return apart
        if self.size == self.thickness:
            return f"{apart}, as thick as the cloth is drawn"
        return f"{apart}, not the {1e3 * self.thickness:.2g} mm that the cloth is thick: key points lie too far apart"


@dataclass(frozen=True)
class SheetGaps:
    """Between a sheet and a body, a ball, a floor, and its own layers."""

    body: Gap
    ball: Gap
    floor: Gap
    layers: Gap


OF_GARMENTS = SheetGaps(
    body=Gap(4e-3, 0.0, stated=True),
    ball=Gap(3e-3, 0.0, stated=True),
    floor=Gap(2e-3, 0.0, stated=True),
    layers=Gap(2e-3, 0.0, stated=True),
)
"""Of a [garment], where its scene states none: garments name their own gap from the body."""


def drawn_thickness(scene: Scene) -> float:
    """Of the threads of a [cloth] that lie on one another, as they are drawn; of a mesh without [yarn] or [weave] as
    its material would be [m]. Raises InputError."""
    cloth = scene.cloth
    assert cloth is not None
    if scene.weave is None or scene.yarn is None:
        name = "cotton-shirting" if scene.material == WOVEN else scene.material
        return 1e-3 * named_construction(name).facts.thickness_mm
    threads = cloth.threads_per_key_point
    per_cm = (
        0.01 * threads * (cloth.columns - 1) / cloth.width_m,
        0.01 * threads * (cloth.rows - 1) / cloth.length_m,
    )
    return 1e-3 * construction_of(scene, per_cm).facts.thickness_mm


def gaps_of(scene: Scene) -> SheetGaps:
    """Of a scene of a [cloth]. What it states holds; the rest is the thickness drawn, or more where a body as thin as a
    finger, the ball or a fold would come through between key points. Raises InputError."""
    cloth, forces = scene.cloth, scene.forces or ForcesSection()
    assert cloth is not None
    thickness = drawn_thickness(scene)
    across, along = cloth.width_m / (cloth.columns - 1), cloth.length_m / (cloth.rows - 1)
    diagonal = hypot(across, along)

    def gap(stated_mm: float | None, least: float = 0.0) -> Gap:
        if stated_mm is not None:
            return Gap(1e-3 * stated_mm, thickness, stated=True)
        return Gap(max(thickness, least), thickness, stated=False)

    ball, floor, layers = forces.sphere, forces.plane, forces.self_contact
    return SheetGaps(
        body=gap(cloth.gap_mm, least_gap(diagonal, FINGER, middles=True)),
        ball=gap(ball.gap_mm, least_gap(diagonal, ball.radius_m)) if ball else gap(None),
        floor=gap(floor.gap_mm if floor else None),
        layers=gap(layers.thickness_mm if layers else None, FOLD * min(across, along)),
    )
