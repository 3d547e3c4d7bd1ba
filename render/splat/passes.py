"""Pictures for people who make data: depth, normal, coverage and the number of what is seen, pixel by pixel.

They follow the same tile lists and the same alpha as the colour image, so they lie on it exactly. With T the light
that still passes, front to back,

    depth      where T falls through 0.5: the front of that particle, as a ball of its radius (a round thread for
               an elliptic one) [m along the viewing direction]; 0 where T stays above
    hit        which particle that is, -1 for none; from it come yarn and part, never blended
    normal     sum of T alpha n over all particles, made unit; world axes; 0 where less than LEAST is covered
    coverage   1 - T

A mesh counts as an opaque surface. The kernel (`pass_raster`) is slower than `raster` and runs only when asked.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.ground.particles import TILE

from ..data.backdrop import Backdrop
from ..data.blocks import ParticleBlocks
from ..data.camera import Camera
from ..data.particles import Particles
from ..tiles.mesh import Mesh, from_behind, normals_at
from .pass_raster import DEPTH, FACING, PASSING, Wanted, raster_passes
from .splat import Splatter

__all__ = ["PASSES", "PassTaker", "Passes", "check_passes", "render_passes"]

PASSES = ("depth", "normal", "mask", "id")

NO_WALL = np.zeros((1, 1), np.float32)

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
        ids = "id" in which
        self._wanted = Wanted(hits="depth" in which or ids, normals="normal" in which)
        self._seen = np.zeros((self._wanted.planes, rows, TILE), np.float32)
        self._seen[PASSING] = 1
        self._number = {name: np.full((rows, TILE) if ids else (1, 1), -1, np.int32) for name in ("yarn", "part")}

    def add(
        self, splatter: Splatter, yarn: NDArray[np.int32] | None = None, part: NDArray[np.int32] | None = None
    ) -> "PassTaker":
        """Take what `splatter` has just drawn, behind what was taken before. yarn, part: numbers of its particles."""
        lists = splatter.lists()
        wall = None if self.backdrop is None or self.backdrop.wall is None else self.backdrop.wall.reshape(-1, TILE)
        hit = np.full(self._seen.shape[1:] if self._wanted.hits else (1, 1), -1, np.int32)
        raster_passes(
            replace(lists.features, turn="only", behind="gradient" if wall is None else "mesh"),
            self._wanted,
            lists.picture,
            lists.starts,
            lists.entries,
            lists.splats,
            lists.blocks,
            lists.keys,
            lists.sheet,
            NO_WALL if wall is None else wall,
            self._seen,
            hit,
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
        planes = [_whole(plane, self._tiles_x, size) for plane in self._seen]
        through, hits, normals = planes[PASSING], self._wanted.hits, self._wanted.normals
        made: dict[str, NDArray] = {"mask": 1 - through}
        if hits:
            made["depth"] = planes[DEPTH]
        if normals:
            made["normal"] = np.stack(planes[FACING:], axis=-1)
        made |= {name: _whole(image, self._tiles_x, size) for name, image in self._number.items()}
        if mesh is not None and backdrop is not None and backdrop.face is not None and backdrop.wall is not None:
            face = backdrop.face[:, : camera.width]
            bare = (face >= 0) & (through > 0.5)
            made["mask"][face >= 0] = 1
            if hits:
                made["depth"][bare] = _whole(backdrop.wall.reshape(-1, TILE), self._tiles_x, size)[bare]
            if "id" in which:
                made["part"][bare] = np.asarray(mesh.part)[face[bare]]
            if normals:
                row, column = np.nonzero(face >= 0)
                of_mesh = normals_at(mesh, face, backdrop.edges, from_behind(mesh, camera), row, column)
                made["normal"][row, column] += through[row, column, None] * of_mesh
        if normals:
            normal = made["normal"]
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            there = (length > 0) & (made["mask"][..., None] >= LEAST)
            made["normal"] = np.where(there, normal / np.where(there, length, 1), np.float32(0))
        wanted = set(which) | ({"yarn", "part"} if "id" in which else set())
        return Passes(**{name: image for name, image in made.items() if name in wanted})


def _whole(tiles: NDArray, tiles_x: int, size: tuple[int, int]) -> NDArray:
    """An image (h, w) from tiles one below the other (tiles * 16, 16)."""
    if len(tiles) == 1:
        return tiles
    image = tiles.reshape(-1, tiles_x, TILE, TILE).swapaxes(1, 2).reshape(-1, tiles_x * TILE)
    return np.ascontiguousarray(image[: size[0], : size[1]])
