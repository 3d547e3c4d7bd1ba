"""`profile --tables`: the paper's three garments, made to its counts, timed in motion on a walking body (paper 4.3).

Ten frames in a row are timed three times from one and the same state: as a mesh garment, as a fibre garment, and with
all work of contact done twice: what that takes longer is what contact takes. (Without it the cloth would fall into the
body, and seams and strain limit would have more to do.) In a row, because a frame finds in the caches what the one
before it left there. The three take turns in who is first, so that what a processor does meanwhile falls on all alike.
"""

import os
import platform
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_middles import MiddleContact
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.garment.sewn.weaving import Weaving
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import Sheet, SheetState

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import frame as framed
from ...render.splat.splat import Splatter
from ...render.stage.paint import paint
from ...render.tiles.mesh import join
from ..measure.machine import cores, cpu_name
from ..models.garment_model import GarmentFibres, GarmentModel
from ..models.moving_model import nothing
from ..picture.view import finish_of, lighting_of
from ..prepare.garment_setup import dressed_parts, garment_simulation, woven_garment
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import built_in_scenes, load_scene
from ..scene.schema import Scene
from .table_text import PAPER, Measured, tables_of, write_tables

__all__ = ["FRAMES", "measure", "scene_of", "table_lines"]

FRAMES = 200
RATE = 60
"""Frames a second."""
BEFORE = 80
"""Frames of the walk before the first one that is timed: the body has come into its stride."""

SIZE = (1280, 720)
ROW = 10
"""Frames that are timed in one way before the next; after them the garment is drawn."""

GARMENTS = {"T-shirt": ("tshirt", "male"), "short skirt": ("skirt", "female"), "dress": ("dress", "female")}
BY_HAND = [(fibres, steps) for fibres in range(3, 8) for steps in range(5, 10)]
"""Fibres of a yarn and pieces of each between two key points that a count is met with."""


def table_lines(
    *, frames: int = FRAMES, out: Path | None = None, arch: Any = "cpu", threads: int | None = None
) -> Iterator[str]:
    """Builds, times and compares the three garments. Starts Taichi. Raises InputError for bad input."""
    if not 2 <= frames <= 100_000:
        raise InputError(f"--frames: {frames}; allowed: 2 to 100000")
    started = runtime.start(arch, threads=threads, pin=True)
    load = f"; load {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    heading = [
        f"{cpu_name()}, {cores()} cores, {platform.system()}; "
        f"Taichi on {started.arch}, {started.threads} threads{load}",
        f"medians of {frames} frames of 1/{RATE} s of a walking body; paper: Core i7-2675QM, 4 cores",
    ]
    yield from heading
    measured: dict[str, Measured] = {}
    for name in PAPER:
        yield f"{name}: the paper's counts are looked for"
        try:
            scene = scene_of(name)
            measured[name] = ours = yield from measure(name, scene, frames)
        except (InputError, Unstable) as error:
            yield f"{name}: not timed: {error}"
            continue
        yield f"{name}: mesh {ours.median('mesh'):.2f} ms, fibre {ours.median('fibre'):.2f} ms"
    if not measured:
        raise InputError("profile --tables: none of the garments could be timed; the lines above say why")
    tables = tables_of(measured)
    for table in tables:
        yield ""
        yield from table.text().splitlines()
    if out is not None:
        written = write_tables(tables, heading, out)
        yield ""
        yield f"written: {', '.join(str(path) for path in written)}"


def scene_of(name: str) -> Scene:
    """A garment of the paper on a walking body, one thread a key point, within 1 % of the paper's counts.

    Fibres and pieces make the most particles that are not too many, and loose fibres what is missing. Needs Taichi.
    Raises InputError when the counts are not met.
    """
    pattern, gender = GARMENTS[name]
    paper = PAPER[name]
    scene_name = pattern if pattern in built_in_scenes() else "tshirt"
    fixed = [
        f"garment.pattern={pattern}",
        f"garment.key_points={paper.key_points}",
        "garment.threads_per_key_point=1",
        "garment.hem_mm=0",
        f"body.gender={gender}",
        "body.motion=walk",
        f"output.fps={RATE}",
        "yarn.plies=1",
        "yarn.hairiness.loops_per_m=0",
    ]

    def scene(fibres: int, steps: int, ends: float) -> Scene:
        numbers = [f"yarn.fibres={fibres}", f"fabric.steps={steps}", f"yarn.hairiness.ends_per_m={ends:.2f}"]
        return load_scene(scene_name, fixed + numbers)

    def count(fibres: int, steps: int, ends: float) -> int:
        return _count(scene(fibres, steps, ends))

    share = count(4, 7, 0.0) / 28
    fitting = [pair for pair in BY_HAND if pair[0] * pair[1] * share <= paper.particles]
    pair = max(fitting, key=lambda p: (p[0] * p[1], -abs(p[1] - 7)))
    low, high = 0.0, 640.0
    ends, found = low, count(*pair, low)
    tried = [(ends, found)]
    while len(tried) < 13 and abs(found / paper.particles - 1) >= 0.005:
        ends = (low + high) / 2
        found = count(*pair, ends)
        tried.append((ends, found))
        low, high = (ends, high) if found < paper.particles else (low, ends)
    # Hairs come in whole numbers: the paper's count may lie between two of ours.
    ends, found = min(tried, key=lambda one: abs(one[1] - paper.particles))
    points = dressed_parts(scene(*pair, ends)).garment.atlas.key_points
    for ours, theirs, what in ((points, paper.key_points, "key points"), (found, paper.particles, "particles")):
        if abs(ours / theirs - 1) > 0.01:
            raise InputError(f"{name}: {ours:,} {what}, not within 1 % of the paper's {theirs:,}")
    return scene(*pair, ends)


def _count(scene: Scene) -> int:
    """Particles of a garment, without sewing it."""
    assert scene.garment is not None
    atlas = dressed_parts(scene).garment.atlas
    fabric = build_fabric(prepare_fabric(woven_garment(scene, atlas)).layout)
    woven = Weaving(atlas, fabric, scene.garment.threads_per_key_point)
    return FibreFollower.count(woven.fabric, present=woven.present, spans=woven.spans)


def measure(name: str, scene: Scene, frames: int) -> Generator[str, None, Measured]:
    """Times `frames` frames of a garment in motion, and says meanwhile how far it is. Taichi is running.

    Stages: "mesh" and "fibre", whole frames without drawing; "step, mesh" and "step, fibre", the solver's part of
    them, and "kernel, fibre", its kernel; "step, contact twice"; "normals"; "crossings" and "follow"; and now and then
    "draw, mesh" and "draw, fibre".
    Where the motion tears the garment it starts anew from its rest, and the frame is among `restarts`. Raises Unstable
    where it does not even begin.
    """
    yield f"{name}: sewn and rested, unless it is kept from before"
    model = GarmentModel.of(scene)
    assert isinstance(model.fibres, GarmentFibres)
    yield f"{name}: its kernels are compiled, unless they are kept"
    follower, weaving, surface = model.fibres.follower, model.fibres.weaving, model.surface
    simulation, double = model.simulation, garment_simulation(scene, model.dressed, contact_twice)
    times: dict[str, list[float]] = {}
    draw = _drawing(model)

    def timed(stage: str, work: Callable[[], Any]) -> Any:
        begin = perf_counter()
        result = work()
        times.setdefault(stage, []).append(1e3 * (perf_counter() - begin))
        return result

    def mesh_frame() -> None:
        timed("step, mesh", simulation.step)
        timed("normals", lambda: surface.points(simulation.positions))

    def fibre_frame() -> None:
        before = simulation.solver.spent
        timed("step, fibre", simulation.step)
        times.setdefault("kernel, fibre", []).append(1e3 * (simulation.solver.spent - before))
        crossings = timed("crossings", lambda: weaving.crossings(simulation.positions))
        timed("follow", lambda: follower.follow(crossings))

    ways = [
        (simulation, lambda: timed("mesh", mesh_frame)),
        (simulation, lambda: timed("fibre", fibre_frame)),
        (double, lambda: timed("step, contact twice", double.step)),
    ]
    rested, restarts = simulation.state.values.copy(), []
    for number in range(3):
        _all_ways(ways, simulation, number, 1)  # compiles
    times.clear()
    number = said = 0
    yield f"{name}: it walks {BEFORE} frames, and then {frames} more that are timed in three ways"
    while number < frames:
        if number >= said + max(ROW, frames / 4):
            said = number
            yield f"{name}: {number} of {frames} frames"
        at = simulation.frame
        kept = {stage: len(row) for stage, row in times.items()}
        try:
            if at < BEFORE and not restarts:
                simulation.step()
                continue
            _all_ways(ways, simulation, number // ROW, min(ROW, frames - number))
        except Unstable as error:
            if error.frame <= 3:
                raise
            restarts.append(error.frame)
            simulation.state, simulation.frame = SheetState(rested.copy()), 0
            for stage, row in times.items():
                del row[kept.get(stage, 0) :]
            continue
        for form, work in draw.items():
            work()
            timed(f"draw, {form}", work)
        number += ROW
    points = model.dressed.garment.atlas.key_points
    return Measured(points, follower.particles, simulation.solver.substeps, times, tuple(restarts))


def contact_twice(sheet: Sheet, forces: Forces, **chosen: Any) -> tuple[Constraint, ...]:
    """`constraints_for` with each contact with a body followed by one that does the same once more."""
    out: list[Constraint] = []
    twin = None
    for one in constraints_for(sheet, forces, **chosen):
        out.append(one)
        if isinstance(one, Contact):
            twin = one.twin()
            out.append(twin)
        elif isinstance(one, MiddleContact):
            assert twin is not None
            out.append(MiddleContact(twin, sheet, one.solids))
    return tuple(out)


def _all_ways(
    ways: list[tuple[Simulation, Callable[[], Any]]], simulation: Simulation, number: int, frames: int
) -> None:
    """So many frames in every way from the same state; `simulation` is as many on after it."""
    values, frame = simulation.state.values, simulation.frame
    turn = number % len(ways)
    for owner, work in ways[turn:] + ways[:turn]:
        owner.state, owner.frame = SheetState(values.copy()), frame
        for _ in range(frames):
            work()


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
