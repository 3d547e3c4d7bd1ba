"""How the cost of motion grows with key points: sizes of one hanging sheet, each solver in each form of its frame.

Forms: `threads`, one kernel that threads of the CPU share; `loops`, parallel loops (`taichi_cloth/loops/`), all that
there is on a device. What is timed on a CPU are a few substeps of a sheet in motion, in turns between forms, so that
other programs on the machine disturb both alike; CPU time is less disturbed than the clock. On a device it is a whole
frame, with the state's way there and back, which a few substeps would not outweigh.
"""

import resource
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import log
from time import perf_counter
from typing import Any

import numpy as np

from taichi_cloth.ground import runtime
from taichi_cloth.ground.device_memory import field_bytes, is_out_of_memory
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, Wind
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet, SheetState
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

from .machine import cores, cpu_name

__all__ = ["scale_lines"]

SIDES = (64, 128, 256, 512, 1024, 2048)
SUBSTEPS = 8
"""Of a run that is timed on a CPU."""
FRAME = 60.0  # frames a second for which substeps are said
LONGEST = 60.0
"""[s] that a form may take for one size: beyond it, larger ones are left out."""
FORCES = Forces(wind=Wind(velocity=(0.2, 0.0, 1.0)))
STRAIGHT = dict.fromkeys(("drawn_warp", "drawn_weft", "crimp_warp", "crimp_weft"), 0.0)


@dataclass
class _Form:
    """A solver in one form, of one sheet. substeps: of a frame of 1/60 s. wall, cpu: seconds of each run."""

    name: str
    solver: Any
    state: SheetState
    substeps: int
    wall: list[float]
    cpu: list[float]

    def run(self) -> float:
        begin, busy = perf_counter(), _busy()
        self.solver.advance(self.state, FORCES.during(0.0, self.solver.step * self.solver.substeps))
        took = perf_counter() - begin
        self.wall.append(took)
        self.cpu.append(_busy() - busy)
        return took


def scale_lines(*, largest: float, repeats: int, arch: Any, threads: int | None) -> Iterator[str]:
    """Sheets of up to `largest` key points; medians of `repeats` runs. Starts Taichi. Raises InputError before."""
    sides = [side for side in SIDES if side * side <= largest]
    if not sides or not 1 <= repeats <= 1000:
        raise InputError(f"--largest {largest:g}, --repeats {repeats}; allowed: from {SIDES[0] ** 2} on, and 1 to 1000")
    started = runtime.start(arch, threads=threads)
    yield f"{cpu_name()}, {cores()} cores; Taichi on {started.arch}, {started.threads} threads"
    run = f"{SUBSTEPS} substeps" if runtime.on_host() else f"a frame of 1/{FRAME:.0f} s"
    yield f"a sheet of 1 m hung from its top edge in wind; medians of {repeats} runs of {run}"
    columns = "bytes a point, substeps a frame, × real time"
    heads = f"{'ms a substep':>12} {'CPU ms':>9} {'ns a point':>10} {'grows':>6}  {columns}"
    yield f"{'key points':>12}  {'form':<16} {heads}"
    before: dict[str, tuple[int, float]] = {}
    slow: set[str] = set()
    for side in sides:
        forms = []
        for name in _forms():
            if name not in slow:
                try:
                    forms.append(_made(name, side))
                except (InputError, RuntimeError) as error:
                    if isinstance(error, RuntimeError) and not is_out_of_memory(error):
                        raise
                    slow.add(name)
                    yield f"{side:>5} × {side:<4}  {name:<16} refused: {' '.join(str(error).split())}"
        for one in forms:  # compiles
            if one.run() > LONGEST * 10:
                slow.add(one.name)
            one.wall.clear()
            one.cpu.clear()
        for _ in range(repeats):
            for one in forms:
                if one.run() > LONGEST / 4:
                    slow.add(one.name)
        for one in forms:
            yield _line(one, side, before)


def _forms() -> tuple[str, ...]:
    if runtime.on_host():
        return "verlet, threads", "verlet, loops", "yarns, threads", "yarns, loops"
    return "verlet, loops", "yarns, loops"


def _made(name: str, side: int) -> _Form:
    kind = Verlet if name.startswith("verlet") else Yarns
    material = replace(named_material("cotton-shirting"), air_damping=1.0, **(STRAIGHT if kind is Verlet else {}))
    spacing = 1 / (side - 1)
    held = np.zeros((side, side), bool)
    held[-1] = True
    springs = calibrate(material, spacing_x=spacing, spacing_y=spacing)
    sheet = Sheet.rectangle(side, side, material=material, springs=springs, pinned=held)
    substeps = kind(sheet, FORCES, frame_rate=FRAME).substeps
    solver = kind(sheet, FORCES, frame_rate=FRAME * substeps / SUBSTEPS if runtime.on_host() else FRAME)
    solver.loops_from = 0 if name.endswith("loops") else float("inf")
    return _Form(name, solver, sheet.state(sheet.flat(), solver.remembered), substeps, [], [])


def _line(one: _Form, side: int, before: dict[str, tuple[int, float]]) -> str:
    points = side * side
    wall, busy = (1e3 * float(np.median(times)) / one.solver.substeps for times in (one.wall, one.cpu))
    grows = "–"
    if one.name in before:
        fewer, least = before[one.name]
        grows = f"n^{log(busy / least) / log(points / fewer):.2f}"
    before[one.name] = points, busy
    frame = one.solver._filled(one.state)
    substeps = one.substeps if runtime.on_host() else one.solver.substeps  # more where threads are pulled hard
    held = field_bytes(frame) / points
    return (
        f"{side:>5} × {side:<4}  {one.name:<16} {wall:>12.3f} {busy:>9.3f} {1e6 * busy / points:>10.1f} {grows:>6}  "
        f"{held:.0f}, {substeps:,}, {1e-3 * wall * substeps * FRAME:.2g}"
    )


def _busy() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
