"""Yarn counts in the trade's words."""

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.count import COUNT_WORDS, parse_count


@pytest.mark.parametrize(
    ("text", "tex", "plies"),
    [
        ("30/2", 590.5 / 30, 2),
        ("Ne 30", 590.5 / 30, 1),
        ("30s", 590.5 / 30, 1),
        ("30/2 Ne", 590.5 / 30, 2),
        ("2/60 Nm", 1000 / 60, 2),
        ("60/2 Nm", 1000 / 60, 2),
        ("Nm 2/60", 1000 / 60, 2),
        ("Nw 2/48", 885.8 / 48, 2),
        ("NeL 25", 1653.5 / 25, 1),
        ("tex 20x2", 20.0, 2),
        ("20 tex", 20.0, 1),
        ("20tex x 2", 20.0, 2),
        ("20 den", 20 / 9, 1),
        ("20/22 den x 2", 21 / 9, 2),
        ("dtex 167f48", 16.7, 1),
        ("150 den / 48f", 150 / 9, 1),
    ],
)
def test_words_of_the_trade(text: str, tex: float, plies: int) -> None:
    count = parse_count(text)
    assert (count.tex, count.plies) == (pytest.approx(tex), plies)


def test_filaments_say_how_fine_they_are() -> None:
    assert parse_count("dtex 167f48").fineness_dtex == pytest.approx(167 / 48)
    assert parse_count("150 den/48f").form == parse_count("20 den").form == "filament"
    assert parse_count("20 den").fineness_dtex is parse_count("Ne 30").form is None


def test_every_form_that_an_error_lists_is_one() -> None:
    for text in COUNT_WORDS:
        assert parse_count(text).tex > 0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("30", "names no system; write Ne 30, Nm 30"),
        ("2/60", "may be metric or worsted; write 2/60 Nm or 2/60 Nw, or 60/2"),
        ("20 texx", 'is no count; known: 30/2.*did you mean "tex"'),
        ("", "is no count"),
        ("Ne -3", "is no count"),
        ("Nm 0", "allowed: a count above 0"),
        ("Ne 30/99", "99 plies; allowed: 1 to 12"),
        ("Ne 30 tex", "is no count"),
        ("99999 tex", "allowed: 0.1 to 10000 tex"),
        ("Ne 30/1.5", "1.5 plies"),
    ],
)
def test_what_is_no_count_is_refused(text: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        parse_count(text)
