"""MP4 files that browsers play, from images in memory or on disk.

H.264 is written by the FFmpeg of imageio-ffmpeg when that optional package is installed (extra "video").
Otherwise OpenCV writes VP9, slower and larger: its own FFmpeg has no H.264.
"""

import importlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import in_one_step

from .image import quiet_stderr, read_png

__all__ = ["Codec", "write_mp4"]

Codec: TypeAlias = Literal["h264", "vp9"]

X264_THREADS = 4
"""Fixed, because x264 gives other bytes for another number of threads."""


def write_mp4(
    path: str | Path,
    frames: Iterable[NDArray[np.uint8] | str | Path],
    *,
    fps: float,
    codec: Codec | None = None,
) -> Codec:
    """Write frames as MP4 and return the codec that was used.

    frames: arrays (h, w, 3) uint8 RGB of one size, or PNG files. An odd width or height is made even by
    repeating the last column or row. codec: None takes H.264 where it can.
    The file appears whole or not at all, and the same frames give the same bytes with the same libraries.
    Raises InputError for no frames, frames of several sizes, a codec that is not there or an impossible rate,
    and OSError when the folder cannot be written.
    """
    if not 0 < fps <= 1000:
        raise InputError(f"fps: {fps:g}; allowed: above 0, up to 1000 frames a second")
    path = Path(path)
    encoder = _imageio_ffmpeg() if codec in (None, "h264") else None
    if codec == "h264" and encoder is None:
        raise InputError(f"{path}: H.264 needs imageio-ffmpeg; pip install 'taichi-cloth[video]', or take vp9")
    images = _even(_load(frames))
    first = next(images, None)
    if first is None:
        raise InputError(f"{path}: no frames; pass at least one")
    with in_one_step(path, ".mp4") as part:
        if encoder is not None:
            _write_h264(encoder, str(part), first, images, fps)
        else:
            _write_vp9(str(part), first, images, fps)
    return "vp9" if encoder is None else "h264"


def _write_h264(
    encoder: Any, path: str, first: NDArray[np.uint8], rest: Iterator[NDArray[np.uint8]], fps: float
) -> None:
    height, width = first.shape[:2]
    options = ["-crf", "18", "-preset", "veryfast", "-movflags", "+faststart", "-threads", str(X264_THREADS)]
    options += ["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-colorspace", "bt709"]  # as players assume
    options += ["-color_primaries", "bt709", "-color_trc", "bt709"]
    options += ["-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4"]
    writer = encoder.write_frames(
        path,
        (width, height),
        fps=fps,
        codec="libx264",
        pix_fmt_in="rgb24",
        pix_fmt_out="yuv420p",
        macro_block_size=2,
        ffmpeg_log_level="error",
        output_params=options,
    )
    writer.send(None)
    try:
        writer.send(first.tobytes())
        for image in rest:
            writer.send(image.tobytes())
    finally:
        writer.close()
    if not os.path.getsize(path):
        raise InputError(f"{path}: FFmpeg wrote nothing; try codec vp9")


def _write_vp9(path: str, first: NDArray[np.uint8], rest: Iterator[NDArray[np.uint8]], fps: float) -> None:
    height, width = first.shape[:2]
    with quiet_stderr():
        writer = cv2.VideoWriter(path, cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"vp09"), fps, (width, height))
    if not writer.isOpened():
        raise InputError(f"OpenCV cannot write VP9 here; pip install 'taichi-cloth[video]' for H.264 ({path})")
    try:
        writer.write(np.ascontiguousarray(first[..., ::-1]))
        for image in rest:
            writer.write(np.ascontiguousarray(image[..., ::-1]))
    finally:
        writer.release()


def _load(frames: Iterable[NDArray[np.uint8] | str | Path]) -> Iterator[NDArray[np.uint8]]:
    """The frames as arrays, checked to be of one size."""
    size: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        image = frame if isinstance(frame, np.ndarray) else read_png(frame)
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
            raise InputError(f"frame {number}: {image.dtype} {image.shape}; allowed: uint8 (h, w, 3)")
        size = size or image.shape
        if image.shape != size:
            raise InputError(f"frame {number}: {image.shape}; allowed: {size}, as the first frame")
        yield image.astype(np.uint8, copy=False)


def _even(images: Iterator[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
    """Codecs that halve the colour's resolution need even sizes."""
    for image in images:
        height, width = image.shape[:2]
        yield np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")


def _imageio_ffmpeg() -> Any:
    try:
        module = importlib.import_module("imageio_ffmpeg")
        module.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return None
    return module
