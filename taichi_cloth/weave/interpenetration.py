"""How deep do the yarns of a cloth run into each other? Sampled from the paths, without trusting their formulas."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.weave.crimp import Family, Interlacing, PathKinds, centreline, path_kinds

__all__ = ["Interpenetration", "Path", "deepest_interpenetration"]

Path = Callable[[PathKinds, ArrayLike], tuple[NDArray[np.float64], NDArray[np.float64]]]
F32 = NDArray[np.float32]

_AT_ONCE = 4_000_000  # distances held at a time


@dataclass(frozen=True)
class Interpenetration:
    """The worst place of a cloth.

    fraction: depth over the smaller diameter of the two yarns, 0 when they only touch, below 0 when they do not.
    depth_m: sum of the radii less the distance of the centrelines [m].
    between: the two families. pick, end: where, counted from 0; the first of the two threads when neighbours.
    """

    fraction: float
    depth_m: float
    between: Literal["warp-weft", "warp-warp", "weft-weft"]
    pick: int
    end: int


def deepest_interpenetration(cloth: Interlacing, *, samples: int = 16, path: Path = centreline) -> Interpenetration:
    """Sample every yarn in 3-D, `samples` points a block, and find where two yarns overlap most.

    Looked at: at every crossing, the two yarns that cross, one block to either side; and every pair of
    neighbours of one family along their whole length. path: the centreline that is measured.

    The crossings themselves, where the yarns touch, are among the samples. Elsewhere the nearest samples are apart
    by d, the yarns by a little less: sqrt(d² - (pitch / samples)² / 2) at worst. Raises InputError when the threads
    jam.
    """
    cloth = cloth.round_core()
    u = np.arange(samples) / samples
    warp, weft = _Sampled.of(cloth, "warp", u, path), _Sampled.of(cloth, "weft", u, path)
    found = [_crossings(cloth, warp, weft, samples)]
    families: tuple[tuple[Family, _Sampled], ...] = (("warp", warp), ("weft", weft))
    found += [_neighbours(cloth, family, sampled, samples) for family, sampled in families]
    return max(found, key=lambda item: item.fraction)


@dataclass(frozen=True)
class _Sampled:
    """All yarns of a family: heights z (threads, points), ways along the yarn (points,), its period or 0, all [m]."""

    z: F32
    way: F32
    period: float

    @classmethod
    def of(cls, cloth: Interlacing, family: Family, u: NDArray[np.float64], path: Path) -> "_Sampled":
        kinds = path_kinds(cloth, family)
        if family == "warp":
            kinds = PathKinds(kinds.pitch.T, kinds.z0.T, kinds.z1.T, kinds.r0.T, kinds.r1.T)
        pitch = cloth.pitches("weft" if family == "warp" else "warp")
        start = np.concatenate([[0.0], np.cumsum(pitch)])
        threads = kinds.z0.shape[0]
        z = path(kinds, u)[0].reshape(threads, -1)
        way = (start[:-1, None] + u * pitch[:, None]).reshape(-1)
        if cloth.periodic:
            return cls(z.astype(np.float32), np.asarray(way, np.float32), float(start[-1]))
        last = kinds.z1[:, -1:] if pitch.size else _only_crossing(cloth, family)
        return cls(
            np.concatenate([z, last], axis=1).astype(np.float32), np.append(way, start[-1]).astype(np.float32), 0.0
        )

    def at(self, point: NDArray[np.intp]) -> tuple[F32, F32]:
        """Heights (threads, …) and ways (…) at points counted beyond either end, clamped when not
        periodic.
        """
        count = self.way.size
        if self.period:
            turn, point = np.divmod(point, count)
            return self.z[:, point], (self.way[point] + turn * self.period).astype(np.float32)
        point = np.clip(point, 0, count - 1)
        return self.z[:, point], self.way[point].astype(np.float32)


def _only_crossing(cloth: Interlacing, family: Family) -> NDArray[np.float64]:
    one = path_kinds(Interlacing(**{**cloth.__dict__, "periodic": True}), family)
    return one.z0.T[:, :1] if family == "warp" else one.z0[:, :1]


def _crossings(cloth: Interlacing, warp: _Sampled, weft: _Sampled, samples: int) -> Interpenetration:
    """Warp end j at (x_j, y, z(y)) against weft pick i at (x, y_i, z(x)), one block to either side of
    (x_j, y_i).
    """
    reach = np.arange(-samples, samples + 1)
    picks, ends = cloth.picks, cloth.ends
    z_weft, x = weft.at(np.arange(ends)[:, None] * samples + reach)  # (picks, ends, m), (ends, m)
    across = (x - x[:, samples : samples + 1]) ** 2
    best = Interpenetration(-np.inf, 0.0, "warp-weft", 0, 0)
    strip = max(1, _AT_ONCE // (ends * reach.size**2))
    for first in range(0, picks, strip):
        i = np.arange(first, min(first + strip, picks))
        z_warp, y = warp.at(i[:, None] * samples + reach)  # (ends, strip, m), (strip, m)
        along = (y - y[:, samples : samples + 1]) ** 2
        square = (z_warp.transpose(1, 0, 2)[:, :, :, None] - z_weft[i][:, :, None, :]) ** 2
        square += along[:, None, :, None]
        square += across[None, :, None, :]
        distance = np.sqrt(square.min(axis=(2, 3)).astype(np.float64))
        d_warp, d_weft = cloth.warp_diameter_m[None, :], cloth.weft_diameter_m[i, None]
        depth = 0.5 * (d_warp + d_weft) - distance
        fraction = depth / np.minimum(d_warp, d_weft)
        k, j = np.unravel_index(np.argmax(fraction), fraction.shape)
        if fraction[k, j] > best.fraction:
            best = Interpenetration(float(fraction[k, j]), float(depth[k, j]), "warp-weft", int(i[k]), int(j))
    return best


def _neighbours(cloth: Interlacing, family: Family, yarns: _Sampled, samples: int) -> Interpenetration:
    """Each thread against the next of its family, points up to half a block apart along the way."""
    pitch = cloth.pitches(family)
    diameter = cloth.warp_diameter_m if family == "warp" else cloth.weft_diameter_m
    between: Literal["warp-warp", "weft-weft"] = "warp-warp" if family == "warp" else "weft-weft"
    if pitch.size == 0:
        return Interpenetration(-np.inf, 0.0, between, 0, 0)
    this, following = np.arange(pitch.size), (np.arange(pitch.size) + 1) % diameter.size
    points = np.arange(yarns.way.size)
    z, way = yarns.at(points)
    least = np.full((pitch.size, points.size), np.inf, dtype=np.float32)
    for shift in range(-(samples // 2), samples // 2 + 1):
        z_shifted, way_shifted = yarns.at(points + shift)
        square = (z[this] - z_shifted[following]) ** 2
        square += (way_shifted - way) ** 2
        np.minimum(least, square, out=least)
    place = np.argmin(least, axis=1)
    distance = np.sqrt(least[this, place].astype(np.float64) + pitch**2)
    depth = 0.5 * (diameter[this] + diameter[following]) - distance
    fraction = depth / np.minimum(diameter[this], diameter[following])
    k = int(np.argmax(fraction))
    crossing = int(place[k]) // samples
    pick, end = (crossing, k) if family == "warp" else (k, crossing)
    return Interpenetration(float(fraction[k]), float(depth[k]), between, pick, end)
