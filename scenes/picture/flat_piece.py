"""A flat piece of a cloth on cells, and from where it is measured: what is the same wherever a cloth goes."""

from dataclasses import replace
from math import asin, degrees
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.fabric.cells import CellCloth, CellPanel, CellThreads
from taichi_cloth.ground.mixing import SURFACE_SHARE

from ...render.data.camera import Camera, frame

__all__ = ["SIZE", "Sight", "flat_camera", "flat_piece", "tilted_camera"]

SIZE = 256, 192
AZIMUTH = 30.0
INNER = 0.6
"""Of a piece, each way, in which it is measured: its edges are not those of a large cloth."""
CELL = 20
PROBE = (0.8, 0.0, 0.8), (0.0, 0.8, 0.8)
"""Colours of warp and of weft by which they are told apart; with 0.6 sheets of 0.9 are 3 % too bright."""


def flat_piece(
    cloth: CellCloth,
    number: int,
    threads: int,
    pitch: tuple[float, float],
    colours: NDArray | None = None,
    *,
    dark: float = SURFACE_SHARE,
    probe: ArrayLike | None = None,
) -> CellStream:
    """A flat piece of so many threads each way, all as wide, woven as a repeat says. colours: of its warp ends and then
    of its weft picks, `CELL` for each cell and one more of both, (n, 3); None: of `probe`, or `PROBE`, over the `dark`
    that none is darker than: else the little that a mixture has of one would be nothing."""
    cells = -(-threads // CELL)
    shape = cells + 1, cells + 1
    count = cells * CELL + 1
    if colours is None:
        colours = np.maximum(np.repeat(PROBE if probe is None else probe, count, axis=0), dark)
    panel = CellPanel(0, 0, *shape, number)
    dyed = CellThreads.whole(np.asarray(colours, np.float32))
    piece = CellCloth(shape, (CELL, CELL), cloth.repeats, (panel,), dyed, bank=cloth.bank, even=True)
    points = np.zeros((*shape, 3))
    points[..., 0] = np.arange(shape[1]) * CELL * pitch[0]
    points[..., 2] = -np.arange(shape[0])[:, None] * CELL * pitch[1]
    piece.move(points)
    return CellStream(piece)


class Sight(NamedTuple):
    """How large a flat piece is seen: pixels from one thread to the next, seen from above, and of the picture."""

    pixels: float
    size: tuple[int, int] = SIZE


def flat_camera(source: CellStream, elevation: float, sight: Sight) -> tuple[Camera, NDArray[np.bool_]]:
    """From far above or below, and which pixels show the inner part."""
    points = source.cloth.node[:, :3].astype(np.float64)
    pixels, (width, height) = sight
    camera = frame(points, width=width, height=height, elevation=elevation, azimuth=AZIMUTH, fov=4)
    away = float(np.linalg.norm(points.mean(axis=0) + camera.rotation.T @ camera.translation))
    camera = replace(camera, focal=pixels * away / float(np.sqrt(source.pitch[0] * source.pitch[1])))
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, INNER * (high - low) / 2
    corners = np.array([middle + half * (a, 0.0, b) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    mask = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(camera.project(corners)[:, :2]).astype(np.int32), 1)
    return camera, mask > 0


def tilted_camera(source: CellStream, tilt: float, side: int, sight: Sight) -> tuple[Camera, NDArray[np.bool_]]:
    """`flat_camera` from the right side of the cloth, 0, or the wrong one, 1, where the cosine of the angle between
    its normal and the view is `tilt`: the nearer the flatter, so that its picture is not much smaller."""
    return flat_camera(source, degrees(asin(tilt)) * (1 - 2 * side), sight._replace(pixels=sight.pixels * tilt**-0.33))
