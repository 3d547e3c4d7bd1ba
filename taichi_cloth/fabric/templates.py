"""Templates: the fibre particles of one kind of block, made once and shared by all blocks of that kind.

A template is a list of particles, each with its ratio u along the block and its offset in the fabric's local frame
(along the yarn, across it, normal). It joins three things: the path the yarn takes over and under (`crimp`), the
block's place in the yarn's period (`spin.spin`), and one of a few variants that hide the repeat. All templates of
one yarn meet their neighbours in the same section, so there is no seam between blocks.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.layout import BODY, END, START, FabricLayout
from taichi_cloth.ground.particles import Property, first_numbers
from taichi_cloth.weave.crimp import PathKinds, centreline
from taichi_cloth.yarn.hairs import hairs
from taichi_cloth.yarn.spin import Period, Strands, spin, unit
from taichi_cloth.yarn.thick_fibres import further_apart, standing_out, thicker_by, twist_of
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["COLUMN", "TemplateBank", "build_templates", "particle_count", "particles_per_body_block"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
FRAY = 1.6  # how much wider a yarn is at its free end
LEAN = 0.45  # how far free ends stray from straight, in thread widths
MOST_OPEN = 0.999  # of a fibre in a yarn; a hair stands open on all sides
EVEN = 0.8191725134, 0.6710436067, 0.5497004779
"""By which places within pieces follow one another from block to block, fibre to fibre and along one: powers of the
inverse of the plastic number's kin in three dimensions (M. Roberts, "The unreasonable effectiveness of quasirandom
sequences", 2018)."""
WANDER = 0.10  # bend of a fibre between block ends that tells variants apart, in yarn radii


TEMPLATE = (
    Property("u", 1, "1", "ratio along the block: 0 at its first key point, 1 at its second"),
    Property("offset", 3, "m", "from there, in the cloth's frame: along the yarn, across it, normal"),
    Property("tangent", 3, "1", "unit direction of the fibre, in that frame"),
    Property("normal", 3, "1", "unit outward direction, in that frame"),
    Property("radius", 1, "m", "of the particle"),
    Property("half_length", 1, "m", "of the particle"),
    Property("openness", 1, "1", "of the particle"),
    Property("tone", 1, "1", "factor for its thread's colour"),
)
"""What a template says of each of its particles, in the order of the columns of `TemplateBank.packed`. Laid between
two key points, in the colour of a thread, it becomes the record of `ground.particles`."""


@dataclass(frozen=True)
class Columns:
    """Where each property of `TEMPLATE` begins, as kernels read it."""

    u: int
    offset: int
    tangent: int
    normal: int
    radius: int
    half_length: int
    openness: int
    tone: int


COLUMN = Columns(*first_numbers(TEMPLATE))


@dataclass(frozen=True)
class TemplateBank:
    """All templates, one after another. Of each particle, float32 (n,) or (n, 3): the properties of `TEMPLATE`."""

    start: NDArray[np.int64]
    """(templates + 1,) where each template's particles begin."""
    template: I32
    """(blocks,) number of each block's template."""
    u: F32
    offset: F32
    tangent: F32
    normal: F32
    radius: F32
    half_length: F32
    openness: F32
    tone: F32

    def properties(self) -> dict[str, F32]:
        """The particles' properties by name."""
        return {one.name: getattr(self, one.name) for one in TEMPLATE}

    def packed(self) -> F32:
        """All properties of each particle side by side, (n, 14): see `COLUMN`."""
        return np.column_stack([*self.properties().values()]).astype(np.float32, copy=False)

    @property
    def particle_start(self) -> NDArray[np.int64]:
        """(blocks + 1,) where each block's particles begin."""
        sizes = np.diff(self.start)[self.template]
        return np.concatenate([[0], np.cumsum(sizes)])


def particles_per_body_block(yarn: Yarn, fibres: int, steps: int) -> int:
    """Particles of a block between two crossings, without hairs."""
    return yarn.plies * min(fibres, yarn.fibres_in_section) * steps


def particle_count(layout: FabricLayout) -> int:
    """How many particles the layout's blocks will have, exactly, without making one."""
    blocks, detail = layout.blocks, layout.detail
    family, section = layout.kinds.family[blocks.kind], layout.kinds.section[blocks.kind]
    total = 0
    for which, (threads, period) in enumerate(((layout.warp, layout.warp_period), (layout.weft, layout.weft_period))):
        rows = particles_per_body_block(threads.yarn, detail.fibres, 1)
        body = (family == which) & (section == BODY)
        free = (family == which) & (section != BODY)
        total += rows * (int(body.sum()) * detail.steps + int(free.sum()) * _free_steps(layout))
        parts = max(1, layout.detail.hairs_each)
        for code, n in enumerate(np.bincount(blocks.variant[body] * parts + blocks.phase[body] % parts)):
            if n:
                total += int(n) * _grown(layout, threads.yarn, period, which, *divmod(code, parts)).half_length.size
    return total


def _free_steps(layout: FabricLayout) -> int:
    """Steps of a yarn's free end."""
    return max(1, round(layout.detail.fringe * layout.detail.steps))


def _grown(layout: FabricLayout, yarn: Yarn, period: Period, family: int, variant: int, part: int) -> Strands:
    """The hairs of one variant of a family's blocks; where one stands for several, those that blocks of that part of
    the period have, so that all have their turn."""
    return hairs(
        yarn,
        length=period.block_length,
        step=1.5 * period.block_length / layout.detail.steps,
        seed=((layout.detail.seed * 2 + family) << 20) + 1000 + variant,
        each=layout.detail.hairs_each,
        part=part,
    )


def build_templates(layout: FabricLayout) -> TemplateBank:
    """Make every template that the layout's blocks use, and no other."""
    blocks = layout.blocks
    family = layout.kinds.family[blocks.kind]
    periods = (layout.warp_period, layout.weft_period)
    yarns = (layout.warp.yarn, layout.weft.yarn)
    most = max(p.blocks for p in periods)
    variants = max(1, layout.detail.variants)
    code = (blocks.kind.astype(np.int64) * most + blocks.phase) * variants + blocks.variant
    used, template = np.unique(code, return_inverse=True)
    kind, phase, variant = used // variants // most, used // variants % most, used % variants
    sections = layout.kinds.section[kind]
    pieces: list[_Piece] = []
    for which in (0, 1):
        if not np.any(family == which):
            continue
        folded, period = yarns[which], periods[which]
        yarn, fibres = folded.as_one, min(layout.detail.fibres, folded.fibres_in_section)
        if yarn is not folded:
            fibres, period = fibres * folded.plies, replace(period, single_turns=period.ply_turns)
        seed = layout.detail.seed * 2 + which
        steps = layout.detail.steps
        spun = spin(yarn, period, fibres=fibres, steps=steps, start=0.0, stop=period.length, seed=seed)
        for section in (BODY, START, END):
            mine = np.flatnonzero((layout.kinds.family[kind] == which) & (sections == section))
            if len(mine):
                pieces.append(_core(layout, mine, kind[mine], phase[mine], variant[mine], spun, period, section, seed))
            if section == BODY and len(mine) and (yarn.hairiness.ends_per_m or yarn.hairiness.loops_per_m):
                pieces += _hair(layout, mine, kind[mine], phase[mine], variant[mine], yarn, period, which)
    return _assemble(pieces, len(used), template.ravel().astype(np.int32))


@dataclass(frozen=True)
class _Piece:
    """Equal-sized particle lists of some templates: template (t,), and of each property of `TEMPLATE` (t, m, …)."""

    template: NDArray[np.int64]
    properties: dict[str, F64]


def _core(
    layout: FabricLayout,
    template: NDArray[np.int64],
    kind: NDArray[np.int64],
    phase: NDArray[np.int64],
    variant: NDArray[np.int64],
    spun: Strands,
    period: Period,
    section: int,
    seed: int,
) -> _Piece:
    steps = layout.detail.steps
    free = _free_steps(layout)
    first, count = {BODY: (0, steps), START: (-free, free), END: (0, free)}[section]
    place = first + np.arange(count)
    u = (place + 0.5) / steps
    rows = len(spun.ply)
    # (t, f, k) positions in the period; free ends run on into the period beyond the block.
    at = (phase[:, None] * steps + place[None, :]) % (period.blocks * steps)

    def gather(array: F64) -> F64:
        return np.moveaxis(array[:, at], 0, 1)  # (f, t, k, …) → (t, f, k, …)

    section_yz = gather(spun.position[..., 1:])
    size = np.stack([layout.kinds.width[kind], layout.kinds.thickness[kind]], -1)[:, None, None, :]
    yarn = _yarn(layout, kind[0])
    scale = size / yarn.diameter
    drawn = spun.radius[:, 0]  # as thick all along
    thick = drawn.mean() * np.sqrt(scale[..., 0] * scale[..., 1])[..., 0]  # (t, 1)
    grown = thicker_by(thick, rows, size[:, 0, 0, :])
    # Thicker fibres are laid within the yarn's outline; then so far apart that they cover its width, but for plies of
    # many fibres, between which a gap would open.
    inside = 1.0 - drawn.mean() / (yarn.diameter / 2)
    filling = np.maximum(size / 2 - (grown * thick)[..., None, None], 0.0) / (inside * size / 2)
    thicker = grown[:, 0] > 1.0
    scale_yz = scale * np.where(thicker[:, None, None, None], filling, 1.0)
    radius = drawn * np.sqrt(scale[..., 0] * scale[..., 1])[..., 0] * grown  # (t, f)
    spread = thicker | (yarn.plies == 1)
    scale_yz[spread, 0, 0, 0] *= further_apart(
        spun.position[..., 1], scale_yz[spread, 0, 0, 0], radius[spread], size[spread, 0, 0, 0]
    )
    section_yz = section_yz * scale_yz
    if section == BODY:
        rng = np.random.Generator(np.random.Philox(key=[seed, 2]))
        bend = rng.standard_normal((max(1, layout.detail.variants), rows, 1, 2)).clip(-2, 2)
        section_yz = section_yz + bend[variant] * (WANDER * size / 2) * (np.sin(pi * u) ** 2)[None, None, :, None]
    else:
        away = np.abs(u if section == END else -u) / max(layout.detail.fringe, 1e-9)
        section_yz = section_yz * (1.0 + (FRAY - 1.0) * away**2)[None, None, :, None]
        rng = np.random.Generator(np.random.Philox(key=[seed, 4]))
        lean = rng.standard_normal((max(1, layout.detail.variants), 1, 1, 2)).clip(-2, 2)
        section_yz = section_yz + lean[variant] * (LEAN * size) * (away**2)[None, None, :, None]
    z, slope = _path(layout, kind, u, section)
    course, outward = gather(spun.tangent), gather(spun.normal)
    if section == BODY and layout.kinds.spread[kind].any():
        section_yz, course, z = _spread(layout, kind, u, section_yz, course, z)
    offset, tangent, normal = _bend(section_yz, course, outward, z[:, None, :], slope[:, None, :])
    if layout.detail.far and section == BODY:
        # Few pieces have the slopes of many: each that of some place of it where one of many stands.
        finest = layout.detail.far
        turns = np.multiply.outer(phase + variant * period.blocks, np.ones((rows, count))) * EVEN[0]
        turns += np.arange(rows)[:, None] * EVEN[1] + np.arange(count) * EVEN[2]
        spot = ((u + (turns % 1.0 - 0.5) / steps) * finest).astype(np.int64).clip(0, finest - 1)
        slopes = _path(layout, kind, (np.arange(finest) + 0.5) / finest, section)[1]
        sampled = np.take_along_axis(slopes[:, None], spot, axis=2)
        _, tangent, normal = _bend(section_yz, course, outward, z[:, None, :], sampled)
    # What is seen of the fibres that a thick one stands for lies farther out, on the cloth's side that it is on.
    out = standing_out(radius, grown, rows / (yarn.fibres_in_section * yarn.plies))[..., None]
    out = out * np.clip(offset[..., 2] / radius[..., None], -1.0, 1.0)
    normal = normal * (gather(spun.away) * (size.mean(axis=-1) / yarn.diameter))[..., None]
    normal[..., 2] += out
    if layout.detail.far:  # there they lean farther across the yarn, too, as far as it is twisted
        leaning = twist_of(spun.position[..., 1:], spun.tangent, spun.ply)
        tangent[..., 1] -= leaning * out * (yarn.diameter / size.mean(axis=-1))
    across, over = np.moveaxis(2.0 * section_yz / size, -1, 0)
    nearer = np.hypot(across, over + 2.0 * out / size[..., 1]) - np.hypot(across, over)
    stretch = (layout.kinds.pitch[kind] / period.block_length)[:, None, None]
    shape = (len(kind), rows, count)
    surface = np.clip(gather(spun.depth) + nearer, 0.0, 1.0)
    open_ = _openness(layout, surface, np.abs(offset[..., 2] + out))
    return _flatten(
        template,
        u=np.broadcast_to(u, shape),
        offset=offset,
        tangent=unit(tangent) if layout.detail.far else tangent,
        normal=unit(normal),
        radius=np.broadcast_to(radius[..., None], shape),
        half_length=gather(spun.half_length) * stretch * np.sqrt(1.0 + slope**2)[:, None, :],
        openness=open_,
        tone=np.broadcast_to(spun.tone[None, :, None], shape),
    )


def _hair(
    layout: FabricLayout,
    template: NDArray[np.int64],
    kind: NDArray[np.int64],
    phase: NDArray[np.int64],
    variant: NDArray[np.int64],
    yarn: Yarn,
    period: Period,
    family: int,
) -> list[_Piece]:
    """Hairs of each variant, turned with the block's place in the period so that no two blocks look alike."""
    pieces = []
    parts = max(1, layout.detail.hairs_each)
    for code in np.unique(variant * parts + phase % parts):
        grown = _grown(layout, yarn, period, family, *(int(k) for k in divmod(code, parts)))
        if not len(grown.ply):
            continue
        mine = np.flatnonzero(variant * parts + phase % parts == code)
        turn = (phase[mine] * (pi * (3.0 - 5.0**0.5)))[:, None, None]

        def turned(array: F64, turn: F64 = turn) -> F64:
            c, s = np.cos(turn), np.sin(turn)
            x, y, z = (np.broadcast_to(array[None, ..., k], (len(turn), *array.shape[:2])) for k in range(3))
            return np.stack([x, c * y - s * z, s * y + c * z], -1)

        position = turned(grown.position)
        u = position[..., 0] / period.block_length
        # Out to the yarn's surface as wide and thick as it is woven, beyond that as it grew, from where its root lies.
        section = position[..., 1:]
        size = np.stack([layout.kinds.width[kind[mine]], layout.kinds.thickness[kind[mine]]], -1)
        out = np.maximum(np.linalg.norm(section, axis=-1), 1e-12) / (yarn.diameter / 2)
        within = np.minimum(out, 1.0) / out
        section = section * (1.0 + within[..., None] * (size[:, None, None, :] / yarn.diameter - 1.0))
        root = np.clip(grown.position[:, 0, 0] / period.block_length, 0.0, 1.0)
        z, slope = _path(layout, kind[mine], root, BODY)
        offset, tangent, normal = _bend(
            section, turned(grown.tangent), turned(grown.normal), z[..., None], 0.0 * slope[..., None]
        )
        shape = u.shape
        pieces.append(
            _flatten(
                template[mine],
                u=u,
                offset=offset,
                tangent=tangent,
                normal=normal,
                radius=np.broadcast_to(grown.radius[None], shape),
                half_length=np.broadcast_to(grown.half_length[None], shape),
                openness=np.ones(shape),
                tone=np.broadcast_to(grown.tone[None, :, None], shape),
            )
        )
    return pieces


def _yarn(layout: FabricLayout, kind: int) -> Yarn:
    """As it is laid."""
    return (layout.warp, layout.weft)[int(layout.kinds.family[kind])].yarn.as_one


def _path(layout: FabricLayout, kind: NDArray[np.int64], u: F64, section: int) -> tuple[F64, F64]:
    """Height of the yarn's axis and its slope, (t, k) each; a free end settles to the middle of the cloth."""
    kinds = layout.kinds
    if section != BODY:
        away = np.clip(np.abs(u) / max(layout.detail.fringe, 1e-9), 0.0, 1.0)
        ease = away * away * (3.0 - 2.0 * away)
        sign = 1.0 if section == END else -1.0
        rate = 6.0 * away * (1.0 - away) / max(layout.detail.fringe, 1e-9) * sign
        z0, pitch = kinds.path.z0[kind][:, None], kinds.pitch[kind][:, None]
        return z0 * (1.0 - ease), -z0 * rate / pitch
    p = kinds.path
    free = p.pitch[kind][:, None]
    # On a flat the path is level: u is counted between the flats, and held at its ends on them.
    inner = np.clip((u[None, :] * kinds.pitch[kind][:, None] - kinds.flat[kind][:, None]) / free, 0.0, 1.0)
    z, per_pitch = centreline(PathKinds(*(a[kind] for a in (p.pitch, p.z0, p.z1, p.r0, p.r1))), inner)
    return z, per_pitch / free


def _spread(
    layout: FabricLayout, kind: NDArray[np.int64], u: F64, section_yz: F64, course: F64, z: F64
) -> tuple[F64, F64, F64]:
    """Threads that float reach out to where no neighbour is beside them, at equal area, and lie on what they lay on.

    section_yz: (t, f, k, 2) [m], course: (t, f, k, 3) the fibres' directions, z: (t, k) [m] the axis; as returned.
    """
    kinds = layout.kinds
    width, pitch = kinds.width[kind][:, None], kinds.pitch[kind][:, None, None]
    # Across a block is to the left of its way, where the next pick lies, and the end before.
    before, after = np.moveaxis(kinds.spread[kind], 2, 0)
    warp = (kinds.family[kind] == 0)[:, None]
    right, left = np.where(warp, after, before), np.where(warp, before, after)  # (t, 2)
    ease, rate = u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u)

    def between(ends: F64) -> tuple[F64, F64]:
        return ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * ease, (ends[:, 1:] - ends[:, :1]) * rate

    more, widens = between((left + right) / width)
    aside, moves = between((left - right) / 2.0)
    wide, widens = 1.0 + more[:, None, :], widens[:, None, :]
    y, up = section_yz[..., 0], section_yz[..., 1]
    lower = np.sign(z) * (kinds.thickness[kind] / 2.0)[:, None]
    section = np.stack([y * wide + aside[:, None, :], up / wide], -1)
    lean = np.stack([0.0 * y, y * widens + moves[:, None, :], -(lower[:, None, :] + up) * widens / wide**2], -1)
    sunk = z - lower * (1.0 - 1.0 / wide[:, 0])
    return section, unit(course + course[..., :1] * lean / pitch[..., None]), sunk


def _bend(section_yz: F64, tangent: F64, normal: F64, z: F64, slope: F64) -> tuple[F64, F64, F64]:
    """Stand sections square to a path that rises with `slope`, and carry directions along with them."""
    c = 1.0 / np.sqrt(1.0 + slope**2)
    s = slope * c
    y, up = section_yz[..., 0], section_yz[..., 1]

    def turn(v: F64) -> F64:
        return np.stack([c * v[..., 0] - s * v[..., 2], v[..., 1], s * v[..., 0] + c * v[..., 2]], -1)

    return np.stack([-s * up, y, z + c * up], -1), turn(tangent), turn(normal)


def _openness(layout: FabricLayout, depth: F64, height: F64) -> F64:
    """Share of the sky a fibre sees, by how deep it lies in its yarn and how deep the yarn lies in the cloth.

    A first approximation that costs nothing at render time: 1 on the crowns, about 0.1 in the gaps' depth.
    """
    half = (float(layout.warp.thickness.mean()) + float(layout.weft.thickness.mean())) / 2
    rise = np.clip(np.abs(height) / half, 0.0, 1.0)
    out = (0.30 + 0.70 * depth**2) * (0.35 + 0.65 * rise * rise * (3.0 - 2.0 * rise))
    return np.minimum(out, MOST_OPEN)


def _flatten(template: NDArray[np.int64], **arrays: F64) -> _Piece:
    t = len(template)
    shape = {one.name: (t, -1, one.numbers) if one.numbers > 1 else (t, -1) for one in TEMPLATE}
    return _Piece(template, {name: np.ascontiguousarray(a).reshape(shape[name]) for name, a in arrays.items()})


def _assemble(pieces: list[_Piece], templates: int, template: I32) -> TemplateBank:
    sizes = np.zeros(templates, np.int64)
    for piece in pieces:
        sizes[piece.template] += piece.properties["u"].shape[1]
    start = np.concatenate([[0], np.cumsum(sizes)])
    filled = start[:-1].copy()
    total = int(start[-1])
    out = {one.name: np.empty((total, one.numbers)[: 1 + (one.numbers > 1)], np.float32) for one in TEMPLATE}
    for piece in pieces:
        m = piece.properties["u"].shape[1]
        rows = (filled[piece.template][:, None] + np.arange(m)).ravel()
        filled[piece.template] += m
        for name, array in out.items():
            array[rows] = piece.properties[name].reshape(-1, *array.shape[1:])
    return TemplateBank(start=start, template=template, **out)
