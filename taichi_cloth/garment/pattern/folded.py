"""A ring sector that falls from a waist in folds with its lengths kept, round and down: circle skirts and their tiers.

Of a full circle the hem is several times as long as a cone that hangs as steeply has room for. A `Cone` is right to
the second order of its waves, which is enough of a flared skirt; a full circle starts stretched and squeezed by a half,
and what springs back out of that crumples. Here waves are as high as it takes for each level to be as long as the
cloth is there, points lie along them by length, and how far down each lies follows from how far out it came.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from taichi_cloth.garment.pattern.pattern import Cone

__all__ = ["Folded"]

F64 = NDArray[np.float64]

STEEPEST = 0.6
"""How fast the mean of the folds goes out with each length down, at most."""
DEEP = 1.0
"""Of the table of a sector that is no tier [m]."""
LEVELS, ROUND = 48, 721
"""Of the table of places, down and round."""
LEAST = 0.15
"""How far down a piece goes with each length of its own, at least: near a full circle's waist folds cannot begin as
fast as cloth is added there."""


@dataclass(frozen=True, eq=False)
class Folded(Cone):
    """As `Cone`. begins: how far down the skirt the sector's arc is [m]. profile: (k, 2) how far down, and how long the
    cloth is there round the whole turn [m], of the skirt that the sector is a tier of; empty: of the sector alone."""

    begins: float = 0.0
    profile: F64 = field(default_factory=lambda: np.zeros((0, 2)))

    def points(self, xy: F64) -> F64:
        """(n, 2) of the panel to (n, 3) of the world [m]."""
        down = np.hypot(xy[:, 0], self.inner - xy[:, 1]) - self.inner
        turn = np.arctan2(xy[:, 0], self.inner - xy[:, 1]) * self.share / self.angle
        table, deep = self._table, self.begins + down
        at = table(np.stack([np.clip(deep, 0.0, table.grid[0][-1]), np.clip(turn, -0.5, 0.5)], -1))
        at[:, 2] += deep - np.clip(deep, 0.0, table.grid[0][-1])
        sideways = np.cross(np.array([0.0, 1.0, 0.0]), self.outward)
        up = np.array([0.0, 1.0, 0.0])
        return self.origin + at[:, :1] * self.outward + at[:, 1:2] * sideways - at[:, 2:] * up

    def hanging(self, xy: F64) -> F64:
        """(n,) heights of points (n, 2) of the panel where the whole skirt hangs straight down [m]."""
        return self.origin[1] - self.begins - np.hypot(xy[:, 0], self.inner - xy[:, 1]) + self.inner

    @cached_property
    def _table(self) -> RegularGridInterpolator:
        """Out, aside and down [m] of how far down the cloth, and of a share of the turn."""
        whole = self.angle / self.share
        alone = np.array([[0.0, self.inner * whole], [DEEP, (self.inner + DEEP) * whole]])
        given = self.profile if len(self.profile) else alone
        d = np.linspace(0.0, float(given[-1, 0]), LEVELS)
        a, b = self.radius
        angle = np.linspace(-np.pi, np.pi, ROUND)
        first = _walked(np.stack([a * np.cos(angle), b * np.sin(angle)], -1))
        long = np.interp(d, given[:, 0], given[:, 1])
        growth = np.gradient(long, d)
        slope = np.minimum(self.hang * growth / (2 * np.pi), STEEPEST)
        wide = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(d))])
        wide = np.clip((long - long[0]) / (2 * np.pi), 0.0, wide)
        long = np.maximum(long - long[0] + first[-1], first[-1])
        wave = np.cos(self.folds * 2 * np.pi * (first / first[-1] - 0.5))
        turn = np.linspace(0.0, 1.0, ROUND)
        places = np.zeros((LEVELS, ROUND, 3))

        def ring(k: int, high: float) -> F64:
            """(ROUND, 3) of a level whose waves are so high, points at equal lengths."""
            out = wide[k] - high * wave
            line = np.stack([(a + out) * np.cos(angle), (b + out) * np.sin(angle)], -1)
            walked = _walked(line)
            now, deep = _at_shares(line, walked), np.zeros(ROUND)
            for _ in range(2 if k else 0):  # how far down points lie adds to their lengths, too
                now, share = _at_shares(line, walked), walked / walked[-1]
                step = d[k] - d[k - 1]
                gone = ((now - places[k - 1, :, :2]) ** 2).sum(axis=1)
                deep = places[k - 1, :, 2] + np.sqrt(np.maximum(step**2 - gone, (LEAST * step) ** 2))
                walked = _walked(np.column_stack([line, np.interp(share, turn, deep)]))
            return np.column_stack([now, deep])

        for k in range(LEVELS):
            low, high = 0.0, (a + b) / 2 + wide[k]
            for _ in range(18):  # the higher the longer
                middle = (low + high) / 2
                low, high = (middle, high) if _walked(ring(k, middle))[-1] < long[k] else (low, middle)
            places[k] = ring(k, low)
        return RegularGridInterpolator((d, turn - 0.5), places)


def _at_shares(line: F64, walked: F64) -> F64:
    """(ROUND, 2) at equal parts of the lengths that were walked along a line (n, 2)."""
    at = np.linspace(0.0, walked[-1], ROUND)
    return np.stack([np.interp(at, walked, line[:, c]) for c in (0, 1)], -1)


def _walked(line: F64) -> F64:
    """(n,) lengths along a line (n, 2 or 3) from its start."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
