"""Friction within the sheet, torsion and locking: loops, strips and frames against closed forms, with both solvers."""

from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from taichi_cloth.mechanics.bending import bias_bending
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_energy, elastic_forces
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import HELD_BENDING, HELD_SHEAR, LOCKED, LOCKS_OVER, SLIPS, calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

SIDE, SPACING = 9, 5e-3
CLOTH = Material(
    tensile_warp=1500.0,
    tensile_weft=1000.0,
    shear=60.0,
    bending_warp=9e-6,
    bending_weft=6e-6,
    couple_warp=0.5e-3,
    couple_weft=0.3e-3,
    torsion=8e-6,
    shear_friction=1.0,
    locking=0.6,
    density=0.12,
)
STILL = Forces(gravity=(0.0, 0.0, 0.0))


def sheet_of(material: Material = CLOTH) -> Sheet:
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    return Sheet.rectangle(SIDE, SIDE, material=material, springs=springs)


def rolled(curvature: float, way: int) -> np.ndarray:
    """Key points of a sheet bent to a curvature [1/m] along its columns (way 0, the weft) or rows; as a circle's arc,
    its chords as long as they were."""
    flat = sheet_of().flat() - SPACING * (SIDE - 1) / 2
    if curvature == 0:
        return flat
    chord = 2 / curvature * np.sin(SPACING * curvature / 2)
    out, angle = flat.copy(), flat[..., way] * curvature
    out[..., way] = np.sin(angle) / curvature * SPACING / chord
    out[..., 2] = (1 - np.cos(angle)) / curvature * SPACING / chord
    return out


def sheared(angle: float) -> np.ndarray:
    """A picture frame: threads as long as they were, at an angle [rad] to the right one."""
    flat = sheet_of().flat()
    x, y = flat[..., 0], flat[..., 1]
    c, s = cos(angle / 2), sin(angle / 2)
    return np.stack([c * x + s * y, s * x + c * y, 0.0 * x], axis=-1)


def pulls(solver_of: type, shapes: list[np.ndarray], material: Material = CLOTH) -> list[np.ndarray]:
    """What a sheet led through such shapes pulls its key points by in each [N]: from the steps that a substep of half a
    microsecond makes of rest."""
    sheet = sheet_of(material)
    solver = solver_of(sheet, STILL, frame_rate=1e6, threads=1)
    assert solver.substeps == 2
    state, found = sheet.state(shapes[0], solver.remembered), []
    for shape in shapes:
        remembered = state.values[6:]
        state = sheet.state(shape, solver.remembered)
        state.values[6:] = remembered
        solver.advance(state, STILL.during(0.0, 0.0))
        found.append(sheet.steps(state).astype(float) / (2 * solver.step**2) * sheet.mass[..., None])
    return found


def work(forces: np.ndarray, shape, at: float) -> float:
    """−Σ F · dx/dq of a family of shapes: what moves them on [J over the unit of q]."""
    step = 1e-4 * max(abs(at), 0.1)
    return -float(np.sum(forces * (shape(at + step) - shape(at - step)))) / (2 * step)


@pytest.mark.parametrize("solver", [Verlet, Yarns])
@pytest.mark.parametrize(("way", "rigidity", "couple"), [(0, 6e-6, 0.3e-3), (1, 9e-6, 0.5e-3)])
def test_pure_bending_is_a_loop_of_width_2hb_round_b(solver: type, way: int, rigidity: float, couple: float) -> None:
    """M(κ) from 0 to 60 to −60 and back to 60 1/m: Bκ + HB on the way up, Bκ − HB on the way down, and after a turn
    the slope B + r until it has slipped."""
    path = [0.0, 30.0, 60.0, 59.0, 30.0, 0.0, -60.0, -30.0, 0.0, 30.0, 60.0]
    forces = pulls(solver, [rolled(k, way) for k in path])
    patches = (SIDE - 1) * (SIDE - 2) * SPACING**2
    moments = [work(f, lambda k: rolled(k, way), k) / patches for f, k in zip(forces, path, strict=True)]
    up, down = couple, -couple
    held = min(couple / SLIPS, HELD_BENDING * rigidity)
    expected = [0.0, up, up, up - held, down, down, down, up, up, up, up]
    for k, moment, friction in zip(path, moments, expected, strict=True):
        assert moment == pytest.approx(rigidity * k + friction, abs=0.03 * (couple + rigidity * abs(k)))


@pytest.mark.parametrize("solver", [Verlet, Yarns])
@pytest.mark.parametrize("shape", [rolled(60.0, 0), sheared(0.2)])
def test_what_rubs_goes_along_in_a_relaxed_sheet_and_pulls_nothing_where_that_left_it(
    solver: type, shape: np.ndarray
) -> None:
    """Pulls of a sheet with friction, in the shape and with the anchors of one that was relaxed, are those without
    friction; those of a sheet that was brought there at once are not."""
    rubbing = sheet_of()
    relaxed = replace(rubbing, springs=rubbing.springs.relaxed)
    free = solver(relaxed, STILL, frame_rate=1e6, threads=1)
    state = relaxed.state(shape, free.remembered)
    free.advance(state, STILL.during(0.0, 0.0))
    expected, anchors = relaxed.steps(state), free.anchors(state)
    rough = solver(rubbing, STILL, frame_rate=1e6, threads=1)
    kept, at_once = (rubbing.state(shape, rough.remembered) for _ in range(2))
    rough.anchors(kept)[:] = anchors
    for one in (kept, at_once):
        rough.advance(one, STILL.during(0.0, 0.0))
    most = np.abs(expected).max()
    assert np.abs(rubbing.steps(kept) - expected).max() < 1e-3 * most
    assert np.abs(rubbing.steps(at_once) - expected).max() > 0.05 * most


@pytest.mark.parametrize("solver", [Verlet, Yarns])
def test_a_picture_frame_shears_in_a_loop_of_2hg_and_locks(solver: type) -> None:
    """T(γ) beyond that of the elastic cells: ± HG, and from half of LOCKS_OVER round the locking angle LOCKED × G."""
    end = CLOTH.locking + 3 * LOCKS_OVER
    path = [0.0, 0.2, 0.4, 0.2, -0.2, -0.4, 0.0, 0.4, CLOTH.locking + LOCKS_OVER, end]
    elastic = sheet_of()
    forces = pulls(solver, [sheared(angle) for angle in path])
    area, tiny = ((SIDE - 1) * SPACING) ** 2, 1e-4
    more = []
    for f, angle in zip(forces, path, strict=True):
        springs = elastic_energy(elastic, sheared(angle + tiny)) - elastic_energy(elastic, sheared(angle - tiny))
        more.append((work(f, sheared, angle) - springs / (2 * tiny)) / area)
    friction = CLOTH.shear_friction
    # A force on diagonals has a lever that falls with the angle: l cos γ/2 of either, over both.
    lever = [cos(angle / 2) for angle in path]
    for got, expected, share in zip(more[:8], [0, 1, 1, -1, -1, -1, 1, 1], lever[:8], strict=True):
        assert got == pytest.approx(expected * friction * share, abs=0.05 * friction)
    stiffness = (more[9] - more[8]) / (path[9] - path[8]) / CLOTH.shear
    assert stiffness == pytest.approx(LOCKED * lever[9] ** 2, rel=0.05)
    assert more[8] - friction * lever[8] == pytest.approx(LOCKED * CLOTH.shear * LOCKS_OVER * lever[8] ** 2, rel=0.05)


def test_a_cylinder_at_any_angle_bends_as_cooper_says() -> None:
    """Energy of a wide sheet on a cylinder of 1 m radius, per area, whose axis is at φ to the weft."""
    sheet = sheet_of()
    flat, middle = sheet.flat(), SPACING * (SIDE - 1) / 2
    for angle in (0.0, pi / 8, pi / 4, pi / 2):
        along = (flat[..., 1] - middle) * cos(angle) + (flat[..., 0] - middle) * sin(angle)
        across = (flat[..., 0] - middle) * cos(angle) - (flat[..., 1] - middle) * sin(angle)
        bent = np.stack([across, np.sin(along), 1 - np.cos(along)], axis=-1)
        # Patches are not as many for each family and torsion: those of a hinge, of a cell.
        cell = ((SIDE - 1) * SPACING) ** 2
        hinge = (SIDE - 1) * (SIDE - 2) * SPACING**2
        bending = bias_bending(CLOTH.bending_warp, CLOTH.bending_weft, 0.0, angle) * hinge
        torsion = bias_bending(0.0, 0.0, CLOTH.torsion, angle) * cell
        none = replace(CLOTH, tensile_warp=1e-9, tensile_weft=1e-9, shear=0.0)
        assert elastic_energy(sheet_of(none), bent) == pytest.approx((bending + torsion) / 2, rel=1e-3)


@pytest.mark.parametrize("cells", [False, True])
def test_a_strip_cut_on_the_bias_grows_by_its_shear(cells: bool) -> None:
    """Pulled at 45° with free edges: 1/E = (S₁₁ + S₂₂ + 2 S₁₂)/4 + 1/(4G), S of the threads with what diagonals couple;
    of cloth in the main four times its shear stiffness. Of cells, which couple nothing: S₁₂ = 0."""
    material = replace(CLOTH, couple_warp=0.0, couple_weft=0.0, torsion=0.0, bending_warp=0.0, bending_weft=0.0)
    material = material if cells else material.elastic
    sheet, g = sheet_of(material), CLOTH.shear
    assert (sheet.springs.diagonal == 0) == cells
    e_x, e_y = CLOTH.tensile_weft, CLOTH.tensile_warp
    c_y = (e_y + sqrt(e_y**2 + 4 * g**2 * e_y / e_x)) / 2
    give = np.diag([1 / e_x, 1 / e_y]) if cells else np.linalg.inv(np.array([[c_y * e_x / e_y, g], [g, c_y]]))
    strain = 1e-4
    xx, yy, angle = (float(one) for one in (*(give @ [0.5, 0.5]), 0.5 / g))
    along = (xx + yy + angle) / 2  # of a unit pull: the strain at 45°
    shape = np.array([[1 + strain * xx / along, strain * angle / along / 2], [strain * angle / along / 2, 1.0]])
    shape[1, 1] += strain * yy / along
    x = sheet.flat()
    x[..., :2] = x[..., :2] @ shape
    energy = elastic_energy(sheet, x) / ((SIDE - 1) * SPACING) ** 2
    expected = 4 / (give.sum() + 1 / g)
    assert energy == pytest.approx(expected * strain**2 / 2, rel=1e-3)
    assert 0.8 * 4 * g < expected < 4 * g


def test_torsion_alone_pulls_as_its_energy_says() -> None:
    """The kernel without friction in it, on a rough sheet, against −∂W/∂x in float64."""
    rough = sheet_of().flat() + 2e-4 * np.random.default_rng(3).standard_normal((SIDE, SIDE, 3))
    only = replace(CLOTH.elastic, torsion=CLOTH.torsion)
    (forces,) = pulls(Verlet, [rough], only)
    expected = elastic_forces(sheet_of(only), rough.astype(np.float32))
    assert np.abs(forces - expected).max() < 1e-3 * np.abs(expected).max()
    assert not sheet_of(only).springs.slips


@pytest.mark.parametrize("solver", [Verlet, Yarns])
def test_cells_pull_as_their_energy_says(solver: type) -> None:
    """The kernel where hardly anything rubs, on a rough sheet with threads that pull nothing, against −∂W/∂x in
    float64."""
    rough = sheet_of().flat() + 2e-4 * np.random.default_rng(4).standard_normal((SIDE, SIDE, 3))
    limp = replace(CLOTH, tensile_warp=1e-6, tensile_weft=1e-6, shear_friction=1e-9, couple_warp=0.0, couple_weft=0.0)
    limp = replace(limp, locking=0.0)
    (forces,) = pulls(solver, [rough], limp)
    sheet = sheet_of(limp)
    expected = elastic_forces(sheet, rough.astype(np.float32))
    assert sheet.springs.diagonal == 0 < sheet.springs.shear
    assert np.abs(forces - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("solver", [Verlet, pytest.param(Yarns, marks=pytest.mark.slow)])
def test_cloth_that_was_bent_stays_bent_by_hb_over_b(solver: type) -> None:
    """Let go at twice that curvature in thick air, it comes to rest where bending no longer overcomes friction."""
    material = replace(CLOTH, shear_friction=0.0, locking=0.0, torsion=0.0, air_damping=200.0)
    material = material.linear if solver is Verlet else material
    sheet = sheet_of(material)
    start = rolled(2.2 * CLOTH.couple_weft / CLOTH.bending_weft, 0)
    simulation = Simulation(sheet, solver(sheet, STILL, threads=1), forces=STILL, positions=start)
    for _ in range(60):
        simulation.step()
    x = simulation.positions[4].astype(float)
    bent = np.linalg.norm(x[2:] - 2 * x[1:-1] + x[:-2], axis=-1) / SPACING**2
    assert np.median(bent) == pytest.approx(CLOTH.couple_weft / CLOTH.bending_weft, rel=0.05)


@pytest.mark.parametrize("solver", [Verlet, Yarns])
def test_a_run_with_friction_that_was_saved_goes_on_to_the_same_bytes(solver: type, tmp_path) -> None:
    """Friction remembers: a sheet that falls over its own corner, saved on the way, with two threads of the machine."""

    def make() -> Simulation:
        held = np.zeros((SIDE, SIDE), bool)
        held[-1, ::4] = True
        sheet = replace(sheet_of(), pinned=held)
        start = sheet.flat()
        start = np.stack([start[..., 0], 1e-3 * np.sin(90 * start[..., 0]), -start[..., 1]], axis=-1)
        forces = Forces()
        pins = (Pins(held),)
        return Simulation(sheet, solver(sheet, forces, threads=1), forces=forces, positions=start, pins=pins)

    whole, first, second = make(), make(), make()
    for _ in range(12):
        whole.step()
    for _ in range(5):
        first.step()
    first.save(tmp_path / "state.npz")
    second.restore(tmp_path / "state.npz")
    for _ in range(7):
        second.step()
    assert np.abs(whole.state.values[6:9]).max() > 0
    assert whole.state.values.tobytes() == second.state.values.tobytes()
    assert whole.solver.substeps == second.solver.substeps


@pytest.mark.parametrize("solver", [Verlet, Yarns])
def test_steps_follow_what_locks_and_nothing_else_pays(solver: type) -> None:
    """A sheet led into a sharp angle takes as many steps as its cells get stiffer, and stays finite."""
    held = np.zeros((SIDE, SIDE), bool)
    held[0] = held[-1] = held[:, 0] = held[:, -1] = True
    sheet = replace(sheet_of(), pinned=held)
    path = Pins(held, lambda time: sheared(min(time / 0.2, 1.0) * (CLOTH.locking + 0.2))[held])
    start = sheared(0.0)
    made = solver(sheet, STILL, threads=1)
    simulation = Simulation(sheet, made, forces=STILL, positions=start, pins=(path,))
    more = sqrt((1 + HELD_SHEAR + LOCKED) / (1 + HELD_SHEAR)) if solver is Yarns else 1.0  # threads set Verlet's
    least = 0.95 * (made.substeps - 2) * more  # a part of the step is bending's, which does not lock
    for _ in range(20):
        simulation.step()
    assert made.choice.locked == 1.0
    assert made.substeps > least
    middle = simulation.positions - sheared(CLOTH.locking + 0.2)
    assert np.abs(middle).max() < 1e-5
    assert sheet.springs.held.diagonal == pytest.approx((1 + HELD_SHEAR) * 2 * sheet.springs.shear)
