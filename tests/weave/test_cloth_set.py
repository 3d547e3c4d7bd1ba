"""A close set: threads are pressed, then press each other rounder, and only then lose yarn."""

import numpy as np
import pytest

from taichi_cloth.weave.cloth_set import CLOSEST, Fitted, fit_set
from taichi_cloth.weave.draft import named_weave
from taichi_cloth.weave.jamming import jams

FLAT = 2.2


def satin(warp_um: float, weft_um: float, diameter_um: float = 105.0) -> Fitted:
    draft = named_weave("satin-8", ends=16, picks=16)
    room, thick = np.full(16, warp_um * 1e-6), np.full(16, diameter_um * 1e-6)
    return fit_set(
        draft.warp_up, (room, np.full(16, weft_um * 1e-6)), (thick, thick), flattening=FLAT, balance=0.5, rounder=True
    )  # fmt: skip


def test_ends_that_lie_closer_than_they_are_flat_press_each_other_rounder() -> None:
    """Silk satin, 90 × 44 a cm: its ends touch, its picks lie as flat as they would, and no yarn is lost."""
    made = satin(111.1, 227.3)
    assert not jams(made.cloth)
    assert made.thinned == pytest.approx(CLOSEST)
    warp, weft = made.flattening
    assert weft == FLAT
    assert warp == pytest.approx((111.1 / (CLOSEST * 105.0)) ** 2)
    width = made.cloth.warp_diameter_m + np.asarray(made.cloth.warp_flat_m)
    np.testing.assert_allclose(width, 111.1e-6, rtol=1e-6)
    np.testing.assert_allclose(width * made.cloth.warp_diameter_m, (CLOSEST * 105e-6) ** 2, rtol=1e-6)


def test_sizes_go_over_from_open_to_close_without_a_step() -> None:
    """From threads that lie free to threads that are too many: no size jumps, and none grows."""
    rooms = np.linspace(170.0, 70.0, 401)
    made = [satin(room, 227.3) for room in rooms]
    thinned = np.array([one.thinned for one in made])
    assert thinned[0] == 1.0
    assert thinned[-1] < 0.9 * CLOSEST
    assert (np.diff(thinned) < 1e-9).all()
    sizes = np.array([(one.cloth.warp_diameter_m[0], one.cloth.weft_diameter_m[0]) for one in made])
    assert (np.abs(np.diff(sizes, axis=0)) < 0.02 * sizes[:-1]).all()
    assert not any(jams(one.cloth) for one in made)


def test_a_set_that_fits_is_as_it_is_stated() -> None:
    made = satin(300.0, 300.0)
    assert (made.balance, made.thinned, made.flattening) == (0.5, 1.0, (FLAT, FLAT))
