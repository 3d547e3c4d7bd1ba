"""Cusick's drapemeter, simulated: a disc of cloth of 30 cm held between two of 18 cm, and its shadow (ISO 9073-9).

The drape coefficient is the share of the free ring that the shadow still covers. Cloth falls into another number of
folds each time, so several specimens are draped, each from another small unevenness, as the standard asks for several
and both faces.

Key points between the two discs are held, and the rim of these is round whatever the grid (`round_rim.py`). With the
least mass of key points that garments have a stiff disc sagged 9, 6, 4 and 2 % more at 7.5, 5, 3.5 and 2.5 mm, since
all of the specimen's own rim was too heavy. Each specimen lies elsewhere on its grid, by less than a spacing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, pi

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, map_coordinates

from taichi_cloth.mechanics.drape import GRAVITY
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.yarns import Yarns

from .round_rim import RoundRim, round_rim

__all__ = [
    "DISC",
    "SUPPORT",
    "Draped",
    "drape",
    "filled",
    "picture_of",
    "place_of",
    "rim_of",
    "shadow_of",
    "spacing_of",
    "specimen_of",
]

DISC, SUPPORT = 0.15, 0.09
"""Radius of the specimen, and of what it lies on [m]."""

SPACING = (2.5e-3, 5e-3)
"""Of key points [m], at least and at most."""

RESOLVED = 4.0
"""Key points within a cloth's bending length, the scale of its folds, at least."""

SPECIMENS = 6
FRAMES, RATE = 120, 60
AIR = 6.0
"""Damping by the air [1/s], more than cloth has: only the rest is asked for."""

LAG = 1e-4
"""Damping within the cloth [s]. Without it waves that the grid has and cloth has not shake friction loose, the more the
finer it is: cotton at 7.5, 5 and 3.5 mm came to 77.6, 74.5 and 71.5 %, with it to 76.0, 76.7 and 77.0 %."""

SETTLED = 30
"""Times that what is led is asked for at the start: it is there within 1e-9 m."""

UNEVEN = 1e-3
"""Of the rim at the start [m]."""

PIXELS_PER_METRE = 2000.0
SIZE = 700
"""Of the shadow's picture."""

PAPER, SHADE, LINE = (244, 243, 240), (70, 72, 78), (150, 120, 60)
FOLD = 2e-3
"""By which the rim of a shadow stands out at a fold [m]."""

SHARE = 16
"""Samples along a side of a cell, of which the share inside the disc is told."""


@dataclass(frozen=True, eq=False)
class Draped:
    """coefficients: of each specimen [%]. folds: of each. shadow: uint8 (SIZE, SIZE), of the first, 255 where it is.
    speed: the largest of the last frame's root mean squares [m/s]. key_points: of a specimen. spacing: theirs [m]."""

    coefficients: NDArray[np.float64]
    folds: NDArray[np.int64]
    shadow: NDArray[np.uint8]
    speed: float
    key_points: int
    spacing: float

    @property
    def coefficient(self) -> float:
        """Their mean [%]."""
        return float(self.coefficients.mean())


def spacing_of(material: Material) -> float:
    """Of key points [m], fine enough for the folds of a fabric."""
    bending = (material.bending_warp + material.bending_weft) / 2
    least, most = SPACING
    return min(max((bending / (material.density * GRAVITY)) ** (1 / 3) / RESOLVED, least), most)


def drape(
    material: Material,
    *,
    spacing: float | None = None,
    specimens: int = SPECIMENS,
    each: Callable[[int, int], None] | None = None,
) -> Draped:
    """Specimens of a fabric. spacing: of key points [m]; None: that of `spacing_of`. each: told after each frame how
    many are done, of how many. Taichi is running."""
    spacing, points = spacing or spacing_of(material), 0
    out, folds, shadows, speeds = [], [], [], []
    for number in range(specimens):
        place = place_of(number)
        sheet = specimen_of(material, spacing, place)
        points = max(points, int(sheet.present.sum()))

        def told(done: int, before: int = number * FRAMES) -> None:
            if each is not None:
                each(before + done, specimens * FRAMES)

        simulation, speed = _fallen(sheet, number, place, told)
        shadow = shadow_of(filled(simulation.positions.astype(np.float64), sheet.present), spacing, place)
        ring = pi * (DISC**2 - SUPPORT**2)
        out.append(100.0 * ((shadow > 0).sum() / PIXELS_PER_METRE**2 - pi * SUPPORT**2) / ring)
        folds.append(_folds(shadow))
        shadows.append(shadow)
        speeds.append(speed)
    return Draped(np.array(out), np.array(folds), shadows[0], max(speeds), points, spacing)


def place_of(number: int) -> tuple[float, float]:
    """Where the middle of specimen so many lies, in rows and columns from that of its grid: spread evenly over a cell,
    however many there are (the additive sequence of the plastic number, Roberts 2018)."""
    return number * 0.7548776662466927 % 1.0, number * 0.5698402909980532 % 1.0


def specimen_of(material: Material, spacing: float, place: tuple[float, float] = (0.0, 0.0)) -> Sheet:
    """The specimen: cells weigh and pull as much as they lie inside the disc. place: see `place_of`."""
    half = ceil(DISC / spacing) + 1
    fine = (np.arange(2 * half * SHARE) + 0.5) * spacing / SHARE - half * spacing
    y, x = (fine - spacing * share for share in place)
    inside = np.hypot(x, y[:, None]) <= DISC
    cells = inside.reshape(2 * half, SHARE, 2 * half, SHARE).mean(axis=(1, 3))
    cells[cells < 0.02] = 0.0
    held = rim_of((2 * half + 1, 2 * half + 1), spacing, place).held
    damped = replace(material, air_damping=AIR, fibre_damping=LAG)
    springs = calibrate(damped, spacing_x=spacing, spacing_y=spacing)
    return Sheet.of_cells(cells, material=damped, springs=springs, pinned=held, lightest=0.0)


def rim_of(shape: tuple[int, int], spacing: float, place: tuple[float, float]) -> RoundRim:
    """What holds a specimen of rows and columns of key points."""
    return round_rim(shape, radius=SUPPORT, spacing=spacing, place=place)


def _fallen(
    sheet: Sheet, number: int, place: tuple[float, float], each: Callable[[int], None]
) -> tuple[Simulation, float]:
    """Specimen so many at rest, and its speed [m/s]. each: told how many frames are done."""
    s = sheet.springs
    across = sheet.flat() - sheet.flat().mean(axis=(0, 1)) - [place[1] * s.spacing_x, place[0] * s.spacing_y, 0.0]
    angle, radius = np.arctan2(across[..., 1], across[..., 0]), np.hypot(across[..., 0], across[..., 1])
    random = np.random.default_rng(number)
    waves = sum(random.standard_normal() * np.cos(k * (angle - random.uniform(0, 2 * pi))) for k in range(2, 13)) / 3
    height = UNEVEN * np.clip((radius - SUPPORT) / (DISC - SUPPORT), 0.0, 1.0) * waves
    start = np.stack([across[..., 0], np.where(sheet.pinned, 0.0, height), across[..., 1]], axis=-1)
    rim, flat = rim_of(sheet.shape, s.spacing_x, place), start * [1.0, 0.0, 1.0]
    held = Pins(rim.still), Pins(rim.led, lambda _: flat[rim.led] + rim.follow(before - flat))
    for _ in range(SETTLED):  # what is led is followed in part itself
        start[rim.led] = flat[rim.led] + rim.follow(start - flat)
    before, forces = start, Forces(gravity=(0.0, -9.81, 0.0))
    solver = Yarns(sheet, forces, frame_rate=RATE)
    simulation = Simulation(sheet, solver, forces=forces, positions=start, pins=held)
    for done in range(FRAMES):
        before = simulation.positions
        simulation.step()
        each(done + 1)
    moved = (simulation.positions - before)[sheet.present] * RATE
    return simulation, float(np.sqrt((moved**2).sum(axis=1).mean()))


def filled(positions: NDArray[np.float64], present: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Positions (n, n, 3) [m], those of absent key points taken from the nearest that is there: the rim of a specimen
    lies partly in cells of which so little is cloth that they are none."""
    nearest = np.asarray(distance_transform_edt(~present, return_distances=False, return_indices=True))
    return positions[nearest[0], nearest[1]]


def shadow_of(
    positions: NDArray[np.float64], spacing: float, place: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.uint8]:
    """The shadow under parallel light from above, uint8 (SIZE, SIZE). positions: (n, n, 3) [m], y up, of key points of
    a specimen. place: see `place_of`."""
    half = (len(positions) - 1) / 2
    middle = half + np.array(place)[:, None, None]
    radius, angle = np.meshgrid(np.linspace(0.0, DISC, 61), np.linspace(0.0, 2 * pi, 361), indexing="ij")
    at = middle + radius / spacing * np.stack([np.sin(angle), np.cos(angle)])
    seen = np.stack([map_coordinates(positions[..., axis], at, order=1) for axis in (0, 2)], axis=-1)
    pixel = PIXELS_PER_METRE * (seen - seen[0, 0]) + SIZE / 2
    quads = np.stack([pixel[:-1, :-1], pixel[1:, :-1], pixel[1:, 1:], pixel[:-1, 1:]], axis=2)
    shadow = np.zeros((SIZE, SIZE), np.uint8)
    shift = 4  # binary places of a pixel's fraction
    for quad in np.rint(quads.reshape(-1, 4, 2) * (1 << shift)).astype(np.int32):
        cv2.fillConvexPoly(shadow, quad, 255, shift=shift)
    return shadow


def _folds(shadow: NDArray[np.uint8]) -> int:
    """How often the rim of a shadow stands out, by more than FOLD."""
    angle, reach = np.arange(0.0, 2 * pi, pi / 360), np.arange(SIZE / 2)
    x, y = (np.clip((SIZE / 2 + reach[:, None] * way(angle)).astype(int), 0, SIZE - 1) for way in (np.cos, np.sin))
    rim = gaussian_filter1d(np.where(shadow[y, x] > 0, reach[:, None], 0.0).max(axis=0), 3.0, mode="wrap")
    rim = np.roll(rim, -int(rim.argmin()))  # so that no fold lies across the ends
    from scipy.signal import find_peaks  # half a second, of all that import this

    return len(find_peaks(rim, prominence=FOLD * PIXELS_PER_METRE)[0])


def picture_of(draped: Draped) -> NDArray[np.uint8]:
    """(SIZE, SIZE, 3): the first specimen's shadow as the instrument shows it, with the rims of disc and support."""
    out = np.where(draped.shadow[..., None] > 0, SHADE, PAPER).astype(np.uint8)
    middle = (SIZE // 2, SIZE // 2)
    for radius in (DISC, SUPPORT):
        cv2.circle(out, middle, round(PIXELS_PER_METRE * radius), LINE, 1, cv2.LINE_AA)
    return out
