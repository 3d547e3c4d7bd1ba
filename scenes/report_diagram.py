"""The solvers' diagram of error against run time, from the rows that `report_solvers` measured."""

# matplotlib is an extra.
# pyright: reportMissingImports=false

from collections.abc import Sequence
from pathlib import Path

from taichi_cloth.errors import InputError

from .report_solvers import CASES, SolverRow

__all__ = ["draw"]

STYLES = {
    "verlet": ("#c0392b", "*"),
    "implicit": ("#1f4e9c", "o"),
    "implicit, order 1": ("#5fa8e8", "s"),
    "threads, 1 sweep": ("#f2b970", "<"),
    "threads, 2 sweeps": ("#e08e2b", "^"),
    "threads, 8 sweeps": ("#8a5a16", "v"),
    "projective, 2 iterations": ("#7fbf7b", "D"),
    "projective, 20 iterations": ("#1b7837", "P"),
}


def draw(rows: Sequence[SolverRow], path: Path | str) -> None:
    """A panel for each case and stiffness, log–log. Raises InputError without matplotlib."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError(
            'report: diagrams need matplotlib; install it with: pip install "taichi-cloth[report]"'
        ) from None
    pairs = list(dict.fromkeys((row.case, row.stiffness) for row in rows))
    columns = min(2, len(pairs))
    lines = -(-len(pairs) // columns)
    figure = Figure(figsize=(5.2 * columns, 3.7 * lines + 0.9), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    for panel in panels.ravel()[len(pairs) :]:
        panel.set_visible(False)
    for panel, (case, stiffness) in zip(panels.ravel(), pairs, strict=False):
        here = [row for row in rows if (row.case, row.stiffness) == (case, stiffness)]
        for name in dict.fromkeys(row.solver for row in here):
            runs = sorted((r.ms_per_s, 1e3 * r.error) for r in here if r.solver == name and r.error == r.error)
            if not runs:
                continue
            if name == "reference":
                panel.axhline(runs[0][1], color="0.55", ls="--", lw=1.2, label="reference, step × 2")
                continue
            colour, marker = STYLES.get(name, ("0.3", "x"))
            size = 13 if marker == "*" else 6
            panel.plot(*zip(*runs, strict=True), color=colour, marker=marker, ms=size, lw=1.6, label=name)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(which="major", color="0.88")
        points = here[0].points
        panel.set_title(f"{case}, {stiffness:,.0f} × cotton, {points} × {points} key points", fontsize=10)
        panel.set_xlabel("CPU time for a simulated second [ms]")
        panel.set_ylabel(f"error after {CASES[case]:g} s, rms [mm]")
    entries = {
        label: line for panel in panels.ravel() for line, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(),
        entries.keys(),
        loc="outside lower center",
        ncols=2 * columns,
        frameon=False,
        fontsize=10,
    )
    figure.savefig(Path(path), dpi=110)
