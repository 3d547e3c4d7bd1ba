"""Sewing (paper 4): panels stand round the body, seams draw them together, gravity lets the garment settle.

1. Closing: thick air; the gaps of all seams shrink at a set speed, the body keeps the cloth out. What is held hangs, so
   that it closes round the body as long as it will be (trousers would fold over themselves on the hips): what shoulders
   carry by the seams over them, which are drawn to their places as seams are (`Pattern.hung`). What is not has no
   weight yet.
2. Settling: gravity, each panel on its own limbs (`limbs.py`), asked again once it has come down on them; at first
   halted whenever it has begun to slow down, and hardly rubbing, as who wears it would draw it down over the hips; then
   with friction and with what rubs within the cloth, slowed a little in every frame, until it is at rest or the time is
   up.
3. Letting in: what closed and settled as a stretchy cloth, as patterns of others do, settles on as its own.
What comes out is where the key points rest. Seams then stay as ties for as long as the garment is worn.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders, solid_distance
from taichi_cloth.garment.sewn.garment import Garment, holds_of, seams_of
from taichi_cloth.garment.sewn.lies import crossed
from taichi_cloth.garment.sewn.limbs import spared
from taichi_cloth.garment.sewn.worn import OPEN, Worn, beyond
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.layers.outline import crossings_of
from taichi_cloth.motion.forces import Forces, SelfContact, StrainLimit
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import MATERIALS
from taichi_cloth.solvers.yarns import Yarns

__all__ = ["GIVES", "RECOVERY", "STILL", "STILLER", "TOILE", "sew"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

CLOSING = 240  # frames at most
STUCK = 20  # frames in which the widest seam comes no closer: what keeps it open, as many gathers do, will go on to
SETTLING = 300
CLOSER = 0.98  # of the widest gap before, that is closer
UNTANGLING = 60  # with contact, of what comes to rest through itself
SWUNG = 40  # frames in which a garment that settles is halted
STILL, STILLER, STEADY = 0.001, 0.0004, 12
"""Speed of cloth at rest [m/s], and the frames over which it is told: root mean square of how far key points came since
the furthest of them, over their time. What trembles where it is, as where a seam pulls cloth against the skin, or what
stands off in folds, rests; from frame to frame it may come to 50 mm/s as long as one waits. STILLER: of what is looked
at as it hangs, which at the other begins to move at 1 to 2 mm/s."""

QUIVERS, WAITS = 0.0006, 60
"""Speed of that from frame to frame (rms) up to which it hangs still [m/s], and the frames for which that is waited for
where it rests else; it hangs as it will be worn meanwhile. Skirts of a dress that came to rest at 0.4 mm/s swayed on at
2, and began to move at 1.5; and a corner of its waist, whose seams then learnt no more, gave way after 0.3 s."""

SLOWED = 0.9
"""Share of its speed that cloth keeps from frame to frame from then on. Halts would wait for all of it to slow down: a
skirt's folds, which take half a second, then creep, and those that tremble at 15 hertz are never met."""
HANGING = 0.3
"""Share of its weight that cloth has while seams close that shoulders will carry: sleeves and hoods fall until theirs
are closed."""
THICK, THIN = 6.0, 2.0  # [1/s] damping by the air while closing and while settling
SMOOTH = 0.05  # Coulomb's µ while closing, and as long as a garment is halted
TOILE = replace(
    MATERIALS["cotton-shirting"].linear, tensile_warp=500.0, tensile_weft=500.0, bending_warp=60e-6, bending_weft=60e-6
)
GIVES = StrainLimit(strain=0.03, passes=3)
"""Stretchy cloth, and how its threads are held, of which patterns of others are tried on, and their seams closed: where
one is tight, or comes on askew, it shows by how much, in seconds. Threads as they are would pull kilonewtons a metre
there, in hundreds of substeps a frame, and lie in the skin."""

LETTING, HALTED, MOST = 60, 10, 512
"""Frames for which it then settles as the cloth that it is, at most; of those in which it is halted; and substeps of
one, at most."""
LOOSE = 3.5
"""Tension of its waistband then [N]: it bears twice what a skirt weighs."""
LIMP = 1e4
"""What its threads hold at most then, once their crimp is drawn out [N/m]: what hangs pulls by some 50, and corners
where seams meet, which pull more, would shorten the substeps of all."""
RECOVERY = 5.0  # [m/s] at which the body lets out cloth that panels start with, or that seams draw, inside it


@dataclass(frozen=True)
class Cloth:
    """A garment of some cloth, how far threads of that may grow, and the solver that moves it."""

    garment: Garment
    limit: StrainLimit | None
    solver: str


Closed = tuple[F32, int]
"""Of a garment whose seams are closed: its key points (rows, cols, 3) [m], and the frames that it took."""
Settled = tuple[Simulation, float, int]
"""A garment that settled, its speed in the end, and the frames that it took."""
Meets = Callable[[F32], Colliders]
"""The body as a garment meets it whose key points lie there (rows, cols, 3) [m]: one limb in each fold (`limbs.py`)."""


def sew(
    garment: Garment,
    body: Colliders,
    *,
    limit: StrainLimit | None = None,
    layers: SelfContact | None = None,
    allowed: float = 0.0,
    solver: str = "verlet",
    start: NDArray | None = None,
    eased: bool = False,
    each: Callable[[str, int, int], None] | None = None,
    closing: int = CLOSING,
    settling: int = SETTLING,
    still: float = STILL,
) -> Worn:
    """Sews a garment on a body at rest. limit: of how far its threads may grow. layers: its contact with itself.
    allowed: triangles through others, over all, up to which that is not taken up (`crossed`). each: told the stage,
    the frame and the most there may be, after each frame. solver: see `named_solver`. start: key points (rows, cols,
    3) [m] of what is worn over other garments, clear of them, in place of panels round the bare body: it is sewn with
    contact from the first frame. eased: its seams close as TOILE, which becomes its own cloth once it hangs. still:
    speed at which it rests [m/s], see STILL.

    Few garments pass through themselves while they are sewn: contact is taken up only for those that come to rest so.
    They are sewn anew with contact from the first frame, in which panels stand round the body; else settled anew from
    where seams are closed, if that is clearer; else they settle on from where they rest, and what is through other
    cloth is drawn apart (`layers/tangles.py`). Of these and of what was sewn without, the one is worn that is least
    beyond what is allowed (`worn.beyond`): cloth that is clear of itself may be deep in the body instead.

    Raises InputError when the cloth does not hold together, with what to change.
    """

    def told(stage: str, frame: int, most: int) -> None:
        if each:
            each(stage, frame, most)

    def close(apart: SelfContact | None) -> Closed:
        begin = garment.atlas.start() if start is None else start
        return _closed(first, begin, skin, apart, closing, lambda frame: told("sewing", frame, closing))

    def meets(positions: F32) -> Colliders:
        if not body.primitives:  # of grids, which are one skin at rest, no folds are known
            return skin
        return replace(skin, spared=spared(garment.atlas, positions, body.primitives, moving=False))

    def rest(begin: Closed, apart: SelfContact | None, most: int = settling) -> Worn:
        tell = partial(told, "settling", most=most)
        return _rest(first, cloth, apart, meets, begin, still, most, tell, lambda at: passes(garment, at) <= allowed)

    cloth = Cloth(garment, limit, solver)
    first = Cloth(replace(garment, material=TOILE), GIVES, "verlet") if eased else cloth
    passes = crossed if allowed else _through
    skin = replace(body, motion=None, recovery=RECOVERY)
    try:
        if start is not None and layers is not None:
            return rest(close(replace(layers, friction=min(layers.friction, SMOOTH))), layers)
        closed = close(None)
        worn = rest(closed, None)
    except Unstable as error:
        raise InputError(
            f"garment {garment.pattern.name}: torn while it was sewn ({error}); it does not fit this body: "
            "allowed: a pattern whose panels start clear of the body and whose seams can close round it"
        ) from None
    through = passes(garment, worn.positions) if layers else 0
    if through > allowed:
        as_worn, least = (worn.positions, worn.frames), beyond(garment, worn, through, allowed, body.primitives)
        tries = [lambda: rest(close(layers), layers)]
        if _through(garment, closed[0]) < through:
            tries.append(lambda: rest(closed, layers))
        tries.append(lambda: rest(as_worn, layers, UNTANGLING))
        for attempt in tries[:1] if allowed else tries:  # each takes minutes: all of them where contact is asked for
            with contextlib.suppress(InputError, Unstable):  # what cannot be sewn so stays as it is
                again = attempt()
                left = passes(garment, again.positions)
                rank = beyond(garment, again, left, allowed, body.primitives)
                if rank < least:
                    worn, through, least = again, left, rank
            if through <= allowed:
                break
    return worn


def _through(garment: Garment, positions: F32) -> int:
    """How many of its triangles pass through others."""
    return crossings_of(garment.outline, positions).count


def _closed(
    cloth: Cloth,
    start: NDArray,
    body: Colliders,
    layers: SelfContact | None,
    closing: int,
    told: Callable[[int], None],
) -> tuple[F32, int]:
    """Stage 1 from `start`: where key points are with seams closed, and after how many frames."""
    smooth = replace(body, friction=SMOOTH)
    hangs = cloth.garment.closing
    share = HANGING if hangs.hanging else float(bool(hangs.pattern.holds))
    x, y, z = Forces().gravity
    simulation = hangs.simulation(
        Forces(gravity=(share * x, share * y, share * z), body=smooth, strain_limit=cloth.limit, self_contact=layers),
        start,
        air_damping=THICK,
        solver=cloth.solver,
        settled=True,
        relaxed=True,
        sewing=True,
    )
    frames, least, since = 0, np.inf, 0
    while frames < closing and since < STUCK:
        simulation.step()
        frames += 1
        told(frames)
        gap = _gap(simulation)
        if gap < OPEN:
            break
        least, since = (gap, 0) if gap < CLOSER * least else (least, since + 1)
    return simulation.positions, frames


def _rest(
    first: Cloth,
    cloth: Cloth,
    layers: SelfContact | None,
    meets: Meets,
    begin: Closed,
    still: float,
    settling: int,
    told: Callable[[int], None],
    clear: Callable[[F32], bool],
) -> Worn:
    """Stages 2 and 3 from where seams are closed. first: what it is until it rests, if that is not `cloth`."""
    most = settling if first is cloth else max(0, settling - LETTING)
    simulation, speed, frames = _settled(first, layers, meets, begin[0], still, most, told, clear)
    pull = 0.0
    if first is not cloth:
        (simulation, speed, more), pull = _let_in(cloth, layers, simulation, still, lambda frame: told(frames + frame))
        frames += more
    positions, body, garment = simulation.positions, simulation.forces.body, cloth.garment
    assert body is not None
    distance = solid_distance(body.solids, garment.surface.places(positions))
    return Worn(
        positions=positions,
        gap=_gap(simulation),
        depth=float(max(0.0, -distance.min())),
        stretch=float(max(s.max() for s in simulation.sheet.stretch(positions))),
        taut=float(max(s.max() for s in garment.strains(positions))),
        speed=speed,
        frames=begin[1] + frames,
        pull=pull,
        **_known(simulation),
        speeds=simulation.sheet.steps(simulation.state) / np.float32(simulation.solver.step),
        spared=np.zeros((0, 0), np.int32) if body.spared is None else body.spared,
    )


def _settled(
    cloth: Cloth,
    layers: SelfContact | None,
    meets: Meets,
    positions: F32,
    still: float,
    most: int,
    told: Callable[[int], None],
    clear: Callable[[F32], bool],
) -> Settled:
    """Stage 2 from `positions`: at rest is at `still` or less, in `most` frames at most. told: of each frame. clear:
    whether, with contact of layers, few enough pass through others for it to be at rest.

    What rubs within the cloth goes along as long as it is halted, and holds from then on: it comes to rest as what has
    been moved about does, and then stays. Held all the way it would keep the folds that sewing made; never held, folds
    creep for seconds until one gives way. What is held at the body is nailed there until it is at rest, and slides from
    then on (`Garment.borne`) until it is again. It closed some way over shoulders, and meets what it has come down on.
    """

    def simulation_of(positions: F32, **known: Any) -> Simulation:
        return _hanging(cloth, body, layers, positions, **known)

    body = replace(meets(positions), friction=SMOOTH)
    simulation = simulation_of(positions, relaxed=True)
    moving, speed, lately, waited = 0.0, 0.0, list[F32](), 0
    held = _slides(cloth.garment)
    for frame in range(most):
        if frame == SWUNG:
            body = meets(simulation.positions)
            simulation = simulation_of(simulation.positions, **_known(simulation))
        before = simulation.positions
        simulation.step()
        told(frame + 1)
        moving, faster = _moved(simulation, before), moving
        if frame < SWUNG:
            if moving < faster:
                simulation.halt()
                moving = 0.0
        else:
            simulation.slow(SLOWED)
            lately = [*lately[1 - STEADY :], before]
            speed = _speed(simulation, lately)
            calm = len(lately) == STEADY and speed < still
            waited += calm
            quiet = still > STILLER or moving < QUIVERS * simulation.frame_time or waited > WAITS
            if calm and not quiet and isinstance(simulation.solver, Yarns):
                simulation.solver.sewing = False
            if calm and quiet and (layers is None or clear(simulation.positions)):
                if not held.size:
                    return simulation, speed, frame + 1
                simulation = simulation_of(simulation.positions, bones=held, **_known(simulation))
                held, lately = held[:0], []
    return simulation, speed, most


def _let_in(
    cloth: Cloth, layers: SelfContact | None, first: Simulation, still: float, told: Callable[[int], None]
) -> tuple[Settled, float]:
    """Stage 3: the garment as its own cloth from where it rests as another, in LETTING frames at most: halted at first,
    as what was strained then springs, and with a loose waistband: one as worn would draw threads to where it was as
    stretchy cloth, by 7 % of their length in each substep. Where more substeps would be asked for, it is left as it is.
    And what pulls its threads where that is so while it is halted, so that it never was its own cloth [N/m]; else 0."""
    m, body = cloth.garment.material, first.forces.body
    assert body is not None
    warp, weft = min(m.drawn_warp, max(m.tensile_warp, LIMP)), min(m.drawn_weft, max(m.tensile_weft, LIMP))
    limp = replace(m, drawn_warp=warp, drawn_weft=weft)
    eased = replace(cloth, garment=replace(cloth.garment, material=limp, band=LOOSE))
    simulation = _hanging(eased, body, layers, first.positions, bones=_slides(cloth.garment), **_known(first))
    solver = simulation.solver
    if isinstance(solver, Yarns):
        solver.most = MOST
    lately, speed, frame = list[F32](), 0.0, 0
    while frame < LETTING and not (len(lately) == STEADY and speed < still):
        lately = [*lately[1 - STEADY :], simulation.positions]
        try:
            simulation.step()
        except Unstable:
            if not isinstance(solver, Yarns):
                raise
            return (simulation, speed, frame), solver.pull if frame < HALTED else 0.0
        simulation.slow(0.0 if frame < HALTED else SLOWED)
        speed, frame = _speed(simulation, lately), frame + 1
        told(frame)
    return (simulation, speed, frame), 0.0


def _hanging(cloth: Cloth, body: Colliders, layers: SelfContact | None, positions: F32, **known: Any) -> Simulation:
    """A garment that settles from there. known: see `Garment.simulation`."""
    acts = Forces(body=body, strain_limit=cloth.limit, self_contact=layers)
    usual = {"air_damping": THIN, "solver": cloth.solver, "settled": True, "sewing": True}
    return cloth.garment.simulation(acts, positions, **usual, **known)


def _slides(garment: Garment) -> NDArray[np.int64]:
    """What carries each place that holds it, (n,): no bone, so that it slides there."""
    return np.full(len(garment.holds()[2]), -1)


def _known(simulation: Simulation) -> dict[str, Any]:
    """What a simulation has found out that the next one needs: `pushes`, `slid`, `sweeps` and `anchors` of `Worn`."""
    seams, solver = seams_of(simulation), simulation.solver
    return {
        "pushes": seams[0].pushes(simulation.state) if seams else np.zeros((3, 0), np.float32),
        "slid": holds_of(simulation).slid(simulation.state).copy(),
        "sweeps": solver.sweeps if isinstance(solver, Yarns) else 0,
        "anchors": solver.anchors(simulation.state).copy(),
    }


def _speed(simulation: Simulation, lately: list[F32]) -> float:
    """Of a garment since the furthest of where it was in the frames before (rms) [m/s]."""
    return max(_moved(simulation, then) for then in lately) / (len(lately) * simulation.frame_time)


def _gap(simulation: Simulation) -> float:
    """Of the widest seam [m]; holds give way to the body."""
    gaps = [one.gaps(simulation.state)[~one.held] for one in seams_of(simulation)]
    return float(np.concatenate([*gaps, [0.0]]).max())


def _moved(simulation: Simulation, before: F32) -> float:
    """Root mean square of how far key points are from where they were, `before` (rows, cols, 3) [m]."""
    present = simulation.sheet.present
    moved = (simulation.positions[present] - before[present]).astype(np.float64)
    return float(np.sqrt((moved**2).sum(axis=1).mean()))
