"""From a scene's words to the layout of its fabric.

All of it on the host and without a particle, so that `plan` can say what a scene needs and a limit can refuse it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.layout import Detail, FabricLayout, families_of, lay_out, required_bytes
from taichi_cloth.fabric.repeat import WeaveRepeat
from taichi_cloth.fabric.templates import particle_count, particles_per_body_block
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.memory import memory_limit, require_memory
from taichi_cloth.mechanics.construction import usual_loss
from taichi_cloth.weave.cloth_set import fit_set, set_sizes, square_set_diameter
from taichi_cloth.weave.crimp import Interlacing
from taichi_cloth.weave.draft import Draft
from taichi_cloth.yarn.yarn import Yarn

from ..scene.schema import FabricSection, Scene
from .drawing import DRAW_BYTES, HELD, STREAM_BYTES, drawn_bytes
from .fibre_count import fibres_drawn, stated_fibres, steps_drawn
from .thread_colours import thread_colours
from .yarns import draft_of, fibre_kind, mechanics_of, yarn_of

__all__ = ["Cells", "Prepared", "prepare_fabric", "woven", "yarns_for"]

LEAST_THINNED = 0.4
"""Of a yarn's diameter, the least that threads are thinned to, but for those of a file that says itself how thick they
are. Real twills of 45 × 27 threads a cm come to 0.66; below this the sett or the count is a slip of the pen."""

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Prepared:
    """A fabric counted but not built. particles: exact; of cells, on average. bytes: of the build and of drawing it.
    in_batches: as its particles are too many to hold. cells: of a cloth with a sett, whose `layout` is of one repeat.
    """

    draft: Draft
    layout: FabricLayout
    particles: int
    bytes: int
    notes: tuple[str, ...]
    in_batches: bool = False
    cells: "Cells | None" = None


@dataclass(frozen=True)
class Cells:
    """Cloth woven on cells of key points. per_cell: warp ends and weft picks to each. woven: ends and picks of it all,
    or of the rectangles it is cut from. blocks: of fibres. repeats: of its drafts, the scene's first."""

    per_cell: tuple[int, int]
    woven: tuple[int, int]
    blocks: int
    repeats: tuple[WeaveRepeat, ...]


def prepare_fabric(scene: Scene, *, streamed: bool = False) -> Prepared:
    """Lay out a scene's fabric. Raises InputError where it cannot be woven, or is too large for this machine.

    streamed: it can be drawn a batch of particles at a time, so that only its blocks must fit in memory.
    """
    assert scene.weave is not None
    assert scene.yarn is not None
    section = scene.fabric or FabricSection()
    draft = draft_of(scene.weave)
    yarns = yarns_for(scene, draft, section)
    per_block = max(particles_per_body_block(y, stated_fibres(scene) or 1, section.steps) for y in yarns)
    needed = required_bytes(draft.ends, draft.picks, per_block) + DRAW_BYTES * per_block * 2 * draft.warp_up.size
    remedy = "take fewer weave.ends and weave.picks, or lower yarn.fibres or fabric.steps"
    if streamed:
        needed = min(needed, required_bytes(draft.ends, draft.picks, 0) + STREAM_BYTES)
        remedy = "take fewer weave.ends and weave.picks"
    require_memory(f"weave of {draft.ends:,} ends × {draft.picks:,} picks", needed, remedy)

    cloth, spacing, note = woven(draft, section, yarns)
    colours = thread_colours(scene, draft, ends=draft.ends, picks=draft.picks)
    families = families_of(cloth, spacing, colours, yarns, section.flattening)
    extent, pitch = (float(spacing[0].sum()), float(spacing[1].sum())), max(float(one.mean()) for one in spacing)
    layout = lay_out(
        cloth,
        *families,
        detail=Detail(
            fibres=fibres_drawn(scene, yarns, extent),
            steps=steps_drawn(scene, pitch, extent),
            variants=section.variants,
            fringe=section.fringe,
            irregularity=section.irregularity,
            seed=scene.seed,
        ),
    )
    particles = particle_count(layout)
    fixed, total = required_bytes(draft.ends, draft.picks, 0), drawn_bytes(particles)
    in_batches = streamed and (particles > HELD or (total > STREAM_BYTES and fixed + total > memory_limit()))
    total = fixed + (STREAM_BYTES if in_batches else total)
    require_memory(f"a fabric of {particles:,} particles", total, remedy)
    return Prepared(draft, layout, particles, total, (*draft.notes, *note), in_batches)


def yarns_for(scene: Scene, draft: Draft, section: FabricSection) -> tuple[Yarn, Yarn]:
    """Of the warp and of the weft: where a scene states no count, as thick as the draft says, or as fills a square
    cloth of its spacing."""
    assert scene.yarn is not None
    out = []
    for family, thickness, per_cm, spacing in (
        (scene.yarn, draft.warp_thickness_m, section.ends_per_cm, draft.warp_spacing_m),
        (scene.weft_yarn or scene.yarn, draft.weft_thickness_m, section.picks_per_cm, draft.weft_spacing_m),
    ):
        room = 0.01 / per_cm if per_cm is not None else None if spacing is None else float(spacing.mean())
        diameter = None if room is None else square_set_diameter(room, section.flattening)
        if thickness is not None:
            diameter = float(thickness.mean())
        yarn = yarn_of(family, fibre_kind(scene), diameter=diameter, raised=section.finish == "raised")
        out.append(replace(yarn, loss=usual_loss(mechanics_of(family, scene), section.finish)))
    return out[0], out[1]


def woven(
    draft: Draft, section: FabricSection, yarns: tuple[Yarn, Yarn]
) -> tuple[Interlacing, tuple[F64, F64], tuple[str, ...]]:
    """The weave with its sizes, the room of each thread [m] of the warp and the weft, and a note of what it took to
    make the threads fit; or the refusal, as asked."""
    asked = (section.ends_per_cm, section.picks_per_cm)
    diameter, rooms = set_sizes(draft, (yarns[0].woven_diameter, yarns[1].woven_diameter), asked, section.flattening)
    fitted = fit_set(
        draft.warp_up,
        rooms,
        diameter,
        flattening=section.flattening,
        balance=section.balance,
        rounder=True,
    )
    if fitted.thinned == 1.0 and fitted.balance == section.balance:
        return fitted.cloth, rooms, ()
    per_cm = f"{0.01 / rooms[0].min():.1f} ends/cm and {0.01 / rooms[1].min():.1f} picks/cm"
    if fitted.thinned == 1.0:
        note = f"{per_cm} can only be woven with the warp taking {100 * fitted.balance:.0f} % of the crimp"
        return fitted.cloth, rooms, (note,)
    warp_mm, weft_mm = (1e3 * float(d.max()) for d in diameter)
    line = f"threads of {warp_mm:.3f} mm (warp) and {weft_mm:.3f} mm (weft) jam at {per_cm}"
    if fitted.thinned < LEAST_THINNED and draft.warp_thickness_m is None and draft.weft_thickness_m is None:
        tex = fitted.thinned**2 * max(yarn.folded_tex for yarn in yarns)
        raise InputError(
            f"fabric.ends_per_cm, fabric.picks_per_cm: {line}, and would fit at {fitted.thinned:.2f} of that "
            f"thickness, as which no yarn is pressed: space them wider, or take a yarn of {tex:.2g} tex or less"
        )
    if section.when_jammed == "refuse":
        raise InputError(
            f"fabric.ends_per_cm, fabric.picks_per_cm: {line}; they fit at {fitted.thinned:.2f} of that thickness: "
            'space them wider, take a finer yarn, or set fabric.when_jammed = "scale"'
        )
    own_shapes = [
        f"{family} {own:.2f}"
        for family, own in zip(("warp", "weft"), fitted.flattening, strict=True)
        if own < section.flattening
    ]
    pressed = f", and pressed rounder, width over thickness: {', '.join(own_shapes)}" if own_shapes else ""
    return fitted.cloth, rooms, (f"{line}: thinned to {100 * fitted.thinned:.0f} %{pressed}",)
