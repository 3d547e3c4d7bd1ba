"""Fibres: spheres to particles against analytic volumes, and sections against what the textile books say."""

from math import pi
from time import perf_counter

import numpy as np
import pytest

from taichi_cloth.errors import InputError
from taichi_cloth.fibre import (
    FIBRES,
    SphereSet,
    contour,
    in_union,
    known_contours,
    lattice_point_count,
    particles_in,
    sphere_set_from_rows,
    sphere_surface_points,
)

UM = 1e-6
BALL = SphereSet(np.zeros((1, 3)), np.array([10 * UM]))
PAIR = sphere_set_from_rows([[0, 0, 0, 10], [8, 0, 0, 6]])


def section(kind: str, x_um: float = 120.0, step_um: float = 0.1) -> np.ndarray:
    """Cross-section at x: y + iz of the points of a fine grid [um] that lie in the fibre."""
    grid = np.arange(-14, 14, step_um)
    y, z = (part.ravel() for part in np.meshgrid(grid, grid, indexing="ij"))
    points = np.stack([np.full_like(y, x_um), y, z], axis=1) * UM
    return (y + 1j * z)[in_union(contour(kind), points)]


def outline(inside: np.ndarray, count: int = 180) -> np.ndarray:
    """Farthest distance from the centroid in each of `count` directions."""
    from_centre = inside - inside.mean()
    bins = np.floor((np.angle(from_centre) / (2 * pi) + 1) * count).astype(int) % count
    reach = np.zeros(count)
    np.maximum.at(reach, bins, np.abs(from_centre))
    return reach


def widths(inside: np.ndarray) -> tuple[float, float]:
    """Least and greatest breadth of a section over all directions [um]."""
    breadths = [float(np.ptp((inside * np.exp(1j * a)).real)) for a in np.linspace(0, pi, 90, endpoint=False)]
    return min(breadths), max(breadths)


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


@pytest.mark.parametrize("kind", known_contours())
def test_section_has_the_area_of_its_fineness_and_its_width(kind: str) -> None:
    """Area = dtex / density, within 12 %; the widest way across within 8 % of the stated width."""
    inside = section(kind)
    assert len(inside) * 0.01 == pytest.approx(FIBRES[kind].section_um2, rel=0.12)
    assert widths(inside)[1] == pytest.approx(FIBRES[kind].width_um, rel=0.08)
    low, high = contour(kind).bounding_box()
    assert (low[0], high[0]) == pytest.approx((0, 240 * UM), abs=1e-12)


def test_cotton_is_a_flat_bean_that_turns_and_reverses() -> None:
    inside = section("cotton")
    thin, wide = widths(inside)
    assert 1.5 < wide / thin < 2.5
    turned = [section("cotton", float(x), 0.25) for x in np.arange(5, 236, 5)]
    axes = np.unwrap([np.angle(np.mean((s - s.mean()) ** 2)) for s in turned]) / 2  # direction of the flat side
    turns = np.diff(axes)
    assert turns.max() > 0.05
    assert turns.min() < -0.05
    assert np.ptp(axes) > pi / 2


def test_silk_has_threefold_symmetry() -> None:
    inside = section("silk")
    reach = outline(inside)
    parts = np.abs(np.fft.rfft(reach)) / len(reach)
    assert np.argmax(parts[1:8]) + 1 == 3
    assert parts[3] > 4 * max(parts[1], parts[2], parts[4], parts[5])
    assert 1.15 < reach.max() / reach.min() < 1.9


def test_viscose_has_its_lobes() -> None:
    reach = np.convolve(np.tile(outline(section("viscose")), 3), np.hanning(7) / np.hanning(7).sum(), "same")
    middle = reach[180:360]
    peaks = (middle > reach[179:359]) & (middle >= reach[181:361])
    assert 6 <= peaks.sum() <= 9
    thin, wide = widths(section("viscose"))
    assert wide / thin < 1.4


@pytest.mark.parametrize(("kind", "within"), [("polyester", 0.02), ("wool", 0.12)])
def test_round_fibres_are_round(kind: str, within: float) -> None:
    thin, wide = widths(section(kind))
    assert wide / thin < 1 + within


def test_wool_scales_step_down_toward_the_tip() -> None:
    """Along the surface the radius climbs slowly and drops at once, by 0.5 to 1 um, every 9 to 16 um."""
    x = np.arange(20, 220, 0.25)
    r = np.arange(8.5, 11.5, 0.05)
    gx, gr = np.meshgrid(x, r, indexing="ij")
    points = np.stack([gx.ravel(), gr.ravel(), np.zeros(gx.size)], axis=1) * UM
    top = (in_union(contour("wool"), points).reshape(gx.shape) * gr).max(axis=1)
    fall = top[:-8] - top[8:]  # over 2 um
    edges = (fall > 0.45) & (fall >= np.maximum(np.roll(fall, 1), np.roll(fall, -1)))
    places = x[:-8][edges]
    places = places[np.concatenate([[True], np.diff(places) > 4])]
    assert 10 < len(places) < 22
    assert 9 < np.diff(places).mean() < 16
    assert 0.45 < np.median(fall[edges]) < 1.1
    assert (top[8:] - top[:-8]).max() < 0.45  # no edge faces the root


def test_width_scales_the_section() -> None:
    low, high = contour("silk", width_m=2 * FIBRES["silk"].width_um * UM).bounding_box()
    usual_low, usual_high = contour("silk").bounding_box()
    np.testing.assert_allclose((high - low)[1:], 2 * (usual_high - usual_low)[1:], rtol=1e-4)


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


def test_a_million_lattice_points_take_well_under_a_second() -> None:
    spheres = contour("cotton", length_m=240 * UM)
    spacing = 0.43 * UM
    assert 0.9e6 < lattice_point_count(spheres, spacing_m=spacing) < 1.2e6
    begin = perf_counter()
    particles_in(spheres, spacing_m=spacing)
    assert perf_counter() - begin < 3  # 0.4 s when alone on the machine


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([], "0 spheres"),
        ([[0, 0, 0, 1], [0, 0, 1]], "row 2 is"),
        ([[0, 0, 0, -1]], "row 1 is"),
        ([[0, 0, 0, float("nan")]], "row 1 is"),
        ([[0, 0, "wide", 1]], "row 1 is"),
        (["1234"], "row 1 is"),
        ([7], "row 1 is"),
        ("spheres", "not a list of rows"),
        ([[0, 0, 0, 1]] * 100_001, "100001 rows"),
    ],
)
def test_a_users_bad_rows_are_named(rows: list, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        sphere_set_from_rows(rows)
    assert "\n" not in str(caught.value)


def test_bad_requests_are_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r'unknown fibre "coton".*did you mean "cotton"'):
        contour("coton")
    with pytest.raises(InputError, match=r"fibre\.length_m"):
        contour("silk", length_m=-1.0)
    with pytest.raises(InputError, match="the limit is 100000"):
        contour("wool", length_m=0.02)
    with pytest.raises(InputError, match=r"fibre\.width_m"):
        contour("silk", width_m=1.0)
    with pytest.raises(InputError, match=r"fibre\.jitter"):
        particles_in(BALL, spacing_m=UM, jitter=1.5)
    with pytest.raises(InputError, match=r"fibre\.spacing_m: 0 "):
        particles_in(BALL, spacing_m=0.0)
    with pytest.raises(InputError, match="surface_points: 0"):
        sphere_surface_points(BALL, 0)
    with pytest.raises(InputError, match=r"must be \(n, 3\)"):
        SphereSet(np.zeros((2, 2)), np.ones(2))


def test_a_lattice_too_large_is_refused_with_the_spacing_that_would_do() -> None:
    with pytest.raises(InputError, match=r"8e\+15 lattice points, the limit is 5e\+07; (\S+) m or more") as caught:
        particles_in(BALL, spacing_m=1e-10)
    enough = float(str(caught.value).split("; ")[1].split(" m")[0])
    assert 4e7 < lattice_point_count(BALL, spacing_m=enough) <= 5e7
