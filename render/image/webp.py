"""Animated WebP, the moving picture that a README shows: small, in full colour, played by every browser."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import write_bytes

from .image import read_png

__all__ = ["write_webp"]


def write_webp(
    path: str | Path,
    frames: Iterable[NDArray[np.uint8] | str | Path],
    *,
    fps: float,
    width: int = 720,
    quality: int = 80,
) -> None:
    """Write frames as an animated WebP that repeats for ever; the file appears whole or not at all.

    frames: arrays (h, w, 3) uint8 RGB of one size, or PNG files. width: wider frames are shrunk to it [px].
    quality: 1 to 100. Raises InputError for no frames, frames of several sizes, or values out of range, and OSError
    when the folder cannot be written.
    """
    if not 0 < fps <= 1000 or not 1 <= quality <= 100 or width < 1:
        raise InputError(
            f"webp: fps {fps:g}, quality {quality}, width {width}; allowed: fps to 1000, quality 1 to 100, width from 1"
        )
    images: list[NDArray[np.uint8]] = []
    size: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        image = frame if isinstance(frame, np.ndarray) else read_png(frame)
        size = size or image.shape
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.shape != size:
            raise InputError(f"frame {number}: {image.dtype} {image.shape}; allowed: uint8 (h, w, 3), all of one size")
        if image.shape[1] > width:
            height = max(1, round(image.shape[0] * width / image.shape[1]))
            image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        images.append(np.ascontiguousarray(image[..., ::-1], np.uint8))
    if not images:
        raise InputError(f"{path}: no frames; pass at least one")
    ends = np.round(1000 / fps * np.arange(len(images) + 1)).astype(int)
    animation = cv2.Animation()
    animation.frames = images
    animation.durations = [max(1, int(n)) for n in np.diff(ends)]  # [ms], without drift
    done, data = cv2.imencodeanimation(".webp", animation, [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise InputError(f"{path}: OpenCV could not encode the animation")
    write_bytes(path, data.tobytes())
