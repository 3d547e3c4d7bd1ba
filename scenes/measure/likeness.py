"""How far a picture is from a reference: brightness, colour, how it lies, and what an eye would see of the difference.

Pictures are linear premultiplied RGBA (h, w, 4); all numbers are of the pixels that both of them cover.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...render.image.image import linear_to_srgb

__all__ = ["DEPTHS", "Likeness", "flip", "likeness", "luminance", "shown_alike"]

F64 = NDArray[np.float64]
COVERED = 0.9
BLUR = 5.0
"""Standard deviation of the blur [px]: what is left is how light lies over threads, not over fibres."""
DEPTHS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
"""Quantiles of openness between which pixels are a bin each, from the interstices to the crowns."""
BRIGHT, SHOWN = 0.95, 0.7
"""The quantile of the reference's luminance that is shown at this share of white."""


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """luminance, colours: ours over the reference's, of their means. blurred: root mean square of the luminances'
    difference, both blurred, over the reference's mean. depths: as colours, bin by bin, (bins, 3). saturation: of our
    mean colour, and of the reference's. flip: mean of the FLIP error, 0 to 1."""

    luminance: float
    colours: tuple[float, float, float]
    blurred: float
    depths: F64
    saturation: tuple[float, float]
    flip: float


def likeness(ours: F64, reference: F64, openness: F64) -> Likeness:
    """openness: of each pixel, (h, w), by which depths are told apart."""
    inside = (ours[..., 3] > COVERED) & (reference[..., 3] > COVERED)
    p, r = ours[inside, :3], reference[inside, :3]
    steps = np.quantile(openness[inside], DEPTHS)
    at = np.clip(np.searchsorted(steps, openness[inside], side="right") - 1, 0, len(DEPTHS) - 2)
    depths = [p[at == k].mean(axis=0) / r[at == k].mean(axis=0) for k in range(len(DEPTHS) - 1)]
    colours = p.mean(axis=0) / r.mean(axis=0)
    apart = _blurred(luminance(ours), inside) - _blurred(luminance(reference), inside)
    mean = luminance(r).mean()
    return Likeness(
        luminance=float(luminance(p).mean() / mean),
        colours=(float(colours[0]), float(colours[1]), float(colours[2])),
        blurred=float(np.sqrt((apart[inside] ** 2).mean()) / mean),
        depths=np.array(depths),
        saturation=(_saturation(p.mean(axis=0)), _saturation(r.mean(axis=0))),
        flip=float(flip(ours, reference)[inside].mean()),
    )


def luminance(rgb: F64) -> F64:
    """Of linear light (…, 3 or more), Rec. 709, shape (…)."""
    return rgb[..., :3] @ np.array([0.2126, 0.7152, 0.0722])


def shown_alike(ours: F64, reference: F64) -> tuple[F64, F64]:
    """Both as sRGB (h, w, 3) at the same exposure, black where one of them is not there."""
    inside = (ours[..., 3] > COVERED) & (reference[..., 3] > COVERED)
    light = SHOWN / np.quantile(luminance(reference)[inside], BRIGHT)
    one, two = (linear_to_srgb(light * picture[..., :3] * inside[..., None]) for picture in (ours, reference))
    return one, two


def flip(ours: F64, reference: F64) -> F64:
    """The difference that is seen when one picture takes the other's place, 0 to 1, (h, w): P. Andersson, J. Nilsson,
    T. Akenine-Moller, M. Oskarsson, K. Astrom, M. Fairchild, "FLIP: a difference evaluator for alternating images",
    PACMCGIT 3(2), 2020, at the distance from the screen that is usual of it. Needs the extra "reference"."""
    import flip_evaluator  # pyright: ignore[reportMissingImports]

    one, two = (picture.astype(np.float32) for picture in shown_alike(ours, reference))
    error, _, _ = flip_evaluator.evaluate(two, one, "LDR", inputsRGB=True, applyMagma=False)
    return np.asarray(error, np.float64).reshape(one.shape[:2])


def _blurred(image: F64, inside: NDArray[np.bool_]) -> F64:
    """The mean of a picture (h, w) around each pixel, of what is inside."""
    weight = cv2.GaussianBlur(inside.astype(np.float64), (0, 0), BLUR)
    return np.asarray(cv2.GaussianBlur(image * inside, (0, 0), BLUR), np.float64) / np.maximum(weight, 1e-6)


def _saturation(rgb: F64) -> float:
    """Of a colour (3,): (max - min) / max."""
    return float((rgb.max() - rgb.min()) / rgb.max())
