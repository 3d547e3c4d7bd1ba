"""How well primitives stand for a skin: distances both ways, part by part, inside and outside told apart."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from taichi_cloth.body.primitives.distance import nearest_distance, signed_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.samples import mesh_distance, skin_samples

__all__ = ["FitReport", "PartError", "exposed_samples", "report_fit"]

F64 = NDArray[np.float64]
SAMPLES = 20_000
SEED = 1
"""Not the fit's: a fit is not to be judged by the points it was made from."""


@dataclass(frozen=True, kw_only=True)
class PartError:
    """Distances in millimetres between the skin of one part, or of all, and the union of all primitives."""

    part: str
    primitives: int
    area_m2: float
    mean_mm: float
    p95_mm: float
    max_mm: float
    under_mm: float
    """Mean where the primitives stay under the skin."""
    over_mm: float
    """Mean where they stick out through it."""
    over_share: float
    """Share of the skin that they stick out through."""


@dataclass(frozen=True, kw_only=True)
class FitReport:
    """What `report_fit` measured. Lengths in millimetres."""

    parts: tuple[PartError, ...]
    whole: PartError
    exposed_mean_mm: float
    """From the union's own surface to the skin."""
    exposed_p95_mm: float
    exposed_max_mm: float

    def as_dict(self) -> dict:
        return asdict(self)

    def lines(self) -> list[str]:
        """A table to print, a line a part, the whole last."""
        head = f"{'part':<17}{'count':>6}{'mean':>8}{'95 %':>8}{'max':>8}{'under':>8}{'over':>8}{'over':>8}"
        unit = f"{'':<17}{'':>6}{'mm':>8}{'mm':>8}{'mm':>8}{'mm':>8}{'mm':>8}{'% area':>8}"
        rows = [
            f"{r.part:<17}{r.primitives:>6}{r.mean_mm:>8.2f}{r.p95_mm:>8.2f}{r.max_mm:>8.2f}"
            f"{r.under_mm:>8.2f}{r.over_mm:>8.2f}{100 * r.over_share:>8.1f}"
            for r in (*self.parts, self.whole)
        ]
        back = (
            f"from the primitives' surface to the skin: mean {self.exposed_mean_mm:.2f} mm, "
            f"95 % {self.exposed_p95_mm:.2f} mm, max {self.exposed_max_mm:.2f} mm"
        )
        return [head, unit, *rows, back]


def report_fit(
    vertices: NDArray, faces: NDArray, labels: NDArray, names: Sequence[str], primitives: Sequence[Primitive]
) -> FitReport:
    """Measure primitives against a skin, vertices (v, 3) [m], faces (f, 3), labels (f,) into names."""
    points, face = skin_samples(vertices, faces, SAMPLES, seed=SEED)
    surface, spacing = exposed_samples(primitives)
    distance = _union_distance(primitives, points, surface)
    corner = np.asarray(vertices, np.float64)[np.asarray(faces)]
    total = float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)
    part = np.asarray(labels)[face]
    rows = [
        _row(name, sum(p.part == name for p in primitives), distance[part == k], total)
        for k, name in enumerate(names)
        if (part == k).any()
    ]
    back = mesh_distance(surface, vertices, faces) * 1000
    share = spacing / spacing.sum()
    order = np.argsort(back)
    ninety_five = order[min(int(np.searchsorted(np.cumsum(share[order]), 0.95)), len(order) - 1)]
    return FitReport(
        parts=tuple(rows),
        whole=_row("all", len(primitives), distance, total),
        exposed_mean_mm=float((back * share).sum()),
        exposed_p95_mm=float(back[ninety_five]),
        exposed_max_mm=float(back.max()),
    )


def _row(part: str, count: int, distance: F64, total: float) -> PartError:
    size, over = np.abs(distance) * 1000, distance < 0
    return PartError(
        part=part,
        primitives=count,
        area_m2=total * len(distance) / SAMPLES,
        mean_mm=float(size.mean()),
        p95_mm=float(np.quantile(size, 0.95)),
        max_mm=float(size.max()),
        under_mm=float(size[~over].mean()) if (~over).any() else 0.0,
        over_mm=float(size[over].mean()) if over.any() else 0.0,
        over_share=float(over.mean()),
    )


def _union_distance(primitives: Sequence[Primitive], points: F64, surface: F64) -> F64:
    """Signed distance (n,) to the union's surface. Inside, the least over the primitives is only a bound; where the
    nearest point of that primitive lies within another, the nearest of the union's surface samples counts."""
    distance, gradient, _ = nearest_distance(primitives, points)
    foot = points - distance[:, None] * gradient
    hidden = (distance < 0) & (nearest_distance(primitives, foot)[0] < -1e-6)
    if hidden.any():
        deep = KDTree(surface).query(points[hidden])[0]
        distance[hidden] = np.minimum(distance[hidden], -deep)
    return distance


def exposed_samples(primitives: Sequence[Primitive], *, each: int = 4000, seed: int = 2) -> tuple[F64, F64]:
    """Points on the surface of the union (n, 3), and the area [m²] that each stands for (n,).

    Points are thrown evenly, by Philox, into a box round each primitive; those within a thin shell of its surface are
    moved onto it, and dropped where another primitive covers them. A shell of half width h holds 2h of volume an area.
    """
    found, area = [], []
    for number, primitive in enumerate(primitives):
        chance = np.random.Generator(np.random.Philox(key=[seed, number]))
        thin = 0.1 * min(primitive.radii)
        reach = max(primitive.radii) + thin
        low = np.minimum(primitive.start, primitive.end) - reach
        high = np.maximum(primitive.start, primitive.end) + reach
        points = low + chance.random((each * 6, 3)) * (high - low)
        volume = float(np.prod(high - low)) / len(points)
        distance, gradient = signed_distance(primitive, points)
        near = np.flatnonzero(np.abs(distance) < thin)
        on = points[near] - distance[near, None] * gradient[near]
        free = np.ones(len(on), bool)
        for other, solid in enumerate(primitives):
            if other != number and primitive.meets(solid):
                free[free] = signed_distance(solid, on[free])[0] > -1e-9
        found.append(on[free])
        area.append(np.full(int(free.sum()), volume / (2 * thin)))
    return np.concatenate(found), np.concatenate(area)
