"""What the solvers are tried on, and how their motion is judged.

Cotton shirting, 0.5 m × 0.5 m, bent to an arc at the start, so that which way it folds is not left to rounding: *hang*,
held at two corners and let go, and *drape*, laid on a ball. Folds are chaotic: where each key point ends tells little.
So a run is judged by how high the cloth is in the mean and at its lowest, frame by frame, and by how long its threads
are: solvers that are broken off too early fall too slowly, or stretch. Even the lowest point of a folding sheet is some
centimetre up or down by chance; the error of motion is that of the mean.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import asin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.mechanics.presets import preset_properties, within_material
from taichi_cloth.motion.forces import Forces, Sphere
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate

__all__ = ["CASES", "FRAME_RATE", "SIDE", "Case", "Judged", "case_of", "judged", "motion_error", "stretch_error"]

F64 = NDArray[np.float64]
CASES = {"hang": 24, "drape": 24}
"""Frames that are looked at."""

COTTON = "cotton-shirting"
FRAME_RATE = 60.0
SIDE, ARC = 0.5, 0.4  # [m], of the sheet and radius of the arc
BALL = Sphere(centre=(0.013, -0.13, 0.021), radius=0.125)
LONG = 99.0
"""Percent of threads, the longest of which stands for stretch."""


@dataclass(frozen=True, eq=False)
class Case:
    """name: of `CASES`. threads: factor of the threads' stiffness. start: (points, points, 3) [m]."""

    name: str
    threads: float
    sheet: Sheet
    forces: Forces
    start: F64

    @property
    def seconds(self) -> float:
        return CASES[self.name] / FRAME_RATE

    @property
    def panel(self) -> str:
        words = "cotton" if self.threads == 1 else f"cotton, threads × {self.threads:,.0f}"
        return f"{self.name}, {words}"


def case_of(
    name: str, points: int, *, threads: float = 1.0, ratio: float | None = None, within: Iterable[str] = ()
) -> Case:
    """A sheet of points × points. ratio: of the threads' stiffness to that of shear, instead of cotton's. within: what
    of cotton's own it has beside springs, by the names of WITHIN."""
    base = replace(named_material(COTTON).linear, **within_material(preset_properties(COTTON), within))
    kept = {key: threads * getattr(base, key) for key in ("tensile_warp", "tensile_weft")}
    if ratio is not None:
        kept = dict.fromkeys(kept, ratio * base.shear)
    material = replace(base, **kept)
    spacing = SIDE / (points - 1)
    pinned = np.zeros((points, points), bool)
    if name == "hang":
        pinned[0, [0, -1]] = True
    springs = calibrate(material, spacing_x=spacing, spacing_y=spacing)
    sheet = Sheet.rectangle(points, points, material=material, springs=springs, pinned=pinned)
    flat = sheet.flat()
    bend = 2 * asin(spacing / 2 / ARC) / spacing  # chords as long as threads, so that none is strained
    angle = (flat[..., 0] - SIDE / 2) * bend
    up = 1.0 if name == "hang" else -1.0
    start = np.stack([ARC * np.sin(angle), up * ARC * (1 - np.cos(angle)), SIDE / 2 - flat[..., 1]], axis=-1)
    return Case(name, threads, sheet, Forces(sphere=BALL if name == "drape" else None), start)


@dataclass(frozen=True, eq=False)
class Judged:
    """Of each frame: height in the mean and of the lowest key point [m], and strain of a thread that all but 1 % stay
    below."""

    mean: F64
    lowest: F64
    strain: F64


def judged(sheet: Sheet, course: F64) -> Judged:
    """course: positions (frames, rows, cols, 3) [m]."""
    height = course[..., 1].reshape(len(course), -1)
    strain = [np.percentile(np.concatenate([part.ravel() for part in sheet.stretch(x)]), LONG) for x in course]
    return Judged(height.mean(axis=1), height.min(axis=1), np.array(strain))


def motion_error(one: Judged, two: Judged) -> float:
    """How far apart mean heights are, root mean square over all frames [m]."""
    return float(np.sqrt(np.mean((one.mean - two.mean) ** 2)))


def stretch_error(one: Judged, two: Judged) -> float:
    """How far apart strains are, root mean square over all frames."""
    return float(np.sqrt(np.mean((one.strain - two.strain) ** 2)))
