"""Vertices and triangles of a mesh file: OBJ, PLY, GLB or STL, read by trimesh.

What a file says of its size is looked at before trimesh takes memory for it, and no other file that it names is read.
"""

import io
import json
import logging
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes

__all__ = ["FORMATS", "MOST_FACES", "read_mesh"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FORMATS = ("obj", "ply", "glb", "stl")
GIVE = "an OBJ, PLY, GLB or STL file"
LARGEST_FILE = 100_000_000
MOST_FACES = 800_000
MOST_VERTICES = 3 * MOST_FACES
"""Three a face, as in STL."""
MOST_LINES = 3 * MOST_VERTICES
"""Of text: a vertex, its normal and its place on a texture."""
MOST_NUMBERS = 5 * MOST_FACES
"""In a PLY of text."""
DRESS = re.compile(rb"(?m)^[ \t]*(?:mtllib|usemtl|vt)\b[^\n]*\n?")
"""Lines of an OBJ that say how it looks: materials are files of their own and want a package for pictures, and a body
would be cut open along the borders of its texture."""
LONGEST_LINE = 10_000
LARGEST_HEADER = 4_000_000
"""Bytes of JSON in a GLB file."""
ITEM_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
ITEMS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""What glTF calls a component's type and an element's, and their sizes."""


def read_mesh(path: Path) -> tuple[F64, I64]:
    """Vertices (v, 3) in the file's unit and triangles (f, 3). Raises InputError with what to give instead."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise InputError(f"body.source: {str(path)!r}; allowed: built-in, anny, or {GIVE}")
    data = read_bytes(path, most=LARGEST_FILE, give=GIVE)
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its own report of a broken file is ours below
    try:
        for count, most, what in _sizes(kind, data):
            if not 0 <= count <= most:
                raise InputError(f"{path.name}: {count:,} {what}; allowed: up to {most:,}; simplify it first")
        with np.errstate(all="ignore"):
            plain = DRESS.sub(b"", data) if kind == "obj" else data
            mesh = trimesh.load_scene(io.BytesIO(plain), file_type=kind, **_options(kind)).to_mesh()
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    except InputError:
        raise
    except Exception as error:  # trimesh raises whatever its many readers raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path.name}: not a mesh that can be read ({reason}); give {GIVE}") from None
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"{path.name}: its vertices have no three coordinates; give {GIVE}")
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise InputError(f"{path.name}: it holds no triangles; give a surface, not points or lines")
    if len(faces) > MOST_FACES:
        raise InputError(f"{path.name}: {len(faces):,} faces; allowed: up to {MOST_FACES:,}; simplify it first")
    return vertices, faces


def _options(kind: str) -> dict[str, Any]:
    return {"skip_materials": True} if kind == "glb" else {}


def _sizes(kind: str, data: bytes) -> Iterator[tuple[int, int, str]]:
    """How many of what a file says it holds, and how many are allowed, before it is read."""
    if kind == "glb":
        yield from _glb_sizes(data)
    elif kind == "stl" and len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        yield len(data) // 50, MOST_FACES, "faces"
    elif kind == "ply" and b"\nformat ascii" not in data[:1000]:
        yield from _ply_sizes(data)
    else:
        yield data.count(b"\n") + data.count(b"\r"), MOST_LINES, "lines"
        longest = re.search(rb"(?<![^\r\n])[^\r\n]{%d}" % LONGEST_LINE, data)
        yield LONGEST_LINE if longest else 0, LONGEST_LINE - 1, "letters in a line"
        if kind == "obj":
            yield data.count(b"\nv "), MOST_VERTICES, "vertices"
            corners = (len(line[0].split()) for line in re.finditer(rb"^f[^\r\n]*", data, re.MULTILINE))
            yield sum(max(n - 3, 1) for n in corners), MOST_FACES, "triangles"
        elif kind == "stl":
            yield len(re.findall(rb"(?i)vertex", data)), MOST_VERTICES, "vertices"
        else:
            yield data.count(b" "), MOST_NUMBERS, "numbers"
            yield from _ply_sizes(data)


def _ply_sizes(data: bytes) -> Iterator[tuple[int, int, str]]:
    head = data[:LONGEST_LINE].split(b"end_header")[0].decode("latin-1")
    for name, count in re.findall(r"^\s*element\s+(\S+)\s+(-?\d{1,18})", head, re.MULTILINE):
        yield int(count), MOST_FACES if name == "face" else MOST_VERTICES, f"{name[:40]} elements"


def _glb_sizes(data: bytes) -> Iterator[tuple[int, int, str]]:
    length = struct.unpack("<I", data[12:16])[0]
    yield length, LARGEST_HEADER, "bytes of JSON"
    header = json.loads(data[20 : 20 + length])
    accessors = header.get("accessors", [])
    yield _total(view["byteLength"] for view in header.get("bufferViews", [])), 2 * len(data), "bytes in its views"
    sizes = (a["count"] * ITEM_BYTES[a["componentType"]] * ITEMS[a["type"]] for a in accessors)
    yield _total(sizes), 4 * LARGEST_FILE, "bytes in its accessors"
    points, corners = [], []
    for mesh in header.get("meshes", []):
        vertices = [accessors[p["attributes"]["POSITION"]]["count"] for p in mesh["primitives"]]
        indices = [accessors[p["indices"]]["count"] for p in mesh["primitives"] if "indices" in p]
        points.append(_total(vertices))
        corners.append(_total(indices) + (0 if len(indices) == len(vertices) else points[-1]))
    placed = [node["mesh"] for node in header.get("nodes", []) if "mesh" in node]  # a mesh may stand in many places
    yield max(_total(corners), _total(corners[m] for m in placed)) // 3, MOST_FACES, "faces"
    yield max(_total(points), _total(points[m] for m in placed)), MOST_VERTICES, "vertices"


def _total(counts: Any) -> int:
    """A sum in which no count is below 0."""
    found = list(counts)
    if not all(isinstance(n, int) and n >= 0 for n in found):
        raise ValueError("a count that is no whole number from 0")
    return sum(found)
