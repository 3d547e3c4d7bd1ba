"""From the words of a scene of several garments to an outfit worn by a body, dressed in the order worn.

Each garment is cut from its own cloth. The innermost is sewn on the body alone; each next one round all that is worn
already, with contact of cloth with cloth from its first frame. What is sewn is kept on disk.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

from taichi_cloth.garment.fit.let_out import LetOut
from taichi_cloth.garment.outfit.outfit import outfit_of, pattern_of_all
from taichi_cloth.garment.pattern.cut import spacing_for
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.ground.errors import InputError

from ..scene.body_section import BodySection
from ..scene.cloth_schema import SolverSection
from ..scene.schema import Scene
from .construction import own_material
from .gaps import SheetGaps, garment_gaps
from .garment_setup import (
    Dressed,
    Parts,
    Progress,
    garment_of,
    key_points_of,
    pattern_of,
    prepare_garment,
    sewn,
    sewn_with,
    stood,
    tried_on,
)
from .sett import refuse, sett_of, spacing_on
from .weave_layout import Prepared

__all__ = ["dress_outfit", "outfit_parts", "woven"]


def outfit_parts(scene: Scene) -> Parts:
    """Body, primitives and garments of an outfit. Raises InputError."""
    return _together(scene, _each(scene))


def dress_outfit(scene: Scene, each: Progress | None = None) -> Dressed:
    """The scene's garments on its body, sewn unless they were before; patterns of others are tried on first. Raises
    InputError; needs Taichi only to sew."""

    def told(name: str) -> Progress:
        def of_one(stage: str, done: int, most: int) -> None:
            if each:
                each(f"{stage} {name}", done, most)

        return of_one

    alone = _each(scene, [tried_on(one, told(one.title)) for one in scene.garments])
    first, *others = scene.garments
    dressed = sewn(first, alone[0], *sewn_with(first, alone[0]), told(first.title))
    for count, one in enumerate(others, 2):
        parts = _together(scene, alone[:count])
        dressed = sewn(scene, parts, *sewn_with(scene, parts), told(one.title), inner=dressed.worn)
    return dressed


def woven(scene: Scene, garment: Garment) -> Prepared:
    """The cloth of a garment of an outfit, whose fibres are made where a camera looks. Raises InputError."""
    prepared = prepare_garment(scene, garment.atlas)
    if prepared is None:
        raise InputError(
            f"{scene.title}: its cloth states no sett, without which fibres of an outfit are not drawn; say "
            f"garment.{scene.title}.fabric.ends_per_cm and picks_per_cm, or garment.representation=mesh"
        )
    return prepared


def _each(scene: Scene, tight: Sequence[LetOut] = ()) -> list[Parts]:
    """Of each garment alone; the key points of all are as far apart as makes all of them together as many as their
    scenes ask for. tight: of each, see `fitted`."""
    body, primitives, grids = stood(scene.body or BodySection())
    sections = [one.garment for one in scene.garments if one.garment]
    names = [one.title for one in scene.garments]
    patterns = [pattern_of(one, body, out) for one, out in zip_longest(sections, tight)]
    count = sum(key_points_of(*both) for both in zip(sections, patterns, strict=True))
    spacing = spacing_for(pattern_of_all(names, patterns), count)
    setts = []
    for one, section in zip(scene.garments, sections, strict=True):
        sett = sett_of(one)
        if sett is not None:
            refuse(one, section.follow, "garment")
            setts.append(sett)
    if setts:  # whole threads of the coarsest fit between key points, and all but whole ones of the others
        spacing = spacing_on((min(s.ends for s in setts), min(s.picks for s in setts)), spacing)[0]
    out = []
    for one, section, pattern in zip(scene.garments, sections, patterns, strict=True):
        made = garment_of(section, pattern, spacing, scene.solver or SolverSection(), own_material(one))
        out.append(Parts(body, primitives, grids, made, garment_gaps(one, spacing), section.friction))
    return out


def _together(scene: Scene, parts: Sequence[Parts]) -> Parts:
    """Garments as one; their friction on skin is the mean of theirs."""
    names = [one.title for one in scene.garments[: len(parts)]]
    outfit = outfit_of(names, [one.garment for one in parts])
    friction = sum(one.friction for one in parts) / len(parts)
    return replace(parts[0], garment=outfit, gaps=_gaps([one.gaps for one in parts]), friction=friction)


def _gaps(gaps: Sequence[SheetGaps]) -> SheetGaps:
    """Of all garments: the thickest's, with the mean of how their cloths rub."""
    thick = max(gaps, key=lambda one: one.body.size)
    layers = max((one.layers for one in gaps), key=lambda gap: gap.size)
    return replace(thick, layers=layers, friction=sum(one.friction for one in gaps) / len(gaps))
