"""How a cloth looks as the sheet it is: measured on its fibres, from both sides and several angles, and kept on disk.

A flat piece is drawn of all its fibres, the warp red and the weft green and both of them blue, so that one picture
tells how bright it is where it is all of one colour, and what of that goes where its warp is dark, or its weft. As a
sheet it must cover as much and be as bright.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from math import asin, cos, degrees, log, pi, sin

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.detail.directions import VIEWS
from taichi_cloth.detail.patches import TONES
from taichi_cloth.detail.surfels import (
    AREA,
    FLANKS,
    OPEN_WARP,
    OPEN_WEFT,
    TILTS,
    TO_EYE,
    TURNED,
    WARP,
    WEFT,
    SheetLook,
    guess_of,
)
from taichi_cloth.fabric.cell_blocks import OPENED
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.ground.cache import digest, kept

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera
from ...render.data.finish import Finish
from ...render.data.light import KeyLight, Lighting
from ...render.light.view import surface_share
from ...render.splat.splat import Splatter
from ...render.splat.stream import STREAMED
from .few_fibres import THREADS, fit_few, sight_of
from .flat_light import FlatLight
from .flat_piece import SIZE, Sight, flat_camera, flat_piece, tilted_camera

__all__ = ["fit_look", "seen_light"]

F64 = NDArray[np.float64]

VERSION = 34
"""Of what is kept on disk: raised whenever the same cloth would come to another look."""
FIBRES, SHEETS = 60, (240, Sight(0.6))
"""Threads each way of the piece that is drawn of fibres, and of that drawn as a sheet, and how large that is; at a flat
angle larger, so that its picture is not much smaller."""
LIT, LIT_TILTS, LEAST = (20, Sight(5.0)), (0.4, 0.9), 0.3
"""Likewise of one that casts its own light, to tell what threads send back alone; the cosines of the angles at which it
is seen; of what it is about, the least that there is."""
ROUNDS, STEADY = 5, 3e-3
"""Rounds in which factors are found, at most, and by how much of itself none changes any more before."""
SKY = 0.4
"""How much of the light comes from the sky before the cloth, beside 1 from lights."""
LITTLE = 0.01
"""Light of warp or weft, and a factor of it, of which less is no matter: of a family that is not seen from one side."""
OPENS, LEAST_OPEN = [OPEN_WARP, OPEN_WEFT], (0.1, 1.0)
"""An openness that is less, or more, is taken for that."""
PALE = 0.6
"""Colour of the family that is pale where the other is dark."""
CLEAR = 1e-3
"""Of light that passes through, less is taken for as much."""
AROUND = ((0.0, 1.0, 0.0, 0.3), *((0.8 * cos(2 * pi * k / 5), 0.6, 0.8 * sin(2 * pi * k / 5), 0.2) for k in range(5)))
"""Directions and intensities of lights above the cloth and round it: a look is a mean over how light falls."""
NARROW = 16.0
"""Half width of highlights [degrees], over which it goes how many times as many sides lights come from: of silk's, of
4 degrees, five sides hit or miss a float's by chance."""
WHITE, BLACK, UNSEEN = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), 1e-9
"""UNSEEN: of a light that is there only so that all pictures are drawn by the same kernel."""


def _lighting(side: int, lights: float, sky: float, turn: float = 0.0) -> Lighting:
    """So much of the lights before the right side (0) or the wrong one (1), all at once, turned round the cloth's
    normal [rad], and of the sky there, with nothing behind: what is there is mostly dark, a body, or other layers."""
    up, c, s = 1.0 - 2.0 * side, cos(turn), sin(turn)
    (way, key), *others = (((c * x - s * z, up * y, s * x + c * z), strength) for x, y, z, strength in AROUND)
    return Lighting(
        direction=way, key=max(lights * key, UNSEEN), key_colour=WHITE, key_follows_camera=False,
        fill=sky, sky=BLACK if side else WHITE, ground=WHITE if side else BLACK, shadows=True, occlusion=True,
        others=tuple(
            KeyLight(direction=way, intensity=max(lights * strength, UNSEEN), colour=WHITE,
                     follows_camera=False, casts_shadow=True)
            for way, strength in others
        ),
    )  # fmt: skip


def fit_look(source: CellStream, finish: Finish) -> SheetLook:
    """The look of the sheets of a cloth whose fibres have that finish."""
    cloth = source.cloth
    guess = guess_of(cloth.bank, cloth.repeats)
    bank = cloth.bank
    parts = bank.particle, bank.start, bank.first, bank.phases, [(one.kind, *one.ahead) for one in cloth.repeats]
    dyed = bool((cloth.threads.colour != cloth.threads.colour[0]).any())  # else nobody asks what one sends back alone
    made_of = digest(VERSION, FLANKS, TO_EYE, TURNED, finish, guess, source.pitch, dyed, *parts)

    def make() -> dict[str, NDArray]:
        repeats = range(len(cloth.repeats))
        few = np.stack([fit_few(cloth, number, source.pitch) for number in repeats]).astype(np.float32)
        for number in repeats:
            _tone(cloth, number, source.pitch, replace(guess, few=few), finish)
        start = replace(guess, few=few)
        every = [_measured(cloth, number, source.pitch, start, finish) for number in repeats]
        alone = guess.alone
        if dyed:
            of_repeat = [_alone(cloth, number, source.pitch, finish) for number in repeats]
            alone = np.stack(of_repeat).astype(np.float32)
            look = SheetLook(np.stack(every).astype(np.float32), guess.lean, alone, few)
            every = [_opened(cloth, number, source.pitch, look, finish) for number in repeats]
        return {"factor": np.stack(every).astype(np.float32), "alone": alone, "few": few}

    found = kept("sheet", made_of, make)[0]
    return SheetLook(found["factor"], guess.lean, found["alone"], found["few"])


def _tone(cloth: CellCloth, number: int, pitch: tuple[float, float], look: SheetLook, finish: Finish) -> None:
    """Find what colours of each level of few fibres are taken times, in the look's `few`, so that warp and weft send
    back as much as all fibres do, in the mean over how light falls: from level to level a little more or less is seen
    of each, and in few of them nothing of a yarn's hairs. A hundredth of the picture is a tenth of a denim's weft."""
    piece, found = flat_piece(cloth, number, THREADS, pitch, dark=surface_share(finish)), []
    piece.sheets, piece.look = False, look
    for piece.level in range(cloth.bank.levels):
        sight = sight_of(cloth, piece.level, pitch)
        splatter = Splatter(*sight.size)
        cameras = [tilted_camera(piece, tilt, side, sight) for tilt, side in product(VIEWS, (0, 1))]
        found.append([_shared(_seen(splatter, piece, *camera, finish, (1.0, SKY))[0]) for camera in cameras])
    tones = look.few[number, :, TONES : TONES + 2 * len(found[0])]
    tones[1:] = ((np.array(found[0]) + LITTLE) / (np.array(found[1:]) + LITTLE)).reshape(len(found) - 1, -1)


def _alone(cloth: CellCloth, number: int, pitch: tuple[float, float], finish: Finish) -> F64:
    """What warp and weft of a repeat send back where all round them is black, over what they do where it is of their
    colour, (4,) as `SheetLook.alone`: in maps of light that show its threads, the mean over how light falls and from
    where it is seen."""
    piece = flat_piece(cloth, number, LIT[0], pitch, dark=surface_share(finish))
    splatter, out = Splatter(*SIZE), []
    splatter.load(ParticleBlocks(piece.sample(np.inf, level=min(1, cloth.bank.levels - 1))))
    for side in (0, 1):
        seen = np.zeros((2, 2))  # as always, and alone; of warp and of weft
        for camera, where in (tilted_camera(piece, tilt, side, LIT[1]) for tilt in LIT_TILTS):
            for k in (0, 1):
                splatter.render(camera, lighting=_lighting(side, 1.0, SKY), finish=replace(finish, alone=float(k)))
                red, green, blue, _ = splatter.linear()[where].mean(axis=0, dtype=np.float64)
                seen[k] += blue - green, blue - red
        out += np.clip(seen[1] / np.maximum(seen[0], 1e-9), LEAST, 1.0).tolist()
    return np.array(out)


def _both(
    cloth: CellCloth,
    number: int,
    pitch: tuple[float, float],
    look: SheetLook,
    dark: float,
    probe: NDArray | None = None,
) -> tuple[CellStream, CellStream]:
    """Flat pieces with a look: of the coarsest fibres, which are what the sheet fades into, and as a sheet, with
    factors of its own to change. dark, probe: see `flat_piece`."""
    fibres, sheet = (flat_piece(cloth, number, n, pitch, dark=dark, probe=probe) for n in (FIBRES, SHEETS[0]))
    fibres.level, fibres.sheets, fibres.look = cloth.bank.levels - 1, False, look
    sheet.look = replace(look, factor=look.factor.copy())
    return fibres, sheet


def _measured(cloth: CellCloth, number: int, pitch: tuple[float, float], guess: SheetLook, finish: Finish) -> F64:
    """The factors of a repeat, (2, TILTS, 5)."""
    sight, splatter = sight_of(cloth, cloth.bank.levels - 1, pitch), Splatter(*SIZE)
    near = Splatter(*sight.size)
    fibres, sheet = _both(cloth, number, pitch, guess, surface_share(finish))
    out = guess.factor[number].astype(np.float64)

    def got(now: F64, side: int, elevation: float) -> F64:
        sheet.look.factor[number, side] = now  # seen so, all of it is at this angle
        return seen_light(splatter, sheet, *flat_camera(sheet, elevation, SHEETS[1]), finish)

    for side in (0, 1):
        for t, tilt in enumerate(TILTS):
            elevation = degrees(asin(tilt)) * (1 - 2 * side)
            want = seen_light(near, fibres, *tilted_camera(fibres, tilt, side, sight), finish)
            start = out[side, max(t - 1, 0)].copy()
            out[side, t] = _solved(lambda now, at=(side, elevation): got(now, *at), want, start)
    return out


def _solved(got: Callable[[F64], F64], want: F64, start: F64) -> F64:
    """The factors with which a sheet looks as wanted (see `seen_light`): each hangs mostly on one. Where its
    openness alone cannot tell how far the sky counts, warp and weft are right for both together."""
    now = start.copy()
    for _ in range(ROUNDS):
        have, before = np.maximum(got(now), 1e-6), now.copy()
        now[AREA] *= log(max(1 - want[0], CLEAR)) / log(min(max(1 - have[0], CLEAR), 1 - CLEAR))
        lights, sky = (want[k].sum() / have[k].sum() for k in (slice(1, 3), slice(3, 5)))
        ratio = (want[1:3] + SKY * want[3:] + LITTLE) / (have[1:3] + SKY * have[3:] + LITTLE)
        now[[WARP, WEFT]] = np.maximum(now[[WARP, WEFT]] * ratio, LITTLE)
        now[OPENS] = np.clip(now[OPENS] * sky / lights, *LEAST_OPEN)
        if np.abs(now / before - 1.0).max() < STEADY:
            break
    return now


def _opened(cloth: CellCloth, number: int, pitch: tuple[float, float], look: SheetLook, finish: Finish) -> F64:
    """The factors of a repeat (2, TILTS, 5) with an openness for each family: of that of which less is seen, what it
    takes where it alone is pale, for threads of which little is seen lie deep and the others hide the sky from them; of
    the other, what leaves a cloth all of one colour as it is."""
    dark, out = surface_share(finish), look.factor[number].astype(np.float64)
    sight = sight_of(cloth, cloth.bank.levels - 1, pitch)
    splatter, near = Splatter(*SIZE), Splatter(*sight.size)

    def sent_back(splatter: Splatter, source: CellStream, camera: Camera, where: NDArray[np.bool_]) -> float:
        return float(_seen(splatter, source, camera, where, finish, (1.0, SKY))[0][0])

    for side in (0, 1):
        few = int(out[side, -1, [WARP, WEFT]].argmin())
        probe = np.full((2, 3), dark)
        probe[few] = PALE
        fibres, sheet = _both(cloth, number, pitch, look, dark, probe)
        for t, tilt in enumerate(TILTS):
            want = sent_back(near, fibres, *tilted_camera(fibres, tilt, side, sight))
            now, camera = out[side, t], flat_camera(sheet, degrees(asin(tilt)) * (1 - 2 * side), SHEETS[1])
            share = now[WARP + few] / (now[WARP] + now[WEFT])
            for _ in range(ROUNDS):
                sheet.look.factor[number, side] = now
                ratio = want / max(sent_back(splatter, sheet, *camera), 1e-6)
                before = now[OPENS[few]]
                now[OPENS[few]] = np.clip(before * ratio**OPENED, *LEAST_OPEN)
                more = now[OPENS[1 - few]] + share / (1.0 - share) * (before - now[OPENS[few]])
                now[OPENS[1 - few]] = np.clip(more, *LEAST_OPEN)
                if abs(now[OPENS[few]] / before - 1.0) < STEADY:
                    break
    return out


def seen_light(
    splatter: Splatter,
    source: CellStream,
    camera: Camera,
    where: NDArray[np.bool_],
    finish: Finish,
) -> F64:
    """Coverage; of lights all round, what comes by warp and by weft where both are white; of the sky before the cloth,
    likewise: means of those pixels. In the light that maps of a whole garment tell of (`FlatLight`)."""
    lights, sky = _seen(splatter, source, camera, where, finish, (1.0, 0.0), (0.0, 1.0))
    return np.array([sky[3], *_shared(lights), *_shared(sky)])


def _seen(
    splatter: Splatter,
    source: CellStream,
    camera: Camera,
    where: NDArray[np.bool_],
    finish: Finish,
    *lit: tuple[float, float],
) -> list[F64]:
    """Linear colour and coverage, (4,), for each pair of how much there is of the lights and of the sky; of fibres with
    narrow highlights the mean over lights from so many more sides."""
    side = int(camera.forward[1] > 0)
    seen = source.survey(camera)
    splatter.load_blocks(STREAMED, *source.lay(seen, np.flatnonzero(seen.counts).astype(np.int32)))
    splatter.light.hold(FlatLight(1.0 - 2.0 * side, len(AROUND)), each=True)
    means = []
    narrow = max(1, int(NARROW / finish.spread))
    for lights, sky in lit:
        turns = 2 * pi / 5 * np.arange(narrow if lights else 1) / narrow
        of_turns = []
        for turn in turns:
            splatter.render(camera, lighting=_lighting(side, lights, sky, turn), finish=finish)
            of_turns.append(splatter.linear()[where].mean(axis=0, dtype=np.float64))
        means.append(np.mean(of_turns, axis=0))
    splatter.light.hold(None)
    return means


def _shared(light: F64) -> F64:
    """Of what is seen where all is of one colour, blue, what comes by warp and by weft: as they are missed where they
    are dark, green and red."""
    red, green, blue = np.maximum(light[:3], 0.0)
    missed = np.array([blue - green, blue - red])
    return blue * missed / max(missed.sum(), 1e-9)
