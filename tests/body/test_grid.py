"""Distance grids of a closed mesh, made for its parts on one lattice."""

import numpy as np
import pytest
import trimesh

from taichi_cloth.body.colliders.grid import part_grids
from taichi_cloth.ground.errors import InputError

BALL = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
RIGHT = (BALL.triangles_center[:, 0] > 0).astype(int)


def test_the_grids_of_two_halves_of_a_ball_know_its_distance() -> None:
    """Nodes 10 mm apart, points from 20 mm within to 25 mm without. Exact: |x| − r. Trilinear values are off by up to
    s²/8 · 2/|x|, 0.26 mm at 98 mm, and the mesh, inscribed, by 0.12 mm; a node more than a spacing away may not have
    found its nearest triangle, of which the longest edge is 8 mm."""
    grids = part_grids(BALL.vertices, BALL.faces, RIGHT, [("left", 0), ("right", 3)], spacing=0.01)
    assert [(g.part, g.bone) for g in grids] == [("left", 0), ("right", 3)]
    rng = np.random.default_rng(2)
    way = rng.normal(size=(4000, 3))
    far = rng.uniform(0.08, 0.125, 4000)
    points = way / np.linalg.norm(way, axis=1, keepdims=True) * far[:, None]
    off = np.min([g.at(points)[0] for g in grids], axis=0) - (far - 0.1)
    near = np.abs(far - 0.1) < 0.002
    assert np.abs(off[near]).max() < 4.5e-4
    assert np.abs(off).max() < 2e-3


def test_each_half_answers_on_its_own_side_only() -> None:
    left, right = part_grids(BALL.vertices, BALL.faces, RIGHT, [("left", 0), ("right", 0)], spacing=0.01)
    inside_right = np.array([[0.085, 0.0, 0.0]])
    assert right.at(inside_right)[0] == pytest.approx([-0.015], abs=5e-4)
    assert left.at(inside_right)[0] > 0


def test_parts_without_faces_and_too_many_nodes_are_refused() -> None:
    parts = [("left", 0), ("right", 0)]
    with pytest.raises(InputError, match="one or more in each"):
        part_grids(BALL.vertices, BALL.faces, np.zeros(len(BALL.faces), int), parts, spacing=0.01)
    with pytest.raises(InputError, match="larger spacing"):
        part_grids(BALL.vertices, BALL.faces, RIGHT, parts, spacing=0.001)
