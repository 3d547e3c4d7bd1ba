"""A report on disk: a page in HTML and in Markdown, a diagram and a CSV for each study; whole, or not at all."""

import csv
import os
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from io import StringIO
from math import isfinite
from pathlib import Path

from taichi_cloth.ground.errors import InputError

from .study import Row, Study, lines_of, orders, standing_of

__all__ = ["Section", "check_folder", "csv_text", "section_of", "write_report"]

STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:1240px;margin:2rem auto;padding:0 1rem;color:#222}"
    "img{max-width:100%;display:block;margin:1rem auto}table{border-collapse:collapse;font-size:.9em;margin:.8rem 0}"
    "td,th{border:1px solid #ddd;padding:.15rem .5rem;text-align:left}"
    "td.n{text-align:right;font-variant-numeric:tabular-nums}summary{cursor:pointer}"
    "code{background:#f2f2f2;padding:.1rem .35rem;font-size:.9em}"
)


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report: words, a table of texts, the same as CSV, and a PNG where there is a diagram."""

    name: str
    title: str
    about: str
    sentences: Sequence[str]
    head: Sequence[str]
    table: Sequence[Sequence[str]]
    csv: str
    image: bytes | None = None


def csv_text(rows: Sequence[object]) -> str:
    """Dataclasses of one kind as CSV with a head; real numbers with six digits."""
    out = StringIO(newline="")
    lines = [asdict(row) for row in rows]  # pyright: ignore[reportArgumentType]
    writer = csv.DictWriter(out, list(lines[0]), lineterminator="\n")
    writer.writeheader()
    for line in lines:
        writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in line.items()})
    return out.getvalue()


def section_of(study: Study, rows: Sequence[Row], image: bytes) -> Section:
    """A study's rows with the orders seen in them, and where the defaults stand."""
    said, table = [], []
    for (panel, method), line in lines_of(rows).items():
        claimed = study.claimed.get(f"{panel}: {method}", study.claimed.get(method))
        seen = orders(line)
        if claimed is not None and seen:
            words = ", ".join(f"{p:.2f}" for p in seen)
            said.append(f"{panel}, {method}: order {claimed:g}; seen, from coarse to fine: {words}.")
        for k, row in enumerate(line):
            order = f"{seen[k - 1]:.2f}" if 0 < k <= len(seen) == len(line) - 1 else ""
            numbers = [
                axis.text(v) if isfinite(v) else "–"
                for axis, v in ((study.error, row.error), (study.time, row.seconds))
            ]
            table.append((panel, method, row.knob, *numbers, order, "default" if row.default else ""))
    return Section(
        name=study.name,
        title=study.title,
        about=study.about,
        sentences=[*said, *standing_of(study, rows)],
        head=("panel", "method", "knob", study.error.words, study.time.words, "order", ""),
        table=table,
        csv=csv_text(rows),
        image=image,
    )


def check_folder(out: Path) -> None:
    """Raises InputError where a report would overwrite something that is none."""
    told = out / "report.md"
    if out.exists() and not (out.is_dir() and (not any(out.iterdir()) or told.is_file())):
        raise InputError(f"--out {out}: holds something else than a report; name a new folder, or empty this one")
    text = told.read_text("utf-8", errors="replace") if told.is_file() else ""
    for name in sorted(path.name for path in out.iterdir()) if text else ():
        if name not in (told.name, "index.html") and f"({name})" not in text:
            raise InputError(f"--out {out}: holds {name} beside a report; move it away, or name a new folder")


def write_report(sections: Sequence[Section], out: Path, *, title: str, facts: Sequence[str]) -> None:
    """Everything into a folder beside `out`, which then takes its place."""
    check_folder(out)
    part, old = (out.with_name(f".{out.name}.{os.getpid()}.{end}") for end in ("part", "old"))
    part.parent.mkdir(parents=True, exist_ok=True)
    try:
        part.mkdir()
        for section in sections:
            (part / f"{section.name}.csv").write_text(section.csv, encoding="utf-8")
            if section.image is not None:
                (part / f"{section.name}.png").write_bytes(section.image)
        (part / "report.md").write_text(_markdown(sections, title, facts), encoding="utf-8")
        (part / "index.html").write_text(_html(sections, title, facts), encoding="utf-8")
        if out.exists():
            out.rename(old)
        part.rename(out)
    finally:
        for left in (part, old):
            shutil.rmtree(left, ignore_errors=True)


def _markdown(sections: Sequence[Section], title: str, facts: Sequence[str]) -> str:
    out = [f"# {title}", "", *(f"- {fact}" for fact in facts), ""]
    for s in sections:
        out += [f"## {s.title}", "", s.about, ""]
        out += [f"![{s.title}]({s.name}.png)", ""] if s.image is not None else []
        out += [*(f"- {line}" for line in s.sentences), ""] if s.sentences else []
        out += [f"Rows: [{s.name}.csv]({s.name}.csv)", ""]
        cells = [s.head, ["---"] * len(s.head), *s.table]
        out += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in cells] + [""]
    return "\n".join(out)


def _html(sections: Sequence[Section], title: str, facts: Sequence[str]) -> str:
    def items(lines: Sequence[str]) -> str:
        return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>" if lines else ""

    def cell(text: str) -> str:
        number = text[:1].isdigit() or text[:1] in ("–", "-")
        return f'<td class="n">{escape(text)}</td>' if number else f"<td>{escape(text)}</td>"

    out = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>',
        f"<h1>{escape(title)}</h1>{items(facts)}",
        "<p>" + " · ".join(f'<a href="#{s.name}">{escape(s.title)}</a>' for s in sections) + "</p>",
    ]
    for s in sections:
        out.append(f'<h2 id="{s.name}">{escape(s.title)}</h2><p>{escape(s.about)}</p>')
        if s.image is not None:
            out.append(f'<img src="{s.name}.png" alt="{escape(s.title)}">')
        out.append(items(s.sentences))
        head = "".join(f"<th>{escape(text)}</th>" for text in s.head)
        body = "".join("<tr>" + "".join(map(cell, row)) + "</tr>" for row in s.table)
        out.append(
            f"<details{'' if s.image else ' open'}><summary>{len(s.table)} rows "
            f'(<a href="{s.name}.csv">CSV</a>)</summary><table><tr>{head}</tr>{body}</table></details>'
        )
    return "\n".join(out) + "\n</html>\n"
