"""A body that stands or moves in a scene: what cloth touches of it, and what is drawn of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.colliders.grid import DistanceGrid, part_grids
from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.parts.parts import JOINTS as PART_JOINTS
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.body.primitives.primitive_arrays import primitives_from, primitives_to
from taichi_cloth.body.primitives.primitive_file import load_primitives
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.ready import fit_body, ready_primitives
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.garment.sewn.skin import beneath
from taichi_cloth.ground.cache import digest, kept
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import colour

from ...render.tiles.mesh import Mesh
from ..scene.body_section import BodySection, prepare_body, prepare_motion
from .gaps import SheetGaps

__all__ = ["GRID_SPACING", "Standing", "grids_at", "grids_of", "primitives_of", "skin_mesh", "standing"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

VERSION = 2
"""Of what is kept on disk: raised whenever the same body would give other primitives or grids."""

FAR = 0.1
"""As far off a body its primitives may be [m]."""
GRID_SPACING = 0.01
"""Of distance grids [m]."""


@dataclass(frozen=True, eq=False)
class Standing:
    """A body in its scene. bones: time [s] → (joints, 4, 4) from rest, as `Colliders.motion`; None: it stands still."""

    section: BodySection
    body: Body
    motion: Motion
    colliders: Colliders

    @property
    def bones(self) -> Callable[[float], F64] | None:
        return self.colliders.motion

    @property
    def touched(self) -> str:
        """What cloth touches, in words."""
        made = self.colliders
        return f"{len(made.grids)} distance grids" if made.grids else f"{len(made.primitives)} primitives"

    def skin(self, time: float) -> F64:
        """(n, 3) [m] at a time [s]."""
        return self.body.posed(self.motion.pose(time))

    def mesh(self, time: float, cloth: NDArray) -> Mesh:
        """The skin at a time [s], let in where it would show through cloth points (m, 3) that lie on it."""
        return skin_mesh(self.section, self.body, self.skin(time), cloth)


def standing(section: BodySection, *, friction: float, gaps: SheetGaps) -> Standing:
    """The body of a scene. friction: Coulomb's µ. gaps: that a sheet keeps. Raises InputError."""
    body = prepare_body(section, Path())
    motion = prepare_motion(section, body, Path())
    still = motion.name == "rest"
    grids = section.contact == "grid"
    colliders = Colliders(
        primitives=() if grids else primitives_of(body, section.primitives),
        grids=grids_of(body) if grids else (),
        motion=None if still else lambda time: body.bone_transforms(motion.pose(time)),
        friction=friction,
        gap=gaps.body.size,
    )
    return Standing(section, body, motion, replace(colliders, beyond=gaps.beyond(colliders.solids)))


def primitives_of(body: Body, file: str | None = None) -> tuple[Primitive, ...]:
    """The primitives of a body, each carried by its bone; those of other than built-in bodies are kept on disk.

    file: what `body fit` wrote, instead. Raises InputError where it is not of such a body.
    """
    if file is not None:
        read = tuple(load_primitives(file))
        low, high = body.vertices.min(axis=0) - FAR, body.vertices.max(axis=0) + FAR
        for number, p in enumerate(read):
            if not 0 <= p.bone < len(body.skeleton.names):
                raise InputError(
                    f"{file}: primitive {number}: bone {p.bone}; allowed: 0 to {len(body.skeleton.names) - 1}"
                )
            if (
                not ((low < (p.start, p.end)) & ((p.start, p.end) < high)).all()
                or max(p.radii) > (high - low).max() / 2
            ):
                raise InputError(
                    f"{file}: primitive {number} is off the body; fit them to this one: taichi-cloth body fit"
                )
        return read
    ready = ready_primitives(body)
    if ready is not None:
        return ready
    made_of = digest(VERSION, body.vertices, body.faces)
    return primitives_from(kept("primitives", made_of, lambda: primitives_to(fit_body(body)))[0])


def grids_of(body: Body) -> tuple[DistanceGrid, ...]:
    """`grids_at` of GRID_SPACING, kept on disk."""
    made_of = digest(VERSION, GRID_SPACING, body.vertices, body.faces)

    def make() -> dict[str, NDArray]:
        made = grids_at(body, GRID_SPACING)
        return {f"{g.part} {what}": getattr(g, what) for g in made for what in ("values", "origin")}

    arrays, _ = kept("grids", made_of, make)
    names = [key.removesuffix(" values") for key in arrays if key.endswith(" values")]
    return tuple(
        DistanceGrid(
            origin=arrays[f"{name} origin"],
            spacing=GRID_SPACING,
            values=arrays[f"{name} values"],
            part=name,
            bone=body.skeleton.index(PART_JOINTS[name]),
        )
        for name in names
    )


def grids_at(body: Body, spacing: float) -> tuple[DistanceGrid, ...]:
    """A grid of distances for each part of a body, carried by its bone. spacing [m]."""
    found = segment(body.vertices, body.faces)
    parts = [(name, body.skeleton.index(PART_JOINTS[name])) for name in found.names]
    return part_grids(body.vertices, body.faces, found.labels, parts, spacing=spacing)


SKIN = 0.6
"""Share of its colour that the body is painted with: a shop-window figure that leaves the light to the cloth."""


def skin_mesh(section: BodySection, body: Body, skin: NDArray, cloth: NDArray, spared: NDArray | None = None) -> Mesh:
    """Skin (n, 3) [m] for a picture, let in where it would show through cloth points (m, 3) that lie on it. spared: as
    in `beneath`."""
    albedo = SKIN * np.asarray(colour(section.colour), np.float32)
    let_in = beneath(skin, body.faces, cloth, bone=body.weights.argmax(axis=1), spared=spared)
    return Mesh(let_in, body.faces, albedo, part=1, skin=1.0)
