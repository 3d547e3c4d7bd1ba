"""The particle record: what every particle is, and in which order its numbers stand.

Whoever makes particles (`fabric`, `detail`, `yarn`) writes this record, and whoever draws them (`render`) reads it, in
*groups*: arrays (rows, groups, 16), a row a number of `RECORD`, so that 16 neighbours of one property lie side by
side and one load fills a vector register. Each property lies in memory by itself: what moves is written without
touching what stays. A new property is a line of `RECORD`, and a field of `FibreCloud` where fibres have it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "COLOUR", "HALF_LENGTH", "LANES", "NORMAL", "OCTET", "OPENNESS", "POSITION", "RADIUS", "RECORD", "ROWS", "TANGENT",
    "TILE", "FibreCloud", "Property", "fill_up", "first_numbers",
]  # fmt: skip

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Property:
    """One property of a particle."""

    name: str
    """As a field of `FibreCloud` and of whatever else holds particles."""
    numbers: int
    """Of float32 a particle: rows of a group."""
    unit: str
    meaning: str
    given: Literal["always", "fibres", "others"] = "always"
    """Who gives it: always; fibres, and others may leave it out; or others, and fibres have none."""


RECORD = (
    Property("position", 3, "m", "centre, in the world, y up"),
    Property("radius", 1, "m", "half width across the fibre; 0 or less is not drawn"),
    Property("colour", 3, "1", "linear albedo, 0 to 1"),
    Property("tangent", 3, "1", "unit direction of the fibre"),
    Property("normal", 3, "1", "unit outward direction of the cloth or the yarn"),
    Property("half_length", 1, "m", "semi-axis along the tangent", given="fibres"),
    Property("openness", 1, "1", "share of the sky it sees, 0 (shut in) to 1 (open)", given="fibres"),
    Property("opacity", 1, "1", "of the middle of a splat, 0 to 1", given="others"),
    Property("sprite", 1, "1", "number in the sheet of sprites", given="others"),
)
"""All properties, in the order of their rows. Of those not always given, the rows of those left out are left out."""


def first_numbers(record: Sequence[Property]) -> Iterator[int]:
    """Where each property begins among the numbers of one particle.

    >>> list(first_numbers(RECORD))
    [0, 3, 4, 7, 10, 13, 14, 15, 16]
    """
    first = 0
    for one in record:
        yield first
        first += one.numbers


POSITION, RADIUS, COLOUR, TANGENT, NORMAL, HALF_LENGTH, OPENNESS, _, _ = first_numbers(RECORD)
"""First row of each property of fibres."""

_OF_FIBRES = [pair for pair in zip(RECORD, first_numbers(RECORD), strict=True) if pair[0].given != "others"]

ROWS = sum(one.numbers for one, _ in _OF_FIBRES)
"""Rows of a group of fibre particles."""

LANES = 16
"""Particles in a group, and pixels in a row of a tile: what one vector instruction takes at once."""

OCTET = LANES // 2
"""Particles in half a group: what one vector instruction moves, and from where on another fibre block may begin."""

TILE = 16
"""Width and height of a tile of the image [px]."""


@dataclass(frozen=True)
class FibreCloud:
    """Fibre particles, each property by itself, float32: (n, 3) or (n,) in the units of `RECORD`."""

    position: F32
    radius: F32
    colour: F32
    tangent: F32
    normal: F32
    half_length: F32
    openness: F32

    def __len__(self) -> int:
        return len(self.radius)

    @classmethod
    def over(cls, numbers: F32) -> "FibreCloud":
        """Particles whose numbers lie there, (ROWS · n,), property after property: views, not copies."""
        n, parts = len(numbers) // ROWS, []
        for one, first in _OF_FIBRES:
            part = numbers[first * n : (first + one.numbers) * n]
            parts.append(part.reshape(n, one.numbers) if one.numbers > 1 else part)
        return cls(*parts)

    @classmethod
    def of_rows(cls, rows: F32) -> "FibreCloud":
        """Particles (ROWS, n) as they stand in groups, a copy."""
        cloud = cls.over(np.empty(rows.size, np.float32))
        for one, first in _OF_FIBRES:
            getattr(cloud, one.name).T[...] = rows[first : first + one.numbers]
        return cloud

    @classmethod
    def joined(cls, clouds: Sequence["FibreCloud"]) -> "FibreCloud":
        """One cloud from several, in their order."""
        return cls(*(np.concatenate([getattr(one, f.name) for one in clouds]) for f in fields(cls)))


def fill_up(groups: F32, count: int) -> None:
    """Where `count` particles leave places in the last group, these hold nothing (radius 0), where something is."""
    over = count % LANES
    if over:
        groups[:, -1, over:] = groups[:, -1, over - 1, None]
        groups[RADIUS, -1, over:] = 0.0
