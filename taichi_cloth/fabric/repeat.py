"""One repeat of a weave, and the templates of its fibre blocks: all that is stored of threads that are counted in
millions.

Which template a block has follows from where it lies: the crossing it begins at, counted in repeats, tells its path;
its thread and its place along it tell its part of the yarn's period and its filling. The same templates are made
several times over, finer and coarser, as *levels*: of all fibres, and of fewer and thicker ones that cover as much.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.layout import BODY, Blocks, FabricLayout
from taichi_cloth.fabric.templates import TemplateBank, build_templates, particles_per_body_block
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.draft import longest_float
from taichi_cloth.yarn.hairs import hairs
from taichi_cloth.yarn.spin import Period
from taichi_cloth.yarn.yarn import Hairiness, Yarn

__all__ = ["BANK_BYTES", "FLOATING", "RepeatBank", "WeaveRepeat", "bank_of", "bytes_of_bank", "levels_of"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

COARSER = ((36, 8), (12, 4), (4, 4))
"""Fibres a ply and particles along a fibre in a block, of levels below the one that a scene states."""
FLOATING, LONG = ((36, 8), (12, 6), (8, 4)), 5
"""The same of weaves with floats over so many crossings, which are steep in few places and shine there."""
BALD = 12
"""Levels of at most so many fibres a ply have no hairs, which nobody sees that far away; but a nap of fewer and wider
ones."""
HAIRS_EACH = 2
"""Hairs of a nap that one stands for in such a level; in each below it as many times more."""
BANK_BYTES = 160_000_000
"""A bank's particles at most: fewer fillings are made where they would take more."""
PARTICLE = 56
"""Bytes of a template's particle."""


@dataclass(frozen=True)
class WeaveRepeat:
    """A repeat of a weave.

    layout: of the repeat and, after it, of its first end and pick once more, so that every block of it is there.
    kind: (2, picks, ends) of `layout.kinds`, of the block that begins at each crossing, of the warp end and of the weft
    pick. ahead: of warp ends (ends,) and weft picks (picks,), how far each lies beyond its even place [threads].
    """

    layout: FabricLayout
    kind: I32
    ahead: tuple[F32, F32]

    @staticmethod
    def of(layout: FabricLayout) -> "WeaveRepeat":
        """The repeat that a layout without fringe is of. Raises InputError on another."""
        picks, ends = layout.cloth.warp_up.shape
        body = layout.kinds.section[layout.blocks.kind] == BODY
        if min(picks, ends) < 2 or not body.all():
            raise InputError(f"repeat: a layout of {ends} ends × {picks} picks; allowed: from 2 on, without fringe")
        count = ends * (picks - 1)
        warp = layout.blocks.kind[:count].reshape(ends, picks - 1).T[:, : ends - 1]
        weft = layout.blocks.kind[count:].reshape(picks, ends - 1)[: picks - 1]
        return WeaveRepeat(
            layout,
            np.stack([warp, weft]).astype(np.int32),
            (_ahead(layout.warp.position), _ahead(layout.weft.position)),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(picks, ends) of the repeat."""
        return self.kind.shape[1], self.kind.shape[2]


def _ahead(position: F64) -> F32:
    """How far threads lie beyond even places, where the last is the first of the next repeat [threads]."""
    even = np.linspace(position[0], position[-1], len(position))
    return ((position - even) * (len(position) - 1) / (position[-1] - position[0]))[:-1].astype(np.float32)


@dataclass(frozen=True)
class RepeatBank:
    """The templates of some repeats, at several levels, one after another.

    first, phases: (kinds,) int32, of each kind of each repeat its first template and how many blocks its yarn's period
    has; template `first + phase · variants + variant`. templates: of one level; those of level l begin at l ·
    templates. start: (levels · templates + 1,) where each one's particles begin. particle: (n, 14), see
    `templates.COLUMN`. size, radius, area, reach, half_length: (levels,) means of a block's particles, and of a
    particle's radius [m] and of that times its half length [m²]; what they reach beyond the block at most [m]; longest
    half length [m]. height: of the cloth's right side
    above its middle, without hairs [m].
    """

    first: I32
    phases: I32
    variants: int
    templates: int
    start: NDArray[np.int64]
    particle: F32
    size: F64
    radius: F64
    area: F64
    reach: F64
    half_length: F64
    height: float

    @property
    def levels(self) -> int:
        return len(self.size)


def levels_of(
    fibres: int, steps: int, most: int, coarser: tuple[tuple[int, int], ...] = COARSER
) -> tuple[tuple[int, int], ...]:
    """Fibres a ply and steps of each level, the finest first. most: fibres that a ply has. coarser: levels below."""
    out = [(min(fibres, most), steps)]
    for fewer, shorter in coarser:
        last = out[-1]
        if fewer < 0.75 * last[0]:
            out.append((fewer, min(shorter, last[1])))
    return tuple(out)


def _levels(layout: FabricLayout, most: int) -> tuple[tuple[int, int], ...]:
    """As `levels_of` has them, of a layout's weave."""
    floats = max(longest_float(layout.cloth.warp_up[:-1, :-1]))
    return levels_of(layout.detail.fibres, layout.detail.steps, most, FLOATING if floats >= LONG else COARSER)


def bytes_of_bank(repeats: tuple[WeaveRepeat, ...]) -> int:
    """Memory of the templates of repeats, about."""
    total = 0
    for repeat in repeats:
        layout = repeat.layout
        variants = _variants(layout)
        for family, (threads, period) in enumerate(
            ((layout.warp, layout.warp_period), (layout.weft, layout.weft_period))
        ):
            kinds = int((layout.kinds.family == family).sum())
            for fibres, steps in _levels(layout, threads.yarn.fibres_in_section):
                total += kinds * period.blocks * variants * _per_block(threads.yarn, period, fibres, steps) * PARTICLE
    return total


def _per_block(yarn: Yarn, period: Period, fibres: int, steps: int) -> int:
    """Particles of a block, about: of the few hairs that stand off a yarn none are counted."""
    body = particles_per_body_block(yarn, fibres, steps)
    if not yarn.hairiness.of_nap:
        return body
    return body + hairs(yarn, length=period.block_length, step=1.5 * period.block_length / steps, seed=0).radius.size


def _variants(layout: FabricLayout) -> int:
    """As many fillings as are asked for, or as there is room for."""
    one = 0
    for family, (threads, period) in enumerate(((layout.warp, layout.warp_period), (layout.weft, layout.weft_period))):
        kinds = int((layout.kinds.family == family).sum())
        per_block = _per_block(threads.yarn, period, layout.detail.fibres, layout.detail.steps)
        one += kinds * period.blocks * per_block * PARTICLE
    return max(1, min(layout.detail.variants, BANK_BYTES // max(one, 1)))


def bank_of(repeats: tuple[WeaveRepeat, ...]) -> RepeatBank:
    """The templates of repeats of the same yarns, at all levels. Needs no Taichi."""
    variants = min(_variants(repeat.layout) for repeat in repeats)
    first, phases, levels = [], [], []
    templates = 0
    for repeat in repeats:
        layout = repeat.layout
        periods = np.array([layout.warp_period.blocks, layout.weft_period.blocks])[layout.kinds.family]
        sizes = periods * variants
        first.append(templates + np.cumsum(sizes) - sizes)
        phases.append(periods)
        templates += int(sizes.sum())
        levels.append(_banks(layout, periods, variants))
    kept = range(min(len(banks) for banks in levels))
    banks = [[of_repeat[level] for of_repeat in levels] for level in kept]
    every = [bank for of_level in banks for bank in of_level]
    counts = np.concatenate([np.diff(bank.start) for bank in every])
    size, radius, area, reach, longest = [], [], [], [], []
    pitch = max(float(repeat.layout.kinds.pitch.max()) for repeat in repeats)
    for of_level in banks:
        size.append(sum(len(b.u) for b in of_level) / templates)
        radius.append(float(np.average([_radius(b) for b in of_level], weights=[len(b.u) for b in of_level])))
        area.append(sum(float((b.radius * b.half_length).sum()) for b in of_level) / sum(len(b.u) for b in of_level))
        reach.append(max(_reach(b, pitch) for b in of_level))
        longest.append(max(float(b.half_length.max(initial=0.0)) for b in of_level))
    return RepeatBank(
        first=np.concatenate(first).astype(np.int32),
        phases=np.concatenate(phases).astype(np.int32),
        variants=variants,
        templates=templates,
        start=np.concatenate([[0], np.cumsum(counts)]),
        particle=np.concatenate([bank.packed() for bank in every]),
        size=np.array(size),
        radius=np.array(radius),
        area=np.array(area),
        reach=np.array(reach),
        half_length=np.array(longest),
        height=max(float(np.quantile(np.abs(b.offset[b.openness < 1.0, 2]), 0.98)) for b in banks[0]),
    )


def _banks(layout: FabricLayout, periods: NDArray, variants: int) -> list[TemplateBank]:
    """The templates of one repeat at each level: of every kind, place in the period and filling, in this order."""
    of_kind = periods * variants
    kind = np.repeat(np.arange(len(periods)), of_kind)
    place = np.arange(len(kind)) - np.repeat(np.cumsum(of_kind) - of_kind, of_kind)
    none, even = np.zeros(len(kind), np.int32), np.ones((len(kind), 2), np.float32)
    phase, variant = np.divmod(place, variants)
    blocks = Blocks(none, none, none, kind.astype(np.int32), phase.astype(np.int32), variant.astype(np.int32), even)
    most = max(layout.warp.yarn.fibres_in_section, layout.weft.yarn.fibres_in_section)
    out = []
    bald = 0
    for fibres, steps in _levels(layout, most):
        bald += fibres <= BALD
        each = HAIRS_EACH**bald
        far = layout.detail.steps if out else 0
        detail = replace(layout.detail, fibres=fibres, steps=steps, variants=variants, hairs_each=each, far=far)
        shown = _with_naps(layout) if bald else layout
        bank = build_templates(replace(shown, blocks=blocks, detail=detail))
        assert (np.diff(bank.template) == 1).all()  # in the order of the blocks
        out.append(bank)
    return out


def _with_naps(layout: FabricLayout) -> FabricLayout:
    """The same without hairs that are no nap."""
    warp, weft = (
        one if one.yarn.hairiness.of_nap else replace(one, yarn=replace(one.yarn, hairiness=Hairiness()))
        for one in (layout.warp, layout.weft)
    )
    return replace(layout, warp=warp, weft=weft)


def _radius(bank: TemplateBank) -> float:
    """Mean radius of a bank's fibres, without hairs, which stand open on all sides [m]."""
    core = bank.openness < 1.0
    return float(bank.radius[core].mean()) if core.any() else float(bank.radius.mean())


def _reach(bank: TemplateBank, pitch: float) -> float:
    """How far particles reach beyond the line between a block's crossings [m]."""
    beyond = np.maximum(np.abs(bank.u - 0.5) - 0.5, 0.0) * pitch
    return float((beyond + np.linalg.norm(bank.offset, axis=1) + np.maximum(bank.radius, bank.half_length)).max())
