"""How well primitives stand for a body and what asking them costs, against how many there are; and the skin itself.

The points are those of a garment: as many as the paper's T-shirt has key points, within 20 mm of the skin, half of them
in it, Philox by a fixed seed. Times are CPU time of one thread, medians.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import solid_distance
from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.colliders.query import PrimitiveQuery
from taichi_cloth.body.parts.parts import BONES
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.fit import fit
from taichi_cloth.body.primitives.fit_report import report_fit
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.samples import skin_samples
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.ground.errors import InputError

from ..measure.study import cpu_seconds

__all__ = [
    "COUNTS",
    "BodyRow",
    "QueryRow",
    "body_rows",
    "check_exact",
    "draw_rows",
    "exact_distance",
    "exact_rows",
    "garment_points",
    "query_lines",
]

F64 = NDArray[np.float64]
COUNTS = (6, 8, 12, 16, 24, 32)
POINTS = 8853
"""Key points of the paper's T-shirt."""
NEAR = 0.02  # [m]
RUNS = 9


@dataclass(frozen=True, kw_only=True)
class BodyRow:
    """A fit. Errors from the skin to the primitives' union, and back from its surface to the skin [mm].
    query_ns: CPU time [ns] a point of distance and normal of the nearest of all primitives, in a kernel."""

    primitives: int
    mean_mm: float
    p95_mm: float
    max_mm: float
    back_mean_mm: float
    back_p95_mm: float
    query_ns: float


@dataclass(frozen=True, kw_only=True)
class QueryRow:
    """A way to ask where a body is. us: CPU time [µs] a point. mean_mm, p95_mm: its distance against the exact one."""

    way: str
    us: float
    mean_mm: float
    p95_mm: float


def garment_points(body: Body, count: int = POINTS, *, seed: int = 5) -> F64:
    """Points (count, 3) [m] within NEAR of the skin, on both sides of it."""
    points, face = skin_samples(body.vertices, body.faces, count, seed=seed)
    corner = body.vertices[body.faces[face]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    chance = np.random.Generator(np.random.Philox(key=[seed, 1]))
    return points + chance.uniform(-NEAR, NEAR, (count, 1)) * normal


def exact_distance(mesh: trimesh.Trimesh, points: F64) -> F64:
    """Signed distance (n,) [m] from a mesh, positive outside, by trimesh. Raises InputError where what it needs is
    missing."""
    try:
        return -np.asarray(trimesh.proximity.signed_distance(mesh, points))
    except ImportError as error:
        missing = f"package {error.name} is not there" if error.name else str(error)
        raise InputError(
            f"comparison with the mesh: {missing}; install it with: pip install taichi-cloth[report]"
        ) from None


def check_exact() -> None:
    """Ask for one distance, so that what `exact_distance` needs is missed before the work and not after it. Raises
    InputError where it is."""
    exact_distance(trimesh.creation.box(), np.array([[0.0, 0.0, 2.0]]))


def body_rows(body: Body, counts: Sequence[int] = COUNTS) -> list[BodyRow]:
    """A fit for each count, measured. Taichi must have been started. Some seven seconds of CPU time each."""
    faces = body.faces.astype(np.int64)
    parts = segment(body.vertices, faces)
    points = garment_points(body)
    rows = []
    for count in counts:
        primitives = fit(body.vertices, faces, parts.labels, parts.names, count=count, bones=BONES)
        report = report_fit(body.vertices, faces, parts.labels, parts.names, primitives)
        query = PrimitiveQuery(primitives)
        rows.append(
            BodyRow(
                primitives=len(primitives),
                mean_mm=report.whole.mean_mm,
                p95_mm=report.whole.p95_mm,
                max_mm=report.whole.max_mm,
                back_mean_mm=report.exposed_mean_mm,
                back_p95_mm=report.exposed_p95_mm,
                query_ns=1e9 * cpu_seconds(lambda query=query: query(points), RUNS) / len(points),
            )
        )
    return rows


def exact_rows(
    body: Body, primitives: Sequence[Primitive], grids: Sequence[DistanceGrid], *, runs: int = RUNS
) -> list[QueryRow]:
    """The same points asked of the primitives, of distance grids, and of the mesh by trimesh, whose nearest points are
    exact and whose sides are found with rays (Embree's, where `embreex` is installed). Taichi must be started. Raises
    InputError where what trimesh needs is missing."""
    points = garment_points(body)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    exact = exact_distance(mesh, points)
    query = PrimitiveQuery(primitives)
    rays = type(mesh.ray).__module__.rsplit(".", 1)[-1]
    ways: list[tuple[str, Callable[[], NDArray]]] = [
        (f"{len(primitives)} primitives, all of them, kernel", lambda: query(points)[0]),
        (f"{len(primitives)} primitives, all of them, numpy", lambda: nearest_distance(primitives, points)[0]),
        *([(f"{len(grids)} distance grids, numpy", lambda: solid_distance(grids, points))] if grids else []),
        (f"mesh of {len(mesh.faces):,} faces, trimesh with {rays}", lambda: exact_distance(mesh, points)),
    ]  # fmt: skip
    rows = []
    for way, ask in ways:
        off = 1e3 * np.abs(ask() - exact)
        rows.append(
            QueryRow(
                way=way,
                us=1e6 * cpu_seconds(ask, runs if "mesh" not in way else 1) / len(points),
                mean_mm=float(off.mean()),
                p95_mm=float(np.quantile(off, 0.95)),
            )
        )
    return rows


def query_lines(rows: Sequence[QueryRow]) -> list[str]:
    """A table to print."""
    head = f"{POINTS:,} points within {1e3 * NEAR:g} mm of the skin{'':<13}{'µs a point':>12}{'mean':>10}{'95 %':>9}"
    return [head, *(f"{r.way:<48}{r.us:>12.3f}{r.mean_mm:>7.2f} mm{r.p95_mm:>6.2f} mm" for r in rows)]


def draw_rows(rows: Sequence[BodyRow], path: Path | str) -> None:
    """Error and cost against the number of primitives, to a PNG. Raises InputError without matplotlib."""
    try:
        import matplotlib  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError("report: needs matplotlib; install it with: pip install taichi-cloth[report]") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot  # pyright: ignore[reportMissingImports]

    count = [row.primitives for row in rows]
    figure, (error, cost) = pyplot.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for name, words, colour in (("mean_mm", "mean", "#2d6a9f"), ("p95_mm", "95 %", "#c2452d")):
        error.plot(count, [getattr(row, name) for row in rows], "o-", color=colour, label=words)
    for bound, colour, words in ((8, "#2d6a9f", "allowed mean"), (20, "#c2452d", "allowed 95 %")):
        error.axhline(bound, color=colour, lw=1, ls=":", label=words)
    error.set(xlabel="primitives", ylabel="distance of skin and primitives [mm]", ylim=(0, None), xticks=count)
    error.legend(frameon=False)
    cost.plot(count, [row.query_ns for row in rows], "o-", color="#3a7d44")
    cost.set(xlabel="primitives", ylabel="CPU time a point [ns]", ylim=(0, None), xticks=count)
    for axes in (error, cost):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
