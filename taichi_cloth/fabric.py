"""Fabric (paper 2.3 and 3.3): key points at every crossing, and the fibre blocks between them.

P[i, j] is the crossing of weft pick i and warp end j, as in the paper (with the textile use of the words: warp ends
run along the cloth, weft picks across). A weft yarn runs along j, a warp yarn along i. A *block* is the piece of a
yarn between two neighbouring key points; blocks of one kind share a template (`templates.py`).

`lay_out` makes everything that is counted, and no particle: it is what `plan` prints and what a limit refuses.
"""

from dataclasses import dataclass
from math import pi
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.crimp import crossing_heights
from taichi_cloth.errors import InputError, did_you_mean
from taichi_cloth.weave import Draft
from taichi_cloth.yarn import Period, Yarn

__all__ = [
    "BLOCK_BYTES",
    "BODY",
    "END",
    "PARTICLE_BYTES",
    "START",
    "Blocks",
    "Detail",
    "FabricLayout",
    "Frames",
    "Pose",
    "Threads",
    "frames",
    "lay_out",
    "pose_points",
    "required_bytes",
]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
Pose = Literal["flat", "wave", "roll"]

BODY, START, END = 0, 1, 2  # a block between two crossings; the free end before the first; after the last
BLOCK_BYTES = 40  # the records of a block, and what laying them out takes besides
PARTICLE_BYTES = 64  # position, tangent, normal, colour, radius, half length, openness, all float32


@dataclass(frozen=True, kw_only=True)
class Detail:
    """How finely the fabric is drawn; nothing here changes the cloth itself.

    fibres: drawn a ply, at most as many as the yarn has. steps: particles along a fibre in a block.
    variants: different fillings of the same kind of block. fringe: free yarn beyond the last crossing [pitches].
    irregularity: how far threads stray from even spacing, in fractions of it. seed: of everything random.
    """

    fibres: int = 12
    steps: int = 6
    variants: int = 8
    fringe: float = 1.5
    irregularity: float = 0.03
    seed: int = 0


@dataclass(frozen=True)
class Threads:
    """One family of threads (warp ends or weft picks).

    position: (n,) [m] across. diameter: (n,) [m]. colour: (n, 3) float32 linear. yarn: what they are spun of;
    a thread whose diameter differs from the yarn's is that yarn scaled in its section.
    """

    position: F64
    diameter: F64
    colour: F32
    yarn: Yarn

    @property
    def pitch(self) -> float:
        """Mean distance between neighbours [m]; the diameter where there is only one thread."""
        n = len(self.position)
        return float(self.position[-1] - self.position[0]) / (n - 1) if n > 1 else float(self.diameter[0]) * 1.5


@dataclass(frozen=True)
class Blocks:
    """Block records, each array (blocks,).

    key0, key1: int32 flat indices i·ends + j of the key points at its ends; equal for the free end of a yarn.
    thread: int32, warp ends first, then weft picks. kind: int32 row of `FabricLayout.kinds`.
    phase: int32 block of the yarn's period. variant: int32 filling.
    """

    key0: I32
    key1: I32
    thread: I32
    kind: I32
    phase: I32
    variant: I32


@dataclass(frozen=True)
class BlockKinds:
    """The distinct shapes of yarn path, each array (kinds,).

    family: 0 warp, 1 weft. section: BODY, START or END. pitch [m]; z0, z1: height of the yarn's axis at its ends
    [m]; side0, side1: +1 above the crossing thread, −1 below; wrap0, wrap1: radius it wraps the crossing thread
    with [m]; diameter: of the thread [m].
    """

    family: I32
    section: I32
    pitch: F64
    z0: F64
    z1: F64
    side0: I32
    side1: I32
    wrap0: F64
    wrap1: F64
    diameter: F64


@dataclass(frozen=True)
class FabricLayout:
    """Everything about a fabric that can be counted before a particle is made."""

    draft: Draft
    warp: Threads
    weft: Threads
    balance: float
    detail: Detail
    warp_period: Period
    weft_period: Period
    kinds: BlockKinds
    blocks: Blocks

    @property
    def key_points(self) -> int:
        return self.draft.warp_up.size


def required_bytes(ends: int, picks: int, particles_per_block: float) -> int:
    """Bytes to build a fabric of that size, before anything of it is laid out."""
    blocks = ends * (picks + 1) + picks * (ends + 1)
    return int(blocks * (BLOCK_BYTES + particles_per_block * PARTICLE_BYTES))


def lay_out(draft: Draft, warp: Threads, weft: Threads, *, balance: float = 0.5, detail: Detail) -> FabricLayout:
    """Key points and block records of a fabric. Vectorised over blocks; no particle is made."""
    picks, ends = draft.warp_up.shape
    z_warp, z_weft = crossing_heights(draft.warp_up, warp.diameter, weft.diameter, balance)
    rng = np.random.Generator(np.random.Philox(key=detail.seed))
    warp_period = Period.of(warp.yarn, weft.pitch)
    weft_period = Period.of(weft.yarn, warp.pitch)
    flat = np.arange(picks * ends, dtype=np.int32).reshape(picks, ends)
    side = np.where(draft.warp_up, 1, -1).astype(np.int32)
    warp_rows, warp_kinds = _family(
        flat.T, side.T, z_warp.T, warp, weft, family=0, first_thread=0, fringe=detail.fringe > 0
    )
    weft_rows, weft_kinds = _family(
        flat, -side, z_weft, weft, warp, family=1, first_thread=ends, fringe=detail.fringe > 0
    )
    weft_rows["kind"] += len(warp_kinds["pitch"])
    rows = {name: np.concatenate([warp_rows[name], weft_rows[name]]) for name in warp_rows}
    kinds = {name: np.concatenate([warp_kinds[name], weft_kinds[name]]) for name in warp_kinds}
    starts = rng.integers(0, 1 << 30, ends + picks)
    blocks_of = np.where(np.arange(ends + picks) < ends, warp_period.blocks, weft_period.blocks)
    thread = rows["thread"]
    phase = (starts[thread] + rows.pop("along")) % blocks_of[thread]
    variant = rng.integers(0, max(1, detail.variants), len(thread))
    return FabricLayout(
        draft=draft,
        warp=warp,
        weft=weft,
        balance=balance,
        detail=detail,
        warp_period=warp_period,
        weft_period=weft_period,
        kinds=BlockKinds(**kinds),
        blocks=Blocks(phase=phase.astype(np.int32), variant=variant.astype(np.int32), **rows),
    )


def _family(
    flat: I32,
    side: I32,
    z: F64,
    own: Threads,
    other: Threads,
    *,
    family: int,
    first_thread: int,
    fringe: bool,
) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Block records and kinds of one family, with the threads along axis 0 and the crossings along axis 1."""
    threads, crossings = flat.shape
    own_class, own_values = _classes(own.diameter)
    other_class, other_values = _classes(other.diameter)
    gaps = np.diff(other.position)
    gap_class, gap_values = _classes(gaps) if crossings > 1 else (np.zeros(0, np.int64), np.ones(1))
    # A kind is a mixed-radix number of everything that shapes the path; np.unique finds those in use.
    i, j = np.indices((threads, max(0, crossings - 1)))
    parts = [(i.ravel(), j.ravel(), j.ravel() + 1, BODY)]
    if fringe:
        all_threads = np.arange(threads)
        zero = np.zeros(threads, np.int64)
        last = zero + crossings - 1
        parts += [(all_threads, zero, zero, START), (all_threads, last, last, END)]
    thread = np.concatenate([p[0] for p in parts])
    begin = np.concatenate([p[1] for p in parts])
    end = np.concatenate([p[2] for p in parts])
    section = np.concatenate([np.full(len(p[0]), p[3]) for p in parts])
    body = section == BODY
    gap = np.zeros(len(thread), np.int64)
    gap[body] = gap_class[begin[body]]
    columns = [
        (section, 3),
        ((side[thread, begin] > 0).astype(np.int64), 2),
        ((side[thread, end] > 0).astype(np.int64), 2),
        (own_class[thread], len(own_values)),
        (other_class[begin], len(other_values)),
        (other_class[end], len(other_values)),
        (gap, len(gap_values)),
    ]
    code = np.zeros(len(thread), np.int64)
    for values, radix in columns:
        code = code * radix + values
    _, first, kind = np.unique(code, return_index=True, return_inverse=True)
    t, b, e = thread[first], begin[first], end[first]
    wrap = (own.diameter[t, None] + other.diameter[np.stack([b, e], 1)]) / 2
    kinds: dict[str, NDArray] = {
        "family": np.full(len(first), family, np.int32),
        "section": section[first].astype(np.int32),
        "pitch": np.where(section[first] == BODY, gap_values[gap[first]], other.pitch),
        "z0": z[t, b],
        "z1": z[t, e],
        "side0": side[t, b],
        "side1": side[t, e],
        "wrap0": wrap[:, 0],
        "wrap1": wrap[:, 1],
        "diameter": own.diameter[t],
    }
    rows: dict[str, NDArray] = {
        "key0": flat[thread, begin],
        "key1": flat[thread, end],
        "thread": (first_thread + thread).astype(np.int32),
        "kind": kind.ravel().astype(np.int32),
        "along": np.where(section == START, 0, begin),
    }
    return rows, kinds


def _classes(values: F64) -> tuple[NDArray[np.int64], F64]:
    """Equal values (to a micrometre's thousandth) as class numbers, and one value for each class."""
    _, first, inverse = np.unique(np.rint(values * 1e9), return_index=True, return_inverse=True)
    return inverse.ravel().astype(np.int64), values[first]


@dataclass(frozen=True)
class Frames:
    """Unit vectors at each key point, each (picks, ends, 3) float32: along the weft, along the warp, the normal."""

    weft: F32
    warp: F32
    normal: F32


def frames(points: NDArray) -> Frames:
    """Local frames of a grid of key points (picks, ends, 3) [m] by central differences.

    The normal is weft × warp, so that a warp that lies on top is on its side. Where a direction has one thread
    only, it is taken square to the other.
    """
    p = np.asarray(points, np.float64)
    picks, ends = p.shape[:2]
    weft = np.gradient(p, axis=1) if ends > 1 else None
    warp = np.gradient(p, axis=0) if picks > 1 else None
    if weft is None:
        weft = np.cross(warp, [0.0, 1.0, 0.0]) if warp is not None else np.broadcast_to([1.0, 0.0, 0.0], p.shape)
    if warp is None:
        warp = np.cross([0.0, 1.0, 0.0], weft)
    normal = np.cross(weft, warp)
    out = [v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30) for v in (weft, warp, normal)]
    return Frames(*(np.ascontiguousarray(v, np.float32) for v in out))


def pose_points(layout: FabricLayout, pose: Pose = "flat", *, amount: float = 1.0) -> F32:
    """Key points (picks, ends, 3) float32 [m] of the resting fabric, centred, lying in the x–z plane, y up.

    flat: a plane. wave: soft folds along the weft, rising `amount` × 5 % of the width. roll: bent about the warp's
    direction to an arc of `amount` × 90°. Both keep lengths along the yarns.
    """
    if pose not in get_args(Pose):
        raise InputError(
            f"fabric.pose: unknown pose {pose!r}; known: {', '.join(get_args(Pose))}{did_you_mean(pose, get_args(Pose))}"
        )
    x = layout.warp.position - layout.warp.position.mean()
    z = layout.weft.position - layout.weft.position.mean()
    x, z = _stray(layout, x, z)
    width = max(float(np.ptp(x)), 1e-9)
    if pose == "wave":
        bend = 2.0 * pi * 1.25 / width
        tilt = 0.05 * amount * width * bend  # slope of the fold at its steepest
        slope = tilt * np.cos(bend * x + 0.6)
    elif pose == "roll":
        slope = amount * (pi / 2) * x / width
    else:
        slope = np.zeros_like(x)
    angle = slope if pose == "roll" else np.arctan(slope)
    # Walk along the weft: each step keeps its length and takes the direction of the fold there.
    # The straying of picks is left out of the walk: it moves threads in the plane only.
    y = _walk(x, np.sin(angle))
    across = _walk(x, np.cos(angle))
    points = np.empty((*z.shape, 3), np.float32)
    points[..., 0] = across
    points[..., 1] = y - 0.5 * (float(y.min()) + float(y.max()))
    points[..., 2] = -z
    return points


def _walk(x: F64, rate: F64) -> F64:
    """∫ rate dx along the last axis by the trapezoidal rule, centred."""
    steps = np.diff(x, axis=-1) * (rate[..., 1:] + rate[..., :-1]) / 2
    total = np.concatenate([np.zeros((*x.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)
    return total - total[..., -1:] / 2


def _stray(layout: FabricLayout, x: F64, z: F64) -> tuple[F64, F64]:
    """Threads that stray: a constant shift a thread and a slow wander along it, both bounded; (picks, ends) each."""
    picks, ends = layout.draft.warp_up.shape
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
