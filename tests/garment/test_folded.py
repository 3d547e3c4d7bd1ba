"""A full circle falls in folds that are as long as its cloth, round and down; tiers begin where the one above ends."""

from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.garment.fit.fitted import fitted
from taichi_cloth.garment.fit.taped import landmarks_of
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.folded import Folded, halved
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body

PATTERNS = Path(__file__).parents[1] / "data" / "patterns" / "unseen"


def half(angle: float, inner: float, **more) -> Folded:
    """Half a skirt round a circle that is as long as both arcs."""
    waist = inner * angle / np.pi
    return Folded(np.zeros(3), np.array([0.0, 0, 1]), (waist, waist), inner, angle, folds=16, **more)


def arc(place: Folded, down: float) -> np.ndarray:
    t = np.linspace(-place.angle / 2, place.angle / 2, 2001)
    r = place.inner + down
    return np.stack([r * np.sin(t), place.inner - r * np.cos(t)], -1)


@pytest.mark.parametrize("angle", [1.2, np.pi, 5.4])
def test_folds_are_as_long_as_the_cloth(angle):
    """Half a quarter, a half and nearly a whole circle before, and as much behind; a cone has a third too little of a
    half."""
    place = half(angle, 0.4 / angle)
    for down in (0.05, 0.2, 0.5):
        line = arc(place, down)
        assert length(place.points(line)) == pytest.approx(length(line), rel=0.06)
    for turn in np.linspace(-0.45, 0.45, 7) * angle:
        r = place.inner + np.linspace(0.1, 0.5, 41)
        line = np.stack([r * np.sin(turn), place.inner - r * np.cos(turn)], -1)
        assert length(place.points(line)) == pytest.approx(0.4, rel=0.03)


def test_both_halves_meet_at_their_sides():
    front = half(np.pi, 0.13)
    back = half(np.pi, 0.13)
    object.__setattr__(back, "outward", np.array([0.0, 0, -1]))
    side = np.stack([np.linspace(0.13, 0.6, 20), np.full(20, 0.13)], -1)
    np.testing.assert_allclose(front.points(side), back.points(side * [-1, 1]), atol=1e-9)


def test_a_tier_begins_where_the_one_above_ends():
    """Both sides of the seam between them lie within what gathers take; files have tiers side by side."""
    worn = landmarks_of(prepare_body(BodySection()))
    pattern = fitted(read_garmentcode(next(PATTERNS.glob("900126_*.json"))), worn)
    tiers = {p.name: p.place for p in pattern.panels if isinstance(p.place, Folded)}
    assert len(tiers) == 8
    apart = []
    for seam in pattern.seams:
        sides = seam.first, seam.second
        if {side.panel for side in sides} <= set(tiers):
            pairs = zip(sides, pattern.pairs(seam, 40), strict=True)
            one, other = (tiers[side.panel].points(at) for side, at in pairs)
            apart.append(np.linalg.norm(one - other, axis=1).max())
    assert len(apart) == 14
    assert max(apart) < 0.06
    assert np.median(apart) < 0.03
    for name, place in tiers.items():
        highest = place.hanging(pattern.panel(name).outline).max()
        assert highest == pytest.approx(place.origin[1] - place.begins, abs=2e-3)


def nearly_whole(jointed: bool) -> Pattern:
    """Two sectors of 340° sewn to each other at their sides, before and behind, and a band on the first."""
    angle, inner, outer = np.radians(340.0), 0.08, 0.4
    turn = np.linspace(-angle / 2, angle / 2, 171)
    ring = [np.stack([r * np.sin(turn), inner - r * np.cos(turn)], -1) for r in (inner, outer)]
    hem, top = ring[1], ring[0][::-1]
    tops = [top[:86], top[85:]] if jointed else [top]
    edges = (*tops, np.stack([top[-1], hem[0]]), hem, np.stack([hem[-1], top[0]]))
    place = half(angle, inner)
    band = length(top)
    corner = np.array([[0, 0], [band, 0], [band, 0.05], [0, 0.05], [0, 0]])
    n = len(tops)
    seams = [
        Seam(Side("one", n), Side("two", n + 2), alike=False),
        Seam(Side("one", n + 2), Side("two", n), alike=False),
    ]
    seams += [] if jointed else [Seam(Side("one", 0), Side("band", 0), alike=False)]
    bands = Panel("band", tuple(corner[k : k + 2] for k in range(4)), Flat(np.eye(3), np.zeros(3)), marks=((2, "top"),))
    panels = (Panel("one", edges, place, hems=(n + 1,)), Panel("two", edges, place), bands)
    return Pattern("ring", panels, tuple(seams))


@pytest.mark.parametrize("jointed", [True, False])
def test_a_sector_that_is_nearly_a_ring_is_cut_in_two(jointed):
    """Along its middle, with all seams as long as they were; what its arc is sewn to is cut where the arc is."""
    before = nearly_whole(jointed)
    after = halved(before)
    names = [panel.name for panel in after.panels]
    assert names == ["one", "one_half", "two", "two_half", "band"]
    for name in ("one", "two"):
        halves = [after.panel(name).area, after.panel(f"{name}_half").area]
        assert sum(halves) == pytest.approx(before.panel(name).area, rel=1e-3)
        assert halves[0] == pytest.approx(halves[1], rel=1e-2)
    assert len(after.seams) == len(before.seams) + (2 if jointed else 3)
    for seam in after.seams:
        assert length(after.edge(seam.first)) == pytest.approx(length(after.edge(seam.second)), rel=1e-2)
        one, other = (after.panel(side.panel).place.points(at) for side, at in
                      zip((seam.first, seam.second), after.pairs(seam, 9), strict=True))  # fmt: skip
        if seam.first.panel[:3] == seam.second.panel[:3]:
            np.testing.assert_allclose(one, other, atol=1e-6)
    assert [len(after.panel(name).hems) for name in names] == [1, 1, 0, 0, 0]
    band = after.panel("band")
    assert len(band.edges) == (4 if jointed else 5)
    assert dict(band.marks) == {2 if jointed else 3: "top"}


def test_half_a_circle_stays_in_one_piece():
    worn = landmarks_of(prepare_body(BodySection()))
    pattern = fitted(read_garmentcode(next(PATTERNS.glob("900126_*.json"))), worn)
    assert halved(pattern) is pattern


def test_frills_of_both_legs_start_apart():
    """As long as they are drawn, each round its own leg: flat ones, wider than from leg to leg, began in one plane."""
    worn = landmarks_of(prepare_body(BodySection()))
    pattern = fitted(read_garmentcode(next(PATTERNS.glob("900165_*.json"))), worn)
    frills = [panel for panel in pattern.panels if "cuff_skirt" in panel.name]
    assert len(frills) == 4
    for panel in frills:
        sign = 1.0 if panel.label == "leg_l" else -1.0
        line = np.concatenate([along(edge, np.linspace(0, 1, 200)) for edge in panel.edges])
        placed = panel.place.points(line)
        assert np.ptp(line[:, 0]) > 2 * worn.leg[0, 0]
        assert (sign * placed[:, 0]).min() > 0.004
        assert length(placed) == pytest.approx(length(line), rel=2e-3)
        assert np.sign(placed[:, 2].mean()) == (1.0 if panel.name.endswith("_f") else -1.0)
