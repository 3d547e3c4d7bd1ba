"""`taichi-cloth body fit`: a body in parts, the parts in primitives, how well they fit, and a picture of both."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.body.fit import fit
from taichi_cloth.body.fit_report import report_fit
from taichi_cloth.body.parts import JOINTS as PART_JOINTS
from taichi_cloth.body.primitive_file import primitives_json
from taichi_cloth.body.segment import segment
from taichi_cloth.body.skeleton import JOINTS
from taichi_cloth.errors import InputError

from ..render.image import write_bytes
from ..render.mesh import Mesh
from .body_picture import HUES, draw_panels, part_mesh, primitive_meshes

__all__ = ["BONES", "fit_body", "read_body"]

F64 = NDArray[np.float64]
BONES = {part: JOINTS.index(joint) for part, joint in PART_JOINTS.items()}
"""The number of the joint that each part moves with."""
TALLEST_M, TALLEST_DM = 3.0, 30.0
"""Longest sides up to which a mesh is taken to be in metres, and then in decimetres; above, centimetres."""


def fit_body(source: str, out: Path, *, count: int, error_mm: float | None, arch: runtime.Arch) -> None:
    """Everything `taichi-cloth body fit` does. Raises InputError."""
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: no such folder {out.parent}; make it first")
    vertices, faces = read_body(source)
    found = segment(vertices, faces)
    primitives = fit(vertices, faces, found.labels, found.names, count=count, error_mm=error_mm, bones=BONES)
    report = report_fit(vertices, faces, found.labels, found.names, primitives)
    for line in report.lines():
        print(line)
    runtime.start(arch)
    picture = out.with_suffix(".png")
    draw_fit(vertices, faces, found.labels, primitive_meshes(primitives), picture)
    write_bytes(out, primitives_json(primitives, {"source": source, "report": report.as_dict()}))
    print(f"{len(primitives)} primitives in {out}, picture in {picture}")


def read_body(source: str) -> tuple[F64, NDArray[np.int64]]:
    """Vertices (v, 3) [m], y up, feet on the ground, and faces (f, 3) of a file or of a body by name.

    Raises InputError for what cannot be read, and for a file without one large connected surface.
    """
    kind, _, gender = source.partition(":")
    if kind in ("built-in", "anny"):
        if gender not in ("female", "male"):
            raise InputError(f"{source}: unknown body; known: {kind}:female, {kind}:male")
        if kind == "anny":
            from taichi_cloth.body.anny import body_from_anny

            made = body_from_anny(gender)
        else:
            from taichi_cloth.body.build import built_in_body

            made = built_in_body(gender=gender)
        return made.vertices, made.faces.astype(np.int64)
    import trimesh

    try:
        mesh = trimesh.load(source, force="mesh", process=True)
    except Exception as error:
        words = getattr(error, "strerror", None) or str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{source}: not a mesh that can be read ({words}); give an OBJ, PLY, GLB or STL file"
        ) from None
    pieces = mesh.split(only_watertight=False) if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) else []
    if len(pieces) == 0:
        raise InputError(f"{source}: no triangles; give a file with a body's surface")
    whole = max(pieces, key=lambda m: float(m.area))
    vertices, faces = np.asarray(whole.vertices, np.float64), np.asarray(whole.faces, np.int64)
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    size = np.ptp(vertices, axis=0)
    vertices = vertices / (1 if size.max() <= TALLEST_M else 10 if size.max() <= TALLEST_DM else 100)
    if size[2] > size[1] and size[2] > 0.8 * size.max():  # z up
        vertices = vertices[:, [0, 2, 1]] * [1, 1, -1]
    vertices = vertices - [0, vertices[:, 1].min(), 0]
    return vertices, faces


def draw_fit(vertices: F64, faces: NDArray, labels: NDArray, solids: Mesh, path: Path) -> None:
    """Figures 10 and 11: the parts from the front and behind, then the primitives likewise, to a PNG."""
    shade = Mesh(vertices, faces, (1, 1, 1))
    skin = part_mesh(vertices, faces, np.asarray(shade.normals), np.array(HUES)[labels % len(HUES)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    panels = [(skin, 25.0, "parts"), (skin, 205.0, ""), (solids, 25.0, "primitives"), (solids, 205.0, "")]
    draw_panels(panels, (low, high), path)
