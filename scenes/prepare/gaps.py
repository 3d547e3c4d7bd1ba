"""What contact keeps between the middle of a sheet and what it meets: the thickness that is drawn.

Of a body it is kept everywhere. What of a body would come through between key points, and primitives that do not cover
all of the skin that they stand for, are touched as if they were wider. A ball is kept off by more than the thickness
where key points lie too far apart to keep it. Layers of the same cloth keep it between what is drawn of them, which is
rounder than the faces that meet (`layers/near_pairs.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

from taichi_cloth.body.colliders.colliders import Solid
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.constraints.thin_limbs import least_gap
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.presets import named_construction
from taichi_cloth.mechanics.properties import woven_properties

from ..scene.cloth_schema import ForcesSection
from ..scene.schema import WOVEN, Scene
from .construction import construction_of, with_measured

__all__ = ["ARM", "FINGER", "Gap", "SheetGaps", "gaps_of", "garment_gaps"]

FINGER = 8e-3
"""Radius of the thinnest limb that a sheet lies on whatever its thickness [m]: a finger's."""
ARM = 25e-3
"""Of the thinnest that a garment lies on, so that key points alone keep it out [m]: a forearm's above the wrist."""
SKIN_BEYOND = 3.5e-3
"""How far skin stands out of the primitives that are touched in its place [m]: of both built-in bodies 85 and 83 % of
the vertices stand out less."""
SPACINGS = 3.0
"""Of key points, that layers are kept apart by at most: more would be near more cloth than there is room for."""
TOO_NEAR = "key points lie too near"
TOO_FAR, BARE = "key points lie too far apart", "primitives do not cover all skin"
"""Why a gap is more than a thickness, and why a body is touched as if it were wider."""


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
    """Between a sheet and a body, a ball, a floor, and its own layers.

    friction: of its yarns, cloth on cloth. diagonal: of a cell [m]. held: radius of the thinnest limb that is kept out
    [m], by key points alone or by the middles of springs too. bare: how far skin stands out of primitives [m].
    """

    body: Gap
    ball: Gap
    floor: Gap
    layers: Gap
    friction: float
    diagonal: float
    held: float
    middles: bool
    bare: float

    def beyond(self, solids: Sequence[Solid]) -> tuple[float, ...]:
        """How much wider than it is each solid of a body is touched [m], see `Colliders`; nothing where the scene
        states a gap."""
        if self.body.stated:
            return ()
        out = []
        for solid in solids:
            bare, limb = (self.bare, solid.thinnest) if isinstance(solid, Primitive) else (0.0, 0.0)
            least = least_gap(self.diagonal, max(limb, self.held), middles=self.middles)
            out.append(max(bare, least - self.body.size))
        return tuple(out)

    def said(self, solids: Sequence[Solid]) -> str:
        """In a plan: how far cloth stays from a body, and how much wider than it is that is touched, with why."""
        beyond = self.beyond(solids)
        most = max(beyond, default=0.0)
        if most <= 0.0:
            return self.body.said
        why = BARE if most == self.bare else TOO_FAR
        some = "" if min(beyond) > 0.0 else f"{sum(by > 0.0 for by in beyond)} limbs of "
        return f"{self.body.said}, from {some}a body touched as if {1e3 * most:.2g} mm wider: {why}"


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
    """Of a scene of a [cloth]. What it states holds; the rest is the thickness drawn, or more where the ball would
    come through between key points. Limbs as thin as a finger are kept out. Raises InputError."""
    cloth = scene.cloth
    assert cloth is not None
    spacing = cloth.width_m / (cloth.columns - 1), cloth.length_m / (cloth.rows - 1)
    return _gaps(scene, spacing, cloth.gap_mm, FINGER, middles=True, bare=0.0)


def garment_gaps(scene: Scene, spacing: tuple[float, float]) -> SheetGaps:
    """Of a scene of a [garment] whose key points are `spacing` apart, across and along [m]. What it states holds; the
    rest is the thickness drawn, or more where the ball would come through between key points. Limbs as thin
    as an arm are kept out, and primitives do not cover all skin. Raises InputError."""
    garment = scene.garment
    assert garment is not None
    return _gaps(scene, spacing, garment.gap_mm, ARM, middles=False, bare=SKIN_BEYOND)


Least = tuple[float, str]
"""Of a gap [m], and why."""


def _gaps(
    scene: Scene, spacing: tuple[float, float], from_body_mm: float | None, held: float, *, middles: bool, bare: float
) -> SheetGaps:
    forces, diagonal = scene.forces or ForcesSection(), hypot(*spacing)
    made, section = _woven(scene, spacing), scene.cloth or scene.garment
    assert section is not None
    thickness = 1e-3 * made.facts.thickness_mm

    def gap(stated_mm: float | None, least: Least = (0.0, "")) -> Gap:
        if stated_mm is not None:
            return Gap(1e-3 * stated_mm, thickness, stated=True)
        return Gap(thickness, thickness) if least[0] <= thickness else Gap(least[0], thickness, least[1])

    ball, floor, layers = forces.sphere, forces.plane, forces.self_contact
    between = gap(layers.thickness_mm if layers else None)
    if not between.stated and between.size > SPACINGS * min(spacing):
        between = Gap(SPACINGS * min(spacing), thickness, TOO_NEAR)
    return SheetGaps(
        body=gap(from_body_mm),
        ball=gap(ball.gap_mm, (least_gap(diagonal, ball.radius_m), TOO_FAR)) if ball else gap(None),
        floor=gap(floor.gap_mm if floor else None),
        layers=between,
        friction=with_measured(woven_properties(made), section.measured)["friction"].value,
        diagonal=diagonal,
        held=held,
        middles=middles,
        bare=bare,
    )
