"""Fibres finer than half a pixel are drawn on a canvas of several samples a pixel each way, averaged in linear light.

Drawn as wide as a pixel and fainter, many of them one behind the other are opaque as far as they reach: the mean of
1 - exp(-depth) is that of what is seen, 1 - exp(-mean depth) is more, and gaps between threads fill. So nothing that is
done to one splat mends it; smaller pixels do.
"""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...render.data.camera import MAX_PIXELS, Camera
from ...render.image.tone import WHITE, Tone, tone_curve, tone_table
from ...render.tiles.rows import LUT_STEPS
from ..models.model import Panel

__all__ = ["SAMPLES", "averaged", "over", "samples_of", "shown"]

SAMPLES = 2
FINE = 0.48
"""Radius [px] of fibres under which there are so many samples: yarns and plies in which they lie are 1 to 3 px wide."""


def samples_of(panel: Panel, camera: Camera) -> int:
    """Samples along each side of a pixel for what a panel shows to a camera. Batches have levels by the pixel."""
    if panel.source is not None or not len(panel.particles):
        return 1
    if SAMPLES * max(camera.width, camera.height) > MAX_PIXELS:
        return 1
    depth = float((panel.bounds.mean(axis=0) - camera.eye) @ camera.forward)
    return SAMPLES if float(np.median(panel.particles.radius)) * camera.focal < FINE * depth else 1


def over(rgba: NDArray[np.float32], behind: NDArray) -> NDArray[np.float32]:
    """Linear colour (h, w, 3) of premultiplied light and coverage (h, w, 4) over what stands behind."""
    return (rgba[..., :3] + (1 - rgba[..., 3:]) * behind).astype(np.float32)


def averaged(image: NDArray[np.float32], by: int) -> NDArray[np.float32]:
    """An image (h, w, channels) on by x by pixels as one."""
    if by == 1:
        return image
    height, width, _ = image.shape
    return np.asarray(cv2.resize(image, (width // by, height // by), interpolation=cv2.INTER_AREA), np.float32)


def shown(tone: Tone, light: ArrayLike) -> NDArray[np.uint8]:
    """8-bit sRGB of linear light (h, w, 3), as `raster` writes it."""
    light = np.asarray(tone_curve(tone, light) if tone == "neutral" else light, np.float32)
    step = np.clip(light * (LUT_STEPS / WHITE[tone]) + 0.5, 0, LUT_STEPS).astype(np.int32)
    return tone_table(tone, LUT_STEPS)[step]
