"""Primitives as plain arrays, to be kept on disk."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.primitives import Primitive

__all__ = ["primitives_from", "primitives_to"]

KINDS = ("sphere", "cylinder", "elliptic")


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
