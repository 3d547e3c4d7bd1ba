"""Limbs that pass between key points: when the middles of springs are met, and how they answer.

One grid of 41 × 41 and one kind of primitives serve all of them, so that they share a kernel.
"""

import numpy as np
import pytest
from strips import NOTHING, PLAIN, replace, run, simulate

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_middles import MiddleContact
from taichi_cloth.constraints.thin_limbs import DEEP, let_through, thinnest_held
from taichi_cloth.motion.constraint import shared_fields
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.yarns import Yarns

N = 41
A = 0.024
"""Between key points [m]."""
GAP = 0.004


def sheet_of(rows: int, columns: int, pinned=None, **changes: float) -> Sheet:
    """Of so many key points, in a corner of the grid."""
    cells = np.zeros((N - 1, N - 1), bool)
    cells[: rows - 1, : columns - 1] = True
    material = replace(PLAIN, **{"tensile_warp": 500.0, "tensile_weft": 500.0, **changes})
    return Sheet.of_cells(
        cells, material=material, springs=calibrate(material, spacing_x=A, spacing_y=A), pinned=pinned
    )


def level(sheet: Sheet, height: float) -> np.ndarray:
    """Columns along x and rows along −z in a level plane, the middle of the sheet over the origin."""
    rows, columns = (int(np.flatnonzero(sheet.present.any(axis=k)).max()) for k in (1, 0))
    u = sheet.flat() - [columns * A / 2, rows * A / 2, 0.0]
    return np.stack([u[..., 0], np.full((N, N), height), -u[..., 1]], axis=-1)


def rod(radius: float, x: float = 0.0, y: float = 0.0) -> Primitive:
    """Along z."""
    return Primitive(kind="cylinder", start=np.array([x, y, -0.4]), end=np.array([x, y, 0.4]), radii=(radius, radius))


def ball(radius: float, x: float = 0.0, y: float = 0.0) -> Primitive:
    return Primitive(kind="sphere", start=np.array([x, y, 0.0]), end=np.array([x, y, 0.0]), radii=(radius, radius))


def middles(sheet: Sheet, x: np.ndarray) -> np.ndarray:
    """Of all springs in the plane (n, 3), straight from the key points."""
    here = sheet.present
    pairs = [(x[:, :-1], x[:, 1:], here[:, :-1] & here[:, 1:]), (x[:-1], x[1:], here[:-1] & here[1:])]
    cell = here[:-1, :-1] & here[1:, 1:] & here[:-1, 1:] & here[1:, :-1]
    pairs += [(x[:-1, :-1], x[1:, 1:], cell), (x[:-1, 1:], x[1:, :-1], cell)]
    return np.concatenate([((a + b) / 2)[there] for a, b, there in pairs])


def clearance(body: Colliders, points: np.ndarray) -> float:
    """The least distance [m] to what stands at rest, less the gap."""
    return float(nearest_distance(body.primitives, points.reshape(-1, 3))[0].min() - body.gap)


def by_key_points_alone(simulation: Simulation) -> Simulation:
    """The same kernel, whose middles meet nothing."""
    (middle,) = (one for one in simulation.solver.constraints if isinstance(one, MiddleContact))
    middle.solids = middle.solids[:0]
    return simulation


THIN = {"rod": rod(0.008), "ball": ball(0.012)}


@pytest.mark.parametrize("name", THIN)
def test_a_limb_thinner_than_the_spacing_holds_a_sheet_by_its_middles(name: str) -> None:
    """Key points 24 mm apart, a rod 16 mm or a ball 24 mm thick between them, the gap 4 mm. By its key points alone the
    sheet falls through. By its middles it comes to rest, none deeper than 0.5 mm in the gap, and stays: the energy of
    motion ends below a hundredth of that of a fall by 1 mm, and halves every quarter of a second."""
    sheet = sheet_of(9 if name == "rod" else 8, 8, air_damping=8.0)
    body = Colliders(primitives=(THIN[name],), gap=GAP, friction=0.6)
    start = {"forces": Forces(body=body), "positions": level(sheet, 0.03)}
    fallen = by_key_points_alone(simulate(sheet, **start))
    run(fallen, 20)
    assert fallen.positions[sheet.present][:, 1].max() < -0.1
    simulation = simulate(sheet, **start)
    paths = run(simulation, 120)
    late = [clearance(body, middles(sheet, x)) for x in paths[90:]]
    assert min(late) > -DEEP
    assert max(late) < 1e-4
    moved = np.diff(paths[90:], axis=0) * 60
    energy = 0.5 * (sheet.mass[..., None] * moved**2).sum(axis=(1, 2, 3))
    assert energy[15:].max() < 0.5 * energy[:15].max()
    assert energy[15:].max() < 1e-2 * sheet.mass.sum() * 9.81 * 1e-3


def test_a_push_at_the_middle_makes_no_moment_about_it() -> None:
    """A ball comes from below at 1 m/s under the middle of a spring between key points of different mass: the sheet
    takes momentum along the normal only, and none of its moment about the place that is pushed."""
    sheet = sheet_of(2, 3, air_damping=0.0)
    x = level(sheet, 0.0)
    x[..., 2] += x[0, 0, 2] * -1.0
    place = (x[0, 0] + x[0, 1]) / 2
    pushed = replace(ball(0.009), start=place - [0, 0.0095, 0], end=place - [0, 0.0095, 0])
    body = Colliders(primitives=(pushed,), friction=0.0, motion=lambda time: lifted(time)[None])
    simulation = simulate(sheet, forces=replace(NOTHING, body=body), positions=x, frame_rate=600.0)
    simulation.step()
    assert sheet.mass[0, 0] != sheet.mass[0, 1]
    moving = (sheet.mass[..., None] * simulation.sheet.steps(simulation.state) / simulation.solver.step)[sheet.present]
    momentum = moving.sum(axis=0)
    assert momentum[1] > 0.5 * sheet.mass[0, :2].sum()
    assert np.abs(momentum[[0, 2]]).max() < 1e-3 * momentum[1]
    about = np.cross(simulation.positions[sheet.present] - place, moving).sum(axis=0)
    assert np.abs(about).max() < 1e-3 * momentum[1] * A


def lifted(time: float, speed: float = 1.0) -> np.ndarray:
    out = np.eye(4)
    out[1, 3] = speed * time
    return out


def test_an_end_that_is_pinned_stays_and_the_middle_is_pushed_out_all_the_same() -> None:
    held = np.zeros((N, N), bool)
    held[:9, 0] = True
    sheet = sheet_of(9, 2, pinned=held, air_damping=8.0)
    x = level(sheet, 0.013)
    body = Colliders(primitives=(rod(0.008),), gap=GAP, motion=lambda time: lifted(min(time, 0.1), 0.05)[None])
    simulation = simulate(sheet, forces=Forces(body=body), positions=x)
    paths = run(simulation, 30)
    np.testing.assert_array_equal(paths[-1][held], x[held].astype(np.float32))
    assert -DEEP < clearance(body, middles(sheet, paths[-1]) - [0.0, 0.005, 0.0]) < 1e-4


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_middles_slip_at_the_friction_angle(factor: float) -> None:
    """A strip lies on two rods between its columns, µ = 0.5, gravity leans along them. 1 % below the friction angle it
    stays within 0.1 mm for 0.5 s; 1 % above it slides as a = g (sin − µ cos) says, 6.4 mm, to 0.3 mm."""
    angle = factor * np.arctan(0.5)
    sheet = sheet_of(9, 3)
    body = Colliders(primitives=(rod(0.008, x=-A / 2), rod(0.008, x=A / 2)), gap=GAP, friction=0.5)
    gravity = (0.0, -9.81 * float(np.cos(angle)), 9.81 * float(np.sin(angle)))
    x = level(sheet, 0.012)
    moved = (run(simulate(sheet, forces=Forces(gravity=gravity, body=body), positions=x), 30)[-1] - x)[sheet.present]
    exact = 0.125 * 9.81 * max(0.0, float(np.sin(angle) - 0.5 * np.cos(angle)))
    assert np.abs(moved[:, 2] - exact).max() < (3e-4 if exact else 1e-4), f"{moved[:, 2].mean():.2e} of {exact:.2e} m"


def test_the_rule_is_the_sag_of_a_cell() -> None:
    """At the radius of the rule a ball that four key points touch stands DEEP out of the skin in their middle, at half
    of the hole with the middles; and with a gap as wide as the hole nothing goes through."""
    diagonal = sheet_of(3, 3).springs.diagonal_length
    for gap in (0.0, 0.002, 0.004):
        for middle, hole in ((False, A / np.sqrt(2)), (True, A / np.sqrt(8))):
            around = thinnest_held(diagonal, gap, middles=middle) + gap
            assert around - np.sqrt(around**2 - hole**2) - gap == pytest.approx(DEEP, rel=1e-6)
    assert thinnest_held(diagonal, A / np.sqrt(2)) == 0.0
    least = thinnest_held(diagonal, GAP)
    solids = (rod(1.01 * least), ball(0.99 * least), rod(0.99 * least), ball(1.01 * least))
    assert let_through(Colliders(primitives=solids, gap=GAP), diagonal).tolist() == [1, 2]


def test_a_grid_is_thin_where_a_part_of_it_is() -> None:
    """A ball of 60 mm, and the same with a finger of 8 mm, that no ball of 30 mm fits into."""
    diagonal = sheet_of(3, 3).springs.diagonal_length
    places = 0.01 * np.stack(np.meshgrid(*[np.arange(-14, 15)] * 3, indexing="ij"), axis=-1)
    round_part = np.linalg.norm(places, axis=-1) - 0.06
    finger, _, _ = nearest_distance(
        [Primitive(kind="cylinder", start=np.zeros(3), end=np.array([0.12, 0, 0]), radii=(0.008, 0.008))],
        places.reshape(-1, 3),
    )
    both = np.minimum(round_part, finger.reshape(round_part.shape))
    grids = tuple(
        DistanceGrid(origin=np.full(3, -0.14), spacing=0.01, values=values.astype(np.float32))
        for values in (round_part, both)
    )
    assert 0.008 < thinnest_held(diagonal, GAP) < 0.06
    assert let_through(Colliders(grids=grids, gap=GAP), diagonal).tolist() == [1]


@pytest.mark.slow  # a kernel of its own takes most of it
@pytest.mark.parametrize("name", THIN)
def test_among_whole_yarns_middles_answer_in_each_turn_of_every_substep(name: str) -> None:
    """A sheet at rest lies on what is thin within rounding; answered in some substeps only, it sank by 0.1 mm."""
    sheet = sheet_of(9 if name == "rod" else 8, 8, air_damping=8.0)
    forces = Forces(body=Colliders(primitives=(THIN[name],), gap=GAP, friction=0.6))
    solver = Yarns(sheet, forces, constraints=constraints_for(sheet, forces, answered=Yarns.answers))
    simulation = Simulation(sheet, solver, forces=forces, positions=level(sheet, 0.03))
    late = [clearance(forces.body, middles(sheet, x)) for x in run(simulation, 120)[90:] if forces.body]
    assert min(late) > -1e-6
    assert max(late) < 1e-4


@pytest.mark.slow  # a kernel for each takes most of it
def test_two_threads_give_the_same_bytes() -> None:
    """Both ends of a spring are written, so the whole sheet goes through one of them, in order."""
    sheet = sheet_of(8, 8)
    forces = Forces(body=Colliders(primitives=(THIN["ball"],), gap=GAP))
    one, two = (simulate(sheet, forces=forces, positions=level(sheet, 0.03), threads=n) for n in (1, 2))
    for simulation in (one, two):
        run(simulation, 12)
    assert one.state.values.tobytes() == two.state.values.tobytes()


def test_where_key_points_are_close_enough_nothing_is_built() -> None:
    made = shared_fields.cache_info().misses
    sheet = sheet_of(3, 3)
    body = Colliders(primitives=(rod(1.01 * thinnest_held(sheet.springs.diagonal_length, GAP)),), gap=GAP)
    passes = simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.2)).solver.constraints
    assert [type(one) for one in passes] == [Contact]
    assert shared_fields.cache_info().misses == made
