"""Layers that tremble get shorter steps, as a heap that lies would not come to rest without."""

import pytest
from layers import THICKNESS, sheet_of

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.motion.forces import Forces, SelfContact
from taichi_cloth.sheet.sheet import PAD
from taichi_cloth.solvers.yarns import FINER, LONGEST, Yarns

RATE, HALF_A_SECOND = 30.0, 15


@pytest.mark.parametrize(
    ("within", "between", "contact", "finer"),
    [
        (0.06, 0.01, True, True),
        (0.02, 0.01, True, False),  # hardly
        (0.06, 0.05, True, False),  # it moves on
        (0.3, 0.15, True, False),  # and fast
        (0.06, 0.01, False, False),
    ],
)
def test_layers_that_tremble_get_shorter_steps(within: float, between: float, contact: bool, finer: bool) -> None:
    """within, between: speed in a substep, and from frame to frame [m/s]."""
    sheet = sheet_of(1)
    forces = Forces(self_contact=SelfContact(thickness=THICKNESS) if contact else None)
    solver = Yarns(sheet, forces, frame_rate=RATE, step=LONGEST, constraints=constraints_for(sheet, forces))
    before, substeps = sheet.state(sheet.flat()), solver.substeps
    for frame in range(HALF_A_SECOND):
        assert solver.substeps == substeps, frame
        after = before.copy()
        inside = after.values[:, PAD:-PAD, : sheet.shape[1]]
        inside[0] += between / RATE
        inside[3] = within * solver.step
        assert not solver.shorten(before, after), "no frame is taken again for it"
    assert (solver.substeps >= FINER * substeps) == finer
