"""`taichi-cloth stability`: runs the matrix, prints the table as it grows, and writes it as CSV."""

from collections import Counter
from pathlib import Path
from typing import Any

from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import write_bytes

from ..commands.device import cpu_for
from ..commands.progress import progress
from ..measure.page import csv_text
from .garments import garment_cases
from .outcome import HEAD, NEITHER, Outcome, tried
from .program import program_cases
from .sheets import cells, ran

__all__ = ["line_of", "make_matrix"]

WIDTHS = (18, 44, 8, 12, 10, 10)
"""Columns of the table but the last."""


def make_matrix(*, out: Path, quick: bool = False, arch: Any = "cpu", threads: int | None = None) -> int:
    """The exit status: 1 when a cell is neither stable nor refused. Starts Taichi. Raises InputError."""
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: no such folder {out.parent}; make it first")
    runtime.start(cpu_for("stability", arch), threads=threads or 1)
    chosen, cases = cells(quick), [*program_cases(quick), *garment_cases(quick)]
    found: list[Outcome] = []
    with progress() as bar:
        task = bar.add_task("stability", total=len(chosen) + len(cases))
        bar.console.print(line_of(HEAD), soft_wrap=True, highlight=False, markup=False)
        for work in (*(lambda c=c: ran(c) for c in chosen), *(lambda c=c: tried(*c) for c in cases)):
            found.append(work())
            bar.console.print(line_of(found[-1].cells()), soft_wrap=True, highlight=False, markup=False)
            bar.advance(task)
    write_bytes(out, csv_text(found).encode())
    counted = Counter(outcome.verdict for outcome in found)
    print(", ".join(f"{number} {verdict}" for verdict, number in counted.items()) + f"; {out}")
    return 1 if counted[NEITHER] else 0


def line_of(cells: tuple[str, ...]) -> str:
    """A line of the table."""
    columns = [f"{cell:<{width}}" for cell, width in zip(cells, WIDTHS, strict=False)]
    return "  ".join([*columns, cells[-1]]).rstrip()
