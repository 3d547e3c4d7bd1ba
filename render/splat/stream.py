"""Pictures of more than fits in memory: the image is cut into windows, and what each shows is made, drawn, dropped.

A source says where its pieces are on the image and how many particles each has; windows are halved until what
lies in one is a batch. A window is drawn whole, with its own depth order, so nothing shows where two meet: the
picture is that of one batch. Pieces that reach into two windows are made twice, pieces out of view or behind a mesh
never. Where even a single tile has too much behind it, batches lie one behind the other, nearest first, until it is
opaque: each is a slab of depth, and has of pieces that reach out of it the particles in it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x1, F32x3, Float
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.particles import LANES, POSITION, RADIUS, TILE

from ..data.backdrop import Backdrop
from ..data.blocks import Layout
from ..data.camera import Camera
from ..data.light import Background
from ..tiles.mesh import Mesh
from .hidden import not_hidden
from .passes import PASSES, Passes, PassTaker, check_passes
from .splat import Splatter

__all__ = ["STREAMED", "Source", "StreamStats", "stream", "stream_passes"]

STREAMED = Layout(elliptic=True, openness=True)
"""The rows of the particles that a source lays."""

FAR = 1e30
"""Beyond all that is seen [m]."""
WASTE = 1.5
"""Windows are not halved further where that makes pieces more than this many times over."""


class Seen(Protocol):
    """boxes: (n, 4) int16 first and last tile column and row of each piece; counts: (n,) particles of each, 0 where
    out of view; depth: (n,) of its middle [m]; reach: (n,) how far its particles lie from there at most [m]."""

    boxes: Any
    counts: Any
    depth: Any
    reach: Any


class Source(Protocol):
    """Particles that are made when they are needed."""

    def survey(self, camera: Any, /) -> Any: ...

    def lay(self, survey: Any, blocks: Any, /) -> tuple[NDArray[np.float32], int]: ...


Drawn = Callable[[Camera, tuple[int, int, int, int], Backdrop | None, Any, NDArray[np.int32]], None]
"""Called after each batch with its window's camera, the window (top, bottom, left, right) [px], what stands behind it,
the survey and the pieces."""


@dataclass(frozen=True)
class StreamStats:
    """pieces: in view, and not behind a mesh. particles: made, with those made twice. batches: drawn. largest:
    particles of a batch."""

    pieces: int
    particles: int
    batches: int
    largest: int


def stream(
    splatter: Splatter,
    camera: Camera,
    source: Source,
    *,
    most: int = 1_000_000,
    background: Background | None = None,
    backdrop: Backdrop | None = None,
    out: NDArray[np.uint8] | None = None,
    linear: NDArray[np.float32] | None = None,
    drawn: Drawn | None = None,
    **options: Any,
) -> tuple[NDArray[np.uint8], StreamStats]:
    """The image (height, width, 3) 8-bit sRGB of all that `source` shows, about `most` particles at a time, and what
    else reaches into a slab of depth from before and from behind it.

    The splatter must have the camera's size. linear: an array (height, width, 4) that takes what `Splatter.linear`
    gives. Other options are those of `Splatter.render`. Batches know nothing of one another: for shadows and occlusion
    the splatter has to hold the light maps of the whole (`splatter.light.hold(splatter.cast_light(…))`).
    """
    width, height = splatter.width, splatter.height
    image = np.empty((height, width, 3), np.uint8) if out is None else out
    background = background or Background()
    if backdrop is not None:
        backdrop = replace(backdrop, colour=fetched(backdrop.colour))  # it is cut into windows
    if splatter.light.held is None and "lighting" in options and options["lighting"] is not None:
        options["lighting"] = options["lighting"].without_maps()
    seen = source.survey(camera)
    ids = not_hidden(seen, np.flatnonzero(seen.counts).astype(np.int32), camera, backdrop)
    made = batches = largest = 0
    try:
        for x0, y0, x1, y1, inside in windows(seen, ids, -(-width // TILE), -(-height // TILE), most):
            left, top, right, bottom = x0 * TILE, y0 * TILE, min(x1 * TILE, width), min(y1 * TILE, height)
            splatter.resize(right - left, bottom - top)
            near = replace(camera, cx=camera.cx - left, cy=camera.cy - top, width=right - left, height=bottom - top)
            seen_behind = None if backdrop is None else _window(backdrop, x0, y0, x1, y1, bottom - top)
            behind = {"background": _part(background, top / height, bottom / height), "backdrop": seen_behind}
            parts = list(_batches(seen, inside, most))
            if len(parts) > 1:
                splatter.begin(near, **behind, **options)
            for part, nearest, farthest in parts:
                blocks, count = source.lay(seen, part)
                if len(parts) > 1:
                    _cut(blocks, _ahead(camera), nearest, farthest)
                made, batches, largest = made + count, batches + 1, max(largest, count)
                splatter.load_blocks(STREAMED, blocks, count)
                if len(parts) == 1:
                    image[top:bottom, left:right] = splatter.render(near, **behind, **options)
                else:
                    splatter.add()
                if drawn is not None:
                    drawn(near, (top, bottom, left, right), seen_behind, seen, part)
                if len(parts) > 1 and splatter.opaque_everywhere():
                    break
            if len(parts) > 1:
                image[top:bottom, left:right] = splatter.finish()
            if linear is not None:
                linear[top:bottom, left:right] = splatter.linear()
    finally:
        splatter.resize(width, height)
    return image, StreamStats(len(ids), made, batches, largest)


def stream_passes(
    splatter: Splatter,
    camera: Camera,
    source: Source,
    which: tuple[str, ...] = PASSES,
    *,
    mesh: Mesh | None = None,
    **options: Any,
) -> tuple[NDArray[np.uint8], Passes]:
    """The image as `stream` makes it and its passes.

    Yarn and part numbers come from `source.numbers(survey, pieces)`, two arrays for the particles that `lay` makes
    of them; without that method there are none. mesh: the one that the backdrop shows. Options are those of `stream`.
    """
    check_passes(which)
    numbers = getattr(source, "numbers", None) if "id" in which else None
    size = camera.height, camera.width
    whole: dict[str, NDArray] = {}
    open_window: list[tuple[tuple[int, int, int, int], PassTaker]] = []

    def close() -> None:
        for (top, bottom, left, right), taker in open_window:
            passes = taker.finish(mesh)
            for field in fields(Passes):
                image = getattr(passes, field.name)
                if image is not None:
                    nothing = -1 if field.name in ("yarn", "part") else 0
                    into = whole.setdefault(field.name, np.full((*size, *image.shape[2:]), nothing, image.dtype))
                    into[top:bottom, left:right] = image
        open_window.clear()

    def drawn(
        near: Camera,
        window: tuple[int, int, int, int],
        behind: Backdrop | None,
        seen: Any,
        pieces: NDArray[np.int32],
    ) -> None:
        if not open_window or open_window[0][0] != window:
            close()
            open_window.append((window, PassTaker(near, which, backdrop=behind)))
        yarn, part = (None, None) if numbers is None else numbers(seen, pieces)
        open_window[0][1].add(splatter, yarn, part)

    image, _ = stream(splatter, camera, source, drawn=drawn, **options)
    close()
    return image, Passes(**whole)


def windows(
    seen: Seen, ids: NDArray[np.int32], tiles_x: int, tiles_y: int, most: int
) -> Iterator[tuple[int, int, int, int, NDArray[np.int32]]]:
    """Rectangles of tiles x0, y0, x1, y1 that make up the image, and the pieces that reach into each."""
    waiting = [(0, 0, tiles_x, tiles_y, ids)]
    while waiting:
        x0, y0, x1, y1, inside = waiting.pop()
        counts = seen.counts[inside]
        total = int(counts.sum(dtype=np.int64))
        if total <= most or (x1 - x0 == 1 and y1 - y0 == 1):
            yield x0, y0, x1, y1, inside
            continue
        axis = 0 if x1 - x0 >= y1 - y0 else 1
        begin, end = (x0, x1) if axis == 0 else (y0, y1)
        first, last = seen.boxes[inside, 2 * axis], seen.boxes[inside, 2 * axis + 1]
        middle = np.clip((first.astype(np.int32) + last) // 2, begin, end - 1) - begin
        load = np.cumsum(np.bincount(middle, weights=counts, minlength=end - begin))
        cut = begin + int(np.clip(np.searchsorted(load, 0.5 * load[-1]) + 1, 1, end - begin - 1))
        near, far = first < cut, last >= cut
        if int(counts[near].sum(dtype=np.int64)) + int(counts[far].sum(dtype=np.int64)) > WASTE * total:
            yield x0, y0, x1, y1, inside
            continue
        boxes = ((x0, y0, cut, y1), (cut, y0, x1, y1)) if axis == 0 else ((x0, y0, x1, cut), (x0, cut, x1, y1))
        waiting.append((*boxes[1], inside[far]))
        waiting.append((*boxes[0], inside[near]))


def _batches(seen: Seen, inside: NDArray[np.int32], most: int) -> Iterator[tuple[NDArray[np.int32], float, float]]:
    """The pieces of a window in one batch, or from front to back in several: of each the pieces and between what depths
    [m] their particles are of it. What reaches into two is in both."""
    if int(seen.counts[inside].sum(dtype=np.int64)) <= most:
        yield inside, -FAR, FAR
        return
    depth, reach = seen.depth[inside], seen.reach[inside]
    order = np.argsort(depth, kind="stable")
    group = np.cumsum(seen.counts[inside][order], dtype=np.int64) // max(most, 1)
    cuts = depth[order][np.flatnonzero(np.diff(group)) + 1].tolist()
    for nearest, farthest in zip([-FAR, *cuts], [*cuts, FAR], strict=True):
        yield inside[(depth - reach < farthest) & (depth + reach >= nearest)], nearest, farthest


def _ahead(camera: Camera) -> NDArray[np.float32]:
    """By what a place's depth is known: the camera's axis, and what is added (4,)."""
    return np.array([*np.asarray(camera.rotation)[2], np.asarray(camera.translation)[2]], np.float32)


@ti.kernel
def _cut(groups: F32x3, ahead: F32x1, nearest: Float, farthest: Float):
    """Particles that are not from the one depth [m] up to the other hold nothing (radius 0)."""
    for at in range(groups.shape[1] * LANES):
        g, lane = at // LANES, at % LANES
        z = ahead[3]
        for c in ti.static(range(3)):
            z += ahead[c] * groups[POSITION + c, g, lane]
        if z < nearest or z >= farthest:
            groups[RADIUS, g, lane] = 0.0


def _window(backdrop: Backdrop, x0: int, y0: int, x1: int, y1: int, height: int) -> Backdrop:
    """What a window of tiles, `height` [px] high, sees of a backdrop."""
    rows, columns = slice(y0 * TILE, y0 * TILE + height), slice(x0 * TILE, x1 * TILE)
    colour = np.ascontiguousarray(backdrop.colour[rows, columns])
    tiles = backdrop.tiles
    if tiles is None:
        return Backdrop(colour)
    wall = np.ascontiguousarray(tiles[y0:y1, x0:x1]).reshape(-1, TILE, TILE)
    if backdrop.face is None or backdrop.edges is None:
        return Backdrop(colour, wall)
    edges = backdrop.edges.copy()  # functions a x + b y + c of the pixel, three numbers each
    edges[:, 2::3] += TILE * (x0 * edges[:, 0::3] + y0 * edges[:, 1::3])
    return Backdrop(colour, wall, np.ascontiguousarray(backdrop.face[rows, columns]), edges)


def _part(background: Background, begin: float, end: float) -> Background:
    """What a window from `begin` to `end` (shares of the height) sees of the gradient."""
    ends = background.ends().astype(np.float64)
    top, bottom = (ends[:3] + (ends[3:] - ends[:3]) * at for at in (begin, end))
    return Background(top=(top[0], top[1], top[2]), bottom=(bottom[0], bottom[1], bottom[2]))
