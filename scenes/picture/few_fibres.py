"""What few thick fibres have to be like so that as much is seen of them, and as much light gets to it, as of all.

A drawn fibre that stands for dozens is as open as its middle, of a yarn's hairs a level of few fibres has next to none,
and what is seen of its cloth is not what is seen of all fibres. How far that matters hangs on the yarn and the weave.
So it is looked at: a flat piece is drawn of all its fibres and then of those of each level, from both sides and at two
angles, and the picture tells the mean openness of what is seen of warp and of weft, and how far fibres' directions
spread: a thick one has only one of those that it stands for.

Each is looked at from where it is drawn. Fibres too small for a pixel are drawn fainter and as wide as one: past the
open ones in front one sees those that they shade, and a picture of them is up to a tenth darker than one from near. So
all fibres are seen from near, and those of each level from as far as it stands for them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.detail.directions import DIRECTIONS, VIEWS, Seen, mended, tables
from taichi_cloth.detail.patches import SPREAD, TONES
from taichi_cloth.detail.surfels import guess_of
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.ground.particles import NORMAL, OPENNESS, TANGENT

from ...render.data.finish import Finish
from ...render.data.light import Lighting
from ...render.splat.shares import shares_seen
from ...render.splat.splat import Splatter
from ...render.splat.stream import STREAMED
from .flat_piece import SIZE, Sight, flat_piece, tilted_camera

__all__ = ["THREADS", "fit_few", "sight_of"]

F64 = NDArray[np.float64]

THREADS = 20
"""Each way of the piece."""
NEAR, OWN = 0.5, 0.4
"""Radius [px] of the finest fibres where all of them are seen, and of a level's where that is: amid the sizes at which
it is drawn (see `detail.cell_stream`)."""
LARGEST = 48.0
"""Pixels from thread to thread, at most."""
ACROSS = 5.0
"""Pixels from thread to thread of a picture of `SIZE`."""
ABOVE = 0.8, 1.0
"""Cosines of the angles at which it is seen how much a level covers."""
ROUNDS, POWER = 3, 0.4
"""Rounds in which a width is found; of fibres wider by a small share, by what power of that light that gets through is
less, as a logarithm, at first."""
WIDEST, OPENER = (0.85, 1.5), (0.3, 2.0)
"""What a width, and a factor of what a fibre does not see of the sky, are kept between."""
TURNS = 3
"""Turns in which directions are found: what is seen hangs on them."""
LITTLE = 0.03
"""Of a picture, a family of which no more is seen is left as it is."""
CLEAR = 1e-3
EVEN = Lighting(
    key=1e-9, key_follows_camera=False, fill=1.0, sky=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0), shadows=False,
    occlusion=False,
)  # fmt: skip
"""In which a picture has the colours of its particles."""


def sight_of(cloth: CellCloth, level: int, pitch: tuple[float, float]) -> Sight:
    """From how far a level of a cloth is looked at, the same part of a piece whichever it is."""
    wide = (NEAR if level == 0 else OWN) / float(cloth.bank.radius[level]) * sqrt(pitch[0] * pitch[1])
    pixels = min(wide, LARGEST)
    return Sight(pixels, (round(SIZE[0] * pixels / ACROSS), round(SIZE[1] * pixels / ACROSS)))


def fit_few(cloth: CellCloth, number: int, pitch: tuple[float, float]) -> F64:
    """Of each level of a repeat, (levels, FEW) as of `SheetLook.few`."""
    piece = flat_piece(cloth, number, THREADS, pitch)
    piece.sheets = False
    guess = guess_of(cloth.bank, cloth.repeats)
    out = guess.few[number].astype(np.float64)
    sights = [sight_of(cloth, level, pitch) for level in range(cloth.bank.levels)]
    eyes = [_Eye(Splatter(*sight.size), sight) for sight in sights]

    def laid(level: int) -> CellStream:
        few = guess.few.copy()
        few[number] = out
        piece.level, piece.look = level, replace(guess, few=few)
        return piece

    def seen(level: int) -> list[_Family]:
        """At a flat angle and from nearly above: of the right side and of the wrong one warp and weft."""
        return [
            family
            for tilt, side in product(VIEWS, (0, 1))
            for family in _seen(eyes[level], laid(level), tilt, side)
        ]  # fmt: skip

    def covered(level: int) -> float:
        return float(np.mean([_covered(eyes[level], laid(level), tilt, side) for tilt, side in product(ABOVE, (0, 1))]))

    want, cover = seen(0), covered(0)
    for level in range(1, cloth.bank.levels):
        few, rng = out[level], np.random.default_rng(level)
        shut, turned = few[1:TONES], few[SPREAD:].reshape(-1, DIRECTIONS)
        _widen(lambda level=level: covered(level), cover, few)
        for turn in range(TURNS):
            for k, (have, wanted) in enumerate(zip(seen(level), want, strict=True)):
                if min(wanted.share, have.share) > LITTLE:
                    more = (1.0 - wanted.opened) / max(1.0 - have.opened, CLEAR)
                    shut[k] = np.clip(shut[k] * more, *OPENER)
                    there, there_should = have.directions, wanted.directions
                    turned[k] = mended(turned[k], there, there_should) if turn else tables(there, there_should, rng)
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


class _Eye(NamedTuple):
    """What draws a level as it is looked at."""

    splatter: Splatter
    sight: Sight


@dataclass(frozen=True)
class _Family:
    """What is seen of warp or weft. share: of the picture; opened: mean openness; directions: of its fibres, but for
    hairs, as `tables` takes them."""

    share: float
    opened: float
    directions: Seen


def _drawn(eye: _Eye, piece: CellStream, tilt: float, side: int) -> Any:
    """A piece is drawn from there: the camera, which pixels show its inner part, its particles, each one's family."""
    camera, where = tilted_camera(piece, tilt, side, eye.sight)
    survey = piece.survey(camera)
    chosen = np.flatnonzero(survey.counts).astype(np.int32)
    family = piece.numbers(survey, chosen)[1]
    batch, total = piece.lay(survey, chosen)
    eye.splatter.load_blocks(STREAMED, batch, total)
    eye.splatter.render(camera, lighting=EVEN, finish=Finish(sheen=0.0))
    return camera, where, batch.reshape(len(batch), -1)[:, :total], family


def _covered(eye: _Eye, piece: CellStream, tilt: float, side: int) -> float:
    """How much of the picture a piece covers from there."""
    _, where, *_ = _drawn(eye, piece, tilt, side)
    return float(eye.splatter.linear()[where][:, 3].mean(dtype=np.float64))


def _seen(eye: _Eye, piece: CellStream, tilt: float, side: int) -> tuple[_Family, _Family]:
    """Warp and weft, from there."""
    camera, where, batch, family = _drawn(eye, piece, tilt, side)
    share = shares_seen(eye.splatter, where)[: len(family)] / np.count_nonzero(where)
    there = share > 0.0
    family, share, batch = family[there], share[there], batch[:, there].astype(np.float64)
    # In the threads' frames: a warp end goes along -z, a weft pick along x, the cloth's normal is y.
    tangent, normal = batch[TANGENT : TANGENT + 3], batch[NORMAL : NORMAL + 3]
    along, aside = np.where(family == 0, -tangent[[2, 0]], tangent[[0, 2]] * [[1.0], [-1.0]])
    way = np.sign(along)
    to_eye = np.where(family == 0, *np.sign(camera.forward[[2, 0]] * (1.0, -1.0)))
    ahead = to_eye * np.where(family == 0, -normal[2], normal[0])
    seen = to_eye * way * tangent[1], way * aside, ahead, normal[1], share
    core, out = batch[OPENNESS] < 1.0, []
    for k in (0, 1):
        of = family == k
        total = float(share[of].sum())
        opened = float(share[of] @ batch[OPENNESS, of]) / max(total, 1e-9)
        of &= core
        out.append(_Family(total, opened, Seen(*(one[of] for one in seen))))
    return out[0], out[1]
