"""The splatter: particles and a camera in, an image out, at tens of millions of particles a second on a CPU.

Per frame: project, shade and key all particles (`project`), sort them by depth and list them tile by tile
(`sort`), blend each tile front to back (`raster`). The same input gives the same bytes whatever the number of
chunks and threads: sorts are stable, nothing is added up atomically, and a tile belongs to one thread.
"""

import time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES, TILE

from ..data.backdrop import NO_COLOUR, NO_WALL, Backdrop
from ..data.blocks import Layout, ParticleBlocks, pack
from ..data.camera import Camera, check_size
from ..data.finish import Finish
from ..data.frame import RenderStats, SplatLists
from ..data.light import Background, Lighting
from ..data.light_sizes import MAP_SIZE
from ..data.particles import Particles
from ..data.sprites import CRISP, Profile, SpriteSheet
from ..image.tone import WHITE, Tone, tone_table
from ..light import shade as rows
from ..light.lightpass import LightMaps, LightPass, shading_of
from ..tiles.mesh import Mesh
from ..tiles.planes import borrow
from ..tiles.raster import LUT_STEPS, clear, count_opaque, raster, resolve_linear
from ..tiles.sort import BINS, count_high, count_tiles, fill_tiles, places, scatter_high, scatter_low, usual_chunks
from . import project as projection
from .constants import set_constants
from .neutral import resolve_neutral

__all__ = ["Splatter"]

MAX_TILE_ENTRIES = 2**31 - 1
"""Longest list of all tiles together; Taichi counts with 32 bits."""

LIMB_DARKENING = 0.5
"""How much darker the sides of a round thread are than its middle, at roundness 1."""


class Splatter:
    """Draws particles on images of one size. Taichi must have been started.

    width, height: image size [px], 1..16384. chunks: pieces the work is cut into; None takes the number of
    CPU threads. profile: the analytic alpha of a splat. sprites: textures instead, which are slower.
    opaque: a tile is finished when less than this share of light still passes everywhere in it.
    Raises InputError for values outside these ranges.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        chunks: int | None = None,
        profile: Profile = CRISP,
        sprites: SpriteSheet | None = None,
        opaque: float = 1 / 255,
    ) -> None:
        check_size(width, height)
        if chunks is None:
            chunks = usual_chunks()
        if not 1 <= chunks <= 1024:
            raise InputError(f"chunks: {chunks}; allowed: 1 to 1024, about the number of threads")
        if not 0 <= opaque < 1:
            raise InputError(f"opaque: {opaque}; allowed: 0 to below 1, 1/255 is half a step of 8 bits")
        self.width, self.height, self.chunks = int(width), int(height), int(chunks)
        self.profile, self.sprites, self.opaque = profile, sprites, float(opaque)
        self.stats: RenderStats | None = None
        self._tiles_x, self._tiles_y = -(-self.width // TILE), -(-self.height // TILE)
        self._tiles = self._tiles_x * self._tiles_y
        self._histogram = np.zeros((self.chunks, max(BINS, self._tiles)), np.int32)
        self._starts = np.zeros(self._tiles + 1, np.int32)
        self._lists = np.zeros(1, np.int32)
        self._planes = borrow(self, self._tiles)
        self._room = np.zeros(self._tiles * TILE * TILE, np.int32)
        self._canvas = self._room.reshape(self._tiles_y * TILE, self._tiles_x * TILE)
        self._tables: dict[Tone, NDArray[np.int32]] = {}
        self.light = LightPass()
        self._constants = np.zeros((rows.CONSTANT_ROWS, 3), np.float32)
        if sprites is None:
            self._sheet, self._levels = np.zeros(1, np.float32), np.zeros(2, np.int32)
        else:
            self._sheet, self._levels = sprites.pyramid()
        self._count = 0
        self._layout = Layout()
        self._batch = "only"
        self._options: dict[str, Any] = {}
        self._reserve(0)

    def load(self, particles: Particles | ParticleBlocks, mesh: Mesh | None = None) -> "Splatter":
        """Pack particles for `render`; the arrays are copied, or taken as they are where they lie in blocks.

        mesh: stands among them (`paint` draws it), and takes light from them. Returns the splatter itself.
        Raises InputError for too many particles or a sprite number that the sheet does not have.
        """
        if isinstance(particles, ParticleBlocks):
            return self.load_blocks(particles.layout, particles.blocks, len(particles), mesh)
        if self.sprites is not None and particles.sprite is not None and len(particles):
            low, high = int(particles.sprite.min()), int(particles.sprite.max())
            if low < 0 or high >= len(self.sprites):
                raise InputError(f"particles.sprite: {low} to {high}; allowed: 0 to {len(self.sprites) - 1}")
        self._layout, self._blocks, self._box = pack(particles, textured=self.sprites is not None)
        self._opacity = 1.0 if self._layout.opacity else float(np.float32(particles.opacity))
        self._count = len(particles)
        self.light.forget(mesh)
        self._reserve(self._blocks.shape[1])
        return self

    def load_blocks(
        self, layout: Layout, blocks: NDArray[np.float32], count: int, mesh: Mesh | None = None
    ) -> "Splatter":
        """Take particles that are in blocks already (see `blocks`), without a copy and unchecked.

        mesh: as of `load`.

        blocks: (layout.rows, ceil(count / 16), 16) float32, C-contiguous; opacity 1 where the layout has none;
        whatever must not be drawn has a radius of 0 and a place among the others.
        Raises InputError for another shape.
        """
        if blocks.shape != (layout.rows, -(-count // LANES), LANES) or layout.textured != (self.sprites is not None):
            raise InputError(f"blocks: shape {blocks.shape}; allowed: {(layout.rows, -(-count // LANES), LANES)}")
        places = blocks[:3].reshape(3, -1)
        box = np.stack([places.min(axis=1), places.max(axis=1)]) if count else np.zeros((2, 3))
        self._layout, self._blocks, self._box, self._opacity = layout, blocks, box.astype(np.float64), 1.0
        self._count = count
        self.light.forget(mesh)
        self._reserve(blocks.shape[1])
        return self

    def resize(self, width: int, height: int) -> "Splatter":
        """Draw smaller images from now on, or larger ones again; nothing is compiled or allocated anew.

        Raises InputError for more tiles than the splatter was made with.
        """
        check_size(width, height)
        tiles_x, tiles_y = -(-width // TILE), -(-height // TILE)
        if tiles_x * tiles_y >= len(self._starts):
            raise InputError(
                f"resize: {width} x {height} px; allowed: up to {len(self._starts) - 1} tiles of {TILE} px"
            )
        self.width, self.height = int(width), int(height)
        self._tiles_x, self._tiles_y, self._tiles = tiles_x, tiles_y, tiles_x * tiles_y
        self._canvas = self._room[: self._tiles * TILE * TILE].reshape(tiles_y * TILE, tiles_x * TILE)
        return self

    def begin(self, camera: Camera, **options: Any) -> "Splatter":
        """Start a picture that comes in batches: `begin`, `add` for each from the nearest on, `finish`.

        The options are those of `render`. Within a batch all is in depth order; batches lie one behind the other.
        """
        clear(self._tiles, *self._planes)
        self._options = {"camera": camera, **options}
        return self

    def add(self, particles: Particles | None = None) -> "Splatter":
        """Draw `particles`, or what is loaded, behind the batches before; opaque tiles take no more."""
        if not self._options:
            raise InputError("add: no picture begun; call begin first")
        if particles is not None:
            self.load(particles)
        self._batch = "more"
        try:
            self.render(**self._options)
        finally:
            self._batch = "only"
        return self

    def opaque_everywhere(self) -> bool:
        """Whether the batches so far leave nothing to see behind them."""
        return bool(self._tiles == count_opaque(self._tiles, self.opaque, self._planes[0]))

    def finish(self, out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """The picture of all batches, as `render` gives it."""
        if not self._options:
            raise InputError("finish: no picture begun; call begin first")
        options, self._options, self._batch = self._options, {}, "last"
        try:
            self._count, self._blocks = 0, self._blocks[:, :0]
            return self.render(**options, out=out)
        finally:
            self._batch = "only"
            self._starts[: self._tiles + 1] = np.arange(self._tiles + 1)  # no tile is known to be empty

    def render(
        self,
        camera: Camera,
        *,
        lighting: Lighting | None = None,
        finish: Finish | None = None,
        background: Background | None = None,
        backdrop: Backdrop | None = None,
        out: NDArray[np.uint8] | None = None,
    ) -> NDArray[np.uint8]:
        """The image (height, width, 3), 8-bit sRGB, of the particles loaded.

        backdrop: ground and meshes from the same camera (see `paint`), instead of the background alone.
        out: an array (height, width, 3) uint8 to write to. Without it every call returns an array of its own.
        Raises InputError when the camera's image has another size or the tile lists would be too long.
        """
        if (camera.width, camera.height) != (self.width, self.height):
            raise InputError(
                f"camera: image of {camera.width} x {camera.height} px; allowed: "
                f"{self.width} x {self.height}, the splatter's size"
            )
        lighting, finish, background = lighting or Lighting(), finish or Finish(), background or Background()
        layout, chunks, blocks = self._layout, self.chunks, self._blocks.shape[1]
        edge = 1.0 if self.sprites is not None else self.profile.edge or 0.0
        profile = {0.0: "crisp", 1.0: "soft"}.get(edge, "sharp")
        clock = [time.perf_counter()]
        set_constants(self._constants, camera, lighting, finish, self._box, opacity=self._opacity, edge=edge)
        if self._batch != "only" and self.light.held is None:  # a batch knows nothing of what would shadow it
            lighting = lighting.without_passes()
        shading = shading_of(lighting, finish)
        maps = self.cast_light(camera, lighting) if shading.rows else None
        light = self.light.on_particles(shading, layout, self._blocks, maps)
        clock.append(time.perf_counter())
        projection.project(
            layout,
            shading,
            profile == "crisp",
            chunks,
            self._blocks,
            blocks,
            light,
            self._constants,
            self._splats,
            self._boxes,
            self._keys,
            self._histogram,
        )
        clock.append(time.perf_counter())

        drawn = places(self._histogram, chunks, BINS)
        scatter_low(chunks, blocks, LANES, self._keys, self._histogram, self._order, self._high)
        count_high(chunks, drawn, self._high, self._histogram)
        places(self._histogram, chunks, BINS)
        scatter_high(chunks, drawn, self._high, self._order, self._histogram, self._sorted)
        clock.append(time.perf_counter())

        count_tiles(chunks, drawn, self._tiles_x, self._tiles, self._sorted, self._boxes, self._histogram)
        entries = places(self._histogram, chunks, self._tiles, self._starts)
        self._reserve_lists(entries)
        fill_tiles(chunks, drawn, self._tiles_x, self._sorted, self._boxes, self._histogram, self._lists)
        clock.append(time.perf_counter())

        raster(
            layout,
            profile,
            self._batch,
            chunks,
            self._tiles_x,
            self._tiles,
            self.height,
            self._starts,
            self._lists,
            self._splats,
            edge,
            LIMB_DARKENING * finish.roundness,
            self._sheet,
            self._levels,
            1 if self.sprites is None else self.sprites.size,
            background.ends(),
            self._table(lighting.tone),
            1.0 / WHITE[lighting.tone],
            self.opaque,
            "gradient" if backdrop is None else backdrop.kind,
            NO_COLOUR if backdrop is None else backdrop.colour,
            NO_WALL if backdrop is None or backdrop.wall is None else backdrop.wall,
            self._keys,
            float(self._constants[rows.DEPTH, 0]),
            1.0 / float(self._constants[rows.DEPTH, 1]),
            *self._planes,
            self._canvas,
        )
        if lighting.tone == "neutral" and self._batch != "more":
            resolve_neutral(
                self._tiles_x,
                self._tiles,
                self.height,
                self._batch == "last",
                self._starts,
                *self._planes,
                background.ends(),
                self._table("neutral"),
                backdrop is not None,
                NO_COLOUR if backdrop is None else backdrop.colour,
                self._canvas,
            )
        image = self._pixels(out)
        clock.append(time.perf_counter())
        self.stats = RenderStats(self._count, drawn, entries, *(1e3 * np.diff(clock)).tolist())
        return image

    def cast_light(self, camera: Camera, lighting: Lighting, *, resolution: int = MAP_SIZE) -> LightMaps:
        """The maps of light of what is loaded, as `render` makes them from this camera: for `paint`, and to `hold`
        for batches. resolution: texels along a shadow map, at most."""
        return self.light.cast(
            shading_of(lighting, Finish()), lighting, camera, self._layout, self._blocks, self._box,
            opacity=self._opacity, chunks=self.chunks, resolution=resolution,
        )  # fmt: skip

    def linear(self) -> NDArray[np.float32]:
        """The last frame without its background: linear premultiplied RGBA (height, width, 4) float32.

        Raises InputError before the first `render`.
        """
        if self.stats is None:
            raise InputError("linear: nothing rendered yet; call render first")
        rgba = np.empty((self.height, self.width, 4), np.float32)
        resolve_linear(self._tiles_x, self._tiles, self._starts, *self._planes, self.width, self.height, rgba)
        return rgba

    def lists(self) -> SplatLists:
        """The splats and tile lists of the last frame. Raises InputError before the first `render`."""
        if self.stats is None:
            raise InputError("passes: nothing rendered yet; call render first")
        nearest, keys_per_metre = (float(v) for v in self._constants[rows.DEPTH, :2])
        edge = 1.0 if self.sprites is not None else self.profile.edge or 0.0
        return SplatLists(
            self._layout,
            {0.0: "crisp", 1.0: "soft"}.get(edge, "sharp"),
            edge,
            self._tiles_x,
            self._tiles,
            self._starts,
            self._lists,
            self._splats,
            self._blocks,
            self._keys,
            nearest,
            1 / keys_per_metre,
            self._sheet,
            self._levels,
            1 if self.sprites is None else self.sprites.size,
        )

    def _pixels(self, out: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
        """The bytes of the canvas that are red, green and blue."""
        if self._batch == "more":
            return np.empty((0, 0, 3), np.uint8)
        shape = self.height, self.width, 3
        if out is None:
            out = np.empty(shape, np.uint8)
        if out.shape != shape or out.dtype != np.uint8:
            raise InputError(f"out: {out.dtype} {out.shape}; allowed: uint8 {shape}")
        rgbx = self._canvas[: self.height].view(np.uint8).reshape(self.height, -1, 4)[:, : self.width]
        if out.flags.c_contiguous:
            cv2.cvtColor(rgbx, cv2.COLOR_BGRA2BGR, dst=out)
        else:
            out[:] = rgbx[..., :3]
        return out

    def _table(self, tone: Tone) -> NDArray[np.int32]:
        if tone not in self._tables:
            self._tables[tone] = tone_table(tone, LUT_STEPS).astype(np.int32)
        return self._tables[tone]

    def _reserve(self, blocks: int) -> None:
        """Room for the splats of `blocks` blocks of particles."""
        count = max(blocks, 1) * LANES
        if blocks == 0:
            self._blocks = np.zeros((self._layout.rows, 0, LANES), np.float32)
            self._box = np.zeros((2, 3))
            self._opacity = 1.0
        size = self._layout.splat_size
        if not hasattr(self, "_splats") or self._splats.shape[0] < count or self._splats.shape[1] != size:
            self._splats = np.zeros((count, size), np.float32)
            self._boxes = np.zeros(count, np.int64)
            self._keys, self._order, self._high, self._sorted = (np.zeros(count, np.int32) for _ in range(4))

    def _reserve_lists(self, entries: int) -> None:
        if entries > MAX_TILE_ENTRIES:
            raise InputError(
                f"tile lists: {entries} entries; allowed: {MAX_TILE_ENTRIES}; "
                "draw a smaller image, fewer particles or smaller radii"
            )
        if entries > len(self._lists):
            self._lists = np.zeros(min(int(entries * 1.25), MAX_TILE_ENTRIES), np.int32)
