"""Pictures of a scene's prints, from files."""

import numpy as np

from taichi_cloth.garment.pattern.pattern import Panel
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import srgb_to_linear

from ...render.image.image import LARGEST_GIVEN, read_png
from ..scene.garment_schema import PrintSection

__all__ = ["print_of"]


def print_of(section: PrintSection, panel: Panel) -> Print:
    """A print on a panel, in the middle of it unless it says where. Raises InputError on what is no picture."""
    try:
        image = read_png(section.file, largest=LARGEST_GIVEN)
    except InputError as error:
        raise InputError(f"garment.prints.{panel.name}.file: {error}") from None
    share = image.astype(np.float64) / (65535 if image.dtype == np.uint16 else 255)
    channels = share[..., None] if share.ndim == 2 else share
    grey, covered = channels.shape[2] <= 2, channels.shape[2] in (2, 4)
    colour = np.repeat(channels[..., :1], 3, axis=2) if grey else channels[..., :3]
    alpha = channels[..., -1:] if covered else np.ones_like(channels[..., :1])
    low, high = panel.outline.min(axis=0), panel.outline.max(axis=0)
    x, y = (low + high) / 2 + 0.01 * np.array([section.right_cm, section.up_cm])
    width = float(high[0] - low[0]) if section.width_cm is None else 0.01 * section.width_cm
    return Print(
        np.concatenate([srgb_to_linear(colour), alpha], axis=2).astype(np.float32), (float(x), float(y)), width
    )
