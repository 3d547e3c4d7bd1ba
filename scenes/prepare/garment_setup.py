"""From a scene's words to a garment worn by a body: both are made once, and kept on disk by what made them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.garment.fit.fitted import fitted
from taichi_cloth.garment.fit.let_out import LetOut, both
from taichi_cloth.garment.fit.taped import landmarks_of
from taichi_cloth.garment.outfit.outfit import Outfit
from taichi_cloth.garment.outfit.over import start_over
from taichi_cloth.garment.pattern.cut import Atlas, cut, spacing_for
from taichi_cloth.garment.pattern.drafts import DRAFTS, Cut, draft
from taichi_cloth.garment.pattern.dxf_pattern import read_dxf
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
from taichi_cloth.garment.pattern.measure import figure_of
from taichi_cloth.garment.pattern.pattern import Pattern
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.lies import CROSSED
from taichi_cloth.garment.sewn.limbs import bearer, limb_of_bones, spared
from taichi_cloth.garment.sewn.sew import GIVES, RECOVERY, STILL, STILLER, TOILE, sew
from taichi_cloth.garment.sewn.tried_on import tight
from taichi_cloth.garment.sewn.weaving import crossings_shape
from taichi_cloth.garment.sewn.worn import Worn, misfit
from taichi_cloth.ground.cache import digest, kept
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, Plane, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.solvers.choice import Choice

from ..scene.body_section import BodySection, prepare_body, prepare_motion
from ..scene.cloth_schema import SolverSection
from ..scene.garment_schema import CLEAR, GarmentSection
from ..scene.schema import FabricSection, Scene, WeavePatch
from ..scene.section import PATTERN_FILE
from .body_setup import grids_of, primitives_of
from .cell_layout import prepare_cells
from .construction import own_material
from .gaps import SheetGaps, garment_gaps
from .sett import Sett, refuse, sett_of, spacing_on
from .sheet_setup import choice_of, forces_of, material_of
from .weave_layout import Prepared
from .yarns import repeat_of

__all__ = [
    "Dressed",
    "Parts",
    "bearers",
    "dress",
    "dressed_parts",
    "dropped",
    "garment_choice",
    "garment_colliders",
    "garment_forces",
    "garment_of",
    "garment_simulation",
    "key_points_of",
    "motion_of",
    "own_drafts",
    "pattern_of",
    "prepare_garment",
    "sewn",
    "sewn_with",
    "stood",
    "tried_on",
    "woven_garment",
]

VERSION = 61
"""Of what is kept on disk: raised whenever the same scene would come to another rest."""
ASKED = 2
"""Of `misfit`: raised whenever it would say something else of the same garment."""

USUAL, WIDE, MOST = 6245, 0.02, 15_000
"""Key points of a garment that does not say how many; how far apart they may lie [m] before it takes more: gathers and
darts close on two of them; and how many it takes at most."""
FEW, FITTINGS = 2000, 2
"""Key points of what is sewn of a pattern of another's to try it on, and how often it is let out, at most."""
TRIED = 90
"""Frames that each stage of sewing has for that, at most: strain shows long before all is at rest."""
BETWEEN, FOLDED = 2.0, 0.125
"""Thicknesses, and of the spacing, that limbs leave cloth on either side of the middle between them, at least: the
sides of a seam that folds there keep twice the latter."""
GIVEN_BACK = 0.1
"""How fast a body in motion lets out what other cloth has pushed into it [m/s]: layers that a limb parts faster than
they part each other would pass through each other."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Parts:
    """What is known before anything is sewn: a body, its primitives, which tell its limbs, the distance grids that
    cloth touches instead of them where a scene asks for those, a garment cut for it, or several as one, the gaps that
    it keeps, and its friction on skin (Coulomb's µ)."""

    body: Body
    primitives: tuple[Primitive, ...]
    grids: tuple[DistanceGrid, ...]
    garment: Garment
    gaps: SheetGaps
    friction: float


@dataclass(frozen=True, eq=False)
class Dressed(Parts):
    """A garment on its body, and how it rests. from_disk: whether it was sewn before. made_of: `digest` of all that it
    follows from; empty of one that was not sewn here."""

    worn: Worn
    from_disk: bool
    made_of: str = ""

    def misfit(self) -> str | None:
        """Why it does not fit, see `worn.misfit`; kept on disk, as the exact look at all cloth takes long."""

        def make() -> dict[str, np.ndarray]:
            return {"why": np.array(misfit(self.garment, self.worn, self.primitives) or "")}

        arrays = kept("fit", digest(ASKED, self.made_of), make)[0] if self.made_of else make()
        return str(arrays["why"]) or None


def dressed_parts(scene: Scene) -> Parts:
    """Body, primitives and garment of a scene; the last few are remembered. Raises InputError."""
    if scene.outfit:
        from .outfit_setup import outfit_parts

        return outfit_parts(scene)
    assert scene.garment is not None
    body = (scene.body or BodySection()).model_dump_json()
    sett = sett_of(scene)
    if sett is not None:
        refuse(scene, scene.garment.follow, "garment")
    solver = (scene.solver or SolverSection()).model_dump_json()
    per_m = None if sett is None else (sett.ends, sett.picks)
    found = _parts(scene.garment.model_dump_json(), body, solver, per_m, own_material(scene))
    return Parts(*found, garment_gaps(scene, found[-1].atlas.spacing), scene.garment.friction)


def _let_out(scene: Scene, parts: Parts, tight: LetOut) -> Parts:
    """The same with its pattern let out. Raises InputError."""
    assert scene.garment is not None
    sett = sett_of(scene)
    per_m = None if sett is None else (sett.ends, sett.picks)
    solver = scene.solver or SolverSection()
    garment = _alone(scene.garment, parts.body, solver, per_m, own_material(scene), tight)
    return replace(parts, garment=garment, gaps=garment_gaps(scene, garment.atlas.spacing))


def _alone(
    section: GarmentSection,
    body: Body,
    solver: SolverSection,
    per_m: tuple[float, float] | None,
    own: Material | None,
    tight: LetOut | None = None,
) -> Garment:
    """A garment that is worn without others, fitted to the body and cut. per_m: ends and picks a metre, whole numbers
    of which are to fit between its key points. Raises InputError."""
    pattern = pattern_of(section, body, tight)
    spacing = spacing_for(pattern, key_points_of(section, pattern))
    if per_m is not None:
        spacing = spacing_on(per_m, spacing)[0]
    return garment_of(section, pattern, spacing, solver, own)


def key_points_of(section: GarmentSection, pattern: Pattern) -> int:
    """About how many key points move a garment: as many as it says, or as its cloth is large."""
    if section.key_points is not None:
        return section.key_points
    return int(np.clip(sum(panel.area for panel in pattern.panels) / WIDE**2, USUAL, MOST))


Made = tuple[Body, tuple[Primitive, ...], tuple[DistanceGrid, ...], Garment]


@lru_cache(maxsize=4)
def _parts(garment: str, body: str, solver: str, per_m: tuple[float, float] | None, own: Material | None) -> Made:
    """All of `Parts` but its gaps, which other sections of a scene tell too."""
    section, worn_by = GarmentSection.model_validate_json(garment), BodySection.model_validate_json(body)
    moved_by = SolverSection.model_validate_json(solver)
    figure, primitives, grids = stood(worn_by)
    return figure, primitives, grids, _alone(section, figure, moved_by, per_m, own)


def stood(section: BodySection) -> tuple[Body, tuple[Primitive, ...], tuple[DistanceGrid, ...]]:
    """A body, its primitives, and its grids where a scene asks for those. Raises InputError."""
    body = prepare_body(section)
    return body, primitives_of(body, section.primitives), grids_of(body) if section.contact == "grid" else ()


def dress(scene: Scene, each: Progress | None = None) -> Dressed:
    """The scene's garment on its body, or its garments, sewn unless they were before; patterns of others are tried on
    first. Raises InputError; needs Taichi only to sew."""
    if scene.outfit:
        from .outfit_setup import dress_outfit

        return dress_outfit(scene, each)
    parts = dressed_parts(scene)
    if known := tried_on(scene, each):
        parts = _let_out(scene, parts, known)
    return sewn(scene, parts, *sewn_with(scene, parts), each)


def tried_on(scene: Scene, each: Progress | None) -> LetOut:
    """What of a pattern of another's is too tight for its body: sewn of FEW key points as TOILE, it is let out where it
    shows to be tight, FITTINGS times at most."""
    assert scene.garment is not None
    if scene.garment.pattern in DRAFTS:
        return {}
    few = scene.garment.model_copy(update={"key_points": min(FEW, scene.garment.key_points or FEW)})
    toile = scene.model_copy(update={"garment": few})
    parts, known = dressed_parts(toile), dict[str, tuple[np.ndarray, np.ndarray]]()
    for _ in range(FITTINGS):
        try:
            made = sewn(toile, _let_out(toile, parts, known) if known else parts, None, 0.0, each, toile=True)
        except InputError:  # torn of so few key points: what it was let out by before still holds
            break
        more = tight(made.garment, made.worn.positions)
        if not more:
            break
        known = both(known, more)
    return known


def sewn(
    scene: Scene,
    parts: Parts,
    layers: SelfContact | None,
    allowed: float,
    each: Progress | None,
    *,
    toile: bool = False,
    inner: Worn | None = None,
) -> Dressed:
    """Sewn unless it was before. layers, allowed: see `sewn_with`. toile: only far enough to try it on. inner: how all
    garments but the last rest, over which that is worn."""
    colliders, eased = garment_colliders(parts), False
    limit, solver = garment_forces(scene, parts).strain_limit, garment_choice(scene, parts).name
    if toile:
        parts = replace(parts, garment=replace(parts.garment, material=TOILE))
        limit, solver = GIVES, "verlet"
    elif scene.garment is not None and scene.garment.pattern not in DRAFTS:
        eased = parts.garment.material != TOILE
    known = VERSION, solver, parts.garment, limit, layers, allowed, eased
    made_of = digest(*known, colliders.made_of(), list(parts.primitives), *([] if inner is None else [inner.positions]))

    def make() -> dict[str, np.ndarray]:
        made = partial(sew, parts.garment, colliders, limit=limit, solver=solver, eased=eased, each=each)
        if toile:
            worn = made(closing=TRIED, settling=TRIED)
        else:
            start = None
            if inner is not None and isinstance(parts.garment, Outfit):
                start = start_over(parts.garment, inner.positions)
            worn = made(layers=layers, allowed=allowed, start=start, still=STILL if allowed else STILLER)
        return {name: np.asarray(getattr(worn, name)) for name in Worn.__dataclass_fields__}

    arrays, found = kept("toile" if toile else "worn", made_of, make)
    rests: dict[str, Any] = {name: array if array.ndim else array.item() for name, array in arrays.items()}
    return Dressed(**vars(parts), worn=Worn(**rests), from_disk=found, made_of=made_of)


def sewn_with(scene: Scene, parts: Parts) -> tuple[SelfContact | None, float]:
    """Contact of a garment with itself while it is sewn, and how much of it may pass through itself before that is
    taken up. A pattern of another's that a scene says nothing of has it where it would not fit else; it then moves
    without, so that its key points need not be held as in motion. Raises InputError."""
    asked = garment_forces(scene, parts).self_contact
    said = scene.forces is not None and "self_contact" in scene.forces.model_fields_set
    if asked or said or scene.garment is None or scene.garment.pattern in CLEAR:
        return asked, 0.0
    return SelfContact(thickness=parts.gaps.layers.size, friction=parts.gaps.friction, held=False), CROSSED


def garment_forces(scene: Scene, parts: Parts) -> Forces:
    """What acts on a garment from outside, but for its body. Raises InputError."""
    return forces_of(scene.forces, parts.gaps)


def garment_choice(scene: Scene, parts: Parts) -> Choice:
    """The solver that moves a garment, and sews it."""
    return choice_of(parts.garment.moving(), garment_forces(scene, parts), scene.solver, seams=True)


def pattern_of(section: GarmentSection, body: Body, tight: LetOut | None = None) -> Pattern:
    """A garment's pattern, fitted to the body. tight: see `fitted`. Raises InputError."""
    pattern: Pattern
    if PATTERN_FILE.fits(section.pattern):
        read = read_dxf if section.pattern.lower().endswith(".dxf") else read_garmentcode
        pattern = fitted(read(Path(section.pattern)), landmarks_of(body), tight)
    elif section.pattern in DRAFTS:
        metres = {name: None if cm is None else 0.01 * cm for name, cm in
                  (("length", section.length_cm), ("sleeve", section.sleeve_cm))}  # fmt: skip
        pattern = draft(section.pattern, figure_of(body), Cut(ease=section.ease, flare=section.flare, **metres))
    else:
        raise InputError(
            f"garment.pattern: {section.pattern!r}; known: {', '.join(DRAFTS)}, or the path of a .json or .dxf file"
        )
    names = [panel.name for panel in pattern.panels]
    for key in ("colours", "weaves", "prints"):
        for name in getattr(section, key):
            if name not in names:
                raise InputError(f"garment.{key}: no panel {name!r}; known: {', '.join(names)}")
    return pattern


def garment_of(
    section: GarmentSection,
    pattern: Pattern,
    spacing: tuple[float, float],
    solver: SolverSection | None = None,
    own: Material | None = None,
) -> Garment:
    """A pattern cut, its key points so far apart [m]. solver, own: see `material_of`. Raises InputError."""
    return Garment(pattern, cut(pattern, spacing), material_of(section, solver, own), 1e-3 * section.hem_mm)


def woven_garment(scene: Scene, atlas: Atlas) -> Scene:
    """The cloth that a garment is cut from as a scene of its own; panels with a draft of their own are patches of it,
    which begin in the corner of the panel's rectangle."""
    assert scene.garment is not None
    assert scene.weave is not None
    k, own = scene.garment.threads_per_key_point, scene.garment.weaves
    patches = []
    for piece in atlas.panels:
        if piece.panel.name in own:
            picks, ends = crossings_shape(piece, k)
            at = {"end": piece.col * k, "pick": piece.row * k, "ends": ends, "picks": picks}
            patches.append(WeavePatch(draft=own[piece.panel.name], **at))
    picks, ends = crossings_shape(atlas, k)
    a, b = atlas.spacing
    per_cm = {"ends_per_cm": 0.01 * k / a, "picks_per_cm": 0.01 * k / b, "fringe": 0.0}
    return scene.model_copy(
        update={
            "weave": scene.weave.model_copy(update={"ends": ends, "picks": picks, "patches": patches}),
            "fabric": (scene.fabric or FabricSection()).model_copy(update=per_cm),
        }
    )


def prepare_garment(scene: Scene, atlas: Atlas) -> Prepared | None:
    """The cloth of a garment with a sett, its drafts in the order of `own_drafts`; None where none is stated. Raises
    InputError as weaving would."""
    assert scene.garment is not None
    sett = sett_of(scene)
    if sett is None:
        return None
    a, b = atlas.spacing
    per_cell = max(1, round(sett.ends * a)), max(1, round(sett.picks * b))
    true = [Sett(per_cell[0] / a, per_cell[1] / b, one) for one in (sett.draft, *map(repeat_of, own_drafts(scene)))]
    threads = [crossings_shape(piece, 1) for piece in atlas.panels]
    woven = sum((c - 1) * per_cell[0] + 1 for _, c in threads), sum((r - 1) * per_cell[1] + 1 for r, _ in threads)
    return prepare_cells(scene, tuple(true), per_cell, woven, int((atlas.cells > 0).sum()))


def own_drafts(scene: Scene) -> list[str]:
    """The drafts that panels have instead of the garment's, each once."""
    assert scene.garment is not None
    return list(dict.fromkeys(scene.garment.weaves.values()))


def motion_of(scene: Scene, body: Body) -> Motion:
    """How the body of a scene moves."""
    return prepare_motion(scene.body or BodySection(), body)


def garment_simulation(
    scene: Scene,
    dressed: Dressed,
    moves: Motion | None = None,
    settled: bool = True,
) -> Simulation:
    """The worn garment, ready to move with its body by one frame of the video at a time. moves: how the body
    does, instead of what the scene says. settled: whether it is worn as it was sewn, see `Simulation`."""
    moves = moves or motion_of(scene, dressed.body)
    still = moves.name == "rest"
    colliders = garment_colliders(dressed)
    if not still:
        poses = [dressed.body.bone_transforms(moves.pose(time)) for time in (0.1, 0.37, 1.0, 2.3)]
        name = f"{moves.name} {digest(poses)}"

        def bones_at(time: float) -> np.ndarray:
            return dressed.body.bone_transforms(moves.pose(time))

        colliders = replace(colliders, motion=bones_at, name=name)
    garment, worn, forces = dressed.garment, dressed.worn, garment_forces(scene, dressed)
    if still:  # meets what it met when it came to rest, and is let out as fast, or it begins with a jerk of 10 mm/s
        colliders = replace(colliders, spared=worn.spared if worn.spared.size else None, recovery=RECOVERY)
    else:
        colliders = replace(colliders, spared=spared(garment.atlas, worn.positions, dressed.primitives, moving=True))
        if forces.self_contact is not None:
            between = max(BETWEEN * forces.self_contact.thickness, FOLDED * min(garment.atlas.spacing))
            colliders = replace(colliders, between=between, limbs=limb_of_bones(), recovery=GIVEN_BACK)
    forces = replace(forces, body=colliders)
    solver = scene.solver or SolverSection()
    return garment.simulation(
        forces,
        worn.positions,
        bones=bearers(garment, dressed.primitives),
        frame_rate=float(scene.output.fps),
        step=None if solver.step_ms is None else 1e-3 * solver.step_ms,
        safety=solver.safety,
        solver=garment_choice(scene, dressed).name,
        settled=settled,
        pushes=worn.pushes,
        sweeps=worn.sweeps,
        anchors=worn.anchors,
        speeds=worn.speeds,
        slid=worn.slid,
    )


def bearers(garment: Garment, primitives: Sequence[Primitive]) -> np.ndarray:
    """The bones that carry what is held, (n,): all of a garment by one."""
    parts = garment.parts if isinstance(garment, Outfit) else (garment,)
    places = [part.holds()[2] for part in parts]
    return np.concatenate([np.full(len(p), bearer(p, primitives) if len(p) else -1) for p in places])


def dropped(scene: Scene, dressed: Dressed, fall: float = 0.3) -> Simulation:
    """The garment as it hung on its body, which is no more there, so far over a floor [m]: it falls as a heap."""
    worn, forces = dressed.worn, garment_forces(scene, dressed)
    low = float(worn.positions[dressed.garment.atlas.present()][:, 1].min())
    thick = forces.self_contact.thickness if forces.self_contact else 0.0
    known = {"pushes": worn.pushes, "sweeps": worn.sweeps, "anchors": worn.anchors}
    return dressed.garment.simulation(
        replace(forces, plane=Plane(height=low - fall, gap=thick / 2)),
        worn.positions,
        frame_rate=float(scene.output.fps),
        solver=garment_choice(scene, dressed).name,
        settled=True,
        **known,
    )


def garment_colliders(parts: Parts) -> Colliders:
    """The body of a scene as a garment meets it, at rest."""
    touched, gaps = () if parts.grids else parts.primitives, parts.gaps
    return Colliders(
        primitives=touched,
        grids=parts.grids,
        friction=parts.friction,
        gap=gaps.body.size,
        beyond=gaps.beyond(parts.grids or touched),
    )
