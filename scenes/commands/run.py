"""Turntables, animations and zooms: frames to disk, then the video and the contact sheet."""

import sys
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError

from ...render.image.image import contact_sheet, write_png
from ...render.image.video import write_mp4
from ...render.image.webp import write_webp
from ..models.build import build, shown_frame
from ..models.moving_model import MovingModel
from ..picture.view import View
from ..picture.zoom import zoom
from ..plan.lines import fact_lines, plan_lines
from ..plan.plan import plan
from ..prepare.drawing import require_picture
from ..scene.load import load_scene
from .sequence import Sequence, fingerprint

__all__ = ["image_size", "progress", "run"]

Command = Literal["turntable", "animate", "zoom"]


def run(
    command: Command,
    name: str,
    overrides: list[str],
    *,
    size: str | None,
    out: Path | None,
    resume: bool,
    arch: Any,
    threads: int | None,
) -> None:
    """One command from scene to files. Raises InputError before anything is written when the input is bad."""
    scene = load_scene(name, overrides + ([f"output.size={list(image_size(size))}"] if size is not None else []))
    if command == "animate" and scene.subject not in ("twist", "cloth", "garment"):
        raise InputError(
            f"animate: {name} stands still; use turntable, or animate twist, drape, flag, hanging or dress"
        )
    if command == "zoom" and scene.subject != "fabric":
        raise InputError(f"zoom: {name} has no [weave]; use a woven scene, such as swatch")
    require_picture(scene.output.size)
    planned = plan(scene)
    count = scene.output.views if command == "turntable" else scene.output.frames
    folder = out or Path("out") / (Path(name).stem + ("-zoom" if command == "zoom" else ""))
    sequence = Sequence.open(folder, fingerprint(scene, command), count, resume=resume)
    runtime.start(arch, threads=threads)
    with progress() as bar:
        stages: dict[str, TaskID] = {}

        def each(stage: str, done: int, most: int) -> None:
            if stage not in stages:
                stages[stage] = bar.add_task(stage, total=most)
            bar.update(stages[stage], completed=done)

        model = build(scene, planned.prepared, each)
    view = View(model, scene.output.size)
    sequence.begin()
    for line in (*plan_lines(planned), *fact_lines(model.facts())):
        print(line)

    todo = sequence.missing()
    if isinstance(model, MovingModel) and command == "animate":
        model.keep(folder, todo[0] if todo else count)
    if command == "turntable":
        model.step(shown_frame(scene, model))
        frames = view.turntable(count, todo)
    elif command == "zoom":
        frames = zoom(view, count, todo)
    else:
        frames = view.animation(todo)
    with progress() as bar:
        task = bar.add_task("frames", total=count, completed=count - len(todo))
        for _ in sequence.write(frames):
            bar.advance(task)
        closing = bar.add_task("video and sheet", total=2)
        codec = write_mp4(folder / f"{command}.mp4", sequence.paths, fps=scene.output.fps)
        bar.advance(closing)
        write_png(folder / "sheet.png", contact_sheet(sequence.paths, thumbnail=max(64, 1920 // 6)))
        bar.advance(closing)
        if scene.output.webp:
            write_webp(folder / f"{command}.webp", sequence.paths, fps=scene.output.fps)
    print(f"{count} frames, {command}.mp4 ({codec}) and sheet.png in {folder}")


def image_size(text: str) -> tuple[int, int]:
    """The image size [px] that a `--size WxH` states. Raises InputError."""
    parts = text.lower().split("x")
    if len(parts) == 2 and all(p.isdecimal() and p.isascii() and len(p) < 6 and 1 <= int(p) <= 16384 for p in parts):
        return int(parts[0]), int(parts[1])
    raise InputError(f"--size: {text[:40]!r}; allowed: WIDTHxHEIGHT with 1 to 16384 pixels each, such as 1280x720")


def progress() -> Progress:
    """A bar on standard error, if that is a terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
    )
