"""Whole yarns against the same scheme in float64 with dense systems, against closed forms, and against themselves."""

from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.constraints.beside_ties import LONGEST, longest_beside
from taichi_cloth.constraints.ties import LEARNT, MOVING, Ties
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.crew import Pace
from taichi_cloth.motion.forces import Forces, FrameForces, Plane, Sphere, StrainLimit
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_energy, elastic_forces, kinetic_energy
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import PAD, Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import CALM, FUTILE, LONG, MOST_SWEEPS, SLACK, STAYS, TIGHTEST, UNSOLVED, WILD, Yarns
from taichi_cloth.solvers.yarns import LONGEST as LONGEST_STEP

SIDE = 21
SPACING = 1 / (SIDE - 1)
CLOTH = Material(
    tensile_warp=1000.0,
    tensile_weft=800.0,
    shear=60.0,
    bending_warp=1e-5,
    bending_weft=1e-5,
    density=0.15,
    air_damping=0.0,
)
FAR = Forces(  # every test has a ball and a plane, most of them far away: so all run the same kernel
    sphere=Sphere(centre=(0.0, -900.0, 0.0), radius=0.25, friction=0.3), plane=Plane(height=-1000.0, friction=0.3)
)
RNG = np.random.Generator(np.random.Philox(key=11))


def sheet_of(material: Material = CLOTH, *, pinned: tuple[slice | int, slice | int] | None = None) -> Sheet:
    """1 m × 1 m."""
    held = np.zeros((SIDE, SIDE), bool)
    if pinned is not None:
        held[pinned] = True
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    return Sheet.rectangle(SIDE, SIDE, material=material, springs=springs, pinned=held)


def times(stiff: float) -> Material:
    return replace(CLOTH, tensile_warp=stiff * CLOTH.tensile_warp, tensile_weft=stiff * CLOTH.tensile_weft)


def softened(sheet: Sheet) -> Sheet:
    """The same without its threads."""
    return replace(sheet, springs=replace(sheet.springs, structural_x=0.0, structural_y=0.0))


def level(sheet: Sheet) -> np.ndarray:
    """Lying flat at height 0: rows along −z."""
    flat = sheet.flat()
    return np.stack([flat[..., 0] - 0.5, 0.0 * flat[..., 0], -flat[..., 1]], axis=-1)


def upright(sheet: Sheet) -> np.ndarray:
    """In a vertical plane, the last row on top at height 0."""
    return sheet.flat() - [0.0, 1.0, 0.0]


def simulation(sheet: Sheet, positions: np.ndarray, forces: Forces = FAR, **options) -> Simulation:
    pins = (Pins(sheet.pinned),) if sheet.pinned.any() else ()
    return Simulation(sheet, Yarns(sheet, forces, **options), forces=forces, positions=positions, pins=pins)


class AllOfThem(Pace):
    """Also where one is quicker."""

    def threads(self) -> int:
        return self._most


def largest(sheet: Sheet, positions: np.ndarray) -> float:
    return max(float(part.max()) for part in sheet.stretch(positions))


@dataclass(frozen=True)
class Threads:
    """first, second: key points (threads,) that each joins. before, after: the threads beside it in its yarn, or −1.
    weight: of each; constant [N/m]; rest [m]."""

    first: np.ndarray
    second: np.ndarray
    before: np.ndarray
    after: np.ndarray
    weight: np.ndarray
    constant: float
    rest: float

    @classmethod
    def along(cls, down: int, right: int, weight: np.ndarray, constant: float, rest: float) -> "Threads":
        """weight: (SIDE, SIDE), of the thread from each key point to the one `down` rows and `right` columns on."""
        row, column = np.nonzero(weight)
        first, second = row * SIDE + column, (row + down) * SIDE + column + right
        begins, ends = np.full(SIDE * SIDE, -1), np.full(SIDE * SIDE, -1)
        begins[first], ends[second] = np.arange(len(first)), np.arange(len(first))
        return cls(first, second, ends[first], begins[second], weight[row, column], constant, rest)

    def aimed(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Where threads (n, 3) are pushed: as before the step, by lengths after it, and half of what turned otherwise
        than those beside them."""
        turned = after - before
        beside = np.stack([np.where(one[:, None] >= 0, turned[one], 0.0) for one in (self.before, self.after)])
        count = (self.before >= 0).astype(float) + (self.after >= 0) + 1e-6
        out = before + 0.5 * (turned - beside.sum(axis=0) / count[:, None])
        return out / np.linalg.norm(out, axis=1, keepdims=True)


def whole_families(sheet: Sheet, chains: bool) -> list[Threads]:
    s = sheet.springs
    east, north, cell = sheet.weights
    families = [
        Threads.along(0, 1, east, s.structural_x, s.spacing_x),
        Threads.along(1, 0, north, s.structural_y, s.spacing_y),
    ]
    if chains:
        families.append(Threads.along(1, 1, cell, s.diagonal, s.diagonal_length))
        families.append(Threads.along(1, -1, np.roll(cell, 1, axis=1), s.diagonal, s.diagonal_length))
    return families


def reference(
    sheet: Sheet, x: np.ndarray, u: np.ndarray, *, step: float, sweeps: int, done: int, wild: bool, chains: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """One substep in float64: soft springs, then the families in turns, each as one dense system, whose matrix is that
    of its first sweep unless the substep is wild. Returns positions, steps and the largest strain of the first sweep.
    """
    soft = softened(sheet)
    if chains:
        soft = replace(soft, springs=replace(soft.springs, diagonal=0.0))
    inverse = sheet.inverse_mass[..., None]
    acceleration = elastic_forces(soft, x) * inverse + np.where(inverse > 0, [0.0, -9.81, 0.0], 0.0)
    u = np.where(inverse > 0, u + acceleration * step**2, u)
    y, u, w = (x + u).reshape(-1, 3), u.reshape(-1, 3).copy(), sheet.inverse_mass.ravel()
    flat_x, families = x.reshape(-1, 3), whole_families(sheet, chains)
    tension = [np.zeros(len(one.first)) for one in families]
    most, matrices = 0.0, {}
    for turn in range(len(families) * sweeps):
        number = turn % len(families) if done % 2 == 0 else len(families) - 1 - turn % len(families)
        one = families[number]
        apart, was = y[one.second] - y[one.first], flat_x[one.second] - flat_x[one.first]
        length = np.linalg.norm(apart, axis=1)
        if number < 2 and (turn < len(families) or wild):
            most = max(most, float(np.abs(length / one.rest - 1).max()))
        n = apart / length[:, None]
        if not wild:
            n = one.aimed(was / length[:, None], n)
        jacobian = np.zeros((len(length), len(w), 3))
        rows = np.arange(len(length))
        jacobian[rows, one.second], jacobian[rows, one.first] = n, -n
        flat = jacobian.reshape(len(length), -1)
        mobile = np.repeat(w, 3)
        compliance = 1 / (one.constant * one.weight * step**2)  # in λ of a force × h²
        if number not in matrices or wild:
            matrices[number] = (flat * mobile) @ flat.T + np.diag(compliance)
        change = np.linalg.solve(matrices[number], -(length - one.rest + compliance * tension[number]))
        tension[number] += change
        move = (mobile * (flat.T @ change)).reshape(-1, 3)
        y, u = y + move, u + move
    return y.reshape(x.shape), u.reshape(x.shape), most


@pytest.mark.parametrize(
    ("stiff", "roughness", "ends_wild", "chains"),
    [(1.0, 0.005, False, False), (1.0, 0.05, True, False), (1e4, 0.005, True, False), (1e4, 0.001, False, True)],
)
def test_the_kernel_is_the_scheme_in_float64(stiff: float, roughness: float, ends_wild: bool, chains: bool) -> None:
    """A frame of two substeps from a rough start, the second wild or not, within 1e-5 of the distance between key
    points. Its cells are cut, or carry what was cut off beside them: threads have 0.7 to 1.3 of the constant."""
    sheet = sheet_of(times(stiff), pinned=(-1, slice(None)))
    sheet = replace(sheet, cells=RNG.uniform(0.7, 1.3, sheet.cells.shape))
    free = sheet.inverse_mass[..., None] > 0
    start = upright(sheet) + np.where(free, RNG.standard_normal((SIDE, SIDE, 3)), 0.0) * roughness * SPACING
    solver = Yarns(sheet, FAR, frame_rate=2000.0, chains=chains, threads=2 if chains else 1)
    assert solver.substeps == 2
    state = sheet.state(start)
    sheet.set_steps(state, np.where(free, RNG.standard_normal(start.shape), 0.0) * 1e-3 * SPACING)
    x, u = sheet.positions(state).astype(float), sheet.steps(state).astype(float)
    solver.advance(state, FrameForces())
    wild = False
    for done in range(2):
        x, u, most = reference(sheet, x, u, step=solver.step, sweeps=2, done=done, wild=wild, chains=chains)
        wild = most > WILD
    assert wild == ends_wild
    assert np.abs(sheet.positions(state) - x).max() < 1e-5 * SPACING
    assert np.abs(sheet.steps(state) - u).max() < 1e-5 * SPACING


def test_a_crimp_is_drawn_out_by_what_pulls_and_not_by_how_long_a_thread_seems() -> None:
    """Key points that a substep would take 10 % apart, as what closes a seam does, are drawn together as far as with
    the soft part of the law alone, where the tension that takes is a fiftieth of what draws out a crimp of 2 %."""
    soft = times(1e3)
    curved = replace(soft, drawn_warp=1e7, drawn_weft=1e7, crimp_warp=0.02, crimp_weft=0.02)
    reached = []
    for material in (soft, curved):
        sheet = sheet_of(material, pinned=(-1, slice(None)))
        solver = Yarns(sheet, FAR, frame_rate=2000.0, threads=1)
        state = sheet.state(upright(sheet))
        steps = np.zeros((SIDE, SIDE, 3))
        steps[0, :, 1] = -0.1 * SPACING
        sheet.set_steps(state, steps)
        solver.advance(state, FrameForces())
        reached.append(sheet.positions(state))
    assert np.abs(reached[0] - reached[1]).max() < 1e-6 * SPACING


def test_stiff_shear_is_solved_whole_where_that_is_cheaper() -> None:
    """Cloth a hundred times as stiff in shear moves with as few substeps, as it does with the many of its springs."""
    sheet = sheet_of(replace(times(1e4), shear=100 * CLOTH.shear), pinned=(-1, slice(None)))
    whole = simulation(sheet, level(sheet), threads=2)
    springs = simulation(sheet, level(sheet), chains=False)
    soft = simulation(sheet_of(times(1e4), pinned=(-1, slice(None))), level(sheet))
    assert whole.solver.substeps <= soft.solver.substeps < springs.solver.substeps / 2
    for _ in range(20):
        whole.step()
        springs.step()
    assert np.linalg.norm(whole.positions - springs.positions, axis=-1).max() < 2e-3


def test_each_sweep_leaves_a_share_of_the_error() -> None:
    """What threads that cannot be stretched are off by, after 1, 2 and 3 sweeps of one substep: warp and weft are
    coupled only where they are not at right angles."""
    sheet = sheet_of(times(1e6), pinned=(-1, slice(None)))
    start = upright(sheet)
    start[..., 2] += 0.1 * np.sin(7 * start[..., 0] + 3 * start[..., 1]) * -start[..., 1]
    left = []
    for sweeps in (1, 2, 3):
        solver = Yarns(sheet, FAR, frame_rate=1000.0, sweeps=sweeps, sewing=True)
        state = sheet.state(start)
        solver.advance(state, FrameForces())
        left.append(max(float(np.abs(part).max()) for part in sheet.stretch(sheet.positions(state).astype(float))))
    assert left[1] < 0.5 * left[0]
    assert left[2] < 0.5 * left[1]


def test_at_the_end_of_a_frame_sweeps_go_on_until_threads_are_solved() -> None:
    """Where one sweep leaves a thread longer than it may be."""
    sheet = sheet_of(times(1e6), pinned=(-1, slice(None)))
    start = upright(sheet)
    start[..., 2] += 0.15 * np.sin(7 * start[..., 0] + 3 * start[..., 1]) * -start[..., 1]
    left = []
    for sewing in (True, False):
        solver = Yarns(sheet, FAR, frame_rate=1000.0, sweeps=1, sewing=sewing)
        state = sheet.state(start)
        solver.advance(state, FrameForces())
        left.append(largest(sheet, sheet.positions(state).astype(float)))
    assert left[0] > LONG + UNSOLVED
    assert left[1] < LONG + 1e-4


def test_cloth_that_hardly_moves_takes_longer_steps() -> None:
    """Hung at its upper edge and not yet stretched by its weight; and as long ones as it began with once it flies. What
    it hangs like is the same."""
    sheet = sheet_of(pinned=(-1, slice(None)))
    hung, fine = simulation(sheet, upright(sheet)), simulation(sheet, upright(sheet), step=LONGEST_STEP)
    first = hung.solver.substeps
    for _ in range(40):
        hung.step()
        fine.step()
    assert (hung.solver.substeps, fine.solver.substeps) == (first // 2 + first % 4 // 2, first)
    assert np.abs(hung.positions - fine.positions).max() < 1e-4
    steps = sheet.steps(hung.state)
    steps[..., 2] = np.where(sheet.pinned, 0.0, 1.0 * hung.solver.step)
    sheet.set_steps(hung.state, steps)
    hung.step()
    assert hung.solver.substeps == first


def sewn_panels(*, free: bool = False) -> tuple[Sheet, Ties, np.ndarray, int]:
    """Two panels sewn to one sheet of 1 m, held at the top or not: with their seam, key points on each other in the x–y
    plane, the top at 0, and the number of the row that is there twice."""
    middle, material = SIDE // 2 + 1, times(1e4)
    cells = np.ones((SIDE, SIDE - 1))
    cells[middle - 1] = 0.0  # rows middle − 1 and middle lie on each other
    held = np.zeros((SIDE + 1, SIDE), bool)
    held[-1] = not free
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    panels = Sheet.of_cells(cells, material=material, springs=springs, pinned=held)
    flat = panels.flat() - [0.5, 1.0, 0.0]
    flat[middle:, :, 1] -= SPACING
    columns = np.arange(SIDE)
    ends = [np.stack([np.full(SIDE, row), columns], axis=-1) for row in (middle - 1, middle)]
    return panels, Ties(panels, np.stack(ends, axis=1), np.tile([1.0, -1.0], (SIDE, 1))), flat, middle


@pytest.mark.slow  # for its kernel
def test_a_seam_moves_as_the_cloth_without_it() -> None:
    """A swing of two panels sewn together, threads that cannot be stretched, against one of whole cloth: the seam stays
    closed, and the cloth is within half a millimetre, which is about what its steps cost."""
    panels, seam, flat, middle = sewn_panels()
    sewn = simulation(
        panels, np.stack([flat[..., 0], 0.0 * flat[..., 0], -1.0 - flat[..., 1]], -1), constraints=(seam,)
    )
    sheet = sheet_of(times(1e4), pinned=(-1, slice(None)))
    whole = simulation(sheet, level(sheet))
    for _ in range(30):
        sewn.step()
        whole.step()
        assert seam.gaps(sewn.state).max() < 5e-4
    apart = np.linalg.norm(np.delete(sewn.positions, middle, axis=0) - whole.positions, axis=-1)
    assert apart.max() < 1e-3
    assert np.sqrt((apart**2).mean()) < 5e-4


@pytest.mark.slow  # the same
def test_a_seam_learns_as_fast_as_it_moves() -> None:
    """Two panels that part at 0.2 m/s without weight, and travel together, which changes nothing else: what their seam
    has learnt after a frame grows with their speed, up to MOVING."""
    learnt = []
    for speed in (0.0, 0.5 * MOVING, MOVING, 3 * MOVING):
        panels, seam, flat, middle = sewn_panels(free=True)
        start = np.zeros_like(flat)
        start[middle:, :, 1], start[..., 2] = 0.2, speed
        none = replace(FAR, gravity=(0.0, 0.0, 0.0))
        moving = Simulation(
            panels, Yarns(panels, none, constraints=(seam,)), forces=none, positions=flat, velocities=start
        )
        moving.step()
        learnt.append(np.linalg.norm(seam.pushes(moving.state), axis=0).mean())
    still, half, _, fast = np.array(learnt) / learnt[2]
    assert still < 0.45
    assert 0.45 < half < 0.75
    assert 0.95 < fast < 1.3


@pytest.mark.slow  # the same
def test_what_hangs_on_a_seam_stretches_no_thread_and_is_not_shaken(tmp_path: Path) -> None:
    """A curtain of twenty times its weight with a seam across, moved a little: once it is known what the seam is pushed
    by, threads are as long as those of whole cloth but for the share of a cell that is not learnt (a seam that finds
    its push anew in each substep leaves 0.7 %), and key points as slow.
    A run that is taken up again knows it too, and one that begins with the same pushes."""
    panels, seam, flat, _ = sewn_panels()
    flat[..., 2] = 2e-3 * np.sin(7 * flat[..., 0]) * np.sin(5 * flat[..., 1])
    sheet = sheet_of(times(1e4), pinned=(-1, slice(None)))
    hanging = sheet.flat() - [0.5, 1.0, 0.0]
    hanging[..., 2] = 2e-3 * np.sin(7 * hanging[..., 0]) * np.sin(5 * hanging[..., 1])
    heavy = replace(FAR, gravity=(0.0, -196.2, 0.0))
    sewn, whole = simulation(panels, flat, heavy, constraints=(seam,)), simulation(sheet, hanging, heavy)
    speeds = []
    for frame in range(60):
        before = sewn.positions, whole.positions
        sewn.step()
        whole.step()
        both = zip((sewn, whole), before, strict=True)
        speeds.append([np.sqrt(((one.positions - old) ** 2).sum(-1).mean()) for one, old in both])
        if frame == 50:
            sewn.save(tmp_path / "state.npz")
    mine, plain = np.array(speeds[30:]).mean(axis=0)
    assert mine < 1.2 * plain
    assert largest(panels, sewn.positions) < largest(sheet, whole.positions) + LEARNT
    again = simulation(panels, flat, heavy, constraints=(seam,))
    again.restore(tmp_path / "state.npz")
    for _ in range(9):
        again.step()
    assert np.array_equal(again.state.values, sewn.state.values)
    jerks = []
    for known in (seam.pushes(sewn.state), None):
        begun = simulation(panels, sewn.positions, heavy, constraints=(seam,))
        if known is not None:
            seam.push(begun.state, known)
        begun.step()
        jerks.append(largest(panels, begun.positions))
    assert jerks[0] < largest(sheet, whole.positions) + LEARNT
    assert jerks[1] > 1.8 * jerks[0]


@pytest.mark.slow  # the same
def test_what_a_seam_asks_at_once_is_shared_among_a_few_threads_of_a_yarn() -> None:
    """A curtain of two hundred times its weight with a seam across, whose push is not known when it starts: no thread
    beside the seam is longer than such a thread may be (without that the last ones are by 7.6 %); and it is closed."""
    panels, seam, flat, _ = sewn_panels()
    heavy = replace(FAR, gravity=(0.0, -1962.0, 0.0))
    sewn = simulation(panels, flat, heavy, constraints=(seam,))
    sewn.step()
    assert 0.9 * LONGEST < largest(panels, sewn.positions) < 1.1 * LONGEST
    assert seam.gaps(sewn.state).max() < 1e-4


def test_a_thread_is_too_long_beyond_what_its_crimp_leaves_it_beside_ties() -> None:
    """From 2.95 % on; of crimp that gives 3 % by itself a hair later, as ties leave it that."""
    for crimp, most in ((0.02, LONG), (0.03, SLACK * (0.03 + 20.0 / 1e5))):
        sheet = sheet_of(replace(CLOTH, drawn_warp=1e5, crimp_warp=crimp))
        assert longest_beside(sheet.material)[1] == pytest.approx(crimp + (50.0 - 1000.0 * crimp) / 1e5)
        weft, warp = (family.numbers[0]["long"] for family in Yarns(sheet, FAR).families())
        assert (weft, warp) == pytest.approx((SPACING * LONG, SPACING * most))


def test_it_falls_as_all_falls() -> None:
    sheet = sheet_of(times(1e4))
    falling = simulation(sheet, level(sheet), frame_rate=60.0)
    for _ in range(30):
        falling.step()
    assert falling.positions[..., 1].mean() == pytest.approx(-9.81 * 0.5**2 / 2, rel=1e-5)
    assert np.ptp(falling.positions[..., 1]) < 1e-4


@pytest.mark.parametrize("stiff", [1.0, 1e4, 1e8])
def test_a_shaken_sheet_keeps_its_momentum_and_makes_no_energy(stiff: float) -> None:
    """Free, without weight: linear momentum to 1e-6 of Σ m |v|, angular to 1e-5. The energy of stiff threads is not
    told from float32 positions, and left out."""
    sheet = sheet_of(times(stiff))
    start = level(sheet) + RNG.standard_normal((SIDE, SIDE, 3)) * 1e-3 * SPACING
    speeds = 0.1 + np.cross([0.0, 2.0, 0.5], start - start.mean(axis=(0, 1))) + RNG.standard_normal(start.shape) * 0.02
    weightless = replace(FAR, gravity=(0.0, 0.0, 0.0))
    shaken = Simulation(sheet, Yarns(sheet, weightless), forces=weightless, positions=start, velocities=speeds)
    m, out = sheet.mass[..., None], []
    for _ in range(20):
        v = sheet.steps(shaken.state).astype(float) / shaken.solver.step
        x = shaken.positions.astype(float) - v * shaken.solver.step / 2
        elastic = elastic_energy(sheet if stiff == 1 else softened(sheet), x)
        out.append(((m * v).sum((0, 1)), (m * np.cross(x, v)).sum((0, 1)), elastic + kinetic_energy(sheet, v)))
        shaken.step()
    linear, angular, energy = (np.array(part) for part in zip(*out, strict=True))
    assert np.abs(linear - linear[0]).max() < 1e-6 * (m * np.abs(speeds)).sum()
    assert np.abs(angular - angular[0]).max() < 1e-5 * np.abs(angular[0]).max()
    assert energy.max() == energy[0]


@pytest.fixture(scope="module")
def swings() -> dict[float, Simulation]:
    """A sheet held along one edge and let go level, after half a second, by how stiff it is."""
    out = {}
    for stiff in (1e4, 1e6):
        sheet = sheet_of(times(stiff), pinned=(-1, slice(None)))
        out[stiff] = simulation(sheet, level(sheet))
        for _ in range(30):
            out[stiff].step()
    return out


def test_threads_that_cannot_be_stretched_move_alike(swings: dict[float, Simulation]) -> None:
    apart = np.linalg.norm(swings[1e6].positions - swings[1e4].positions, axis=-1)
    assert apart.max() < 1e-3
    assert swings[1e6].solver.substeps == swings[1e4].solver.substeps


def test_a_swing_keeps_its_energy() -> None:
    """Without drag, of a sheet whose threads cannot be stretched, until its end whips round: within 1 %. Kinetic energy
    is of the middle of a step, so is what it is told beside."""
    sheet = sheet_of(times(1e4), pinned=(-1, slice(None)))
    swing = simulation(sheet, level(sheet))
    soft = softened(sheet)
    for _ in range(30):
        swing.step()
        positions, steps = swing.positions.astype(float), sheet.steps(swing.state).astype(float)
        fallen = 9.81 * (sheet.mass * (positions - steps / 2)[..., 1]).sum()
        moving = 0.5 * (sheet.mass[..., None] * (steps / swing.solver.step) ** 2).sum()
        assert moving + fallen + elastic_energy(soft, positions) == pytest.approx(0.0, abs=0.01 * abs(fallen) + 1e-5)


def test_a_swing_is_that_of_springs_with_many_steps(swings: dict[float, Simulation]) -> None:
    """Against Verlet at 100 × in its own, short steps: all key points, and the lowest, which is that of a whip."""
    sheet = sheet_of(times(100.0), pinned=(-1, slice(None)))
    own = simulation(sheet, level(sheet))
    other = Simulation(
        sheet, Verlet(sheet, FAR), forces=FAR, positions=level(sheet), pins=(Pins(sheet.pinned),)
    )  # 7 times the substeps
    for _ in range(30):
        own.step()
        other.step()
    assert other.solver.substeps > 6 * own.solver.substeps
    assert abs(own.positions[..., 1].min() - other.positions[..., 1].min()) < 5e-3
    assert np.linalg.norm(own.positions - other.positions, axis=-1).mean() < 1.5e-3


def test_a_drape_falls_as_springs_with_many_steps_do() -> None:
    """Mean height of a sheet that falls on a ball with friction and folds round it, against Verlet at 100 ×: single key
    points part like weather, their mean does not: within 5 mm of a fall of 290 mm, 2.5 rms."""
    sheet = sheet_of(times(100.0))
    ball = replace(FAR, sphere=Sphere(centre=(0.0, -0.3, -0.5), radius=0.25, friction=0.3))
    falls = [Simulation(sheet, kind(sheet, ball), forces=ball, positions=level(sheet)) for kind in (Yarns, Verlet)]
    apart = []
    for _ in range(30):
        for fall in falls:
            fall.step()
        apart.append(falls[0].positions[..., 1].mean() - falls[1].positions[..., 1].mean())
    assert falls[1].positions[..., 1].mean() < -0.25
    assert np.abs(apart).max() < 8e-3
    assert np.square(apart).mean() ** 0.5 < 4e-3
    assert falls[1].solver.substeps > 6 * falls[0].solver.substeps


def test_a_hanging_sheet_is_as_long_as_its_law_says() -> None:
    """Soft until its crimp is drawn out, then stiff: strain at a height from the weight below it."""
    bent = replace(
        CLOTH, tensile_warp=50.0, tensile_weft=50.0, drawn_warp=5000.0, drawn_weft=5000.0, crimp_warp=0.01,
        crimp_weft=0.01, shear=0.01, bending_warp=1e-8, bending_weft=1e-8, air_damping=20.0,
    )  # fmt: skip
    sheet = sheet_of(bent, pinned=(-1, slice(None)))
    hanging = simulation(sheet, upright(sheet))
    for _ in range(90):
        hanging.step()
    strain = sheet.stretch(hanging.positions.astype(float))[1].mean(axis=1)
    below = (np.arange(SIDE - 1) + 0.5) * SPACING  # of the middle of each thread, from the lower edge
    pull = 0.15 * 9.81 * below
    law = np.where(pull < 50.0 * 0.01, pull / 50.0, 0.01 + (pull - 50.0 * 0.01) / 5000.0)
    assert np.abs(strain - law).max() < 2e-4


def test_a_strain_limit_holds() -> None:
    soft = replace(CLOTH, tensile_warp=20.0, tensile_weft=20.0, shear=5.0, air_damping=5.0)
    sheet = sheet_of(soft, pinned=(-1, slice(None)))
    held = simulation(sheet, upright(sheet), replace(FAR, strain_limit=StrainLimit(strain=0.01, passes=1)))
    most = 0.0
    for frame in range(60):
        held.step()
        most = max(most, largest(sheet, held.positions)) if frame > 5 else 0.0
    assert 0.009 < most < 0.011


def test_a_taut_string_gets_the_steps_it_needs() -> None:
    """A load that would make the wave along the threads too quick for the step of the soft springs: the frame is taken
    again with shorter ones, and where the load has gone they are long again."""
    sheet = sheet_of(replace(times(1e4), air_damping=1.0, shear=5.0), pinned=(-1, slice(None)))
    heavy = replace(FAR, gravity=(0.0, -20_000.0, 0.0))
    loaded = simulation(sheet, upright(sheet), heavy)
    first = loaded.solver.substeps
    for _ in range(10):
        loaded.step()
    solver = loaded.solver
    assert isinstance(solver, Yarns)
    assert solver.substeps > 1.5 * first
    assert solver.tight <= TIGHTEST
    assert largest(sheet, loaded.positions) < 1e-3
    calm = simulation(sheet, upright(sheet))
    calm.solver.go_on((solver.substeps,))
    for _ in range(10):
        calm.step()
    assert calm.solver.substeps < 1.3 * first


def test_what_moves_the_ends_of_threads_after_their_yarn_is_seen() -> None:
    """Threads that gravity draws by up to a tenth are as long as they pull. A key point that is then moved by 4 % of
    its thread leaves the thread so much longer than that, and the next as much shorter, which is no matter."""
    sheet = sheet_of(replace(CLOTH, tensile_warp=18.0, tensile_weft=18.0, air_damping=8.0), pinned=(-1, slice(None)))
    hung = simulation(sheet, upright(sheet))
    for _ in range(120):
        hung.step()
    solver = hung.solver
    assert isinstance(solver, Yarns)
    assert 0.08 < largest(sheet, hung.positions) < 0.12
    assert solver.unsolved < 2e-3
    assert solver.sweeps == 2
    frame = solver._filled(hung.state)
    place = (SIDE - 3 + PAD) * sheet.width + SIDE // 2
    frame.position[1][place] -= 0.04 * SPACING  # pyright: ignore[reportIndexIssue]
    assert abs(frame.unsolved() - 0.04) < 2e-3


def test_a_frame_gets_more_sweeps_while_they_gain() -> None:
    """Of what is left after each frame: taken again with a sweep more as long as that brings it below GAIN, at most
    MOST_SWEEPS; for a while one that gained nothing is not tried again, and a sweep goes where no other gains."""
    solver = simulation(sheet_of(), level(sheet_of())).solver
    assert isinstance(solver, Yarns)

    def ask(*left: float, still: bool = False) -> list[bool]:
        out = []
        for solver.unsolved in left:
            out.append(solver._sweep_more(still))
        return out

    assert ask(0.0, 0.5 * UNSOLVED) == [False, False]
    assert (ask(0.05, 0.03, 0.005), solver.sweeps) == ([True, True, False], 4)
    for sweeps in (3, 2, 2):
        ask(*[0.0] * ceil(CALM * solver.frame_rate))
        assert solver.sweeps == sweeps
    calm, stays = [0.0] * ceil(CALM * solver.frame_rate), [0.0] * ceil(STAYS * solver.frame_rate)
    assert (ask(0.05, 0.005, *calm, still=True), solver.sweeps) == ([True, False] + [False] * len(calm), 3)
    assert (ask(*stays, still=True), solver.sweeps) == ([False] * len(stays), 2)  # of what lies still it stays
    assert (ask(0.05, 0.048), solver.sweeps) == ([True, False], 2)
    waiting = [False] * ceil(FUTILE * solver.frame_rate)
    assert ask(*[0.05] * len(waiting)) == waiting
    assert ask(0.1, 0.08, 0.06, 0.05, 0.04) == [True, True, True, True, False]
    assert solver.sweeps == MOST_SWEEPS == solver.numbers["sweeps"]
    # What so many leave unsolved is held against one less, in time, and where that leaves no more they end.
    seen = []
    for _ in range(ceil(5 * (CALM + FUTILE) * solver.frame_rate)):
        while ask(0.04)[0]:
            pass
        seen.append(solver.sweeps)
    assert list(dict.fromkeys(seen)) == [6, 5, 4, 3, 2]
    assert seen == sorted(seen, reverse=True)
    while not ask(0.04)[0]:
        pass
    assert (ask(0.039), solver.sweeps) == ([False], 2)  # given up
    assert ask(0.04, 0.045) == [False, True]  # until more is left than then
    assert (ask(0.044), solver.sweeps) == ([False], 2)
    assert ask(0.045) == [False]
    other = simulation(sheet_of(), level(sheet_of())).solver
    other.go_on(solver.found)
    assert other.found == solver.found
    other.go_on((solver.substeps + 2,))
    assert other.found == (solver.substeps + 2, *solver.found[1:])


def test_a_frame_that_is_taken_again_keeps_the_steps_that_its_start_is_told_in() -> None:
    """Where fewer steps would do and more sweeps are wanted at once; then fewer, once sweeps do."""
    moves = simulation(sheet_of(), level(sheet_of()))
    solver, before, after = moves.solver, moves.state, moves.state.copy()
    assert isinstance(solver, Yarns)
    fewer = solver.substeps
    solver._go_over(before, 2 * fewer)
    start, solver.tight = before.values.copy(), 0.0
    solver.unsolved = 0.05
    assert (solver.shorten(before, after), solver.substeps) == (True, 2 * fewer)
    assert np.array_equal(before.values, start)
    solver.unsolved = 0.0
    assert not solver.shorten(before, after)
    assert solver.substeps < 2 * fewer


def test_a_pull_that_no_steps_follow_is_refused() -> None:
    """Never passed on: the state is that before the frame."""
    sheet = sheet_of(replace(times(1e6), air_damping=1.0, shear=5.0), pinned=(-1, slice(None)))
    loaded = simulation(sheet, upright(sheet), replace(FAR, gravity=(0.0, -2e8, 0.0)))
    before = loaded.positions
    with pytest.raises(Unstable, match=r"pulled by .* N/m, and more than 4096 substeps .* no cloth carries that"):
        loaded.step()
    assert loaded.solver.substeps == 4096
    np.testing.assert_array_equal(loaded.positions, before)


@pytest.mark.parametrize(("slope", "slides"), [(0.25, False), (0.35, True)])
def test_friction_on_a_slope_is_coulombs(slope: float, slides: bool) -> None:
    """µ = 0.3 holds on a slope of 0.25 and lets go at 0.35, with the right acceleration, whatever the sweeps."""
    tilt = np.arctan(slope)
    gravity = tuple(9.81 * np.array([np.sin(tilt), -np.cos(tilt), 0.0]))
    floor = Plane(height=-0.001, friction=0.3, gap=0.001)
    sheet = sheet_of(times(1e3))
    lying = simulation(sheet, level(sheet), replace(FAR, gravity=gravity, plane=floor), sweeps=3)
    start = lying.positions[..., 0].mean()
    for _ in range(30):
        lying.step()
    moved = lying.positions[..., 0].mean() - start
    expected = 0.5 * 9.81 * (np.sin(tilt) - 0.3 * np.cos(tilt)) * 0.5**2 if slides else 0.0
    assert moved == pytest.approx(expected, abs=2e-4 + 0.01 * abs(expected))


def test_a_run_that_was_saved_goes_on_to_the_same_bytes(tmp_path) -> None:
    sheet = sheet_of(replace(times(1e3), air_damping=1.0), pinned=(-1, slice(None)))
    whole, half = (simulation(sheet, level(sheet)) for _ in range(2))
    for _ in range(4):
        whole.step()
    for _ in range(2):
        half.step()
    half.save(tmp_path / "state.npz")
    rest = simulation(sheet, level(sheet))
    rest.restore(tmp_path / "state.npz")
    for _ in range(2):
        rest.step()
    assert rest.state.values.tobytes() == whole.state.values.tobytes()
    with pytest.raises(InputError, match="another"):
        simulation(sheet, level(sheet), sweeps=1).restore(tmp_path / "state.npz")


def test_two_threads_leave_the_bytes_of_one() -> None:
    """Groups of yarns share nothing, whoever of the crew solves them. With chains, as all kernels of them here are for
    two threads: one of them goes through it alone, too."""
    sheet = sheet_of(times(1e3), pinned=(-1, slice(None)))
    one, two = (simulation(sheet, level(sheet), chains=True, threads=2) for _ in range(2))
    assert isinstance(one.solver, Yarns)
    assert isinstance(two.solver, Yarns)
    one.solver._pace, two.solver._pace = Pace(1), AllOfThem(2)
    for _ in range(3):
        one.step()
        two.step()
    assert two.state.values.tobytes() == one.state.values.tobytes()


def test_verlet_says_what_a_curve_needs() -> None:
    with pytest.raises(InputError, match='need "yarns"'):
        Verlet(sheet_of(replace(CLOTH, drawn_warp=1e5, crimp_warp=0.02)), FAR)
    with pytest.raises(InputError, match="drawn_weft: 10 N/m; allowed: at least its 800 N/m"):
        replace(CLOTH, drawn_weft=10.0)
