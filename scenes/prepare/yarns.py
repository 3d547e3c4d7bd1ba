"""From a scene's words to its fibre, its yarns and its draft."""

from dataclasses import replace

import numpy as np

from taichi_cloth.fibre.contours import FIBRES, FibreKind
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics, Form, blend, fibre_mechanics
from taichi_cloth.weave.colour_order import coloured
from taichi_cloth.weave.draft import Draft, named_weave, tile
from taichi_cloth.yarn.count import in_count, in_tex, parse_count
from taichi_cloth.yarn.hairs import usual_hairiness
from taichi_cloth.yarn.unevenness import usual_unevenness
from taichi_cloth.yarn.yarn import Hairiness, Yarn, count_for_diameter, turns_per_m

from ..scene.draft_file import draft_file
from ..scene.schema import Scene, Weave, YarnSection
from ..scene.section import DRAFT_FILE

__all__ = ["draft_of", "fibre_kind", "mechanics_of", "repeat_of", "yarn_of"]

DEFAULT_THREADS = 40
"""Ends and picks of a named weave."""
FEWEST_THREADS = 24
"""Of a WIF file, whose repeats come as often as makes so many: most hold one alone, a strip of four picks."""
DEFAULT_COUNT_TEX = 20.0
LARGEST_COUNT_TEX = 10_000.0


def fibre_kind(scene: Scene) -> FibreKind:
    """The scene's fibre; of a blend its kind is what is drawn. Raises InputError for a kind that is not known."""
    kind = scene.fibre.kind
    if kind not in FIBRES:
        raise InputError(f"fibre.kind: unknown fibre {kind!r}; known: {', '.join(FIBRES)}{did_you_mean(kind, FIBRES)}")
    found, own = FIBRES[kind], scene.fibre.fineness_dtex
    if scene.fibre.blend:
        mixed = _blended(scene)
        found = replace(found, density_kg_m3=1e3 * mixed.density, fineness_dtex=10.0 * mixed.fineness)
    return found if own is None else replace(found, fineness_dtex=own)


def yarn_of(section: YarnSection, fibre: FibreKind, *, diameter: float | None = None, raised: bool = False) -> Yarn:
    """A yarn as stated in a scene, of the scene's fibre. raised: in cloth with a nap.

    diameter: woven diameter [m] of a yarn whose count is not stated; it is twisted by the same twist multiplier as a
    yarn of the default count, turns ∝ 1/√tex.
    """
    said = parse_count(section.count) if section.count is not None else None
    plies = section.plies if said is None else said.plies
    stated = said.tex if said else section.count_tex or (in_tex(section.count_ne, "Ne") if section.count_ne else None)
    count = stated or DEFAULT_COUNT_TEX
    tighter = 1.0
    if stated is None and diameter is not None:
        count = count_for_diameter(diameter, fibre.density_kg_m3, section.packing, plies)
        count = float(np.clip(count, fibre.fineness_dtex, LARGEST_COUNT_TEX))
        tighter = float(np.sqrt(DEFAULT_COUNT_TEX / count))
    twist = section.twist_per_m * tighter
    if section.twist_multiplier is not None:
        twist = turns_per_m(section.twist_multiplier, in_count(count * plies, "Ne"))
    fineness = (said.fineness_dtex if said else None) or fibre.fineness_dtex
    form = (said.form if said else None) or fibre_mechanics(fibre.name).form
    unevenness = section.unevenness
    if unevenness is None:
        unevenness = usual_unevenness(
            (said.fibre if said else None) or fibre.name, form, 10.0 * count * plies / fineness
        )
    return Yarn(
        count_tex=count,
        plies=plies,
        twist_per_m=twist,
        twist=section.twist,
        singles_twist_per_m=section.singles_twist_per_m * tighter,
        singles_twist=section.singles_twist,
        fibre_density=fibre.density_kg_m3,
        fineness_dtex=fineness,
        packing=section.packing,
        flattening=section.flattening,
        migration=section.migration,
        migration_period_mm=section.migration_period_mm,
        hairiness=_hairiness(section, fibre, form, count * plies, raised),
        unevenness=unevenness,
    )


def _hairiness(section: YarnSection, fibre: FibreKind, form: Form, tex: float, raised: bool) -> Hairiness:
    """As stated; else as is usual of the fibre, spun or of filaments as its count says."""
    if section.hairiness is not None:
        return Hairiness(**section.hairiness.model_dump())
    return usual_hairiness(fibre.name, form, tex, raised=raised)


def mechanics_of(section: YarnSection, scene: Scene) -> FibreMechanics:
    """What a yarn's fibres are when they are bent and pulled; spun or of filaments as its count says, else as is usual
    of the fibre. Raises InputError."""
    own = scene.fibre
    fibre = _blended(scene) if own.blend else fibre_mechanics(fibre_kind(scene).name)
    form = parse_count(section.count).form if section.count is not None else None
    stated = {
        "form": form,
        "modulus": own.modulus_n_per_tex,
        "flexural": own.flexural_mn_mm2_per_tex2,
        "friction": own.friction,
        "rubbing": own.friction,
    }
    return replace(fibre, **{key: value for key, value in stated.items() if value is not None})


def _blended(scene: Scene) -> FibreMechanics:
    """The blend that a scene states. Raises InputError."""
    try:
        return blend([(share, fibre_mechanics(name)) for name, share in scene.fibre.blend.items()])
    except InputError as error:
        raise InputError(f"fibre.blend: {str(error).removeprefix('fibre: ')}") from None


def draft_of(weave: Weave) -> Draft:
    """The draft of a scene: a named weave or a WIF file, at the stated number of ends and picks, patched, coloured."""
    draft = _draft(weave.draft, weave.ends, weave.picks)
    for number, patch in enumerate(weave.patches):
        last_end, last_pick = patch.end + patch.ends, patch.pick + patch.picks
        if last_end > draft.ends or last_pick > draft.picks:
            raise InputError(
                f"weave.patches[{number}]: reaches to end {last_end} and pick {last_pick}; allowed: up to {draft.ends} "
                f"and {draft.picks}, the cloth's own"
            )
        up = draft.warp_up.copy()
        up[patch.pick : last_pick, patch.end : last_end] = _draft(patch.draft, patch.ends, patch.picks).warp_up
        draft = replace(draft, warp_up=up)
    try:
        return coloured(draft, warp=weave.warp_colours, weft=weave.weft_colours)
    except InputError as error:
        raise InputError(f"weave.warp_colours, weave.weft_colours: {error}") from None


def repeat_of(name: str) -> Draft:
    """One repeat of a named weave, or a WIF file as it is."""
    return draft_file(name) if DRAFT_FILE.fits(name) else named_weave(name)


def _draft(name: str, ends: int | None, picks: int | None) -> Draft:
    """A named weave or a WIF file, at its own size where none is stated; of what is one small repeat, several."""
    if DRAFT_FILE.fits(name):
        draft = draft_file(name)
        own = [count * max(1, -(-FEWEST_THREADS // count)) for count in (draft.ends, draft.picks)]
        return tile(draft, ends=own[0] if ends is None else ends, picks=own[1] if picks is None else picks)
    return named_weave(
        name,
        ends=DEFAULT_THREADS if ends is None else ends,
        picks=DEFAULT_THREADS if picks is None else picks,
    )
