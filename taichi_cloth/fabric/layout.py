"""What a fabric is laid out of (paper 2.3 and 3.3): key points at every crossing, and the fibre blocks between them.

P[i, j] is the crossing of weft pick i and warp end j, as in the paper (with the textile use of the words: warp ends
run along the cloth, weft picks across). A weft yarn runs along j, a warp yarn along i. A *block* is the piece of a
yarn between two neighbouring key points; blocks of one kind share a template (`templates.py`).

`lay_out` makes everything that is counted, and no particle: it is what `plan` prints and what a limit refuses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.particles import ROWS
from taichi_cloth.weave.cloth_facts import cloth_facts
from taichi_cloth.weave.crimp import Interlacing, PathKinds, crossing_heights, path_kinds
from taichi_cloth.yarn.spin import Period
from taichi_cloth.yarn.unevenness import thick_places, uneven_row
from taichi_cloth.yarn.yarn import CLOSEST_PACKING, Yarn

__all__ = [
    "BLOCK_BYTES",
    "BODY",
    "END",
    "PARTICLE_BYTES",
    "START",
    "Blocks",
    "Detail",
    "FabricLayout",
    "Threads",
    "drawn_density",
    "drawn_tex",
    "families_of",
    "lay_out",
    "required_bytes",
]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

BODY, START, END = 0, 1, 2  # a block between two crossings; the free end before the first; after the last
BLOCK_BYTES = 48  # the records of a block, and what laying them out takes besides
FLOATING = 1.6
"""Width over thickness of floats in a cloth that is set closer than its threads are wide, at least: nothing binds them,
and finishing presses them flat."""
ALIKE = 1e-6
"""Share of a width below which a thread is as wide as another."""
PARTICLE_BYTES = 4 * (ROWS + 1)  # its record, and the number of its thread


@dataclass(frozen=True, kw_only=True)
class Detail:
    """How finely the fabric is drawn; nothing here changes the cloth itself.

    fibres: drawn a ply, at most as many as the yarn has. steps: particles along a fibre in a block.
    variants: different fillings of the same kind of block. fringe: free yarn beyond the last crossing [pitches].
    irregularity: how far threads stray from even spacing, in fractions of it. seed: of everything random.
    hairs_each: real hairs that each drawn one stands for, as many times as wide. far: nobody tells one fibre from
    another, so that pieces may lean from their course as those do that they stand for: steps of the many; 0 where each
    fibre is seen.
    """

    fibres: int = 12
    steps: int = 6
    variants: int = 8
    fringe: float = 1.5
    irregularity: float = 0.03
    seed: int = 0
    hairs_each: int = 1
    far: int = 0


@dataclass(frozen=True)
class Threads:
    """One family of threads (warp ends or weft picks).

    position: (n,) [m] across. thickness, width: (n,) [m] of the section as it lies in the cloth, flattened by the
    threads it crosses. colour: (n, 3) float32 linear. yarn: what they are spun of; its section is scaled to fit. room:
    how much wider each is where it floats and no neighbour is beside it (n,) [m]. swell: and where there is one: a
    thread that was thinned to be woven takes its own width again, up to the room it has.
    """

    position: F64
    thickness: F64
    width: F64
    colour: F32
    yarn: Yarn
    room: F64 | float = 0.0
    swell: F64 | float = 0.0

    @property
    def pitch(self) -> float:
        """Mean distance between neighbours [m]; the diameter where there is only one thread."""
        n = len(self.position)
        return float(self.position[-1] - self.position[0]) / (n - 1) if n > 1 else float(self.width[0]) * 1.5


@dataclass(frozen=True)
class Blocks:
    """Block records, each array (blocks,).

    key0, key1: int32 flat indices i·ends + j of the key points at its ends; equal for the free end of a yarn.
    thread: int32, warp ends first, then weft picks. kind: int32 row of `FabricLayout.kinds`.
    phase: int32 block of the yarn's period. variant: int32 filling. wide: (blocks, 2) float32 how wide the thread is
    over its mean at both ends.
    """

    key0: I32
    key1: I32
    thread: I32
    kind: I32
    phase: I32
    variant: I32
    wide: F32


@dataclass(frozen=True)
class BlockKinds:
    """The distinct shapes of yarn path, each array (kinds,).

    family: 0 warp, 1 weft. section: BODY, START or END. pitch: between the two crossings [m]. path: heights, wrap
    radii and pitch without flats [m] as in `crimp`. flat: half of the first crossing's flat [m], where the path
    starts to bend. thickness, width: of the thread [m]. spread: (kinds, 2, 2) [m] how much farther out it reaches at
    the first crossing and at the next, towards the thread before it and the one after it.
    """

    family: I32
    section: I32
    pitch: F64
    path: PathKinds
    flat: F64
    thickness: F64
    width: F64
    spread: F64


@dataclass(frozen=True)
class FabricLayout:
    """Everything about a fabric that can be counted before a particle is made."""

    cloth: Interlacing
    warp: Threads
    weft: Threads
    detail: Detail
    warp_period: Period
    weft_period: Period
    kinds: BlockKinds
    blocks: Blocks

    @property
    def key_points(self) -> int:
        return self.cloth.warp_up.size


def required_bytes(ends: int, picks: int, particles_per_block: float) -> int:
    """Bytes to build a fabric of that size, before anything of it is laid out."""
    blocks = ends * (picks + 1) + picks * (ends + 1)
    return int(blocks * (BLOCK_BYTES + particles_per_block * PARTICLE_BYTES))


def drawn_tex(layout: FabricLayout) -> tuple[F64, F64]:
    """Linear density of each warp end and each weft pick as it lies in the cloth [tex]: of a thread that was made
    thicker than its yarn, or thinner than it can be pressed, that of its section; pressed threads keep their mass."""
    warp, weft = (t.yarn.folded_tex * _kept(t) for t in (layout.warp, layout.weft))
    return warp, weft


def _kept(threads: Threads) -> F64:
    """Mass of each thread of a family over that of its yarn."""
    yarn = threads.yarn
    section = threads.thickness * threads.width / yarn.woven_diameter**2
    pressed = section * max(CLOSEST_PACKING / yarn.packing, 1.0)
    return np.where(section < 1.0, np.minimum(pressed, 1.0), section)


def drawn_density(layout: FabricLayout) -> float:
    """Mass of the cloth that is drawn [kg/m²]: threads · linear density · (1 + crimp), of both families."""
    warp, weft = drawn_tex(layout)
    return 1e-3 * cloth_facts(layout.cloth, warp_tex=warp, weft_tex=weft).mass_gsm


def families_of(
    cloth: Interlacing,
    spacing: tuple[F64, F64],
    colour: tuple[NDArray, NDArray],
    yarns: tuple[Yarn, Yarn],
    flattening: float = 1.0,
) -> tuple[Threads, Threads]:
    """Warp ends and weft picks of a weave with its sizes, each where the room [m] of those before it puts it.
    flattening: width over thickness of threads that have room; what neighbours press rounder spreads where it has."""
    thickness = (cloth.warp_diameter_m, cloth.weft_diameter_m)
    flat = (cloth.warp_flat_m, cloth.weft_flat_m)
    warp, weft = (
        Threads(
            np.concatenate([[0.0], np.cumsum((room[1:] + room[:-1]) / 2)]),
            thick,
            thick + wider,
            np.asarray(shades, np.float32),
            yarn,
            np.maximum(np.sqrt(flattening * thick * (thick + wider)) - (thick + wider) * (1.0 + ALIKE), 0.0),
            _swelling(thick + wider, yarn.woven_diameter, flattening, room),
        )
        for room, thick, wider, shades, yarn in zip(spacing, thickness, flat, colour, yarns, strict=True)
    )
    return warp, weft


def _swelling(width: F64, own: float, flattening: float, room: F64) -> F64:
    """How much wider threads of a width are where they float, with that room, if they are thinner than their own
    diameter [m] flattened as asked."""
    thinned = np.sqrt(flattening) * own > width * (1.0 + ALIKE)
    free = np.sqrt(max(flattening, FLOATING)) * own
    return np.where(thinned, np.maximum(np.minimum(free, room) - width, 0.0), 0.0)


def lay_out(cloth: Interlacing, warp: Threads, weft: Threads, *, detail: Detail) -> FabricLayout:
    """Key points and block records of a fabric. Vectorised over blocks; no particle is made.

    cloth: the weave with the sizes of its threads, not periodic. Raises InputError where its threads jam.
    """
    picks, ends = cloth.warp_up.shape
    rng = np.random.Generator(np.random.Philox(key=detail.seed))
    warp_period = Period.of(warp.yarn, weft.pitch)
    weft_period = Period.of(weft.yarn, warp.pitch)
    heights = crossing_heights(cloth.warp_up, cloth.warp_diameter_m, cloth.weft_diameter_m, cloth.balance)
    flat = np.arange(picks * ends, dtype=np.int32).reshape(picks, ends)
    warp_rows, warp_kinds = _family(
        flat.T, cloth.warp_up.T, heights[0].T, _along(path_kinds(cloth, "warp"), transpose=True), warp, weft, detail
    )
    weft_rows, weft_kinds = _family(
        flat, ~cloth.warp_up, heights[1], _along(path_kinds(cloth, "weft"), transpose=False), weft, warp, detail
    )
    weft_rows["kind"] += len(warp_kinds["section"])
    weft_rows["thread"] += ends
    rows = {name: np.concatenate([warp_rows[name], weft_rows[name]]) for name in warp_rows}
    kinds = {name: np.concatenate([warp_kinds[name], weft_kinds[name]]) for name in warp_kinds}
    starts = rng.integers(0, 1 << 30, ends + picks)
    blocks_of = np.where(np.arange(ends + picks) < ends, warp_period.blocks, weft_period.blocks)
    thread = rows["thread"]
    along = rows.pop("along")
    phase = (starts[thread] + along) % blocks_of[thread]
    variant = rng.integers(0, max(1, detail.variants), len(thread))
    own = [uneven_row(t.yarn.unevenness, p.block_length) for t, p in ((warp, warp_period), (weft, weft_period))]
    on = (rows["key0"] != rows["key1"]).astype(np.int64)  # a free end is as wide as at its crossing
    wide = np.empty((len(thread), 2), np.float32)
    for family, mine in enumerate((thread < ends, thread >= ends)):
        for end in (0, 1):
            wide[mine, end] = thick_places(own[family], starts[thread[mine]], (along + end * on)[mine])
    return FabricLayout(
        cloth=cloth,
        warp=warp,
        weft=weft,
        detail=detail,
        warp_period=warp_period,
        weft_period=weft_period,
        kinds=BlockKinds(
            family=np.repeat(np.array([0, 1], np.int32), [len(warp_kinds["section"]), len(weft_kinds["section"])]),
            section=kinds["section"],
            path=PathKinds(*(kinds[name] for name in PATH_FIELDS)),
            **{name: kinds[name] for name in ("pitch", "flat", "thickness", "width", "spread")},
        ),
        blocks=Blocks(phase=phase.astype(np.int32), variant=variant.astype(np.int32), wide=wide, **rows),
    )


PATH_FIELDS = ("free", "z0", "z1", "r0", "r1")  # of PathKinds; its pitch is free of the flats


def _values(paths: PathKinds) -> tuple[F64, F64, F64, F64, F64]:
    return paths.pitch, paths.z0, paths.z1, paths.r0, paths.r1


def _along(paths: PathKinds, *, transpose: bool) -> dict[str, F64]:
    """Path arrays with the threads along axis 0 and the blocks along axis 1; pitch spread to that shape."""
    out = {
        name: np.broadcast_to(array, paths.z0.shape) for name, array in zip(PATH_FIELDS, _values(paths), strict=True)
    }
    return {name: array.T if transpose else array for name, array in out.items()}


def _family(
    flat: I32, up: NDArray[np.bool_], z: F64, paths: dict[str, F64], own: Threads, other: Threads, detail: Detail
) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Block records and kinds of one family, with the threads along axis 0 and the crossings along axis 1."""
    threads, crossings = flat.shape
    own_class = _classes(own.thickness)
    other_class = _classes(other.thickness)
    gaps = np.diff(other.position)
    gap_class = _classes(gaps)
    i, j = np.indices((threads, crossings - 1))
    parts = [(i.ravel(), j.ravel(), j.ravel() + 1, BODY)]
    if detail.fringe > 0:
        each = np.arange(threads)
        first, last = 0 * each, 0 * each + crossings - 1
        parts += [(each, first, first, START), (each, last, last, END)]
    thread, begin, end = (np.concatenate([p[k] for p in parts]) for k in range(3))
    section = np.concatenate([np.full(len(p[0]), p[3], np.int32) for p in parts])
    gap = np.zeros(len(thread), np.int64)
    gap[section == BODY] = gap_class[begin[section == BODY]]
    room, swell = np.broadcast_to(own.room, threads), np.broadcast_to(own.swell, threads)
    beside, floats = _beside(up)
    beside, floats = beside & (room > 0.0)[:, None, None], floats & (swell > 0.0)[:, None]
    sides = (beside @ np.array([1, 2]) + 4 * floats).astype(np.int64)  # (threads, crossings)
    shapes = [up[thread, begin], up[thread, end], own_class[thread], other_class[begin], other_class[end], gap]
    shapes += [np.where(section == BODY, sides[thread, at], 0) for at in (begin, end)]
    # A kind is a mixed-radix number of everything that shapes the path; np.unique finds those in use.
    code = section.astype(np.int64)
    for values in shapes:
        code = code * (int(values.max(initial=0)) + 1) + values
    _, found, kind = np.unique(code, return_index=True, return_inverse=True)
    t, b, free = thread[found], begin[found], section[found] != BODY
    inside = np.minimum(b, max(0, crossings - 2))
    kinds: dict[str, NDArray] = {
        "section": section[found],
        "thickness": own.thickness[t],
        "width": own.width[t],
        "flat": np.where(free, 0.0, (other.width - other.thickness)[b] / 2),
        "pitch": np.where(free, other.pitch, gaps[inside] if crossings > 1 else other.pitch),
    }
    here = np.stack([b, end[found]], axis=1)
    reaching, floating = beside[t[:, None], here], floats[t[:, None], here][..., None]
    over = room[t][:, None, None] / np.maximum(reaching.sum(axis=2, keepdims=True), 1)
    under = floating * swell[t][:, None, None] / 2.0
    kinds["spread"] = np.where(free[:, None, None], 0.0, np.where(reaching, np.maximum(over, under), under))
    for name, array in paths.items():
        kinds[name] = np.where(free, 0.0, array[t, inside] if crossings > 1 else 0.0)
    for name in ("z0", "z1"):
        kinds[name] = np.where(free, z[t, b], kinds[name])
    rows: dict[str, NDArray] = {
        "key0": flat[thread, begin],
        "key1": flat[thread, end],
        "thread": thread.astype(np.int32),
        "kind": kind.ravel().astype(np.int32),
        "along": begin,
    }
    return rows, kinds


def _beside(up: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where threads float and the one before, or after, lies on the other face, (threads, crossings, 2), and where they
    float at all. Of a repeat with its first thread and crossing once more it goes on beyond the edge; another weave
    ends there."""
    on = [up.shape[axis] > 2 and bool((np.take(up, 0, axis) == np.take(up, -1, axis)).all()) for axis in (0, 1)]
    wide = up
    for axis, goes_on in enumerate(on):
        first, last = np.take(wide, [-2 if goes_on else 0], axis), np.take(wide, [1 if goes_on else -1], axis)
        wide = np.concatenate([first, wide, last], axis)
    here = wide[1:-1, 1:-1]
    floats = (wide[1:-1, :-2] == here) & (wide[1:-1, 2:] == here)
    return np.stack([floats & (wide[:-2, 1:-1] != here), floats & (wide[2:, 1:-1] != here)], axis=-1), floats


def _classes(values: F64) -> NDArray[np.int64]:
    """Class numbers of values that are equal to a nanometre."""
    return np.unique(np.rint(values * 1e9), return_inverse=True)[1].ravel().astype(np.int64)
