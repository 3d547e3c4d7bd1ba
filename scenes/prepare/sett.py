"""The sett that a scene or its WIF file states, and the cells of key points that hold a whole number of its threads.

Threads are independent of key points: where a sett is stated, the spacing of key points is what adapts. Where none is,
threads follow key points (`threads_per_key_point`).
"""

from dataclasses import dataclass

import numpy as np

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.cloth_set import set_sizes
from taichi_cloth.weave.draft import Draft

from ..scene.schema import FabricSection, Scene
from .weave_layout import yarns_for
from .yarns import repeat_of

__all__ = ["Sett", "on_cells", "sett_of", "spacing_on", "threads_to_a_cell"]

LEAST, MOST = 0.1, 500.0
"""Threads a cm of a cloth that moves."""
WITHIN, FEW = 0.15, 3
"""By how much of it, or by how many, the number of cells along a side may change so that threads fit."""
EXACT = 2e-3
"""A number of threads that is wrong by no more of it, or by one thread, is right."""


@dataclass(frozen=True)
class Sett:
    """ends, picks: threads a metre. draft: the weave's repeat, its threads spaced so that they are that many."""

    ends: float
    picks: float
    draft: Draft


def sett_of(scene: Scene, draft: str | None = None) -> Sett | None:
    """The sett of a moving cloth; None where neither [fabric] nor a WIF file states any. What is stated of the warp
    alone, or of the weft, leaves the other as in a fabric at rest: the draft's own, or what just fits.

    draft: of the repeat, in place of the scene's. Raises InputError as reading it does.
    """
    if scene.weave is None or scene.yarn is None:
        return None
    section = scene.fabric or FabricSection()
    own = repeat_of(scene.weave.draft)
    asked = section.ends_per_cm, section.picks_per_cm
    if asked == (None, None) and own.warp_spacing_m is None and own.weft_spacing_m is None:
        return None
    for key, per_cm in zip(("ends_per_cm", "picks_per_cm"), asked, strict=True):
        _check(key, per_cm)
    yarns = yarns_for(scene, own, section)
    _, rooms = set_sizes(own, (yarns[0].woven_diameter, yarns[1].woven_diameter), asked, section.flattening)
    ends, picks = (len(room) / float(room.sum()) for room in rooms)
    for key, per_m in (("ends_per_cm", ends), ("picks_per_cm", picks)):
        _check(key, 0.01 * per_m)
    return Sett(ends, picks, own if draft is None else repeat_of(draft))


def _check(key: str, per_cm: float | None) -> None:
    """Raises InputError where no cloth that moves has so many."""
    if per_cm is not None and not LEAST <= per_cm <= MOST:
        raise InputError(f"fabric.{key}: {per_cm:.3g} on a cloth; allowed: {LEAST:g} to {MOST:g}")


def on_cells(scene: Scene) -> Scene:
    """A scene of a [cloth] with a sett, its columns and rows such that a whole number of threads fits between key
    points; any other as it is. Raises InputError on what a cloth with a sett cannot have."""
    sett = sett_of(scene) if scene.cloth else None
    if sett is None or scene.cloth is None:
        return scene
    refuse(scene, scene.cloth.follow, "cloth")
    columns = _cells(scene.cloth.width_m, sett.ends, scene.cloth.columns - 1)[0] + 1
    rows = _cells(scene.cloth.length_m, sett.picks, scene.cloth.rows - 1)[0] + 1
    return scene.model_copy(update={"cloth": scene.cloth.model_copy(update={"columns": columns, "rows": rows})})


def refuse(scene: Scene, follow: str, section: str) -> None:
    """Raises InputError on what cloth with a sett cannot have."""
    if follow == "paper":
        raise InputError(
            f'{section}.follow: "paper" has a key point at each crossing; leave fabric.ends_per_cm and '
            'fabric.picks_per_cm out, or take "smooth"'
        )
    if scene.weave is not None and scene.weave.patches:
        raise InputError(
            "weave.patches: not of a cloth whose threads are set by fabric.ends_per_cm, fabric.picks_per_cm or a .wif "
            "file's spacing, which is one repeat of a draft wherever a picture shows it; draw the patches into a .wif "
            "file as large as what repeats, or leave the sett out"
        )


def threads_to_a_cell(scene: Scene, sett: Sett) -> tuple[int, int]:
    """Warp ends and weft picks between neighbouring key points of a [cloth] that `on_cells` gave."""
    cloth = scene.cloth
    assert cloth is not None
    return (
        max(1, round(sett.ends * cloth.width_m / (cloth.columns - 1))),
        max(1, round(sett.picks * cloth.length_m / (cloth.rows - 1))),
    )


def spacing_on(per_m: tuple[float, float], spacing: tuple[float, float]) -> tuple[tuple[float, float], tuple[int, int]]:
    """Key points' spacing near the one wished for [m], along the weft and the warp, that holds whole numbers of warp
    ends and weft picks, so many a metre; and these."""
    whole = tuple(max(1, round(threads * room)) for threads, room in zip(per_m, spacing, strict=True))
    return (whole[0] / per_m[0], whole[1] / per_m[1]), (whole[0], whole[1])


def _cells(length: float, per_m: float, wished: int) -> tuple[int, int]:
    """How many cells a side of a cloth [m] is cut into and threads to each: of numbers near the wished one, the nearest
    that has the sett, or else that whose threads come nearest to it."""
    wanted = length * per_m
    most = max(1, round(wanted))
    room = max(FEW, round(wished * WITHIN))
    low, high = max(2, wished - room), wished + room
    if most < low:  # threads farther apart than key points
        if most < 2:
            raise InputError(
                f"cloth: {100 * length:.3g} cm with {0.01 * per_m:.3g} threads a cm; allowed: 3 threads or more"
            )
        return most, 1
    counts = np.arange(low, min(high, most) + 1)
    threads = np.maximum(1, np.rint(wanted / counts))
    miss = np.maximum(np.abs(counts * threads - wanted), np.maximum(1.0, EXACT * wanted))  # nearer is as good
    best = int(np.lexsort((np.abs(counts - wished), np.rint(2 * miss)))[0])
    return int(counts[best]), int(threads[best])
