"""Where the fibres of a yarn run (paper 2.2): packing, twist in the single and in the ply, migration.

`spin` lays fibres out in one *period* of yarn, cut into equal blocks, that closes on itself, so that blocks can be laid
end to end for ever without a seam. Twist is therefore rounded to whole turns a period; `Period` picks the number of
blocks that makes the rounding least.

Axes of a straight yarn: x along it, (y, z) its section. A rotation by a positive angle about +x is the Z twist
(the middle stroke of the letter, seen from outside, runs along the surface fibres); S is the other.
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.yarn.yarn import Direction, Yarn

__all__ = ["GIRTH", "OVERLAP", "Period", "Strands", "drawn_radius", "pack_section", "rotate_section", "spin", "unit"]

F64 = NDArray[np.float64]
GOLDEN_ANGLE = pi * (3.0 - sqrt(5.0))


@dataclass(frozen=True)
class Period:
    """A length of yarn that closes on itself: `blocks` blocks of `block_length` [m].

    ply_turns, single_turns: whole turns in the period, signed (Z positive).
    """

    block_length: float
    blocks: int
    ply_turns: int
    single_turns: int

    @cached_property
    def length(self) -> float:
        return self.block_length * self.blocks

    @staticmethod
    def of(yarn: Yarn, block_length: float, *, least: int = 24, most: int = 96) -> "Period":
        """The period of `least` to `most` blocks whose whole turns come nearest to the stated twists."""
        folding, own = _signed_twists(yarn)
        counts = np.arange(least, most + 1)
        error = np.zeros(len(counts))
        for twist in (folding, own):
            if twist != 0.0:
                turns = twist * block_length * counts
                error = np.maximum(error, np.abs(np.rint(turns) - turns) / np.abs(turns))
        blocks = int(counts[np.argmin(error)])
        length = blocks * block_length
        return Period(block_length, blocks, round(folding * length), round(own * length))


@dataclass(frozen=True)
class Strands:
    """Fibres of a straight yarn as rows of points, one row a fibre piece, equally spaced along the yarn.

    position: (f, k, 3) [m], x along the yarn, (y, z) from its axis. tangent, normal: (f, k, 3) unit vectors; the
    normal points away from the ply's axis. ply: (f,) int32. tone: (f,) brightness factor about 1.
    depth: (f, k) 0 at the middle of the yarn, 1 at its surface and beyond. radius: (f, k) [m] of the drawn fibre. away:
    (f, k) [m] from the ply's axis.
    half_length: (f, k) [m] half the distance between neighbours, with the overlap that makes a row read as one.
    """

    position: F64
    tangent: F64
    normal: F64
    ply: NDArray[np.int32]
    tone: F64
    depth: F64
    radius: F64
    away: F64
    half_length: F64


OVERLAP = 3.0  # length of a drawn piece over the distance between pieces; below, a row of them shows its joints
TONE = 0.10  # spread of brightness from fibre to fibre
TWISTS = 3  # waves of its twist along a period
GIRTH = 0.18  # spread of radius from fibre to fibre


def pack_section(count: int) -> tuple[F64, F64]:
    """Even packing of `count` fibres in a unit disc: (area fraction in (0, 1), angle [rad]), each (count,).

    Vogel's spiral: radius √((k + ½)/n), successive angles apart by the golden angle; equal area for each fibre.
    """
    k = np.arange(count, dtype=np.float64)
    return (k + 0.5) / count, k * GOLDEN_ANGLE


def rotate_section(position: F64, angle: F64) -> F64:
    """Rotate points about the yarn's axis x: (…, 3) by (…,) [rad]. The move of the paper's Step 2."""
    c, s = np.cos(angle), np.sin(angle)
    y, z = position[..., 1], position[..., 2]
    return np.stack([position[..., 0], c * y - s * z, s * y + c * z], axis=-1)


def spin(
    yarn: Yarn,
    period: Period,
    *,
    fibres: int,
    steps: int,
    start: float,
    stop: float,
    seed: int,
    folded: bool = True,
) -> Strands:
    """Lay out `fibres` fibres a ply of the periodic yarn between `start` and `stop` [m], `steps` points a block.

    The drawn fibres are as many as asked for; their radius is such that they cover the area of the real ones.
    folded: False leaves the plies parallel and untwisted about each other (the paper's Step 1).
    Points stand at the middles of steps; x is measured from the start of the period.
    """
    count = max(1, round((stop - start) / period.block_length * steps))
    edges = np.linspace(start, stop, count + 1)
    x = (edges[:-1] + edges[1:]) / 2
    pitch = (stop - start) / count
    course = _Course(yarn, period, fibres, seed, folded)
    middle, centre, depth = course(x)
    delta = 0.25 * pitch
    ahead, _, _ = course(x + delta)
    behind, _, _ = course(x - delta)
    tangent = unit(ahead - behind)
    out = middle - centre
    out[..., 0] = 0.0
    normal = out - tangent * np.sum(out * tangent, axis=-1, keepdims=True)
    slant = 1.0 / np.maximum(np.abs(tangent[..., 0]), 0.3)
    rows = yarn.plies * fibres
    return Strands(
        position=middle,
        tangent=tangent,
        normal=unit(normal),
        ply=np.repeat(np.arange(yarn.plies, dtype=np.int32), fibres),
        tone=course.tone,
        depth=depth,
        radius=np.broadcast_to((drawn_radius(yarn, fibres) * course.girth)[:, None], (rows, count)),
        away=np.linalg.norm(out, axis=-1),
        half_length=OVERLAP * 0.5 * pitch * slant * np.ones((rows, count)),
    )


def drawn_radius(yarn: Yarn, fibres: int) -> float:
    """Radius [m] of a drawn fibre when `fibres` of them stand for all fibres of a single, at equal area."""
    return yarn.fibre_diameter / 2 * sqrt(yarn.fibres_in_section / fibres)


class _Course:
    """Where each fibre of the periodic yarn is at a length x: closed forms, so that any piece fits its neighbour."""

    def __init__(self, yarn: Yarn, period: Period, fibres: int, seed: int, folded: bool) -> None:
        self.yarn, self.period, self.folded = yarn, period, folded
        rng = np.random.Generator(np.random.Philox(key=seed))
        rows = yarn.plies * fibres
        area, angle = pack_section(fibres)
        self.area = np.tile(area, yarn.plies)[:, None]
        spins = rng.uniform(0.0, 2.0 * pi, yarn.plies)  # neighbouring plies must not be copies of each other
        self.angle = (np.tile(angle, yarn.plies) + np.repeat(spins, fibres))[:, None]
        self.ply_angle = (2.0 * pi / yarn.plies * np.repeat(np.arange(yarn.plies), fibres))[:, None]
        mean_waves = max(1, round(period.length / (yarn.migration_period_mm * 1e-3)))
        spread = max(1, mean_waves // 3)
        self.waves = rng.integers(max(1, mean_waves - spread), mean_waves + spread + 1, (rows, 2))
        self.wave_phase = rng.uniform(0.0, 2.0 * pi, (rows, 2))
        tone = np.clip(rng.standard_normal(rows), -2.0, 2.0)
        girth = 1.0 + GIRTH * rng.uniform(-1.0, 1.0, rows)
        self.girth = girth / np.sqrt(np.mean(girth**2))  # spread, at the same area in all
        # A yarn's colour is the mean of few as of many.
        self.tone = 1.0 + TONE * (tone - np.average(tone, weights=girth))
        # Where a yarn is thin it is twisted more: turns that it is ahead of even ones, over the turns there are.
        waves = np.random.Generator(np.random.Philox(key=[seed, 5])).standard_normal((2, TWISTS))
        self.ahead = waves * yarn.unevenness / sqrt(TWISTS) / (2.0 * pi * np.arange(1, TWISTS + 1))
        self.inset = np.maximum(0.0, 1.0 - drawn_radius(yarn, fibres) * self.girth / min(yarn.ply_axes))[:, None]

    def __call__(self, x: F64) -> tuple[F64, F64, F64]:
        """Points (f, k, 3), the axis of their ply (f, k, 3), depth in the yarn (f, k)."""
        yarn, turn = self.yarn, 2.0 * pi * x[None, :] / self.period.length
        wander = np.sin(self.waves[:, :1] * turn + self.wave_phase[:, :1])
        swing = np.sin(self.waves[:, 1:] * turn + self.wave_phase[:, 1:])
        # The area fraction wanders and is folded back at the axis and at the surface, so density stays even.
        fraction = self.area + 0.5 * yarn.migration * wander
        fraction = np.abs(fraction)
        fraction = np.where(fraction > 1.0, 2.0 - fraction, fraction)
        rho = self.inset * np.sqrt(np.clip(fraction, 0.0, 1.0))
        order = np.arange(1, TWISTS + 1)[:, None] * turn
        turn = turn + 2.0 * pi * (self.ahead[0] @ np.sin(order) + self.ahead[1] @ (1.0 - np.cos(order)))
        own = self.angle + self.period.single_turns * turn + 0.8 * yarn.migration * swing
        radial, tangential = yarn.ply_axes
        zero = np.zeros_like(rho)
        local = np.stack([zero, yarn.ply_offset + radial * rho * np.cos(own), tangential * rho * np.sin(own)], -1)
        axis = np.stack([zero, zero + yarn.ply_offset, zero], -1)
        if yarn.plies > 1:
            fold = self.ply_angle + (self.period.ply_turns * turn if self.folded else zero)
            local, axis = rotate_section(local, fold), rotate_section(axis, fold)
        local[..., 0] = x
        axis[..., 0] = x
        return local, axis, np.clip(np.hypot(local[..., 1], local[..., 2]) / (yarn.diameter / 2), 0.0, 1.0)


def _signed_twists(yarn: Yarn) -> tuple[float, float]:
    """(folding, inside each single) [turns/m], Z positive. A single yarn has its twist inside."""

    def sign(direction: Direction) -> float:
        return 1.0 if direction == "Z" else -1.0

    if yarn.plies == 1:
        return 0.0, sign(yarn.twist) * yarn.twist_per_m
    return sign(yarn.twist) * yarn.twist_per_m, sign(yarn.singles_twist) * yarn.singles_twist_per_m


def unit(v: Any) -> F64:
    """Vectors (…, 3) at length 1."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30)
