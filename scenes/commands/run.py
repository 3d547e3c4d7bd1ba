"""Turntables, animations and zooms: frames to disk, then the video and the contact sheet."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.progress import TaskID

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import DoesNotFit, InputError

from ...render.image.image import contact_sheet, write_png
from ...render.image.video import write_mp4
from ...render.image.webp import write_webp
from ..models.build import build, shown_frame
from ..models.model import FACTS, STATE, Model
from ..picture.view import View
from ..plan.lines import fact_lines, plan_lines
from ..plan.plan import plan
from ..prepare.drawing import require_picture
from ..prepare.weave_layout import Prepared
from ..scene.load import load_scene
from ..scene.schema import Scene
from .device import device_of
from .output_folder import OutputFolder
from .progress import progress
from .sequence import Sequence, fingerprint

if TYPE_CHECKING:
    from ..models.moving_model import MovingModel

__all__ = ["image_size", "require_fit", "run"]

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
    if command == "animate" and not (scene.is_soft or scene.subject == "twist"):
        raise InputError(
            f"animate: {name} stands still; use turntable, or animate twist, drape, flag, hanging or dress"
        )
    if command == "zoom":
        from ..picture.zoom import require_threads

        require_threads(scene, name)
    require_picture(scene.output.size)
    planned = plan(scene)
    count = scene.output.views if command == "turntable" else scene.output.frames
    folder = out or Path("out") / (Path(name).stem + ("-zoom" if command == "zoom" else ""))
    video, sheet, moving = f"{command}.mp4", "sheet.png", command == "animate" and scene.subject != "twist"
    products = [video, sheet, *([f"{command}.webp"] if scene.output.webp else []), *([STATE] if moving else [])]
    products += [FACTS] if moving and scene.is_worn else []
    mark = fingerprint(scene, command)
    with OutputFolder(folder) as held:
        sequence = Sequence.open(held, mark, count, products, resume=resume)
        runtime.start(device_of(planned, arch), threads=threads)
        model = _built(scene, planned.prepared)
        view = View(model, scene.output.size)
        if not held.path.exists():
            held.make()
            sequence = Sequence.open(held, mark, count, products, resume=resume)  # what came there meanwhile
        sequence.begin()
        for line in (*plan_lines(planned, material=False), *fact_lines(model.facts())):
            print(line)
        todo = sequence.missing()
        moved = _moving(model)
        if moved is not None and command == "animate":
            moved.keep(folder, todo[0] if todo else count)
        if command != "animate":
            model.step(shown_frame(scene, model))
        if command == "turntable":
            frames = view.turntable(count, todo)
        elif command == "zoom":
            from ..picture.zoom import zoom

            frames = zoom(view, count, todo)
        else:
            frames = view.animation(todo)
        with progress() as bar:
            task = bar.add_task("frames", total=count, completed=count - len(todo))
            for _ in sequence.write(frames):
                bar.advance(task)
            closing = bar.add_task("video and sheet", total=2)
            codec = write_mp4(folder / video, sequence.paths, fps=scene.output.fps)
            bar.advance(closing)
            write_png(folder / sheet, contact_sheet(sequence.paths, thumbnail=max(64, 1920 // 6)))
            bar.advance(closing)
            if scene.output.webp:
                write_webp(folder / f"{command}.webp", sequence.paths, fps=scene.output.fps)
    for line in fact_lines([] if moved is None else moved.motion_facts()):
        print(line)
    print(f"{count} frames, {video} ({codec}) and {sheet} in {folder}")
    require_fit(model)


def require_fit(model: Model) -> None:
    """Raises DoesNotFit where a garment was sewn, and drawn, that does not fit who wears it."""
    moved = _moving(model)
    if moved is not None and moved.misfit is not None:
        raise DoesNotFit(f"does not fit: {moved.misfit}; the pictures are kept")


def _moving(model: Model) -> "MovingModel | None":
    """A sheet or a garment; None of what lies still, for which nothing is loaded that moves."""
    if not model.scene.is_soft:
        return None
    from ..models.moving_model import MovingModel

    return model if isinstance(model, MovingModel) else None


def _built(scene: Scene, prepared: Prepared | None) -> Model:
    """The scene's model, with a bar where building takes long."""
    with progress() as bar:
        stages: dict[str, TaskID] = {}

        def each(stage: str, done: int, most: int) -> None:
            if stage not in stages:
                stages[stage] = bar.add_task(stage, total=most)
            bar.update(stages[stage], completed=done)

        return build(scene, prepared, each)


def image_size(text: str) -> tuple[int, int]:
    """The image size [px] that a `--size WxH` states. Raises InputError."""
    parts = text.lower().split("x")
    if len(parts) == 2 and all(p.isdecimal() and p.isascii() and len(p) < 6 and 1 <= int(p) <= 16384 for p in parts):
        return int(parts[0]), int(parts[1])
    raise InputError(f"--size: {text[:40]!r}; allowed: WIDTHxHEIGHT with 1 to 16384 pixels each, such as 1280x720")
