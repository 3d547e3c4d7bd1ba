"""Fibres: spheres to particles against analytic volumes."""

from math import pi

import numpy as np
import pytest

from taichi_cloth.fibre.contours import contour, known_contours
from taichi_cloth.fibre.fibre import lattice_point_count, particles_in
from taichi_cloth.fibre.sphere_set import SphereSet, in_union, sphere_set_from_rows
from taichi_cloth.ground.errors import InputError

UM = 1e-6
BALL = SphereSet(np.zeros((1, 3)), np.array([10 * UM]))

PAIR = sphere_set_from_rows([[0, 0, 0, 10], [8, 0, 0, 6]])


def test_lattice_volume_tends_to_the_spheres() -> None:
    spacings = 10 * UM / np.array([4, 6.3, 10, 16.2, 25, 40])
    volumes = [len(particles_in(BALL, spacing_m=h).positions) * h**3 for h in spacings]
    errors = np.abs(np.array(volumes) / (4 / 3 * pi * (10 * UM) ** 3) - 1)
    order = np.polyfit(np.log(spacings), np.log(errors + 1e-6), 1)[0]
    assert order > 1.0
    assert errors[-1] < 1e-3


def test_volume_of_two_overlapping_spheres() -> None:
    r1, r2, d = 10.0, 6.0, 8.0
    lens = pi * (r1 + r2 - d) ** 2 * (d * d + 2 * d * (r1 + r2) - 3 * (r1 - r2) ** 2) / (12 * d)
    expected = 4 / 3 * pi * (r1**3 + r2**3) - lens
    found = len(particles_in(PAIR, spacing_m=0.25 * UM).positions) * 0.25**3
    assert found == pytest.approx(expected, rel=2e-3)


def test_exactly_the_lattice_points_inside_any_sphere_are_kept() -> None:
    """By hand: three spheres of different size on a 2 um lattice, every point tested against every sphere."""
    spheres = sphere_set_from_rows([[0, 0, 0, 5], [7, 2, -1, 3.1], [3, -6, 2, 1.2]])
    got = particles_in(spheres, spacing_m=1.3 * UM, jitter=0.0)
    low, high = spheres.bounding_box()
    numbers = np.ceil((high - low) / (1.3 * UM)).astype(int)
    axes = [0.5 * (low[k] + high[k]) + (np.arange(numbers[k]) - 0.5 * (numbers[k] - 1)) * 1.3 * UM for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    gaps = np.linalg.norm(points[:, None] - spheres.centres[None], axis=2) - spheres.radii
    kept = (gaps <= 0).any(axis=1)
    assert lattice_point_count(spheres, spacing_m=1.3 * UM) == len(points)
    np.testing.assert_allclose(got.positions, points[kept], atol=1e-6 * UM)
    np.testing.assert_array_equal(in_union(spheres, points), kept)


@pytest.mark.parametrize("kind", known_contours())
def test_perturbation_is_bounded_seeded_and_changes_nothing_else(kind: str) -> None:
    spheres, h = contour(kind, length_m=60 * UM), 0.8 * UM
    still = particles_in(spheres, spacing_m=h, jitter=0)
    moved = particles_in(spheres, spacing_m=h, jitter=0.4, seed=3)
    again = particles_in(spheres, spacing_m=h, jitter=0.4, seed=3)
    other = particles_in(spheres, spacing_m=h, jitter=0.4, seed=4)
    assert moved.positions.tobytes() == again.positions.tobytes()
    assert still.positions.shape == moved.positions.shape == other.positions.shape
    assert not np.array_equal(moved.positions, other.positions)
    for particles in (moved, other):
        shift = (particles.positions.astype(np.float64) - still.positions) / h
        assert np.abs(shift).max() <= 0.4 * (1 + 1e-4)
        assert np.abs(shift.mean(axis=0)).max() < 5 * 0.4 / np.sqrt(3 * len(shift))
        assert shift.std() == pytest.approx(0.4 / np.sqrt(3), rel=0.03)
    assert in_union(spheres, still.positions.astype(np.float64), margin_m=1e-5 * UM).all()
    assert in_union(spheres, moved.positions.astype(np.float64), margin_m=0.4 * np.sqrt(3) * h).all()


def test_jitter_of_a_lattice_point_does_not_depend_on_the_others() -> None:
    """A second sphere inside the same box adds particles and leaves the old ones where they were."""
    ends = [[0, 0, 0, 5], [30, 0, 0, 5]]
    few = particles_in(sphere_set_from_rows(ends), spacing_m=UM, seed=9).positions
    more = particles_in(sphere_set_from_rows([*ends, [15, 0, 0, 4]]), spacing_m=UM, seed=9).positions
    assert len(more) > len(few)
    assert {row.tobytes() for row in few} <= {row.tobytes() for row in more}


def test_particles_can_be_kept_inside() -> None:
    spheres = contour("viscose", length_m=40 * UM)
    paper = particles_in(spheres, spacing_m=0.8 * UM, jitter=0.8)
    held = particles_in(spheres, spacing_m=0.8 * UM, jitter=0.8, keep_inside=True)
    assert not in_union(spheres, paper.positions.astype(np.float64)).all()
    assert in_union(spheres, held.positions.astype(np.float64), margin_m=1e-5 * UM).all()
    assert len(paper.positions) == len(held.positions)


def test_normals_depths_and_tangents_of_a_ball() -> None:
    got = particles_in(BALL, spacing_m=0.5 * UM, jitter=0.3)
    distance = np.linalg.norm(got.positions, axis=1)
    shell = distance > 5 * UM
    straight = got.positions[shell] / distance[shell, None]
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", straight, got.normals[shell]), -1, 1)))
    assert angle.mean() < 3
    assert angle.max() < 15
    assert np.abs(got.depths - np.maximum(10 * UM - distance, 0)).max() < 0.75 * 0.5 * UM * 2
    assert np.abs(got.depths - np.maximum(10 * UM - distance, 0)).mean() < 0.5 * 0.5 * UM
    np.testing.assert_allclose(np.linalg.norm(got.normals, axis=1), 1, atol=1e-5)
    np.testing.assert_array_equal(got.tangents, np.tile([1.0, 0.0, 0.0], (len(distance), 1)))
    assert got.radius_m == pytest.approx(0.4 * UM)


def test_cotton_tangents_follow_the_convolutions() -> None:
    got = particles_in(contour("cotton"), spacing_m=UM, jitter=0)
    lean = np.degrees(np.arccos(got.tangents[:, 0]))
    np.testing.assert_allclose(np.linalg.norm(got.tangents, axis=1), 1, atol=1e-5)
    assert 5 < lean.max() < 40  # convolution angles of cotton at the rim
    twist = got.positions[:, 1] * got.tangents[:, 2] - got.positions[:, 2] * got.tangents[:, 1]
    outer = lean > 3
    assert (twist[outer] > 0).any()
    assert (twist[outer] < 0).any()  # the sense reverses within the piece


def test_bad_requests_are_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"fibre\.jitter"):
        particles_in(BALL, spacing_m=UM, jitter=1.5)
    with pytest.raises(InputError, match=r"fibre\.spacing_um: 0 "):
        particles_in(BALL, spacing_m=0.0)


def test_a_lattice_too_large_is_refused_with_the_spacing_that_would_do() -> None:
    with pytest.raises(InputError, match=r"8e\+15 lattice points, the limit is 5e\+07; (\S+) µm or more") as caught:
        particles_in(BALL, spacing_m=1e-10)
    enough = 1e-6 * float(str(caught.value).split("; ")[1].split(" µm")[0])
    assert 4e7 < lattice_point_count(BALL, spacing_m=enough) <= 5e7
