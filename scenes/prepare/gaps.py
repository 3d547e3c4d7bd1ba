"""What contact keeps between the middle of a sheet and what it meets: the thickness that is drawn, where key points lie
close enough to keep it."""

from dataclasses import dataclass
from math import hypot

from taichi_cloth.constraints.thin_limbs import least_gap
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.presets import named_construction
from taichi_cloth.mechanics.properties import woven_properties

from ..scene.body_section import BodySection
from ..scene.cloth_schema import ForcesSection
from ..scene.schema import WOVEN, Scene
from .construction import construction_of, with_measured

__all__ = ["ARM", "FINGER", "Gap", "SheetGaps", "gaps_of", "garment_gaps"]

FINGER = 8e-3
"""Radius of the thinnest limb that a sheet lies on whatever its thickness [m]: a finger's."""
ARM = 25e-3
"""Of the thinnest that a garment lies on, so that key points alone keep it out [m]: a forearm's above the wrist."""
SKIN_BEYOND = 4e-3
"""How far skin stands out of the primitives that are touched in its place [m]: of both built-in bodies 86 and 88 % of
the vertices stand out less."""
FOLD = 0.1
"""Layers are kept apart by this share of the spacing of key points at least: so far a chord from one to the next leaves
a fold whose radius is 5/4 of it, the tightest that they follow."""
TOO_FAR, BARE = "key points lie too far apart", "primitives do not cover all skin"
"""Why a gap is more than a thickness."""


@dataclass(frozen=True)
class Gap:
    """size: kept [m]. thickness: of the cloth that is drawn [m]. why: it is more than that, or nothing. stated: by the
    scene."""

    size: float
    thickness: float
    why: str = ""
    stated: bool = False

    @property
    def said(self) -> str:
        """In a plan: how far apart, and why where it is not the thickness."""
        apart = f"{1e3 * self.size:.3g} mm apart"
        if self.stated:
            return apart
        if not self.why:
            return f"{apart}, as thick as the cloth is drawn"
        return f"{apart}, not the {1e3 * self.thickness:.2g} mm that the cloth is thick: {self.why}"


@dataclass(frozen=True)
class SheetGaps:
    """Between a sheet and a body, a ball, a floor, and its own layers. friction: of its yarns, cloth on cloth."""

    body: Gap
    ball: Gap
    floor: Gap
    layers: Gap
    friction: float


def _woven(scene: Scene, spacing: tuple[float, float]) -> Construction:
    """Of a [cloth] or [garment] as it is drawn; of a mesh without [yarn] or [weave] as its material would be. spacing:
    of key points, across and along [m]. Raises InputError."""
    section = scene.cloth or scene.garment
    assert section is not None
    if scene.weave is None or scene.yarn is None:
        return named_construction("cotton-shirting" if scene.material == WOVEN else scene.material)
    threads = section.threads_per_key_point
    return construction_of(scene, (0.01 * threads / spacing[0], 0.01 * threads / spacing[1]))


def gaps_of(scene: Scene) -> SheetGaps:
    """Of a scene of a [cloth]. What it states holds; the rest is the thickness drawn, or more where a body as thin as a
    finger, the ball or a fold would come through between key points. Raises InputError."""
    cloth = scene.cloth
    assert cloth is not None
    spacing = cloth.width_m / (cloth.columns - 1), cloth.length_m / (cloth.rows - 1)
    return _gaps(scene, spacing, cloth.gap_mm, (least_gap(hypot(*spacing), FINGER, middles=True), TOO_FAR))


def garment_gaps(scene: Scene, spacing: tuple[float, float]) -> SheetGaps:
    """Of a scene of a [garment] whose key points are `spacing` apart, across and along [m]. What it states holds; the
    rest is the thickness drawn, or more: where an arm, the ball or a fold would come through between key points, and
    where primitives stand for the skin, which they do not all cover. Raises InputError."""
    garment = scene.garment
    assert garment is not None
    least = least_gap(hypot(*spacing), ARM), TOO_FAR
    on_skin = (scene.body or BodySection()).contact == "grid"
    return _gaps(scene, spacing, garment.gap_mm, least if on_skin else max(least, (SKIN_BEYOND, BARE)))


Least = tuple[float, str]
"""Of a gap [m], and why."""


def _gaps(scene: Scene, spacing: tuple[float, float], from_body_mm: float | None, least: Least) -> SheetGaps:
    """least: from the body where nothing is stated, however thin the cloth."""
    forces, diagonal = scene.forces or ForcesSection(), hypot(*spacing)
    made, section = _woven(scene, spacing), scene.cloth or scene.garment
    assert section is not None
    thickness = 1e-3 * made.facts.thickness_mm

    def gap(stated_mm: float | None, least: Least = (0.0, "")) -> Gap:
        if stated_mm is not None:
            return Gap(1e-3 * stated_mm, thickness, stated=True)
        return Gap(thickness, thickness) if least[0] <= thickness else Gap(least[0], thickness, least[1])

    ball, floor, layers = forces.sphere, forces.plane, forces.self_contact
    return SheetGaps(
        body=gap(from_body_mm, least),
        ball=gap(ball.gap_mm, (least_gap(diagonal, ball.radius_m), TOO_FAR)) if ball else gap(None),
        floor=gap(floor.gap_mm if floor else None),
        layers=gap(layers.thickness_mm if layers else None, (FOLD * min(spacing), TOO_FAR)),
        friction=with_measured(woven_properties(made), section.measured)["friction"].value,
    )
