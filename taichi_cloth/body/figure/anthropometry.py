"""How big a person is: the measures a body is made from, and how a tape reads them off a mesh.

Sources. Stature, chest or bust, waist and hip: the middle of EN 13402-3 and ISO 8559-2 size tables for young adults
(women 168 cm, 88-72-96, size 38; men 178 cm, 98-84-98, size M). All else: near the means of ANSUR II (Gordon et al.,
"2012 Anthropometric survey of U.S. Army personnel", NATICK/TR-15/007, 2014) as a share of stature (lengths, breadths)
or scaled by hip (legs) and chest (arms) to the sizes above; limb girths of relaxed limbs; rounded to 5 mm.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.body.skin.sections import section_pieces
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["FEMALE", "MALE", "Gender", "Measures", "measures_of", "tape"]

F64 = NDArray[np.float64]
Gender = Literal["female", "male"]


@dataclass(frozen=True, kw_only=True)
class Measures:
    """Lengths and girths of a person [m]."""

    stature: float
    bust: float
    """Girth of the chest at its fullest."""
    underbust: float
    waist: float
    hip: float
    neck: float
    """Girth halfway up the neck, square to it."""
    upper_arm: float
    forearm: float
    wrist: float
    thigh: float
    """Girth just below the fold of the buttock."""
    knee: float
    calf: float
    ankle: float
    shoulder_breadth: float
    """Between the two acromia (biacromial)."""
    arm_length: float
    """From the shoulder's joint over the elbow to the wrist."""
    crotch_height: float


FEMALE = Measures(
    stature=1.68, bust=0.88, underbust=0.75, waist=0.72, hip=0.96, neck=0.325, upper_arm=0.265, forearm=0.24,
    wrist=0.155, thigh=0.555, knee=0.355, calf=0.355, ankle=0.21, shoulder_breadth=0.375, arm_length=0.545,
    crotch_height=0.785,
)  # fmt: skip
MALE = Measures(
    stature=1.78, bust=0.98, underbust=0.90, waist=0.84, hip=0.98, neck=0.385, upper_arm=0.315, forearm=0.28,
    wrist=0.175, thigh=0.565, knee=0.385, calf=0.375, ankle=0.23, shoulder_breadth=0.42, arm_length=0.585,
    crotch_height=0.84,
)  # fmt: skip

ALLOWED = {
    "stature": (0.7, 2.3), "bust": (0.42, 1.6), "underbust": (0.38, 1.5), "waist": (0.38, 1.6), "hip": (0.42, 1.7),
    "neck": (0.18, 0.6), "upper_arm": (0.11, 0.6), "forearm": (0.11, 0.5), "wrist": (0.08, 0.3), "thigh": (0.22, 1.0),
    "knee": (0.16, 0.65), "calf": (0.14, 0.65), "ankle": (0.1, 0.4), "shoulder_breadth": (0.16, 0.55),
    "arm_length": (0.22, 0.85), "crotch_height": (0.25, 1.15),
}  # fmt: skip


def measures_of(gender: Gender = "female", given: Mapping[str, float] | None = None) -> Measures:
    """The standard person of a gender with some measures [m] replaced. Raises InputError.

    What is not given follows what is: lengths the stature, girths of the arm the bust, of the leg the hip; the
    underbust stays as far below the bust as it was.
    """
    if gender not in get_args(Gender):
        raise InputError(f"body.gender: {gender!r}; known: female, male{did_you_mean(str(gender), get_args(Gender))}")
    standard = FEMALE if gender == "female" else MALE
    given = {str(k): float(v) for k, v in (given or {}).items()}
    known = [f.name for f in fields(Measures)]
    for name, value in given.items():
        if name not in known:
            raise InputError(f"body: unknown measure {name!r}; known: {', '.join(known)}{did_you_mean(name, known)}")
        low, high = ALLOWED[name]
        if not (np.isfinite(value) and low <= value <= high):
            raise InputError(f"body.{name}: {100 * value:g} cm; allowed: {100 * low:g} to {100 * high:g} cm")
    tall = given.get("stature", standard.stature) / standard.stature
    follows = dict.fromkeys(known, tall)
    for leader, led in (
        ("bust", ("underbust", "neck", "upper_arm", "forearm", "wrist")),
        ("hip", ("thigh", "knee", "calf", "ankle")),
    ):
        wide = given.get(leader, getattr(standard, leader) * tall) / getattr(standard, leader)
        follows |= dict.fromkeys(led, float(np.sqrt(tall * wide)))
    bust = given.get("bust", standard.bust * tall)
    follows["underbust"] = (bust - tall * (standard.bust - standard.underbust)) / standard.underbust
    follows["shoulder_breadth"] = tall + 0.35 * (bust / standard.bust - tall)
    return replace(standard, **{n: given.get(n, getattr(standard, n) * follows[n]) for n in known})


def tape(vertices: F64, faces: NDArray[np.integer], point: ArrayLike, normal: ArrayLike) -> float:
    """Length [m] of a tape laid round the mesh in a plane: the hull of the piece of the section nearest to the point.

    nan where the plane misses the mesh. point: within the limb, in the plane; normal: of the plane.
    """
    from scipy.spatial import ConvexHull, QhullError  # half a second, of all that read a scene

    point, normal = np.asarray(point, np.float64), np.asarray(normal, np.float64)
    normal = normal / np.linalg.norm(normal)
    across = np.linalg.svd(normal[None])[2][1:]
    pieces = [(piece - point) @ across.T for piece in section_pieces(vertices, faces, point, normal)]
    if not pieces:
        return float("nan")
    best = min(pieces, key=lambda p: np.linalg.norm((p.max(0) + p.min(0)) / 2))
    try:
        return float(ConvexHull(best).area)  # in two dimensions the "area" is the perimeter
    except QhullError:
        return float("nan")
