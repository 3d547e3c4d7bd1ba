"""Weaves against drawdowns written by hand, and the counts that define twills, satins and baskets."""

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import colour, coloured, known_colours, thread_colours
from taichi_cloth.weave.draft import Draft, interlacing_notes, known_weaves, longest_float, named_weave, tile


def drawdown(text: str) -> np.ndarray:
    """Rows from the top as a weaver draws them, so pick 0 is the last line."""
    return np.array([[c == "#" for c in line] for line in text.split()])[::-1]


BY_HAND = {
    "plain": ".# #.",
    "twill-2/2-z": ".##. ##.. #..# ..##",
    "twill-2/1-s": "##. .## #.#",
    "sateen-5": "...#. .#... ....# ..#.. #....",
    "basket-2/2": "..## ..## ##.. ##..",
    "basket-2/1": "..## ##..",
}


@pytest.mark.parametrize("name", BY_HAND)
def test_against_drawdowns_by_hand(name):
    got = named_weave(name).warp_up
    want = drawdown(BY_HAND[name])
    n = got.shape[0]
    assert any(np.array_equal(np.roll(got, k, axis=0), want) for k in range(n)), f"\n{got.astype(int)}"


def test_twill_2_2_z_climbs_to_the_right():
    up = named_weave("twill-2/2").warp_up
    np.testing.assert_array_equal(up[1:, 1:], up[:-1, :-1])
    s = named_weave("twill-2/2-s").warp_up
    np.testing.assert_array_equal(s[1:, :-1], s[:-1, 1:])


@pytest.mark.parametrize(("name", "share"), [
    ("plain", 1 / 2), ("twill-2/1", 2 / 3), ("twill-1/2-s", 1 / 3), ("twill-2/2", 1 / 2),
    ("twill-3/1-s", 3 / 4),
    ("twill-1/3", 1 / 4), ("satin-5", 4 / 5), ("sateen-5", 1 / 5), ("satin-8", 7 / 8), ("sateen-8", 1 / 8),
    ("basket", 1 / 2), ("basket-3/3", 1 / 2), ("herringbone", 1 / 2), ("twill-3/1/1/3", 1 / 2),
])  # fmt: skip
def test_share_of_warp_on_the_face(name, share):
    up = named_weave(name).warp_up
    assert up.mean() == pytest.approx(share)
    np.testing.assert_allclose(up.mean(axis=0), share)
    np.testing.assert_allclose(up.mean(axis=1), share)


@pytest.mark.parametrize(("name", "longest"), [
    ("plain", (1, 1)), ("twill-2/2", (2, 2)), ("twill-3/1", (3, 3)), ("satin-5", (4, 4)), ("satin-8", (7, 7)),
    ("basket-3/3", (3, 3)), ("basket-2/1", (1, 2)), ("herringbone", (2, 2)),
])  # fmt: skip
def test_longest_float(name, longest):
    assert longest_float(named_weave(name).warp_up) == longest
    assert longest_float(named_weave(name, ends=240, picks=120).warp_up) == longest


def test_longest_float_agrees_with_counting():
    rng = np.random.default_rng(5)
    for _ in range(20):
        up = rng.random((7, 9)) < 0.4
        expected = []
        for lines in (up.T, up):
            longest = 0
            for line in lines:
                ring = "".join("#" if v else "." for v in np.tile(line, 2))
                runs = max(len(run) for run in ring.replace("#.", "# .").replace(".#", ". #").split())
                longest = max(longest, min(runs, line.size))
            expected.append(longest)
        assert longest_float(up) == tuple(expected)


@pytest.mark.parametrize("name", ["satin-5", "satin-8", "sateen-7", "satin-12"])
def test_satin_binding_points_never_touch(name):
    up = named_weave(name).warp_up
    bound = up if up.mean() < 0.5 else ~up
    assert (bound.sum(axis=0) == 1).all()
    assert (bound.sum(axis=1) == 1).all()
    for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
        assert not (bound & np.roll(bound, step, axis=(0, 1))).any()


def test_every_known_weave_weaves_and_interlaces():
    for name in known_weaves():
        draft = named_weave(name, ends=30, picks=17)
        assert draft.warp_up.shape == (17, 30)
        assert interlacing_notes(named_weave(name).warp_up) == ()


def test_tile_repeats_everything_and_is_read_only():
    small = Draft(
        warp_up=np.array([[1, 0, 0], [0, 1, 1]], dtype=bool),
        warp_colour=thread_colours("red white blue", 3),
        weft_spacing_m=np.array([1e-3, 2e-3]),
        warp_thickness_m=np.array([1e-4, 2e-4, 3e-4]),
    )
    big = tile(small, ends=7, picks=5)
    for i in range(5):
        for j in range(7):
            assert big.warp_up[i, j] == small.warp_up[i % 2, j % 3]
    assert big.warp_colour is not None
    assert big.weft_spacing_m is not None
    np.testing.assert_array_equal(big.warp_colour[3], colour("red"))
    np.testing.assert_array_equal(big.weft_spacing_m, [1e-3, 2e-3, 1e-3, 2e-3, 1e-3])
    assert big.weft_colour is None
    with pytest.raises(ValueError, match="read-only"):
        big.warp_up[0, 0] = False


def test_threads_that_never_interlace_are_named():
    up = np.array([[1, 0, 1], [0, 0, 1], [1, 0, 1]], dtype=bool)
    notes = interlacing_notes(up)
    assert len(notes) == 1
    assert "2 of 3 ends never interlace" in notes[0]
    assert notes[0].endswith("2, 3")
    assert "picks never interlace" in interlacing_notes(up.T)[0]


@pytest.mark.parametrize(("call", "words"), [
    (lambda: named_weave("twil-2/2"), 'did you mean "twill-2/2"'),
    (lambda: named_weave("twill-0/2"), "whole numbers from 1"),
    (lambda: named_weave("twill-2/2/1"), "pairs"),
    (lambda: named_weave("satin-6"), "needs 5 or from 7"),
    (lambda: named_weave("satin-4"), "needs 5"),
    (lambda: named_weave("satin-8/4"), "allowed for 8 ends: 3, 5"),
    (lambda: named_weave("twill-99/99"), "at most 64"),
    (lambda: named_weave("herringbone-2/1"), "equal floats"),
    (lambda: named_weave(""), "unknown weave"),
    (lambda: named_weave("plain", ends=0), "ends: 0"),
    (lambda: named_weave("plain", picks=-3), "picks: -3"),
    (lambda: named_weave("plain", ends=10**9, picks=10**9), "crossings"),
    (lambda: named_weave("plain", ends=2.5), "whole number"),  # type: ignore[arg-type]
    (lambda: Draft(warp_up=np.zeros(4, dtype=bool)), "(picks, ends)"),
    (lambda: Draft(warp_up=np.zeros((0, 4), dtype=bool)), "picks: 0"),
    (lambda: Draft(warp_up=np.eye(2, dtype=bool), warp_colour=np.zeros((3, 3), np.float32)), "(2, 3)"),
    (lambda: Draft(warp_up=np.eye(2, dtype=bool), weft_colour=np.full((2, 3), np.nan, np.float32)), "0 to 1"),
    (lambda: Draft(warp_up=np.eye(2, dtype=bool), warp_spacing_m=np.array([1e-3, 0.0])), "thread 2"),
    (lambda: Draft(warp_up=np.eye(2, dtype=bool), weft_thickness_m=np.array([np.nan, 1.0])), "thread 1"),
])  # fmt: skip
def test_bad_weaves_are_one_line(call, words):
    with pytest.raises(InputError) as error:
        call()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_colour_orders():
    stripes = thread_colours("navy*2 white", 7)
    navy, white = colour("navy"), colour("white")
    np.testing.assert_array_equal(stripes, [navy, navy, white, navy, navy, white, navy])
    np.testing.assert_array_equal(stripes, thread_colours([("navy", 2), ("white", 1)], 7))
    np.testing.assert_array_equal(stripes, thread_colours("navy * 2, white", 7))
    assert stripes.dtype == np.float32


@pytest.mark.parametrize("text", ["sett: K4 R6 Y2", "sett: K/4 R6 Y/2", "SETT: black*4 red6 #e3b81a/2"])
def test_a_sett_turns_at_its_pivots(text):
    k, r, y = colour("black"), colour("red"), colour("yellow")
    np.testing.assert_array_equal(thread_colours(text, 20), [k] * 4 + [r] * 6 + [y] * 2 + [r] * 6 + [k] * 2)


def test_a_sett_of_one_or_two_stripes_just_repeats():
    np.testing.assert_array_equal(thread_colours("sett: K2 W2", 8), thread_colours("black*2 white*2", 8))
    assert len(np.unique(thread_colours("sett: K2", 8), axis=0)) == 1


def test_srgb_is_decoded_to_linear_light():
    np.testing.assert_allclose(colour("#808080"), 0.2158605, rtol=1e-5)
    np.testing.assert_allclose(colour("#fff"), 1.0)
    for name in known_colours():
        assert ((colour(name) >= 0) & (colour(name) <= 1)).all()


def test_houndstooth_repeats_in_eight():
    draft = coloured(named_weave("twill-2/2", ends=16, picks=16), warp="black*4 white*4", weft="black*4 white*4")
    assert draft.warp_colour is not None
    assert draft.weft_colour is not None
    face = np.where(draft.warp_up[..., None], draft.warp_colour[None], draft.weft_colour[:, None])[..., 0]
    np.testing.assert_array_equal(face[:8], face[8:])
    np.testing.assert_array_equal(face[:, :8], face[:, 8:])
    assert (face[:8, :8] == colour("black")[0]).sum() == 32  # half the cloth is dark


@pytest.mark.parametrize(("order", "words"), [
    ("nawy*4", 'did you mean "navy"'), ("", "empty"), ("sett:", "empty"), ([], "empty"), ("navy*0", "from 1"),
    ("navy*-2", "from 1"), ("navy*two", "from 1"), ("#12345", "3 or 6 digits"),
    ("sett: K4 R24 Q4", "unknown colour 'Q'"),
    ("sett: K4 R/24 K4", "pivots"), ("sett: K R", "no stripe"), ("navy*999999999", "up to 1000000"),
    ([("navy", 1.5)], "from 1"), (["navy"], "pairs"), ([(7, 2)], "not a colour name"),
    ("navy*9999999999", "from 1"),
])  # fmt: skip
def test_bad_orders_are_one_line(order, words):
    with pytest.raises(InputError) as error:
        thread_colours(order, 10)
    assert words in str(error.value)


@pytest.mark.parametrize("count", [0, -1, 10**12, 2.0])
def test_bad_thread_counts(count):
    with pytest.raises(InputError, match="threads"):
        thread_colours("navy", count)
