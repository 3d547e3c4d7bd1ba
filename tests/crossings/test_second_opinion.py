"""The exact test against another's, where that is installed: `pip install ".[test]"`."""

import numpy as np
import pytest
from numpy.typing import NDArray

from taichi_cloth.crossings.crossings import find_crossings

ipctk = pytest.importorskip("ipctk", reason="the IPC Toolkit is not installed")


def grid(rows: int, cols: int) -> NDArray:
    """Triangles of a sheet, two a cell."""
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    return np.concatenate([np.stack([a, a + 1, a + cols + 1], -1), np.stack([a, a + cols + 1, a + cols], -1)])


def meets(points: NDArray, faces: NDArray) -> bool:
    """Whether the IPC Toolkit finds an edge that passes through a face."""
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    mesh = ipctk.CollisionMesh(points, edges.astype(np.int32), faces.astype(np.int32))
    return bool(ipctk.has_intersections(mesh, points))


def test_crumpled_sheets() -> None:
    """100 sheets rolled up more or less, and crumpled: some just meet, some just do not."""
    rng, faces, answers = np.random.default_rng(7), grid(7, 12), []
    for _ in range(100):
        turn = np.linspace(0, 1, 11) * rng.uniform(0, 9)
        x, z = (np.concatenate([[0.0], np.cumsum(f(turn))]) for f in (np.cos, np.sin))
        sheet = np.zeros((7, 12, 3))
        sheet[..., 0], sheet[..., 1], sheet[..., 2] = x, np.arange(7)[:, None], z
        points = (sheet + rng.uniform(0, 0.3) * rng.normal(size=sheet.shape)).reshape(-1, 3)
        answers.append((find_crossings(points, faces).count > 0, meets(points, faces)))
    ours, theirs = np.array(answers).T
    np.testing.assert_array_equal(ours, theirs)
    assert 20 < ours.sum() < 80


def test_triangles_at_random() -> None:
    """250 pairs of triangles without a common corner."""
    rng, faces = np.random.default_rng(3), np.array([[0, 1, 2], [3, 4, 5]])
    points = rng.normal(size=(250, 6, 3))
    ours = [find_crossings(p, faces).count > 0 for p in points]
    np.testing.assert_array_equal(ours, [meets(p, faces) for p in points])
    assert 25 < sum(ours) < 225
