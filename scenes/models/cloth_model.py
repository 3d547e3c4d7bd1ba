"""A woven sheet that moves."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.crossings import refine_points
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.fabric.frames import grid_faces, vertex_normals
from taichi_cloth.ground.mixing import sent_back
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.weave.colour_order import colour

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import box_corners
from ...render.tiles.mesh import Mesh
from ..prepare.cell_layout import prepare_sheet
from ..prepare.sett import on_cells, sett_of, threads_to_a_cell
from ..prepare.sheet_setup import sheet_simulation, standing_in, start_of, woven_scene
from ..prepare.thread_colours import colour_repeats, thread_colours, woven_light
from ..prepare.weave_layout import Prepared, prepare_fabric
from ..prepare.yarns import draft_of, repeat_of
from ..scene.schema import Scene, Weave
from .cell_fibres import CellFibres, sheet_fibres
from .facts import Fact
from .model import Numbers
from .moving_model import MovingModel

__all__ = ["ClothFibres", "ClothModel", "ball_mesh"]

F32 = NDArray[np.float32]

STRIPE, MOST_POINTS = 8, 400
"""Points of a mesh across its narrowest stripe, and at most each way."""


class ClothFibres:
    """The fibres of a scene's sheet."""

    def __init__(self, scene: Scene, prepared: Prepared | None = None) -> None:
        assert scene.cloth is not None
        self.prepared = prepared or prepare_fabric(woven_scene(scene))
        self.threads_per_key_point = scene.cloth.threads_per_key_point
        fabric = build_fabric(self.prepared.layout)
        rest = None
        if scene.cloth.follow == "paper":
            flat = scene.cloth.model_copy(update={"pleats": 0, "roughness_mm": 0.0})
            rest = self.crossings(start_of(flat, seed=scene.seed))
        self.follower = FibreFollower(fabric, rule=scene.cloth.follow, rest=rest)

    def crossings(self, positions: NDArray) -> F32:
        """Where the threads cross, (picks, ends, 3) [m]."""
        return refine_points(positions, None, self.threads_per_key_point)

    def follow(self, positions: F32) -> ParticleBlocks:
        return ParticleBlocks(self.follower.follow(self.crossings(positions)))


class ClothModel(MovingModel):
    """A sheet in motion, drawn as its scene says."""

    def __init__(self, scene: Scene, prepared: Prepared | None = None) -> None:
        assert scene.cloth is not None
        scene = on_cells(scene)
        assert scene.cloth is not None
        self.scene, self.frames = scene, scene.output.frames
        self.body = standing_in(scene)
        self.simulation = self.at_start()
        self.simulation.solver.make_ready(self.simulation.state)  # before what is drawn, which differs more
        self.fibres = fibres_of(scene, prepared) if scene.cloth.representation == "fibre" else None
        if self.fibres is None:
            self.finer, self.colours = mesh_colours(scene)
            rows, columns = ((n - 1) * self.finer + 1 for n in self.simulation.sheet.shape)
            self.faces = grid_faces(np.ones((rows, columns), bool))
        ball = scene.forces.sphere if scene.forces else None
        self.ball = ball_mesh(ball.centre_m, ball.radius_m, colour(ball.colour)) if ball else None
        box = scene.camera.box_m
        self.bounds = np.asarray(self._extent() if box is None else box_corners(*box), np.float32)

    def at_start(self) -> Simulation:
        return sheet_simulation(self.scene, self.body)

    def _extent(self) -> NDArray:
        """Points that a picture frames: the sheet at its start, and the body."""
        points = self.simulation.positions.reshape(-1, 3)
        return points if self.body is None else np.concatenate([points, self.body.skin(0.0)])

    def crossings(self) -> F32:
        """Where the threads cross now, (picks, ends, 3) [m]."""
        assert isinstance(self.fibres, ClothFibres)
        return self.fibres.crossings(self.simulation.positions)

    def solids(self) -> tuple[Mesh, ...]:
        """The ball, the skin."""
        balls = (self.ball,) if self.ball is not None else ()
        if self.body is None:
            return balls
        cloth = self.simulation.positions.reshape(-1, 3)
        return (*balls, self.body.mesh(self.simulation.time, cloth))

    def mesh(self) -> Mesh:
        """With smooth normals; each cell cut as finely as its colours want, and as flat as it is."""
        points = self.simulation.positions
        normals = vertex_normals(points)
        if self.finer > 1:
            normals = _between(normals.reshape(points.shape), self.finer)
            normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
            points = _between(points, self.finer)
        return Mesh(points.reshape(-1, 3), self.faces, self.colours, normals.reshape(-1, 3), woven=1.0)

    def numbers(self) -> Numbers:
        """Yarn: the warp ends, then the weft picks. Part: 0 warp, 1 weft."""
        if isinstance(self.fibres, CellFibres):
            return self.fibres.numbers()
        assert self.follower is not None
        ends = self.follower.shape[1]
        yarn = self.yarn_of_places()
        yarns: dict[int, dict[str, str | int]] = {
            k: {"system": "warp", "index": k} if k < ends else {"system": "weft", "index": k - ends}
            for k in range(sum(self.follower.shape))
        }
        part = np.where(yarn < 0, -1, yarn >= ends).astype(np.int32)
        return Numbers(yarn, part, yarns, {0: "warp", 1: "weft"})

    def cloth_facts(self) -> list[Fact]:
        sheet = self.simulation.sheet
        m = sheet.material
        facts = [
            Fact("key points", f"{sheet.shape[0]} × {sheet.shape[1]}"),
            Fact("mass of the sheet", f"{1e3 * float(sheet.mass.sum()):.1f} g"),
            Fact("stiffness, warp and weft", f"{m.tensile_warp:g} and {m.tensile_weft:g} N/m"),
            Fact("bending, warp and weft", f"{1e6 * m.bending_warp:.2f} and {1e6 * m.bending_weft:.2f} µN·m"),
            self.substeps_fact(),
        ]
        if self.body is not None:
            person = self.body.body
            facts.append(Fact("body", f"{person.name}, {100 * person.stature:.0f} cm", self.body.touched))
        return facts


def fibres_of(scene: Scene, prepared: Prepared | None = None) -> ClothFibres | CellFibres:
    """The fibres of a sheet: threads that follow key points, or as many as its sett says."""
    prepared = prepared or prepare_sheet(scene)
    return ClothFibres(scene, prepared) if prepared is None or prepared.cells is None else sheet_fibres(scene, prepared)


def mesh_colours(scene: Scene) -> tuple[int, F32]:
    """How many times as many points as key points a sheet's mesh has each way, 1 where it is all of one colour, and the
    albedo at each, (n, 3): what the threads that it stands for send back."""
    cloth = scene.cloth
    assert cloth is not None
    sett = sett_of(scene)
    k = (cloth.threads_per_key_point,) * 2 if sett is None else threads_to_a_cell(scene, sett)
    ends, picks = ((n - 1) * k + 1 for n, k in zip((cloth.columns, cloth.rows), k, strict=True))
    weave = scene.weave or Weave()
    draft = draft_of(woven_scene(scene).weave or Weave()) if scene.weave and sett is None else None
    shades_of = thread_colours(scene, draft, ends=ends, picks=picks)
    if sett is not None:
        repeats = colour_repeats(scene)
        shades_of = [own[np.arange(n) % len(own)] for own, n in zip(repeats, (ends, picks), strict=True)]
    wanted = max(STRIPE * each / _narrowest(shades) for each, shades in zip(k, shades_of, strict=True))
    finer = int(np.clip(np.ceil(wanted), 1, max(1, min(*k, MOST_POINTS // max(cloth.columns, cloth.rows)))))
    families = []
    for shades, each in zip(shades_of, k, strict=True):
        nearest = (2 * finer * np.arange(len(shades)) + each) // (2 * each)
        sent = sent_back(shades)
        families.append(
            [
                np.stack([np.bincount(nearest, c) / np.bincount(nearest) for c in of.T], axis=-1)
                for of in (sent, sent * sent)
            ]
        )
    warp, weft = families
    up = repeat_of(weave.draft).warp_up.mean()
    seen = woven_light(up, (warp[0][None], warp[1][None]), (weft[0][:, None], weft[1][:, None]))
    return finer, seen.reshape(-1, 3).astype(np.float32)


def _between(values: F32, finer: int) -> F32:
    """Those of a grid (rows, columns, 3) at so many times as many places each way, linear between."""
    for axis in (0, 1):
        at = np.arange((values.shape[axis] - 1) * finer + 1)
        first = np.minimum(at // finer, values.shape[axis] - 2)
        share = np.expand_dims((at / finer - first).astype(np.float32), (1 - axis, 2))
        values = values.take(first, axis) * (1 - share) + values.take(first + 1, axis) * share
    return values


def _narrowest(shades: NDArray) -> float:
    """Threads of the narrowest stripe of colours (n, 3) between two others; infinite where there is none."""
    at = np.flatnonzero((shades[1:] != shades[:-1]).any(axis=1))
    return float(np.diff(at).min()) if len(at) > 1 else np.inf


def ball_mesh(centre: tuple[float, float, float], radius: float, albedo: NDArray, *, rings: int = 64) -> Mesh:
    """A ball of 2 · rings meridians."""
    polar, around = np.linspace(0, np.pi, rings + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * rings + 1)
    normal = np.stack(
        np.broadcast_arrays(np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)), -1
    ).reshape(-1, 3)
    faces = grid_faces(np.ones((rings + 1, 2 * rings + 1), bool))
    return Mesh(np.asarray(centre) + radius * normal, faces, albedo, normal, part=1)
