"""What a first sewing shows to be tight is cut wider, where it is tight and nowhere else."""

import numpy as np
import pytest

from taichi_cloth.garment.fit.let_out import both, let_out
from taichi_cloth.garment.fit.piece import pieces_of
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.tried_on import EASE, tight
from taichi_cloth.sheet.materials import MATERIALS

CELL = 0.01
CLOTH = MATERIALS["cotton-shirting"].linear


def panel(label: str, turn: int) -> Panel:
    """0.3 m wide, 0.4 m high, from the middle of the body; turned by so many right angles."""
    corner = np.array([[0, 0], [0.3, 0], [0.3, 0.4], [0, 0.4], [0, 0.0]])
    quarter = np.linalg.matrix_power(np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]]), turn)
    edges = tuple(corner[k : k + 2] @ quarter[:2, :2].T for k in range(4))
    return Panel("front", edges, Flat(quarter.T, np.zeros(3)), label=label)


def drawn(one: Panel, strain: float, low: float, high: float) -> tuple[Garment, np.ndarray]:
    """The panel as it stands, drawn wider between two heights of the body."""
    garment = Garment(Pattern("one", (one,), ()), cut(Pattern("one", (one,), ()), (CELL, CELL)), CLOTH)
    at = garment.atlas.start()
    wide = np.where((at[..., 1] > low) & (at[..., 1] < high), 1 + strain, 1.0)
    return garment, at * np.stack([wide, np.ones_like(wide), np.ones_like(wide)], -1)


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_rows_that_are_drawn_longer_are_tight(turn):
    """In a panel's own coordinates, however it was drawn: threads across the body are those of the weft or the warp."""
    garment, at = drawn(panel("trunk", turn), 0.06, 0.15, 0.25)
    heights, by = tight(garment, at)["front"]
    assert (np.diff(heights) > 0).all()
    band = (heights > 0.17) & (heights < 0.23)
    np.testing.assert_allclose(by[band], 1.06 + EASE, atol=2e-3)
    np.testing.assert_allclose(by[(heights < 0.11) | (heights > 0.29)], 1.0, atol=1e-3)


def test_slack_and_little_strain_ask_for_nothing():
    garment, at = drawn(panel("trunk", 0), 0.02, 0.1, 0.3)
    assert tight(garment, at) == {}
    assert tight(garment, garment.atlas.start() * [0.8, 1.0, 1.0]) == {}


@pytest.mark.parametrize(("away", "alike"), [(0.0, True), (0.02, False)])
def test_left_and_right_are_let_out_alike(away, alike):
    """As the tighter one asks, wherever each begins in its own coordinates; a panel that lies elsewhere is no twin."""
    left = panel("trunk", 0)
    mirror = np.diag([-1.0, 1.0, -1.0])
    lower = tuple(edge + np.array([0.0, 0.3]) for edge in left.edges)
    right = Panel("other", lower, Flat(mirror, np.array([0.0, away - 0.3, 0.0])), label="trunk")
    pattern = Pattern("two", (left, right), ())
    garment = Garment(pattern, cut(pattern, (CELL, CELL)), CLOTH)
    at = garment.atlas.start()
    high = (at[..., 1] > 0.15) & (at[..., 1] < 0.25) & (at[..., 0] > 0)
    wide = np.where(high, 1.06, 1.0)
    found = tight(garment, at * np.stack([wide, np.ones_like(wide), np.ones_like(wide)], -1))
    assert set(found) == ({"front", "other"} if alike else {"front"})
    if alike:
        np.testing.assert_allclose(found["other"][0] - 0.3, found["front"][0], atol=1e-9)
        np.testing.assert_allclose(found["other"][1], found["front"][1], atol=1e-9)


def test_a_half_is_let_out_at_its_side_and_keeps_its_middle():
    """By as much as was asked there, and not beyond where it is asked."""
    work = pieces_of(Pattern("one", (panel("trunk", 0),), ()))
    piece = work.pieces["front"]
    piece.graded, piece.shift, piece.part, piece.side = piece.edges, piece.at, "trunk", "front"
    asked = {"front": (np.array([0.0, 0.1, 0.2, 0.3]), np.array([1.0, 1.1, 1.1, 1.0]))}
    (note,) = let_out(work, asked)
    assert note.endswith("front of trunk 3.0 cm")
    side = piece.graded[1]
    np.testing.assert_allclose(side[:, 0], 0.3 * np.interp(side[:, 1], *asked["front"]))
    np.testing.assert_allclose(np.concatenate(piece.graded)[:, 0].min(), 0.0, atol=1e-12)
    np.testing.assert_allclose(piece.graded[2][:, 1], 0.4)


def test_letting_out_twice_is_letting_out_by_both():
    at = np.array([0.0, 0.1, 0.2])
    once, twice = {"a": (at, np.array([1.0, 1.1, 1.0]))}, {"a": (at, np.full(3, 1.1)), "b": (at, np.full(3, 1.2))}
    found = both(once, twice)
    np.testing.assert_allclose(found["a"][1], [1.1, 1.21, 1.1])
    np.testing.assert_allclose(found["b"][1], 1.2)
