"""One scene in a process of its own: what it builds and compiles, and where the time to its first picture goes.

`python -m taichi_cloth.scenes.studies.stage_probe BEGUN WIDTHxHEIGHT SCENE [KEY=VALUE …]` prints JSON; BEGUN: the
time.time() of whoever started it.
"""

import gc
import json
import sys
import time
from dataclasses import asdict, dataclass
from math import prod
from statistics import median

__all__ = ["Probe", "field_bytes", "kernel_count"]

FRAMES, STEPS, LONG = 3, 12, 2.0
"""Frames that are drawn and steps that are moved to be timed, and CPU time [s] after which no more are."""


@dataclass(frozen=True, kw_only=True)
class Probe:
    """kernels: compiled or taken from the cache. bytes: of Taichi's fields and arrays. import_s … picture_s: time [s]
    since the process was asked for, at the end of each: Python and imports, the start of Taichi, the scene built, its
    first picture. cpu_s: CPU time up to there. moved_s, drawn_s: CPU time of moving on by a frame, 0 for what stands
    still, and of drawing one, medians of further frames. stages: names of those built."""

    kernels: int
    bytes: int
    import_s: float
    start_s: float
    build_s: float
    picture_s: float
    cpu_s: float
    moved_s: float
    drawn_s: float
    stages: list[str]


def kernel_count() -> int:
    """Kernels of this process that Taichi has compiled or loaded, each variant once."""
    from taichi.lang import impl

    return int(impl.get_runtime().get_num_compiled_functions())


def field_bytes() -> int:
    """Of all fields and arrays of Taichi that are alive; all of them hold numbers of four bytes. Only in a process that
    has started Taichi once: to ask a field of a start before is fatal."""
    import taichi as ti

    total = 0
    for one in gc.get_objects():
        if isinstance(one, ti.Ndarray):
            total += 4 * prod(one.shape or ())
        elif isinstance(one, ti.Field) and one.snode.ptr is not None:  # gradients that nobody asked for have none
            total += 4 * prod(one.shape) * (one.n * one.m if isinstance(one, ti.MatrixField) else 1)
    return total


def probe(begun: float, size: tuple[int, int], name: str, overrides: list[str]) -> Probe:
    """Everything from the import to a few frames. Starts Taichi."""
    from taichi_cloth.ground import runtime

    from ..models.build import build, shown_frame
    from ..picture.view import View
    from ..plan.plan import plan
    from ..scene.load import load_scene

    imported = time.time()
    scene = load_scene(name, overrides)
    planned = plan(scene)
    runtime.start("cpu", threads=1)
    started = time.time()
    model = build(scene, planned.prepared)
    built = time.time()
    moves = scene.subject in ("cloth", "garment", "twist")
    model.step(0 if moves else shown_frame(scene, model))
    view = View(model, size)
    frames = view.animation(list(range(2 + FRAMES))) if moves else view.turntable(36, list(range(2 + FRAMES)))
    next(frames)
    shown, cpu = time.time(), time.process_time()
    next(frames)  # the first that moves compiles what moves it
    moved, drawn = [0.0] if not moves else [], list[float]()

    def step(number: int) -> None:
        begin = time.process_time()
        model.step(number)
        moved.append(time.process_time() - begin)

    number = 2
    while len(drawn) < FRAMES and sum(drawn) < LONG:
        if moves:
            step(number)
        begin = time.process_time()
        next(frames)
        drawn.append(time.process_time() - begin)
        number += 1
    while moves and len(moved) < STEPS and sum(moved) < LONG:
        step(number)
        number += 1
    return Probe(
        kernels=kernel_count(),
        bytes=field_bytes(),
        import_s=imported - begun,
        start_s=started - begun,
        build_s=built - begun,
        picture_s=shown - begun,
        cpu_s=cpu,
        moved_s=median(moved),
        drawn_s=median(drawn),
        stages=[stage.name for stage in planned.stages if stage.built],
    )


def main() -> None:
    begun, size, name, *overrides = sys.argv[1:]
    width, height = (int(n) for n in size.split("x"))
    print(json.dumps(asdict(probe(float(begun), (width, height), name, overrides))))


if __name__ == "__main__":
    main()
