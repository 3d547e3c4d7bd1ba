"""What hangs on seams and hardly moves loses speed as fibres do, learns nothing, and keeps its steps."""

from math import exp

import numpy as np
import pytest
from layers import sheet_of

from taichi_cloth.constraints.ties import Ties
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.sheet import PAD
from taichi_cloth.solvers.yarns import SLOWED, Yarns

RATE = 30.0
NODES, WEIGHTS = np.array([[[0, 0], [0, 2]]]), np.array([[1.0, -1.0]])


def after_frames(solver: Yarns, *speeds: float) -> None:
    """Of all key points [m/s]."""
    before = solver.sheet.state(solver.sheet.flat())
    for speed in speeds:
        after = before.copy()
        after.values[0, PAD:-PAD, : solver.sheet.shape[1]] += speed / RATE
        assert not solver.shorten(before, after), "no frame is taken again for it"


@pytest.mark.parametrize(
    ("speeds", "seam", "sewing", "hangs"),
    [
        ((0.004,), True, False, True),
        ((0.007,), True, False, False),
        ((0.004, 0.008), True, False, True),  # it goes on until it moves in earnest
        ((0.004, 0.012), True, False, False),
        ((0.004, 0.012, 0.008), True, False, False),
        ((0.004,), True, True, False),
        ((0.004,), False, False, False),
    ],
)
def test_what_hangs_still_on_seams_is_slowed_and_learns_nothing(
    speeds: tuple[float, ...], seam: bool, sewing: bool, hangs: bool
) -> None:
    sheet = sheet_of(1)
    ties = (Ties(sheet, NODES, WEIGHTS),) if seam else ()
    solver = Yarns(sheet, Forces(), frame_rate=RATE, constraints=ties, sewing=sewing)
    own = exp(-sheet.material.air_damping * solver.step)
    after_frames(solver, *speeds)
    kept = exp(-SLOWED * solver.step) if hangs else exp(-sheet.material.air_damping * solver.step)
    assert own > exp(-SLOWED * solver.step), "or nothing is tested"
    assert solver.numbers["kept"] == kept
    assert [one.hangs for one in ties] == [hangs] * len(ties)
    again = Yarns(sheet, Forces(), frame_rate=RATE, constraints=ties, sewing=sewing)
    again.go_on(solver.found)
    assert again.numbers == solver.numbers, "and so does a run that goes on from it"


def test_what_is_sewn_hangs_still_from_when_it_hangs_as_it_is_worn() -> None:
    sheet = sheet_of(1)
    ties = Ties(sheet, NODES, WEIGHTS)
    solver = Yarns(sheet, Forces(), frame_rate=RATE, constraints=(ties,), sewing=True)
    after_frames(solver, 0.004)
    assert not ties.hangs
    solver.sewing = False
    after_frames(solver, 0.004)
    assert ties.hangs


def test_cloth_with_seams_keeps_its_steps_as_it_rests() -> None:
    sheet = sheet_of(1)
    steps = []
    for ties in ((), (Ties(sheet, NODES, WEIGHTS),)):
        solver = Yarns(sheet, Forces(), frame_rate=RATE, constraints=ties)
        before = solver.step
        after_frames(solver, 0.004)
        steps.append(solver.step / before)
    assert steps[0] > 1.5
    assert steps[1] == 1.0
