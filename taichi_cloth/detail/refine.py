"""Nearer than the template: drawn fibres part into the real ones, and these get their own surface.

A drawn fibre stands for several real ones of the same area together. Close by it is replaced by that many, in its
own section, on its own course, so the yarn keeps its outline, its colour and its fibres' places; closer still, a
piece of fibre is replaced by points on its surface (`skin`). Both changes are continuous: the real fibres part from
the drawn one's axis and its surface rises from a round one as the camera comes nearer, so nothing pops.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.detail.pieces import THREAD, WIDTH, place, reach_of, split
from taichi_cloth.detail.skins import Skins
from taichi_cloth.detail.streaming import FabricStream, Survey
from taichi_cloth.detail.view import Pinhole, View, view_of
from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.layout import BODY, Blocks
from taichi_cloth.fabric.templates import build_templates
from taichi_cloth.ground.particles import LANES

__all__ = ["PARTING", "RefiningStream"]

F32 = NDArray[np.float32]
PART = (3.5, 9.0)
"""Radius of a drawn fibre [px] at which it begins to part into real ones, and at which they have their places."""
PARTING = 3.5, 3.7, 4.0, 4.5, 5.0, 6.0, 7.5, 9.0
"""Radii of a drawn fibre [px] between which the brightness of real ones is led from one to the next."""
MOST_BLOCKS = 700
"""Blocks parted at a time; the nearest go first."""
STEPS = 32
"""Pieces of a real fibre in a block."""


@dataclass(frozen=True)
class Refined:
    """A survey of blocks and, after them, pieces of fibre: as `Survey`, with the pieces (n, WIDTH) themselves."""

    boxes: NDArray[np.int16]
    counts: NDArray[np.int32]
    depth: F32
    reach: F32
    blocks: Survey
    pieces: F32
    grid: NDArray[np.int32]
    view: View


class RefiningStream:
    """A fabric that streams as `FabricStream` does and is refined where the camera is near.

    skin: the fibre's height map (see `skin.skin_of`). steps: pieces of a real fibre in a block.
    parted_gain, surface_gain: factors for the colour of real fibres of warp and of weft, (2,) or at each of `PARTING`
    (radii, 2), and of points on their surface besides (2,). They hide what is behind them better than what they
    replace, so that more of the picture is fibres that lie open.
    """

    def __init__(
        self,
        fabric: Fabric,
        points: NDArray,
        skin: F32,
        *,
        steps: int = STEPS,
        parted_gain: ArrayLike = (1.0, 1.0),
        surface_gain: ArrayLike = (1.0, 1.0),
        chunks: int = 2,
        **options: object,
    ) -> None:
        self.base = FabricStream(fabric, points, chunks=chunks, **options)  # pyright: ignore[reportArgumentType]
        self.skins, self.steps, self.chunks = Skins(skin, surface_gain, chunks), steps, chunks
        self.parted_gain = np.broadcast_to(np.asarray(parted_gain, np.float32), (len(PARTING), 2))
        self._known = np.zeros(0, np.int64)
        self._near: FabricStream | None = None
        bank, base = fabric.bank, self.base
        beyond = np.maximum(np.abs(bank.u - 0.5) - 0.5, 0.0) * float(base.arrays.pitch.max())
        reach = beyond + np.linalg.norm(bank.offset, axis=1) + bank.half_length
        filled = base.size > 0
        self._reach = np.zeros(len(base.size))  # of each template without its hairs, which stand open on all sides
        self._reach[filled] = np.maximum.reduceat(np.where(bank.openness < 1.0, reach, 0.0), bank.start[:-1][filled])

    def survey(self, camera: Pinhole) -> Refined:
        """Where every block is, and every piece of the fibres near the camera."""
        seen = self.base.survey(camera)
        radius = self.base.radius[self.base.fabric.bank.template]
        with np.errstate(divide="ignore"):
            pixels = (radius * camera.focal / np.maximum(seen.depth, camera.near)).astype(np.float32)
        near = np.flatnonzero((seen.counts > 0) & (pixels > PART[0]))
        near = near[self._in_view(near, camera)]
        if len(near) > MOST_BLOCKS:
            near = np.sort(near[np.argsort(seen.depth[near], kind="stable")[:MOST_BLOCKS]])
        view = view_of(camera)
        pieces = self._part(near, pixels[near], seen.eye) if len(near) else np.zeros((0, WIDTH), np.float32)
        n = len(pieces)
        boxes, counts = np.empty((n, 4), np.int16), np.zeros(n, np.int32)
        depth, grid = np.empty(n, np.float32), np.empty((n, 2), np.int32)
        if n:
            place(pieces, view, boxes, counts, depth, grid)
        counts_of_blocks = seen.counts.copy()
        counts_of_blocks[near] = 0
        return Refined(
            boxes=np.concatenate([seen.boxes, boxes]),
            counts=np.concatenate([counts_of_blocks, counts]),
            depth=np.concatenate([seen.depth, depth]),
            reach=np.concatenate([seen.reach, reach_of(pieces)]),
            blocks=seen,
            pieces=pieces,
            grid=grid,
            view=view,
        )

    def lay(self, survey: Refined, chosen: NDArray[np.int32]) -> tuple[F32, int]:
        """The particles of these blocks and pieces; places between the two kinds that stay empty have radius 0."""
        first = len(survey.blocks.counts)
        out, total = self.base.lay(survey.blocks, chosen[chosen < first])
        mine = chosen[chosen >= first] - first
        if not len(mine):
            return out, total
        return self.skins.lay_after(out, survey, survey.counts[first:][mine], mine)

    def numbers(self, survey: Refined, chosen: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """As `FabricStream.numbers`, of what `lay` makes of these; -1 for a place that stays empty."""
        first = len(survey.blocks.counts)
        parts = self.base.numbers(survey.blocks, chosen[chosen < first])
        mine = chosen[chosen >= first] - first
        if not len(mine):
            return parts
        of_piece = survey.pieces[mine, THREAD].astype(np.int32)
        family = (of_piece >= self.ends).astype(np.int32)
        counts = survey.counts[first:][mine]
        laid, more = (
            [np.pad(one, (0, -len(one) % LANES), constant_values=-1) for one in pair]
            for pair in (parts, (np.repeat(of_piece, counts), np.repeat(family, counts)))
        )
        return np.concatenate([laid[0], more[0]]), np.concatenate([laid[1], more[1]])

    @property
    def ends(self) -> int:
        """Warp threads; those after them are weft."""
        return self.base.fabric.layout.cloth.warp_up.shape[1]

    @property
    def allocated(self) -> int:
        """Bytes of the batches' arrays."""
        return self.base.allocated + self.skins.allocated

    def _in_view(self, blocks: NDArray[np.int64], camera: Pinhole) -> NDArray[np.bool_]:
        """Whether the spheres round the blocks' own fibres, without hairs, touch the frustum."""
        base = self.base.arrays
        p0, p1 = base.point[base.key0[blocks]], base.point[base.key1[blocks]]
        r = np.linalg.norm(p1 - p0, axis=1) / 2 + self._reach[base.template[blocks]]
        x, y, z = ((p0 + p1) / 2 @ np.asarray(camera.rotation).T + np.asarray(camera.translation)).T
        inside = z + r > camera.near
        for across, edge in (
            (-x, camera.cx),
            (x, camera.width - camera.cx),
            (-y, camera.cy),
            (y, camera.height - camera.cy),
        ):
            inside &= camera.focal * across - edge * z <= r * np.hypot(camera.focal, edge)
        return inside

    def _part(self, near: NDArray[np.int64], pixels: F32, eye: F32) -> F32:
        """The pieces of all real fibres of these blocks, (n, WIDTH). eye: of `Survey`."""
        if not np.isin(near, self._known).all():
            self._known = near
            layout = self.base.fabric.layout
            b = layout.blocks
            fewer = Blocks(*(getattr(b, name)[near] for name in Blocks.__dataclass_fields__))
            finer = replace(layout, blocks=fewer, detail=replace(layout.detail, steps=self.steps))
            bank = build_templates(finer)
            fabric = Fabric(finer, bank, self.base.fabric.thread_colour, bank.particle_start)
            self._fine = (fabric, fabric.arrays(self.base.arrays.point, self.base.frame))
        fabric, arrays = self._fine
        layout, bank, family = fabric.layout, fabric.bank, arrays.family
        where = np.searchsorted(self._known, near).astype(np.int32)
        yarns = (layout.warp.yarn, layout.weft.yarn)
        drawn = np.array([min(layout.detail.fibres, y.fibres_in_section) for y in yarns])
        each = np.maximum(1, np.rint(np.array([y.fibres_in_section for y in yarns]) / drawn)).astype(np.int32)
        rows = np.array([y.plies for y in yarns]) * drawn
        free = max(1, round(layout.detail.fringe * self.steps))
        length = np.where(layout.kinds.section[layout.blocks.kind] == BODY, self.steps, free)
        core = (rows[family] * length).astype(np.int32)  # hairs, which are real already, come after these
        size = np.diff(bank.start)[bank.template]
        counts = (core * each[family] + (size - core))[where]
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        out = np.empty((int(starts[-1]), WIDTH), np.float32)
        usual = float(np.mean([y.fibre_diameter for y in yarns])) * 20.0  # a skin's period is near this [m]
        parted = np.clip((pixels - PART[0]) / (PART[1] - PART[0]), 0, 1)
        parted = (parted * parted * (3 - 2 * parted)).astype(np.float32)
        of_radius = np.stack([np.interp(pixels, PARTING, gain) for gain in self.parted_gain.T])
        gain = of_radius[family[where], np.arange(len(near))].astype(np.float32)
        split(
            self.chunks,
            where,
            starts.astype(np.int32),
            parted,
            gain,
            arrays.pack(),
            core,
            length.astype(np.int32),
            each[family].astype(np.int32),
            usual,
            eye,
            out,
        )
        return out
