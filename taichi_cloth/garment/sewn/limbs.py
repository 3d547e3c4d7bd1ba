"""Which limbs a garment's panels meet: cloth between an arm and the chest is held by one of them, not torn by both.

A body is five limbs: the trunk with neck and head, two arms, two legs. A panel is *of* the limbs that enough of it lies
nearest to where the garment rests: a shirt's front of the trunk, a sleeve of its arm, half a pair of trousers of a leg
and the trunk. A panel of the trunk that hangs below it meets both legs as well. Of another limb a key point meets what
it lies on at rest, as a front the shoulder under it.

Where the two face each other there is a fold, the armpit or the crotch. On a body at rest a key point near both meets
both in the armpit of an arm without a sleeve, and comes to lie where that is wide enough; else, as where a sleeve lies
in the fold, too, or between thighs, it meets the nearer. A limb that moves closes the fold: cloth that both keep out
has nowhere to go, and as each rubs it along its own way it is torn. So once the body moves it meets the limb of its own
panel alone, and deep in the fold neither: cloth slips into it, which hides it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.garment.pattern.cut import Atlas

__all__ = ["LIMBS", "bearer", "limb_of_bones", "spared"]

F64 = NDArray[np.float64]

LIMBS = {
    "trunk": ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "clavicle_l", "clavicle_r"),
    "arm_l": ("upper_arm_l", "forearm_l", "hand_l"),
    "arm_r": ("upper_arm_r", "forearm_r", "hand_r"),
    "leg_l": ("thigh_l", "shin_l", "foot_l"),
    "leg_r": ("thigh_r", "shin_r", "foot_r"),
}
SHARE = 0.2
"""Of a panel's key points that lie nearest to a limb that the panel is of."""
ABOVE_LEGS = 0.05
"""The same of the trunk, of one that is of a leg: thighs reach up into the hips, and most of trousers is below."""
CLOSE = 0.02
"""From a limb of another panel at which a key point still rests on it, and at rest meets it in a fold, too [m]."""
ABOVE = 0.06
"""The same while the garment is sewn and may yet come down on it [m]."""
FACING = 0.5
"""Cosine between the normals of two surfaces below which there is a fold between them."""
NEARER = 0.005
"""By which a limb of another panel has to be nearer, in a fold that is closed at rest, to be met instead [m]."""

FOLD, HIDDEN = 0.075, 0.05
"""From both of two limbs with a fold between them, at rest, within which cloth in motion meets its own alone, and
within which it hides in the fold [m]. Hidden farther out, an arm that comes down shows through the front of its sleeve;
within 40 mm alone, the paper's T-shirt has threads of 3.5 % and twice the sweeps, within 25 mm any has 5 %."""


def limb_of_bones() -> tuple[int, ...]:
    """Of each bone the number of its limb in LIMBS, or one of its own."""
    of = {name: number for number, names in enumerate(LIMBS.values()) for name in names}
    return tuple(of.get(name, len(LIMBS) + k) for k, name in enumerate(JOINTS))


def bearer(places: NDArray, primitives: Sequence[Primitive]) -> int:
    """The bone that carries what is held at places (n, 3) on the body at rest [m]: that whose part most of them lie on.

    Carried by another, as a waistband by the pelvis, they would be moved into the waist, which keeps cloth out, as it
    turns, and threads between the two drawn long.
    """
    _, _, nearest = nearest_distance(primitives, places)
    return int(np.bincount([primitives[k].bone for k in nearest]).argmax())


def spared(atlas: Atlas, positions: NDArray, primitives: Sequence[Primitive], *, moving: bool) -> NDArray[np.int32]:
    """(rows, cols): for each key point bits 1 << bone of the bones that it does not meet.

    positions: of the garment at rest on the body at rest (rows, cols, 3) [m]. moving: whether the body moves
    from there.
    """
    present, owner = atlas.present(), atlas.owner()
    points = np.asarray(positions, np.float64)[present]
    bones = [[JOINTS.index(name) for name in names] for names in LIMBS.values()]
    distance = np.full((len(LIMBS), len(points)), np.inf)
    normal = np.zeros((len(LIMBS), len(points), 3))
    for k, own in enumerate(bones):
        of_limb = [p for p in primitives if p.bone in own]
        if of_limb:
            distance[k], normal[k], _ = nearest_distance(of_limb, points)
    nearest = distance.argmin(axis=0)
    trunk, legs = list(LIMBS).index("trunk"), [list(LIMBS).index(f"leg_{side}") for side in "lr"]
    meets = np.zeros((len(LIMBS), len(points)), bool)
    counts = [np.bincount(nearest[owner[present] == k], minlength=len(LIMBS)) for k in range(len(atlas.panels))]
    bare = [name.startswith("arm") and all(2 * c[k] < max(c.sum(), 1) for c in counts) for k, name in enumerate(LIMBS)]
    for number, count in enumerate(counts):
        mine = owner[present] == number
        of = count >= SHARE * mine.sum()
        of[trunk] |= of[legs].any() and count[trunk] >= ABOVE_LEGS * mine.sum()
        if of[trunk] and not of[legs].any():
            of[legs] = True
        meets[:, mine] = _met(distance[:, mine], normal[:, mine], of, np.array(bare), moving)
    bits = np.array([sum(1 << bone for bone in own) for own in bones], np.int32)
    out = np.zeros(atlas.shape, np.int32)
    out[present] = (~meets * bits[:, None]).sum(axis=0)
    return out


def _met(distance: F64, normal: F64, of: NDArray[np.bool_], bare: NDArray[np.bool_], moving: bool) -> NDArray[np.bool_]:
    """(limbs, n): what points of a panel meet that is `of` some limbs (limbs,), by their distance from each (limbs, n)
    and the normals there (limbs, n, 3). bare: which limbs are arms without sleeves (limbs,)."""
    points = np.arange(distance.shape[1])
    own = np.flatnonzero(of)[distance[of].argmin(axis=0)]
    along = np.einsum("kna,na->kn", normal, normal[own, points])
    other = (distance < (CLOSE if moving else ABOVE)) & ~of[:, None]
    out = of[:, None] | (other & (along > FACING))
    fold = np.where(~of[:, None] & (along <= FACING), distance, np.inf)
    across, there = fold.min(axis=0), fold.argmin(axis=0)
    if moving:
        within = np.maximum(across, distance[own, points])
        out[:, within < FOLD] = False
        mine = (within < FOLD) & (within >= HIDDEN)
        out[own[mine], points[mine]] = True
    else:
        near = across < CLOSE
        armpit = near & (own == list(LIMBS).index("trunk")) & bare[there]
        nearer = near & ~armpit & (across < distance[own, points] - NEARER)  # thighs touch, armpits open downwards
        out[:, nearer] = False
        also = nearer | armpit
        out[there[also], points[also]] = True
    return out
