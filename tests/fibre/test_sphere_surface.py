"""Points on the surface of sphere sets, against the areas of spheres and caps."""

from math import pi

import numpy as np
import pytest

from taichi_cloth.fibre.contours import contour, known_contours
from taichi_cloth.fibre.sphere_set import in_union, sphere_set_from_rows
from taichi_cloth.fibre.sphere_surface import sphere_surface_points
from taichi_cloth.ground.errors import InputError

UM = 1e-6
PAIR = sphere_set_from_rows([[0, 0, 0, 10], [8, 0, 0, 6]])


@pytest.mark.parametrize("kind", known_contours())
def test_surface_points_lie_on_the_union_evenly(kind: str) -> None:
    spheres = contour(kind, length_m=60 * UM)
    got = sphere_surface_points(spheres, 5000, seed=1)
    assert len(got.positions) == pytest.approx(5000, rel=0.1)
    on = np.linalg.norm(got.positions - spheres.centres[got.sphere], axis=1)
    np.testing.assert_allclose(on, spheres.radii[got.sphere], rtol=1e-9)
    assert in_union(spheres, got.positions, margin_m=1e-4 * UM).all()
    assert not in_union(spheres, got.positions + 1e-4 * UM * got.normals, margin_m=-1e-12).all()
    assert not in_union(spheres, got.positions, margin_m=-1e-4 * UM).any()
    np.testing.assert_array_equal(got.positions, sphere_surface_points(spheres, 5000, seed=1).positions)


def test_surface_points_of_two_spheres_share_the_visible_area() -> None:
    got = sphere_surface_points(PAIR, 40_000)
    cap = [2 * pi * 10 * (10 + (100 + 64 - 36) / 16), 2 * pi * 6 * (6 + (36 + 64 - 100) / 16)]
    counts = np.bincount(got.sphere)
    assert counts[0] / counts.sum() == pytest.approx(cap[0] / sum(cap), rel=0.01)
    assert got.area_m2 == pytest.approx(sum(cap) * UM**2, rel=0.01)


def test_a_number_of_points_that_is_not_allowed_is_refused() -> None:
    with pytest.raises(InputError, match="surface_points: 0"):
        sphere_surface_points(PAIR, 0)
