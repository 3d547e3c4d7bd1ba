"""Ties: points of the cloth held together, or held to a moving place, by correcting positions after each substep.

A tie is a blend of up to eight key points, d = Σ w x (− target): the gap between two points embedded in the cloth, or
between one and its place. A gap wider than allowed is closed along d, shared out by w/m:

    Δx_k = −w_k/m_k · λ,      λ = (1 − allowed/|d|) d / Σ w_k²/m_k,

which keeps the momentum of what is tied together. Ties are worked through in order, each seeing what the ones before
did (Gauss–Seidel). What is allowed shrinks from frame to frame, so panels are drawn together at a set speed.
"""

# pyright: reportOptionalCall=false, reportOperatorIssue=false, reportGeneralTypeIssues=false

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.arrays import Template
from taichi_cloth.errors import InputError
from taichi_cloth.forces import FrameForces
from taichi_cloth.sheet import PAD, Sheet, SheetState
from taichi_cloth.solvers.passes import Pass

__all__ = ["Ties"]

F64 = NDArray[np.float64]
NODES = 8


@ti.data_oriented
class Ties(Pass):
    """nodes: int (n, m ≤ 8, 2) rows and columns of key points. weights: (n, m); those of a tie sum to 0, or to 1 where
    it has a place. substeps: of a frame. frame_time: [s]. speed: at which gaps are closed [m/s].
    places: (n, 3) [m] for a tie to a fixed place, NaN for one between two points; None: all of the latter.

    Raises InputError on shapes that differ or a tie without key points.
    """

    local = False

    def __init__(
        self,
        sheet: Sheet,
        nodes: NDArray[np.int64],
        weights: F64,
        *,
        substeps: int,
        frame_time: float,
        speed: float = 0.5,
        places: F64 | None = None,
    ) -> None:
        n, m = weights.shape
        if nodes.shape != (n, m, 2) or m > NODES or n == 0:
            raise InputError(
                f"ties: nodes {nodes.shape}, weights {weights.shape}; allowed: (n, m, 2) and (n, m), m ≤ 8"
            )
        self.count, self.substeps, self.reach = n, substeps, speed * frame_time
        self.index = np.zeros((n, NODES), np.int32)
        self.weight = np.zeros((n, NODES), np.float32)
        self.index[:, :m] = (nodes[..., 0] + PAD) * sheet.width + nodes[..., 1]
        self.index[:, m:] = self.index[:, :1]
        self.weight[:, :m] = weights
        self.places = np.full((n, 3), np.nan) if places is None else np.asarray(places, np.float64)
        self.held = np.isfinite(self.places).all(axis=1)
        self._nodes = ti.field(ti.i32, (n, NODES))
        self._weights = ti.field(ti.f32, (n, NODES))
        self._target = ti.field(ti.f32, (n, 6))  # at the start of the frame, and how far it moves in it
        self._allowed = ti.field(ti.f32, (n, 2))  # at both ends of the frame
        self._nodes.from_numpy(self.index)
        self._weights.from_numpy(self.weight)

    def targets(self, forces: FrameForces) -> tuple[F64, F64]:
        """Places (n, 3) [m] at the start and the end of a frame; 0 for ties between two points."""
        fixed = np.where(self.held[:, None], self.places, 0.0)
        return fixed, fixed

    def gaps(self, state: SheetState, target: F64 | None = None) -> F64:
        """Width of each gap (n,) [m]."""
        flat = state.values[:3].reshape(3, -1)
        place = np.where(self.held[:, None], self.places, 0.0) if target is None else target
        return np.linalg.norm(
            np.einsum("cnk,nk->nc", flat[:, self.index], self.weight.astype(np.float64)) - place, axis=1
        )

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        start, end = self.targets(forces)
        now = self.gaps(state, start)
        self._target.from_numpy(np.concatenate([start, end - start], axis=1).astype(np.float32))
        self._allowed.from_numpy(np.stack([now, np.maximum(now - self.reach, 0.0)], axis=1).astype(np.float32))

    @ti.func
    def after(self, work: Template, at: Template, first, last, shift, done, n: Template):
        x, y, z = ti.static(*work.position[at])
        u, v, w = ti.static(*work.step[at])
        share = ti.cast(done + 1, ti.f32) / self.substeps
        for k in range(self.count):
            dx = -self._target[k, 0] - share * self._target[k, 3]
            dy = -self._target[k, 1] - share * self._target[k, 4]
            dz = -self._target[k, 2] - share * self._target[k, 5]
            compliance = 0.0
            for c in range(NODES):
                p, a = self._nodes[k, c], self._weights[k, c]
                dx += a * x[p]
                dy += a * y[p]
                dz += a * z[p]
                compliance += a * a * work.inverse_mass[p]
            gap = ti.sqrt(dx * dx + dy * dy + dz * dz)
            allowed = self._allowed[k, 0] + share * (self._allowed[k, 1] - self._allowed[k, 0])
            if gap > allowed and compliance > 0.0:
                pull = (gap - allowed) / (gap * compliance)
                for c in range(NODES):
                    p = self._nodes[k, c]
                    f = -pull * self._weights[k, c] * work.inverse_mass[p]
                    x[p] += f * dx
                    y[p] += f * dy
                    z[p] += f * dz
                    u[p] += f * dx
                    v[p] += f * dy
                    w[p] += f * dz
