"""Heights at which cloth is worn: flat where there are no darts, lower over one at the side, by its width."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.garment.fit import widen
from taichi_cloth.garment.fit.fitted import fitted, placed
from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.levels import worn_levels
from taichi_cloth.garment.fit.piece import Work, pieces_of
from taichi_cloth.garment.fit.taped import landmarks_of
from taichi_cloth.garment.fit.widen import widths
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
from taichi_cloth.garment.pattern.pattern import Course, Flat, Panel, Pattern, Seam, Side
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body

UNSEEN = Path(__file__).parents[1] / "data" / "patterns" / "unseen"


@cache
def woman() -> Landmarks:
    return landmarks_of(prepare_body(BodySection()))


def bodice(mouth: float) -> Work:
    """A front 30 cm wide with a dart in its left side, and a back lower by the dart's width, sewn there."""
    low, high = 0.2 - mouth / 2, 0.2 + mouth / 2
    corner = np.array([[0, 0], [0.3, 0], [0.3, low], [0.15, 0.2], [0.3, high], [0.3, 0.4], [0.0, 0.4], [0.0, 0.0]])
    front = Panel("front", tuple(corner[k : k + 2] for k in range(7)), Flat(np.eye(3), np.zeros(3)))
    tall = 0.4 - mouth
    corner = np.array([[0, 0], [0.3, 0], [0.3, tall], [0.0, tall], [0.0, low], [0, 0.0]])
    back = Panel(
        "back", tuple(corner[k : k + 2] for k in range(5)), Flat(np.diag([-1.0, 1, -1]), np.array([0.6, 0, 0]))
    )
    seams = (
        Seam(Side("front", 2), Side("front", 3), alike=False),
        Seam(Side("front", 1), Side("back", 4), alike=False),
        Seam(Side("front", 4), Side("back", 3), alike=False),
    )
    work = pieces_of(Pattern("bodice", (front, back), seams))
    for piece in work.pieces.values():
        piece.graded, piece.shift, piece.part = piece.edges, piece.at, "trunk"
    return work


def test_a_closed_dart_lowers_what_lies_over_it_at_the_side():
    """By its width at the seam, and not at the other side, where the cloth goes on over its tip."""
    work = bodice(0.03)
    front, back = work.pieces["front"], work.pieces["back"]
    level = worn_levels(work, [front, back])
    over, under = level["front"][4], level["front"][1]
    assert over[0] == pytest.approx(under[-1], abs=1e-3)  # the dart's mouth is closed
    other = level["front"][6]
    assert np.ptp(other) == pytest.approx(0.4, abs=0.012)  # the middle of the front is as long as it was
    assert 0.365 < np.ptp(np.concatenate([over, under])) < 0.385
    for mine, theirs in ((under, level["back"][4]), (over, level["back"][3])):
        assert mine[[0, -1]] == pytest.approx(theirs[[-1, 0]], abs=1e-3)
    found = widths(front, np.array([0.1, 0.3]), level["front"])
    np.testing.assert_allclose(found, 0.3, atol=1e-6)


def test_without_darts_heights_are_those_of_the_plane():
    work = bodice(0.03)
    work.seams = work.seams[1:]
    front = work.pieces["front"]
    level = worn_levels(work, [front, work.pieces["back"]])
    for k, found in enumerate(level["front"]):
        np.testing.assert_array_equal(found, front.level(k, worn=True))


def test_what_shoulders_carry_hangs_by_their_seams_while_others_close():
    """Both sides of each on one line; once it is sewn nothing holds it."""
    worn = woman()
    pattern = fitted(read_garmentcode(next(UNSEEN.glob("900140_*.json"))), worn)
    assert pattern.holds == ()
    assert len(pattern.hung) == 4
    places = {hold.side: hold.place for hold in pattern.hung if isinstance(hold.place, Course)}
    for seam in pattern.seams:
        if seam.first in places:
            one, other = (places[side].points(at) for side, at in
                          zip((seam.first, seam.second), pattern.pairs(seam, 12), strict=True))  # fmt: skip
            np.testing.assert_allclose(one, other, atol=5e-3)
            assert one[:, 1].min() > worn.height["underarm"]
    held = fitted(read_garmentcode(next(UNSEEN.glob("900132_*.json"))), worn)
    assert held.holds
    assert held.hung == ()


def test_a_hood_hangs_by_the_seam_over_the_head_while_others_close():
    """In the middle, from the neck to over the crown; its halves stand beside the head."""
    worn = woman()
    pattern = fitted(read_garmentcode(next(UNSEEN.glob("900170_*.json"))), worn)
    hoods = [hold for hold in pattern.hung if pattern.panel(hold.side.panel).label == "head"]
    assert {hold.side.panel for hold in hoods} == {"left_hood", "right_hood"}
    places = [hold.place.places for hold in hoods if isinstance(hold.place, Course)]
    assert len(places) == len(hoods)
    np.testing.assert_allclose(np.concatenate(places)[:, 0], 0.0, atol=5e-3)
    assert np.concatenate(places)[:, 1].max() > worn.height["top"] - 0.05


def test_a_jumpsuit_is_longer_in_the_trunk_and_no_other_garment_is(monkeypatch):
    """Its fork comes lower by that, its shoulders stay; trousers that hang from the waist keep their places."""
    worn = woman()

    def heights(number: int, part: str, room: float) -> tuple[float, float]:
        monkeypatch.setattr(widen, "ROOM", room)
        work = placed(read_garmentcode(next(UNSEEN.glob(f"900{number}_*.json"))), worn)[0]
        y = np.concatenate([piece.worn()[:, 1] for piece in work.of(part)])
        return float(y.min()), float(y.max())

    for part, lower in (("leg_l", 0.04), ("trunk", 0.04)):
        before, after = heights(177, part, 0.0), heights(177, part, 0.04)
        assert before[0] - after[0] == pytest.approx(lower, abs=0.006)
        assert before[1] - after[1] == pytest.approx(lower if part == "leg_l" else 0.0, abs=0.006)
    assert heights(138, "leg_l", 0.0) == heights(138, "leg_l", 0.04)


@pytest.mark.parametrize("number", [114, 151, 164, 166])
def test_an_arm_lies_between_the_seams_of_its_sleeve_where_that_starts(number):
    """Of sleeves that were drawn with one of them across the arm, as 900114's, 2 cm over its middle; others stay."""
    worn = woman()
    work = placed(read_garmentcode(next(UNSEEN.glob(f"900{number}_*.json"))), worn)[0]
    shoulder, hand = worn.arm[0, :2], worn.arm[2, :2]
    way = (hand - shoulder) / np.linalg.norm(hand - shoulder)
    for front in work.of("arm_l"):
        if front.side == "front":
            lines = [front.worn(a.edge)[:, :2] - shoulder for a, b in work.pairs(front.name)
                     if work.pieces[b.panel].part == "arm_l" and work.pieces[b.panel].side == "back"]  # fmt: skip
            over = sorted((line @ [-way[1], way[0]] for line in lines), key=lambda across: float(across.mean()))
            radius = worn.girth["wrist"] / (2 * np.pi)
            assert over[-1].min() > radius
            assert over[0].max() < -radius


def test_trousers_that_are_tight_at_their_top_are_widened_where_they_are():
    """Skirts go up to where they fit; the fork of 900127 would have gone 11 cm up with it."""
    worn = woman()
    for number, raised in ((127, False), (142, True)):
        notes = fitted(read_garmentcode(next(UNSEEN.glob(f"900{number}_*.json"))), worn).notes
        assert any("raised" in note for note in notes) == raised
