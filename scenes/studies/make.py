"""`taichi-cloth report`: runs studies and writes the page."""

import os
import platform
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import taichi_cloth
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError, did_you_mean

from ..commands.device import cpu_for
from ..commands.progress import progress
from ..measure.diagram import draw, require_matplotlib
from ..measure.machine import cores, cpu_name
from ..measure.page import Section, check_folder, section_of, write_report
from ..measure.study import Row, Study

__all__ = ["STUDIES", "chosen", "make_report", "what_to_install"]

STUDIES = (
    *("solver", "spacing", "interpolation", "contact", "layers", "twist", "fibres", "splat", "stages", "appearance"),
)
"""Each a module here, with a `STUDY`, or with `sections` of its own."""

EXTRAS = {"appearance": ("reference", ("mitsuba", "flip_evaluator"))}
"""Studies that need an extra, and the packages in it."""


def chosen(only: str | None) -> list[str]:
    """The studies that "solver,contact" asks for, in their own order; all for None. Raises InputError."""
    if only is None:
        return list(STUDIES)
    wanted = [name.strip() for name in only.split(",")]
    for name in wanted:
        if name not in STUDIES:
            raise InputError(
                f"--only: unknown study {name!r}; known: {', '.join(STUDIES)}{did_you_mean(name, STUDIES)}"
            )
    return [name for name in STUDIES if name in wanted]


def what_to_install(name: str) -> str | None:
    """Why a study cannot be made here, and what makes it possible; None where it can."""
    extra, packages = EXTRAS.get(name, ("", ()))
    lacking = [package for package in packages if find_spec(package) is None]
    if not lacking:
        return None
    return f'{name} needs {" and ".join(lacking)}; install it with: pip install "taichi-cloth[{extra}]"'


def make_report(*, only: str | None, quick: bool, out: Path, arch: Any = "cpu", threads: int | None = None) -> None:
    """Runs studies and writes the report whole, or nothing. Starts Taichi. Raises InputError for bad input.

    threads: of kernels; one by default, so that CPU time is that of the work and not of waiting threads."""
    names, left_out = chosen(only), []
    for name in names:
        lacking = what_to_install(name)
        if lacking and only is not None:
            raise InputError(f"report: {lacking}")
        left_out += [(name, lacking)] if lacking else []
    check_folder(out)
    require_matplotlib()
    begun, load = time.perf_counter(), _load()
    started = runtime.start(cpu_for("report", arch), threads=threads or 1)
    sections = []
    names = [name for name in names if name not in dict(left_out)]
    with progress() as bar:
        for _, lacking in left_out:
            bar.console.print(f"left out: {lacking}", highlight=False, markup=False)
        task = bar.add_task("studies", total=len(names))
        for name in names:
            bar.update(task, description=name)
            start = time.perf_counter()
            sections += _sections(name, quick, lambda text: bar.update(task, description=text))
            bar.console.print(f"{name}: {time.perf_counter() - start:.0f} s", highlight=False)
            bar.advance(task)
    minutes = (time.perf_counter() - begun) / 60
    facts = [
        f"taichi-cloth {taichi_cloth.__version__}, Taichi on {started.arch} with {started.threads} thread"
        f"{'s' * (started.threads > 1)}, Python {platform.python_version()}",
        f"{cpu_name()}, {cores()} cores; load {load} at the start, {_load()} at the end; {minutes:.1f} minutes",
        "Times are CPU times, medians where a run is short. Measured again with: taichi-cloth report"
        + (f" --only {','.join(names)}" if only else "")
        + (" --quick (coarse: fewer and shorter runs)" if quick else ""),
        "The knee of a line is its setting with the least error × time; a ring marks the default.",
    ]
    write_report(sections, out, title="Error against run time", facts=facts)


def _sections(name: str, quick: bool, say: Callable[[str], object]) -> list[Section]:
    module = import_module(f".{name}", __package__)
    if not hasattr(module, "STUDY"):
        return module.sections(quick, say)
    study: Study = module.STUDY
    rows: list[Row] = []
    for row in study.rows(quick):
        rows.append(row)
        say(f"{name}: {row.panel}, {row.method}, {row.knob}"[:70])
    return [section_of(study, rows, draw(study, rows))]


def _load() -> str:
    try:
        return f"{os.getloadavg()[0]:.1f}"
    except OSError:
        return "unknown"
