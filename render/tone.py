"""From linear light to the screen: plain sRGB, or a curve that keeps bright highlights from clipping.

srgb     light above 1 is cut off
shoulder unchanged up to 0.84, then 1 - d^2 / (x + d - 0.84) with d = 0.16, channel by channel: the compression of
         highlights of the Khronos PBR Neutral tone mapper (github.com/KhronosGroup/ToneMapping, PBR_Neutral), but
         not that mapper, which first takes up to 0.04 off all channels, compresses by the brightest of the three
         from 0.76 on and leads bright colours towards white
aces     (x (2.51 x + 0.03)) / (x (2.43 x + 0.59) + 0.14) of 0.6 x: K. Narkowicz, "ACES Filmic Tone Mapping Curve",
         knarkowicz.wordpress.com, 6 January 2016; 0.6 x is the film industry's own exposure, as he says there
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .image import linear_to_srgb

__all__ = ["TONES", "WHITE", "Tone", "tone_curve", "tone_inverse", "tone_table"]

Tone = Literal["srgb", "shoulder", "aces"]
TONES: tuple[Tone, ...] = get_args(Tone)

WHITE: dict[Tone, float] = {"srgb": 1.0, "shoulder": 4.0, "aces": 8.0}
"""Brightest light that still differs from what is brighter."""

SHOULDER = 0.84


def tone_curve(tone: Tone, light: ArrayLike) -> NDArray[np.float64]:
    """Display light 0..1, still linear, of scene light."""
    x = np.clip(np.asarray(light, np.float64), 0, WHITE[tone])
    if tone == "shoulder":
        d = 1.0 - SHOULDER
        return np.where(x < SHOULDER, x, 1.0 - d * d / (np.maximum(x, SHOULDER) + d - SHOULDER))
    if tone == "aces":
        x = 0.6 * x
        return np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    return x


def tone_inverse(tone: Tone, shown: ArrayLike) -> NDArray[np.float64]:
    """Scene light that is shown as a given linear display light: so that a backdrop keeps its stated colour."""
    if tone == "srgb":
        return np.asarray(shown, np.float64)
    x = np.linspace(0, WHITE[tone], 100_001)
    return np.interp(np.asarray(shown, np.float64), tone_curve(tone, x), x)


def tone_table(tone: Tone, steps: int) -> NDArray[np.uint8]:
    """8-bit values of steps + 1 evenly spaced values of light from 0 to WHITE[tone]."""
    light = WHITE[tone] * np.arange(steps + 1) / steps
    return (linear_to_srgb(tone_curve(tone, light)) * 255 + 0.5).astype(np.uint8)
