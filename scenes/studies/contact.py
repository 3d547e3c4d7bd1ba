"""What stands for a body in contact: primitives by their number, distance grids by their spacing, the mesh itself."""

from collections.abc import Iterator
from math import nan

import numpy as np
import trimesh
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import solid_distance
from taichi_cloth.body.colliders.query import PrimitiveQuery
from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.parts.parts import BONES
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.fit import fit
from taichi_cloth.body.primitives.primitives import Primitive

from ..body.report_body import POINTS, exact_distance, garment_points
from ..measure.study import Axis, Row, Study, cpu_seconds
from ..prepare.body_setup import GRID_SPACING, grids_at, primitives_of

__all__ = ["STUDY", "rows"]

F64 = NDArray[np.float64]
COUNTS = (8, 12, 16, 24, 48, 64)
SPACINGS = (0.04, 0.02, 0.01, 0.005)  # [m]
PANELS = ("mean", "95 % of the points")


def rows(quick: bool) -> Iterator[Row]:
    body = built_in_body(gender="female")
    faces = body.faces.astype(np.int64)
    points = garment_points(body, 2000 if quick else POINTS)
    mesh = trimesh.Trimesh(body.vertices, faces, process=False)
    exact = exact_distance(mesh, points)
    runs = 1 if quick else 3

    def both(method: str, knob: str, value: float, found: F64, cost: float, usual: bool = False) -> Iterator[Row]:
        off = np.abs(found - exact)
        for panel, error in zip(PANELS, (off.mean(), np.quantile(off, 0.95)), strict=True):
            yield Row(
                panel=panel,
                method=method,
                knob=knob,
                value=value,
                error=float(error),
                seconds=cost / len(points),
                default=usual,
            )

    cost = cpu_seconds(lambda: exact_distance(mesh, points), 1)
    yield from both("the mesh, trimesh: exact", f"{len(faces):,} triangles", nan, exact, cost)
    ready = list(primitives_of(body))
    sets: list[list[Primitive]] = []
    parts = segment(body.vertices, faces)
    for count in COUNTS[:3:2] if quick else COUNTS:
        sets.append(fit(body.vertices, faces, parts.labels, parts.names, count=count, bones=BONES))
    for primitives in sorted([*sets, ready], key=len):
        usual, knob, value = primitives is ready, f"{len(primitives)}", 1 / len(primitives)
        query = PrimitiveQuery(primitives)
        cost = cpu_seconds(lambda query=query: query(points), runs)
        yield from both("primitives, kernel", knob, value, query(points)[0].astype(np.float64), cost, usual)
        found = nearest_distance(primitives, points)[0]
        cost = cpu_seconds(lambda primitives=primitives: nearest_distance(primitives, points), runs)
        yield from both("primitives, NumPy", knob, value, found, cost)
    for spacing in SPACINGS[:3:2] if quick else SPACINGS:
        grids = grids_at(body, spacing)
        cost = cpu_seconds(lambda grids=grids: solid_distance(grids, points), runs)
        knob, usual = f"{1e3 * spacing:g} mm", spacing == GRID_SPACING
        yield from both("a grid a part, NumPy", knob, spacing, solid_distance(grids, points), cost, usual)


STUDY = Study(
    name="contact",
    title="Contact: what stands for a body",
    about="Points within 20 mm of the skin of the built-in female, on both sides, as many as the paper's T-shirt has "
    "key points. Error: of the distance, against the exact one to the mesh of 29,322 triangles (trimesh). Primitives "
    "and grids are asked whole, one and all: in contact lists leave most of them out. NumPy compares primitives and "
    "grids on one footing; the kernel shows what the primitives' line is shifted by.",
    error=Axis("error of distance", "mm", 1e3),
    time=Axis("CPU time a point", "ns", 1e9),
    rows=rows,
    why={
        "primitives, kernel": "so few are off by more than the 4 mm that cloth keeps, and skin shows through; of what "
        "more of them cost here, contact's lists spare cloth the most",
        "a grid a part, NumPy": "its error is a small part of the 4 mm that cloth keeps, and half the spacing takes "
        "seven times the memory and more than twice the time to make",
    },
)
