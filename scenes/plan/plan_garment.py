"""What a garment will build, in words."""

from math import hypot

from taichi_cloth.constraints.ties import MOST_AT_ONCE, Ties
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
from ..prepare.weave_layout import Prepared
from ..scene.cloth_schema import ForcesSection, SolverSection
from ..scene.garment_schema import CLEAR
from ..scene.schema import Scene
from .plan_cloth import LAYERS, force_stages, material_stage, solver_stages, thin_limbs, within_stages

__all__ = ["garment_stages"]


def garment_stages(scene: Scene) -> tuple[dict[str, str], dict[str, str], int, Scene | None, Prepared | None]:
    """Stages that are built, with what of, those left out, with why, the key points, the cloth as a
    scene, and what is laid out of it where it has a sett."""
    section = scene.garment
    assert section is not None
    parts = dressed_parts(scene)
    pattern, atlas = parts.garment.pattern, parts.garment.atlas
    a, b = atlas.spacing
    worn, gaps = garment_colliders(scene, parts), parts.gaps
    kinds = [*(p.kind for p in worn.primitives), *("distance grid" for _ in worn.grids)]
    counted = ", ".join(f"{kinds.count(k)} {k}{'s' * (kinds.count(k) > 1)}" for k in dict.fromkeys(kinds))
    moves = motion_of(scene, parts.body)
    built = {
        "body": f"{parts.body.name}, {100 * parts.body.stature:.0f} cm, {len(parts.body.vertices):,} vertices",
        "pattern": f"{pattern.name}: {len(pattern.panels)} panels, {len(pattern.seams)} seams, "
        f"{sum(p.area for p in pattern.panels):.2f} m²",
        "sheet": f"{atlas.key_points:,} key points, {1e3 * a:.1f} × {1e3 * b:.1f} mm apart, {scene.material}",
        "seams": f"{len(parts.garment.seams()[0])} ties, {len(parts.garment.holds()[0])} to the body",
        "contact": f"{counted}, {gaps.said(worn.solids)}, friction {section.friction:g}",
        "meshes": "the body" if section.representation == "fibre" else "the body and the garment",
    }
    if section.weaves:
        built["weaves"] = ", ".join(f"{name}: {draft}" for name, draft in section.weaves.items())
    built |= material_stage(scene)
    built |= _solver(scene, parts)
    if max(len(parts.garment.seams()[0]), len(parts.garment.holds()[0])) > MOST_AT_ONCE:
        built["devices"] = ", ".join(filter(None, (built["devices"], Ties.known_as)))
    left = {}
    if moves.name == "rest":
        left["motion"] = 'body.motion is "rest": the garment hangs as it was sewn'
    else:
        built["motion"] = moves.name
    for more_built, more_left in (
        within_stages(scene),
        force_stages(garment_forces(scene, parts), gaps),
        thin_limbs(worn, hypot(a, b)),
    ):
        built |= more_built
        left |= more_left
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


def _solver(scene: Scene, parts: Parts) -> dict[str, str]:
    section = scene.solver or SolverSection()
    choice, step = garment_choice(scene, parts), None if section.step_ms is None else 1e-3 * section.step_ms
    kind, sheet = named_solver(choice.name), parts.garment.moving()
    solver = kind(sheet, Forces(), frame_rate=float(scene.output.fps), step=step, safety=section.safety)
    return solver_stages(choice, solver, scene)
