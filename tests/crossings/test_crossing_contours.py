"""Which way cloth that passes through cloth comes apart: closed cases, and sheets moved so until none does."""

import numpy as np
import pytest
from numpy.typing import NDArray

from taichi_cloth.crossings.contours import ways_apart
from taichi_cloth.crossings.crossings import find_crossings

SIDE = 17


def sheet() -> tuple[NDArray, NDArray]:
    """Points of a square of 2 × 2, and its triangles."""
    x, y = np.meshgrid(*(np.linspace(-1, 1, SIDE),) * 2)
    a = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    faces = np.stack([a, a + 1, a + SIDE + 1, a, a + SIDE + 1, a + SIDE], -1).reshape(-1, 3)
    return np.stack([x, y, 0.0 * x], -1).reshape(-1, 3), faces


def test_a_tip_that_has_come_through_goes_back() -> None:
    """A triangle whose tip is below another: both edges at the tip go up, the triangle that they meet down; what is
    beyond is told by the line alone, which is shorter further towards the tip."""
    points = np.array([[-1, 0.0, 1], [1, 0.0, 1], [0, 0.0, -1], [-5, -5, 0], [5, -5, 0], [0, 9, 0]], float)
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    found = find_crossings(points, faces)
    assert found.edges.tolist() == [[1, 2], [2, 0]]
    np.testing.assert_allclose(found.at, [[0.5, 0, 0], [-0.5, 0, 0]], atol=1e-12)
    nodes, shares, way = ways_apart(found, points, faces)
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", shares, points[nodes]), 0.0, atol=1e-12)  # both are there
    assert (way[:, 2] > 0.3).all()
    assert (np.linalg.norm(way, axis=1) <= 1).all()


def test_in_the_middle_of_a_straight_line_nothing_has_to_move() -> None:
    """Two sheets across each other: only edges at the ends of the line are led along it, inwards."""
    flat, faces = sheet()
    upright = flat[:, [0, 2, 1]] * 0.7 + [0.013, 0.03, 0.04]
    points = np.concatenate([flat, upright])
    faces = np.concatenate([faces, faces + len(flat)])
    nodes, shares, way = ways_apart(find_crossings(points, faces), points, faces)
    at = np.einsum("nk,nkc->nc", np.maximum(shares, 0), points[nodes])[:, 0]
    end = np.isclose(at, at.min()) | np.isclose(at, at.max())
    assert np.abs(way[~end]).max() < 1e-9
    assert (way[end, 0] * at[end] < -0.5).all()


@pytest.mark.parametrize("aside", [0.0, 0.6])
def test_a_dent_that_has_come_through_is_drawn_out(aside: float) -> None:
    """In the middle, where the line is closed, and nearer to the edge of the lower sheet."""
    flat, faces = sheet()
    dented = flat.copy()
    dented[:, 2] = 0.1 - 0.25 * np.exp(-8 * ((flat[:, 0] - 0.05 - aside) ** 2 + (flat[:, 1] - 0.03) ** 2))
    points, faces = np.concatenate([flat, dented]), np.concatenate([faces, faces + len(flat)])
    counts = []
    for _ in range(40):
        found = find_crossings(points, faces)
        counts.append(found.count)
        if not found.count:
            break
        nodes, shares, way = ways_apart(found, points, faces)
        push = 0.01 * (shares / (shares**2).sum(axis=1, keepdims=True))[:, :, None] * way[:, None]
        move = np.zeros_like(points)
        np.add.at(move, nodes.ravel(), push.reshape(-1, 3))
        points += move * np.minimum(1.0, 0.01 / np.maximum(np.linalg.norm(move, axis=1, keepdims=True), 1e-30))
    assert counts[0] > 40
    assert counts[-1] == 0
