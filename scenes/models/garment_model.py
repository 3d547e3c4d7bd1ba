"""A garment worn by a body (paper 4): sewn once, then moved with it."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.garment.sewn.cell_weaving import CellWeaving
from taichi_cloth.garment.sewn.in_motion import Watch
from taichi_cloth.garment.sewn.limbs import spared
from taichi_cloth.garment.sewn.stitches import PIECES, STRANDS, Stitches
from taichi_cloth.garment.sewn.weaving import Colours, Weaving
from taichi_cloth.ground.particles import LANES, ROWS
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.weave.colour_order import colour

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import box_corners
from ...render.tiles.mesh import Mesh
from ..prepare.body_setup import skin_mesh
from ..prepare.drawing import LIT
from ..prepare.garment_setup import (
    Dressed,
    Progress,
    dress,
    garment_simulation,
    motion_of,
    own_drafts,
    prepare_garment,
    woven_garment,
)
from ..prepare.print_images import print_of
from ..prepare.thread_colours import outer_colours, panel_colours
from ..prepare.weave_layout import Prepared, prepare_fabric
from ..scene.body_section import BodySection
from ..scene.schema import Scene
from .facts import Fact
from .following import camera_path
from .model import Numbers
from .motion_facts import MotionFacts
from .moving_model import MovingModel

__all__ = ["GarmentFibres", "GarmentModel", "box_round"]

F32 = NDArray[np.float32]
Near = tuple[NDArray, float]
"""A place [m] and a distance [m]."""


class GarmentFibres:
    """The fibres of a garment, and the stitches along its hems and seams.

    near: only what is woven within it of the garment at rest is drawn.
    """

    def __init__(
        self, scene: Scene, dressed: Dressed, prepared: Prepared | None = None, near: Near | None = None
    ) -> None:
        assert scene.garment is not None
        section, atlas, pattern = scene.garment, dressed.garment.atlas, dressed.garment.pattern
        self.prepared = prepared or prepare_fabric(woven_garment(scene, atlas))
        hem, k = 1e-3 * section.hem_mm, section.threads_per_key_point
        prints = {p.name: print_of(section.prints[p.name], p) for p in pattern.panels if p.name in section.prints}
        colours = colours_of(scene, dressed)
        self.weaving = Weaving(atlas, build_fabric(self.prepared.layout), k, colours, hem=hem, prints=prints)
        if near is not None:
            self._leave_out(dressed.worn.positions.astype(np.float32), near)
        self.stitches: Stitches | None = None
        if section.stitches is not None:
            pitch, thread = 1e-3 * section.stitch_mm, 1e-3 * section.thread_mm
            self.stitches = Stitches(pattern, self.weaving, hem=hem, pitch=pitch, diameter=thread)
        rest = None
        if section.follow == "paper":
            rest = self.weaving.crossings(atlas.start().astype(np.float32))
        self.follower = FibreFollower(
            self.weaving.fabric,
            present=self.weaving.present,
            spans=self.weaving.spans,
            rule=section.follow,
            rest=rest,
            shades=self.weaving.shades,
            others=len(self.stitches or ()),
        )
        if self.stitches is not None:
            self.stitches.dress(self.follower.others, colour(str(section.stitches)))

    def _leave_out(self, positions: F32, near: Near) -> None:
        """Draw nothing of what lies farther off."""
        crossings = self.weaving.crossings(positions).reshape(-1, 3)
        away = np.linalg.norm(crossings[self.weaving.fabric.layout.blocks.key0] - near[0], axis=1)
        self.weaving.spans[~(away < near[1])] = 1.0, 0.0

    def follow(self, positions: F32) -> ParticleBlocks:
        crossings = self.weaving.crossings(positions)
        drawn = ParticleBlocks(self.follower.follow(crossings))
        if self.stitches is not None:
            self.stitches.follow(crossings, self.follower.others)
        return drawn


class GarmentCells:
    """As `GarmentFibres`, of a garment with a sett: made where a camera looks."""

    def __init__(self, scene: Scene, dressed: Dressed, prepared: Prepared) -> None:
        assert scene.garment is not None
        assert prepared.cells is not None
        self.prepared = prepared
        section, atlas, pattern = scene.garment, dressed.garment.atlas, dressed.garment.pattern
        hem = 1e-3 * section.hem_mm
        drafts = own_drafts(scene)
        own = {name: 1 + drafts.index(draft) for name, draft in section.weaves.items()}
        prints = {p.name: print_of(section.prints[p.name], p) for p in pattern.panels if p.name in section.prints}
        self.weaving = CellWeaving(
            atlas,
            prepared.cells.per_cell,
            prepared.cells.repeats,
            own,
            colours_of(scene, dressed),
            hem=hem,
            prints=prints,
            seed=scene.seed,
        )
        self.stitches: Stitches | None = None
        pieces: F32 = np.zeros((ROWS, 0), np.float32)
        if section.stitches is not None:
            pitch, thread = 1e-3 * section.stitch_mm, 1e-3 * section.thread_mm
            self.stitches = Stitches(pattern, self.weaving, hem=hem, pitch=pitch, diameter=thread)
            self._sewn = np.zeros((ROWS, -(-len(self.stitches) // LANES), LANES), np.float32)
            self.stitches.dress(self._sewn, colour(str(section.stitches)))
            pieces = self._sewn.reshape(ROWS, -1)[:, : len(self.stitches)]
        each = STRANDS * PIECES
        self.source = CellStream(self.weaving.cloth, parts=self.weaving.cloth.of_thread(), pieces=pieces, each=each)

    def follow(self, positions: F32) -> ParticleBlocks:
        """Lays them on key points (rows, columns, 3) [m]; a sample of them, which casts their light."""
        whole = self.weaving.whole(positions)
        self.weaving.cloth.move(whole)
        if self.stitches is not None:
            self.stitches.follow(self.weaving.crossings(whole), self._sewn)
        return ParticleBlocks(self.source.sample(LIT))


class GarmentModel(MovingModel):
    """A garment in motion on its body. Make it with `GarmentModel.of`."""

    _moments: MotionFacts | None = None

    def __init__(self, scene: Scene, dressed: Dressed) -> None:
        self.scene, self.dressed, self.fibres, self.frames = scene, dressed, None, scene.output.frames
        self.motion = motion_of(scene, dressed.body)
        self.misfit = dressed.misfit()
        self.simulation = self.at_start()
        self.simulation.solver.make_ready(self.simulation.state)  # before what is drawn, as where it was sewn just now
        self.surface = dressed.garment.surface
        box = scene.camera.box_m
        at_rest = self.simulation.positions[self.simulation.sheet.present]
        self.bounds = box_round(at_rest) if box is None else box_corners(*box).astype(np.float32)

    @staticmethod
    def of(
        scene: Scene,
        prepared: Prepared | None = None,
        dressed: Dressed | None = None,
        each: Progress | None = None,
        near: Near | None = None,
    ) -> "GarmentModel":
        """The scene's garment, sewn unless it was before, with its fibres where it shows them."""
        assert scene.garment is not None
        model = GarmentModel(scene, dressed or dress(scene, each))
        if scene.garment.representation == "fibre":
            prepared = prepared or prepare_garment(scene, model.dressed.garment.atlas)
            if prepared is not None and prepared.cells is not None:
                model.fibres = GarmentCells(scene, model.dressed, prepared)
            else:
                model.fibres = GarmentFibres(scene, model.dressed, prepared, near)
        return model

    def at_start(self) -> Simulation:
        """The garment at rest."""
        return garment_simulation(self.scene, self.dressed)

    def solids(self) -> tuple[Mesh, ...]:
        """The body now, its skin let in a little where cloth lies on it: primitives are not quite the skin."""
        body = self.dressed.body
        skin = body.posed(self.motion.pose(self.simulation.time))
        points, _ = self.surface.points(self.simulation.positions)
        return (skin_mesh(self.scene.body or BodySection(), body, skin, points, self._spared),)

    def framed(self) -> F32:
        """The bounds, gone with a body that walks away (`following.py`)."""
        frame = min(self.simulation.frame, len(self._path) - 1)
        return self.bounds + self._path[frame].astype(np.float32)

    @cached_property
    def _path(self) -> NDArray[np.float64]:
        section = self.scene.camera
        wanted = False if section.follow is None and section.box_m is not None else section.follow
        return camera_path(self.motion, self.frames, self.scene.output.fps, wanted)

    def mesh(self) -> Mesh:
        """With smooth normals, cut along its outlines."""
        points, normals = self.surface.points(self.simulation.positions)
        return Mesh(points, self.surface.faces, self.mesh_colours, normals, woven=1.0)

    @cached_property
    def _spared(self) -> NDArray[np.int32]:
        """At each point of the surface, the bones that the garment does not lie on (`limbs.spared`)."""
        worn = self.dressed
        return self.surface.nearest(spared(worn.garment.atlas, worn.worn.positions, worn.primitives, moving=False))

    @cached_property
    def mesh_colours(self) -> F32:
        """Albedo at each point of the surface, (n, 3): what its panel sends back outside."""
        names = [piece.panel.name for piece in self.dressed.garment.atlas.panels]
        shades = list(outer_colours(self.scene, names).values())
        return np.stack(shades)[self.surface.panel].astype(np.float32)

    def numbers(self) -> Numbers:
        """Yarn: by panel, its warp ends, then its weft picks. Part: number of the panel."""
        if isinstance(self.fibres, GarmentCells):
            yarn, panel = np.zeros(0, np.int32), self.fibres.weaving.cloth.of_thread()
        else:
            assert isinstance(self.fibres, GarmentFibres)
            yarn, panel = self.yarn_of_places(), self.fibres.weaving.panel
        part = np.where(yarn < 0, -1, panel[yarn]).astype(np.int32)
        names = [p.panel.name for p in self.dressed.garment.atlas.panels]
        yarns: dict[int, dict[str, str | int]] = {k: {"panel": names[p]} for k, p in enumerate(panel.tolist())}
        return Numbers(yarn, part, yarns, dict(enumerate(names)))

    def keep(self, folder: Path, first: int) -> None:
        """As any model; also of every frame how deep it lies in the body and how long its threads are."""
        self._moments = MotionFacts(folder)
        super().keep(folder, first)
        self._moments.read(self.simulation.frame)
        self._look()

    def motion_facts(self) -> list[Fact]:
        return [] if self._moments is None else self._moments.facts()

    def _save(self) -> None:
        super()._save()
        self._look()

    def _look(self) -> None:
        if self._moments is None or self.simulation.frame in self._moments.moments:
            return
        bones = self.dressed.body.bone_transforms(self.motion.pose(self.simulation.time))
        moment = replace(self._watch.at(self.simulation.positions, bones), let_off=self.simulation.solver.let_off)
        self._moments.moments[self.simulation.frame] = moment
        self._moments.write(self._said)

    @cached_property
    def _watch(self) -> Watch:
        return Watch(self.dressed.garment, self.dressed.grids or self.dressed.primitives)

    @cached_property
    def _said(self) -> list[Fact]:
        return self.facts()

    def cloth_facts(self) -> list[Fact]:
        garment, sheet = self.dressed.garment, self.simulation.sheet
        return [
            Fact("garment", f"{garment.pattern.name}: {len(garment.pattern.panels)} panels"),
            Fact("key points", f"{garment.atlas.key_points:,}"),
            Fact("mass of the garment", f"{1e3 * float(sheet.mass.sum()):.0f} g"),
            *self.sewn_facts(),
        ]

    def sewn_facts(self) -> list[Fact]:
        """How what is worn was sewn, and whether it fits."""
        worn, garment = self.dressed.worn, self.dressed.garment
        facts = [
            Fact("widest seam", f"{1e3 * worn.gap:.2f} mm"),
            Fact("deepest in the body", f"{1e3 * worn.depth:.2f} mm"),
            Fact("largest stretch", f"{100 * worn.stretch:.1f} %, away from seams {100 * worn.taut:.1f} %"),
            self.substeps_fact(),
            *(Fact("fitted", note) for note in garment.pattern.notes),
        ]
        if self.misfit is not None:
            facts.append(Fact("does not fit", self.misfit))
        return facts


def box_round(points: NDArray) -> F32:
    """The corners, (8, 3) [m], of a box round points (n, 3) with some room, which every picture of a garment frames."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.12 * (high - low).max()
    return box_corners(low - room, high + room).astype(np.float32)


def colours_of(scene: Scene, dressed: Dressed) -> dict[str, Colours]:
    """Thread orders of the garment's panels, by name, in its atlas's order."""
    return panel_colours(scene, [piece.panel.name for piece in dressed.garment.atlas.panels])
