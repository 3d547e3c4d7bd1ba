"""What the splatter draws: points with a radius, a colour and the direction of the fibre they are part of."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["Particles", "concatenate"]


@dataclass(frozen=True, eq=False)
class Particles:
    """n particles. Arrays are converted to contiguous float32 (sprite: int32) and their shapes checked.

    A particle with a radius of zero or below, or with any value that is NaN or infinite, is not drawn.
    Raises InputError when a shape or a whole-array range is wrong.
    """

    position: NDArray[np.float32]
    """Centres [m], world, y up, shape (n, 3)."""
    radius: NDArray[np.float32]
    """Half width across the fibre [m], shape (n,); a scalar is repeated."""
    colour: NDArray[np.float32]
    """Linear albedo 0..1, shape (n, 3); one colour (3,) is repeated."""
    tangent: NDArray[np.float32]
    """Unit direction of the fibre, shape (n, 3)."""
    normal: NDArray[np.float32]
    """Unit outward direction of the cloth or yarn, shape (n, 3)."""
    half_length: NDArray[np.float32] | None = None
    """Semi-axis along the tangent [m], shape (n,); None draws round splats. For a chain that reads as one
    smooth fibre take at least 1.5 times the distance between neighbours."""
    openness: NDArray[np.float32] | None = None
    """Share of the sky the particle sees, 0 (shut in) .. 1 (open), shape (n,); None is 1 everywhere."""
    sprite: NDArray[np.int32] | None = None
    """Index into the splatter's sprite sheet, shape (n,); None is sprite 0."""
    opacity: float | NDArray[np.float32] = 0.85
    """Opacity of the middle of a splat, 0..1: a number or shape (n,)."""
    yarn: NDArray[np.int32] | None = None
    """Number of the yarn each is part of, for the id pass, 0 and up, shape (n,); None or -1 is none."""
    part: NDArray[np.int32] | None = None
    """Number of the part of the subject, likewise."""

    if TYPE_CHECKING:  # what a person may pass; what is kept is stated above

        def __init__(
            self,
            position: ArrayLike,
            radius: ArrayLike,
            colour: ArrayLike,
            tangent: ArrayLike,
            normal: ArrayLike,
            half_length: ArrayLike | None = None,
            openness: ArrayLike | None = None,
            sprite: ArrayLike | None = None,
            opacity: ArrayLike = 0.85,
            yarn: ArrayLike | None = None,
            part: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        position = _array("position", self.position, np.float32)
        if position.ndim != 2 or position.shape[1] != 3:
            raise InputError(f"particles.position: shape {position.shape}; allowed: (n, 3)")
        count = len(position)
        _set(self, "position", position)
        for name, columns in (("radius", ()), ("colour", (3,)), ("tangent", (3,)), ("normal", (3,))):
            _set(self, name, _shaped(name, getattr(self, name), (count, *columns), np.float32))
        optional = {"half_length": np.float32, "openness": np.float32}
        for name, dtype in (optional | dict.fromkeys(("sprite", "yarn", "part"), np.int32)).items():
            if getattr(self, name) is not None:
                _set(self, name, _shaped(name, getattr(self, name), (count,), dtype))
        opacity = _array("opacity", self.opacity, np.float32)
        if opacity.ndim == 0:
            if not 0 <= opacity <= 1:
                raise InputError(f"particles.opacity: {float(opacity):g}; allowed: 0 to 1")
            _set(self, "opacity", float(self.opacity))
        else:
            _set(self, "opacity", _shaped("opacity", opacity, (count,), np.float32))

    def __len__(self) -> int:
        return len(self.position)


def concatenate(parts: Sequence[Particles]) -> Particles:
    """One set of particles from several, in their order.

    Optional arrays that only some parts have are filled in for the others: openness 1, sprite 0, yarn
    and part -1 (none), half_length the radius (a ball). Raises InputError for no parts at all.
    """
    if not parts:
        raise InputError("concatenate: no particles given; pass at least one set")
    joined: dict[str, Any] = {}
    for field in fields(Particles):
        values = [getattr(part, field.name) for part in parts]
        if field.name == "opacity" and all(np.ndim(v) == 0 and v == values[0] for v in values):
            joined["opacity"] = values[0]
        elif any(value is not None for value in values):
            joined[field.name] = np.concatenate(
                [_filled(field.name, value, part) for value, part in zip(values, parts, strict=True)]
            )
    return Particles(**joined)


def _filled(name: str, value: Any, part: Particles) -> NDArray[Any]:
    if value is None:
        value = {"half_length": part.radius, "openness": np.float32(1), "sprite": np.int32(0)}.get(name, np.int32(-1))
    return np.broadcast_to(value, (len(part),)) if np.ndim(value) < 2 else value


def _set(particles: Particles, name: str, value: Any) -> None:
    object.__setattr__(particles, name, value)


def _array(name: str, value: Any, dtype: Any) -> NDArray[Any]:
    try:
        with np.errstate(over="ignore"):
            return np.ascontiguousarray(value, dtype).reshape(np.shape(value))
    except (TypeError, ValueError):
        raise InputError(f"particles.{name}: {type(value).__name__} is not an array of numbers") from None


def _shaped(name: str, value: Any, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    array = _array(name, value, dtype)
    if array.shape in ((), shape[1:]) and array.shape != shape:
        array = np.ascontiguousarray(np.broadcast_to(array, shape))
    if array.shape != shape:
        raise InputError(f"particles.{name}: shape {array.shape}; allowed: {shape}, as many as there are positions")
    return array
