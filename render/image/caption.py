"""Words on a picture. The font is OpenCV's own, which holds ASCII."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["caption", "label", "legend", "tag"]

Image = NDArray[np.uint8]
FONT = cv2.FONT_HERSHEY_SIMPLEX
LINE_HEIGHT = 22.0  # px at scale 1
COLOUR = (40, 40, 44)
PAPER = (244, 243, 240)


def caption(image: Image, text: str) -> Image:
    """The image (h, w, 3) RGB with one line of text near its lower left corner, smaller where it would not fit."""
    height, width = image.shape[:2]
    scale = _scale(image)
    while scale > 0.1 and _width(text, scale) > 0.94 * width:  # letters come in whole sizes
        scale *= 0.97
    return _write(image, text, (0.03 * width, 0.97 * height), scale)


def tag(image: Image, text: str) -> Image:
    """The image with a text on a light plate in its lower left corner, for pictures that are full to their edges."""
    scale = _scale(image)
    room = round(0.6 * LINE_HEIGHT * scale)
    out = image.copy()
    plate = out[-round(LINE_HEIGHT * scale) - 2 * room :, : _width(text, scale) + 2 * room]
    plate[:] = 255 - (255 - plate.astype(np.uint16)) // 6
    return _write(out, text, (room, image.shape[0] - room - 0.1 * LINE_HEIGHT * scale), scale)


def label(image: Image, text: str, at: tuple[float, float]) -> Image:
    """The image with a text centred at a pixel (x, y)."""
    scale = _scale(image)
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


def _scale(image: Image) -> float:
    """Letters are 1/36 of the image's height, or of half the width of a flat one and 2.4 widths of a narrow one;
    and legible on a small one."""
    height, width = image.shape[:2]
    return max(0.35, min(max(height, width / 2), 2.4 * width) / 36 / LINE_HEIGHT)


def _width(text: str, scale: float) -> int:
    return cv2.getTextSize(text, FONT, scale, _weight(scale))[0][0]


def _weight(scale: float) -> int:
    """Thickness of the strokes, on which letters' widths depend too [px]."""
    return max(1, round(1.6 * scale))


def _write(image: Image, text: str, at: tuple[float, float], scale: float) -> Image:
    written = np.ascontiguousarray(image).copy()
    cv2.putText(written, text, (round(at[0]), round(at[1])), FONT, scale, COLOUR, _weight(scale), cv2.LINE_AA)
    return written
