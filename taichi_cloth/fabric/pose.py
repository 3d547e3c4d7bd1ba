"""Fabric that lies still: its key points in a plane, in folds or in a roll, with threads that stray a little."""

from math import pi
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.layout import FabricLayout
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["Bent", "Pose", "pose_points"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Pose = Literal["flat", "wave", "roll"]
Bent = Literal["weft", "warp"]


def pose_points(layout: FabricLayout, pose: Pose = "flat", *, amount: float = 1.0, bent: Bent = "weft") -> F32:
    """Key points (picks, ends, 3) float32 [m] of the resting fabric, centred, lying in the x–z plane, y up.

    flat: a plane. wave: soft folds, rising `amount` × 5 % of the cloth's extent along the threads that they bend.
    roll: these bent to an arc of `amount` × 90°. Both keep lengths along the yarns. bent: which threads bend.
    """
    for name, value, known in (("pose", pose, get_args(Pose)), ("bent", bent, get_args(Bent))):
        if value not in known:
            raise InputError(f"{name}: unknown {name} {value!r}; known: {', '.join(known)}{did_you_mean(value, known)}")
    x = layout.warp.position - layout.warp.position.mean()
    z = layout.weft.position - layout.weft.position.mean()
    x, z = _stray(layout, x, z)
    # The straying of threads that stay straight is left out of the walk: it moves them in the plane only.
    along = x if bent == "weft" else z.T
    extent = max(float(np.ptp(along)), 1e-9)
    if pose == "wave":
        bend = 2.0 * pi * 1.25 / extent
        tilt = 0.05 * amount * extent * bend  # slope of the fold at its steepest
        slope = tilt * np.cos(bend * along + 0.6)
    elif pose == "roll":
        slope = amount * (pi / 2) * along / extent
    else:
        slope = np.zeros_like(along)
    angle = slope if pose == "roll" else np.arctan(slope)
    # Each step along a thread that bends keeps its length and takes the direction of the fold there.
    y, walked = _walk(along, np.sin(angle)), _walk(along, np.cos(angle))
    x, y, z = (walked, y, z) if bent == "weft" else (x, y.T, walked.T)
    return np.stack([x, y - 0.5 * (float(y.min()) + float(y.max())), -z], axis=-1).astype(np.float32)


def _walk(x: F64, rate: F64) -> F64:
    """∫ rate dx along the last axis by the trapezoidal rule, centred."""
    steps = np.diff(x, axis=-1) * (rate[..., 1:] + rate[..., :-1]) / 2
    total = np.concatenate([np.zeros((*x.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)
    return total - total[..., -1:] / 2


def _stray(layout: FabricLayout, x: F64, z: F64) -> tuple[F64, F64]:
    """Threads that stray: a constant shift a thread and a slow wander along it, both bounded; (picks, ends) each."""
    picks, ends = layout.cloth.warp_up.shape
    amount = layout.detail.irregularity
    rng = np.random.Generator(np.random.Philox(key=[layout.detail.seed, 1]))

    def one(own: F64, other: F64, pitch: float) -> F64:
        n = len(own)
        shift = rng.uniform(-1.0, 1.0, (n, 1)) * 0.5
        wave = rng.uniform(0.5, 1.5, (n, 1)) * 2.0 * pi / max(float(np.ptp(other)), pitch)
        wander = 0.5 * np.sin(wave * other[None, :] + rng.uniform(0.0, 2.0 * pi, (n, 1)))
        return own[:, None] + amount * pitch * (shift + wander)

    xs = one(x, z, layout.warp.pitch).T
    zs = one(z, x, layout.weft.pitch)
    return np.broadcast_to(xs, (picks, ends)), np.broadcast_to(zs, (picks, ends))
