"""A woven cloth that moves: the same sheet drawn as a mesh, or as the fibres that follow it (paper, Figure 9)."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.crossings import refine_points
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.fabric.normals import grid_faces, vertex_normals
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.weave.colour_order import colour

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import box_corners
from ...render.data.particles import Particles
from ...render.tiles.mesh import Mesh
from ..scene.schema import Scene
from .facts import Fact, fabric_facts, yarn_facts
from .kept import KeptRun
from .model import Numbers, Panel
from .moving import simulation_of, standing_in, start_of, woven_scene
from .prepare import Prepared, draft_of, fibre_kind, prepare_fabric

__all__ = ["ALBEDO", "ClothModel", "ball_mesh", "nothing"]

F32 = NDArray[np.float32]
ALBEDO = 0.35
"""Brightness of a mesh over that of its fibres: between fibres light is lost that a smooth surface would return.
With it drape and T-shirt are drawn as bright as their fibres to about 10 %."""


class ClothModel(KeptRun):
    """A sheet in motion, drawn as its scene says."""

    def __init__(self, scene: Scene, prepared: Prepared | None = None) -> None:
        assert scene.cloth is not None
        self.scene, self.cloth, self.frames = scene, scene.cloth, scene.output.frames
        self.body = standing_in(scene)
        self.simulation = self.at_start()
        self.prepared: Prepared | None = None
        self.follower: FibreFollower | None = None
        if scene.cloth.representation == "fibre":
            self.prepared = prepared or prepare_fabric(woven_scene(scene))
            fabric = build_fabric(self.prepared.layout)
            rest = None
            if scene.cloth.follow == "paper":
                flat = scene.cloth.model_copy(update={"pleats": 0, "roughness_mm": 0.0})
                rest = refine_points(start_of(flat, seed=scene.seed), None, scene.cloth.threads_per_key_point)
            self.follower = FibreFollower(fabric, rule=scene.cloth.follow, rest=rest)
        else:
            self.faces = grid_faces(np.ones(self.simulation.sheet.shape, bool))
            self.colours = key_colours(scene)
        ball = scene.forces.sphere if scene.forces else None
        self.ball = ball_mesh(ball.centre_m, ball.radius_m, colour(ball.colour)) if ball else None
        box = scene.camera.box_m
        self.bounds = np.asarray(self._extent() if box is None else box_corners(*box), np.float32)

    def at_start(self) -> Simulation:
        return simulation_of(self.scene, self.body)

    def _extent(self) -> NDArray:
        """Points that a picture frames: the sheet at its start, and the body."""
        points = self.simulation.positions.reshape(-1, 3)
        return points if self.body is None else np.concatenate([points, self.body.skin(0.0)])

    def crossings(self) -> F32:
        """Where the threads cross now, (picks, ends, 3) [m]."""
        return refine_points(self.simulation.positions, None, self.cloth.threads_per_key_point)

    def panels(self) -> list[Panel]:
        solids = self.solids()
        if self.follower is not None:
            drawn = ParticleBlocks(self.follower.follow(self.crossings()))
            return [Panel(drawn, self.bounds, numbers=self.numbers, meshes=solids)]
        return [Panel(nothing(), self.bounds, meshes=(self.mesh(), *solids))]

    def solids(self) -> tuple[Mesh, ...]:
        """What the sheet meets, as it is drawn now: the ball, the skin."""
        balls = (self.ball,) if self.ball is not None else ()
        if self.body is None:
            return balls
        cloth = self.simulation.positions.reshape(-1, 3)
        return (*balls, self.body.mesh(self.simulation.time, cloth))

    def mesh(self) -> Mesh:
        """The sheet as triangles with smooth normals."""
        points = self.simulation.positions
        return Mesh(points.reshape(-1, 3), self.faces, self.colours, vertex_normals(points))

    def numbers(self) -> Numbers:
        """Yarn: the warp ends, then the weft picks. Part: 0 warp, 1 weft. -1 for places that are not drawn."""
        assert self.follower is not None
        ends = self.follower.shape[1]
        yarn = np.full(self.follower.slots, -1, np.int32)
        yarn[self.follower.particle_slots] = self.follower.threads
        yarns: dict[int, dict[str, str | int]] = {
            k: {"system": "warp", "index": k} if k < ends else {"system": "weft", "index": k - ends}
            for k in range(sum(self.follower.shape))
        }
        part = np.where(yarn < 0, -1, yarn >= ends).astype(np.int32)
        return Numbers(yarn, part, yarns, {0: "warp", 1: "weft"})

    def facts(self) -> list[Fact]:
        sheet, solver = self.simulation.sheet, self.simulation.solver
        m = sheet.material
        facts = [
            Fact("key points", f"{sheet.shape[0]} × {sheet.shape[1]}"),
            Fact("mass of the sheet", f"{1e3 * float(sheet.mass.sum()):.1f} g", f"{1e3 * m.density:.0f} g/m²"),
            Fact("stiffness, warp and weft", f"{m.tensile_warp:g} and {m.tensile_weft:g} N/m"),
            Fact("bending, warp and weft", f"{1e6 * m.bending_warp:.2f} and {1e6 * m.bending_weft:.2f} µN·m"),
            Fact("substeps a frame", f"{solver.substeps} of {1e6 * solver.step:.1f} µs"),
        ]
        if self.body is not None:
            person = self.body.body
            facts.append(Fact("body", f"{person.name}, {100 * person.stature:.0f} cm", self.body.touched))
        if self.prepared is not None:
            layout = self.prepared.layout
            facts += yarn_facts(layout.warp.yarn, "warp yarn") + fabric_facts(layout)
        return facts


def key_colours(scene: Scene) -> F32:
    """Colour of a mesh at each key point, (rows · columns, 3): the mean of the threads that it stands for."""
    cloth = scene.cloth
    assert cloth is not None
    own = np.asarray(fibre_kind(scene).colour, np.float32)
    k = cloth.threads_per_key_point
    families = []
    draft = draft_of(woven_scene(scene).weave) if scene.weave else None  # pyright: ignore[reportArgumentType]
    for n, stated, section in (
        (cloth.rows, draft.weft_colour if draft else None, scene.weft_yarn or scene.yarn),
        (cloth.columns, draft.warp_colour if draft else None, scene.yarn),
    ):
        plain = own if section is None or section.colour is None else np.asarray(colour(section.colour), np.float32)
        shades = np.tile(plain, ((n - 1) * k + 1, 1)) if stated is None else stated
        nearest = (np.arange(len(shades)) + k // 2) // k
        families.append(np.stack([np.bincount(nearest, c) / np.bincount(nearest) for c in shades.T], axis=-1))
    weft, warp = families
    return (ALBEDO * (weft[:, None] + warp[None, :]) / 2).reshape(-1, 3).astype(np.float32)


def ball_mesh(centre: tuple[float, float, float], radius: float, albedo: NDArray, *, rings: int = 64) -> Mesh:
    """A ball of 2 · rings meridians."""
    polar, around = np.linspace(0, np.pi, rings + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * rings + 1)
    normal = np.stack(
        np.broadcast_arrays(np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)), -1
    ).reshape(-1, 3)
    faces = grid_faces(np.ones((rings + 1, 2 * rings + 1), bool))
    return Mesh(np.asarray(centre) + radius * normal, faces, albedo, normal, part=1)


def nothing() -> Particles:
    none = np.zeros((0, 3), np.float32)
    return Particles(position=none, radius=none[:, 0], colour=none, tangent=none, normal=none)
