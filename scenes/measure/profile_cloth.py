"""How long a frame of a moving cloth takes, stage by stage, its mesh and its fibres side by side."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from taichi_cloth.fabric.crossings import refine_points
from taichi_cloth.fabric.frames import vertex_normals

from ...render.data.camera import Camera, frame
from ...render.splat.splat import Splatter
from ...render.stage.paint import paint
from ...render.tiles.mesh import join
from ..models.cloth_model import ClothModel
from ..picture.view import View, finish_of, lighting_of
from ..scene.schema import Scene

__all__ = ["cloth_profile_lines"]

SIZE = (1280, 720)
BEFORE = 20
"""Frames before the first one that is timed: the cloth has met what it falls on."""


@dataclass
class _Clock:
    """Milliseconds of each stage, frame by frame."""

    times: dict[str, list[float]] = field(default_factory=dict)

    def time(self, stage: str, work: Callable[[], object]) -> None:
        begin = perf_counter()
        work()
        self.times.setdefault(stage, []).append(1e3 * (perf_counter() - begin))

    def median(self, *stages: str) -> float:
        """Of the sum of some stages [ms]."""
        return float(np.median(np.sum([self.times[s] for s in stages if s in self.times], axis=0)))

    def lines(self) -> Iterator[str]:
        """Of each stage, its median with the least and the greatest."""
        for stage, times in self.times.items():
            yield f"  {stage:<20} {np.median(times):>8.2f} ms  ({min(times):.2f} to {max(times):.2f})"


def cloth_profile_lines(scene: Scene, *, repeats: int) -> Iterator[str]:
    """Times `repeats` frames; the mesh's and the fibres' stages in turn on the same state. Taichi is running."""
    assert scene.cloth is not None
    fibre, mesh = (
        ClothModel(scene.model_copy(update={"cloth": scene.cloth.model_copy(update={"representation": form})}))
        for form in ("fibre", "mesh")
    )
    sheet, solver = fibre.simulation.sheet, fibre.simulation.solver
    follower, k = fibre.follower, scene.cloth.threads_per_key_point
    if follower is None:  # threads of a sett, made where a picture shows them
        yield from _cell_lines(fibre, mesh, repeats)
        return
    drawing = {form: _drawing(model) for form, model in (("mesh", mesh), ("fibre", fibre))}
    clock = _Clock()
    for clock in _frames(fibre, mesh, repeats):
        points = fibre.simulation.positions
        clock.time("vertex normals", lambda p=points: vertex_normals(p))
        crossings = points
        if k > 1:
            clock.time("crossings", lambda p=points: refine_points(p, None, k))
            crossings = refine_points(points, None, k)
        clock.time("frames and fibres", lambda c=crossings: follower.follow(c))
        for form, draw in drawing.items():
            for stage, work in draw.items():
                clock.time(f"{stage}, {form}", work)
    size = f"{sheet.shape[0]} × {sheet.shape[1]} key points"
    yield f"{size}, {follower.particles:,} particles, {solver.substeps} substeps a frame"
    yield from clock.lines()
    solve = clock.median("forces and solver")
    moved = clock.median("crossings", "frames and fibres")
    mesh_frame = clock.median("forces and solver", "vertex normals")
    fibre_frame = clock.median("forces and solver", "crossings", "frames and fibres")
    yield f"  a substep {1e3 * solve / solver.substeps:.1f} µs, forces, contact and step together"
    yield f"  a particle {1e6 * moved / follower.particles:.1f} ns"
    yield f"  frame without drawing: mesh {mesh_frame:.2f} ms, fibres {fibre_frame:.2f} ms"
    yield f"  fibres / mesh {fibre_frame / mesh_frame:.3f} (paper's Table 1: 1.18 to 1.29, with drawing)"
    drawn = {form: clock.median(*(f"{s}, {form}" for s in drawing[form])) for form in drawing}
    yield f"  drawn at {SIZE[0]} × {SIZE[1]}: mesh {drawn['mesh']:.2f} ms, fibres {drawn['fibre']:.2f} ms"


def _frames(fibre: ClothModel, mesh: ClothModel, repeats: int) -> Iterator[_Clock]:
    """Frames of both, one that compiles and then `repeats`; with each the clock that has timed its forces and solver,
    which the first has for itself."""
    fibre.step(BEFORE)
    mesh.simulation = fibre.simulation
    first, others = _Clock(), _Clock()
    for run in range(repeats + 1):
        clock = others if run else first
        clock.time("forces and solver", lambda: fibre.step(fibre.simulation.frame + 1))
        yield clock


def _cell_lines(fibre: ClothModel, mesh: ClothModel, repeats: int) -> Iterator[str]:
    """Of cloth whose fibres are made in batches while they are drawn, so that its picture is one stage."""
    views = {form: View(model, SIZE) for form, model in (("mesh", mesh), ("fibre", fibre))}
    clock = _Clock()
    for clock in _frames(fibre, mesh, repeats):
        for form, view in views.items():
            clock.time(f"picture, {form}", lambda v=view: list(v.turntable(1, [0])))
    rows, columns = fibre.simulation.sheet.shape
    yield f"{rows} × {columns} key points, {fibre.simulation.solver.substeps} substeps a frame"
    yield from clock.lines()


def _drawing(model: ClothModel) -> dict[str, Callable[[], object]]:
    """Stages of drawing what a model shows now, without shadows, from one camera."""
    splatter = Splatter(*SIZE)
    camera: Camera = frame(model.bounds, width=SIZE[0], height=SIZE[1], elevation=30.0)
    lighting, finish = lighting_of(model.scene).without_maps(), finish_of(model.scene)
    follower = model.follower
    if follower is not None:
        (panel,) = model.panels()
        return {
            "upload": lambda: splatter.load(panel.particles),
            "draw": lambda: splatter.render(camera, lighting=lighting, finish=finish),
        }

    def draw() -> None:
        backdrop = paint(camera, mesh=join([model.mesh()]), lighting=lighting)
        splatter.load(model.panels()[0].particles)
        splatter.render(camera, lighting=lighting, finish=finish, backdrop=backdrop)

    return {"draw": draw}
