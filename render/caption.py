"""Words on a picture."""

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["caption"]


def caption(image: NDArray[np.uint8], text: str, *, colour: tuple[int, int, int] = (40, 40, 44)) -> NDArray[np.uint8]:
    """The image (h, w, 3) RGB with one line of text near its lower left corner, as high as 1/36 of the image.

    The text is drawn in OpenCV's own font, which holds ASCII, and made smaller where it would not fit.
    """
    height, width = image.shape[:2]
    image = np.ascontiguousarray(image).copy()
    scale = height / 36 / 22
    (wide, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    scale *= min(1.0, 0.94 * width / max(wide, 1))
    at = (round(0.03 * width), height - round(0.03 * height))
    thick = max(1, round(scale * 1.6))
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thick, cv2.LINE_AA)
    return image
