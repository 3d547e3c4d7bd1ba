"""Which bone carries which part of a body, and primitives as plain arrays."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives import Primitive
from taichi_cloth.body.skeleton import Skeleton
from taichi_cloth.errors import InputError

__all__ = ["bones_of_parts", "primitives_from", "primitives_to"]

CARRIED = {
    "head": "head", "neck": "neck", "chest": "spine3", "abdomen": "spine1", "pelvis": "pelvis",
    "upper arm": "upper_arm", "lower arm": "forearm", "hand": "hand",
    "upper leg": "thigh", "lower leg": "shin", "foot": "foot",
}  # fmt: skip
KINDS = ("sphere", "cylinder", "elliptic")


def bones_of_parts(names: Sequence[str], skeleton: Skeleton) -> dict[str, int]:
    """Number of the joint that each part moves with. Raises InputError for a part that no bone carries."""
    out = {}
    for name in names:
        side, _, limb = name.partition(" ")
        plain, ending = (limb, f"_{side[0]}") if side in ("left", "right") else (name, "")
        if plain not in CARRIED:
            raise InputError(f"body: no bone carries {name!r}; known parts: {', '.join(CARRIED)}, left and right")
        out[name] = skeleton.index(CARRIED[plain] + ending)
    return out


def primitives_to(primitives: Sequence[Primitive]) -> dict[str, NDArray]:
    """Arrays that `primitives_from` reads."""
    return {
        "kind": np.array([KINDS.index(p.kind) for p in primitives]),
        "start": np.stack([p.start for p in primitives]),
        "end": np.stack([p.end for p in primitives]),
        "radii": np.array([p.radii for p in primitives]),
        "across": np.stack([np.zeros(3) if p.across is None else p.across for p in primitives]),
        "rounding": np.array([p.rounding for p in primitives]),
        "part": np.array([p.part for p in primitives]),
        "bone": np.array([p.bone for p in primitives]),
    }


def primitives_from(arrays: Mapping[str, NDArray]) -> tuple[Primitive, ...]:
    """The primitives of `primitives_to`."""
    out = []
    for k in range(len(arrays["kind"])):
        kind = KINDS[int(arrays["kind"][k])]
        out.append(
            Primitive(
                kind=kind,
                start=arrays["start"][k],
                end=arrays["end"][k],
                radii=(float(arrays["radii"][k, 0]), float(arrays["radii"][k, 1])),
                across=arrays["across"][k] if kind == "elliptic" else None,
                rounding=float(arrays["rounding"][k]),
                part=str(arrays["part"][k]),
                bone=int(arrays["bone"][k]),
            )
        )
    return tuple(out)
