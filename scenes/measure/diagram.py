"""Error against time, log–log: a panel for each of a study's, a line for each method, a ring round each default; and
where time goes, as bars."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from math import isfinite
from typing import Any

from taichi_cloth.ground.errors import InputError

from .study import Row, Study, lines_of

__all__ = ["PARTS", "draw", "draw_bars", "require_matplotlib"]

COLOURS = (
    *("#c0392b", "#1f4e9c", "#2f8f4e", "#e08e2b", "#7d4fa6", "#5fa8e8", "#8a5a16", "#444444"),
    *("#d6568f", "#12a39a"),
)
PARTS = (
    *("#b8bec7", "#8d99a8", "#6f7f92", "#c9b28a", "#a98f66", "#7f9e6b", "#9c6b8e", "#e3a34f"),
    *("#c0392b", "#d98880", "#1f4e9c", "#5fa8e8", "#444444"),
)
"""Of bars' parts."""
MARKERS = ("o", "s", "^", "D", "v", "P", "<", ">", "X", "h")
WIDTH, HEIGHT = 5.6, 4.0  # of a panel [inch]
FOOT = 0.05
"""Where on the axis of errors, as a share of it, a setting stands that is as good as the reference."""

RING: dict[str, Any] = {
    "marker": "o", "ms": 15, "mfc": "none", "mec": "black", "mew": 1.4, "ls": "none", "label": "default"
}  # fmt: skip
LEAST = 4.0
"""Ratio of the ends of an axis at least, so that noise does not look like much."""

CLOSE = 8.0
"""Ratio of the ends of an axis below which more than 1, 2 and 5 are written at it."""

LABELLED = 9
"""Points of a panel up to which each is named."""

SIDES = ((5, 5), (-8, -13), (5, -13), (-8, 7), (5, 15), (-8, -23), (5, -23), (-8, 17), (-30, -25), (12, -33))
"""Where beside its point a label may stand [pt], to the right or to the left of it; the earlier the better."""
ROOM = 2.5
"""Beside a point's mark or ring that is kept free of labels [pt]."""


def require_matplotlib() -> None:
    """Raises InputError without it."""
    try:
        import matplotlib.figure  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            'report: diagrams need matplotlib; install it with: pip install "taichi-cloth[report]"'
        ) from None


def draw(study: Study, rows: Sequence[Row]) -> bytes:
    """The diagram as a PNG. Raises InputError without matplotlib."""
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # pyright: ignore[reportMissingImports]
    from matplotlib.figure import Figure  # pyright: ignore[reportMissingImports]

    lines = lines_of(rows)
    panels = list(dict.fromkeys(panel for panel, _ in lines))
    methods = [m for m in dict.fromkeys(method for _, method in lines) if m != study.floor]
    columns = min(2, len(panels))
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * -(-len(panels) // columns) + 0.7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(-(-len(panels) // columns), columns, squeeze=False).ravel()
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    labels = []
    for axis, panel in zip(axes, panels, strict=False):
        here = {method: line for (name, method), line in lines.items() if name == panel}
        labels.append(_panel(axis, study, here, methods))
        axis.set_title(panel, fontsize=11)
    found: dict[str, Any] = {}
    for axis in axes:
        found |= {name: line for line, name in zip(*axis.get_legend_handles_labels(), strict=True)}
    beside = min(columns + 1, len(found))
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=beside, frameon=False, fontsize=9.5)
    figure.draw_without_rendering()  # puts the panels where they will be
    for axis, here in zip(axes, labels, strict=False):
        _set_apart(axis, here)
    return _png(figure)


def draw_bars(bars: Sequence[tuple[str, Mapping[str, float]]], order: Sequence[str], label: str) -> bytes:
    """What each thing is made of, a bar for each, its parts one after the other in that order, as a PNG. label: of
    their axis. Raises InputError without matplotlib."""
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # pyright: ignore[reportMissingImports]
    from matplotlib.figure import Figure  # pyright: ignore[reportMissingImports]

    figure = Figure(figsize=(2 * WIDTH, 0.34 * len(bars) + 1.6), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    places, ends = range(len(bars)), [0.0] * len(bars)
    known = [part for part in order if any(part in parts for _, parts in bars)]
    for k, part in enumerate(known):
        widths = [parts.get(part, 0.0) for _, parts in bars]
        axis.barh(places, widths, left=ends, label=part, color=PARTS[k % len(PARTS)], edgecolor="white", lw=0.5)
        ends = [end + width for end, width in zip(ends, widths, strict=True)]
    for place, end in zip(places, ends, strict=True):
        axis.annotate(f"{end:.3g}", (end, place), (4, 0), textcoords="offset points", va="center", fontsize=8)
    axis.set_yticks(places, [name for name, _ in bars], fontsize=9)
    axis.invert_yaxis()
    axis.set_xlabel(label)
    axis.margins(x=0.06)
    axis.grid(axis="x", color="0.88")
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return _png(figure)


def _png(figure: Any) -> bytes:
    out = BytesIO()
    figure.savefig(out, dpi=120, format="png", metadata={"Software": None})
    return out.getvalue()


def _panel(axis: Any, study: Study, lines: dict[str, list[Row]], methods: Sequence[str]) -> list[Any]:
    """Draws a panel; its labels."""
    from matplotlib.patheffects import Normal, Stroke  # pyright: ignore[reportMissingImports]
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # pyright: ignore[reportMissingImports]

    count = sum(len(line) for line in lines.values())
    first, labels = True, []
    for method, line in lines.items():
        if method == study.floor:
            axis.axhline(study.error.scale * line[0].error, color="0.55", ls="--", lw=1.2, label=line[0].knob)
            continue
        k = methods.index(method)
        colour = COLOURS[k % len(COLOURS)]
        if all(row.error == 0 for row in line):
            axis.axvline(study.time.scale * line[0].seconds, color=colour, ls=":", lw=1.8, label=method)
            continue
        exact = [row for row in line if row.error == 0]
        drawn = [row for row in line if isfinite(row.error) and isfinite(row.seconds) and row.error > 0]
        x, y = ([scale * v for v in values] for scale, values in (
            (study.time.scale, [row.seconds for row in drawn]), (study.error.scale, [row.error for row in drawn])
        ))  # fmt: skip
        axis.plot(x, y, color=colour, marker=MARKERS[k % len(MARKERS)], ms=5, lw=1.6, label=method)
        for row, a, b in zip(drawn, x, y, strict=True):
            if row.default:
                axis.plot([a], [b], **RING)
        for row in exact:  # at the foot of the panel
            at, foot = study.time.scale * row.seconds, axis.get_xaxis_transform()
            axis.plot([at], [FOOT], MARKERS[k % len(MARKERS)], color=colour, ms=5, transform=foot)
            axis.annotate(f"{row.knob}: no error", (at, FOOT), (9, 3), xycoords=foot, textcoords="offset points",
                          fontsize=7.5, color=colour)  # fmt: skip
            if row.default:
                axis.plot([at], [FOOT], transform=foot, **RING)
        if not drawn:  # refused at every setting, as the table says
            continue
        ends = {0, len(drawn) - 1} if first else {len(drawn) - 1}
        usual = {n for n, row in enumerate(drawn) if row.default}
        named = range(len(drawn)) if count <= LABELLED else sorted(ends | usual)
        first = False
        for n in named:
            label = axis.annotate(
                drawn[n].knob,
                (x[n], y[n]),
                SIDES[1 if drawn[n].default else 0],  # clear of the ring
                textcoords="offset points",
                fontsize=7.5,
                color=colour,
                path_effects=[Stroke(linewidth=2.5, foreground="white"), Normal()],
            )
            labels.append(label)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.margins(0.16, 0.12)
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for one, (low, high) in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
        if high / low < LEAST:
            middle = (low * high) ** 0.5
            low, high = middle / LEAST**0.5, middle * LEAST**0.5
        (axis.set_xlim if one is axis.xaxis else axis.set_ylim)(low, high)
        marks = (1.5, 2, 3, 4, 5, 7) if high / low < CLOSE else (2, 5) if high / low < 100 else ()
        if marks:
            one.set_minor_locator(LogLocator(subs=marks))
            one.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        else:
            one.set_minor_formatter(NullFormatter())
    axis.grid(which="major", color="0.86")
    axis.grid(which="minor", color="0.94", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
    axis.set_xlabel(study.time.label)
    axis.set_ylabel(study.error.label)
    return labels


def _set_apart(axis: Any, labels: Sequence[Any]) -> None:
    """Each label to the first of its sides where it is in the panel and clear of points and of the labels before it, or
    where it covers least of them."""
    from matplotlib.transforms import Bbox  # pyright: ignore[reportMissingImports]

    inside = axis.get_window_extent()
    taken = []
    for line in axis.lines:
        half = (line.get_markersize() / 2 + ROOM) * axis.figure.dpi / 72
        taken += [Bbox([xy - half, xy + half]) for xy in line.get_transform().transform(line.get_xydata())]

    def area(box: Any) -> float:
        return box.width * box.height if box else 0.0

    for label in labels:
        tried = []
        usual = label.get_position()
        for side in [usual, *(one for one in SIDES if one != usual)]:
            box = _beside(label, side)
            covered = sum(area(Bbox.intersection(box, other)) for other in taken)
            tried.append((covered + area(box) - area(Bbox.intersection(box, inside)), side))
        taken.append(_beside(label, min(tried, key=lambda one: one[0])[1]))


def _beside(label: Any, side: tuple[float, float]) -> Any:
    """Puts a label there; its box [px]."""
    label.set_position(side)
    label.set_horizontalalignment("left" if side[0] > 0 else "right")
    return label.get_window_extent()
