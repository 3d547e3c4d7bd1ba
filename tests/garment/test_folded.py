"""A full circle falls in folds that are as long as its cloth, round and down; tiers begin where the one above ends."""

from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.garment.fit.fitted import fitted
from taichi_cloth.garment.fit.taped import landmarks_of
from taichi_cloth.garment.pattern.curves import length
from taichi_cloth.garment.pattern.folded import Folded
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
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
