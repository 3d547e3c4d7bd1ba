"""Contours: sections of the known fibres against what the textile books say."""

from math import pi

import numpy as np
import pytest

from taichi_cloth.fibre.contours import FIBRES, contour, known_contours
from taichi_cloth.fibre.sphere_set import in_union
from taichi_cloth.ground.errors import InputError

UM = 1e-6


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


def test_bad_requests_are_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r'unknown fibre "coton".*did you mean "cotton"'):
        contour("coton")
    with pytest.raises(InputError, match=r"fibre\.length_m"):
        contour("silk", length_m=-1.0)
    with pytest.raises(InputError, match="the limit is 100000"):
        contour("wool", length_m=0.02)
    with pytest.raises(InputError, match=r"fibre\.width_m"):
        contour("silk", width_m=1.0)
