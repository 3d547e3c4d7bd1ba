"""Ties as a pass of the solver: closed at once, and no source of motion."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from strips import COLS, NOTHING, PLAIN, simulate, strip

from taichi_cloth.constraints import ties as of_ties
from taichi_cloth.constraints.beside_ties import PULL
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.tie_fields import TieFields
from taichi_cloth.constraints.ties import CLOSED, Ties
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_energy, kinetic_energy
from taichi_cloth.sheet.sheet import PAD, Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

TIES = 40


@pytest.fixture(scope="module")
def strips():
    """Two strips of 12 cells side by side, and 40 ties along their edges: nodes and weights."""
    cells = np.ones((12, 7), bool)
    cells[:, 3] = False
    sheet = Sheet.of_cells(cells, material=PLAIN, springs=calibrate(PLAIN, spacing_x=0.01, spacing_y=0.01))
    along = np.linspace(0.0, 11.99, TIES)
    row, part = along.astype(int), along % 1
    nodes = np.stack([np.stack([row + i, np.full(TIES, c)], -1) for c in (3, 4) for i in (0, 1)], 1)
    return sheet, nodes, np.stack([1 - part, part, part - 1, -part], 1)


def joined(sheet: Sheet) -> np.ndarray:
    """Flat, the strips' edges on each other."""
    x = sheet.flat()
    x[:, 4:, 0] -= 0.01
    return x


def test_seams_finer_than_the_cells_close_and_shake_nothing(strips):
    """Thrown about by 0.1 m/s without any damping: closed to 10 µm after each frame, and never more energy than after
    the first, to a tenth. (Ties that leave their gaps as speed tear the strips in the first frame.)"""
    sheet, nodes, weights = strips
    ties = Ties(sheet, nodes, weights)
    velocities = 0.1 * np.random.default_rng(3).standard_normal((*sheet.shape, 3))
    simulation = simulate(sheet, positions=joined(sheet), velocities=velocities, ties=(ties,))
    energy, gaps = [], []
    for _ in range(120):
        simulation.step()
        x, v = simulation.positions.astype(float), sheet.steps(simulation.state) / simulation.solver.step
        energy.append(elastic_energy(sheet, x - v * simulation.solver.step / 2) + kinetic_energy(sheet, v))
        gaps.append(ties.gaps(simulation.state).max())
    assert max(gaps) < 1e-5
    assert max(energy) < 1.1 * energy[0]


def test_the_answer_of_many_ties_is_that_of_few(strips, monkeypatch):
    """Row by row from a sparse factorization, and from the inverse as a whole."""
    sheet, nodes, weights = strips
    whole = Ties(sheet, nodes, weights).answer
    monkeypatch.setattr(of_ties, "MOST_AT_ONCE", TIES - 1)
    monkeypatch.setattr(of_ties, "BLOCK", 16)
    rows = Ties(sheet, nodes, weights).answer
    one, other = (csr_array((values, at, begin), shape=(TIES, TIES)).toarray() for begin, at, values in (whole, rows))
    assert one.any()
    np.testing.assert_allclose(one, other, atol=1e-4)
    assert len(rows[1]) < TIES**2


def test_what_seams_are_usually_pushed_by_is_kept_with_the_state(strips):
    """In planes of its own, and as much as the square of the step: it is a force."""
    sheet, nodes, weights = strips
    ties = Ties(sheet, nodes, weights)
    state = sheet.state(joined(sheet), ties.keeps)
    assert state.values[6:].size >= 3 * TIES
    state.values[6:] = 1.0
    ties.rescale(state, 0.5)
    assert np.count_nonzero(state.values[6:] == 0.25) == 3 * TIES
    assert (state.values[:6] == sheet.state(joined(sheet)).values).all()
    assert Ties(sheet, nodes, weights, repeated=False).keeps == 0


def test_threads_beside_ties_and_the_ties_at_their_ends(strips):
    """Of the strips' edges: those along the edge and those that lead to it. Each knows the ties that name one of its
    ends, and may be as long as its law makes it at PULL, since that is more than LONGEST."""
    sheet, nodes, weights = strips
    ties = Ties(sheet, nodes, weights)
    near, flat = ties.beside, sheet.flat().reshape(-1, 3)
    rows, columns = sheet.shape
    place = near.ends - PAD * sheet.width
    place = place // sheet.width * columns + place % sheet.width
    along = np.linalg.norm(flat[place[:, 1]] - flat[place[:, 0]], axis=1)
    assert len(near.ends) == 2 * (rows + rows - 1)
    assert np.allclose(np.sqrt(near.numbers[:, 0]) / along, 1 + PULL / PLAIN.tensile_warp)
    assert np.allclose(near.numbers[:, 2:].sum(axis=1), 1.0)
    for thread, (begin, end) in enumerate(zip(near.begin, near.begin[1:], strict=False)):
        named = (np.isin(ties.index, near.ends[thread]) & (ties.weight != 0)).any(axis=1)
        assert near.tie[begin:end].tolist() == np.flatnonzero(named).tolist()


def test_threads_wait_until_all_seams_are_closed(strips, monkeypatch):
    """While one is still being drawn together those beside ties are left to their law: drawn to their length meanwhile
    they tear denim."""
    sheet, nodes, weights = strips
    ties = Ties(sheet, nodes, weights)
    drawn = []
    monkeypatch.setattr(TieFields, "take", lambda _, path: drawn.append(path[-1, 5]))
    ties.join(40, 1 / 60 / 40)
    apart = joined(sheet)
    apart[7, 4:, 0] += 1.1 * CLOSED
    for positions in (joined(sheet), apart):
        ties.begin(sheet.state(positions, ties.keeps), NOTHING.during(0.0, 1 / 60))
    assert drawn == [1.0, 0.0]


@pytest.mark.parametrize("share", [2.5, 0.6])
@pytest.mark.parametrize("solver", [Verlet, Yarns])
def test_what_hangs_on_more_than_its_holds_bear_slides(share, solver):
    """A strip by its upper edge, of holds that bear so many times its weight between them: it hangs, or slides at what
    is left of gravity (Coulomb). Where they have gone stays with the state."""
    sheet = strip(rows=9, length=0.08)
    forces = Forces(gravity=(0.0, -9.81, 0.0))
    nodes = np.array([[[0, c]] for c in range(COLS)])
    x = sheet.flat() * np.array([1.0, -1.0, 1.0])
    most = share * 9.81 * sheet.mass.sum() * np.array([0.25, 0.5, 0.25])
    ties = Ties(sheet, nodes, np.ones((COLS, 1)), places=x[0], most=most, repeated=False)
    constraints = constraints_for(sheet, forces, ties=(ties,))
    simulation = Simulation(
        sheet, solver(sheet, forces, frame_rate=60.0, constraints=constraints), forces=forces, positions=x
    )
    for _ in range(30):
        simulation.step()
    fallen = float((x - simulation.positions)[0, :, 1].mean())
    expected = max(0.0, 1.0 - share) * 9.81 * 0.5**2 / 2
    assert fallen == pytest.approx(expected, rel=0.03, abs=2e-5)
    slid = ties.slid(simulation.state)
    assert slid[1] == pytest.approx(-expected, rel=0.03, abs=2e-5)


def test_places_begin_as_far_as_they_have_slid():
    """A strip that hangs 10 mm below where its places were at first, which have slid by so much: it stays there."""
    sheet = strip(rows=9, length=0.08)
    forces = Forces(gravity=(0.0, -9.81, 0.0))
    x = sheet.flat() * np.array([1.0, -1.0, 1.0])
    nodes, most = np.array([[[0, c]] for c in range(COLS)]), np.full(COLS, 9.81 * sheet.mass.sum())
    ties = Ties(sheet, nodes, np.ones((COLS, 1)), places=x[0] + [0, 0.01, 0], most=most, repeated=False)
    solver = Verlet(sheet, forces, frame_rate=60.0, constraints=constraints_for(sheet, forces, ties=(ties,)))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    assert ties.gaps(simulation.state) == pytest.approx(0.01, rel=1e-3)
    ties.slide(simulation.state, np.tile([[0.0], [-0.01], [0.0]], ties.count).astype(np.float32))
    assert ties.gaps(simulation.state).max() < 1e-6
    for _ in range(10):
        simulation.step()
    assert np.abs((simulation.positions - x)[0]).max() < 1e-4
