"""What a moving cloth will build, in words."""

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.constraints.thin_limbs import let_through, thinnest_held
from taichi_cloth.mechanics.presets import WITHIN
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.solver import Solver
from taichi_cloth.solvers.choice import Choice

from ..prepare.construction import own_material
from ..prepare.gaps import SheetGaps, gaps_of
from ..prepare.sheet_setup import choice_of, forces_of, moved_by, sheet_of, solver_of, standing_in
from ..scene.schema import Scene
from .plan import MATERIAL

__all__ = ["LAYERS", "force_stages", "material_stage", "sheet_stages", "solver_stages", "thin_limbs", "within_stages"]

LAYERS, THIN, WITHIN_CLOTH = "cloth on cloth", "thin limbs", "within cloth"


def thin_limbs(body: Colliders, diagonal: float) -> tuple[dict[str, str], dict[str, str]]:
    """Whether the middles of springs are met, and by what, and why or why not. diagonal: of a cell [m]."""
    thin = let_through(body, diagonal)
    if not len(thin):
        held = 1e3 * thinnest_held(diagonal, body.gap + min(body.wider))
        return {}, {THIN: f"key points keep out all of the body: from {held:.1f} mm radius on"}
    least = 1e3 * max(thinnest_held(diagonal, body.gap + body.wider[number], middles=True) for number in thin)
    parts = ", ".join(dict.fromkeys(body.solids[number].part or f"number {number}" for number in thin))
    return {THIN: f"the middles of springs meet {parts}; enough from {least:.1f} mm radius on"}, {}


def solver_stages(choice: Choice, solver: Solver, scene: Scene) -> dict[str, str]:
    """Who moves the sheet, by how many steps, and what that costs beside the other solver."""
    rate = scene.output.fps
    costs = ", ".join(
        f"{name} about {_short(cost.milliseconds(rate))} ms a frame ({cost.substeps(rate):,} substeps)"
        for name, cost in choice.costs.items()
    )
    return {
        "devices": solver.lacks,
        "solver": f"{choice.name}, {solver.substeps} substeps a frame of 1/{rate} s, {1e6 * solver.step:.1f} µs each; "
        f"{scene.output.frames} frames",
        "solver's cost": f"{costs}; threads up to {_short(choice.ratio)} times as stiff as shear; {choice.why}",
    }


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def force_stages(forces: Forces, gaps: SheetGaps) -> tuple[dict[str, str], dict[str, str]]:
    """What acts beside springs and contact: what is built of it, and what is left out. gaps: that the scene keeps."""
    built: dict[str, str] = {}
    wind, limit, layers = forces.wind, forces.strain_limit, forces.self_contact
    if wind:
        speed = sum(v * v for v in wind.velocity) ** 0.5
        built["wind"] = f"{speed:.1f} m/s, gusts of {100 * wind.gusts:.0f} %"
    if limit:
        built["strain limit"] = f"{100 * limit.strain:g} %, {limit.passes} passes a substep"
    if layers:
        built[LAYERS] = f"{gaps.layers.said}; friction {layers.friction:g}"
    keys = {"wind": "wind", "strain limit": "strain_limit"}
    left = {stage: f"the scene has no [forces.{key}]" for stage, key in keys.items() if stage not in built}
    return built, left if layers else left | {LAYERS: "the scene leaves forces.self_contact out"}


def material_stage(scene: Scene) -> dict[str, str]:
    """What a cloth moves by, each number with where it is from."""
    groups: dict[str, list[str]] = {}
    for quantity in moved_by(scene).values():
        groups.setdefault(quantity.provenance, []).append(f"{quantity.name} {quantity.shown}")
    return {MATERIAL: "; ".join(f"{', '.join(named)} ({why})" for why, named in groups.items())}


def within_stages(scene: Scene) -> tuple[dict[str, str], dict[str, str]]:
    """Friction within the cloth, torsion and locking: what moves with it, and what is left out."""
    section = scene.cloth or scene.garment
    assert section is not None
    moves, built, left = moved_by(scene), [], []
    for name, keys in WITHIN.items():
        found = [moves[key] for key in keys if key in moves]
        built += [f"{one.name} {one.shown}" for one in found]
        left += [] if found else [name]
    without = f"without {', '.join(left)}: {'cloth' if scene.cloth else 'garment'}.properties.within leaves them out"
    if not built:
        return {}, {WITHIN_CLOTH: f'{without}; "all" takes about a fifth longer'}
    return {WITHIN_CLOTH: "; ".join([*built, *([without] if left else [])])}, {}


def sheet_stages(scene: Scene) -> tuple[dict[str, str], dict[str, str]]:
    """Stages that are built, with what of, and those left out, with why. Raises InputError as building would."""
    cloth = scene.cloth
    assert cloth is not None
    gaps = gaps_of(scene)
    sheet, forces = sheet_of(cloth, scene.solver, own_material(scene)), forces_of(scene.forces, gaps)
    solver = solver_of(sheet, forces, scene.solver, frame_rate=float(scene.output.fps))
    s = sheet.springs
    law = "hinges" if s.law == "hinge" else "springs to second neighbours"
    built = {
        "sheet": (
            f"{cloth.rows} × {cloth.columns} key points, {1e3 * s.spacing_x:.1f} × {1e3 * s.spacing_y:.1f} mm apart, "
            f"{scene.material}; bending by {law}"
        ),
    }
    built |= material_stage(scene)
    built |= solver_stages(choice_of(sheet, forces, scene.solver), solver, scene)
    left: dict[str, str] = {}
    held = int(sheet.pinned.sum())
    body, standing = scene.body, standing_in(scene)
    if body:
        moved = "standing still" if body.motion == "rest" else f"motion {body.motion}"
        built["body"] = f"{body.source} {body.gender if body.source in ('built-in', 'anny') else ''}".rstrip()
        built["body"] += f", {moved}; skin, skeleton and {body.contact}"
    else:
        left["body"] = left[THIN] = "the scene has no [body]"
    if standing is not None:
        thin = thin_limbs(standing.colliders, s.diagonal_length)
        for stages, more in zip((built, left), thin, strict=True):
            stages |= more
    if held:
        pull = f", pulled apart by {cloth.pins.pull_mm:g} mm" if cloth.pins.pull_mm else ""
        at = (*cloth.pins.edges, *cloth.pins.corners, *(f"the body's {pin.bone}" for pin in cloth.pins.body))
        built["pins"] = f"{held} key points at {', '.join(at)}{pull}"
    else:
        left["pins"] = "cloth.pins names none"
    for both in (within_stages(scene), force_stages(forces, gaps)):
        for stages, more in zip((built, left), both, strict=True):
            stages |= more
    ball = f"a ball of {forces.sphere.radius:g} m, {gaps.ball.said}" if forces.sphere else ""
    floor = f"a floor at {forces.plane.height:g} m, {gaps.floor.said}" if forces.plane else ""
    person = ""
    if body and standing is not None:
        person = f"the body's {body.contact}, µ {cloth.friction:g}, {gaps.said(standing.colliders.solids)}"
    if ball or floor or person:
        built["contact"] = "; ".join(filter(None, (person, ball, floor)))
    else:
        left["contact"] = "the scene has neither [body], [forces.sphere] nor [forces.plane]"
    shown = (cloth.representation == "mesh", "the sheet"), (bool(ball), "the ball"), (bool(body), "the body's skin")
    meshes = [name for drawn, name in shown if drawn]
    if meshes:
        built["meshes"] = " and ".join(meshes)
    return built, left
