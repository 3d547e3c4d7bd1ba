"""`taichi-cloth figures`: the paper's Figures 1 to 16 made by this library, on one page with captions and commands."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.ground.files import write_bytes

from ...render.image.image import write_png
from ..commands.device import cpu_for
from .figures_cloth import drape, fibre, springs, textured, twist, weaves
from .figures_garment import body_parts, dressed_twice, magnified, moving, primitives, skirt_and_shirt, stretched

__all__ = ["FIGURES", "PaperFigure", "make_figures", "numbers_of", "page"]

Image = NDArray[np.uint8]
WIDTH = 1200
INDEX = "index.html"


@dataclass(frozen=True)
class PaperFigure:
    """first, last: the paper's numbers that one picture stands for. command: makes the like of it by itself.
    make: the picture; its argument asks for a quick one."""

    first: int
    last: int
    caption: str
    command: str
    make: Callable[[bool], Image]

    @property
    def number(self) -> str:
        return str(self.first) if self.first == self.last else f"{self.first}–{self.last}"

    @property
    def file(self) -> str:
        ends = f"{self.first:02}" if self.first == self.last else f"{self.first:02}-{self.last:02}"
        return f"figure-{ends}.png"


FIGURES = (
    PaperFigure(
        1,
        2,
        "A fibre as a set of spheres (left) and filled with particles (right): cotton, wool and silk.",
        "taichi-cloth turntable fibre --set fibre.kind=wool --views 1",
        fibre,
    ),
    PaperFigure(
        3,
        4,
        "Two singles being twisted: (a) at the start, (b, c) as the twist of zone a (A–B) rises while zone b (B–C) is "
        "twisted the other way, and (d) in the end, when zone b is straight again: false twist.",
        "taichi-cloth animate twist",
        twist,
    ),
    PaperFigure(
        5,
        5,
        "Weaves: plain, twill, satin and herringbone, near enough to see the threads.",
        "taichi-cloth turntable satin --views 1 --set camera.zoom=3",
        weaves,
    ),
    PaperFigure(
        6,
        6,
        "Fabric with a texture of coloured yarns, in soft folds: tartan and houndstooth.",
        "taichi-cloth turntable tartan --views 1",
        textured,
    ),
    PaperFigure(
        7,
        8,
        "Key points where the yarns cross (left), and the springs between them (right): structural along the yarns "
        "(red), shear across the meshes (green), bending over one key point (blue).",
        "taichi-cloth figures --only 7",
        springs,
    ),
    PaperFigure(
        9,
        9,
        "One sheet over a ball, as a mesh (left) and as fibre particles (right).",
        "taichi-cloth still drape --set cloth.representation=mesh",
        drape,
    ),
    PaperFigure(10, 10, "A body divided into its parts.", "taichi-cloth body fit built-in:female", body_parts),
    PaperFigure(
        11,
        11,
        "Primitives that stand for the body in contact: cylinders red, spheres blue, elliptic cylinders green.",
        "taichi-cloth body fit built-in:female",
        primitives,
    ),
    PaperFigure(
        12,
        12,
        "A whole dress (a) as a mesh and (b) as fibre particles: the same key points.",
        "taichi-cloth turntable dress --views 1 --set garment.representation=mesh",
        dressed_twice,
    ),
    PaperFigure(
        13,
        13,
        "The T-shirt magnified: whole, 4, 16 and 60 times.",
        "taichi-cloth still tshirt --set camera.zoom=4",
        magnified,
    ),
    PaperFigure(
        14,
        14,
        "A sheet held left and right: (a) at rest and (b) wrinkled along the pull.",
        "taichi-cloth animate stretch",
        stretched,
    ),
    PaperFigure(15, 15, "A short skirt and a T-shirt at rest.", "taichi-cloth turntable skirt", skirt_and_shirt),
    PaperFigure(
        16, 16, "A dress in motion: four moments of a walk.", "taichi-cloth animate dress --motion walk", moving
    ),
)


def numbers_of(only: str | None) -> list[PaperFigure]:
    """The figures that "5,9-11" asks for, all for None. Raises InputError."""
    if only is None:
        return list(FIGURES)
    wanted: set[int] = set()
    for part in only.split(","):
        low, _, high = part.strip().replace("–", "-").partition("-")
        if not (low.isdecimal() and (not high or high.isdecimal()) and 1 <= int(low) <= int(high or low) <= 16):
            raise InputError(f"--only {only!r}: allowed: numbers 1 to 16, such as 5,9 or 10-12")
        wanted |= set(range(int(low), int(high or low) + 1))
    return [f for f in FIGURES if wanted & set(range(f.first, f.last + 1))]


def make_figures(
    *, out: Path, only: str | None = None, quick: bool = False, arch: Any = "cpu", threads: int | None = None
) -> int:
    """Draws figures to a folder with an index page, each written whole; one that fails is named and the rest go on.

    The exit status: 1 when any failed. Raises InputError for bad input. Starts Taichi.
    """
    from ..commands.output_folder import OutputFolder

    chosen = numbers_of(only)
    with OutputFolder(out) as held:
        held.refuse_foreign([*(figure.file for figure in chosen), INDEX])
        runtime.start(cpu_for("figures", arch), threads=threads)
        held.make()
        held.claim([*(figure.file for figure in chosen), INDEX])
        failed = _draw(chosen, out, quick)
    return 1 if failed else 0


def _draw(chosen: Sequence[PaperFigure], out: Path, quick: bool) -> int:
    """Draws figures into a folder; how many failed."""
    from ..commands.progress import progress

    failed = 0
    with progress() as bar:
        task = bar.add_task("figures", total=len(chosen))
        for figure in chosen:
            bar.update(task, description=f"figure {figure.number}")
            begin = perf_counter()
            try:
                write_png(out / figure.file, fitted(figure.make(quick)))
            except (InputError, Unstable, MemoryError) as error:
                failed += 1
                print(f"figure {figure.number}: {' '.join(str(error).split()) or 'out of memory'}", file=sys.stderr)
            else:
                bar.console.print(f"figure {figure.number}: {out / figure.file}, {perf_counter() - begin:.0f} s")
                write_bytes(out / INDEX, page(out, FIGURES).encode())
            bar.advance(task)
    return failed


def fitted(image: Image) -> Image:
    """At most WIDTH wide: large pictures come out smooth."""
    height, width = image.shape[:2]
    if width <= WIDTH:
        return image
    return np.asarray(cv2.resize(image, (WIDTH, round(height * WIDTH / width)), interpolation=cv2.INTER_AREA), np.uint8)


def page(folder: Path, figures: Sequence[PaperFigure]) -> str:
    """HTML with the figures that are in the folder."""
    blocks = [
        f'<figure><img src="{f.file}" alt="{escape(f.caption)}"><figcaption><b>Figure {f.number}.</b> '
        f"{escape(f.caption)}<br><code>{escape(f.command)}</code></figcaption></figure>"
        for f in figures
        if (folder / f.file).exists()
    ]
    style = (
        "body{font:16px/1.5 system-ui,sans-serif;max-width:1240px;margin:2rem auto;padding:0 1rem;color:#222}"
        "figure{margin:0 0 3rem}img{max-width:100%;display:block;margin:0 auto .6rem}"
        "code{background:#f2f2f2;padding:.1rem .35rem;font-size:.9em}"
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Figures</title>'
        f"<style>{style}</style><h1>Figures 1 to 16</h1>\n" + "\n".join(blocks) + "\n</html>\n"
    )
