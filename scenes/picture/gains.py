"""How much wider and brighter the particles of a thinned block must be: measured on the fabric itself."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.pieces import SURFACE
from taichi_cloth.detail.refine import PARTING, RefiningStream
from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.detail.thinning import UNCHANGED, Gains, thinned_to
from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.frames import frames
from taichi_cloth.fabric.layout import Blocks

from ...render.data.camera import Camera, frame
from ...render.data.finish import Finish
from ...render.data.light import Lighting
from ...render.splat.splat import Splatter
from ...render.splat.stream import Source, stream

__all__ = ["Views", "colours_at", "crossings", "fit_gains", "fit_near", "matched", "seen_at", "views_of"]

F64 = NDArray[np.float64]
Seen = tuple[Camera, tuple[slice, slice]]
"""A patch as it is measured: from where, and in what rows and columns of the picture."""
SIZE = 320, 192
ELEVATIONS = (90.0, 75.0, 60.0, 45.0, 30.0, 18.0)
LEVELS = 9
MEASURED = (1, 2, 3, 4, 5, 6, 8)
"""Levels at which gains are measured; between them they are interpolated, beyond the last they are its own."""
FARTHEST = 0.03
"""Radius of a particle [px] below which a cloth is too small to measure gains."""
ROUNDS = 5
CLOSE = 0.005
SLOPE = np.array([[0.4, 0, 0, 0], [0.4, 1, 0, 1], [0.8, 0, 1, 1.5], [0.6, 0, 0, 0.8]])
"""About how the logarithms of coverage, light by warp, by weft, and without colour change with those of the first three
gains and with the fourth."""
LARGEST_STEP = 0.3
OPENED = -0.5, 0.9
CROSSINGS = 6
MOST = 4_000_000
PATCH, MEASURED_SIDE = 24, 16
"""Of a fabric of more than so many particles, gains are measured on patches of so many threads each way, in the middle
of which they are those of a large cloth."""
PATCHES = 5
"""Patches, spread over the cloth as it is folded: where it gleams depends on how it lies, and one has few threads."""
APART = np.array([0.7548776662, 0.5698402910])
"""From one patch to the next, in widths of the cloth: the inverse of the plastic number, and its square (M. Roberts,
"The unreasonable effectiveness of quasirandom sequences", 2018)."""
PROBE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Colours of warp and weft by which what comes from either is told apart; blue is what has no colour."""


@dataclass(frozen=True)
class Views:
    """Where gains are measured: elevations [degrees] and levels (λ = 2^−level)."""

    elevations: tuple[float, ...]
    levels: tuple[int, ...]


def fit_gains(
    fabric: Fabric,
    points: NDArray,
    *,
    target: float | None = None,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
    views: Views | None = None,
    to_eye: float = 0.0,
) -> Gains:
    """Gains by which the cloth, at the distance where a share is drawn, has the coverage and the brightness of all its
    particles, in any colours: warp is red, weft green, and both are black in blue, so that one picture tells their
    parts and the sheen. Measured from `ELEVATIONS` on key points (picks, ends, 3) [m], as how a cloth is folded tells
    where it gleams; where the fabric is large, on patches of it.

    views: where it is measured; None is everywhere. to_eye: as of `FabricStream`.
    """
    target = thinned_to(fabric.particles) if target is None else target
    views = views or Views(ELEVATIONS, MEASURED)
    patches = _patches(fabric, points)
    large = patches[0].inner is not None
    edges = min(1.0, PATCH / min(fabric.layout.cloth.warp_up.shape)) if large else 1.0
    eye = _Eye(Splatter(*SIZE), lighting, finish, edges)
    wholes, thins = (
        [FabricStream(patch.fabric, points, target=share, to_eye=to_eye) for patch in patches]
        for share in (0.0, target)
    )
    factor = np.tile(UNCHANGED, (len(views.elevations), LEVELS, 1))
    tilt = np.zeros(len(views.elevations))
    measured = [level for level in views.levels if target * 0.5 ** (level / 2) > FARTHEST] or [1]
    for a, elevation in enumerate(views.elevations):
        for level in measured:
            cameras = [patch.seen(points, target * 0.5 ** (level / 2), elevation) for patch in patches]
            tilts = [
                whole.survey(camera).tilt  # pyright: ignore[reportArgumentType]
                for whole, camera in zip(wholes, cameras, strict=True)
            ]
            tilt[a] = np.mean(tilts)
            seen = list(zip(cameras, [p.window(c) for p, c in zip(patches, cameras, strict=True)], strict=True))
            want = eye.parts(seen, wholes)

            def error(now: F64, seen: list[Seen] = seen, want: F64 = want) -> F64:
                for thin in thins:
                    thin.gains = Gains(np.ones(1), np.tile(now, (1, 2, 1)))
                return np.log(np.maximum(eye.parts(seen, thins), 1e-9) / np.maximum(want, 1e-9))

            factor[a, level:] = _solved(error, factor[max(a - 1, 0), level if a else level - 1])
        nodes = (0, *measured)
        for c in range(4):
            factor[a, :, c] = np.interp(range(LEVELS), nodes, factor[a, nodes, c])
    order = np.argsort(tilt, kind="stable")
    return Gains(tilt[order], factor[order])


def views_of(fabric: Fabric, points: NDArray, farthest: Camera) -> Views:
    """What must be measured for views none of which is farther away, or at a lower angle to the cloth: the levels and
    elevations up to the first beyond it."""
    target = thinned_to(fabric.particles)
    deepest = float(farthest.project(np.asarray(points).reshape(-1, 3))[:, 2].max())
    smallest = float(fabric.bank.radius.mean()) * farthest.focal / deepest
    lowest = _tilt(points, farthest)
    tilts = [_tilt(points, seen_at(fabric, points, target, elevation=elevation)) for elevation in ELEVATIONS]
    return Views(
        ELEVATIONS[: 1 + sum(tilt > lowest for tilt in tilts)],
        MEASURED[: 1 + sum(target * 0.5 ** (level / 2) > smallest for level in MEASURED)],
    )


def _tilt(points: NDArray, camera: Camera) -> float:
    """As `Survey.tilt`."""
    return float(np.abs(frames(points).normal @ camera.rotation[2]).mean())


def _solved(error: Callable[[F64], F64], start: F64) -> F64:
    """Gains with no `error` (logarithms of coverage, light by warp, by weft, and without colour, over what they should
    be): Broyden's method (C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", 1965)."""
    x = np.concatenate([np.log(start[:3]), start[3:]])
    slope, step, before = SLOPE.copy(), np.zeros(4), np.zeros(4)
    best, least = start, np.inf
    for _ in range(ROUNDS):
        now = np.concatenate([np.exp(x[:3]), x[3:]])
        y = error(now)
        if step.any():
            slope += np.outer(y - before - slope @ step, step) / (step @ step)
        if np.abs(y).max() < least:
            best, least = now, float(np.abs(y).max())
        if least < CLOSE:
            break
        step = np.clip(np.linalg.solve(slope, -y), -LARGEST_STEP, LARGEST_STEP)
        step[3] = np.clip(x[3] + step[3], *OPENED) - x[3]
        x, before = x + step, y
    return best


@dataclass(frozen=True)
class _Patch:
    """What gains are measured on. inner: key points [m] of the corners of what is measured, as the cut edges of a patch
    are not those of the fabric; None where it is the whole fabric."""

    fabric: Fabric
    inner: NDArray | None = None

    def seen(self, points: NDArray, pixels: float, elevation: float) -> Camera:
        about = None if self.inner is None else self.inner.mean(axis=0)
        return seen_at(self.fabric, points, pixels, elevation=elevation, about=about)

    def window(self, camera: Camera) -> tuple[slice, slice]:
        """Rows and columns of the picture in which what is measured lies."""
        if self.inner is None:
            return slice(None), slice(None)
        at = camera.project(self.inner)[:, :2]
        (left, top), (right, bottom) = np.floor(at.min(axis=0)).astype(int), np.ceil(at.max(axis=0)).astype(int)
        return slice(max(0, top), bottom), slice(max(0, left), right)


def _patches(fabric: Fabric, points: NDArray) -> list[_Patch]:
    """A fabric, every thread of which has the colour of its family in `PROBE`; where it is large, patches of it, none
    in line with another."""
    layout, probed = fabric.layout, _probed(fabric)
    picks, ends = points.shape[:2]
    if fabric.particles <= MOST or min(picks, ends) <= PATCH:
        return [_Patch(probed)]
    row, column = np.divmod(layout.blocks.key0, ends)
    half, side, patches = PATCH // 2, MEASURED_SIDE // 2, []
    for k in range(PATCHES):
        share = (0.5 + k * APART) % 1.0
        i, j = np.clip(share * (picks, ends), half, (picks - 1 - half, ends - 1 - half)).astype(int)
        chosen = np.flatnonzero((np.abs(row - i) <= half) & (np.abs(column - j) <= half))
        blocks = Blocks(*(getattr(layout.blocks, name)[chosen] for name in Blocks.__dataclass_fields__))
        bank = replace(fabric.bank, template=fabric.bank.template[chosen])
        part = Fabric(replace(layout, blocks=blocks), bank, probed.thread_colour, bank.particle_start)
        corners = [points[i + a * side, j + b * side] for a in (-1, 1) for b in (-1, 1)]
        patches.append(_Patch(part, np.array(corners)))
    return patches


def _probed(fabric: Fabric) -> Fabric:
    """The fabric with every thread in the colour of its family in `PROBE`."""
    weft = np.arange(len(fabric.thread_colour)) >= fabric.layout.cloth.warp_up.shape[1]
    return replace(fabric, thread_colour=PROBE[weft.astype(np.intp)].astype(np.float32))


def fit_near(
    fabric: Fabric,
    points: NDArray,
    skin: NDArray[np.float32],
    *,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
    to_eye: float = 0.0,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The `parted_gain` and `surface_gain` by which real fibres, and those with a surface, are together as bright as
    the splats they replace, in each colour as far as two factors can: what has no colour changes too, and cannot be
    multiplied by itself. to_eye: as of `FabricStream`."""
    yarn, fibres = fabric.layout.warp.yarn, fabric.layout.detail.fibres
    drawn = float(np.median(fabric.bank.radius[fabric.bank.openness < 1.0]))
    real = drawn / max(1.0, yarn.fibres_in_section / fibres) ** 0.5
    with_surface = 1.3 * SURFACE[0] * float(fabric.bank.radius.mean()) / real
    ends = fabric.layout.cloth.warp_up.shape[1]
    own = np.stack([fabric.thread_colour[:ends].mean(axis=0), fabric.thread_colour[ends:].mean(axis=0)])
    probed = _probed(fabric)
    splatter, plain = Splatter(*SIZE), FabricStream(probed, points, to_eye=to_eye)
    fine = RefiningStream(probed, points, skin, to_eye=to_eye)

    def factor(pixels: float) -> NDArray[np.float32]:
        before, after = (
            np.sum(
                [
                    colours_at(splatter, source, camera, lighting=lighting, finish=finish)[:3]
                    for camera in crossings(fabric, points, pixels)
                ],
                axis=0,
            )
            for source in (plain, fine)
        )
        return matched(before, after, own)

    parted = np.stack([np.ones(2, np.float32), *(factor(pixels) for pixels in PARTING[1:])])
    fine.parted_gain = parted
    return parted, factor(with_surface)


def matched(before: F64, after: F64, own: F64) -> NDArray[np.float32]:
    """Factors for the colours of warp and of weft by which what looked so after looks as it did before. Red, green and
    blue of warp and weft in the colours of `PROBE`; own: in which they are really dyed, (2, 3)."""
    was, now = (np.maximum(light[:2] - light[2], 1e-9) for light in (before, after))  # by warp and by weft
    alike = was / now
    more, *_ = np.linalg.lstsq((now[:, None] * own).T, np.full(3, before[2] - after[2]), rcond=1e-3)
    return np.clip(alike + more, 0.5, 1.5).astype(np.float32)


def colours_at(
    splatter: Splatter,
    source: Source,
    camera: Camera,
    *,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
) -> NDArray[np.float64]:
    """Red, green, blue and coverage of the whole picture."""
    stream(splatter, camera, source, most=10**9, lighting=lighting, finish=finish)
    return splatter.linear().sum(axis=(0, 1), dtype=np.float64)


def crossings(fabric: Fabric, points: NDArray, pixels: float) -> Iterator[Camera]:
    """Narrow views from above of a few crossings near the middle, of which some show warp and some weft."""
    grid = np.asarray(points)
    picks, ends = (n // 2 for n in grid.shape[:2])
    for k in range(CROSSINGS):
        yield seen_at(fabric, points, pixels, fov=4, about=grid[picks + k // 3, ends + k % 3])


def seen_at(
    fabric: Fabric,
    points: NDArray,
    pixels: float,
    *,
    elevation: float = 60,
    fov: float = 30,
    about: NDArray | None = None,
) -> Camera:
    """From above, where the mean radius of a particle is `pixels`."""
    flat = np.asarray(points).reshape(-1, 3)
    camera = frame(flat, width=SIZE[0], height=SIZE[1], elevation=elevation, fov=fov)
    distance = float(fabric.bank.radius.mean()) * camera.focal / pixels
    place = (flat.mean(axis=0) if about is None else about) - camera.forward * distance
    return replace(camera, translation=-camera.rotation @ place, near=1e-4)


@dataclass(frozen=True)
class _Eye:
    """How a cloth is measured: in which light, and of what window the picture tells how much of the whole."""

    splatter: Splatter
    lighting: Lighting | None
    finish: Finish | None
    edges: float

    def parts(self, seen: list[Seen], sources: list[FabricStream]) -> NDArray[np.float64]:
        """Coverage, light by the colour of warp and of weft, and light without colour; of patches as of a cloth of
        which the edges are a share `edges` of theirs."""
        total = np.zeros(4)
        for k, ((camera, window), source) in enumerate(zip(seen, sources, strict=True)):
            source.turn = k
            stream(self.splatter, camera, source, most=10**9, lighting=self.lighting, finish=self.finish)
            picture = self.splatter.linear()
            inside = picture[window].sum(axis=(0, 1), dtype=np.float64)
            total += self.edges * picture.sum(axis=(0, 1), dtype=np.float64)
            total += (1 - self.edges) * (PATCH / MEASURED_SIDE) ** 2 * inside
        red, green, blue, cover = total
        return np.array([cover, red - blue, green - blue, blue])
