"""A turntable: the same garment from all round, one image a view. Nothing is written to disk here."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .finish import Finish
from .light import Background, Lighting
from .splat import Splatter

__all__ = ["turntable"]


def turntable(
    splatter: Splatter,
    cameras: Iterable[Camera],
    *,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
    background: Background | None = None,
    on_view: Callable[[int], None] | None = None,
) -> Iterator[tuple[int, Camera, NDArray[np.uint8]]]:
    """Render what `splatter` has loaded from each camera; yields (k, camera, image (h, w, 3) 8-bit sRGB).

    cameras: usually from `camera.orbit`. on_view: called with k after view k is drawn, to show progress.
    """
    for k, camera in enumerate(cameras):
        image = splatter.render(camera, lighting=lighting, finish=finish, background=background)
        if on_view is not None:
            on_view(k)
        yield k, camera, image
