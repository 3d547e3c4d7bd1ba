"""OpenEXR files: float images without loss. Needs the optional package OpenEXR (extra "exr"); OpenCV's wheels have
no EXR."""

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import in_one_step

__all__ = ["require_exr", "write_exr"]


def require_exr() -> Any:
    """The OpenEXR package. Raises InputError that says how to get it."""
    try:
        return importlib.import_module("OpenEXR")
    except ImportError:
        raise InputError("EXR needs OpenEXR; pip install 'taichi-cloth[exr]', or take png16") from None


def write_exr(path: str | Path, channels: Mapping[str, NDArray[Any]]) -> None:
    """Write named channels (h, w) of one size as a ZIP-compressed EXR: float32, or uint32 for whole numbers.

    The file appears whole or not at all. Raises InputError for no channels, several sizes, negative whole numbers,
    or without the package, and OSError when the folder cannot be written.
    """
    library = require_exr()
    path = Path(path)
    shapes = {np.shape(channel) for channel in channels.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
        raise InputError(f"{path}: channels of shapes {sorted(shapes)}; allowed: at least one, all of one (h, w)")
    planes = {}
    for name, channel in channels.items():
        whole = np.issubdtype(channel.dtype, np.integer)
        if whole and channel.min() < 0:
            raise InputError(f"{path}: channel {name} has {channel.min()}; allowed: 0 and above")
        planes[name] = np.ascontiguousarray(channel, np.uint32 if whole else np.float32)
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    with in_one_step(path, ".exr") as part:
        library.File(header, planes).write(str(part))
