"""Ties: points of the cloth held together, or held to a moving place, by correcting positions after each substep.

A tie is a blend of up to eight key points, d = Σ w x (− target): the gap between two points embedded in the cloth, or
between one and its place. A gap wider than allowed is closed along d, shared out by w/m:

    Δx_k = −w_k/m_k · λ,      λ = (1 − allowed/|d|) d / Σ w_k²/m_k,

which keeps the momentum of what is tied together. Ties are worked through in order, each seeing what the ones before
did (Gauss–Seidel). What is allowed shrinks from frame to frame, so panels are drawn together at a set speed.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false
# pyright: reportArgumentType=false

from functools import lru_cache

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth import runtime
from taichi_cloth.arrays import F32x2, Template
from taichi_cloth.cache import digest
from taichi_cloth.errors import InputError
from taichi_cloth.forces import FrameForces
from taichi_cloth.sheet import PAD, Sheet, SheetState
from taichi_cloth.solvers.passes import Pass

__all__ = ["Ties"]

F64 = NDArray[np.float64]
NODES = 8
SHARE = NODES
ROW = 2 * NODES
"""Numbers of a tie that stay: weights, shares w/m / Σ w²/m."""
ALLOWED = 6
PATH = ALLOWED + 2
"""Numbers of a tie for a frame: target at its start [m] and how far it moves, width allowed at its start [m] and how
that changes."""

SLACK = 1e-4
"""By how much a tie has to be too wide to be seen to more than once in a substep [m]: few are."""


class Ties(Pass):
    """nodes: int (n, m ≤ 8, 2) rows and columns of key points. weights: (n, m); those of a tie sum to 0, or to 1 where
    it has a place. speed: at which gaps are closed [m/s].
    places: (n, 3) [m] at rest for a tie to a place, NaN for one between two points; None: all of the latter.
    bones: (n,) the bone that carries each place, −1 for none; None: none are carried.

    Raises InputError on shapes that differ or no ties.
    """

    whole = True
    repeated = True
    substeps: int
    reach: float

    def __init__(
        self,
        sheet: Sheet,
        nodes: NDArray[np.int64],
        weights: F64,
        *,
        speed: float = 0.5,
        places: F64 | None = None,
        bones: NDArray[np.int64] | None = None,
    ) -> None:
        n, m = weights.shape
        if nodes.shape != (n, m, 2) or m > NODES or n == 0:
            shapes = f"{nodes.shape} and {weights.shape}"
            raise InputError(f"ties: nodes and weights of shapes {shapes}; allowed: (n, m, 2) and (n, m), m at most 8")
        self.count, self.speed = n, speed
        self.index = np.zeros((n, NODES), np.int32)
        self.weight = np.zeros((n, NODES), np.float32)
        self.index[:, :m] = (nodes[..., 0] + PAD) * sheet.width + nodes[..., 1]
        self.weight[:, :m] = weights
        for c in range(1, m):  # a key point that a tie names twice is one: its lanes are read and written at once
            for b in range(c):
                again = self.index[:, c] == self.index[:, b]
                self.weight[again, b] += self.weight[again, c]
                self.weight[again, c] = 0.0
        self.index[self.weight == 0.0] = 0  # in the padding, where nothing is
        inverse = sheet.padded(sheet.inverse_mass).reshape(-1)[self.index]
        compliance = (self.weight.astype(np.float64) ** 2 * inverse).sum(axis=1, keepdims=True)
        self.share = self.weight * inverse / np.where(compliance > 0, compliance, np.inf)
        self.blend = self.weight.astype(np.float64)
        self.places = np.full((n, 3), np.nan) if places is None else np.asarray(places, np.float64)
        self.bones = np.full(n, -1) if bones is None else np.asarray(bones)
        self.held = np.asarray(np.isfinite(self.places).all(axis=1))
        self.memory = _memory(runtime.generation(), -(-n // 256) * 256)

    # Ties that share their memory are one pass to the solver: they need no second kernel.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, Ties) and self.memory is other.memory

    def __hash__(self) -> int:
        return id(self.memory)

    def made_of(self) -> str:
        return digest(self.index, self.weight, self.share, self.places, self.bones, self.reach)

    def targets(self, bones: F64 | None) -> F64:
        """Places (n, 3) [m] with the bones there, (bones, 4, 4) or None for rest; 0 for ties between two points."""
        out = np.where(self.held[:, None], self.places, 0.0)
        carried = self.held & (self.bones >= 0)
        if bones is not None and carried.any():
            moved = bones[self.bones[carried]]
            out[carried] = np.einsum("nij,nj->ni", moved[:, :3, :3], out[carried]) + moved[:, :3, 3]
        return out

    def gaps(self, state: SheetState, bones: F64 | None = None) -> F64:
        """Width of each gap (n,) [m]."""
        return self._widths(state, self.targets(bones))

    def _widths(self, state: SheetState, targets: F64) -> F64:
        flat = state.values[:3].reshape(3, -1)
        points = np.einsum("cnk,nk->nc", flat[:, self.index], self.blend)
        return np.linalg.norm(points - targets, axis=1)

    def join(self, substeps: int, step: float) -> None:
        self.substeps, self.reach = substeps, self.speed * step * substeps

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        frame, memory = forces.body, self.memory
        start = self.targets(frame.start if frame else None)
        end = self.targets(frame.end if frame else None)
        now = self._widths(state, start)
        path = np.zeros((memory.capacity + 1, PATH), np.float32)
        path[: self.count, :3], path[: self.count, 3:ALLOWED] = start, end - start
        path[: self.count, ALLOWED], path[: self.count, ALLOWED + 1] = now, np.maximum(now - self.reach, 0.0) - now
        path[-1, :2] = self.count, 1.0 / self.substeps
        if memory.holder is not self:
            more = ((0, memory.capacity - self.count), (0, 0))
            memory.node.from_numpy(np.pad(self.index, more))
            memory.row.from_numpy(np.pad(np.concatenate([self.weight, self.share], axis=1).astype(np.float32), more))
            memory.holder = self
        memory.take(path)

    @ti.func
    def before(self, work: Template, done, n: Template):
        self.memory.wide[None] = -1

    @ti.func
    def after_all(self, work: Template, done, n: Template):
        self.memory.pull(work, done)


@lru_cache(maxsize=8)
def _memory(generation: int, capacity: int) -> "_Memory":
    """Fields and functions for that many ties. generation: of the Taichi runtime."""
    return _Memory(capacity)


@ti.data_oriented
class _Memory:
    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.row, self.path = ti.field(ti.f32, (capacity, ROW)), ti.field(ti.f32, (capacity + 1, PATH))
        self.node = ti.field(ti.i32, (capacity, NODES))
        self.holder: Ties | None = None
        self.wide, self.listed = ti.field(ti.i32, ()), ti.field(ti.i32, capacity)

    @ti.kernel
    def take(self, path: F32x2):
        ti.loop_config(serialize=True)  # less work than to wake threads
        for i, j in ti.ndrange(path.shape[0], path.shape[1]):
            self.path[i, j] = path[i, j]

    @ti.func
    def pull(self, work: Template, done):
        """Every tie once, the first time in a substep; from then on those that were much too wide."""
        share = ti.cast(done + 1, ti.f32) * self.path[self.capacity, 1]
        if self.wide[None] < 0:
            found = 0
            for k in range(ti.cast(self.path[self.capacity, 0], ti.i32)):
                if self.close(work, k, share):
                    self.listed[found] = k
                    found += 1
            self.wide[None] = found
        else:
            for m in range(self.wide[None]):
                self.close(work, self.listed[m], share)

    @ti.func
    def close(self, work: Template, k, share):
        """Closes tie k to the width allowed after this share of the frame. Returns whether it was wider by SLACK."""
        x, y, z = ti.static(*work.position)
        u, v, w = ti.static(*work.step)
        place = ti.Vector([self.node[k, c] for c in ti.static(range(NODES))])
        weight = ti.Vector([self.row[k, c] for c in ti.static(range(NODES))])
        here = (gather(x, place), gather(y, place), gather(z, place))
        dx = (weight * here[0]).sum() - self.path[k, 0] - share * self.path[k, 3]
        dy = (weight * here[1]).sum() - self.path[k, 1] - share * self.path[k, 4]
        dz = (weight * here[2]).sum() - self.path[k, 2] - share * self.path[k, 5]
        gap = ti.sqrt(dx * dx + dy * dy + dz * dz)
        allowed = self.path[k, ALLOWED] + share * self.path[k, ALLOWED + 1]
        if gap > allowed:
            pull = (gap - allowed) / gap
            f = pull * ti.Vector([self.row[k, SHARE + c] for c in ti.static(range(NODES))])
            scatter(x, place, here[0] - dx * f)
            scatter(y, place, here[1] - dy * f)
            scatter(z, place, here[2] - dz * f)
            scatter(u, place, gather(u, place) - dx * f)
            scatter(v, place, gather(v, place) - dy * f)
            scatter(w, place, gather(w, place) - dz * f)
        return gap > allowed + SLACK


@ti.func
def gather(field: Template, places):
    return ti.Vector([field[places[c]] for c in ti.static(range(NODES))])


@ti.func
def scatter(field: Template, places, values):
    for c in ti.static(range(NODES)):
        field[places[c]] = values[c]
