"""Who says which colour a thread has. The first that says anything:

- of a garment's panel: its stated order (garment.colours), then the WIF file it names (garment.weaves);
- of the cloth: its stated orders (weave.warp_colours, weave.weft_colours), then the WIF file it names (weave.draft);
- of the yarn: its colour (yarn.colour, weft_yarn.colour), then that of its fibre's kind.

A print (garment.prints) colours what lies under it, whatever the thread.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.weave.colour_order import colour, thread_repeat
from taichi_cloth.weave.draft import Draft

from ..scene.garment_schema import PanelColours
from ..scene.schema import Scene, Weave, YarnSection
from .yarns import fibre_kind, repeat_of

if TYPE_CHECKING:  # loads Taichi, which a plan of what lies still does without
    from taichi_cloth.garment.sewn.weaving import Colours

__all__ = [
    "AMONG", "colour_repeats", "fibre_colour", "outer_colours", "panel_colours", "thread_colours", "woven_light",
    "yarn_colours",
]  # fmt: skip

F32 = NDArray[np.float32]

AMONG = 0.67
"""What a thread of a mesh sends back among black ones, over what it does among its like (`ground.mixing`): as none is
drawn of which it could be measured, as in denim: 0.71 of its warp and 0.64 of its weft on the right side."""


def fibre_colour(scene: Scene) -> F32:
    """Of a fibre that is shown alone, linear (3,): as stated, or its kind's own."""
    stated = scene.fibre.colour
    return np.asarray(fibre_kind(scene).colour, np.float32) if stated is None else colour(stated)


def yarn_colours(scene: Scene) -> tuple[F32, F32]:
    """Of the warp's yarn and the weft's, linear, each (3,)."""
    plain = np.asarray(fibre_kind(scene).colour, np.float32)
    yarn = scene.yarn or YarnSection()
    warp, weft = (
        plain if family.colour is None else colour(family.colour) for family in (yarn, scene.weft_yarn or yarn)
    )
    return warp, weft


def thread_colours(scene: Scene, draft: Draft | None, *, ends: int, picks: int) -> tuple[NDArray, NDArray]:
    """Of every warp end (ends, 3) and weft pick (picks, 3) of a cloth, linear. draft: `draft_of` its weave, if any."""
    brought = (draft.warp_colour, draft.weft_colour) if draft else (None, None)
    warp, weft = (
        np.tile(own, (count, 1)) if order is None else order
        for order, own, count in zip(brought, yarn_colours(scene), (ends, picks), strict=True)
    )
    return warp, weft


def colour_repeats(scene: Scene) -> tuple[F32, F32]:
    """Of the warp and the weft of a cloth, one repeat of each, (n, 3) linear."""
    weave = scene.weave or Weave()
    stated = _orders(weave.draft, weave.warp_colours, weave.weft_colours)
    warp, weft = (own[None] if order is None else order for order, own in zip(stated, yarn_colours(scene), strict=True))
    return warp, weft


def panel_colours(scene: Scene, panels: Iterable[str]) -> "dict[str, Colours]":
    """Thread orders of a garment's panels, by name."""
    from taichi_cloth.garment.sewn.weaving import Colours

    assert scene.garment is not None
    weave = scene.weave or Weave()
    plain = [own[None] for own in yarn_colours(scene)]
    common = _orders(weave.draft, weave.warp_colours, weave.weft_colours)
    out = {}
    for name in panels:
        stated = scene.garment.colours.get(name) or PanelColours()
        own = _orders(scene.garment.weaves.get(name), stated.warp, stated.weft)
        warp, weft = (next(o for o in orders if o is not None) for orders in zip(own, common, plain, strict=True))
        out[name] = Colours(warp, weft)
    return out


def outer_colours(scene: Scene, panels: Iterable[str]) -> dict[str, F32]:
    """What a garment's panels send back outside, linear (3,), by name: warp and weft by how often each lies on top."""
    from taichi_cloth.ground.mixing import sent_back

    assert scene.garment is not None
    common, own = (scene.weave or Weave()).draft, scene.garment.weaves
    out = {}
    for name, threads in panel_colours(scene, panels).items():
        up = repeat_of(own.get(name, common)).warp_up.mean()
        warp, weft = (sent_back(colours) for colours in (threads.warp, threads.weft))
        out[name] = woven_light(up, *((x.mean(axis=0), (x * x).mean(axis=0)) for x in (warp, weft)))
    return out


def woven_light(up: float, warp: tuple[NDArray, NDArray], weft: tuple[NDArray, NDArray]) -> NDArray:
    """What a cloth sends back on the side on which its warp lies on top in a share `up` of its crossings, (..., 3).
    warp, weft: means of what their threads send back among their like, and of its square, (..., 3)."""
    from taichi_cloth.ground.mixing import WHITE

    out, others = 0.0, (weft[0], warp[0])
    for share, (mean, square), other in zip((up, 1.0 - up), (warp, weft), others, strict=True):
        out = out + share * (mean + (1.0 - AMONG) / WHITE * (other * mean - square))  # the mean of `mixing.lit_among`
    return np.asarray(out)


def _orders(draft: str | None, *stated: str | None) -> list[F32 | None]:
    """Of the warp and of the weft: as stated, or as a WIF file has them, (n, 3), or None."""
    brought = repeat_of(draft) if draft is not None else None
    found = (None, None) if brought is None else (brought.warp_colour, brought.weft_colour)
    return [one if order is None else thread_repeat(order) for order, one in zip(stated, found, strict=True)]
