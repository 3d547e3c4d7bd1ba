"""`taichi-cloth pattern FILE.dxf`: draws the pieces of a DXF with the numbers of their edges, and writes the TOML that
goes beside it, to begin with: seams that lengths and notches suggest, each to be looked at."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.dxf_pattern import PARTS, beside
from taichi_cloth.garment.pattern.dxf_pieces import CutPiece, read_pieces
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import shown_path, write_bytes

from ...render.image.image import write_png
from .output_folder import OutputFolder

__all__ = ["pattern_lines", "suggested"]

F64 = NDArray[np.float64]

PICTURE = "pieces.png"
WIDTH, HEAD, ROOM = 1600, 40, 40
"""Of the picture, of a piece's name, and round a piece [px]."""
MOST_HEIGHT = 12_000
PAPER, INK, PALE, MARK = (250, 249, 246), (40, 40, 44), (150, 150, 155), (190, 40, 30)
ALIKE = 0.01
"""How much lengths of edges that are suggested for a seam may differ."""
SHORTEST = 0.03
"""Of such an edge [m]."""
SAME_WAY = 0.9
"""Cosine between two edges from which they run the same way."""


def pattern_lines(path: Path, out: Path | None, unit: str | None = None) -> Iterator[str]:
    """What a file holds, line by line; makes the picture and, where none is beside it, the TOML. Raises InputError."""
    if path.suffix.lower() != ".dxf":
        raise InputError(f"{shown_path(path)}: no DXF by its name; give a pattern as .dxf")
    pieces = read_pieces(path, unit)
    sizes = list(dict.fromkeys(piece.size for piece in pieces if piece.size))
    for piece in pieces:
        edges = piece.outline.edges()
        low, high = piece.outline.loop.min(axis=0), piece.outline.loop.max(axis=0)
        wide, tall = 100 * (high - low)
        of = f", size {piece.size}" if piece.size else ""
        line = "sew line" if piece.sewn else "cut line, no sew line"
        yield f"{piece.name}{of}: {wide:.1f} × {tall:.1f} cm, {len(edges)} edges, {line}"
        for k, edge in enumerate(edges):
            marks = ", ".join(f"{100 * s:.1f}" for s in piece.outline.marks(k))
            yield f"  {k + 1}: {100 * length(edge):.1f} cm" + (f", notches at {marks} cm" if marks else "")
    folder = OutputFolder(out or Path("out") / path.stem)
    with folder:
        folder.make()
        names = [PICTURE, beside(path).name]
        folder.claim(names)
        chosen = [piece for piece in pieces if not sizes or piece.size == sizes[0]] or pieces
        write_png(folder.path / PICTURE, _picture(chosen))
        write_bytes(folder.path / names[1], _words(chosen, sizes, unit).encode())
    yield f"{', '.join(names)} in {folder.path}"
    if not beside(path).exists():
        yield f"{names[1]} goes beside {path.name} once its panels and seams are right"


def suggested(pieces: list[CutPiece]) -> list[tuple[str, str]]:
    """Pairs of edges that are as long as each other and have as many notches, each edge once: of two pieces, the
    nearest in length first, then of one piece that no other is sewn to, as a sleeve's. Outlines run counter-clockwise,
    so that what is sewn together runs opposite ways where pieces are drawn alike; edges that run the same way, as two
    hems, are none."""
    edges = [
        (k, n + 1, length(edge), len(piece.outline.marks(n)), edge[-1] - edge[0])
        for k, piece in enumerate(pieces)
        for n, edge in enumerate(piece.outline.edges())
    ]
    found = []
    for i, (a, n, own, marks, way) in enumerate(edges):
        for b, m, other, more, back in edges[i + 1 :]:
            off = abs(own - other) / max(own, other)
            alike = float(way @ back) / max(float(np.linalg.norm(way) * np.linalg.norm(back)), 1e-9)
            if off < ALIKE and marks == more and min(own, other) > SHORTEST and alike < SAME_WAY:
                found.append((a == b, round(off, 3), alike, (a, n), (b, m)))
    used: set[tuple[int, int]] = set()
    of: set[tuple[int, int]] = set()
    out = []
    for alone, *_, one, two in sorted(found):
        joined = alone and any(a == one[0] and b != one[0] for a, b in of)
        if one not in used and two not in used and not joined:
            of |= {(one[0], two[0]), (two[0], one[0])}
            used |= {one, two}
            out.append((f"{_key(pieces[one[0]])}.{one[1]}", f"{_key(pieces[two[0]])}.{two[1]}"))
    return out


def _up(pieces: list[CutPiece]) -> str:
    """Most files of the trade lay the grain along x."""
    level = [abs(float(np.sin(piece.grain))) > 0.7 for piece in pieces if piece.grain is not None]
    return "+x" if 2 * sum(level) > len(level) else "+y"


def _key(piece: CutPiece) -> str:
    """A panel's name in TOML, of letters, digits, - and _."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in piece.name.lower()) or "piece"


def _text(value: str) -> str:
    """A TOML string."""
    shown = "".join(c if c.isprintable() else " " for c in value).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{shown}"'


def _words(pieces: list[CutPiece], sizes: list[str], unit: str | None) -> str:
    rows = [
        f"# Which edges meet and where pieces are worn; {PICTURE} has the numbers of the edges.",
        "# Seams below are those that lengths and notches suggest: look at each, and add what is missing. A side may",
        '# be several edges in their order along the seam: ["left_sleeve.3", ["back.7", "front.2"]].',
        f"# part: {', '.join(PARTS)}. side: front, back; of skirts and hoods also left, right.",
        f'up = "{_up(pieces)}"  # which way of the drawing is up on the body: +x, +y, -x, -y',
    ]
    rows += [f'unit = "{unit}"'] if unit else []
    rows += [f"size = {_text(sizes[0])}  # of {', '.join(_text(size) for size in sizes)}"] if len(sizes) > 1 else []
    rows += ["seams = [", *(f'  ["{a}", "{b}"],' for a, b in suggested(pieces)), "]"]
    for piece in pieces:
        back = "back" in piece.name.lower()
        sleeve = "sleeve" in piece.name.lower()
        rows += [
            "",
            f"[panels.{_key(piece)}]",
            f"piece = {_text(piece.name)}",
            f'part = "{"left arm" if sleeve else "trunk"}"',
            f'side = "{"back" if back else "front"}"',
        ]
    return "\n".join(rows) + "\n"


def _picture(pieces: list[CutPiece]) -> NDArray[np.uint8]:
    """All pieces, to one scale, with numbers of edges, notches as dots and grain as an arrow."""
    reach = [np.ptp(piece.outline.loop, axis=0) for piece in pieces]
    columns = 2 if len(pieces) > 1 else 1
    cell = WIDTH // columns - 2 * ROOM
    scale = cell / max(float(r[0]) for r in reach)
    rows = [list(range(k, min(k + columns, len(pieces)))) for k in range(0, len(pieces), columns)]
    tall = [max(float(reach[k][1]) for k in row) * scale + HEAD + 2 * ROOM for row in rows]
    if sum(tall) > MOST_HEIGHT:
        scale *= MOST_HEIGHT / sum(tall)
        tall = [max(float(reach[k][1]) for k in row) * scale + HEAD + 2 * ROOM for row in rows]
    image = np.full((int(sum(tall)) + 1, WIDTH, 3), PAPER, np.uint8)
    top = 0.0
    for row, high in zip(rows, tall, strict=True):
        for column, k in enumerate(row):
            _draw(image, pieces[k], scale, (column * WIDTH // columns + ROOM, top + HEAD + ROOM))
        top += high
    return image


def _draw(image: NDArray[np.uint8], piece: CutPiece, scale: float, at: tuple[float, float]) -> None:
    loop = piece.outline.loop
    low, high = loop.min(axis=0), loop.max(axis=0)

    def px(points: F64) -> F64:
        return np.stack([at[0] + scale * (points[:, 0] - low[0]), at[1] + scale * (high[1] - points[:, 1])], -1)

    def write(text: str, where: F64, size: float, colour: tuple[int, int, int]) -> None:
        (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
        corner = (int(where[0] - wide / 2), int(where[1] + tall / 2))
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)

    cv2.polylines(image, [np.round(8 * px(loop)).astype(np.int32)], True, INK, 2, cv2.LINE_AA, 3)
    middle = loop.mean(axis=0)
    for k, edge in enumerate(piece.outline.edges()):
        half = along(edge, np.array([0.48, 0.5, 0.52]))
        way = half[2] - half[0]
        inward = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-9)
        write(str(k + 1), px((half[1] + 22 / scale * inward)[None])[0], 0.7, INK)
        start = px(edge[:1])[0]
        cv2.circle(image, (int(start[0]), int(start[1])), 5, INK, -1, cv2.LINE_AA)
        for s in piece.outline.marks(k):
            spot = px(along(edge, np.array([s / length(edge)])))[0]
            cv2.circle(image, (int(spot[0]), int(spot[1])), 5, MARK, -1, cv2.LINE_AA)
    if piece.grain is not None:
        way = 0.12 * float(np.ptp(loop, axis=0).max()) * np.array([np.sin(piece.grain), np.cos(piece.grain)])
        a, b = px(np.stack([middle - way, middle + way]))
        cv2.arrowedLine(image, (int(a[0]), int(a[1])), (int(b[0]), int(b[1])), PALE, 2, cv2.LINE_AA, tipLength=0.1)
    name = piece.name.encode("ascii", "replace").decode()
    write(f"{name} {piece.size}".strip(), np.array([at[0] + scale * (high[0] - low[0]) / 2, at[1] - HEAD]), 0.8, INK)
