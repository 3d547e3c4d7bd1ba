"""What a scene will build and what it leaves out, counted before anything runs."""

from dataclasses import dataclass

from taichi_cloth.fibre.contours import contour
from taichi_cloth.fibre.fibre import lattice_point_count
from taichi_cloth.fibre.sphere_set import sphere_set_from_rows
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.memory import memory_limit
from taichi_cloth.yarn.yarn import Yarn

from ...render.data.light_sizes import light_bytes
from ..prepare.drawing import LIT, drawn_bytes, has_floor, picture_bytes
from ..prepare.weave_layout import Prepared, prepare_fabric
from ..prepare.yarns import fibre_kind, yarn_of
from ..scene.schema import Scene

__all__ = ["Plan", "Stage", "plan"]


@dataclass(frozen=True)
class Stage:
    """A step of the pipeline: whether it is built, and what of, or why not."""

    name: str
    built: bool
    why: str


@dataclass(frozen=True)
class Plan:
    """stages in the order they run; key_points, blocks, particles (exact unless `about`), bytes; notes."""

    stages: tuple[Stage, ...]
    key_points: int
    blocks: int
    particles: int
    about: bool
    bytes: int
    limit: int
    notes: tuple[str, ...]
    prepared: Prepared | None = None


def plan(scene: Scene) -> Plan:
    """Count a scene. Raises InputError as building it would, where that shows before a particle is made."""
    subject = scene.subject
    fibre = fibre_kind(scene)
    source = "own sphere set" if scene.fibre.spheres is not None else fibre.name
    built: dict[str, str] = {}
    left: dict[str, str] = {}
    key_points = blocks = particles = 0
    about = False
    notes: tuple[str, ...] = ()
    prepared = None
    woven = None
    if scene.cloth:
        from ..prepare.sheet_setup import woven_scene  # loads Taichi, which a plan of what lies still does without
        from .plan_cloth import sheet_stages

        woven = woven_scene(scene) if scene.cloth.representation == "fibre" else None
        sheet_built, sheet_left = sheet_stages(scene)
        built |= sheet_built
        left |= sheet_left
        key_points = scene.cloth.rows * scene.cloth.columns
    if subject == "garment":
        from .plan_garment import garment_stages

        sheet_built, sheet_left, key_points, woven = garment_stages(scene)
        built |= sheet_built
        left |= sheet_left
    elif subject == "fabric":
        woven = scene
    if subject in ("cloth", "garment") and not scene.yarn:
        left["fibre lattice"] = "only a scene of one fibre needs it"
        left["yarn"] = "the scene has no [yarn]"
    elif subject == "fibre":
        rows = scene.fibre.spheres
        spheres = (
            sphere_set_from_rows(rows)
            if rows is not None
            else contour(scene.fibre.kind, length_m=scene.fibre.length_um * 1e-6)
        )
        particles = lattice_point_count(spheres, spacing_m=scene.fibre.spacing_um * 1e-6)
        about = True
        built["fibre lattice"] = f"{len(spheres.radii):,} spheres of {source}; at most {particles:,} lattice points"
        left["yarn"] = "the scene has no [yarn]"
    else:
        assert scene.yarn is not None
        left["fibre lattice"] = f"only a scene of one fibre needs it; {source} gives density, fineness, colour, finish"
        yarn = yarn_of(scene.yarn, fibre)
        built["yarn"] = _yarn_line(yarn, scene.yarn.fibres)
    if subject == "twist" and scene.twist and scene.yarn:
        s, yarn = scene.twist, yarn_of(scene.yarn, fibre)
        length = 1e-3 * (s.zone_a_mm + s.zone_b_mm + 2 * s.feed_mm + s.speed_mm_per_s * s.duration_s)
        particles = int(length / (yarn.diameter / 5)) * yarn.plies * min(scene.yarn.fibres, yarn.fibres_in_section)
        about = True
        built["twist"] = f"zones of {s.zone_a_mm:g} and {s.zone_b_mm:g} mm, {scene.output.frames} frames"
    elif subject not in ("fibre", "cloth", "garment"):
        left["twist"] = "the scene has no [twist]"
    if subject == "yarn" and scene.yarn:
        yarn = yarn_of(scene.yarn, fibre)
        steps = 10 * max(4, round(scene.yarn.length_mm * 1e-3 / (yarn.diameter * 1.2)))
        particles, about = steps * yarn.plies * min(scene.yarn.fibres, yarn.fibres_in_section), True
    if woven is not None:
        prepared = prepare_fabric(woven, streamed=subject == "fabric")
        layout = prepared.layout
        built["yarn"] = _yarn_line(layout.warp.yarn, layout.detail.fibres)
        blocks, particles = len(layout.blocks.kind), prepared.particles
        key_points = key_points or layout.key_points
        notes = prepared.notes
        picks, ends = layout.cloth.warp_up.shape
        built["weave"] = f"{prepared.draft.name or 'draft'}: {ends} ends × {picks} picks"
        built["fibre blocks"] = f"{len(layout.kinds.section)} kinds of path, {layout.detail.variants} variants"
        if not (layout.warp.yarn.hairiness.ends_per_m or layout.warp.yarn.hairiness.loops_per_m):
            left["hairs"] = "yarn.hairiness is 0"
    elif scene.garment:
        left["weave"] = "nothing is drawn of it"
    elif scene.cloth:
        left["fibre blocks"] = 'cloth.representation is "mesh"'
    else:
        left["weave"] = "the scene has no [weave]"
        left["fibre blocks"] = "the scene has no [weave]"
    drawn = "elongated splats, analytic alpha" if scene.fibre.sprite in ("thread", "soft") else "textured sprites"
    built["splatter"] = f"{scene.output.size[0]} × {scene.output.size[1]} px, {drawn}"
    held = particles
    if prepared is not None and prepared.in_batches:
        built["splatter"] += ", in batches of what is in view"
        held = LIT
        if scene.fibre.sprite not in ("thread", "soft"):
            raise InputError(
                f"fibre.sprite: {scene.fibre.sprite!r}; a fabric of {particles:,} particles is drawn in batches, which "
                'have no textures: take "thread" or "soft", or fewer weave.ends and weave.picks'
            )
    lamps = 2 if scene.light.rim_strength > 0 else 1
    if scene.light.shadows:
        built["light pass"] = f"transmittance of fibres to {lamps} light{'s' * (lamps > 1)}, once a pose and direction"
    else:
        left["light pass"] = "light.shadows is false"
    if scene.light.occlusion and scene.light.fill_strength > 0:
        built["occlusion"] = "the sky that fibres leave each other, from ten maps all round, once a pose"
    else:
        why = "light.occlusion is false" if not scene.light.occlusion else "light.fill_strength is 0"
        left["occlusion"] = f"{why}; the depth in the yarn stands for it"
    if has_floor(scene):
        layers = "from layers of the subject by height"
        alike = f"shadows of the key light and of the sky {layers}"
        built["floor"] = f"the key light's shadow from its map, the sky's {layers}" if scene.light.shadows else alike
    else:
        lies = subject == "fabric"
        left["floor"] = "stage.ground is false" if lies else "only fabrics lie on one, and cloth with [forces.plane]"
    if "meshes" not in built:
        left["meshes"] = "the scene has none"
    left["passes"] = "no depth, normal or id buffers; `still --passes` asks for them"
    order = (
        *("fibre lattice", "yarn", "hairs", "twist", "weave", "fibre blocks"),
        *("body", "pattern", "sheet", "seams", "solver", "pins", "wind", "strain limit", "contact"),
        *("thin limbs", "cloth on cloth", "motion"),
        *("light pass", "occlusion", "floor", "meshes", "splatter", "passes"),
    )
    stages = tuple(
        Stage(name, name in built, built.get(name) or left[name]) for name in order if name in built or name in left
    )
    total = prepared.bytes if prepared else drawn_bytes(particles)
    occlusion = scene.light.occlusion and scene.light.fill_strength > 0
    total += picture_bytes(scene.output.size)
    total += light_bytes(held, shadows=lamps if scene.light.shadows else 0, occlusion=occlusion)
    return Plan(stages, key_points, blocks, particles, about, total, memory_limit(), notes, prepared)


def _yarn_line(yarn: Yarn, fibres: int) -> str:
    return (
        f"{yarn.plies} × {yarn.count_tex:.1f} tex, {yarn.twist_per_m:.0f} turns/m {yarn.twist}; "
        f"{min(fibres, yarn.fibres_in_section)} of {yarn.fibres_in_section} fibres a ply drawn"
    )
