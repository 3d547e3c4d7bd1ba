"""Several cloths in one sheet: each moves as it does alone, and weighs what it weighs."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_energy, elastic_forces
from taichi_cloth.sheet.materials import MATERIALS, Material
from taichi_cloth.sheet.sheet import Band, Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.choice import choose
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

ROWS, COLS, SPACING = 9, 11, 0.02
THIN = MATERIALS["silk-habotai"]
RUBS = replace(
    MATERIALS["denim"], couple_warp=2e-3, couple_weft=1e-3, torsion=4e-5, shear_friction=2.0, air_damping=2.0
)


def sheet_of(*materials: Material) -> Sheet:
    """Rectangles of ROWS by COLS key points, one below the other in one grid, an empty row of cells between, each held
    along its last row."""
    cells, pinned = np.ones((ROWS * len(materials) - 1, COLS - 1)), np.zeros((ROWS * len(materials), COLS), bool)
    cells[ROWS - 1 :: ROWS] = 0.0
    pinned[ROWS - 1 :: ROWS] = True
    made = [Band(k * ROWS, m, calibrate(m, spacing_x=SPACING, spacing_y=SPACING)) for k, m in enumerate(materials)]
    sheet = Sheet.of_cells(cells, material=made[0].material, springs=made[0].springs, pinned=pinned)
    return replace(sheet, bands=tuple(made[1:]))


def start(count: int) -> np.ndarray:
    """Each as a rough sheet, level, beside the other."""
    random = np.random.Generator(np.random.Philox(key=5))
    flat = sheet_of(THIN).flat()[..., [0, 2, 1]] + 1e-4 * random.standard_normal((ROWS, COLS, 3))
    return np.concatenate([flat + np.array([0.5 * k, 0.0, 0.0]) for k in range(count)])


@pytest.mark.parametrize(
    ("solver", "loops"),
    [
        (Yarns, False),
        pytest.param(Yarns, True, marks=pytest.mark.slow),
        pytest.param(Verlet, False, marks=pytest.mark.slow),
        pytest.param(Verlet, True, marks=pytest.mark.slow),
    ],
)
def test_each_moves_as_alone(solver: type, loops: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """In steps of one length; a step is rounded where key points lie, so not to the last bit. loops: as parallel loops,
    which is all that there is on a device."""
    if loops:
        monkeypatch.setattr(solver, "loops_from", 0)
    materials = [m.linear for m in (THIN, RUBS)] if solver is Verlet else [THIN, RUBS]
    both = sheet_of(*materials)
    step = solver(both, Forces(), frame_rate=60.0).step

    def moved(sheet: Sheet, positions: np.ndarray) -> np.ndarray:
        simulation = Simulation(
            sheet, solver(sheet, Forces(), frame_rate=60.0, step=step), forces=Forces(), positions=positions
        )
        for _ in range(6):
            simulation.step()
        return simulation.positions

    together = moved(both, start(2))
    for k, material in enumerate(materials):
        rows = slice(k * ROWS, (k + 1) * ROWS)
        alone = moved(sheet_of(material), start(2)[rows])
        np.testing.assert_allclose(together[rows], alone, atol=2e-6)
        assert np.abs(alone - start(2)[rows]).max() > 0.02
    # And not as the other does.
    swapped = moved(sheet_of(*materials[::-1]), start(2))
    assert np.abs(swapped - together).max() > 1e-3


def test_numbers_of_all_are_those_of_each() -> None:
    positions = start(2) * 1.01
    both, alone = sheet_of(THIN, RUBS), [sheet_of(THIN), sheet_of(RUBS)]
    parts = np.split(positions, 2)
    np.testing.assert_allclose(both.mass, np.concatenate([one.mass for one in alone]))
    energies = [elastic_energy(one, part) for one, part in zip(alone, parts, strict=True)]
    np.testing.assert_allclose(elastic_energy(both, positions), sum(energies))
    forces = [elastic_forces(one, part) for one, part in zip(alone, parts, strict=True)]
    np.testing.assert_allclose(elastic_forces(both, positions), np.concatenate(forces), atol=1e-12)


def test_the_stiffest_sets_the_step() -> None:
    both = choose(sheet_of(THIN, RUBS), Forces())
    alone = [choose(sheet_of(m), Forces()) for m in (THIN, RUBS)]
    assert both.name == "yarns"
    least = min(one.costs["verlet"].step for one in alone)
    assert 0.9 * least < both.costs["verlet"].step < 1.01 * least


def test_too_many_are_refused() -> None:
    with pytest.raises(InputError, match="9 cloths; allowed: up to 8"):
        Yarns(sheet_of(*[THIN] * 9), Forces())
