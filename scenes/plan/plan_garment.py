"""What a garment will build, or several, in words."""

from collections.abc import Sequence
from math import hypot

from taichi_cloth.garment.outfit.outfit import Outfit
from taichi_cloth.motion.forces import Forces
from taichi_cloth.solvers.named import named_solver

from ..prepare.garment_setup import (
    Parts,
    dressed_parts,
    garment_choice,
    garment_colliders,
    garment_forces,
    motion_of,
    prepare_garment,
    woven_garment,
)
from ..prepare.outfit_setup import woven
from ..prepare.weave_layout import Prepared
from ..scene.cloth_schema import ForcesSection, SolverSection
from ..scene.garment_schema import CLEAR
from ..scene.schema import Scene
from .plan_cloth import LAYERS, force_stages, material_stage, solver_stages, thin_limbs, within_stages

__all__ = ["garment_stages", "outfit_stages"]


def garment_stages(scene: Scene) -> tuple[dict[str, str], dict[str, str], int, Scene | None, Prepared | None]:
    """Stages that are built, with what of, those left out, with why, the key points, the cloth as a
    scene, and what is laid out of it where it has a sett."""
    section = scene.garment
    assert section is not None
    parts = dressed_parts(scene)
    atlas = parts.garment.atlas
    built, left = _worn_stages(scene, parts, (scene,))
    built["meshes"] = "the body" if section.representation == "fibre" else "the body and the garment"
    if section.weaves:
        built["weaves"] = ", ".join(f"{name}: {draft}" for name, draft in section.weaves.items())
    built |= material_stage(scene)
    within = within_stages(scene)
    built |= within[0]
    left |= within[1]
    if section.pattern not in CLEAR and "self_contact" not in (scene.forces or ForcesSection()).model_fields_set:
        left[LAYERS] = (
            "garments of this pattern may start through themselves, and are sewn with it only where they would not fit "
            "else; forces.self_contact={} asks for it"
        )
    cloth, prepared = None, None
    if section.representation == "fibre":
        prepared = prepare_garment(scene, atlas)
        cloth = woven_garment(scene, atlas) if prepared is None else scene
    else:
        left["fibre blocks"] = 'garment.representation is "mesh"'
    return built, left, atlas.key_points, cloth, prepared


def outfit_stages(scene: Scene) -> tuple[dict[str, str], dict[str, str], int, list[Prepared]]:
    """The same of several garments: stages that are built, those left out, the key points of all, and what is laid out
    of each one's cloth."""
    parts = dressed_parts(scene)
    assert isinstance(parts.garment, Outfit)
    fibre = scene.outfit[0].representation == "fibre"
    prepared = (
        [woven(one, part) for one, part in zip(scene.garments, parts.garment.parts, strict=True)] if fibre else []
    )
    built, left = _worn_stages(scene, parts, scene.garments)
    built["meshes"] = "the body and the garments"
    stages = [material_stage, lambda one: within_stages(one)[0]]
    for number, one in enumerate(scene.garments):
        found = {name: said for stage in stages for name, said in stage(one).items()}
        if fibre:
            found["weave"] = _woven_line(prepared[number])
        for name, said in found.items():
            built[name] = "; ".join(filter(None, (built.get(name), f"{one.title}: {said}")))
    if not fibre:
        left["fibre blocks"] = 'garment.representation is "mesh"'
    return built, left, parts.garment.atlas.key_points, prepared


def _woven_line(prepared: Prepared) -> str:
    """Of a cloth on cells."""
    assert prepared.cells is not None
    layout, (across, along) = prepared.layout, prepared.cells.per_cell
    per_cm = 0.01 / layout.warp.pitch, 0.01 / layout.weft.pitch
    name = prepared.draft.name or "draft"
    return f"{name}, {per_cm[0]:.1f} × {per_cm[1]:.1f} a cm, {across} × {along} to a cell of key points"


def _worn_stages(scene: Scene, parts: Parts, ones: Sequence[Scene]) -> tuple[dict[str, str], dict[str, str]]:
    """What garments have in common, be it one or several. ones: each as a scene of its own."""
    garment, (a, b) = parts.garment, parts.garment.atlas.spacing
    worn, gaps = garment_colliders(parts), parts.gaps
    kinds = [*(p.kind for p in worn.primitives), *("distance grid" for _ in worn.grids)]
    counted = ", ".join(f"{kinds.count(k)} {k}{'s' * (kinds.count(k) > 1)}" for k in dict.fromkeys(kinds))
    moves = motion_of(scene, parts.body)
    each = garment.parts if isinstance(garment, Outfit) else (garment,)
    patterns = [one.pattern for one in each]
    named = [pattern.name if len(ones) == 1 else one.title for one, pattern in zip(ones, patterns, strict=True)]
    cut = [
        f"{name}: {len(one.panels)} panels, {len(one.seams)} seams, {sum(panel.area for panel in one.panels):.2f} m²"
        for name, one in zip(named, patterns, strict=True)
    ]
    materials = ", ".join(dict.fromkeys(one.material for one in ones))
    built = {
        "body": f"{parts.body.name}, {100 * parts.body.stature:.0f} cm, {len(parts.body.vertices):,} vertices",
        "pattern": "; ".join(cut),
        "sheet": f"{garment.atlas.key_points:,} key points, {1e3 * a:.1f} × {1e3 * b:.1f} mm apart, {materials}",
        "seams": f"{len(garment.seams()[0])} ties, {len(garment.holds()[0])} to the body",
        "contact": f"{counted}, {gaps.said(worn.solids)}, friction {parts.friction:g}",
    }
    built |= _solver(scene, parts)
    left = {}
    if moves.name == "rest":
        hang = "the garment hangs as it was" if len(ones) == 1 else "garments hang as they were"
        left["motion"] = f'body.motion is "rest": {hang} sewn'
    else:
        built["motion"] = moves.name
    for more_built, more_left in (
        force_stages(garment_forces(scene, parts), gaps),
        thin_limbs(worn, hypot(a, b)),
    ):
        built |= more_built
        left |= more_left
    return built, left


def _solver(scene: Scene, parts: Parts) -> dict[str, str]:
    section = scene.solver or SolverSection()
    choice, step = garment_choice(scene, parts), None if section.step_ms is None else 1e-3 * section.step_ms
    kind, sheet = named_solver(choice.name), parts.garment.moving()
    solver = kind(sheet, Forces(), frame_rate=float(scene.output.fps), step=step, safety=section.safety)
    return solver_stages(choice, solver, scene)
