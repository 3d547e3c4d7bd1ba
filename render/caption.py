"""Words on a picture. The font is OpenCV's own, which holds ASCII."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["caption", "label", "legend"]

Image = NDArray[np.uint8]
FONT = cv2.FONT_HERSHEY_SIMPLEX
LINE_HEIGHT = 22.0  # px at scale 1
COLOUR = (40, 40, 44)
PAPER = (244, 243, 240)


def caption(image: Image, text: str) -> Image:
    """The image (h, w, 3) RGB with one line of text near its lower left corner, smaller where it would not fit."""
    height, width = image.shape[:2]
    scale = _scale(height)
    scale *= min(1.0, 0.94 * width / max(_width(text, scale), 1))
    return _write(image, text, (0.03 * width, 0.97 * height), scale)


def label(image: Image, text: str, at: tuple[float, float]) -> Image:
    """The image with a text centred at a pixel (x, y)."""
    scale = _scale(image.shape[0])
    return _write(image, text, (at[0] - _width(text, scale) / 2, at[1] + LINE_HEIGHT * scale / 2), scale)


def legend(width: int, entries: Sequence[tuple[str, Sequence[float]]], *, height: int = 30) -> Image:
    """A strip (h, width, 3) that says what colours mean: (name, sRGB from 0 to 1), in as many rows as they need.

    height: of a row [px].
    """
    scale, gap = 0.62 * height / LINE_HEIGHT, height // 2
    cell = max(_width(name, scale) for name, _ in entries) + height + 2 * gap
    across = max(1, (width - gap) // cell)
    across = -(-len(entries) // -(-len(entries) // across))  # rows of like length
    rows = -(-len(entries) // across)
    strip = np.full((rows * height + 2 * gap, width, 3), PAPER, np.uint8)
    left = max(gap, (width - across * cell) // 2)
    for k, (name, colour) in enumerate(entries):
        x, y = left + k % across * cell, gap + k // across * height
        strip[y + 4 : y + height - 4, x : x + height - 8] = np.round(255 * np.asarray(colour)).astype(np.uint8)
        strip = _write(strip, name, (x + height, y + 0.72 * height), scale)
    return strip


def _scale(height: int) -> float:
    """Letters are 1/36 of the image's height, and legible on a small one."""
    return max(0.35, height / 36 / LINE_HEIGHT)


def _width(text: str, scale: float) -> int:
    return cv2.getTextSize(text, FONT, scale, 1)[0][0]


def _write(image: Image, text: str, at: tuple[float, float], scale: float) -> Image:
    written = np.ascontiguousarray(image).copy()
    cv2.putText(
        written, text, (round(at[0]), round(at[1])), FONT, scale, COLOUR, max(1, round(1.6 * scale)), cv2.LINE_AA
    )
    return written
