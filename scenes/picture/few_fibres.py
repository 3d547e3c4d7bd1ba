"""What few thick fibres have to be like so that as much is seen of them, and as much light gets to it, as of all.

A drawn fibre that stands for dozens is as open as its middle, of a yarn's hairs a level of few fibres has next to none,
and what is seen of its cloth is not what is seen of all fibres. How far that matters hangs on the yarn and the weave.
So it is looked at: a flat piece is drawn of all its fibres and then of those of each level, from both sides and at two
angles, and the picture tells the mean openness of what is seen of warp and of weft, and how far fibres' directions
spread: a thick one has only one of those that it stands for.
"""

from collections.abc import Callable
from dataclasses import replace
from math import log

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.detail.surfels import guess_of
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.ground.particles import COLOUR, LANES, OPENNESS, TANGENT

from ...render.data.finish import Finish
from ...render.data.light import Lighting
from ...render.splat.splat import Splatter
from ...render.splat.stream import STREAMED
from .flat_piece import SIZE, flat_piece, tilted_camera

__all__ = ["fit_few"]

F64 = NDArray[np.float64]

THREADS, PIXELS = 20, 5.0
"""Threads each way of the piece, and pixels from one to the next where it is seen from above."""
TILTS = 0.4, 0.9
"""Cosines of the angles at which it is seen; how much it covers is asked at the last, as at a flat angle all do."""
ROUNDS, POWER = 3, 0.4
"""Rounds in which a width is found; of fibres wider by a small share, by what power of that light that gets through is
less, as a logarithm, at first."""
WIDEST, OPENER = (0.85, 1.25), (0.3, 2.0)
"""What a width, and a factor of what a fibre does not see of the sky, are kept between."""
SPREAD = 0.6
"""The most that directions are spread by."""
LITTLE = 0.03
"""Of a picture, a family of which no more is seen is left as it is."""
CLEAR = 1e-3
EVEN = Lighting(
    key=1e-9, key_follows_camera=False, fill=1.0, sky=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0), shadows=False,
    occlusion=False,
)  # fmt: skip
"""In which a picture has the colours of its particles."""


def fit_few(cloth: CellCloth, number: int, pitch: tuple[float, float]) -> F64:
    """Of each level of a repeat, (levels, FEW) as of `SheetLook.few`."""
    piece = flat_piece(cloth, number, THREADS, pitch)
    piece.sheets = False
    guess = guess_of(cloth.bank, cloth.repeats)
    splatter, out = Splatter(*SIZE), guess.few[number].astype(np.float64)

    def seen(level: int, side: int, tilt: float) -> F64:
        few = guess.few.copy()
        few[number] = out
        piece.level, piece.look = level, replace(guess, few=few)
        return _seen(splatter, piece, tilt, side)

    want = np.array([[seen(0, side, tilt) for tilt in TILTS] for side in (0, 1)])
    covered = float(want[:, -1, 0].mean())
    for level in range(1, cloth.bank.levels):
        few = out[level]
        _widen(lambda level=level: float(np.mean([seen(level, side, TILTS[-1])[0] for side in (0, 1)])), covered, few)
        have = np.array([[seen(level, side, tilt) for tilt in TILTS] for side in (0, 1)])
        for side in (0, 1):
            for family in (0, 1):
                share, opened = want[side, :, 1 + 2 * family : 3 + 2 * family].mean(axis=0)
                now, now_opened = have[side, :, 1 + 2 * family : 3 + 2 * family].mean(axis=0)
                if min(share, now) > LITTLE:
                    shut = (1.0 - opened / share) / max(1.0 - now_opened / now, CLEAR)
                    few[1 + 2 * side + family] = np.clip(shut, *OPENER)
        # An even chance of so much each way has a third of its square.
        spread = 3.0 * (want[..., 5:] - have[..., 5:]).mean(axis=(0, 1))
        few[5:] = np.minimum(np.sqrt(np.maximum(spread, 0.0)), SPREAD)
    return out


def _widen(cover: Callable[[], float], want: float, few: F64) -> None:
    """Find the width, `few[0]`, with which a level covers as much as wanted."""
    power, before = POWER, None
    for _ in range(ROUNDS):
        deep = log(max(1.0 - cover(), CLEAR)) / log(max(1.0 - want, CLEAR))
        if before is not None and abs(log(few[0] / before[0])) > 1e-3:
            found = log(deep / before[1]) / log(few[0] / before[0])
            power = float(np.clip(found, 0.1, 2.0))
        before = few[0], deep
        few[0] = np.clip(few[0] * deep ** (-1.0 / power), *WIDEST)


def _seen(splatter: Splatter, piece: CellStream, tilt: float, side: int) -> F64:
    """From there: coverage; of warp how much of the picture it is and how much of that times its openness; of weft
    likewise; of what is seen the mean squares of the fibres' directions, out of the cloth and across the thread."""
    camera, where = tilted_camera(piece, tilt, side, PIXELS)
    survey = piece.survey(camera)
    chosen = np.flatnonzero(survey.counts).astype(np.int32)
    laid, total = piece.lay(survey, chosen)
    batch = np.array(laid)
    family = np.zeros(batch.shape[1] * LANES, np.float32)
    family[:total] = piece.numbers(survey, chosen)[1]
    warp, opened = 1.0 - family.reshape(-1, LANES), batch[OPENNESS].copy()
    rises, across = batch[TANGENT + 1] ** 2, np.where(warp > 0, batch[TANGENT], batch[TANGENT + 2]) ** 2
    batch[OPENNESS], means = 1.0, []
    for colours in ((warp, warp * opened, (1.0 - warp) * opened), (rises, across, across)):
        batch[COLOUR : COLOUR + 3] = colours
        splatter.load_blocks(STREAMED, batch, total)
        splatter.render(camera, lighting=EVEN, finish=Finish(sheen=0.0))
        means.append(splatter.linear()[where].mean(axis=0, dtype=np.float64))
    (shown, of_warp, of_weft, cover), (high, wide, *_) = means
    return np.array([cover, shown, of_warp, cover - shown, of_weft, high / cover, wide / cover])
