"""A garment of the paper's tables, timed in motion (paper 4.3).

Some frames in a row are timed in each of three ways from one and the same state: as a mesh garment; as a fibre garment;
and as many of a free sheet, one piece of the same cloth with as many key points that nothing touches. In a row, because
a frame finds in the caches what the one before it left there. The ways take turns in who is first, so that what a
processor does meanwhile falls on all alike. Between frames it is counted what passes through what.

Where kernels can ask for the time, time stamps inside them tell their parts apart. They are in every frame of the
garment, those of its sewing too, so that one kernel is compiled and not two: some 20 a substep of 50 ns each, 0.1 % of
a frame.
"""

from collections.abc import Callable, Generator
from math import sqrt
from time import perf_counter
from typing import Any

import numpy as np

from taichi_cloth.crossings.crossings import find_crossings
from taichi_cloth.ground.errors import Unstable
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.kernel_solver import stamped
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.sheet.sheet import Sheet, SheetState

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import frame as framed
from ...render.splat.splat import Splatter
from ...render.stage.paint import paint
from ...render.tiles.mesh import join
from ..measure.frame_parts import kernel_parts
from ..models.garment_model import GarmentFibres, GarmentModel
from ..models.moving_model import nothing
from ..picture.view import finish_of, lighting_of
from ..prepare.garment_setup import Progress
from ..scene.schema import Scene
from .table_text import Measured

__all__ = ["free_sheet", "measure"]

BEFORE = 80
"""Frames of the walk before the first one that is timed: the body has come into its stride."""

SIZE = (1280, 720)
ROW = 10
"""Frames that are timed in one way before the next; after every second row the garment is drawn."""

WAVE = 0.3
"""Speed [m/s] at which a free sheet is set waving."""


class _Timed:
    """The garment and what it is timed in: `times` [ms] by stage, a number a frame. clock: of its kernel's parts, None
    where there are none to be told. quick: see `measure`."""

    def __init__(self, model: GarmentModel, clock: StageClock | None, quick: bool) -> None:
        assert isinstance(model.fibres, GarmentFibres)
        self.model, self.fibres, self.simulation = model, model.fibres, model.simulation
        self.clock, self.sheet = clock, None if quick else free_sheet(model.simulation)
        self.times: dict[str, list[float]] = {}
        self.through: list[int] = []
        self.ways: list[Callable[[], object]] = [self.mesh, self.fibre]
        if self.sheet is not None:
            self.ways.append(self.free)

    def time(self, stage: str, work: Callable[[], Any]) -> Any:
        begin = perf_counter()
        result = work()
        self.note(stage, perf_counter() - begin)
        return result

    def note(self, stage: str, seconds: float) -> None:
        self.times.setdefault(stage, []).append(1e3 * seconds)

    def mesh(self) -> None:
        self._forget()
        self.time("mesh", self._mesh)
        self._note_kernel("mesh")

    def _mesh(self) -> None:
        self.time("step, mesh", self.simulation.step)
        self.time("normals", lambda: self.model.surface.points(self.simulation.positions))

    def fibre(self) -> None:
        self._forget()
        solver, times = self.simulation.solver, self.times
        spent = solver.spent
        self.time("fibre", self._fibre)
        self.note("substep", 1e-3 * times["step, fibre"][-1] / solver.substeps)
        if self.clock is not None:
            self._note_kernel("parts")
            self.note("parts: host", 1e-3 * times["step, fibre"][-1] - (solver.spent - spent))

    def _fibre(self) -> None:
        self.time("step, fibre", self.simulation.step)
        crossings = self.time("crossings", lambda: self.fibres.weaving.crossings(self.simulation.positions))
        self.time("follow", lambda: self.fibres.follower.follow(crossings))

    def free(self) -> None:
        assert self.sheet is not None
        self.time("step, sheet", self.sheet.step)
        self.note("substep, sheet", 1e-3 * self.times["step, sheet"][-1] / self.sheet.solver.substeps)

    def count(self) -> None:
        """Triangles that pass through others now."""
        surface = self.model.surface
        points, _ = surface.points(self.simulation.positions)
        self.through.append(find_crossings(points, surface.faces, surface.same).count)

    def _forget(self) -> None:
        """Stamps of frames that are not timed."""
        if self.clock is not None:
            self.clock.forget()

    def _note_kernel(self, name: str) -> None:
        if self.clock is not None:
            for part, seconds in kernel_parts(self.clock.read()).items():
                self.note(f"{name}: {part}", seconds)

    def all_ways(self, number: int, frames: int) -> None:
        """So many frames in every way from the same state; the garment is as many on after it."""
        values, frame = self.simulation.state.values, self.simulation.frame
        turn = number % len(self.ways)
        for work in self.ways[turn:] + self.ways[:turn]:
            if work != self.free:
                self.simulation.state, self.simulation.frame = SheetState(values.copy()), frame
            for _ in range(frames):
                work()
                if work == self.mesh:
                    self.count()


def measure(
    name: str,
    scene: Scene,
    frames: int,
    *,
    clock: StageClock | None,
    quick: bool = False,
    each: Progress | None = None,
) -> Generator[str, None, Measured]:
    """Times `frames` frames of a garment in motion, and says meanwhile how far it is. Taichi is running.

    clock: of the parts of kernels, None where they cannot ask for the time; garments of one clock share their kernels.
    Stages: "mesh" and "fibre", whole frames without drawing; "step, mesh" and "step, fibre", the solver's part of them;
    "normals"; "crossings" and "follow"; "substep" and "substep, sheet", of the garment as fibres and of a free sheet;
    with a clock "parts: …" of a fibre frame's "step, fibre", and "mesh: …" of a mesh frame's kernel; and now and then
    "draw, mesh" and "draw, fibre". quick: without free sheet and drawing, which have kernels of their own, after
    half of BEFORE. each: told the stage, what is done and how much there is.
    Where the motion tears the garment it starts anew from its rest, and the frame is among `restarts`. Raises Unstable
    where it does not even begin.
    """
    said = each or (lambda stage, done, most: None)
    yield f"{name}: sewn and rested, unless it is kept from before"
    with stamped(clock):
        model = GarmentModel.of(scene, each=lambda stage, done, most: said(f"{name}: {stage}", done, most))
    yield f"{name}: its kernels are compiled, unless they are kept"
    timed = _Timed(model, clock, quick)
    simulation, times, draw = model.simulation, timed.times, {} if quick else _drawing(model)
    rested, restarts = simulation.state.values.copy(), []
    for number in range(3):
        timed.all_ways(number, 1)  # compiles
        said(f"{name}: compiling", number + 1, 3)
    times.clear()
    before = BEFORE // 2 if quick else BEFORE
    yield f"{name}: it walks {before} frames, and then {frames} more that are timed in {len(timed.ways)} ways"
    number = 0
    while number < frames:
        at = simulation.frame
        kept = {stage: len(row) for stage, row in times.items()}
        try:
            if at < before and not restarts:
                simulation.step()
                timed.count()
                said(f"{name}: walking", at + 1, before)
                continue
            timed.all_ways(number // ROW, min(ROW, frames - number))
        except Unstable as error:
            if error.frame <= 3:
                raise
            restarts.append(error.frame)
            simulation.state, simulation.frame = SheetState(rested.copy()), 0
            for stage, row in times.items():
                del row[kept.get(stage, 0) :]
            continue
        if number // ROW % 2 == 0:
            for form, work in draw.items():
                work()
                timed.time(f"draw, {form}", work)
        number += ROW
        said(f"{name}: timed", min(number, frames), frames)
    points, follower = model.dressed.garment.atlas.key_points, timed.fibres.follower
    steps, through = simulation.solver.substeps, tuple(timed.through)
    return Measured(points, follower.particles, steps, times, tuple(restarts), through)


def free_sheet(garment: Simulation) -> Simulation:
    """A sheet of the garment's cloth, in one piece, with as many key points to half a row, moved by the same solver; it
    waves while it falls, and touches nothing."""
    points, kind = int(garment.sheet.present.sum()), type(garment.solver)
    rows = round(sqrt(points))
    cols = round(points / rows)
    springs, material = garment.sheet.springs, garment.sheet.material
    sheet = Sheet.rectangle(rows, cols, material=material, springs=springs)
    forces = Forces()
    solver = kind(sheet, forces, frame_rate=1 / garment.frame_time)  # pyright: ignore[reportCallIssue]
    waves = np.zeros((rows, cols, 3))
    along, across = (np.sin(6 * np.pi * np.arange(n) / n) for n in (rows, cols))
    waves[..., 2] = WAVE * np.outer(along, across)
    return Simulation(sheet, solver, forces=forces, positions=sheet.flat(), velocities=waves)


def _drawing(model: GarmentModel) -> dict[str, Callable[[], object]]:
    """Draws the garment as it is now, without its body and without shadows, from one camera."""
    splatter = Splatter(*SIZE)
    camera = framed(model.bounds, width=SIZE[0], height=SIZE[1], elevation=6.0, azimuth=20.0)
    lighting, finish = lighting_of(model.scene).without_maps(), finish_of(model.scene)
    follower = model.follower
    assert follower is not None

    def mesh() -> None:
        backdrop = paint(camera, mesh=join([model.mesh()]), lighting=lighting)
        splatter.load(nothing())
        splatter.render(camera, lighting=lighting, finish=finish, backdrop=backdrop)

    def fibre() -> None:
        splatter.load(ParticleBlocks(follower.groups))
        splatter.render(camera, lighting=lighting, finish=finish)

    return {"mesh": mesh, "fibre": fibre}
