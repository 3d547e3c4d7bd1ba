"""Curves over time beside a reference, as differences from it: a panel for each pair of a case and a measure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagram import COLOURS

__all__ = ["Panel", "draw_curves"]

WIDTH, HEIGHT = 5.6, 2.9  # of a panel [inch]
LINEAR = 1.0
"""Up to where an axis of differences is linear; beyond it is logarithmic."""


@dataclass(frozen=True, eq=False)
class Panel:
    """title. time [s]. lines: by method, differences from the reference, one a time. unsure: half the width of the band
    in which the reference itself may lie, at each time."""

    title: str
    time: NDArray[np.float64]
    lines: Mapping[str, NDArray[np.float64]]
    unsure: NDArray[np.float64]


def draw_curves(panels: Sequence[Panel], methods: Sequence[str], words: tuple[str, str]) -> bytes:
    """A PNG, panels two abreast. methods: in the order of their colours. words: of the axes. Needs matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # pyright: ignore[reportMissingImports]
    from matplotlib.figure import Figure  # pyright: ignore[reportMissingImports]
    from matplotlib.ticker import FuncFormatter  # pyright: ignore[reportMissingImports]

    rows = -(-len(panels) // 2)
    figure = Figure(figsize=(2 * WIDTH, HEIGHT * rows + 0.7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 2, squeeze=False).ravel()
    found: dict[str, Any] = {}
    for axis, panel in zip(axes, panels, strict=False):
        band = axis.fill_between(panel.time, -panel.unsure, panel.unsure, color="0.86", lw=0)
        found["the reference, ± its own uncertainty"] = band
        axis.axhline(0.0, color="0.55", lw=1.0)
        for method, line in panel.lines.items():
            colour = COLOURS[methods.index(method) % len(COLOURS)]
            (found[method],) = axis.plot(panel.time, line, color=colour, lw=1.6)
        axis.set_yscale("symlog", linthresh=LINEAR)
        axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
        axis.set_title(panel.title, fontsize=11)
        axis.set_xlabel(words[0])
        axis.set_ylabel(words[1])
        axis.grid(color="0.92")
        axis.set_axisbelow(True)
        axis.margins(x=0.0)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=3, frameon=False, fontsize=9.5)
    out = BytesIO()
    figure.savefig(out, dpi=120, format="png", metadata={"Software": None})
    return out.getvalue()
