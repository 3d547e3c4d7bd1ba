"""Pictures for people who make data: depth, normal, coverage and the number of what is seen, pixel by pixel.

They follow the same tile lists and the same alpha as the colour image, so they lie on it exactly. With T the light
that still passes, front to back,

    depth      where T falls through 0.5: the front of that particle, as a ball of its radius (a round thread for
               an elliptic one) [m along the viewing direction]; 0 where T stays above
    hit        which particle that is, -1 for none; from it come yarn and part, never blended
    normal     sum of T alpha n over all particles, made unit; world axes; 0 where less than LEAST is covered
    coverage   1 - T

A mesh counts as an opaque surface. This kernel is slower than `raster` and runs only when asked.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x1, I32x2, Int, Template
from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.particles import LANES, NORMAL, RADIUS, TILE
from taichi_cloth.ground.vectors import Vec16, keep

from ..data.backdrop import Backdrop
from ..data.blocks import ParticleBlocks
from ..data.camera import Camera
from ..data.particles import Particles
from ..tiles.mesh import Mesh, from_behind, normals_at
from ..tiles.raster import row_from_sprite
from .splat import Splatter

__all__ = ["PASSES", "PassTaker", "Passes", "check_passes", "render_passes"]

PASSES = ("depth", "normal", "mask", "id")

LEAST = 1 / 65535
"""Coverage below which a pixel is empty: a step of 16 bits."""


@dataclass(frozen=True, eq=False)
class Passes:
    """The passes asked for; the others are None."""

    depth: NDArray[np.float32] | None = None
    """[m] along the viewing direction, shape (h, w); 0 where nothing is."""
    normal: NDArray[np.float32] | None = None
    """Unit, world axes, shape (h, w, 3); 0 where nothing is."""
    mask: NDArray[np.float32] | None = None
    """Coverage 0..1, shape (h, w)."""
    yarn: NDArray[np.int32] | None = None
    """Number of the yarn, shape (h, w); -1 where there is none."""
    part: NDArray[np.int32] | None = None
    """Number of the part, shape (h, w); -1 where there is none."""


def check_passes(which: tuple[str, ...]) -> None:
    """Raises InputError for a pass that is not known."""
    for name in which:
        if name not in PASSES:
            known = ", ".join(PASSES)
            raise InputError(f"passes: unknown pass {name!r}; known: {known}{did_you_mean(name, PASSES)}")


def render_passes(
    splatter: Splatter,
    camera: Camera,
    particles: Particles | ParticleBlocks,
    which: tuple[str, ...] = PASSES,
    *,
    backdrop: Backdrop | None = None,
    mesh: Mesh | None = None,
) -> Passes:
    """The passes of what `splatter` has just drawn from `camera` with `load` and `render`.

    particles: those that are loaded, for their yarn and part numbers. mesh: the one that `backdrop` shows.
    Raises InputError for a pass that is not known, when something else is loaded, or when nothing is drawn yet.
    """
    check_passes(which)
    splatter.lists()
    loaded = splatter.stats.particles if splatter.stats else 0
    if len(particles) != loaded:
        raise InputError(f"passes: {len(particles)} particles; allowed: the {loaded} that are loaded")
    taken = PassTaker(camera, which, backdrop=backdrop)
    return taken.add(splatter, particles.yarn, particles.part).finish(mesh)


class PassTaker:
    """The passes of a picture that comes in batches: `add` after each `Splatter.add`, then `finish`."""

    def __init__(self, camera: Camera, which: tuple[str, ...] = PASSES, *, backdrop: Backdrop | None = None) -> None:
        check_passes(which)
        self.camera, self.which, self.backdrop = camera, which, backdrop
        self._tiles_x = -(-camera.width // TILE)
        rows = self._tiles_x * -(-camera.height // TILE) * TILE
        self._hits, self._normals, ids = "depth" in which or "id" in which, "normal" in which, "id" in which
        self._through = np.ones((rows, TILE), np.float32)
        self._depth = np.zeros((rows, TILE) if self._hits else (1, 1), np.float32)
        self._normal = np.zeros((rows, TILE, 3) if self._normals else (1, 1, 3), np.float32)
        self._number = {name: np.full((rows, TILE) if ids else (1, 1), -1, np.int32) for name in ("yarn", "part")}

    def add(
        self, splatter: Splatter, yarn: NDArray[np.int32] | None = None, part: NDArray[np.int32] | None = None
    ) -> "PassTaker":
        """Take what `splatter` has just drawn, behind what was taken before. yarn, part: numbers of its particles."""
        lists = splatter.lists()
        wall = None if self.backdrop is None or self.backdrop.wall is None else self.backdrop.wall.reshape(-1, TILE)
        hit = np.full(self._depth.shape, -1, np.int32)
        _passes(
            lists.layout,
            lists.profile,
            self._hits,
            self._normals,
            wall is not None,
            splatter.chunks,
            lists.tiles_x,
            lists.tiles,
            self.camera.focal,
            lists.starts,
            lists.entries,
            lists.splats,
            lists.blocks,
            lists.keys,
            lists.nearest,
            lists.key_depth,
            lists.edge,
            lists.sheet,
            lists.levels,
            lists.sprite_size,
            np.zeros((1, 1), np.float32) if wall is None else wall,
            self._through,
            self._depth,
            hit,
            self._normal,
        )
        if "id" in self.which:
            for name, numbers in (("yarn", yarn), ("part", part)):
                if numbers is not None and len(numbers):
                    self._number[name][hit >= 0] = numbers[hit[hit >= 0]]
        return self

    def finish(self, mesh: Mesh | None = None) -> Passes:
        """The passes of all that was taken, and of the mesh that the backdrop shows."""
        camera, which, backdrop = self.camera, self.which, self.backdrop
        size = camera.height, camera.width
        through, depth, normal = (_whole(a, self._tiles_x, size) for a in (self._through, self._depth, self._normal))
        made: dict[str, NDArray] = {"mask": 1 - through, "depth": depth, "normal": normal}
        made |= {name: _whole(image, self._tiles_x, size) for name, image in self._number.items()}
        if mesh is not None and backdrop is not None and backdrop.face is not None and backdrop.wall is not None:
            face = backdrop.face[:, : camera.width]
            bare = (face >= 0) & (through > 0.5)
            made["mask"][face >= 0] = 1
            if self._hits:
                depth[bare] = _whole(backdrop.wall.reshape(-1, TILE), self._tiles_x, size)[bare]
            if "id" in which:
                made["part"][bare] = np.asarray(mesh.part)[face[bare]]
            if self._normals:
                row, column = np.nonzero(face >= 0)
                of_mesh = normals_at(mesh, face, backdrop.edges, from_behind(mesh, camera), row, column)
                normal[row, column] += through[row, column, None] * of_mesh
        if self._normals:
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            there = (length > 0) & (made["mask"][..., None] >= LEAST)
            made["normal"] = np.where(there, normal / np.where(there, length, 1), np.float32(0))
        wanted = set(which) | ({"yarn", "part"} if "id" in which else set())
        return Passes(**{name: image for name, image in made.items() if name in wanted})


def _whole(tiles: NDArray, tiles_x: int, size: tuple[int, int]) -> NDArray:
    """An image (h, w, …) from tiles one below the other (tiles * 16, 16, …)."""
    if len(tiles) == 1:
        return tiles
    extra = tiles.shape[2:]
    image = tiles.reshape(-1, tiles_x, TILE, TILE, *extra).swapaxes(1, 2).reshape(-1, tiles_x * TILE, *extra)
    return np.ascontiguousarray(image[: size[0], : size[1]])


@ti.kernel
def _passes(
    layout: Template,
    profile: Template,
    hits: Template,
    normals: Template,
    walled: Template,
    blocks: Int,
    tiles_x: Int,
    tiles: Int,
    focal: Float,
    # splats:
    starts: I32x1,
    lists: I32x1,
    splats: F32x2,
    particles: F32x3,
    keys: I32x1,
    nearest: Float,
    key_depth: Float,
    # sprite:
    edge: Float,
    sheet: F32x1,
    levels: I32x1,
    sprite_size: Int,
    # what stands behind:
    wall: F32x2,
    # out, a tile's rows one below the other:
    through_out: F32x2,
    depth_out: F32x2,
    hit_out: I32x2,
    normal_out: F32x3,
):
    """Alpha is `raster`'s, row by row; see there and `project` for what a splat's numbers are."""
    keep(hit_out, (0, 0), tiles)
    keep(depth_out, (0, 0), tiles)
    rounds = ti.max(512, (tiles + blocks - 1) // blocks)
    for step in range(rounds * blocks):
        tile = (step % rounds) * blocks + step // rounds
        if tile < tiles:
            x0 = (tile % tiles_x) * TILE
            y0 = (tile // tiles_x) * TILE
            iota = Vec16([0.5 + k for k in range(LANES)])
            for i in range(starts[tile], starts[tile + 1]):
                k = lists[i]
                z = nearest + key_depth * ti.cast(keys[k], ti.f32)
                radius = particles[RADIUS, k // LANES, k % LANES]
                narrow = radius * focal / z  # [px], as `reach` would be without a rim
                dx = iota - (splats[k, 0] - x0)
                middle = splats[k, 1] - y0
                reach = splats[k, 6]
                first = ti.max(0, ti.cast(ti.ceil(middle - reach - 0.5), ti.i32))
                last = ti.min(TILE - 1, ti.cast(ti.floor(middle + reach - 0.5), ti.i32))
                for y in range(first, last + 1):
                    dy = y + 0.5 - middle
                    alpha = Vec16(0.0)
                    rise = Vec16(0.0)  # 1 - (distance from the middle or the axis, in radii)^2
                    if ti.static(layout.elliptic):
                        s = dx * splats[k, 7] + dy * splats[k, 8]
                        t = dx * splats[k, 9] + dy * splats[k, 10]
                        wide = ti.rsqrt(splats[k, 7] * splats[k, 7] + splats[k, 8] * splats[k, 8])
                        rise = 1.0 - (s * wide / narrow) * (s * wide / narrow)
                        if ti.static(layout.textured):
                            number = ti.cast(splats[k, 13], ti.i32)
                            s0 = dx * splats[k, 7]
                            t0 = dx * splats[k, 9]
                            alpha = row_from_sprite(
                                sheet, levels, sprite_size, number, wide, s0, t0, splats[k, 8], splats[k, 10], dy
                            )
                        else:
                            q = ti.max(1.0 - s * s - t * t, 0.0)
                            if ti.static(profile == "crisp"):
                                q = ti.max(1.0 - s * s - t * t * splats[k, 14], 0.0)
                                q = ti.min(q * splats[k, 12], 1.0)
                                q *= ti.min(ti.max(1.0 - t * t, 0.0) * splats[k, 15], 1.0)
                            if ti.static(profile == "sharp"):
                                q = ti.min(q * splats[k, 12], 1.0)
                            alpha = q * q
                    else:
                        rho = (dx * dx + dy * dy) / (reach * reach)
                        rise = 1.0 - rho * (reach / narrow) * (reach / narrow)
                        if ti.static(layout.textured):
                            number = ti.cast(splats[k, 7], ti.i32)
                            one = 1.0 / reach
                            alpha = row_from_sprite(
                                sheet, levels, sprite_size, number, reach, Vec16(0.0), dx * one, one, 0.0, dy
                            )
                        else:
                            sharp = 1.0
                            if ti.static(profile == "crisp"):
                                sharp = ti.max(0.5 * reach, 1.0)
                            if ti.static(profile == "sharp"):
                                sharp = edge
                            q = ti.min(ti.max(1.0 - rho, 0.0) * sharp, 1.0)
                            alpha = q * q
                    at = tile * TILE + y
                    for x in range(LANES):
                        light = through_out[at, x]
                        weight = light * alpha[x] * splats[k, 2]
                        if ti.static(walled):
                            weight = ti.select(z < wall[at, x], weight, 0.0)
                        if weight > 0.0:
                            left = light - weight
                            through_out[at, x] = left
                            if ti.static(hits):
                                crosses = light > 0.5 and left <= 0.5
                                if crosses:
                                    hit_out[at, x] = k
                                    depth_out[at, x] = z - radius * ti.sqrt(ti.max(rise[x], 0.0))
                            if ti.static(normals):
                                for c in ti.static(range(3)):
                                    normal_out[at, x, c] += weight * particles[NORMAL + c, k // LANES, k % LANES]
