"""Particles as the kernels read them: blocks of 16, and for each number of a particle's record (`RECORD` in
`ground.particles`) a row of all blocks."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.copies import DeviceArray, every, fetched
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES, POSITION, RADIUS, RECORD

from .particles import Particles

__all__ = ["Layout", "ParticleBlocks", "pack"]

MAX_INDEX = 2**31 - 1
"""Taichi counts the elements of an array with 32-bit integers."""

FARTHEST = 1e7
"""Particles farther than this [m] from the origin are not drawn."""


@dataclass(frozen=True)
class Layout:
    """Which optional properties there are. Kernels take it as a compile-time switch: what is off costs nothing."""

    elliptic: bool = False
    openness: bool = False
    opacity: bool = False
    textured: bool = False

    @property
    def half_length_row(self) -> int:
        return self._before("half_length")

    @property
    def openness_row(self) -> int:
        return self._before("openness")

    @property
    def opacity_row(self) -> int:
        return self._before("opacity")

    @property
    def sprite_row(self) -> int:
        return self._before("sprite")

    @property
    def rows(self) -> int:
        """How many there are."""
        return self._before(None)

    @property
    def names(self) -> list[str]:
        """The properties there are, in the order of their rows."""
        optional = {"half_length": self.elliptic, "openness": self.openness}
        optional |= {"opacity": self.opacity, "sprite": self.textured}
        return [one.name for one in RECORD if optional.get(one.name, one.given == "always")]

    def _before(self, name: str | None) -> int:
        """Rows that stand before those of a property; None: all rows."""
        before = [one for one in RECORD if one.name == name]
        stop = RECORD.index(before[0]) if before else len(RECORD)
        names = self.names
        return sum(one.numbers for one in RECORD[:stop] if one.name in names)

    @property
    def of_splat(self) -> "Layout":
        """What of it shows in the splats that `project` makes of particles: all that is compiled into the raster."""
        return Layout(elliptic=self.elliptic, textured=self.textured)

    @property
    def splat_size(self) -> int:
        """Numbers that the raster reads for one splat (see `project`)."""
        return 16 if self.elliptic else 8


@dataclass(frozen=True, eq=False)
class ParticleBlocks:
    """Particles that lie in blocks already, and are drawn without a copy: whoever moves them moves the picture.

    blocks: (layout.rows, n / 16, 16) float32; opacity is 1 where the layout has none, and whatever must not be drawn
    has a radius of 0 and a place among the others.
    yarn, part: as of Particles, (n,) with the places not drawn.
    """

    blocks: NDArray[np.float32]
    layout: Layout = field(default_factory=lambda: Layout(elliptic=True, openness=True))
    yarn: NDArray[np.int32] | None = None
    part: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return self.blocks.shape[1] * LANES

    def some(self, most: int) -> tuple["ParticleBlocks", int]:
        """On the host, where they lie on a device: at most so many, every so manieth group, and how many each stands
        for. Else all."""
        if not isinstance(self.blocks, DeviceArray):
            return self, 1
        step = -(-len(self) // most)
        return ParticleBlocks(every(self.blocks, step), self.layout), step

    def _rows(self, first: int, count: int) -> NDArray[np.float32]:
        return fetched(self.blocks[first : first + count]).reshape(count, -1).T.copy()

    @property
    def position(self) -> NDArray[np.float32]:
        """(n, 3) [m], a copy."""
        return self._rows(POSITION, 3)

    @property
    def radius(self) -> NDArray[np.float32]:
        """(n,) [m], a copy."""
        return self._rows(RADIUS, 1)[:, 0]

    @property
    def half_length(self) -> NDArray[np.float32] | None:
        """(n,) [m], a copy, where the layout has it."""
        return self._rows(self.layout.half_length_row, 1)[:, 0] if self.layout.elliptic else None


def pack(particles: Particles, *, textured: bool) -> tuple[Layout, NDArray[np.float32], NDArray[np.float64]]:
    """The layout, the blocks (rows, ceil(n / 16), 16) float32, and the box (2, 3) [m] that holds what is drawn.

    Whatever must not be drawn (a value that is not finite, a radius or half length of zero or below, a place
    beyond 1e7 m) gets a radius of 0 and zeros elsewhere, as do the places that fill up the last block.
    Raises InputError for more particles than 32-bit indices can count.
    """
    layout = Layout(
        elliptic=particles.half_length is not None,
        openness=particles.openness is not None,
        opacity=np.ndim(particles.opacity) > 0,
        textured=textured,
    )
    count = len(particles)
    limit = MAX_INDEX // max(layout.rows, layout.splat_size) - LANES
    if count > limit:
        raise InputError(f"particles: {count}; allowed: up to {limit} at once; draw them in several parts")
    columns = []
    for name in layout.names:
        values = getattr(particles, name)
        if values is None:  # no numbers of sprites: all are the first
            values = np.zeros(count, np.float32)
        values = np.asarray(values, np.float32)
        columns += [*values.T] if values.ndim == 2 else [values]

    drawn = None if _all_drawn(particles, columns) else _drawn(particles, columns)
    blocks = np.zeros((layout.rows, -(-count // LANES), LANES), np.float32)
    for row, column in enumerate(columns):
        values = column if drawn is None else np.where(drawn, column, np.float32(0))
        blocks[row].reshape(-1)[:count] = values
    positions = particles.position if drawn is None else particles.position[drawn]
    box = np.stack([positions.min(axis=0), positions.max(axis=0)]) if len(positions) else np.zeros((2, 3))
    return layout, blocks, box.astype(np.float64)


def _drawn(particles: Particles, columns: list[NDArray[np.float32]]) -> NDArray[np.bool_]:
    """Which of them are, (n,)."""
    drawn = particles.radius > 0
    for column in columns:
        drawn &= np.isfinite(column)
    if particles.half_length is not None:
        drawn &= particles.half_length > 0
    return drawn & (np.abs(particles.position).max(axis=1, initial=0) < FARTHEST)


def _all_drawn(particles: Particles, columns: list[NDArray[np.float32]]) -> bool:
    """Whether all of them surely are, found without looking at each: a sum is finite only of values that are."""
    least = [one.min(initial=1) for one in (particles.radius, particles.half_length) if one is not None]
    return (
        min(least) > 0
        and all(np.isfinite(column.sum()) for column in columns)
        and float(np.abs(particles.position).max(initial=0)) < FARTHEST
    )
