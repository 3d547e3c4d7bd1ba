"""From a scene's words to the construction of its cloth, and what follows from it."""

from dataclasses import dataclass, replace
from pathlib import Path

from taichi_cloth.fabric.layout import FabricLayout, drawn_tex
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.measured import measured_properties, read_measured
from taichi_cloth.mechanics.presets import PRESET_KEYS, TRADE, preset_properties, within_material
from taichi_cloth.mechanics.properties import FabricProperties, woven_properties
from taichi_cloth.sheet.materials import MATERIALS, Material, named_material
from taichi_cloth.weave.cloth_facts import ClothFacts, cloth_facts

from ..scene.schema import WOVEN, FabricSection, Scene
from .sett import sett_of
from .weave_layout import yarns_for
from .yarns import mechanics_of, repeat_of

__all__ = ["Drawn", "construction_of", "drawn_of", "fabric_properties", "own_material", "with_measured"]


def construction_of(scene: Scene, per_cm: tuple[float, float] | None = None) -> Construction:
    """Fibre, yarns, weave and sett of a scene that names [yarn] and [weave]. per_cm: threads of a sheet whose threads
    follow key points, where [fabric] and the draft state none. Raises InputError."""
    if scene.weave is None or scene.yarn is None:
        raise InputError(
            'the scene names no cloth: add [yarn] and [weave], for instance yarn.count = "Ne 40", weave.draft = "plain"'
        )
    section = scene.fabric or FabricSection()
    draft = repeat_of(scene.weave.draft)
    unsaid = section.ends_per_cm is None and section.picks_per_cm is None and draft.warp_spacing_m is None
    if unsaid and per_cm is not None:
        section = section.model_copy(update={"ends_per_cm": per_cm[0], "picks_per_cm": per_cm[1]})
    warp, weft = yarns_for(scene, draft, section)
    return Construction(
        draft=draft,
        warp=warp,
        weft=weft,
        warp_fibre=mechanics_of(scene.yarn, scene),
        weft_fibre=mechanics_of(scene.weft_yarn or scene.yarn, scene),
        ends_per_cm=section.ends_per_cm,
        picks_per_cm=section.picks_per_cm,
        flattening=section.flattening,
        balance=section.balance,
        finish=section.finish,
    )


def fabric_properties(scene: Scene) -> FabricProperties | None:
    """Of the cloth that moves, where it is woven or was measured; None of a preset as it stands. Raises InputError."""
    section = scene.cloth or scene.garment
    assert section is not None
    kind = "cloth" if scene.cloth else "garment"
    if scene.material == WOVEN:
        if scene.weave is None or scene.yarn is None or sett_of(scene) is None:
            raise InputError(
                f'{kind}.material: "woven" needs [yarn], [weave], fabric.ends_per_cm and fabric.picks_per_cm, or a '
                f".wif file that states its spacing; or name a preset: {', '.join(MATERIALS)}"
            )
        return with_measured(woven_properties(construction_of(scene)), section.measured)
    if scene.material not in TRADE:
        known = ", ".join((WOVEN, *TRADE))
        hint = did_you_mean(scene.material, (WOVEN, *TRADE))
        raise InputError(f"{kind}.material: unknown material {scene.material!r}; known: {known}{hint}")
    if scene.material in MATERIALS and section.measured is None:
        return None
    return with_measured(preset_properties(scene.material), section.measured)


def own_material(scene: Scene) -> Material | None:
    """What `fabric_properties` make of the sheet, with what the scene wants of WITHIN; None of a preset as it stands.
    Raises InputError."""
    properties, section = fabric_properties(scene), scene.cloth or scene.garment
    assert section is not None
    names = section.properties.wanted
    within = within_material(properties or preset_properties(scene.material), names) if names else {}
    if properties is None:
        return replace(named_material(scene.material), **within) if within else None
    found = {field: properties[key].value / unit for key, (field, unit) in PRESET_KEYS.items()}
    if scene.material not in MATERIALS:
        return Material(**found, **within)
    preset = named_material(scene.material)
    bent = {field for field in found if field.startswith(("drawn", "crimp")) and getattr(preset, field) == 0}
    return replace(preset, **{field: value for field, value in found.items() if field not in bent}, **within)


def with_measured(properties: FabricProperties, measured: str | None) -> FabricProperties:
    """Properties with those of a file of measured ones in their place. Raises InputError."""
    return properties if measured is None else measured_properties(properties, read_measured(Path(measured)))


@dataclass(frozen=True)
class Drawn:
    """A cloth as it is drawn. facts: sett, mass of the threads as thick as they are drawn, crimp, cover, thickness.
    thinned: their diameter over that of their yarn."""

    facts: ClothFacts
    thinned: float


def drawn_of(layout: FabricLayout) -> Drawn | None:
    """The facts of a layout; None where it has a single end or pick."""
    if min(layout.cloth.warp_up.shape) < 2:
        return None
    warp, weft = drawn_tex(layout)
    families = (layout.warp, layout.weft)
    thinned = min(float((t.thickness * t.width).min()) ** 0.5 / t.yarn.woven_diameter for t in families)
    return Drawn(cloth_facts(layout.cloth, warp_tex=warp, weft_tex=weft), thinned)
