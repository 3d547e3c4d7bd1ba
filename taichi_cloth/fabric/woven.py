"""A fabric from a draft and its yarns: the shortest way from what a weaver states to fibres."""

import numpy as np

from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.layout import Detail, families_of, lay_out
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.cloth_set import fit_set, set_sizes
from taichi_cloth.weave.draft import Draft
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["weave_fabric"]

UNDYED = (0.72, 0.68, 0.60)  # linear


def weave_fabric(
    draft: Draft,
    warp: Yarn,
    weft: Yarn | None = None,
    *,
    ends_per_cm: float | None = None,
    picks_per_cm: float | None = None,
    flattening: float = 1.0,
    detail: Detail | None = None,
) -> Fabric:
    """Weaves a draft from yarns: its blocks, and the templates of their fibres. Needs no Taichi; `Fabric.cloud` does.

    weft: as the warp where None. ends_per_cm, picks_per_cm: the set [1/cm]; None takes the draft's own spacing, or what
    just fits. flattening: of the threads in the cloth, width over thickness. Colours are the draft's, or undyed.

    >>> import taichi_cloth as tc
    >>> fabric = tc.weave_fabric(tc.named_weave("twill-2/2", ends=8, picks=8), tc.Yarn(count_tex=20), ends_per_cm=16)
    >>> fabric.layout.cloth.warp_up.shape
    (8, 8)

    Raises InputError where the threads jam, with the thickness that would fit.
    """
    weft = weft or warp
    per_cm = (ends_per_cm, picks_per_cm)
    for asked in per_cm:
        if asked is not None and not (np.isfinite(asked) and asked > 0):
            raise InputError(f"weave_fabric: {asked!r} threads/cm; allowed: above 0, or None for what just fits")
    diameter, rooms = set_sizes(draft, (warp.woven_diameter, weft.woven_diameter), per_cm, flattening)
    fitted = fit_set(draft.warp_up, rooms, diameter, flattening=flattening, balance=0.5)
    if fitted.thinned < 1.0:
        raise InputError(
            f"weave_fabric: threads of {1e3 * float(diameter[0].max()):.3f} mm (warp) and "
            f"{1e3 * float(diameter[1].max()):.3f} mm (weft) jam at {0.01 / rooms[0].min():.1f} ends/cm and "
            f"{0.01 / rooms[1].min():.1f} picks/cm; they fit at {fitted.thinned:.2f} of that: space them wider"
        )
    shades = tuple(
        np.tile(np.array(UNDYED, np.float32), (count, 1)) if stated is None else stated
        for count, stated in ((draft.ends, draft.warp_colour), (draft.picks, draft.weft_colour))
    )
    families = families_of(fitted.cloth, rooms, (shades[0], shades[1]), (warp, weft), flattening)
    return build_fabric(lay_out(fitted.cloth, *families, detail=detail or Detail()))
