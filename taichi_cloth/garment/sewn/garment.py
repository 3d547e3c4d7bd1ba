"""A garment: a pattern cut from a material; its sheet, the ties that sew and hold it, and itself in motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import Atlas, turned
from taichi_cloth.garment.pattern.hems import with_hems
from taichi_cloth.garment.pattern.pattern import Hold, Pattern, Side
from taichi_cloth.garment.sewn.joined import SeamLine, seam_lines
from taichi_cloth.garment.sewn.own_outline import outline_of
from taichi_cloth.garment.sewn.surface import Surface
from taichi_cloth.layers.outline import Outline
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Band, Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.named import named_solver
from taichi_cloth.solvers.yarns import Yarns

__all__ = ["Garment", "holds_of", "seams_of"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LIGHTEST = 2.0
"""Least mass of a key point at an outline, in corners of a whole cell: half of what one inside has, as on an edge along
the lattice. What lies beyond the outline is then the centimetre of cloth that a seam allows. With half of that, what
seams pull at is four times as light as the cloth beside it, and its threads set the step."""

BAND = 20.0
"""Tension of a waistband that is worn [N]: it presses on the body, round which it goes in a circle, by that over its
radius, and bears by friction µ times that of each metre of it; 44 N/m of a waist of 0.85 m at µ = 0.3. Beyond that it
slides: of trousers that are sat down in the waistband comes down at the back."""

LAG = 3e-5  # [s] least damping of the threads: what seams and skin strike dies out in a few milliseconds


@dataclass(frozen=True, eq=False)
class Garment:
    """A pattern cut from a material. hem: width that its hems are turned inwards [m]; what is turned in weighs and
    pulls as cloth that lies there twice. hanging: as it is while its seams close, see `Pattern.hung`. band: tension of
    its waistband [N]. Raises InputError as `cut` and `calibrate` do."""

    pattern: Pattern
    atlas: Atlas
    material: Material
    hem: float = 0.0
    hanging: bool = False
    band: float = BAND

    @cached_property
    def layers(self) -> F64:
        """Of cloth in each cell, (rows − 1, cols − 1)."""
        return with_hems(self.atlas, self.hem) if self.hem > 0 else self.atlas.cells

    def sheet(self) -> Sheet:
        """Key points and springs of all panels."""
        a, b = self.atlas.spacing
        springs = calibrate(self.material, spacing_x=a, spacing_y=b)
        return Sheet.of_cells(self.layers, material=self.material, springs=springs, lightest=LIGHTEST)

    def moving(self, air_damping: float | None = None) -> Sheet:
        """The sheet as it moves. air_damping: instead of the material's [1/s]."""

        def moved(cloth: Band) -> Band:
            own = cloth.material
            air = own.air_damping if air_damping is None else air_damping
            return replace(cloth, material=replace(own, air_damping=air, fibre_damping=max(own.fibre_damping, LAG)))

        return self.sheet().with_cloths(moved)

    @cached_property
    def surface(self) -> Surface:
        """What is drawn of it."""
        return Surface(self.atlas, self.seam_lines)

    @cached_property
    def apart(self) -> Surface:
        """Its panels, each by itself: what lies where before anything is sewn, and how each lies in what is."""
        return Surface(self.atlas)

    @cached_property
    def seam_lines(self) -> list[SeamLine]:
        """All seams in the flat pattern."""
        return seam_lines(self.pattern, self.atlas)

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

    @cached_property
    def asked(self) -> NDArray[np.bool_]:
        """Which points along the seams (n,) are tied: all but those of two points that are both held. Where a seam ends
        at a waistband, what it asks is said already, and said twice of one cell it draws threads longer."""
        held = _named(*self.holds()[:2])
        nodes, weights = self.seams()
        first, second = _named(nodes[:, :4], weights[:, :4]), _named(nodes[:, 4:], -weights[:, 4:])
        return np.array([not (a in held and b in held) for a, b in zip(first, second, strict=True)], bool)

    @cached_property
    def closing(self) -> "Garment":
        """The same with what it hangs by while its seams close."""
        return replace(self, hanging=True) if self.pattern.hung else self

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
        return self._placed(self.pattern.holds)

    def _placed(self, holds: Sequence[Hold]) -> tuple[I64, F64, F64]:
        nodes, weights, places = [], [], []
        for hold in holds:
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

    def borne(self, friction: float) -> F64:
        """What each point of `holds` bears before it slides (n,) [N], see BAND. friction: Coulomb's µ."""
        each = []
        for hold in self.pattern.holds:
            along_edge = length(self.pattern.edge(hold.side))
            parts = max(1, int(np.ceil(along_edge / max(self.atlas.spacing))))
            share = np.full(parts + 1, along_edge / parts)
            share[[0, -1]] /= 2
            each.append(share)
        metres = np.concatenate(each) if each else np.zeros(0)
        return friction * self.band * 2 * np.pi / max(metres.sum(), 1e-9) * metres

    def _embedded(self, side: Side, points: F64) -> tuple[I64, F64]:
        piece = self.atlas.panel(side.panel)
        return piece.embed(turned(points, piece.panel.grain))

    def ties(
        self, sheet: Sheet, bones: NDArray | None, speed: float, body: Colliders | None = None
    ) -> tuple[Ties, ...]:
        """Holds and seams, where there are any. bones: (n,) that carry holds, which slide then (`borne`); None: none
        do, nothing slides, and seams are without ties of two points that are held. A garment without holds has one that
        holds nothing, so that its kernel is that of all garments.

        What is held keeps the gap to the body at rest: held within, it would be drawn in and pushed out in every
        substep, and key points beside it flip to and fro by a millimetre. What a garment hangs by is drawn in as seams
        are, in one with them: holds give way, and its sleeves would draw it off the shoulders.
        """
        seams, seam_weights = self.seams()
        nodes, weights, places = self.holds()
        most = None
        if bones is None:
            seams, seam_weights = seams[self.asked], seam_weights[self.asked]
        elif body is not None and len(nodes):
            most = self.borne(body.friction)
        if not len(nodes):
            nodes, weights, places = np.zeros((1, 4, 2), np.int64), np.zeros((1, 4)), np.zeros((1, 3))
            bones = None
        elif body is not None:
            places = body.let_out(places)
        out = [Ties(sheet, nodes, weights, speed=speed, places=places, bones=bones, most=most, repeated=False)]
        between = None
        if self.hanging:
            nodes, weights, places = self._placed(self.pattern.hung)
            between = np.concatenate([np.full((len(seams), 3), np.nan), places])
            seams = np.concatenate([seams, np.pad(nodes, ((0, 0), (0, 4), (0, 0)))])
            seam_weights = np.concatenate([seam_weights, np.pad(weights, ((0, 0), (0, 4)))])
        if len(seams):
            out.append(Ties(sheet, seams, seam_weights, speed=speed, places=between))
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
        slid: F32 | None = None,
        sweeps: int = 0,
        anchors: F32 | None = None,
        speeds: F32 | None = None,
        relaxed: bool = False,
        sewing: bool = False,
    ) -> Simulation:
        """The garment in motion from `positions`, seams and holds tied. bones: that carry the holds, −1 for none; None:
        none are carried. solver: see `named_solver`. settled: see `Simulation`. pushes, slid, sweeps, anchors,
        speeds: of `Worn`.
        relaxed: nothing rubs within the cloth, see `Springs.relaxed`. sewing: see `Yarns`.
        """
        sheet = self.moving(air_damping)
        if relaxed:
            sheet = sheet.with_springs(lambda springs: springs.relaxed)
        ties = self.ties(sheet, bones, speed, forces.body)
        kind = named_solver(solver)
        outline = self.outline if forces.self_contact else None
        constraints = constraints_for(sheet, forces, ties=ties, outline=outline, answered=kind.answers)
        known = {"sewing": sewing} if kind is Yarns else {}
        made = kind(sheet, forces, frame_rate=frame_rate, step=step, safety=safety, constraints=constraints, **known)
        moving = 0.0 if speeds is None or not speeds.size else speeds
        simulation = Simulation(sheet, made, forces=forces, positions=positions, velocities=moving, settled=settled)
        if slid is not None and slid.size:
            holds_of(simulation).slide(simulation.state, slid)
        if pushes is not None and pushes.size:
            for seam in seams_of(simulation):
                whole = np.zeros((3, len(self.asked)), np.float32)
                whole[:, self.asked if pushes.shape[1] < len(self.asked) else slice(None)] = pushes
                seam.push(simulation.state, whole if seam.count == len(self.asked) else whole[:, self.asked])
        if isinstance(made, Yarns) and sweeps:
            made.take_sweeps(sweeps)
        if anchors is not None and anchors.size:
            made.anchors(simulation.state)[:] = anchors
        return simulation


def _named(nodes: I64, weights: F64) -> list[bytes]:
    """A name for each blend of key points (n, 4, 2) and (n, 4): equal ones have the same."""
    return [bytes(np.append(n[w != 0], w[w != 0].round(6))) for n, w in zip(nodes, weights, strict=True)]


def seams_of(simulation: Simulation) -> list[Ties]:
    """All seams, one object or none."""
    return [one for one in simulation.solver.constraints if isinstance(one, Ties) and one.repeated]


def holds_of(simulation: Simulation) -> Ties:
    """All places that hold it; one that holds nothing where there are none."""
    return next(one for one in simulation.solver.constraints if isinstance(one, Ties) and not one.repeated)
