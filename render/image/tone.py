"""From linear light to the screen: plain sRGB, or a curve that keeps bright highlights from clipping.

srgb     light above 1 is cut off
shoulder unchanged up to 0.84, then 1 - d^2 / (x + d - 0.84) with d = 0.16, channel by channel: our own, after the
         compression of highlights of the next
neutral  the Khronos PBR Neutral tone mapper (github.com/KhronosGroup/ToneMapping, PBR_Neutral, README and
         pbrNeutral.glsl, 2024), all three channels together. With x the least of the three, f = x - 6.25 x^2 below
         0.08 and 0.04 from there on is taken off all, the light that a dielectric reflects; p is the greatest of what
         is left. From k = 0.76 on it becomes p' = 1 - d^2 / (p + d - k), d = 1 - k, the others in proportion, and the
         colour goes the way 1 - 1 / (0.15 (p - p') + 1) towards the grey p'
aces     (x (2.51 x + 0.03)) / (x (2.43 x + 0.59) + 0.14) of 0.6 x: K. Narkowicz, "ACES Filmic Tone Mapping Curve",
         knarkowicz.wordpress.com, 6 January 2016; 0.6 x is the film industry's own exposure, as he says there
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .image import linear_to_srgb

__all__ = ["TONES", "WHITE", "Tone", "tone_curve", "tone_inverse", "tone_table"]

Tone = Literal["srgb", "shoulder", "neutral", "aces"]
TONES: tuple[Tone, ...] = get_args(Tone)

WHITE: dict[Tone, float] = {"srgb": 1.0, "shoulder": 4.0, "neutral": 1.0, "aces": 8.0}
"""Where `tone_table` ends: the brightest light that still differs from what is brighter. That of `neutral` begins
where its three channels have been mapped."""

SHOULDER = 0.84
NEUTRAL_START, NEUTRAL_FADE, NEUTRAL_FOOT, NEUTRAL_TOE = 0.76, 0.15, 0.04, 6.25
"""`neutral`: where compression begins, how fast bright colours lose their hue, what is taken off, and how gently."""
NEUTRAL_WHITE = 0.999
"""Display light that the inverse of `neutral` takes for white, which no light reaches."""


def tone_curve(tone: Tone, light: ArrayLike) -> NDArray[np.float64]:
    """Display light 0..1, still linear, of scene light; for `neutral` of colours (…, 3)."""
    if tone == "neutral":
        return _neutral(np.maximum(np.asarray(light, np.float64), 0.0))
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
    if tone == "neutral":
        return _neutral_inverse(np.clip(np.asarray(shown, np.float64), 0.0, NEUTRAL_WHITE))
    x = np.linspace(0, WHITE[tone], 100_001)
    return np.interp(np.asarray(shown, np.float64), tone_curve(tone, x), x)


def tone_table(tone: Tone, steps: int) -> NDArray[np.uint8]:
    """8-bit values of steps + 1 evenly spaced values of light from 0 to WHITE[tone]."""
    light = WHITE[tone] * np.arange(steps + 1) / steps
    shown = light if tone == "neutral" else tone_curve(tone, light)
    return (linear_to_srgb(shown) * 255 + 0.5).astype(np.uint8)


def _neutral(light: NDArray[np.float64]) -> NDArray[np.float64]:
    least = light.min(axis=-1, keepdims=True)
    toe = least - NEUTRAL_TOE * least**2
    colour = light - np.where(least < 2 * NEUTRAL_FOOT, toe, NEUTRAL_FOOT)
    peak = colour.max(axis=-1, keepdims=True)
    d = 1.0 - NEUTRAL_START
    lower = 1.0 - d * d / (np.maximum(peak, NEUTRAL_START) + d - NEUTRAL_START)
    keep = 1.0 / (NEUTRAL_FADE * (peak - lower) + 1.0)
    bright = lower + keep * (colour * lower / np.maximum(peak, NEUTRAL_START) - lower)
    return np.where(peak < NEUTRAL_START, colour, bright)


def _neutral_inverse(shown: NDArray[np.float64]) -> NDArray[np.float64]:
    """`_neutral` step by step backwards: each step leaves the greatest of the three the greatest. What is shown both
    brighter and purer than any light is (below 0 before the last step) comes from the nearest light there is."""
    lower = shown.max(axis=-1, keepdims=True)
    d = 1.0 - NEUTRAL_START
    peak = d * d / (1.0 - np.maximum(lower, NEUTRAL_START)) - d + NEUTRAL_START
    keep = 1.0 / (NEUTRAL_FADE * (peak - lower) + 1.0)
    bright = (lower + (shown - lower) / keep) * peak / np.maximum(lower, NEUTRAL_START)
    colour = np.maximum(np.where(lower < NEUTRAL_START, shown, bright), 0.0)
    least = colour.min(axis=-1, keepdims=True)
    toe = np.sqrt(least / NEUTRAL_TOE) - least
    return colour + np.where(least < NEUTRAL_FOOT, toe, NEUTRAL_FOOT)
