"""`profile --tables`: the paper's three garments, made to its counts, timed in motion on a walking body (paper 4.3)."""

import os
import platform
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.garment.sewn.weaving import Weaving
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError, Unstable

from ..commands.device import cpu_for
from ..measure.frame_parts import clock_or_none
from ..measure.machine import cores, cpu_name
from ..prepare.garment_setup import Progress, dressed_parts, woven_garment
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import built_in_scenes, load_scene
from ..scene.schema import Scene
from .garment_timing import measure
from .own_scenes import scene_file
from .table_text import PAPER, Measured, tables_of, write_tables

__all__ = ["FRAMES", "QUICK", "scene_of", "table_lines"]

FRAMES = 100
RATE = 60
"""Frames a second."""

QUICK, QUICK_FRAMES = ("short skirt",), 30
"""What is timed quickly: the garment that is made soonest."""

GARMENTS = {"T-shirt": ("tshirt", "male"), "short skirt": ("skirt", "female"), "dress": ("dress", "female")}
BY_HAND = [(fibres, steps) for fibres in range(3, 8) for steps in range(5, 10)]
"""Fibres of a yarn and pieces of each between two key points that a count is met with."""
GAP_MM = 4
"""From the primitives, whose skin is part of that. Threads of one a key point are as thick as cloth of 3.3 to 3.6 mm:
a body that kept both away would draw a waistband's weft by 3.7 %, beyond its crimp."""


def table_lines(
    *,
    frames: int | None = None,
    quick: bool = False,
    out: Path | None = None,
    arch: Any = "cpu",
    threads: int | None = None,
    each: Progress | None = None,
) -> Iterator[str]:
    """Builds, times and compares the three garments, or those of QUICK. Starts Taichi. each: told the stage, what is
    done of it and how much there is. Raises InputError for bad input."""
    begun = time.process_time()
    if frames is None:
        frames = QUICK_FRAMES if quick else FRAMES
    if not 2 <= frames <= 100_000:
        raise InputError(f"--frames: {frames}; allowed: 2 to 100000")
    started = runtime.start(cpu_for("what --tables times", arch), threads=threads, pin=True)
    load = f"; load {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    heading = [
        f"{cpu_name()}, {cores()} cores, {platform.system()}; "
        f"Taichi on {started.arch}, {started.threads} threads{load}",
        f"medians of {frames} frames of 1/{RATE} s of a walking body; paper: Core i7-2675QM, 4 cores",
    ]
    yield from heading
    measured: dict[str, Measured] = {}
    clock = clock_or_none()
    for name in QUICK if quick else PAPER:
        yield f"{name}: the paper's counts are looked for"
        try:
            scene = scene_of(name)
            measured[name] = ours = yield from measure(name, scene, frames, clock=clock, quick=quick, each=each)
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
    yield ""
    yield f"CPU time in all: {time.process_time() - begun:.0f} s"
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
        f"garment.gap_mm={GAP_MM}",
        f"body.gender={gender}",
        "body.motion=walk",
        "forces.self_contact={}",  # of which the paper says nothing
        f"output.fps={RATE}",
        "yarn.plies=1",
        "yarn.hairiness.loops_per_m=0",
    ]

    def scene(fibres: int, steps: int, ends: float) -> Scene:
        numbers = [f"yarn.fibres={fibres}", f"fabric.steps={steps}", f"yarn.hairiness.ends_per_m={ends:.2f}"]
        return load_scene(scene_file(scene_name), fixed + numbers)

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
