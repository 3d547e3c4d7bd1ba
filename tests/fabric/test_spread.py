"""Threads that neighbours press round reach out over a neighbour that dives, where they float."""

import numpy as np
import pytest

from taichi_cloth.fabric.layout import BODY, Detail, FabricLayout, families_of, lay_out
from taichi_cloth.fabric.templates import TemplateBank, build_templates
from taichi_cloth.weave.cloth_set import fit_set
from taichi_cloth.weave.draft import named_weave, tile
from taichi_cloth.yarn.yarn import Yarn

YARN = Yarn(count_tex=7, plies=1, twist_per_m=0.0, migration=0.0)
FLAT = 2.2


def satin(ends: int = 9, picks: int = 9, opening: float = 1.0) -> FabricLayout:
    """A silk satin whose ends lie too close to be as flat as its picks: one repeat, and its first threads once more."""
    draft = named_weave("satin-8", ends=ends, picks=picks)
    diameter = np.full(ends, YARN.woven_diameter), np.full(picks, YARN.woven_diameter)
    rooms = np.full(ends, 1.06 * opening * YARN.woven_diameter), np.full(picks, 2.2 * YARN.woven_diameter)
    made = fit_set(draft.warp_up, rooms, diameter, flattening=FLAT, balance=0.5, rounder=True)
    grey = np.full((ends, 3), 0.5), np.full((picks, 3), 0.5)
    return lay_out(
        made.cloth,
        *families_of(made.cloth, rooms, grey, (YARN, YARN), FLAT),
        detail=Detail(fibres=20, steps=12, variants=1, fringe=0.0, irregularity=0.0),
    )


def block_of(layout: FabricLayout, end: int, pick: int) -> int:
    """Number of the warp block that begins there."""
    ends = layout.cloth.warp_up.shape[1]
    return int(np.flatnonzero((layout.blocks.thread == end) & (layout.blocks.key0 == pick * ends + end))[0])


def across(bank: TemplateBank, block: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the fibres of a block at its end: how far left of the way, and how high."""
    t = bank.template[block]
    mine = np.s_[bank.start[t] : bank.start[t + 1]]
    last = bank.u[mine] > 0.95
    return bank.offset[mine][last, 1], bank.offset[mine][last, 2]


def _even(layout: FabricLayout, end: int) -> int:
    """A block of an end that ends where it floats between neighbours."""
    spread, heights = layout.kinds.spread[layout.blocks.kind][:, 1], layout.cloth.warp_up[:, end]
    alone = np.all(spread <= 0.51 * float(np.asarray(layout.warp.swell)[0]), axis=1)
    picks = [k for k in range(1, 7) if heights[k : k + 3].all() and alone[block_of(layout, end, k)]]
    return block_of(layout, end, picks[0])


def test_an_end_that_floats_reaches_over_the_one_that_dives_beside_it() -> None:
    layout = satin()
    up, room, swell = layout.cloth.warp_up, *(float(np.asarray(a)[0]) for a in (layout.warp.room, layout.warp.swell))
    assert room > 0.05 * layout.warp.width[0]
    assert np.max(layout.weft.room) == 0.0
    bank = build_templates(layout)
    found = 0
    for end in range(1, 8):
        dives = int(np.flatnonzero(~up[:8, end])[0])
        if dives == 0:
            continue
        for neighbour, side in ((end - 1, -1.0), (end + 1, 1.0)):  # an end goes away: the one before lies to its left
            y, z = across(bank, block_of(layout, neighbour, dives - 1))
            even, high = across(bank, _even(layout, neighbour))
            assert (side * y).max() - (side * even).max() == pytest.approx(room - swell / 2, rel=0.15)
            assert (-side * y).max() == pytest.approx((-side * even).max(), abs=0.12 * room)
            assert np.ptp(y) * np.ptp(z) == pytest.approx(np.ptp(even) * np.ptp(high), rel=0.05)
            assert z.min() == pytest.approx(high.min(), abs=0.05 * float(np.ptp(high)))  # it lies on what it lay on
            found += 1
    assert found > 8


def test_a_float_goes_on_from_block_to_block() -> None:
    """What a thread reaches at the end of a block it reaches at the beginning of the next, and where it goes down it
    is as wide as it was."""
    layout = satin()
    spread, ends = layout.kinds.spread[layout.blocks.kind], layout.cloth.warp_up.shape[1]
    body = layout.kinds.section[layout.blocks.kind] == BODY
    for end in range(ends):
        mine = np.flatnonzero((layout.blocks.thread == end) & body)
        np.testing.assert_array_equal(spread[mine][:-1, 1], spread[mine][1:, 0])
    first, last = layout.blocks.key0 // ends, layout.blocks.key1 // ends
    warp = layout.blocks.thread < ends
    face = layout.cloth.warp_up.ravel()
    changes = warp & (face[layout.blocks.key0] != face[layout.blocks.key1])
    assert changes.any()
    assert (first[changes] != last[changes]).all()
    assert not spread[changes].any()


def test_floats_of_a_set_that_threads_were_thinned_for_are_as_wide_as_they_have_room() -> None:
    """A denim's warp hides the weft that it floats over, where it is wider than where that binds it, at equal area."""
    draft = tile(named_weave("twill-3/1"), ends=9, picks=9)
    own = YARN.woven_diameter
    diameter, rooms = np.full(9, own), (np.full(9, 1.16 * own), np.full(9, 1.6 * own))
    made = fit_set(draft.warp_up, rooms, (diameter, diameter), flattening=1.1, balance=0.5)
    assert made.thinned < 0.97
    grey = np.full((9, 3), 0.5), np.full((9, 3), 0.5)
    families = families_of(made.cloth, rooms, grey, (YARN, YARN), 1.1)
    layout = lay_out(
        made.cloth, *families, detail=Detail(fibres=20, steps=12, variants=1, fringe=0.0, irregularity=0.0)
    )
    bound, free = float(families[0].width[0]), min(float(rooms[0][0]), 1.6**0.5 * own)
    assert float(np.asarray(families[0].swell)[0]) == pytest.approx(free - bound, rel=1e-3)
    bank, up = build_templates(layout), layout.cloth.warp_up
    middle = next(k for k in range(1, 7) if up[k - 1 : k + 2, 4].all())
    ends = next(k for k in range(1, 7) if not up[k, 4])
    (y, z), (narrow, high) = (across(bank, block_of(layout, 4, k - 1)) for k in (middle, ends))
    assert np.ptp(y) / np.ptp(narrow) == pytest.approx(free / bound, rel=0.03)
    assert np.ptp(y) * np.ptp(z) == pytest.approx(np.ptp(narrow) * np.ptp(high), rel=0.05)


def test_threads_that_have_room_stay_as_they_are() -> None:
    assert not satin(opening=2.0).kinds.spread.any()
