"""Pictures of a scene's prints, from files."""

from pathlib import Path

import cv2
import numpy as np

from taichi_cloth.garment.pattern.pattern import Panel
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import srgb_to_linear

from ..scene.garment_schema import PrintSection

__all__ = ["print_of"]

LARGEST = 8192  # pixels each way


def print_of(section: PrintSection, panel: Panel) -> Print:
    """A print on a panel, in the middle of it unless it says where. Raises InputError on what is no picture."""
    where = f"garment.prints.{panel.name}.file"
    path = Path(section.file)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{where}: {section.file!r}: {error.strerror}; allowed: a PNG that can be read") from None
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None:
        raise InputError(f"{where}: {section.file!r} is no picture that can be read; allowed: a PNG")
    if max(image.shape[:2]) > LARGEST:
        size = f"{image.shape[1]} x {image.shape[0]}"
        raise InputError(f"{where}: {section.file!r} has {size} pixels; allowed: up to {LARGEST} each way")
    share = image.astype(np.float64) / (65535 if image.dtype == np.uint16 else 255)
    channels = share[..., None] if share.ndim == 2 else share
    grey, covered = channels.shape[2] <= 2, channels.shape[2] in (2, 4)
    colour = np.repeat(channels[..., :1], 3, axis=2) if grey else channels[..., 2::-1]  # OpenCV reads blue first
    alpha = channels[..., -1:] if covered else np.ones_like(channels[..., :1])
    low, high = panel.outline.min(axis=0), panel.outline.max(axis=0)
    x, y = (low + high) / 2 + 0.01 * np.array([section.right_cm, section.up_cm])
    width = float(high[0] - low[0]) if section.width_cm is None else 0.01 * section.width_cm
    return Print(
        np.concatenate([srgb_to_linear(colour), alpha], axis=2).astype(np.float32), (float(x), float(y)), width
    )
