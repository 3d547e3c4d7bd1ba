"""What of a body cloth can touch: its primitives or distance grids, how its bones move, gap and friction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.ground.cache import digest
from taichi_cloth.ground.errors import InputError

__all__ = ["BoneFrame", "Colliders", "Motion", "Solid", "solid_distance"]

F64 = NDArray[np.float64]
Motion = Callable[[float], F64]
Solid = Primitive | DistanceGrid
"""What a part of a body may be to the cloth that touches it."""

LETTING_OUT = 3
"""How often points are moved out of the gap: what one solid lets out may come near another."""


def solid_distance(solids: Sequence[Solid], points: NDArray) -> F64:
    """Signed distance (n,) [m] of points (n, 3) from what one or more solids at rest stand for together."""
    return _nearest(solids, np.asarray(points, np.float64))[0]


def _nearest(solids: Sequence[Solid], points: F64) -> tuple[F64, F64]:
    """The same, and its gradient (n, 3)."""
    primitives = [s for s in solids if isinstance(s, Primitive)]
    found = [nearest_distance(primitives, points)[:2]] if primitives else []
    found += [s.at(points)[:2] for s in solids if isinstance(s, DistanceGrid)]
    nearest = np.argmin([distance for distance, _ in found], axis=0)
    at = np.arange(len(points))
    return np.stack([d for d, _ in found])[nearest, at], np.stack([n for _, n in found])[nearest, at]


@dataclass(frozen=True, eq=False)
class BoneFrame:
    """start, end: (bones, 4, 4), from the world at rest to the world at the two ends of a frame; rigid."""

    start: F64
    end: F64


@dataclass(frozen=True, kw_only=True, eq=False)
class Colliders:
    """A body that cloth can touch. Raises InputError on one that cannot be.

    primitives, grids: what it is made of, at rest. motion: time [s] → (bones, 4, 4), where rest positions go, rigid;
    None: the body stands still. name: of the motion, which tells one from another where a run is resumed.
    friction: Coulomb's µ. gap: kept between the body and the key points [m], the thickness of the cloth.
    beyond: how much wider than it is each of `solids` is touched [m], where it does not cover all that it stands for
    or key points would let it through; empty: none is. recovery: how fast key points that lie inside are let out, and
    get no speed by it [m/s].
    spared: (rows, cols) int32 of one sheet's key points, bits 1 << bone of the bones that each does not meet
    (`garment/limbs.py`); None: all meet all, and nothing is spent on it.
    between: where key points lie between two limbs that face each other, how far from the middle those leave them at
    least, and give way themselves [m]; None: each keeps out what it meets.
    limbs: of each bone the number of the limb that it is of; empty: all are one, and only those give way that face one
    which key points do not meet.
    """

    primitives: tuple[Primitive, ...] = ()
    grids: tuple[DistanceGrid, ...] = field(default=(), repr=False)
    motion: Motion | None = field(default=None, repr=False)
    name: str = ""
    friction: float = 0.3
    gap: float = 0.0
    beyond: tuple[float, ...] = ()
    recovery: float = 1.0
    spared: NDArray[np.int32] | None = field(default=None, repr=False)
    between: float | None = None
    limbs: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.primitives and not self.grids:
            raise InputError("body: nothing to touch; allowed: one primitive or grid, or more")
        for name in ("friction", "gap", "recovery"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"body.{name}: {value!r}; allowed: a finite number, 0 or more")
        if self.beyond and (len(self.beyond) != len(self.solids) or not min(self.beyond) >= 0):
            raise InputError(f"body.beyond: {len(self.beyond)} numbers; allowed: 0 or more for each of its solids")
        if self.motion is not None:
            self.during(0.0, 0.0)

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Primitives, then grids."""
        return (*self.primitives, *self.grids)

    @property
    def wider(self) -> tuple[float, ...]:
        """How much wider than it is each of `solids` is touched [m], also where none is."""
        return self.beyond or (0.0,) * len(self.solids)

    @cached_property
    def touched(self) -> "Colliders":
        """The same as cloth meets it, nothing beyond."""
        if not any(self.beyond):
            return self
        wider = [solid.wider(by) for solid, by in zip(self.solids, self.beyond, strict=True)]
        primitives = tuple(s for s in wider if isinstance(s, Primitive))
        grids = tuple(s for s in wider if isinstance(s, DistanceGrid))
        return replace(self, primitives=primitives, grids=grids, beyond=())

    def let_out(self, points: F64) -> F64:
        """Points (n, 3) [m] at rest, those within the gap moved out of it, but for those as deep in the body as they
        would have to be out of it, and for those that one solid would let out into another."""
        start, deepest = np.asarray(points, np.float64), -self.gap - 2 * max(self.beyond, default=0.0)
        solids = self.touched.solids
        before = solid_distance(solids, start)
        out, near = start.copy(), (before > deepest) & (before < self.gap)
        for _ in range(LETTING_OUT):
            distance, normal = _nearest(solids, out)
            inside = near & (distance < self.gap)
            out[inside] += (self.gap - distance[inside])[:, None] * normal[inside]
        worse = solid_distance(solids, out) < before
        return np.where(worse[:, None], start, out)

    def made_of(self) -> str:
        """A hash of what cloth meets. Of a motion that has no name, where it leads in the first seconds."""
        moves = [self.name] if self.name or self.motion is None else [self.at(t) for t in (0.0, 0.1, 0.37, 1.0, 2.3)]
        grids = [(g.origin, g.spacing, g.values, g.part, g.bone) for g in self.grids]
        spared = tuple(one for one in (self.spared, self.between, self.limbs or None) if one is not None)
        return digest(
            list(self.primitives), grids, moves, self.friction, self.gap, list(self.beyond), self.recovery, *spared
        )

    def at(self, time: float) -> F64:
        """(bones, 4, 4) at a time [s]. Raises InputError where the motion gives something that is not rigid."""
        bones = 1 + max(s.bone for s in self.solids)
        if self.motion is None:
            return np.broadcast_to(np.eye(4), (bones, 4, 4))
        out = np.asarray(self.motion(time), np.float64)
        if out.ndim != 3 or out.shape[1:] != (4, 4) or len(out) < bones or not np.isfinite(out).all():
            raise InputError(f"body.motion: {out.shape} at {time:g} s; allowed: ({bones} or more, 4, 4), finite")
        turn = out[:, :3, :3]
        if np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max() > 1e-4 or (np.linalg.det(turn) < 0).any():
            raise InputError(f"body.motion: a bone that is not rigid at {time:g} s; allowed: turns and shifts")
        return out

    def during(self, start: float, end: float) -> BoneFrame:
        """The bones at the ends of a frame [s]."""
        return BoneFrame(self._recent(start), self._recent(end))

    @cached_property
    def _recent(self) -> Motion:
        """`at`, of the last two times kept: a frame starts where the one before ended."""
        return lru_cache(maxsize=2)(self.at)
