"""Images: linear light to sRGB, PNG files that are whole or not there, and contact sheets."""

import contextlib
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes, shown_path, write_bytes

__all__ = [
    "LARGEST_GIVEN",
    "Pixels",
    "contact_sheet",
    "linear_to_srgb",
    "png_is_whole",
    "quiet_stderr",
    "read_png",
    "srgb_to_linear",
    "write_png",
]

Pixels: TypeAlias = NDArray[np.uint8] | NDArray[np.uint16]
"""An image (h, w), (h, w, 3) RGB or (h, w, 4) RGBA."""

LARGEST = 16384
"""Pixels each way of what we write."""
LARGEST_GIVEN = 8192
"""Pixels each way of a picture that a person gives, to be printed or to be a sprite."""
SIGNATURE = b"\x89PNG\r\n\x1a\n"
OF_PIXELS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""Chunks that make the pixels. Others are left out: one that promises many frames takes gigabytes."""
SPARE_BYTES = 1_000_000
"""In a PNG beside 3 a pixel: its colour profile and what it says of itself."""


def linear_to_srgb(linear: ArrayLike) -> NDArray[np.float64]:
    """sRGB values 0..1 of linear light, clipped to 0..1 (IEC 61966-2-1)."""
    light = np.clip(np.asarray(linear, np.float64), 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def srgb_to_linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear light of sRGB values 0..1 (IEC 61966-2-1)."""
    value = np.asarray(srgb, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def write_png(path: str | Path, image: Pixels, *, compression: int = 3) -> None:
    """Write an image (h, w), (h, w, 3) RGB or (h, w, 4) RGBA, uint8 or uint16, as PNG.

    The file appears whole or not at all: a failed write leaves an older file as it was.
    compression: zlib level, 0 (fast) to 9 (small). Raises InputError for another shape, type or level, and
    OSError when the folder cannot be written.
    """
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: image of {image.dtype}; allowed: uint8, uint16 (see linear_to_srgb)")
    if image.ndim not in (2, 3) or 0 in image.shape or (image.ndim == 3 and image.shape[2] not in (3, 4)):
        raise InputError(f"{path}: image of shape {image.shape}; allowed: (h, w), (h, w, 3), (h, w, 4)")
    if not 0 <= compression <= 9:
        raise InputError(f"compression: {compression}; allowed: 0 to 9")
    done, data = cv2.imencode(".png", _swapped(image), [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not done:
        raise InputError(f"{path}: OpenCV could not encode the image")
    write_bytes(path, data.tobytes())


def read_png(path: str | Path, *, largest: int = LARGEST) -> Pixels:
    """The image in a PNG file, in its own depth and channels, RGB(A). Its size is looked at before it is decoded.

    largest: pixels it may have each way. Raises InputError when it has more, or is no PNG that can be read.
    """
    data = read_bytes(path, most=3 * largest**2 + SPARE_BYTES, give="a PNG")
    name = shown_path(path)
    chunks = list(_chunks(data))
    if (
        data[:8] != SIGNATURE
        or not chunks
        or chunks[-1][4:8] != b"IEND"
        or chunks[0][4:8] != b"IHDR"
        or len(chunks[0]) != 25
    ):
        raise InputError(f"{name}: not an image that can be read; give a PNG")
    width, height = struct.unpack(">II", chunks[0][8:16])
    if not (1 <= width <= largest and 1 <= height <= largest):
        raise InputError(f"{name}: {width} x {height} pixels; allowed: up to {largest} each way; give a smaller PNG")
    pixels = SIGNATURE + b"".join(chunk for chunk in chunks if chunk[4:8] in OF_PIXELS)
    try:
        with quiet_stderr():
            image = cv2.imdecode(np.frombuffer(pixels, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{name}: not an image that can be read; give a PNG")
    return _swapped(image)


def png_is_whole(path: str | Path) -> bool:
    """Whether a file is a PNG with all its chunks, each as it was written (PNG specification, 5: lengths and CRCs)."""
    try:
        data = Path(path).read_bytes()
    except OSError:
        return False
    chunks = list(_chunks(data))
    whole = data[:8] == SIGNATURE and bool(chunks) and chunks[-1][4:8] == b"IEND"
    return whole and all(zlib.crc32(c[4:-4]) == int.from_bytes(c[-4:], "big") for c in chunks)


def _chunks(png: bytes) -> Iterator[bytes]:
    """The chunks of a PNG file as they stand, to the last or as far as they are whole: length, name, data, check."""
    at = len(SIGNATURE)
    while (end := at + 12 + int.from_bytes(png[at : at + 4], "big")) <= len(png):
        yield png[at:end]
        if png[at + 4 : at + 8] == b"IEND":
            return
        at = end


@contextlib.contextmanager
def quiet_stderr() -> Iterator[None]:
    """Keep C libraries from writing to stderr: libpng says there what is wrong with a file, which the reader says
    again, and OpenCV's FFmpeg that it renames the codec's tag."""
    try:
        said = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(said, 2)
        os.close(said)


def contact_sheet(
    images: Sequence[NDArray[np.uint8] | str | Path],
    *,
    columns: int | None = None,
    thumbnail: int = 320,
    gap: int = 6,
    background: tuple[int, int, int] = (255, 255, 255),
) -> NDArray[np.uint8]:
    """One picture (h, w, 3) of many, in rows from the top left; all thumbnails have the first one's shape.

    images: arrays (h, w, 3) uint8 or PNG files. columns: None makes the sheet about square. thumbnail: width
    of one [px], never enlarged. gap: space between [px]. background: sRGB 0..255.
    Raises InputError for no images or images that are not 8-bit RGB.
    """
    if not len(images):
        raise InputError("contact_sheet: no images; pass at least one")
    if columns is not None and columns < 1:
        raise InputError(f"contact_sheet: {columns} columns; allowed: 1 or more")
    columns = min(columns or int(np.ceil(np.sqrt(len(images)))), len(images))
    rows = -(-len(images) // columns)
    sheet = cell = None
    for number, item in enumerate(images):
        image = item if isinstance(item, np.ndarray) else read_png(item)
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise InputError(f"contact_sheet: image {number} is {image.dtype} {image.shape}; allowed: uint8 (h, w, 3)")
        if sheet is None or cell is None:
            width = max(1, min(thumbnail, image.shape[1]))
            cell = (width, max(1, round(image.shape[0] * width / image.shape[1])))
            shape = (rows * (cell[1] + gap) + gap, columns * (cell[0] + gap) + gap, 3)
            sheet = np.full(shape, background, np.uint8)
        y = gap + number // columns * (cell[1] + gap)
        x = gap + number % columns * (cell[0] + gap)
        sheet[y : y + cell[1], x : x + cell[0]] = cv2.resize(image, cell, interpolation=cv2.INTER_AREA)
    assert sheet is not None
    return sheet


def _swapped(image: NDArray[Any]) -> NDArray[Any]:
    """RGB(A) to OpenCV's BGR(A), or back."""
    if image.ndim == 2:
        return image
    return np.ascontiguousarray(image[..., [2, 1, 0, 3][: image.shape[2]]])
