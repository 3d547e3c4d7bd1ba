"""A garment worn by a body (paper 4): sewn once, then moved with it; drawn as a mesh or as its fibres."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.garment.pattern.cut import Atlas
from taichi_cloth.garment.sewn.limbs import spared
from taichi_cloth.garment.sewn.sew import misfit
from taichi_cloth.garment.sewn.stitches import Stitches
from taichi_cloth.garment.sewn.surface import Surface
from taichi_cloth.garment.sewn.weaving import Colours, Weaving, crossings_shape
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.weave.colour_order import colour, thread_repeat

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import box_corners
from ...render.tiles.mesh import Mesh
from ..scene.body_section import BodySection
from ..scene.garment_schema import PanelColours
from ..scene.schema import FabricSection, Scene, Weave, WeavePatch
from .cloth import ALBEDO, nothing
from .dressing import Dressed, Parts, Progress, dress, motion_of, simulation_of
from .facts import Fact, fabric_facts, yarn_facts
from .kept import KeptRun
from .model import Numbers, Panel
from .prepare import Prepared, draft_of, prepare_fabric, yarn_colours
from .prints import print_of
from .standing import skin_mesh

__all__ = ["GarmentModel", "colours_of", "woven_garment"]

F32 = NDArray[np.float32]


class GarmentModel(KeptRun):
    """A garment in motion on its body.

    near: a place [m] and a distance [m]; only what is woven within it of the garment at rest is drawn as fibres.
    """

    def __init__(
        self,
        scene: Scene,
        prepared: Prepared | None = None,
        dressed: Dressed | None = None,
        each: Progress | None = None,
        near: tuple[NDArray, float] | None = None,
    ) -> None:
        assert scene.garment is not None
        self.scene, self.section, self.frames = scene, scene.garment, scene.output.frames
        self.dressed = dressed or dress(scene, each)
        self.motion = motion_of(scene, self.dressed.body)
        self.simulation = self.at_start()
        atlas = self.dressed.garment.atlas
        self.prepared: Prepared | None = None
        self.follower: FibreFollower | None = None
        self.stitches: Stitches | None = None
        if self.section.representation == "fibre":
            self.prepared = prepared or prepare_fabric(woven_garment(scene, atlas))
            k = self.section.threads_per_key_point
            hem = 1e-3 * self.section.hem_mm
            pattern, cloth = self.dressed.garment.pattern, build_fabric(self.prepared.layout)
            asked = self.section.prints
            prints = {p.name: print_of(asked[p.name], p) for p in pattern.panels if p.name in asked}
            self.weaving = Weaving(atlas, cloth, k, colours_of(scene, self.dressed), hem=hem, prints=prints)
            if near is not None:
                crossings = self.weaving.crossings(self.simulation.positions).reshape(-1, 3)
                blocks = self.weaving.fabric.layout.blocks
                away = np.linalg.norm(crossings[blocks.key0] - near[0], axis=1)
                self.weaving.spans[~(away < near[1])] = 1.0, 0.0
            if self.section.stitches is not None:
                pitch, thread = 1e-3 * self.section.stitch_mm, 1e-3 * self.section.thread_mm
                self.stitches = Stitches(pattern, self.weaving, hem=hem, pitch=pitch, diameter=thread)
            rest = None
            if self.section.follow == "paper":
                rest = self.weaving.crossings(atlas.start().astype(np.float32))
            self.follower = FibreFollower(
                self.weaving.fabric,
                present=self.weaving.present,
                spans=self.weaving.spans,
                rule=self.section.follow,
                rest=rest,
                shades=self.weaving.shades,
                others=len(self.stitches or ()),
            )
            if self.stitches is not None:
                self.stitches.dress(self.follower.others, colour(str(self.section.stitches)))
        self.surface = Surface(atlas)
        self.bounds = self._bounds()

    def at_start(self) -> Simulation:
        """The garment at rest."""
        return simulation_of(self.scene, self.dressed)

    def panels(self) -> list[Panel]:
        positions = self.simulation.positions
        figure = self.figure(positions)
        if self.follower is not None:
            crossings = self.weaving.crossings(positions)
            drawn = ParticleBlocks(self.follower.follow(crossings))
            if self.stitches is not None:
                self.stitches.follow(crossings, self.follower.others)
            return [Panel(drawn, self.bounds, numbers=self.numbers, meshes=(figure,))]
        return [Panel(nothing(), self.bounds, meshes=(self.mesh(positions), figure))]

    def figure(self, positions: F32) -> Mesh:
        """The body now, its skin let in a little where cloth lies on it: primitives are not quite the skin."""
        body = self.dressed.body
        skin = body.posed(self.motion.pose(self.simulation.time))
        points, _ = self.surface.points(positions)
        return skin_mesh(self.scene.body or BodySection(), body, skin, points, self._spared)

    def mesh(self, positions: F32) -> Mesh:
        """The garment as triangles with smooth normals, cut along its outlines."""
        points, normals = self.surface.points(positions)
        return Mesh(points, self.surface.faces, self.mesh_colours, normals)

    @cached_property
    def _spared(self) -> NDArray[np.int32]:
        """At each point of the surface, the bones that the garment does not lie on (`limbs.spared`)."""
        worn = self.dressed
        return self.surface.nearest(spared(worn.garment.atlas, worn.worn.positions, worn.primitives, moving=False))

    @cached_property
    def mesh_colours(self) -> F32:
        """At each point of the surface, (n, 3): the mean of its panel's threads."""
        colours = colours_of(self.scene, self.dressed)
        repeats = [colours[piece.panel.name] for piece in self.dressed.garment.atlas.panels]
        shades = [(repeat.warp.mean(axis=0) + repeat.weft.mean(axis=0)) / 2 for repeat in repeats]
        return (ALBEDO * np.stack(shades)[self.surface.panel]).astype(np.float32)

    def numbers(self) -> Numbers:
        """Yarn: by panel, its warp ends, then its weft picks. Part: number of the panel. -1 for places not drawn."""
        assert self.follower is not None
        yarn = np.full(self.follower.slots, -1, np.int32)
        yarn[self.follower.particle_slots] = self.follower.threads
        part = np.where(yarn < 0, -1, self.weaving.panel[yarn]).astype(np.int32)
        names = [p.panel.name for p in self.dressed.garment.atlas.panels]
        yarns: dict[int, dict[str, str | int]] = {
            k: {"panel": names[p]} for k, p in enumerate(self.weaving.panel.tolist())
        }
        return Numbers(yarn, part, yarns, dict(enumerate(names)))

    def facts(self) -> list[Fact]:
        worn, garment = self.dressed.worn, self.dressed.garment
        sheet, solver = self.simulation.sheet, self.simulation.solver
        facts = [
            Fact("garment", f"{garment.pattern.name}: {len(garment.pattern.panels)} panels"),
            Fact("key points", f"{garment.atlas.key_points:,}"),
            Fact("mass", f"{1e3 * float(sheet.mass.sum()):.0f} g", f"{1e3 * sheet.material.density:.0f} g/m²"),
            Fact("widest seam", f"{1e3 * worn.gap:.2f} mm"),
            Fact("deepest in the body", f"{1e3 * worn.depth:.2f} mm"),
            Fact("largest stretch", f"{100 * worn.stretch:.1f} %"),
            Fact("substeps a frame", f"{solver.substeps} of {1e6 * solver.step:.1f} µs"),
        ]
        wrong = misfit(garment, worn)
        if wrong is not None:
            facts.append(Fact("does not fit", wrong))
        if self.prepared is not None:
            layout = self.prepared.layout
            facts += yarn_facts(layout.warp.yarn, "warp yarn") + fabric_facts(layout)
        return facts

    def _bounds(self) -> F32:
        """What every picture of the garment frames: the scene's box, or itself at rest, with some room; its corners,
        (8, 3) [m]."""
        if self.scene.camera.box_m is not None:
            return box_corners(*self.scene.camera.box_m).astype(np.float32)
        points = self.simulation.positions[self.simulation.sheet.present]
        low, high = points.min(axis=0), points.max(axis=0)
        room = 0.12 * (high - low).max()
        return box_corners(low - room, high + room).astype(np.float32)


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


def colours_of(scene: Scene, parts: Parts) -> dict[str, Colours]:
    """Thread orders of every panel: stated for it, or what its own WIF file brings, or stated for the weave, or what
    the weave's file brings, or the yarns' colours."""
    assert scene.garment is not None
    weave = scene.weave or Weave()
    plain = [own[None] for own in yarn_colours(scene)]
    common = _thread_orders(weave.draft, weave.warp_colours, weave.weft_colours)
    out = {}
    for piece in parts.garment.atlas.panels:
        name = piece.panel.name
        stated = scene.garment.colours.get(name) or PanelColours()
        own = _thread_orders(scene.garment.weaves.get(name), stated.warp, stated.weft)
        warp, weft = (next(o for o in orders if o is not None) for orders in zip(own, common, plain, strict=True))
        out[name] = Colours(warp, weft)
    return out


def _thread_orders(draft: str | None, *stated: str | None) -> list[F32 | None]:
    """Of the warp and of the weft: as stated, or as a WIF file has them, (n, 3), or None."""
    brought = draft_of(Weave(draft=draft)) if draft is not None else None
    found = (None, None) if brought is None else (brought.warp_colour, brought.weft_colour)
    return [one if order is None else thread_repeat(order) for order, one in zip(stated, found, strict=True)]
