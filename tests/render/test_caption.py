"""Words on pictures: measured as they are drawn, inside the picture, on a plate that fits them."""

import numpy as np
import pytest

from taichi_cloth.render.image.caption import caption, label, legend, tag

SIZES = [(1200, 400), (600, 600), (520, 2400), (900, 600)]


def inked(image: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row and column of what is darker than the paper."""
    rows, columns, _ = np.nonzero(image < 100)
    return rows.min(), rows.max(), columns.min(), columns.max()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("text", ["wool", "cotton: 1,020 spheres and much, much more than there is room for on it"])
def test_a_caption_stays_in_its_picture(size: tuple[int, int], text: str) -> None:
    height, width = size
    _, bottom, left, right = inked(caption(np.full((height, width, 3), 255, np.uint8), text))
    assert left >= 0.02 * width
    assert right < 0.98 * width
    assert bottom < height - 1


@pytest.mark.parametrize("size", SIZES)
def test_a_label_stands_centred(size: tuple[int, int]) -> None:
    height, width = size
    _, _, left, right = inked(label(np.full((height, width, 3), 255, np.uint8), "HOOH", (width / 2, height / 2)))
    assert (left + right) / 2 == pytest.approx(width / 2, abs=3)


@pytest.mark.parametrize("size", SIZES)
def test_a_tag_has_its_words_in_the_middle_of_its_plate(size: tuple[int, int]) -> None:
    picture = np.full((*size, 3), 120, np.uint8)
    tagged = tag(picture, "HOOH")
    rows, columns = (np.flatnonzero((tagged != 120).any(axis=2).any(axis=axis)) for axis in (1, 0))
    top, bottom, left, right = inked(tagged)
    assert (rows[-1], columns[0]) == (size[0] - 1, 0)  # in the corner
    assert (left + right) / 2 == pytest.approx((columns[0] + columns[-1]) / 2, abs=3)
    assert (top + bottom) / 2 == pytest.approx((rows[0] + rows[-1]) / 2, abs=0.15 * len(rows))
    assert (picture == 120).all()


def test_a_legend_keeps_its_entries_apart() -> None:
    names = ["structural springs", "shear springs", "bending springs"]
    strip = legend(2400, [(name, (0.8, 0.1, 0.1)) for name in names], height=64)
    paper = strip[0, 0]
    clear = (np.abs(strip.astype(int) - paper) < 30).all(axis=2).all(axis=0)
    edges = np.flatnonzero(np.diff(clear.astype(int)))
    gaps = np.diff(edges)[1::2]  # of clear columns between what is drawn: the widest two part three entries
    assert np.sort(gaps)[-2] >= 32
