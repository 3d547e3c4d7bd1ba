"""The lights: a key light and more of its kind, and a soft fill, one colour from above and another from below."""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

from ..image.tone import TONES, Tone
from .camera import Camera

__all__ = ["Background", "Colour", "KeyLight", "Lighting"]

Colour: TypeAlias = tuple[float, float, float]
"""Linear red, green, blue."""


@dataclass(frozen=True, kw_only=True)
class KeyLight:
    """A distant light. Raises InputError for values no light can have."""

    direction: Colour
    """Towards the light, any length; axes as in `Lighting.direction`."""
    intensity: float = 0.5
    """A white surface facing it gets this radiance."""
    colour: Colour = (1.0, 1.0, 1.0)
    follows_camera: bool = True
    size: float = 6.0
    """Angle across the light [degrees], 0..90: how soft its shadows are."""
    casts_shadow: bool = False

    def __post_init__(self) -> None:
        for name in ("direction", "colour"):
            check_colour(f"light.{name}", getattr(self, name), negative=name == "direction")
        if not np.linalg.norm(self.direction) > 0:
            raise InputError("light.direction: has no length; give the direction towards the light")
        for name, most in (("intensity", 1e4), ("size", 90.0)):
            value = getattr(self, name)
            if not 0 <= value <= most:
                raise InputError(f"light.{name}: {value!r}; allowed: 0 to {most:g}")

    def towards(self, camera: Camera) -> NDArray[np.float64]:
        """Unit direction towards the light, world, shape (3,)."""
        direction = np.asarray(self.direction, np.float64)
        if self.follows_camera:
            direction = camera.rotation.T @ (direction * (1.0, -1.0, -1.0))
        return direction / np.linalg.norm(direction)


@dataclass(frozen=True, kw_only=True)
class Lighting:
    """A key light and a hemisphere of fill light. Raises InputError for values no light can have."""

    direction: Colour = (-0.55, 0.75, 0.60)
    """Towards the key light, any length. World axes, or, when it follows the camera, the viewer's: x right,
    y up, z towards the viewer."""
    key_follows_camera: bool = True
    """True: the light stays with the viewer, as on a turntable where the garment turns. False: world."""
    key: float = 0.85
    """Intensity of the key light: a white surface facing it gets this radiance."""
    key_colour: Colour = (1.0, 0.965, 0.91)
    fill: float = 0.34
    """Intensity of the fill light."""
    sky: Colour = (0.92, 0.97, 1.06)
    """Colour of the fill from above: of the whole upper half of the sky, or of its zenith where it has a horizon."""
    horizon: Colour | None = None
    """Colour of the sky at the horizon, from where it changes to that of the zenith as the sine of the height; None is
    that of the zenith."""
    ground: Colour = (0.52, 0.49, 0.46)
    """Colour of the fill from below."""
    exposure: float = 0.0
    """Stops: +1 doubles all light that falls on particles. The background is not changed."""
    size: float = 6.0
    """Angle across the key light [degrees], 0..90: how soft its shadows are. The sun has 0.5, a soft box 20."""
    shadows: bool = False
    """Whether particles shadow one another from the key light; a map of them a pose and light direction."""
    occlusion: bool = False
    """Whether particles hide the fill light from one another, instead of `Particles.openness`; maps a pose."""
    others: tuple[KeyLight, ...] = ()
    """More lights, such as one from behind."""
    tone: Tone = "srgb"
    """How light becomes brightness on the screen (see `tone`)."""

    def __post_init__(self) -> None:
        for name in ("direction", "key_colour", "sky", "ground", "horizon"):
            if getattr(self, name) is not None:
                check_colour(f"lighting.{name}", getattr(self, name), negative=name == "direction")
        if not np.linalg.norm(self.direction) > 0:
            raise InputError("lighting.direction: has no length; give the direction towards the light")
        for name in ("key", "fill"):
            value = getattr(self, name)
            if not 0 <= value < 1e4:
                raise InputError(f"lighting.{name}: {value!r}; allowed: 0 to 10000")
        if not 0 <= self.size <= 90:
            raise InputError(f"lighting.size: {self.size!r} degrees; allowed: 0 to 90")
        if self.tone not in TONES:
            raise InputError(f"lighting.tone: unknown {self.tone!r}; known: {', '.join(TONES)}")
        if not -20 <= self.exposure <= 20:
            raise InputError(f"lighting.exposure: {self.exposure!r} stops; allowed: -20 to 20")

    @property
    def lights(self) -> tuple[KeyLight, ...]:
        """All distant lights, the key light first."""
        key = KeyLight(
            direction=self.direction,
            intensity=self.key,
            colour=self.key_colour,
            follows_camera=self.key_follows_camera,
            size=self.size,
            casts_shadow=self.shadows,
        )
        return (key, *self.others)

    def without_maps(self) -> "Lighting":
        """The same lights without shadows and occlusion, which need all particles at once."""
        others = tuple(replace(light, casts_shadow=False) for light in self.others)
        return replace(self, shadows=False, occlusion=False, others=others)

    def towards_key(self, camera: Camera) -> NDArray[np.float64]:
        """Unit direction towards the key light, world, shape (3,)."""
        return self.lights[0].towards(camera)

    def radiances(self) -> NDArray[np.float64]:
        """Key, sky (at the horizon) and ground light with intensity and exposure in them, rows of shape (3, 3)."""
        lights = [np.multiply(self.key, self.key_colour)]
        lights += [np.multiply(self.fill, colour) for colour in (self.horizon or self.sky, self.ground)]
        return np.stack(lights) * 2.0**self.exposure

    @property
    def rise(self) -> NDArray[np.float64]:
        """How much more light comes from the zenith than from the horizon, shape (3,)."""
        return np.subtract(self.sky, self.horizon or self.sky) * (self.fill * 2.0**self.exposure)

    def ambient(self, upward: ArrayLike) -> NDArray[np.float64]:
        """What a white surface sends on of the open sky and ground; upward: the y of its normal (…), shape (…, 3).

        The sky's radiance is horizon + rise sin(height), the ground's is even. The integral of the clamped cosine to
        a normal at the angle b from the vertical, over pi, is (1 + cos b) / 2 for an even upper half, and
        2 / (3 pi) (sin b + (pi - b) cos b) for sin(height): that of the product of two clamped cosines.
        """
        c = np.clip(np.asarray(upward, np.float64)[..., None], -1, 1)
        _, horizon, ground = self.radiances()
        b = np.arccos(c)
        return (
            horizon * (0.5 + 0.5 * c)
            + ground * (0.5 - 0.5 * c)
            + self.rise * (2 / (3 * np.pi) * (np.sin(b) + (np.pi - b) * c))
        )


@dataclass(frozen=True, kw_only=True)
class Background:
    """What is behind everything: one linear colour, or a vertical gradient to a second one."""

    top: Colour = (0.80, 0.82, 0.85)
    """Linear colour of the top edge."""
    bottom: Colour | None = None
    """Linear colour of the bottom edge; None is the same as the top."""

    def __post_init__(self) -> None:
        check_colour("background.top", self.top)
        if self.bottom is not None:
            check_colour("background.bottom", self.bottom)

    def ends(self) -> NDArray[np.float32]:
        """Top and bottom colour, shape (6,)."""
        return np.array([*self.top, *(self.top if self.bottom is None else self.bottom)], np.float32)

    def rows(self, height: int) -> NDArray[np.float32]:
        """The colour of each row of pixels of a picture, shape (height, 1, 3)."""
        top, bottom = self.ends().reshape(2, 3)
        down = (np.arange(height, dtype=np.float32) + np.float32(0.5)) / np.float32(height)
        return np.asarray(top + (bottom - top) * down[:, None, None], np.float32)


def check_colour(name: str, value: Colour, *, negative: bool = False) -> None:
    """Raises InputError unless `value` is three finite numbers, none negative unless `negative`."""
    array = np.asarray(value, np.float64) if len(value) == 3 else np.array([np.nan])
    if not np.isfinite(array).all() or (array.min() < 0 and not negative):
        raise InputError(f"{name}: {value!r}; allowed: three {'' if negative else 'non-negative '}numbers")
