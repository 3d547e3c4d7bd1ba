"""The rim of a drapemeter's support as a circle, whatever grid the specimen has.

Cloth that is clamped along a line leaves it as a parabola: at a distance d it has moved by κ d²/2 across its own plane,
in proportion to d along the line, where it shears, and to d³ towards it, as it is no shorter than before. Key points
that lie at most HELD spacings outside the rim are held, and those of them that lie outside are led along that shape:
it is read off where cloth has come to FOLLOWED spacings from the rim, frame by frame, till all is at rest. A facet of
the grid along the rim then is as round as the rim itself.

What is held takes up what pulls at it. With these two numbers a stiff disc sags as much as a plate that is clamped at
the rim, in the mean of four within 1.5 % from 7.5 to 3.5 mm and from one to the next by 1 % (2 % where what is held
stays level). Key points that stayed level up to ¾ spacing outside did as well in the mean, but wool came to 58.4 and
61.9 % on grids of 7.5 and 3.5 mm.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

__all__ = ["RoundRim", "round_rim"]

HELD, FOLLOWED = 1.15, 2.0
"""Outside the rim [spacings]."""


@dataclass(frozen=True, eq=False)
class RoundRim:
    """still, led: bool (rows, cols), key points that stay where they are and that follow. beyond: (led, rows × cols),
    shares of key points at the place each follows. near: d over that place's distance, (led,). outward: unit vectors
    (led, 3), y up."""

    still: NDArray[np.bool_]
    led: NDArray[np.bool_]
    beyond: csr_array
    near: NDArray[np.float64]
    outward: NDArray[np.float64]

    @property
    def held(self) -> NDArray[np.bool_]:
        return self.still | self.led

    def follow(self, moved: ArrayLike) -> NDArray[np.float64]:
        """How far what is led has moved, (led, 3) [m], of all key points (rows, cols, 3)."""
        there = self.beyond @ np.asarray(moved, np.float64).reshape(-1, 3)
        near = self.near[:, None]
        out = np.sum(there * self.outward, axis=1, keepdims=True) * self.outward
        up = there * [0.0, 1.0, 0.0]
        return near**3 * out + near**2 * up + near * (there - out - up)


def round_rim(
    shape: tuple[int, int], *, radius: float, spacing: float, place: tuple[float, float] = (0.0, 0.0)
) -> RoundRim:
    """Of a grid of key points whose middle lies `place` rows and columns from that of the rim. radius, spacing: [m]."""
    middle = (np.array(shape) - 1) / 2 + np.array(place)
    away = np.moveaxis(np.indices(shape), 0, -1) - middle
    distance = np.hypot(away[..., 0], away[..., 1]) - radius / spacing
    led = (distance > 0.0) & (distance <= HELD)
    out = away[led] / np.linalg.norm(away[led], axis=1, keepdims=True)
    at = middle + out * (radius / spacing + FOLLOWED)
    first = np.floor(at).astype(int)
    share = at - first
    row = np.arange(len(at))
    parts = []
    for i in (0, 1):
        for j in (0, 1):
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            parts.append((weight, row, (first[:, 0] + i) * shape[1] + first[:, 1] + j))
    weight, row, column = (np.concatenate(part) for part in zip(*parts, strict=True))
    beyond = csr_array((weight, (row, column)), shape=(len(at), shape[0] * shape[1]))
    outward = np.stack([out[:, 1], np.zeros(len(out)), out[:, 0]], axis=1)
    return RoundRim(distance <= 0.0, led, beyond, distance[led] / FOLLOWED, outward)
