"""Contacts of points that are blends of key points."""

import numpy as np
import pytest
import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, Float, I32x1
from taichi_cloth.layers.blended import Blended
from taichi_cloth.layers.blends import Blends

KEY_POINTS, CORNERS = 4, 4


@ti.data_oriented
class Two:
    """Two edges whose ends are blends of the same four key points, elements 4 to 7, as beside a seam that folds."""

    def __init__(self) -> None:
        size = KEY_POINTS + CORNERS
        self.position, self.step = ([ti.field(ti.f32, size) for _ in range(3)] for _ in range(2))
        self.inverse_mass, self.blends, self.blended = ti.field(ti.f32, size), Blends(size, CORNERS), Blended(CORNERS)
        self.point = [ti.field(ti.i32, 1) for _ in range(4)]

    @ti.kernel
    def take(self, at: I32x1, starts: I32x1, nodes: I32x1, weights: F32x1):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.blends.take(self, CORNERS, at, starts, nodes, weights)
            self.blends.refresh(self)
            for corner in ti.static(range(4)):
                self.point[corner][0] = KEY_POINTS + corner

    @ti.kernel
    def part(self, s: Float, t: Float, x: Float, y: Float, z: Float, apart: Float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            weights = ti.Vector([1.0 - s, s, t - 1.0, -t])
            self.blended.part(self, self, 0, weights, ti.Vector([x, y, z]), apart)


def test_sides_of_the_same_key_points_are_parted_at_once() -> None:
    """By exactly what is asked for, though what moves one side moves the other; momentum stays, and what was moved
    shows in both sides. Σ w²/m of the two is 0.02 of the largest 1/m: to and fro would take dozens of turns."""
    rng = np.random.default_rng(4)
    two, masses = Two(), np.array([1.0, 2.0, 1.5, 0.5])
    x, v, n = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), np.array([0.6, 0.0, 0.8])
    blend = np.array([[0.4, 0.2, 0.2, 0.2], [0.2, 0.4, 0.2, 0.2], [0.2, 0.2, 0.4, 0.2], [0.2, 0.2, 0.3, 0.3]])
    for axis in range(3):
        for field, values in ((two.position, x), (two.step, v)):
            field[axis].from_numpy(np.concatenate([values[:, axis], np.zeros(CORNERS)]).astype(np.float32))
    two.inverse_mass.from_numpy(np.concatenate([1 / masses, np.zeros(CORNERS)]).astype(np.float32))
    at, starts = np.arange(4, 8, dtype=np.int32), np.arange(0, 20, 4, dtype=np.int32)
    with runtime.plain_code(routines=True):
        two.take(at, starts, np.tile(np.arange(4, dtype=np.int32), 4), blend.ravel().astype(np.float32))
    s, t = 0.3, 0.6
    weights = np.array([1 - s, s, t - 1, -t]) @ blend
    assert (weights**2 / masses).sum() < 0.1 * (1 / masses).max()
    apart = float(n @ (weights @ x)) + 0.01
    with runtime.plain_code(routines=True):
        two.part(s, t, *n.tolist(), apart)  # pyright: ignore[reportCallIssue]
    moved, faster = (np.stack([f.to_numpy() for f in field], axis=1) for field in (two.position, two.step))
    assert n @ (weights @ moved[:4]) == pytest.approx(apart, abs=1e-5)
    assert n @ (weights @ faster[:4]) == pytest.approx(max(n @ (weights @ v), 0.0), abs=1e-5)
    assert masses @ (moved[:4] - x) == pytest.approx(np.zeros(3), abs=1e-5)
    assert moved[4:] == pytest.approx(blend @ moved[:4], abs=1e-6)
