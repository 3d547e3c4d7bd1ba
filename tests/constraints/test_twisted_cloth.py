"""A sheet wrung by two turns: what is jammed does not pass through itself, and its threads stay as long as without
contact."""

import numpy as np
import pytest
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.crossings.crossings import find_crossings
from taichi_cloth.motion.forces import Forces, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.yarns import Yarns

COUNT, SPACING, TURNS, TIME, LIFT, FRAMES = 61, 0.01, 2.0, 3.0, 0.12, 100


def wrung(contact: SelfContact | None) -> tuple[list[int], float]:
    """Of a cotton shirting of 0.6 × 0.6 m, hung by 4 cm of its upper edge, of which 4 cm of the lower one are turned
    and lifted in three seconds: triangles through others, frame by frame, and the longest strain of a thread."""
    material = named_material("cotton-shirting")
    high, low = (np.zeros((COUNT, COUNT), bool) for _ in range(2))
    high[0, 28:33] = low[-1, 28:33] = True
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    sheet = Sheet.rectangle(COUNT, COUNT, material=material, springs=springs, pinned=high | low)
    x = np.zeros((COUNT, COUNT, 3))
    x[..., 0] = (np.arange(COUNT) - COUNT // 2) * SPACING
    x[..., 1] = -np.arange(COUNT)[:, None] * SPACING
    x[..., 2] = 1e-4 * np.random.default_rng(1).standard_normal((COUNT, COUNT))
    x[high | low, 2] = 0
    held = x[low].copy()

    def path(time: float) -> NDArray[np.float64]:
        s = min(time / TIME, 1.0)
        way = s * s * (3 - 2 * s)
        turn = 2 * np.pi * TURNS * way
        across = held[:, 0]
        return np.stack([across * np.cos(turn), held[:, 1] + LIFT * way, across * np.sin(turn)], -1)

    forces = Forces(self_contact=contact)
    solver = Yarns(sheet, forces, frame_rate=30, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x, pins=(Pins(high), Pins(low, path)))
    through, longest = [], 0.0
    for _ in range(FRAMES):
        simulation.step()
        positions = simulation.positions
        through.append(find_crossings(positions.reshape(-1, 3), sheet.triangles).count)
        longest = max(longest, *(float(strain.max()) for strain in sheet.stretch(positions)))
    return through, longest


@pytest.mark.slow  # a minute or two with its kernels
def test_a_sheet_that_is_wrung_by_two_turns_stays_clear_and_as_long_as_without_contact() -> None:
    """In every frame; at most 1.5 times as long a thread, 1.1 measured (2.3 %). Without contact up to 1,602 of 7,200
    triangles are through others, in 88 of 100 frames."""
    through, longest = wrung(SelfContact(thickness=5e-4))
    without, usual = wrung(None)
    assert not any(through)
    assert max(without) > 500
    assert longest < 1.5 * usual
