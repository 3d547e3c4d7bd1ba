"""What a scene will build and what it leaves out, counted before anything runs."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from taichi_cloth.fabric.layout import drawn_density
from taichi_cloth.fibre.fibre import lattice_point_count
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.memory import memory_limit
from taichi_cloth.yarn.yarn import Yarn

from ...render.data.light_sizes import light_bytes
from ..prepare.drawing import (
    CELLS_LIT,
    LAYERS_BYTES,
    LIT,
    MESH_BYTES,
    MOTION_BYTES,
    PROCESS_BYTES,
    SAMPLED_BYTES,
    drawn_bytes,
    has_floor,
    picture_bytes,
)
from ..prepare.fibre_count import EVERY
from ..prepare.sett import on_cells
from ..prepare.strands import fibre_spheres, twist_particles, yarn_piece
from ..prepare.weave_layout import Prepared, prepare_fabric
from ..prepare.yarns import fibre_kind, yarn_of
from ..scene.schema import Scene

__all__ = ["MATERIAL", "Plan", "PlannedStage", "plan"]

MATERIAL = "material"
"""The stage of what cloth weighs and moves by."""


@dataclass(frozen=True)
class PlannedStage:
    """A step of the pipeline: whether it is built, and what of, or why not."""

    name: str
    built: bool
    why: str


@dataclass(frozen=True)
class Plan:
    """stages in the order they run; key_points, blocks, particles (exact unless `about`), bytes; notes."""

    stages: tuple[PlannedStage, ...]
    key_points: int
    blocks: int
    particles: int
    about: bool
    bytes: int
    limit: int
    notes: tuple[str, ...]
    prepared: Prepared | None = None
    lacks: str = ""
    """What of the motion has no parallel form, so that a run on another device takes the CPU; "" where all has one."""


DEVICES = "devices"

ORDER = (
    *("fibre lattice", "yarn", "hairs", "twist", "weave", "fibre blocks"),
    *(
        "body",
        "pattern",
        "sheet",
        MATERIAL,
        "within cloth",
        "seams",
        "solver",
        "solver's cost",
        "pins",
        "wind",
        "strain limit",
    ),
    *("contact", "thin limbs", "cloth on cloth", "motion", DEVICES),
    *("light pass", "occlusion", "floor", "meshes", "splatter", "passes"),
)
"""In which stages run."""


@dataclass
class _Counted:
    """What is known so far. built, left: stages to what of, and to why not. woven: the cloth as a scene of its own.
    worn: those of several garments."""

    built: dict[str, str] = field(default_factory=dict)
    left: dict[str, str] = field(default_factory=dict)
    key_points: int = 0
    blocks: int = 0
    particles: int = 0
    about: bool = False
    woven: Scene | None = None
    prepared: Prepared | None = None
    worn: Sequence[Prepared] = ()
    lacks: str = ""


def plan(scene: Scene) -> Plan:
    """Count a scene. Raises InputError as building it would, where that shows before a particle is made."""
    counted = _Counted()
    _count_cloth(scene, counted)
    _count_strands(scene, counted)
    _count_weave(scene, counted)
    _count_drawing(scene, counted)
    built, left, prepared = counted.built, counted.left, counted.prepared
    stages = tuple(
        PlannedStage(name, name in built, built.get(name) or left[name])
        for name in ORDER
        if name in built or name in left
    )
    return Plan(
        stages,
        counted.key_points,
        counted.blocks,
        counted.particles,
        counted.about,
        _bytes(scene, counted),
        memory_limit(),
        prepared.notes if prepared else tuple(note for one in counted.worn for note in one.notes),
        prepared,
        counted.lacks,
    )


def _count_cloth(scene: Scene, counted: _Counted) -> None:
    """Key points and stages of a sheet or a garment, and what is woven."""
    if scene.cloth:
        # These load Taichi, which a plan of what lies still does without.
        from ..prepare.cell_layout import prepare_sheet
        from ..prepare.sheet_setup import woven_scene
        from .plan_cloth import sheet_stages

        scene = on_cells(scene)
        assert scene.cloth is not None
        if scene.cloth.representation == "fibre":
            counted.prepared = prepare_sheet(scene)
            counted.woven = woven_scene(scene) if counted.prepared is None else scene
        built, left = sheet_stages(scene)
        counted.key_points = scene.cloth.rows * scene.cloth.columns
    elif scene.garment:
        from .plan_garment import garment_stages

        built, left, counted.key_points, counted.woven, counted.prepared = garment_stages(scene)
    elif scene.outfit:
        from .plan_garment import outfit_stages

        built, left, counted.key_points, counted.worn = outfit_stages(scene)
        counted.blocks = sum(one.cells.blocks for one in counted.worn if one.cells)
        counted.particles, counted.about = sum(one.particles for one in counted.worn), bool(counted.worn)
    else:
        counted.woven = scene if scene.weave else None
        return
    counted.lacks = built.get(DEVICES, "")
    built[DEVICES] = (
        f"--arch other than cpu: none, {counted.lacks} has no parallel form yet, and the whole run takes the CPU"
        if counted.lacks
        else "--arch of any device: all of the motion and of the drawing runs there"
    )
    counted.built |= built
    counted.left |= left


def _count_strands(scene: Scene, counted: _Counted) -> None:
    """The fibre, the yarn, the yarn being twisted."""
    built, left, subject = counted.built, counted.left, scene.subject
    fibre = fibre_kind(scene)
    source = "own sphere set" if scene.fibre.spheres is not None else fibre.name
    if subject == "outfit":
        pass
    elif subject in ("cloth", "garment") and not scene.yarn:
        left["fibre lattice"] = "only a scene of one fibre needs it"
        left["yarn"] = "the scene has no [yarn]"
    elif subject == "fibre":
        spheres = fibre_spheres(scene)
        particles = lattice_point_count(spheres, spacing_m=scene.fibre.spacing_um * 1e-6)
        counted.particles, counted.about = particles, True
        built["fibre lattice"] = f"{len(spheres.radii):,} spheres of {source}; at most {particles:,} lattice points"
        left["yarn"] = "the scene has no [yarn]"
    else:
        assert scene.yarn is not None
        left["fibre lattice"] = f"only a scene of one fibre needs it; {source} gives density, fineness, colour, finish"
        built["yarn"] = _yarn_line(yarn_of(scene.yarn, fibre), scene.yarn.fibres or EVERY)
    if subject == "twist" and scene.twist:
        counted.particles, counted.about = twist_particles(scene), True
        zones = f"zones of {scene.twist.zone_a_mm:g} and {scene.twist.zone_b_mm:g} mm"
        built["twist"] = f"{zones}, {scene.output.frames} frames"
    elif subject != "fibre" and not scene.is_soft:
        left["twist"] = "the scene has no [twist]"
    if subject == "yarn":
        counted.particles, counted.about = yarn_piece(scene).particles, True


def _count_weave(scene: Scene, counted: _Counted) -> None:
    """The weave and its fibre blocks. Raises InputError as laying it out would."""
    built, left = counted.built, counted.left
    if counted.woven is not None:
        prepared = counted.prepared or prepare_fabric(counted.woven, streamed=scene.subject == "fabric")
        counted.prepared, layout = prepared, prepared.layout
        built["yarn"] = _yarn_line(layout.warp.yarn, layout.detail.fibres)
        counted.blocks, counted.particles = len(layout.blocks.kind), prepared.particles
        counted.key_points = counted.key_points or layout.key_points
        picks, ends = layout.cloth.warp_up.shape
        if prepared.cells is not None:
            (ends, picks), counted.blocks = prepared.cells.woven, prepared.cells.blocks
            counted.about = True
        built["weave"] = f"{prepared.draft.name or 'draft'}: {ends} ends × {picks} picks"
        if prepared.cells is not None:
            across, along = prepared.cells.per_cell
            per_cm = 0.01 / layout.warp.pitch, 0.01 / layout.weft.pitch
            built["weave"] += (
                f", {per_cm[0]:.1f} × {per_cm[1]:.1f} a cm, {across} × {along} to a cell of key points; "
                "made where a picture shows them"
            )
        if not (scene.cloth or scene.garment):
            built[MATERIAL] = f"areal density {1e3 * drawn_density(layout):.0f} g/m², of the threads as drawn"
        built["fibre blocks"] = f"{len(layout.kinds.section)} kinds of path, {layout.detail.variants} variants"
        if not (layout.warp.yarn.hairiness.ends_per_m or layout.warp.yarn.hairiness.loops_per_m):
            left["hairs"] = "yarn.hairiness is 0"
    elif counted.worn:
        built["fibre blocks"] = "of each garment's own threads, made where a picture shows them"
    elif scene.is_worn:
        left["weave"] = "nothing is drawn of it"
    elif scene.cloth:
        left["fibre blocks"] = 'cloth.representation is "mesh"'
    else:
        left["weave"] = "the scene has no [weave]"
        left["fibre blocks"] = "the scene has no [weave]"


def _count_drawing(scene: Scene, counted: _Counted) -> None:
    """The splatter, light, floor and passes. Raises InputError for a sprite that cannot be drawn so."""
    built, left = counted.built, counted.left
    analytic = scene.fibre.sprite in ("thread", "soft")
    drawn = "elongated splats, analytic alpha" if analytic else "textured sprites"
    built["splatter"] = f"{scene.output.size[0]} × {scene.output.size[1]} px, {drawn}"
    if counted.prepared is not None and counted.prepared.in_batches:
        built["splatter"] += ", in batches of what is in view"
        if not analytic:
            raise InputError(
                f"fibre.sprite: {scene.fibre.sprite!r}; a fabric of {counted.particles:,} particles is drawn in "
                'batches, which have no textures: take "thread" or "soft", or fewer weave.ends and weave.picks'
            )
    lamps = _lamps(scene)
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
        lies = scene.subject == "fabric"
        left["floor"] = "stage.ground is false" if lies else "only fabrics lie on one, and cloth with [forces.plane]"
    if "meshes" not in built:
        left["meshes"] = "the scene has none"
    left["passes"] = "no depth, normal or id buffers; `still --passes` asks for them"


def _lamps(scene: Scene) -> int:
    return 2 if scene.light.rim_strength > 0 else 1


def _bytes(scene: Scene, counted: _Counted) -> int:
    """Memory of the whole process at its peak."""
    prepared = counted.prepared
    held = counted.particles
    if prepared is not None and prepared.in_batches:
        held = min(held, LIT if prepared.cells is None else CELLS_LIT)
    if counted.worn:
        held = CELLS_LIT * len(counted.worn)
    shadows = _lamps(scene) if scene.light.shadows else 0
    occlusion = scene.light.occlusion and scene.light.fill_strength > 0
    total = prepared.bytes if prepared else drawn_bytes(0 if counted.worn else counted.particles)
    total += sum(one.bytes for one in counted.worn)
    total += light_bytes(held, shadows=shadows, occlusion=occlusion)
    meshes = "meshes" in counted.built
    total += MESH_BYTES * meshes + MOTION_BYTES * scene.is_soft
    total += LAYERS_BYTES * ("cloth on cloth" in counted.built)
    if prepared is not None and not prepared.in_batches:
        total += SAMPLED_BYTES * scene.output.size[0] * scene.output.size[1]
    return PROCESS_BYTES + total + picture_bytes(scene.output.size, meshes=meshes)


def _yarn_line(yarn: Yarn, fibres: int) -> str:
    return (
        f"{yarn.plies} × {yarn.count_tex:.1f} tex, {yarn.twist_per_m:.0f} turns/m {yarn.twist}; "
        f"{min(fibres, yarn.fibres_in_section)} of {yarn.fibres_in_section} fibres a ply drawn"
    )
