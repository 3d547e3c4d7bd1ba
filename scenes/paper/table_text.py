"""The paper's Tables 1 to 3 beside ours, as text, CSV and Markdown."""

import csv
import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from taichi_cloth.ground.files import write_bytes

__all__ = ["PAPER", "Measured", "Paper", "Table", "tables_of", "write_tables"]


@dataclass(frozen=True)
class Paper:
    """The paper's numbers for one garment: counts (Table 1), and times [ms] of its mesh and of its fibres, of
    collision (Table 2) and of a whole frame (Table 3)."""

    key_points: int
    particles: int
    contact: tuple[float, float]
    frame: tuple[float, float]


PAPER = {
    "T-shirt": Paper(6_245, 377_508, (43.5, 46.1), (63.0, 81.3)),
    "short skirt": Paper(4_612, 248_250, (32.3, 37.2), (49.0, 60.0)),
    "dress": Paper(8_853, 584_705, (84.6, 89.3), (124.5, 147.1)),
}


THROUGH = "frames with crossings"
"""Head of the column that says in how many frames a garment passes through itself, by an exact count of triangles."""


@dataclass(frozen=True)
class Measured:
    """Ours for one garment. times: [ms] of each frame, by stage; see `garment_timing.measure`.
    restarts: frames at which the motion tore the garment, so that it began anew. through: triangles that pass through
    others, in each frame that it came to."""

    key_points: int
    particles: int
    substeps: int
    times: dict[str, list[float]] = field(default_factory=dict)
    restarts: tuple[int, ...] = ()
    through: tuple[int, ...] = ()

    def crossings(self) -> str:
        """In how many frames something passes through other cloth, and how many triangles at most."""
        if not self.through:
            return "not counted"
        bad = sum(count > 0 for count in self.through)
        most = f", up to {max(self.through):,} triangles" if bad else ""
        return f"{bad} of {len(self.through)}{most}"

    def median(self, plus: str, minus: str | None = None) -> float:
        """Of a stage, or of the difference of two frame by frame [ms]."""
        values = np.asarray(self.times[plus])
        return float(np.median(values if minus is None else values - np.asarray(self.times[minus])))

    def ratio(self, over: str, under: str) -> float:
        """The median of the quotients of two stages frame by frame."""
        return float(np.median(np.asarray(self.times[over]) / np.asarray(self.times[under])))

    def parts(self) -> dict[str, float]:
        """Where a fibre frame goes [ms], by part; "rest" and all others add up to "whole". Means over the same frames:
        the half of them in the middle by what they took in all. Empty where kernels could not ask for the time."""
        stages = {stage.removeprefix("parts: "): stage for stage in self.times if stage.startswith("parts: ")}
        if not stages:
            return {}
        order = np.argsort(self.times["fibre"], kind="stable")
        quarter = len(order) // 4
        middle = order[quarter : len(order) - quarter]

        def mean(stage: str) -> float:
            return float(np.asarray(self.times[stage])[middle].mean())

        out = {part: mean(stage) for part, stage in (stages | {s: s for s in ("crossings", "follow")}).items()}
        whole = mean("fibre")
        return out | {"rest": whole - sum(out.values()), "whole": whole}


@dataclass(frozen=True)
class Table:
    """name: of its file. rows: as printed."""

    name: str
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def text(self) -> str:
        """In columns, numbers to the right."""
        width = [max(len(row[k]) for row in (self.head, *self.rows)) for k in range(len(self.head))]

        def line(row: tuple[str, ...]) -> str:
            rest = (f"{cell:>{w}}" for cell, w in zip(row[1:], width[1:], strict=True))
            return "  ".join([f"{row[0]:<{width[0]}}", *rest]).rstrip()

        return "\n".join([self.title, *(f"  {line(row)}" for row in (self.head, *self.rows)), *self.notes])

    def markdown(self) -> str:
        def line(row: tuple[str, ...]) -> str:
            return "| " + " | ".join(row) + " |"

        rule = "|" + "|".join(["---"] + ["---:"] * (len(self.head) - 1)) + "|"
        lines = [f"**{self.title}**", "", line(self.head), rule, *(line(row) for row in self.rows)]
        return "\n".join([*lines, "", *(f"{note}  " for note in self.notes)]).rstrip()

    def csv(self) -> str:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.head)
        writer.writerows([cell.replace(",", "") for cell in row] for row in self.rows)
        return out.getvalue()


def tables_of(measured: dict[str, Measured]) -> list[Table]:
    """Tables 1 to 3 and the stages of a frame, of the garments that were measured, by their name in PAPER."""
    counts, contact, frames = [], [], []
    for name, ours in measured.items():
        paper = PAPER[name]
        counts.append(
            (
                name,
                *_count(paper.key_points, ours.key_points),
                *_count(paper.particles, ours.particles),
                ours.crossings(),
            )
        )
        if (took := _contact(ours)) is not None:
            contact.append((name, *_times(paper.contact, took), ours.crossings()))
        frames.append((name, *_times(paper.frame, (ours.median("mesh"), ours.median("fibre"))), ours.crossings()))
    pairs = ("paper mesh", "ours mesh", "paper/ours", "paper fibre", "ours fibre", "paper/ours")
    last = ("paper fibre/mesh", "ours fibre/mesh", THROUGH)
    first = ("garment", "paper key points", "ours", "off", "paper particles", "ours", "off", THROUGH)
    return [
        Table("table1", "Table 1: key points and particles", first, tuple(counts)),
        Table(
            "table2",
            "Table 2: collision detection and response [ms a frame]",
            ("garment", *pairs, *last),
            tuple(contact),
            (
                "Ours: by time stamps inside the kernel."
                if contact
                else "Not timed: kernels can ask for the time on a CPU under Linux or macOS only.",
            ),
        ),
        Table(
            "table3",
            "Table 3: a whole frame [ms]",
            ("garment", *pairs, *last),
            tuple(frames),
            (
                "Ours: forces, contact and solver, then vertex normals (mesh) or every fibre particle (fibre); "
                "without drawing.",
                *(
                    f"{name}: torn by the motion, begun anew {len(m.restarts)} times, first at frame {m.restarts[0]}."
                    for name, m in measured.items()
                    if m.restarts
                ),
            ),
        ),
        _stages(measured),
        _ratios(measured),
    ]


def _contact(ours: Measured) -> tuple[float, float] | None:
    """Of a mesh frame and of a fibre frame [ms]; None where kernels could not ask for the time."""
    if "parts: contact" not in ours.times:
        return None
    return ours.median("mesh: contact"), ours.median("parts: contact")


PARTS = {
    "springs": "soft springs",
    "yarns": "yarns",
    "strain limit": "strain limit",
    "seams": "seams",
    "holds": "holds",
    "contact": "contact",
    "cloth on cloth": "cloth on cloth",
    "state": "state in and out",
    "host": "what the host does for it",
    "crossings": "crossings",
    "follow": "fibre particles",
    "rest": "rest",
    "whole": "together: a frame as fibres",
}
"""Parts of a frame in the order in which they are printed, and their titles."""


def _stages(measured: dict[str, Measured]) -> Table:
    rows: list[tuple[str, ...]] = []
    parts = [m.parts() for m in measured.values()]
    for part, title in PARTS.items():
        if any(part in one for one in parts):
            rows.append((title, *(f"{one[part]:.2f}" if part in one else "" for one in parts)))
    others = {
        "as a mesh": "mesh",
        "vertex normals (mesh)": "normals",
        "drawing the mesh": "draw, mesh",
        "drawing the fibres": "draw, fibre",
    }
    for title, stage in others.items():
        if all(stage in m.times for m in measured.values()):
            rows.append((title, *(f"{m.median(stage):.2f}" for m in measured.values())))
    rows.append((THROUGH, *(m.crossings() for m in measured.values())))
    rows.append(("substeps a frame", *(str(m.substeps) for m in measured.values())))
    rows.append(("a particle [ns]", *(f"{1e6 * m.median('follow') / m.particles:.1f}" for m in measured.values())))
    notes = [
        "Parts: by time stamps inside the kernel, means over the same frames, the half of them in the middle by "
        "what they took; the other rows are medians."
        if any(parts)
        else "No parts of the kernel: it can ask for the time on a CPU under Linux or macOS only.",
    ]
    if all("draw, mesh" in m.times for m in measured.values()):
        notes.append("Drawing: 1280 × 720, the garment without its body and without shadows; not part of Table 3.")
    return Table("stages", "Stages of a frame [ms]", ("stage", *measured), tuple(rows), tuple(notes))


def _ratios(measured: dict[str, Measured]) -> Table:
    rows = []
    for name, m in measured.items():
        own = f"{m.ratio('fibre', 'mesh'):.3f}", f"{1e3 * m.median('substep'):.0f}"
        free = ("", "")
        if "substep, sheet" in m.times:
            free = f"{1e3 * m.median('substep, sheet'):.0f}", f"{m.ratio('substep', 'substep, sheet'):.2f}"
        rows.append((name, *own, *free, m.crossings()))
    return Table(
        "ratios",
        "Ratios, in one run and in turn",
        ("garment", "fibre / mesh", "its substep [µs]", "a free sheet's [µs]", "garment / sheet", THROUGH),
        tuple(rows),
        (
            "Free sheet: as many key points of the same cloth in one piece, which wave and fall and touch nothing. "
            "Substeps with what the host does for them. Medians of quotients, frame by frame.",
        ),
    )


def _count(paper: int, ours: int) -> tuple[str, str, str]:
    return f"{paper:,}", f"{ours:,}", f"{100 * (ours / paper - 1):+.2f} %"


def _times(paper: tuple[float, float], ours: tuple[float, float]) -> tuple[str, ...]:
    out: list[str] = []
    for theirs, own in zip(paper, ours, strict=True):
        out += [f"{theirs:g}", f"{own:.2f}", f"{theirs / own:.1f}"]
    return (*out, f"{paper[1] / paper[0]:.2f}", f"{ours[1] / ours[0]:.2f}")


def write_tables(tables: list[Table], heading: list[str], folder: Path) -> list[Path]:
    """tables.txt, tables.md and a CSV a table, each written whole; the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "tables.txt": "\n".join([*heading, "", "\n\n".join(t.text() for t in tables)]) + "\n",
        "tables.md": "\n".join([*(f"{h}  " for h in heading), "", "\n\n".join(t.markdown() for t in tables)]) + "\n",
        **{f"{t.name}.csv": t.csv() for t in tables},
    }
    for name, text in files.items():
        write_bytes(folder / name, text.encode())
    return [folder / name for name in files]
