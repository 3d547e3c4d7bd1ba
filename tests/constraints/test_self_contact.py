"""Cloth against cloth: layers keep their thickness, momentum stays, and nothing of it is there where nobody asks."""

from functools import cache

import numpy as np
import pytest
from layers import SOFT, THICKNESS, crossings, layers, nearest, sheet_of
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.ground.errors import InputError
from taichi_cloth.layers.layer_contact import LayerContact
from taichi_cloth.motion.forces import Forces, Plane, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.verlet import Verlet

REACH = 2  # rows that are a key point's own neighbourhood at this thickness and spacing


@cache
def fallen() -> tuple[Sheet, NDArray, list[NDArray], tuple[bytes, ...]]:
    """Momentum at the start of each of 8 frames, positions at their ends, and the last states of two runs."""
    sheet, x, v = layers(1.0)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=THICKNESS))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))
    states, paths, momenta = [], [], []
    for _ in range(2):
        simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=v)
        paths, momenta = [], []
        for _ in range(8):
            momenta.append((sheet.mass[..., None] * sheet.steps(simulation.state)).sum((0, 1)) / solver.step)
            simulation.step()
            paths.append(simulation.positions)
        states.append(simulation.state.values.tobytes())
    return sheet, np.array(momenta), paths, tuple(states)


def test_layers_that_fall_on_each_other_keep_their_thickness() -> None:
    """At 1 m/s: no key point comes nearer to the other layer than 70 % of the thickness, and no thread crosses it."""
    sheet, _, paths, _ = fallen()
    least = min(nearest(sheet, x, apart=0.03) for x in paths)
    assert 0.7 * THICKNESS < least < 1.2 * THICKNESS, f"{1e3 * least:.2f} mm of {1e3 * THICKNESS:.2f}"
    assert all(crossings(sheet, x, apart=REACH) == 0 for x in paths)


def test_contact_keeps_momentum() -> None:
    """Without external forces only the air takes momentum, e^(−ct): to 1 % of the first, as contacts keep it but what
    certificates push does not; and after the blow none at all, to 1e-4."""
    _, momenta, _, _ = fallen()
    exact = momenta[0] * np.exp(-SOFT.air_damping * np.arange(8) / 60)[:, None]
    assert np.abs(momenta - exact).max() < 1e-2 * np.linalg.norm(momenta[0])
    later = momenta[2] * np.exp(-SOFT.air_damping * np.arange(6) / 60)[:, None]
    assert np.abs(momenta[2:] - later).max() < 1e-4 * np.linalg.norm(momenta[0])


def test_a_second_run_gives_the_same_bytes() -> None:
    """With what the first has left in the lists; asking for 2 threads changes nothing, as the sheet is one strip."""
    assert len(set(fallen()[3])) == 1


@pytest.mark.slow
def test_a_strip_that_falls_in_folds_lies_in_layers() -> None:
    """0.36 m, let go upright: at rest it is a heap of layers, none deeper than 10 % of the thickness into another, and
    nothing crosses but what lies within a fold tighter than the key points can show (4 rows)."""
    sheet = sheet_of(1)
    x = sheet.flat()
    x[..., 2] = 0.01 * np.sin(25 * x[..., 1])
    x[..., 1] += 0.005
    forces = Forces(self_contact=SelfContact(thickness=THICKNESS), plane=Plane(friction=0.5))
    simulation = Simulation(
        sheet, Verlet(sheet, forces, constraints=constraints_for(sheet, forces)), forces=forces, positions=x
    )
    for _ in range(60):
        simulation.step()
    x = simulation.positions
    assert x[..., 1].max() < 0.05, "it lies"
    assert x[..., 1].max() > 3 * THICKNESS, "in layers"
    assert nearest(sheet, x, apart=0.035) > 0.9 * THICKNESS
    assert crossings(sheet, x, apart=4) == 0


def test_what_is_not_asked_for_is_not_built() -> None:
    sheet = sheet_of(2)
    forces = Forces(self_contact=SelfContact(thickness=THICKNESS))
    assert constraints_for(sheet, Forces()) == ()
    assert [type(one) for one in constraints_for(sheet, forces)] == [LayerContact]


def test_forces_that_no_constraint_answers_are_refused() -> None:
    with pytest.raises(InputError, match=r"forces\.self_contact: no constraint"):
        Verlet(sheet_of(2), Forces(self_contact=SelfContact(thickness=THICKNESS)))


def test_contacts_that_cannot_be_are_refused() -> None:
    for thickness, friction in ((0.0, 0.3), (1e-3, -1.0)):
        with pytest.raises(InputError, match="self_contact"):
            SelfContact(thickness=thickness, friction=friction)
    with pytest.raises(InputError, match="thickness"):
        constraints_for(sheet_of(2), Forces(self_contact=SelfContact(thickness=0.1)))
