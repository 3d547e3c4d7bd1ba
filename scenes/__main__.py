"""The command line: `taichi-cloth scenes | plan | turntable | animate | zoom | still | pattern | fabric | profile |
check | figures | report | stability | body`."""

import io
import logging
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

import taichi_cloth
from taichi_cloth.ground.errors import DoesNotFit, InputError, Unstable

from .body.body_command import body_app
from .commands.stopping import Terminated, stoppable

__all__ = ["app", "main"]

STOPPED = "stopped; frames already written are whole: go on with --resume"

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Cloth modelled from its fibres up: fibres, yarns, woven fabric, and pictures of every fibre.",
)

app.add_typer(body_app, name="body")

SceneName = Annotated[str, typer.Argument(help="A built-in scene (see: taichi-cloth scenes) or a .toml file.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a scene value.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for the images; default: out/SCENE.")]
Size = Annotated[str | None, typer.Option("--size", metavar="WxH", help="Image size in pixels, such as 1280x720.")]
Resume = Annotated[bool, typer.Option("--resume", help="Keep the frames an interrupted run left, make the others.")]
Webp = Annotated[bool, typer.Option("--webp", help="Also an animated WebP for a README.")]
Arch = Annotated[str, typer.Option("--arch", help="cpu, cuda, vulkan, metal or gpu.")]
Threads = Annotated[int | None, typer.Option("--threads", help="CPU threads; default: all there are.")]


@app.command("scenes")
def list_scenes() -> None:
    """List the built-in scenes, a line each."""
    from .scene.load import built_in_scenes

    known = built_in_scenes()
    width = max(len(name) for name in known)
    for name, title in known.items():
        typer.echo(f"{name:<{width}}  {title}")


@app.command("plan")
def show_plan(scene: SceneName, overrides: Overrides = None) -> None:
    """Say what a scene builds, what it leaves out and why, and how much of everything. Runs nothing."""
    from .plan.lines import plan_lines
    from .plan.plan import plan
    from .scene.load import load_scene

    for line in plan_lines(plan(load_scene(scene, overrides))):
        typer.echo(line)


def _changed(overrides: list[str] | None, key: str, count: int | None, webp: bool) -> list[str]:
    """A scene's overrides with what the options for the number of pictures and for a WebP say."""
    counted = [f"output.{key}={count}"] if count is not None else []
    return [*(overrides or []), *counted, *(["output.webp=true"] if webp else [])]


@app.command("turntable")
def turntable(
    scene: SceneName,
    overrides: Overrides = None,
    views: Annotated[int | None, typer.Option("--views", help="Views round the subject; default: 36.")] = None,
    size: Size = None,
    out: Out = None,
    webp: Webp = False,
    resume: Resume = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Walk round a scene: a PNG a view, an MP4 and a contact sheet."""
    from .commands.run import run

    changed = _changed(overrides, "views", views, webp)
    run("turntable", scene, changed, size=size, out=out, resume=resume, arch=arch, threads=threads)


@app.command("animate")
def animate(
    scene: SceneName,
    overrides: Overrides = None,
    frames: Annotated[int | None, typer.Option("--frames", help="Frames; default: the scene's.")] = None,
    motion: Annotated[
        str | None,
        typer.Option("--motion", help="How the body moves: rest, turn, walk, … or a .bvh or .npz file."),
    ] = None,
    size: Size = None,
    out: Out = None,
    webp: Webp = False,
    resume: Resume = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Show a scene that moves (twist, drape, flag, hanging, dress): a PNG a frame, an MP4 and a contact sheet."""
    from .commands.run import run

    changed = _changed(overrides, "frames", frames, webp)
    changed += [f"body.motion={motion}"] if motion is not None else []
    run("animate", scene, changed, size=size, out=out, resume=resume, arch=arch, threads=threads)


@app.command("zoom")
def make_zoom(
    scene: SceneName,
    overrides: Overrides = None,
    frames: Annotated[int | None, typer.Option("--frames", help="Frames; default: the scene's.")] = None,
    size: Size = None,
    out: Out = None,
    webp: Webp = False,
    resume: Resume = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """One continuous move from the whole cloth to one fibre: a PNG a frame, an MP4 and a contact sheet."""
    from .commands.run import run

    changed = _changed(overrides, "frames", frames, webp)
    run("zoom", scene, changed, size=size, out=out, resume=resume, arch=arch, threads=threads)


@app.command("still")
def make_still(
    scene: SceneName,
    overrides: Overrides = None,
    size: Size = None,
    passes: Annotated[str, typer.Option("--passes", help="colour, depth, normal, mask, id.")] = "colour",
    form: Annotated[str, typer.Option("--format", help="png (8-bit colour), png16, or exr.")] = "png",
    supersample: Annotated[int, typer.Option("--supersample", help="Samples a pixel each way: 1, 2 or 4.")] = 2,
    out: Out = None,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """One clean picture, and if asked depth, normals, coverage and numbers of yarns, with the camera in a JSON."""
    from .commands.still import still

    still(
        scene,
        list(overrides or []),
        size=size,
        passes=passes,
        form=form,
        supersample=supersample,
        out=out,
        arch=arch,
        threads=threads,
    )


@app.command("pattern")
def pattern(
    file: Annotated[Path, typer.Argument(help="A pattern as DXF (ASTM/AAMA).")],
    unit: Annotated[str | None, typer.Option("--unit", help="mm, cm, m or in, where the file does not say.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for both files; default: out/FILE.")] = None,
) -> None:
    """Draw the pieces of a DXF with the numbers of their edges, and write a TOML for beside it to begin with."""
    from .commands.pattern_pieces import pattern_lines

    for line in pattern_lines(file, out, unit):
        typer.echo(line)


@app.command("fabric")
def fabric(
    scene: Annotated[str, typer.Argument(help="A built-in scene, a .toml file, or a draft as a .wif file.")],
    overrides: Overrides = None,
    length: Annotated[float | None, typer.Option("--length", help="Of the piece, finished, in metres.")] = None,
    width: Annotated[float | None, typer.Option("--width", help="Of the piece, finished, in metres.")] = None,
    shrinkage_length: Annotated[float, typer.Option(help="In finishing, of the length on the loom [%].")] = 0.0,
    shrinkage_width: Annotated[float, typer.Option(help="In finishing, of the width on the loom [%].")] = 0.0,
    waste: Annotated[float, typer.Option("--waste", help="Warp left at both ends of the loom, in metres.")] = 0.0,
    measured: Annotated[Path | None, typer.Option("--measured", help="A .toml file of measured properties.")] = None,
    drape: Annotated[
        bool, typer.Option("--drape", help="Drape a disc of it over Cusick's support, simulated.")
    ] = False,
    shadow: Annotated[Path | None, typer.Option("--shadow", help="With --drape: a .png for the disc's shadow.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
) -> None:
    """The mill's ticket of a cloth: sett, widths, weight, yarn needed, and how it bends, shears and pulls."""
    from .fabric.fabric_command import print_ticket
    from .fabric.ticket import PieceAsked

    asked = PieceAsked(length, width, (shrinkage_length, shrinkage_width), waste)
    print_ticket(scene, list(overrides or []), asked, measured=measured, as_json=as_json, draped=drape, shadow=shadow)


@app.command("profile")
def profile(
    scene: SceneName = "swatch",
    overrides: Overrides = None,
    repeats: Annotated[int, typer.Option("--repeats", help="Timed runs of each stage.")] = 15,
    render: Annotated[bool, typer.Option("--render", help="Time the splatter's paths and how they scale.")] = False,
    scale: Annotated[bool, typer.Option("--scale", help="Time motion of ever larger sheets, in each form.")] = False,
    largest: Annotated[
        float | None, typer.Option("--largest", help="Particles (--render) or key points (--scale) to scale up to.")
    ] = None,
    tables: Annotated[bool, typer.Option("--tables", help="The paper's Tables 1 to 3 beside ours.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="With --tables: the short skirt alone.")] = False,
    frames: Annotated[
        int | None, typer.Option("--frames", help="With --tables: timed frames; default: 100, quick 30.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="With --tables: folder for text, CSV, Markdown.")] = None,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Time building and drawing: this scene, and the fixed work the paper's T-shirt sets. Medians."""
    if tables:
        from .commands.progress import staged
        from .paper.tables import table_lines

        with staged() as (each, say):
            for line in table_lines(frames=frames, quick=quick, out=out, arch=arch, threads=threads, each=each):
                say(line)
        return
    if render:
        from .measure.profile_render import render_profile_lines

        for line in render_profile_lines(
            scene, overrides, largest=largest or 1e7, repeats=repeats, arch=arch, threads=threads
        ):
            typer.echo(line)
        return
    if scale:
        from .measure.profile_scale import scale_lines

        for line in scale_lines(largest=largest or 1.1e6, repeats=repeats, arch=arch, threads=threads):
            typer.echo(line)
        return
    from .measure.profile import profile_lines

    for line in profile_lines(scene, overrides, repeats=repeats, arch=arch, threads=threads):
        typer.echo(line)


@app.command("check")
def check_cloth(
    what: Annotated[str, typer.Argument(help="A scene, the folder of an animate, or a mesh: OBJ, PLY, GLB, STL.")],
    overrides: Overrides = None,
    frames: Annotated[int | None, typer.Option("--frames", min=1, help="Frames to look at; default: all.")] = None,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Count triangles of a cloth that pass through others, frame by frame. Exit code 1 if there are any."""
    from .measure.crossing_check import check

    lines = check(what, list(overrides or []), frames=frames, arch=arch, threads=threads)
    while True:
        try:
            typer.echo(next(lines))
        except StopIteration as end:
            raise typer.Exit(int(end.value)) from None


@app.command("figures")
def figures(
    out: Annotated[Path, typer.Option("--out", help="Folder for the figures and index.html.")] = Path("out/figures"),
    only: Annotated[str | None, typer.Option("--only", help="Numbers, such as 5,9 or 10-12; default: all.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Coarser, to see what they show.")] = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Make the paper's Figures 1 to 16, on one page with captions and commands."""
    from .paper.figures import make_figures

    status = make_figures(out=out, only=only, quick=quick, arch=arch, threads=threads)
    if status:
        raise typer.Exit(status)


@app.command("report")
def report(
    out: Annotated[Path, typer.Option("--out", help="Folder for the page, diagrams and CSV.")] = Path("report"),
    only: Annotated[str | None, typer.Option("--only", help="Studies, such as solver,contact; default: all.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer and shorter runs: minutes in all.")] = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Error against run time of everything that is approximate: a page with diagrams, and the rows as CSV."""
    from .studies.make import make_report

    make_report(only=only, quick=quick, out=out, arch=arch, threads=threads)


@app.command("stability")
def stability(
    out: Annotated[Path, typer.Option("--out", help="CSV of all cells.")] = Path("stability.csv"),
    quick: Annotated[bool, typer.Option("--quick", help="A part of the matrix.")] = False,
    arch: Arch = "cpu",
    threads: Threads = None,
) -> None:
    """Stiffness, steps, masses and starts that no one would wish for: stable, or refused with its line."""
    from .stability.make import make_matrix

    status = make_matrix(out=out, quick=quick, arch=arch, threads=threads)
    if status:
        raise typer.Exit(status)


@app.callback(invoke_without_command=True)
def root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        typer.echo(f"taichi-cloth {taichi_cloth.__version__}")
        raise typer.Exit


def main(arguments: list[str] | None = None) -> None:
    """Run the command line. Bad input gives one line on standard error and exit code 2, a garment that does not fit its
    body, its pictures drawn, one line and exit code 3.

    130 and 143 after an interrupt (Ctrl-C) and a SIGTERM (killed, so 137, where a compiler did not let it answer within
    a second), 1 when the machine fails: a full disk, a closed pipe.
    """
    _open_streams()
    logging.basicConfig(format="taichi-cloth: %(message)s")
    with stoppable(STOPPED):
        status = _status(sys.argv[1:] if arguments is None else arguments)
    sys.exit(status)


def _open_streams() -> None:
    """Standard streams that are closed lead nowhere, so that no file of ours takes their place and what others write
    to them; those of a terminal that knows ASCII only show other letters written out."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # for the whole run
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _status(arguments: list[str]) -> int:
    from typer.exceptions import TyperException

    try:
        result: Any = app(args=arguments, standalone_mode=False, prog_name="taichi-cloth")
    except (InputError, Unstable) as error:
        _say(str(error))
        return 2
    except DoesNotFit as error:
        _say(str(error))
        return 3
    except typer.Exit as end:
        return end.exit_code
    except TyperException as error:
        _say(" ".join(error.format_message().split()) or f"see: taichi-cloth {' '.join(arguments)} --help")
        return 2
    except (KeyboardInterrupt, typer.Abort, Terminated) as stop:
        _say(STOPPED)
        return 143 if isinstance(stop, Terminated) else 130
    except MemoryError:
        _say("out of memory; make the scene smaller (see: taichi-cloth plan) or close other programs")
        return 2
    except RuntimeError as error:
        from taichi_cloth.ground.device_memory import is_out_of_memory, said_of_memory

        if not is_out_of_memory(error):
            raise
        _say(
            f"the device is out of memory{said_of_memory()}; use --arch cpu, fewer key points or fewer particles (see: "
            "taichi-cloth plan)"
        )
        return 2
    except BrokenPipeError:  # whoever read our output has gone; Python must not trip over it again at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        _say(f"{error.filename or 'writing'}: {error.strerror or error}; frames already written are whole")
        return 1
    status = result if isinstance(result, int) else 0
    if status == 130:  # what Typer makes of Ctrl-C
        _say(STOPPED)
    return status


def _say(line: str) -> None:
    """One line on standard error, with what a terminal would obey or could not show written out."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(line.split()))
    print(f"taichi-cloth: {shown}", file=sys.stderr)


if __name__ == "__main__":
    main()
