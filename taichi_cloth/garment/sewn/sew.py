"""Sewing (paper 4): panels stand round the body, seams draw them together, gravity lets the garment settle.

1. Closing: thick air; the gaps of all seams shrink at a set speed, the body keeps the cloth out. What is held hangs, so
   that it closes round the body as long as it will be (trousers would fold over themselves on the hips); what is not
   has no weight yet.
2. Settling: gravity and friction, each panel on its own limbs (`limbs.py`); at first halted whenever it has begun to
   slow down, then slowed a little in every frame, until it is at rest or the time is up.
What comes out is where the key points rest. Seams then stay as ties for as long as the garment is worn.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders, solid_distance
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import Atlas, turned
from taichi_cloth.garment.pattern.pattern import Pattern, Side
from taichi_cloth.garment.sewn.limbs import spared
from taichi_cloth.garment.sewn.own_outline import outline_of
from taichi_cloth.garment.sewn.surface import Surface
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.layers.outline import Outline, crossings_of
from taichi_cloth.motion.forces import Forces, SelfContact, StrainLimit
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.named import named_solver
from taichi_cloth.solvers.yarns import Yarns

__all__ = ["OPEN", "RECOVERY", "Garment", "Worn", "sew"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LIGHTEST = 2.0
"""Least mass of a key point at an outline, in corners of a whole cell: half of what one inside has, as on an edge along
the lattice. What lies beyond the outline is then the centimetre of cloth that a seam allows. With half of that, what
seams pull at is four times as light as the cloth beside it, and its threads set the step."""

OPEN = 2e-3
"""A seam is closed when its gap is no wider than this [m]."""

CLOSING = 240  # frames at most
SETTLING = 300
SWUNG = 40  # frames in which a garment that settles is halted
STILL, STEADY = 0.001, 12
"""Root mean square from frame to frame [m/s] of cloth at rest, and for how many frames it is no faster."""

SLOWED = 0.9
"""Share of its speed that cloth keeps from frame to frame from then on. Halts would wait for all of it to slow down: a
skirt's folds, which take half a second, then creep, and those that tremble at 15 hertz are never met."""
THICK, THIN = 6.0, 2.0  # [1/s] damping by the air while closing and while settling
LAG = 3e-5  # [s] least damping of the threads: what seams and skin strike dies out in a few milliseconds
RECOVERY = 5.0  # [m/s] at which the body lets out cloth that panels start with, or that seams draw, inside it


@dataclass(frozen=True, eq=False)
class Garment:
    """A pattern cut from a material. Raises InputError as `cut` and `calibrate` do."""

    pattern: Pattern
    atlas: Atlas
    material: Material

    def sheet(self, material: Material | None = None) -> Sheet:
        """Key points and springs of all panels."""
        m, (a, b) = material or self.material, self.atlas.spacing
        springs = calibrate(m, spacing_x=a, spacing_y=b)
        return Sheet.of_cells(self.atlas.cells, material=m, springs=springs, lightest=LIGHTEST)

    def moving(self, air_damping: float | None = None) -> Sheet:
        """The sheet as it moves. air_damping: instead of the material's [1/s]."""
        own = self.material
        air = own.air_damping if air_damping is None else air_damping
        return self.sheet(replace(own, air_damping=air, fibre_damping=max(own.fibre_damping, LAG)))

    @cached_property
    def surface(self) -> Surface:
        """What is drawn of it."""
        return Surface(self.atlas)

    @cached_property
    def outline(self) -> Outline:
        """What of it can meet cloth."""
        return outline_of(self)

    def seams(self) -> tuple[I64, F64]:
        """Points along all seams, a key point's distance apart: blends (n, 8, 2) and (n, 8) that are 0 when closed."""
        nodes, weights = [], []
        for seam, count in zip(self.pattern.seams, self.tie_counts(), strict=True):
            sides = zip((seam.first, seam.second), self.pattern.pairs(seam, count), strict=True)
            (n0, w0), (n1, w1) = (self._embedded(side, points) for side, points in sides)
            nodes.append(np.concatenate([n0, n1], axis=1))
            weights.append(np.concatenate([w0, -w1], axis=1))
        if not nodes:
            return np.zeros((0, 8, 2), np.int64), np.zeros((0, 8))
        return np.concatenate(nodes), np.concatenate(weights)

    def sewn(self) -> NDArray[np.bool_]:
        """Key points (rows, cols) that the seams join."""
        nodes, weights = self.seams()
        out = np.zeros(self.atlas.shape, bool)
        out[tuple(nodes[weights != 0].T)] = True
        return out

    def strains(self, positions: F32) -> tuple[NDArray, NDArray]:
        """`Sheet.stretch` of the threads that end in no seam and at no hold, 0 for others: at the ends of seams those
        ask of threads that lie half outside the cloth what no cloth is asked."""
        both = zip(self.sheet().stretch(positions), self.free_threads(), strict=True)
        weft, warp = (strain * free for strain, free in both)
        return weft, warp

    def free_threads(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Pieces of the weft (rows, cols − 1) and of the warp (rows − 1, cols) that end in no seam and at no hold."""
        nodes, weights = self.holds()[:2]
        free = ~self.sewn()
        free[tuple(nodes[weights != 0].T)] = False
        return free[:, :-1] & free[:, 1:], free[:-1] & free[1:]

    def tie_counts(self) -> list[int]:
        """Ties of each seam."""
        cell = max(self.atlas.spacing)
        return [max(2, int(np.ceil(self.pattern.seam_length(seam) / cell)) + 1) for seam in self.pattern.seams]

    def last_ties(self) -> NDArray[np.int64]:
        """Number of each seam's last tie in `seams`, (seams,)."""
        return np.cumsum(self.tie_counts()) - 1

    def holds(self) -> tuple[I64, F64, F64]:
        """Points of the edges that the body carries: blends (n, 4, 2) and (n, 4), where they belong (n, 3) [m]."""
        nodes, weights, places = [], [], []
        for hold in self.pattern.holds:
            edge = self.pattern.edge(hold.side)
            count = max(2, int(np.ceil(length(edge) / max(self.atlas.spacing))) + 1)
            points = along(edge, np.linspace(0.0, 1.0, count))
            n, w = self._embedded(hold.side, points)
            nodes.append(n)
            weights.append(w)
            places.append((hold.place or self.pattern.panel(hold.side.panel).place).points(points))
        if not nodes:
            return np.zeros((0, 4, 2), np.int64), np.zeros((0, 4)), np.zeros((0, 3))
        return np.concatenate(nodes), np.concatenate(weights), np.concatenate(places)

    def _embedded(self, side: Side, points: F64) -> tuple[I64, F64]:
        piece = self.atlas.panel(side.panel)
        return piece.embed(turned(points, piece.panel.grain))

    def ties(
        self, sheet: Sheet, bones: NDArray | None, speed: float, body: Colliders | None = None
    ) -> tuple[Ties, ...]:
        """Holds, carried by `bones` (n,) or none, and seams, where there are any, but for ties of two points that are
        held. A garment without holds has one that holds nothing, so that its kernel is that of all garments.

        What is held keeps the gap to the body at rest: held within, it would be drawn in and pushed out in every
        substep, and key points beside it flip to and fro by a millimetre.
        """
        seams, seam_weights = self.seams()
        nodes, weights, places = self.holds()
        asked = ~_both_in(seams, seam_weights, _named(nodes, weights))
        seams, seam_weights = seams[asked], seam_weights[asked]
        if not len(nodes):
            nodes, weights, places = np.zeros((1, 4, 2), np.int64), np.zeros((1, 4)), np.zeros((1, 3))
            bones = None
        elif body is not None:
            places = body.let_out(places)
        out = [Ties(sheet, nodes, weights, speed=speed, places=places, bones=bones, repeated=False)]
        if len(seams):
            out.append(Ties(sheet, seams, seam_weights, speed=speed))
        return tuple(out)

    def simulation(
        self,
        forces: Forces,
        positions: F64 | F32,
        *,
        bones: NDArray | None = None,
        frame_rate: float = 60.0,
        step: float | None = None,
        safety: float = 0.9,
        air_damping: float | None = None,
        speed: float = 0.5,
        solver: str = "verlet",
        settled: bool = False,
        pushes: F32 | None = None,
        sweeps: int = 0,
        anchors: F32 | None = None,
        relaxed: bool = False,
    ) -> Simulation:
        """The garment in motion from `positions`, seams and holds tied. bones: that carry the holds, −1 for none; None:
        none are carried. solver: see `named_solver`. settled: see `Simulation`. pushes, sweeps, anchors: of `Worn`.
        relaxed: nothing rubs within the cloth, see `Springs.relaxed`.
        """
        sheet = self.moving(air_damping)
        if relaxed:
            sheet = replace(sheet, springs=sheet.springs.relaxed)
        ties = self.ties(sheet, bones, speed, forces.body)
        kind = named_solver(solver)
        outline = self.outline if forces.self_contact else None
        constraints = constraints_for(sheet, forces, ties=ties, outline=outline, answered=kind.answers)
        made = kind(sheet, forces, frame_rate=frame_rate, step=step, safety=safety, constraints=constraints)
        simulation = Simulation(sheet, made, forces=forces, positions=positions, settled=settled)
        if pushes is not None and pushes.size:
            for seam in _seams(simulation):
                seam.push(simulation.state, pushes)
        if isinstance(made, Yarns) and sweeps:
            made.take_sweeps(sweeps)
        if anchors is not None and anchors.size:
            made.anchors(simulation.state)[:] = anchors
        return simulation


@dataclass(frozen=True, eq=False)
class Worn:
    """A garment at rest on a body.

    positions: key points (rows, cols, 3) [m]. gap: of the widest seam [m]. depth: of the deepest cloth in the body [m];
    of cloth, not of key points, which stand outside it at an outline. stretch, taut: largest strain of a thread, and of
    one that ends in no seam and at no hold. speed: root mean square from frame to frame at the end, see STILL [m/s].
    frames: that sewing took.

    What a simulation that goes on from there needs, or it begins with a jerk: pushes, what keeps its seams closed, see
    `Ties.pushes`; sweeps, over whole yarns, 0 of another solver; anchors, see `KernelSolver.anchors`; spared, of the
    body as it was, see `Colliders`, empty where nothing is.
    """

    positions: F32
    gap: float
    depth: float
    stretch: float
    taut: float
    speed: float
    frames: int
    pushes: F32 = field(default_factory=lambda: np.zeros((3, 0), np.float32))
    sweeps: int = 0
    anchors: F32 = field(default_factory=lambda: np.zeros((0, 0, 0), np.float32))
    spared: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 0), np.int32))


def sew(
    garment: Garment,
    body: Colliders,
    *,
    limit: StrainLimit | None = None,
    layers: SelfContact | None = None,
    solver: str = "verlet",
    each: Callable[[str, int, int], None] | None = None,
    closing: int = CLOSING,
    settling: int = SETTLING,
) -> Worn:
    """Sews a garment on a body at rest. limit: of how far its threads may grow. layers: its contact with itself. each:
    told the stage, the frame and the most there may be, after each frame. solver: see `named_solver`.

    Few garments pass through themselves while they are sewn: contact is taken up only for those that come to rest so,
    which are sewn again: with contact from where their seams are closed, and if that is not enough from the start.

    Raises InputError when the cloth does not hold together, with what to change.
    """
    worn = _sew(garment, body, limit, (None, None), solver, each, closing, settling)
    for apart in ((None, layers), (layers, layers)):
        if layers and not _clear(garment, worn.positions):
            with contextlib.suppress(InputError):  # what cannot be sewn so stays as it is, and contact says where
                worn = _sew(garment, body, limit, apart, solver, each, closing, settling)
    return worn


def _clear(garment: Garment, positions: F64 | F32) -> bool:
    """Whether it passes through itself nowhere."""
    return not crossings_of(garment.outline, positions).count


def _sew(
    garment: Garment,
    body: Colliders,
    limit: StrainLimit | None,
    layers: tuple[SelfContact | None, SelfContact | None],
    solver: str,
    each: Callable[[str, int, int], None] | None,
    closing: int,
    settling: int,
) -> Worn:
    """`sew`, with contact of layers while seams close and while cloth settles, from where on none passes through
    another: panels may start within each other."""
    start = garment.atlas.start()
    still = replace(body, motion=None, recovery=RECOVERY)
    smooth = replace(still, friction=0.05)
    frames = 0
    try:
        weight = Forces().gravity if garment.pattern.holds else (0.0, 0.0, 0.0)
        apart = layers[0] if layers[0] and _clear(garment, start) else None
        simulation = garment.simulation(
            Forces(gravity=weight, body=smooth, strain_limit=limit, self_contact=apart),
            start,
            air_damping=THICK,
            solver=solver,
            settled=True,
            relaxed=True,
        )
        for frame in range(closing):
            simulation.step()
            frames += 1
            if each:
                each("sewing", frame + 1, closing)
            if _gap(simulation) < OPEN:
                break
        if body.primitives:  # in whose folds both keep out; of grids, which are one skin at rest, there are none
            still = replace(still, spared=spared(garment.atlas, simulation.positions, body.primitives, moving=False))
        apart = layers[1] if layers[1] and _clear(garment, simulation.positions) else None
        forces = Forces(body=still, strain_limit=limit, self_contact=apart)

        def told(frame: int) -> None:
            if each:
                each("settling", frame, settling)

        simulation, speed, settled = _settled(garment, forces, simulation.positions, solver, settling, told)
        frames += settled
    except Unstable as error:
        raise InputError(
            f"garment {garment.pattern.name}: torn while it was sewn ({error}); it does not fit this body: "
            "allowed: a pattern whose panels start clear of the body and whose seams can close round it"
        ) from None
    positions = simulation.positions
    distance = solid_distance(body.solids, garment.surface.places(positions))
    depth = float(max(0.0, -distance.min()))
    return Worn(
        positions=positions,
        gap=_gap(simulation),
        depth=depth,
        stretch=float(max(s.max() for s in simulation.sheet.stretch(positions))),
        taut=float(max(s.max() for s in garment.strains(positions))),
        speed=speed,
        frames=frames,
        **_known(simulation),
        spared=np.zeros((0, 0), np.int32) if still.spared is None else still.spared,
    )


def _settled(
    garment: Garment, forces: Forces, positions: F32, solver: str, most: int, told: Callable[[int], None]
) -> tuple[Simulation, float, int]:
    """Stage 2 from `positions`: the garment at rest, its speed (STILL), and the frames that it took, `most` at most.
    told: of each frame.

    What rubs within the cloth goes along as long as it is halted, and holds from then on: it comes to rest as what has
    been moved about does, and then stays. Held all the way it would keep the folds that sewing made; never held, folds
    creep for seconds until one gives way.
    """

    def simulation_of(positions: F32, **known: Any) -> Simulation:
        return garment.simulation(forces, positions, air_damping=THIN, solver=solver, settled=True, **known)

    simulation = simulation_of(positions, relaxed=True)
    moving, speed, speeds = 0.0, 0.0, []
    for frame in range(most):
        if frame == SWUNG and simulation.sheet.springs.slips:
            simulation = simulation_of(simulation.positions, **_known(simulation))
        before = simulation.positions
        simulation.step()
        told(frame + 1)
        moving, faster = _speed(simulation, before), moving
        if frame < SWUNG:
            if moving < faster:
                simulation.halt()
                moving = 0.0
        else:
            simulation.slow(SLOWED)
            speeds.append(moving)
            speed = max(speeds[-STEADY:])
            if len(speeds) >= STEADY and speed < STILL:
                return simulation, speed, frame + 1
    return simulation, speed, most


def _known(simulation: Simulation) -> dict[str, Any]:
    """What a simulation has found out that the next one needs: `pushes`, `sweeps` and `anchors` of `Worn`."""
    seams, solver = _seams(simulation), simulation.solver
    return {
        "pushes": seams[0].pushes(simulation.state) if seams else np.zeros((3, 0), np.float32),
        "sweeps": solver.sweeps if isinstance(solver, Yarns) else 0,
        "anchors": solver.anchors(simulation.state).copy(),
    }


def _gap(simulation: Simulation) -> float:
    """Of the widest seam [m]; holds give way to the body."""
    return max((float(one.gaps(simulation.state).max()) for one in _seams(simulation)), default=0.0)


def _named(nodes: I64, weights: F64) -> list[bytes]:
    """A name for each blend of key points (n, 4, 2) and (n, 4): equal ones have the same."""
    return [bytes(np.append(n[w != 0], w[w != 0].round(6))) for n, w in zip(nodes, weights, strict=True)]


def _both_in(nodes: I64, weights: F64, held: list[bytes]) -> NDArray[np.bool_]:
    """Ties (n,) between two points that are both held: where a seam ends at a waistband, what it asks is said already,
    and said twice of one cell it draws threads longer."""
    first, second = _named(nodes[:, :4], weights[:, :4]), _named(nodes[:, 4:], -weights[:, 4:])
    return np.array([a in held and b in held for a, b in zip(first, second, strict=True)], bool)


def _seams(simulation: Simulation) -> list[Ties]:
    """All seams, one object or none."""
    return [one for one in simulation.solver.constraints if isinstance(one, Ties) and one.repeated]


def _speed(simulation: Simulation, before: F32) -> float:
    """Root mean square of how far key points came since `before` (rows, cols, 3) [m], a frame ago, over its time.

    Not the speed within a substep: where a seam pulls cloth against the skin the two take turns, and key points
    tremble by hundredths of a millimetre that no frame shows.
    """
    present = simulation.sheet.present
    moved = (simulation.positions[present] - before[present]).astype(np.float64)
    return float(np.sqrt((moved**2).sum(axis=1).mean())) / simulation.frame_time
