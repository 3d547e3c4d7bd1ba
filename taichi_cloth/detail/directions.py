"""Directions of fibres that stand for many: they spread as those of all that are seen do.

A yarn's own fibres lean across it and out of the cloth by its twist, where they wander, and where it goes over and
under. Of a few thick ones, with few pieces each, other shares are seen of the flat and the steep: too few where a float
of satin dives, which is where silk shines. So a fibre's direction is taken for that of the same rank among all: how far
it rises and how far it leans aside each go through a table that leads from the one distribution of what is seen to the
other. Where many are alike, chance says which is before which.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x2

__all__ = ["DIRECTIONS", "FACING", "VIEWS", "Seen", "mended", "tables", "turned"]

F64 = NDArray[np.float64]

STEPS = 32
"""Steps of the root of what a direction rises or leans, to each side, in which ranks are known: flat ones are told
apart more finely."""
VALUES = 128
"""Of all that are seen, that stand for them, each for as much of what is seen."""
CLASSES = 16
"""Of them by how far they rise, each with its mean normal."""
NODES = 2 * STEPS + 2
EACH = NODES + VALUES
NORMALS = 2 * EACH
DIRECTIONS = NORMALS + 2 * CLASSES
"""Numbers of the tables of a family on a side: of what directions rise the ranks and the values, of what they lean,
and by how much normals of each class are moved along the thread and out of the cloth."""
FACING = 0.2
"""Cosine of the angle between a thread and the view from which on it is known which way it goes towards the eye."""
CHANCES = 4
"""That are tried of each direction."""
ALIKE = 1e-3
"""Values that differ by less are taken for the same."""
MIDDLES = (np.arange(VALUES) + 0.5) / VALUES


VIEWS = 0.4, 0.9
"""Cosines of the angles between the cloth's normal and the view for which there are tables; between them chance picks
one, as beyond them it does the nearer."""


@dataclass(frozen=True)
class Seen:
    """Fibres' pieces that are seen, in their threads' frames, (n,) each. rise: how far their directions rise, along
    where it is towards the eye; lean: how far they lean aside; ahead, up: of their normals, along likewise and out of
    the cloth; share: of what is seen."""

    rise: F64
    lean: F64
    ahead: F64
    up: F64
    share: F64


def tables(have: Seen, want: Seen, rng: np.random.Generator) -> F64:
    """Tables (DIRECTIONS,) from the directions that there are to those that there should be; normals stay."""
    out = []
    for these, those in ((have.rise, want.rise), (have.lean, want.lean)):
        place = STEPS * (1.0 + np.sign(these) * np.sqrt(np.abs(these)))
        at = (place[:, None] + rng.random((len(these), CHANCES))).ravel()
        at, below = _ranked(at, np.repeat(have.share, CHANCES))
        values, share = _ranked(those, want.share)
        out += np.interp(np.arange(NODES), at, below), np.interp(MIDDLES, share, values)
    return np.concatenate([*out, np.zeros(2 * CLASSES)])


def mended(table: F64, have: Seen, want: Seen) -> F64:
    """Tables with ranks and normals by what is seen of what went through them."""
    out = table.copy()
    normals = out[NORMALS:].reshape(CLASSES, 2)
    for begin, these in ((0, have.rise), (EACH, have.lean)):
        rank, values = out[begin : begin + NODES], out[begin + NODES : begin + EACH]
        one, group, like = np.unique(np.rint(values / ALIKE), return_inverse=True, return_counts=True)
        found = np.searchsorted((one[1:] + one[:-1]) / 2, these / ALIKE)
        if begin == 0:
            normals += _mean_normals(want, _class_of(want)) - _mean_normals(have, _class_of(have))
        seen = np.cumsum((np.bincount(found, have.share, len(one)) / like)[group])  # of values alike each the same
        rank[:] = np.interp(rank * VALUES, np.arange(VALUES + 1), np.append(0.0, seen / seen[-1]))
    return out


def _class_of(seen: Seen) -> NDArray[np.int64]:
    """Class of each by how far it rises."""
    below = np.empty(len(seen.rise))
    below[np.argsort(seen.rise)] = _ranked(seen.rise, seen.share)[1]
    return np.minimum((below * CLASSES).astype(np.int64), CLASSES - 1)


def _mean_normals(seen: Seen, number: NDArray[np.int64]) -> F64:
    """Of each class, (CLASSES, 2)."""
    sums = [np.bincount(number, seen.share * one, CLASSES) for one in (seen.ahead, seen.up)]
    return np.stack(sums, 1) / np.maximum(np.bincount(number, seen.share, CLASSES), 1e-12)[:, None]


def _ranked(values: F64, weight: F64) -> tuple[F64, F64]:
    """Values in order, and the share of the weight that lies below the middle of each."""
    order = np.argsort(values)
    share = weight[order]
    return values[order], (np.cumsum(share) - 0.5 * share) / max(float(share.sum()), 1e-30)


@ti.func
def turned(tangent, normal, towards, by: F32x2, row, begin, chance, aside, flip):
    """A direction and a normal in the thread's frame (along, across, up) as tables say that begin at by[row, begin].
    towards: how far the thread goes to the eye, cosine; 0 where there is none. chance, aside, flip: 0 to 1. Where no
    table is, as they are."""
    out, outward = tangent, normal
    if by[row, begin + ti.static(NODES - 1)] > 0.0:
        way = ti.select(tangent[0] < 0.0, -1.0, 1.0)
        to_eye = ti.select(flip < 0.5 + ti.static(0.5 / FACING) * towards, 1.0, -1.0)
        facing = to_eye * way
        number = _ranked_at(facing * tangent[2], by, row, begin, chance)
        rise = facing * by[row, begin + ti.static(NODES) + number]
        other = begin + ti.static(EACH)
        lean = way * by[row, other + ti.static(NODES) + _ranked_at(way * tangent[1], by, row, other, aside)]
        rest = way * ti.sqrt(ti.max(1.0 - rise * rise - lean * lean, 0.0))
        out = ti.Vector([rest, lean, rise]).normalized()
        outward = normal + (tangent - out).dot(normal) * out  # as square to it as it was
        at = begin + ti.static(NORMALS) + 2 * (number // ti.static(VALUES // CLASSES))
        outward = outward.normalized() + ti.Vector([to_eye * by[row, at], 0.0, by[row, at + 1]])
    return out, outward


@ti.func
def _ranked_at(value, by: F32x2, row, begin, chance):
    """Which of the values it is that stands for one that rises or leans so far."""
    root = ti.sqrt(ti.min(ti.abs(value), 1.0))
    at = ti.static(float(STEPS)) * (1.0 + ti.select(value < 0.0, -root, root)) + chance
    k = ti.cast(at, ti.i32)
    rank = by[row, begin + k] + (at - k) * (by[row, begin + k + 1] - by[row, begin + k])
    return ti.math.clamp(ti.cast(rank * ti.static(float(VALUES)), ti.i32), 0, ti.static(VALUES - 1))
