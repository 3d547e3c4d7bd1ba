"""The alpha of a splat: a formula, which is the fast path, or textures from a sheet.

The formula, with q = 1 - rho^2 and rho the distance from the middle in units of the radius:

    alpha = opacity min(1, edge q)^2

edge = 1 is a soft sprite; its coverage is pi r^2 / 3. A larger edge has a flat middle and a rim that is
r / (2 edge) wide. The crisp profile takes edge = R / 2 for a drawn radius of R pixels, so that the rim is about
one pixel wide at any zoom, and R such that the splat covers pi r^2 (see `project`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import shown_path

from ..image.image import LARGEST_GIVEN, read_png

__all__ = ["CRISP", "SOFT", "Profile", "SpriteSheet", "fibre_sprite", "round_sprite", "sheet_from_png", "soft_sprite"]

SIZES = tuple(2**k for k in range(2, 11))


@dataclass(frozen=True, kw_only=True)
class Profile:
    """The analytic alpha profile: `edge` from 1 (soft) up, or None for a rim that is always one pixel wide.

    Raises InputError for an edge below 1.
    """

    edge: float | None = None

    def __post_init__(self) -> None:
        if self.edge is not None and not 1 <= self.edge <= 1e6:
            raise InputError(f"profile.edge: {self.edge!r}; allowed: 1 to 1000000, or None for a one-pixel rim")


SOFT = Profile(edge=1.0)
CRISP = Profile()


@dataclass(frozen=True, eq=False)
class SpriteSheet:
    """Alpha textures, shape (count, size, size), 0..1, converted to float32; size is a power of two, 4..1024.

    On an elliptic splat the columns run along the fibre and the rows across it; on a round one they are the
    image's own. Only the square -1..1 is sampled, so leave the outermost texels empty.
    Raises InputError for another shape or for values outside 0..1.
    """

    alpha: NDArray[np.float32]

    if TYPE_CHECKING:

        def __init__(self, alpha: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        alpha = np.ascontiguousarray(self.alpha, np.float32)
        object.__setattr__(self, "alpha", alpha)
        if alpha.ndim != 3 or alpha.shape[1] != alpha.shape[2] or alpha.shape[1] not in SIZES or not len(alpha):
            raise InputError(
                f"sprites: shape {alpha.shape}; allowed: (count, size, size), size a power of two, 4..1024"
            )
        if not (alpha.min() >= 0 and alpha.max() <= 1):
            raise InputError(f"sprites: alpha {alpha.min():g} to {alpha.max():g}; allowed: 0 to 1")

    def __len__(self) -> int:
        return len(self.alpha)

    @property
    def size(self) -> int:
        """Width and height of a texture [texel]."""
        return self.alpha.shape[1]

    def pyramid(self) -> NDArray[np.float32]:
        """All mip levels of one texture after another, from the finest down to 4 x 4, flat."""
        levels: list[NDArray[Any]] = [self.alpha]
        while levels[-1].shape[1] > 4:
            a = levels[-1]
            levels.append((a[:, ::2, ::2] + a[:, 1::2, ::2] + a[:, ::2, 1::2] + a[:, 1::2, 1::2]) / 4)
        flat = np.concatenate([level.reshape(len(self.alpha), -1) for level in levels], axis=1)
        return np.ascontiguousarray(flat, np.float32).ravel()


def soft_sprite(size: int = 64) -> NDArray[np.float32]:
    """The formula with edge 1 as a texture (size, size)."""
    return _from_formula(size, lambda rho: np.maximum(1 - rho**2, 0) ** 2)


def round_sprite(size: int = 64, *, rim: float = 0.1) -> NDArray[np.float32]:
    """A flat disc (size, size) whose rim fades over `rim` of its radius."""
    return _from_formula(size, lambda rho: np.clip((1 - rho) / rim, 0, 1))


def fibre_sprite(size: int = 64, *, seed: int = 0, streaks: int = 9) -> NDArray[np.float32]:
    """A tuft of fibrils (size, size): streaks along the columns' direction that differ in length and density.

    Across it is dense in the middle and frayed at the sides; the same seed gives the same tuft.
    """
    random = np.random.default_rng(seed)
    s, t = _grid(size)
    alpha = np.zeros_like(s)
    for k in range(streaks):
        at = 0.8 * (2 * (k + random.uniform(0.2, 0.8)) / streaks - 1)
        bend = random.uniform(-0.12, 0.12) * t**2 + random.uniform(-0.06, 0.06) * t
        width = random.uniform(0.05, 0.13) * (1 - 0.5 * abs(at)) + 1.0 / size
        length = random.uniform(0.65, 0.98) * np.sqrt(1 - at**2)
        along = np.clip((length - np.abs(t - random.uniform(-0.05, 0.05))) / 0.35, 0, 1)
        streak = np.exp(-(((s - at - bend) / width) ** 2)) * along * random.uniform(0.55, 1.0)
        alpha = 1 - (1 - alpha) * (1 - streak)
    body = np.clip(1 - (s / 0.75) ** 2 - t**2, 0, 1) ** 2
    alpha = 1 - (1 - alpha) * (1 - 0.6 * body)
    window = np.clip((1 - np.maximum(np.abs(s), np.abs(t))) * size / 4, 0, 1)
    return np.clip(alpha * window, 0, 1).astype(np.float32)


def sheet_from_png(paths: Sequence[str | Path], *, size: int = 64) -> SpriteSheet:
    """A sheet from the alpha channels of PNG files (8 or 16 bit), each resized to `size`.

    Raises InputError when a file is missing, is no image, or has no alpha channel.
    """
    if size not in SIZES:
        raise InputError(f"sprite size: {size}; allowed: {', '.join(map(str, SIZES))}")
    textures = []
    for path in paths:
        try:
            image = read_png(path, largest=LARGEST_GIVEN)
        except InputError as error:
            raise InputError(f"sprite {error} with an alpha channel") from None
        if image.ndim != 3 or image.shape[2] != 4:
            raise InputError(f"sprite {shown_path(path)}: has no alpha channel; save it as RGBA PNG")
        alpha = image[..., 3].astype(np.float32) / (255 if image.dtype == np.uint8 else 65535)
        shrinks = min(alpha.shape) >= size
        alpha = cv2.resize(alpha, (size, size), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        textures.append(np.clip(alpha, 0, 1))
    if not textures:
        raise InputError("sprites: no files given; pass at least one PNG")
    return SpriteSheet(np.stack(textures))


def _grid(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    centres = (np.arange(size) + 0.5) / size * 2 - 1
    s, t = np.meshgrid(centres, centres, indexing="ij")
    return s, t


def _from_formula(size: int, profile: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> NDArray[np.float32]:
    s, t = _grid(size)
    return np.asarray(profile(np.hypot(s, t)), np.float32)
