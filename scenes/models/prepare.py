"""From a scene's words to the core's objects: yarns, drafts, thread spacings and a fabric's layout.

All of it on the host and without a particle, so that `plan` can say what a scene needs and a limit can refuse it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.layout import Detail, FabricLayout, Threads, lay_out, required_bytes
from taichi_cloth.fabric.templates import particle_count, particles_per_body_block
from taichi_cloth.fibre.contours import FIBRES, FibreKind
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.memory import memory_limit, require_memory
from taichi_cloth.weave.colour_order import colour as colour_named
from taichi_cloth.weave.colour_order import coloured
from taichi_cloth.weave.crimp import Interlacing
from taichi_cloth.weave.draft import Draft, named_weave, tile
from taichi_cloth.weave.jamming import fit_balance, fit_diameters
from taichi_cloth.weave.wif import read_wif
from taichi_cloth.yarn.yarn import Hairiness, Yarn, ne_to_tex

from ..scene.schema import FabricSection, Scene, Weave, YarnSection

__all__ = [
    "DRAW_BYTES",
    "LIT",
    "Prepared",
    "draft_of",
    "fibre_kind",
    "has_floor",
    "picture_bytes",
    "prepare_fabric",
    "require_picture",
    "yarn_colours",
    "yarn_of",
]

F32 = NDArray[np.float32]

DRAW_BYTES = 130  # what the splatter keeps for a particle while it draws
PIXEL_BYTES = 210
"""What a picture takes for a pixel of its canvas, with what stands behind and the conversion to a file: 190 to 202 were
measured at 512² and 3072²."""

HELD = 4_000_000
"""Particles of a fabric beyond which it is drawn in batches."""
LIT = 1_000_000
"""Particles of the sample of it that then casts light."""
STREAM_BYTES = 400_000_000  # a batch of a million particles, a sample of as many, what the splatter keeps of them
DEFAULT_THREADS = 40
DEFAULT_COUNT_TEX = 20.0
LARGEST_COUNT_TEX = 10_000.0
DEFAULT_OPENING = 1.02  # spacing of threads over the closest possible, where a scene states none


@dataclass(frozen=True)
class Prepared:
    """A fabric counted but not built. particles: exact. bytes: of the build and of drawing it. in_batches: as its
    particles are too many to hold."""

    draft: Draft
    layout: FabricLayout
    particles: int
    bytes: int
    notes: tuple[str, ...]
    in_batches: bool = False


def fibre_kind(scene: Scene) -> FibreKind:
    """The scene's fibre. Raises InputError for a kind that is not known."""
    kind = scene.fibre.kind
    if kind not in FIBRES:
        raise InputError(f"fibre.kind: unknown fibre {kind!r}; known: {', '.join(FIBRES)}{did_you_mean(kind, FIBRES)}")
    return FIBRES[kind]


def yarn_colours(scene: Scene) -> tuple[F32, F32]:
    """Of the warp's yarn and the weft's, linear, where no thread order says otherwise: its own, or the fibre's."""
    plain = np.asarray(fibre_kind(scene).colour, np.float32)
    yarn = scene.yarn or YarnSection()
    warp, weft = (
        plain if family.colour is None else colour_named(family.colour) for family in (yarn, scene.weft_yarn or yarn)
    )
    return warp, weft


def yarn_of(section: YarnSection, fibre: FibreKind, *, diameter: float | None = None) -> Yarn:
    """A yarn as stated in a scene, of the scene's fibre.

    diameter: woven diameter [m] of a yarn whose count is not stated; it is twisted by the same twist multiplier as a
    yarn of the default count, turns ∝ 1/√tex.
    """
    stated = section.count_tex or (ne_to_tex(section.count_ne) if section.count_ne else None)
    count = stated or DEFAULT_COUNT_TEX
    tighter = 1.0
    if stated is None and diameter is not None:
        count = 1e6 * np.pi / 4 * diameter**2 * fibre.density_kg_m3 * section.packing / section.plies
        count = float(np.clip(count, fibre.fineness_dtex, LARGEST_COUNT_TEX))
        tighter = float(np.sqrt(DEFAULT_COUNT_TEX / count))
    return Yarn(
        count_tex=count,
        plies=section.plies,
        twist_per_m=section.twist_per_m * tighter,
        twist=section.twist,
        singles_twist_per_m=section.singles_twist_per_m * tighter,
        singles_twist=section.singles_twist,
        fibre_density=fibre.density_kg_m3,
        fineness_dtex=fibre.fineness_dtex,
        packing=section.packing,
        flattening=section.flattening,
        migration=section.migration,
        migration_period_mm=section.migration_period_mm,
        hairiness=Hairiness(**section.hairiness.model_dump()),
    )


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


def _draft(name: str, ends: int | None, picks: int | None) -> Draft:
    """A named weave or a WIF file, at its own size where none is stated."""
    if name.lower().endswith(".wif"):
        draft = read_wif(name)
        return tile(draft, ends=draft.ends if ends is None else ends, picks=draft.picks if picks is None else picks)
    return named_weave(
        name,
        ends=DEFAULT_THREADS if ends is None else ends,
        picks=DEFAULT_THREADS if picks is None else picks,
    )


def has_floor(scene: Scene) -> bool:
    """Whether the subject lies on a floor that shows its shadow: fabrics do unless the scene says otherwise, a moving
    cloth where there is one to fall on."""
    if scene.stage.ground is not None:
        return scene.stage.ground
    return scene.subject == "fabric" or (scene.forces is not None and scene.forces.plane is not None)


def picture_bytes(size: tuple[int, int], supersample: int = 1) -> int:
    """Memory of drawing one picture of (width, height) [px] with so many samples a pixel each way."""
    return PIXEL_BYTES * size[0] * size[1] * supersample**2


def require_picture(size: tuple[int, int], supersample: int = 1) -> None:
    """Refuses, with InputError, a picture that this machine has no memory for."""
    finer = f", {supersample} × {supersample} samples a pixel" if supersample > 1 else ""
    remedy = "take a smaller output.size" + (" or fewer samples" if supersample > 1 else "")
    require_memory(f"a picture of {size[0]} × {size[1]} px{finer}", picture_bytes(size, supersample), remedy)


def prepare_fabric(scene: Scene, *, streamed: bool = False) -> Prepared:
    """Lay out a scene's fabric. Raises InputError where it cannot be woven, or is too large for this machine.

    streamed: it can be drawn a batch of particles at a time, so that only its blocks must fit in memory.
    """
    assert scene.weave is not None
    assert scene.yarn is not None
    section = scene.fabric or FabricSection()
    fibre = fibre_kind(scene)
    weft_section = scene.weft_yarn or scene.yarn
    fibres = max(scene.yarn.fibres, weft_section.fibres)
    draft = draft_of(scene.weave)
    warp_yarn = yarn_of(
        scene.yarn, fibre, diameter=_asked(draft.warp_thickness_m, section, section.ends_per_cm, draft.warp_spacing_m)
    )
    weft_yarn = yarn_of(
        weft_section,
        fibre,
        diameter=_asked(draft.weft_thickness_m, section, section.picks_per_cm, draft.weft_spacing_m),
    )
    per_block = max(particles_per_body_block(y, fibres, section.steps) for y in (warp_yarn, weft_yarn))
    needed = required_bytes(draft.ends, draft.picks, per_block) + DRAW_BYTES * per_block * 2 * draft.warp_up.size
    remedy = "take fewer weave.ends and weave.picks, or lower yarn.fibres or fabric.steps"
    if streamed:
        needed = min(needed, required_bytes(draft.ends, draft.picks, 0) + STREAM_BYTES)
        remedy = "take fewer weave.ends and weave.picks"
    require_memory(f"weave of {draft.ends:,} ends × {draft.picks:,} picks", needed, remedy)

    notes = list(draft.notes)
    diameter = [
        np.full(n, yarn.woven_diameter) if stated is None else stated
        for n, yarn, stated in (
            (draft.ends, warp_yarn, draft.warp_thickness_m),
            (draft.picks, weft_yarn, draft.weft_thickness_m),
        )
    ]
    spacing = _spacings(draft, section, diameter)
    cloth, note = _woven(draft, section, spacing, diameter)
    if note:
        notes.append(note)
    own = yarn_colours(scene)
    families = []
    for room, thick, flat, stated, plain, yarn in (
        (spacing[0], cloth.warp_diameter_m, cloth.warp_flat_m, draft.warp_colour, own[0], warp_yarn),
        (spacing[1], cloth.weft_diameter_m, cloth.weft_flat_m, draft.weft_colour, own[1], weft_yarn),
    ):
        position = np.concatenate([[0.0], np.cumsum((room[1:] + room[:-1]) / 2)])
        shades = stated if stated is not None else np.tile(plain, (len(room), 1))
        families.append(Threads(position, thick, thick + flat, np.asarray(shades, np.float32), yarn))
    layout = lay_out(
        cloth,
        *families,
        detail=Detail(
            fibres=fibres,
            steps=section.steps,
            variants=section.variants,
            fringe=section.fringe,
            irregularity=section.irregularity,
            seed=scene.seed,
        ),
    )
    particles = particle_count(layout)
    fixed, total = required_bytes(draft.ends, draft.picks, 0), particles * (64 + DRAW_BYTES)
    in_batches = streamed and (particles > HELD or (total > STREAM_BYTES and fixed + total > memory_limit()))
    total = fixed + (STREAM_BYTES if in_batches else total)
    require_memory(f"a fabric of {particles:,} particles", total, remedy)
    return Prepared(draft, layout, particles, total, tuple(notes), in_batches)


def _asked(
    thickness: np.ndarray | None, section: FabricSection, per_cm: float | None, spacing: np.ndarray | None
) -> float | None:
    """Diameter [m] that the draft asks of a yarn: its thickness, or what fills its spacing in a square cloth."""
    if thickness is not None:
        return float(thickness.mean())
    room = 0.01 / per_cm if per_cm is not None else None if spacing is None else float(spacing.mean())
    root = float(np.sqrt(section.flattening))
    return None if room is None else room / (DEFAULT_OPENING * (np.sqrt(3.0) / root + root - 1.0 / root))


def _spacings(draft: Draft, section: FabricSection, diameter: list[np.ndarray]) -> list[np.ndarray]:
    """Room of each thread [m], warp then weft: the scene's threads/cm, else the draft's, else what just fits."""
    root = float(np.sqrt(section.flattening))
    passing = 0.5 * np.sqrt(3.0) * sum(float(d.max()) for d in diameter) / root  # Peirce's limit of a square cloth
    out = []
    for d, per_cm, stated in (
        (diameter[0], section.ends_per_cm, draft.warp_spacing_m),
        (diameter[1], section.picks_per_cm, draft.weft_spacing_m),
    ):
        if per_cm is not None:
            out.append(np.full(len(d), 0.01 / per_cm))
        elif stated is not None:
            out.append(np.asarray(stated, np.float64))
        else:
            out.append(np.full(len(d), DEFAULT_OPENING * (passing + float(d.max()) * (root - 1.0 / root))))
    return out


def _woven(
    draft: Draft, section: FabricSection, spacing: list[np.ndarray], diameter: list[np.ndarray]
) -> tuple[Interlacing, str]:
    """The weave with its sizes, and a note of what it took to make the threads fit; or the refusal, as asked.

    A yarn of diameter d lies flattened at equal area, d·√f wide and d/√f thick. Close sets are woven as a loom
    weaves them: first the crimp is shared otherwise, and only then is yarn thinned.
    """
    root = float(np.sqrt(section.flattening))

    def sized(factor: float, balance: float) -> Interlacing:
        return Interlacing(
            warp_up=draft.warp_up,
            warp_spacing_m=spacing[0],
            weft_spacing_m=spacing[1],
            warp_diameter_m=factor * diameter[0] / root,
            weft_diameter_m=factor * diameter[1] / root,
            warp_flat_m=factor * diameter[0] * (root - 1.0 / root),
            weft_flat_m=factor * diameter[1] * (root - 1.0 / root),
            balance=balance,
            periodic=False,
        )

    cloth = sized(1.0, section.balance)
    if fit_diameters(cloth) >= 1.0:
        return cloth, ""
    balance = fit_balance(cloth)
    shared = sized(1.0, balance)
    factor = fit_diameters(shared)
    set_ = f"{0.01 / spacing[0].min():.1f} ends/cm and {0.01 / spacing[1].min():.1f} picks/cm"
    if factor >= 1.0:
        return shared, f"{set_} can only be woven with the warp taking {100 * balance:.0f} % of the crimp"
    warp_mm, weft_mm = (1e3 * float(d.max()) for d in diameter)
    line = f"threads of {warp_mm:.3f} mm (warp) and {weft_mm:.3f} mm (weft) jam at {set_}"
    if section.when_jammed == "refuse":
        raise InputError(
            f"fabric.ends_per_cm, fabric.picks_per_cm: {line}; they fit at {factor:.2f} of that thickness: space them "
            'wider, take a finer yarn, or set fabric.when_jammed = "scale"'
        )
    return sized(factor * (1.0 - 1e-9), balance), f"{line}: thinned to {100 * factor:.0f} %"
