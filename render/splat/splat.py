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

from taichi_cloth.ground.copies import extent, fetched, put, sent, zeros
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import LANES, NORMAL, TILE
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.ground.vectors import in_octets

from ..data.backdrop import NO_WALL, Backdrop
from ..data.blocks import Layout, ParticleBlocks, pack
from ..data.camera import Camera, check_size
from ..data.finish import Finish
from ..data.light import Background, Lighting
from ..data.light_sizes import MAP_SIZE
from ..data.particles import Particles
from ..data.sprites import CRISP, Profile, SpriteSheet
from ..image.tone import WHITE, Tone, tone_table
from ..light import view as rows
from ..light.lean import lean
from ..light.particle_light import LightMaps, ParticleLight, shading_of
from ..tiles.lists import TileLists
from ..tiles.mesh import Mesh
from ..tiles.picture import Features, RimShape, Turn, new_picture
from ..tiles.pixels import raster_pixels
from ..tiles.planes import borrow
from ..tiles.raster import clear, count_opaque, raster, resolve_linear
from ..tiles.rows import LUT_STEPS
from ..tiles.sort import usual_chunks
from .drawn import RenderStats, SplatLists
from .neutral import resolve_neutral
from .project import project

__all__ = ["Splatter"]

CLOTH = Finish(depth=1e-3)
"""Needs every map of light that a finish may need."""
UPRIGHT = 0.0, 0.0, 0.0, 0.0
"""How far normals lean, and to what place, where they do not (`lean`)."""


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
        across, down = -(-self.width // TILE), -(-self.height // TILE)
        tiles = across * down
        self._lists = TileLists(self.chunks, tiles)
        self._planes = borrow(self, tiles)
        self._room = zeros(tiles * TILE * TILE, np.int32)
        self._tables: dict[Tone, NDArray[np.int32]] = {}
        self.light = ParticleLight()
        self._view = rows.new_view()
        self._picture = new_picture(shares=self.chunks, opaque=self.opaque)
        self._sheet = np.zeros(1, np.float32)
        if sprites is not None:
            self._sheet = sent(sprites.pyramid())
            self._picture.sprite_size, self._picture.sprite_texels = sprites.size, len(self._sheet) // len(sprites)
        self._picture.edge = 1.0 if sprites is not None else float(profile.edge or 0.0)
        profiles: dict[float, RimShape] = {0.0: "crisp", 1.0: "soft"}
        self._profile: RimShape = profiles.get(self._picture.edge, "sharp")
        self._set_size(self.width, self.height)
        self._count = 0
        self._upright: NDArray[np.float32] | None = None
        self._leant = UPRIGHT
        self._layout = Layout()
        self._turn: Turn = "only"
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
        layout, blocks, box = pack(particles, textured=self.sprites is not None)
        opacity = 1.0 if layout.opacity else float(np.float32(particles.opacity))
        return self._take(layout, sent(blocks), box, opacity, len(particles), mesh)

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
        return self._take(layout, sent(blocks), extent(blocks), 1.0, count, mesh)

    def _take(
        self,
        layout: Layout,
        blocks: NDArray[np.float32],
        box: NDArray[np.float64],
        opacity: float,
        count: int,
        mesh: Mesh | None,
    ) -> "Splatter":
        """Particles in blocks in place of those before, of which nothing is known yet. box: (2, 3) [m] that holds them.
        opacity: of all where the layout has none."""
        self._layout, self._blocks, self._box, self._opacity, self._count = layout, blocks, box, opacity, count
        self._upright, self._leant = None, UPRIGHT
        self.light.forget(mesh)
        self._reserve(blocks.shape[1])
        return self

    def resize(self, width: int, height: int) -> "Splatter":
        """Draw smaller images from now on, or larger ones again; nothing is compiled or allocated anew.

        Raises InputError for more tiles than the splatter was made with.
        """
        check_size(width, height)
        if -(-width // TILE) * -(-height // TILE) >= len(self._lists.starts):
            most = len(self._lists.starts) - 1
            raise InputError(f"resize: {width} x {height} px; allowed: up to {most} tiles of {TILE} px")
        self._set_size(int(width), int(height))
        return self

    def begin(self, camera: Camera, **options: Any) -> "Splatter":
        """Start a picture that comes in batches: `begin`, `add` for each from the nearest on, `finish`.

        The options are those of `render`. Within a batch all is in depth order; batches lie one behind the other.
        """
        clear(self._picture.tiles, self._planes)
        self._options = {"camera": camera, **options}
        return self

    def add(self, particles: Particles | None = None) -> "Splatter":
        """Draw `particles`, or what is loaded, behind the batches before; opaque tiles take no more."""
        if not self._options:
            raise InputError("add: no picture begun; call begin first")
        if particles is not None:
            self.load(particles)
        self._turn = "more"
        try:
            self.render(**self._options)
        finally:
            self._turn = "only"
        return self

    def opaque_everywhere(self) -> bool:
        """Whether the batches so far leave nothing to see behind them."""
        return bool(self._picture.tiles == count_opaque(self._picture, self._planes))

    def finish(self, out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
        """The picture of all batches, as `render` gives it."""
        if not self._options:
            raise InputError("finish: no picture begun; call begin first")
        options, self._options, self._turn = self._options, {}, "last"
        try:
            self._count, self._blocks = 0, self._blocks[:, :0]
            return self.render(**options, out=out)
        finally:
            self._turn = "only"
            tiles = self._picture.tiles
            put(self._lists.starts[: tiles + 1], np.arange(tiles + 1, dtype=np.int32))  # no tile is known to be empty

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
        lighting, finish = lighting or Lighting(), finish or Finish()
        clock = [time.perf_counter()]

        # What light reaches the particles.
        self._lean(camera, finish.to_eye)
        self._set_numbers(camera, lighting, finish)
        if self._turn != "only" and self.light.held is None:  # a batch knows nothing of what would shadow it
            lighting = lighting.without_maps()
        shading = shading_of(lighting, finish)
        maps = (self.light.held or self.cast_light(camera, lighting)) if shading.rows else None
        light = self.light.on_particles(shading, self._layout, self._blocks, maps, finish.depth)
        if maps is not None and shading.bulk:
            rows.set_bulk(self._view, finish, maps.coarse(finish.depth), maps.blind(finish.depth))
        clock.append(time.perf_counter())

        # Where each lands on the image, how large and how bright.
        lists, blocks = self._lists, self._blocks.shape[1]
        project(
            self._layout,
            shading,
            self._profile == "crisp",
            self.chunks,
            in_octets(self._blocks),
            blocks,
            in_octets(light),
            self._view,
            self._splats,
            lists.boxes,
            lists.keys,
            lists.histogram,
        )
        clock.append(time.perf_counter())

        # The nearest first, and tile by tile.
        drawn = lists.sort(blocks)
        clock.append(time.perf_counter())
        entries = lists.fill(drawn, self._picture.across, self._picture.tiles)
        clock.append(time.perf_counter())

        # Blended and shown.
        self._features = Features(
            self._layout.of_splat, self._profile, self._turn, "gradient" if backdrop is None else backdrop.kind
        )
        colours = (background or Background()).rows(self.height) if backdrop is None else sent(backdrop.colour)
        wall = NO_WALL if backdrop is None or backdrop.wall is None else sent(backdrop.wall)
        draw = raster if on_host() else raster_pixels
        draw(
            self._features,
            self._picture,
            lists.starts,
            lists.entries,
            self._splats,
            lists.keys,
            self._sheet,
            colours,
            wall,
            self._table(lighting.tone),
            self._planes,
            self._canvas,
        )
        if lighting.tone == "neutral" and self._turn != "more":
            table = self._table("neutral")
            resolve_neutral(self._features, self._picture, lists.starts, self._planes, colours, table, self._canvas)
        image = self._pixels(out)
        clock.append(time.perf_counter())
        self.stats = RenderStats(self._count, drawn, entries, *(1e3 * np.diff(clock)).tolist())
        return image

    def _lean(self, camera: Camera, by: float) -> None:
        """Have normals lean to the eye by so much, those of blocks that were taken as they are, too."""
        x, y, z = camera.eye.tolist()
        leant = (by, x, y, z) if by else UPRIGHT
        if leant != self._leant and self._count:
            if self._upright is None:
                self._upright = sent(fetched(self._blocks[NORMAL : NORMAL + 3]).copy())
            lean(self._layout, *leant, self._upright, self._blocks)
            self._leant = leant
            self.light.turned()

    def cast_light(self, camera: Camera, lighting: Lighting, *, resolution: int = MAP_SIZE) -> LightMaps:
        """The maps of light of what is loaded, as `render` makes them from this camera: for `paint`, and to `hold`
        for batches. resolution: texels along a shadow map, at most."""
        return self.light.cast(
            shading_of(lighting, CLOTH), lighting, camera, self._layout, self._blocks, self._box,
            opacity=self._opacity, chunks=self.chunks, resolution=resolution,
        )  # fmt: skip

    def linear(self) -> NDArray[np.float32]:
        """The last frame without its background: linear premultiplied RGBA (height, width, 4) float32.

        Raises InputError before the first `render`.
        """
        if self.stats is None:
            raise InputError("linear: nothing rendered yet; call render first")
        rgba = np.empty((self.height, self.width, 4), np.float32)
        resolve_linear(self._picture, self._lists.starts, self._planes, rgba)
        return rgba

    def lists(self) -> SplatLists:
        """The splats and tile lists of the last frame. Raises InputError before the first `render`."""
        if self.stats is None:
            raise InputError("passes: nothing rendered yet; call render first")
        lists = self._lists
        return SplatLists(
            self._features,
            self._picture,
            lists.starts,
            lists.entries,
            self._splats,
            self._blocks,
            lists.keys,
            self._sheet,
        )

    def _set_size(self, width: int, height: int) -> None:
        """The size of the image [px], in whole tiles where kernels write it."""
        across, down = -(-width // TILE), -(-height // TILE)
        self.width, self.height = width, height
        picture = self._picture
        picture.width, picture.height, picture.across, picture.tiles = width, height, across, across * down
        self._canvas = self._room[: across * down * TILE * TILE].reshape(down * TILE, across * TILE)

    def _set_numbers(self, camera: Camera, lighting: Lighting, finish: Finish) -> None:
        """The numbers of one picture, for `project` and for `raster`."""
        view, picture = self._view, self._picture
        rows.set_view(view, camera, lighting)
        rows.set_finish(view, camera, lighting, finish, self._box, opacity=self._opacity, edge=picture.edge)
        picture.focal = float(camera.focal)
        picture.nearest, picture.key_depth = float(view[rows.DEPTH, 0]), 1.0 / float(view[rows.DEPTH, 1])
        picture.darkening = float(view[rows.COAT, 2])
        picture.gain = 1.0 / WHITE[lighting.tone]

    def _pixels(self, out: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
        """The bytes of the canvas that are red, green and blue."""
        if self._turn == "more":
            return np.empty((0, 0, 3), np.uint8)
        shape = self.height, self.width, 3
        if out is None:
            out = np.empty(shape, np.uint8)
        if out.shape != shape or out.dtype != np.uint8:
            raise InputError(f"out: {out.dtype} {out.shape}; allowed: uint8 {shape}")
        rgbx = fetched(self._canvas[: self.height]).view(np.uint8).reshape(self.height, -1, 4)[:, : self.width]
        if out.flags.c_contiguous:
            cv2.cvtColor(rgbx, cv2.COLOR_BGRA2BGR, dst=out)
        else:
            out[:] = rgbx[..., :3]
        return out

    def _table(self, tone: Tone) -> NDArray[np.int32]:
        if tone not in self._tables:
            self._tables[tone] = sent(tone_table(tone, LUT_STEPS).astype(np.int32))
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
            self._splats = zeros((count, size))
            self._lists.reserve(count)
