"""`taichi-cloth figures`: the page, and what becomes of a figure that fails."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.image.image import read_png
from taichi_cloth.scenes.paper import figures
from taichi_cloth.scenes.paper.figures_cloth import _network


def test_every_figure_of_the_paper_is_there_once() -> None:
    numbers = [n for f in figures.FIGURES for n in range(f.first, f.last + 1)]
    assert numbers == list(range(1, 17))
    assert len({f.file for f in figures.FIGURES}) == len(figures.FIGURES)


def test_numbers_choose_figures() -> None:
    assert [f.number for f in figures.numbers_of("2,9-11")] == ["1–2", "9", "10", "11"]
    assert len(figures.numbers_of(None)) == len(figures.FIGURES)
    for wrong in ("0", "17", "3-1x", "a", "", "5,"):
        with pytest.raises(InputError, match="--only"):
            figures.numbers_of(wrong)


@pytest.mark.usefixtures("keep_taichi")
def test_a_failed_figure_is_named_and_the_rest_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(quick: bool) -> np.ndarray:
        raise InputError("no such <cloth>")

    grey = np.full((30, 2400, 3), 128, np.uint8)
    first = replace(figures.FIGURES[0], make=fails)
    second = replace(figures.FIGURES[1], make=lambda quick: grey, caption="a < b & c")
    monkeypatch.setattr(figures, "FIGURES", (first, second))
    assert figures.make_figures(out=tmp_path) == 1
    assert "figure 1–2: no such <cloth>" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == [second.file, "index.html", "made.json"]
    assert read_png(tmp_path / second.file).shape == (15, 1200, 3)  # no wider than the page
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert re.findall('src="(.*?)"', text) == [second.file]
    assert "a &lt; b &amp; c" in text
    assert second.command in unescape(text)


def test_springs_of_a_weave_are_counted_as_a_grid_has_them() -> None:
    """n × m key points: along both ways, across both diagonals, over one key point both ways."""
    n, m = 5, 6
    at = np.stack(np.meshgrid(np.arange(m), np.arange(n)), -1).astype(float)
    lengths = np.array([np.linalg.norm(ends[1] - ends[0]) for ends, *_ in _network(at)])
    assert np.isclose(lengths, 1).sum() == n * (m - 1) + m * (n - 1)
    assert np.isclose(lengths, np.sqrt(2)).sum() == 2 * (n - 1) * (m - 1)
    assert np.isclose(lengths, 2).sum() == n * (m - 2) + m * (n - 2)
    assert len(lengths) == sum(np.isclose(lengths, v).sum() for v in (1, np.sqrt(2), 2))
